//! Keypoints that several matchers describe are found once per image, and kept on disk.
//!
//! Each matcher is charged as if it were alone: the seconds of the detection are kept with the keypoints,
//! and added to the time of each matcher that uses them. The time spent with files is subtracted.

use std::time::Instant;

use matchbench_vision::features::{Detections, Detector, Keypoint};
use matchbench_vision::image::GrayImage;

use crate::cache::{FeatureCache, Key, SaveError, lie_in};

/// The keypoints of one image, kept in the cache under a `key`; without one they are not shared.
pub(super) struct KeptDetections<'a> {
    cache: &'a FeatureCache,
    key: Option<Key>,
    begin: Instant,
    /// Seconds to be added to what the clock of the extraction says.
    elsewhere: f64,
    saved: Result<(), SaveError>,
}

impl<'a> KeptDetections<'a> {
    /// To be made when the extraction begins.
    pub(super) fn new(cache: &'a FeatureCache, key: Option<Key>) -> Self {
        Self {
            cache,
            key,
            begin: Instant::now(),
            elsewhere: 0.0,
            saved: Ok(()),
        }
    }

    /// The seconds to be added to what the clock of the extraction says: those of the detection, if
    /// it was done before, without those spent with files. And whether the cache could be written.
    pub(super) fn finish(self) -> (f64, Result<(), SaveError>) {
        (self.elsewhere, self.saved)
    }
}

impl KeptDetections<'_> {
    /// The keypoints of an earlier extraction, if they are believed.
    fn recall_if(&mut self, believed: impl FnOnce(&[Keypoint]) -> bool) -> Option<Vec<Keypoint>> {
        let begin = Instant::now();
        let found = self.key.and_then(|key| self.cache.load_keypoints(key));
        let found = found.filter(|(keypoints, _)| believed(keypoints));
        self.elsewhere -= begin.elapsed().as_secs_f64();
        let (keypoints, seconds) = found?;
        self.elsewhere += seconds;
        Some(keypoints)
    }
}

impl Detections for KeptDetections<'_> {
    fn recall(&mut self) -> Option<Vec<Keypoint>> {
        self.recall_if(|_| true)
    }

    /// Keypoints that do not lie in the image are none that were found in it.
    fn recall_or_detect(&mut self, detector: &dyn Detector, image: &GrayImage) -> Vec<Keypoint> {
        let known = self.recall_if(|keypoints| lie_in(keypoints, image.size()));
        known.unwrap_or_else(|| {
            let keypoints = detector.detect(image);
            self.remember(&keypoints);
            keypoints
        })
    }

    fn remember(&mut self, keypoints: &[Keypoint]) {
        let Some(key) = self.key else { return };
        let seconds = self.begin.elapsed().as_secs_f64() + self.elsewhere;
        let begin = Instant::now();
        self.saved = self.cache.save_keypoints(key, keypoints, seconds);
        self.elsewhere -= begin.elapsed().as_secs_f64();
    }
}

#[cfg(test)]
mod tests {
    use std::fs;
    use std::sync::Arc;
    use std::sync::atomic::{AtomicUsize, Ordering};
    use std::time::Duration;

    use matchbench_vision::features::{
        Describer, DescriptorKind, Descriptors, DetectThenDescribe, Features, FloatRows,
    };
    use matchbench_vision::image::Size;
    use matchbench_vision::matching::{NearestNeighbours, Pipeline};
    use serde_json::json;

    use super::super::frame::FrameStage;
    use super::super::testing::{dataset, decode};
    use super::*;
    use crate::datasets::{Turn, decode_gray};
    use crate::matchers::{BuiltMatcher, Extraction};
    use crate::records::images::ImageNotes;

    const DETECTION: Duration = Duration::from_millis(50);

    /// Finds a keypoint for each row, slowly, and counts how often.
    struct Slow(Arc<AtomicUsize>);

    impl Detector for Slow {
        fn detect(&self, image: &GrayImage) -> Vec<Keypoint> {
            self.0.fetch_add(1, Ordering::Relaxed);
            std::thread::sleep(DETECTION);
            let keypoint = |y: usize| Keypoint {
                at: [0.0, y as f32].into(),
                size: 1.0,
                angle: None,
                response: 1.0,
                octave: 0,
            };
            (0..image.height()).map(keypoint).collect()
        }
    }

    /// Describes by a constant.
    struct Constant(f32);

    impl Describer for Constant {
        fn kind(&self) -> DescriptorKind {
            DescriptorKind::Float { dim: 1 }
        }

        fn describe(&self, _: &GrayImage, keypoints: &mut Vec<Keypoint>) -> Descriptors {
            Descriptors::Float(FloatRows::from_vec(1, vec![self.0; keypoints.len()]))
        }
    }

    /// A matcher that describes by `value` what a detector with the parameter `threshold` finds.
    fn matcher(value: f32, threshold: Option<i32>, count: &Arc<AtomicUsize>) -> BuiltMatcher {
        let extraction = |extractor: &str, params| Extraction {
            extractor: extractor.into(),
            params,
            revision: 1,
        };
        BuiltMatcher {
            id: "constant".into(),
            params: json!({}),
            extraction: extraction("constant", json!({"value": value, "threshold": threshold})),
            detection: threshold.map(|t| extraction("rows", json!({"threshold": t}))),
            matcher: Box::new(Pipeline {
                extractor: Box::new(DetectThenDescribe {
                    detector: Slow(Arc::clone(count)),
                    describer: Constant(value),
                }),
                search: Box::new(NearestNeighbours),
                selectors: vec![],
            }),
        }
    }

    #[test]
    fn a_detector_runs_once_per_image_and_all_its_matchers_are_charged() {
        let folder = tempfile::tempdir().unwrap();
        let frames = dataset(folder.path(), "street", 2).sequence.frames;
        let images = ImageNotes::open(folder.path(), "street").unwrap().into();
        let cache = FeatureCache::new(folder.path().join("cache"));
        let count = Arc::default();
        let mut keypoints = Vec::new();
        for (value, threshold, detections) in [
            (1.0, Some(20), 2),
            (2.0, Some(20), 2),
            (2.0, Some(30), 4),
            (2.0, None, 6),
            (3.0, None, 8),
            (3.0, Some(20), 8),
        ] {
            let matcher = matcher(value, threshold, &count);
            let stage = FrameStage {
                matcher: &matcher,
                cache: &cache,
                decode,
                images: &images,
            };
            for (index, frame) in (0..).zip(&frames) {
                let extracted = stage.extract(index, frame).unwrap();
                let seconds = extracted.seconds.expect("described now");
                assert!(seconds >= DETECTION.as_secs_f64(), "{seconds} s");
                let features = extracted.features.unwrap();
                assert_eq!(features.descriptors.len(), 8);
                keypoints.push(features.keypoints);
            }
            let counted = count.load(Ordering::Relaxed);
            assert_eq!(counted, detections, "{value} {threshold:?}");
        }
        assert!(keypoints.iter().all(|found| *found == keypoints[0]));
    }

    #[test]
    fn what_is_kept_of_another_image_is_found_anew() {
        let folder = tempfile::tempdir().unwrap();
        let mut frame = dataset(folder.path(), "street", 1)
            .sequence
            .frames
            .remove(0);
        let size = Size::new(12, 8);
        let pixels = [b"P5 12 8 255\n".to_vec(), vec![7; size.area()]].concat();
        fs::write(&frame.image, &pixels).unwrap();
        // The size is that of the image as it is turned.
        frame.turn = Turn::Quarter;
        let images = ImageNotes::open(folder.path(), "street").unwrap().into();
        let cache = FeatureCache::new(folder.path().join("cache"));
        let count = Arc::default();
        let matcher = matcher(1.0, Some(20), &count);
        let stage = FrameStage {
            matcher: &matcher,
            cache: &cache,
            decode: |file| decode_gray(file).map_err(|error| error.to_string()),
            images: &images,
        };
        let extract = || stage.extract(0, &frame).unwrap().features.unwrap();
        let counted = || count.swap(0, Ordering::Relaxed);
        let sound = extract();
        assert_eq!((sound.size, sound.len()), (Size::new(8, 12), 12));
        assert_eq!((counted(), extract() == sound, counted()), (1, true, 0));
        let key = |extraction| Key::new(&pixels, frame.turn.into(), extraction);
        let described = key(&matcher.extraction);
        let found = key(matcher.detection.as_ref().unwrap());
        let save = |size, keypoints: &[Keypoint]| {
            let forged = Features::new(size, keypoints.to_vec(), sound.descriptors.clone());
            cache.save(described, &forged).unwrap();
        };
        let mut outside = sound.keypoints.clone();
        for (x, y) in [(8.5, 3.0), (3.0, -1.5), (-1e30, 3.0), (3.0, 12.5)] {
            outside[5].at = [x, y].into();
            save(sound.size, &outside);
            assert!(extract() == sound, "{x} {y}");
            assert_eq!(counted(), 0, "the keypoints are kept beside");
            cache.save_keypoints(found, &outside, 0.5).unwrap();
            save(sound.size, &outside);
            assert!(extract() == sound, "{x} {y}");
            assert_eq!(counted(), 1);
        }
        save(Size::new(1 << 40, 1 << 20), &sound.keypoints);
        assert!(extract() == sound);
        save(sound.size, &sound.keypoints[..]);
        assert!(extract() == sound);
        assert_eq!(counted(), 0);
    }

    #[test]
    fn features_and_keypoints_that_cannot_be_kept_are_there_nevertheless() {
        let folder = tempfile::tempdir().unwrap();
        let frames = dataset(folder.path(), "street", 1).sequence.frames;
        let images = ImageNotes::open(folder.path(), "street").unwrap().into();
        let file = folder.path().join("file");
        fs::write(&file, "").unwrap();
        let stage = FrameStage {
            matcher: &matcher(1.0, Some(20), &Arc::default()),
            cache: &FeatureCache::new(&file),
            decode,
            images: &images,
        };
        let extracted = stage.extract(0, &frames[0]).unwrap();
        assert_eq!(extracted.features.unwrap().len(), 8);
        let [keypoints, features] = &extracted.unkept[..] else {
            panic!("{:?}", extracted.unkept);
        };
        assert!(keypoints.contains(".keypoints: "), "{keypoints}");
        assert!(features.contains(".features: "), "{features}");
    }

    #[test]
    fn damaged_keypoints_are_found_again() {
        let folder = tempfile::tempdir().unwrap();
        let cache = FeatureCache::new(folder.path());
        let key = Key([3; 32]);
        let mut detections = KeptDetections::new(&cache, Some(key));
        assert_eq!(detections.recall(), None);
        detections.remember(&[]);
        assert_eq!(detections.recall(), Some(vec![]));
        detections.finish().1.unwrap();
        let file = fs::read_dir(folder.path().join("03")).unwrap().next();
        fs::write(file.unwrap().unwrap().path(), b"torn").unwrap();
        let mut detections = KeptDetections::new(&cache, Some(key));
        assert_eq!(detections.recall(), None);
    }
}
