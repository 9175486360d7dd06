//! From an image file to features: decoded and extracted, or taken from the cache.

use std::path::Path;
use std::sync::{Mutex, MutexGuard, PoisonError};

use matchbench_vision::features::Features;
use matchbench_vision::image::{GrayImage, Size};

use super::RunError;
use super::detections::KeptDetections;
use super::guard::{Broken, guard, timed};
use crate::cache::{FeatureCache, Key, SaveError, are_of};
use crate::datasets::{Frame, size_of_image};
use crate::files::read_file;
use crate::front_door::{SETTINGS, THREADS};
use crate::matchers::BuiltMatcher;
use crate::memory::{Reserved, reserve};
use crate::records::images::ImageNotes;

/// Turns the bytes of an image file into pixels, or says why it cannot.
pub type Decode = fn(&[u8]) -> Result<GrayImage, String>;

/// The stage that is done once per frame.
pub(super) struct FrameStage<'a> {
    pub(super) matcher: &'a BuiltMatcher,
    pub(super) cache: &'a FeatureCache,
    pub(super) decode: Decode,
    /// The images that the records of the run are of.
    pub(super) images: &'a Mutex<ImageNotes>,
}

/// What a frame came to.
#[derive(Debug)]
pub(super) struct Extracted {
    /// The features, or why there are none: the pairs of this frame fail for the same reason.
    pub(super) features: Result<Features, Broken>,
    /// The pixels, where there are features and the matcher [uses](matchbench_vision::matching::Matcher::uses_pixels)
    /// pixels of pairs.
    pub(super) pixels: Option<GrayImage>,
    /// How long the extraction took, if it was done: also the part of it, the detection, that an
    /// earlier matcher did.
    pub(super) seconds: Option<f64>,
    /// Why files of the cache could not be written, where some were: what is in them is extracted again when it is needed
    /// again.
    pub(super) unkept: Vec<String>,
    /// The content of the image, where there are features: it is to be noted.
    pub(super) hash: Option<blake3::Hash>,
}

impl FrameStage<'_> {
    /// The features of `frame`, which has this `index`.
    ///
    /// # Errors
    /// If a link is in the cache, or the image is another than the run has worked with. An image that cannot be read is not
    /// an error, and a cache that cannot be written neither.
    pub(super) fn extract(&self, index: u32, frame: &Frame) -> Result<Extracted, RunError> {
        let (mut seconds, mut noted, mut unkept) = (None, None, Vec::new());
        let described = match read(&frame.image) {
            Err(reason) => Err(reason),
            Ok(file) => {
                let hash = blake3::hash(&file);
                lock(self.images).check(index, &frame.image, hash)?;
                let key = Key::new(&file, frame.turn.into(), &self.matcher.extraction);
                let described = match self.known(key, frame, &file) {
                    Some(features) => self.pixels(frame, &file).map(|pixels| (features, pixels)),
                    None => self.compute(frame, &file, key, &mut seconds, &mut unkept)?,
                };
                noted = described.is_ok().then_some(hash);
                described
            }
        };
        let (features, pixels) = match described {
            Ok((features, pixels)) => (Ok(features), pixels),
            Err(reason) => (Err(reason), None),
        };
        Ok(Extracted {
            features,
            pixels,
            seconds,
            unkept,
            hash: noted,
        })
    }

    /// The features that are in the cache, unless they have other descriptors than the matcher makes or are of an image of
    /// another size: then they are as good as damaged, whatever their checksum says.
    fn known(&self, key: Key, frame: &Frame, file: &[u8]) -> Option<Features> {
        let made = self.matcher.matcher.descriptors();
        let features = self.cache.load(key)?;
        // What another decoder reads may have no header that is known here.
        let size = size_of_image(file).map_or(features.size, |size| frame.turn.size(size));
        let is_made = made.is_none_or(|made| made == features.descriptors.kind());
        (is_made && are_of(&features, size)).then_some(features)
    }

    /// The pixels of a frame whose features are known, if they are still needed.
    fn pixels(&self, frame: &Frame, file: &[u8]) -> Result<Option<GrayImage>, Broken> {
        let uses_pixels = self.matcher.matcher.uses_pixels();
        uses_pixels
            .then(|| decode(self.decode, frame, file))
            .transpose()
    }

    fn compute(
        &self,
        frame: &Frame,
        file: &[u8],
        key: Key,
        seconds: &mut Option<f64>,
        unkept: &mut Vec<String>,
    ) -> Result<Result<(Features, Option<GrayImage>), Broken>, RunError> {
        let image = match decode(self.decode, frame, file) {
            Ok(image) => image,
            Err(reason) => return Ok(Err(reason)),
        };
        let _memory = match self.memory_for(frame, &image) {
            Ok(reserved) => reserved,
            Err(reason) => return Ok(Err(reason)),
        };
        let path = frame.image.display();
        let what = format_args!("extraction from {path}");
        let shared = self.matcher.detection.as_ref();
        let shared = shared.map(|detection| Key::new(file, frame.turn.into(), detection));
        let mut detections = KeptDetections::new(self.cache, shared);
        let features = timed(seconds, || {
            let matcher = &self.matcher.matcher;
            guard(what, || matcher.extract_sharing(&image, &mut detections))
        });
        let (elsewhere, saved) = detections.finish();
        go_without(saved, unkept)?;
        *seconds = seconds.map(|seconds| seconds + elsewhere);
        if let Ok(features) = &features {
            go_without(self.cache.save(key, features), unkept)?;
        }
        let pixels = self.matcher.matcher.uses_pixels().then_some(image);
        Ok(features
            .map(|features| (features, pixels))
            .map_err(Broken::from))
    }
}

impl FrameStage<'_> {
    /// The memory that the extraction will take; there may be more another time.
    fn memory_for(&self, frame: &Frame, image: &GrayImage) -> Result<Reserved<'static>, Broken> {
        let needed = self.matcher.matcher.extraction_memory(image.size());
        reserve(needed).map_err(|missing| {
            let smaller = SETTINGS.with(&format!("{}.extractor.max_size=N", self.matcher.id));
            Broken::for_now(format!(
                "extraction from {} ({} pixels) was not begun: {missing}; use smaller images ({smaller}) or \
                 fewer {THREADS}, free memory, or set MATCHBENCH_MAX_MEMORY",
                frame.image.display(),
                image.size(),
            ))
        })
    }
}

/// Notes what the cache could not keep. Only that somebody has put a link into it is an error.
fn go_without(saved: Result<(), SaveError>, unkept: &mut Vec<String>) -> Result<(), RunError> {
    match saved {
        Err(SaveError::Link(error)) => return Err(error.into()),
        Err(SaveError::Unwritable(error)) => unkept.push(error.to_string()),
        Ok(()) => {}
    }
    Ok(())
}

/// How large the image of a frame is.
pub(super) fn size(frame: &Frame) -> Result<Size, Broken> {
    frame
        .size()
        .map_err(|error| Broken::for_now(error.to_string()))
}

/// The notes, one thread at a time.
pub(super) fn lock(images: &Mutex<ImageNotes>) -> MutexGuard<'_, ImageNotes> {
    // A thread that panicked left nothing half noted that the file does not show.
    images.lock().unwrap_or_else(PoisonError::into_inner)
}

pub(super) fn read(path: &Path) -> Result<Vec<u8>, Broken> {
    read_file(path)
        .map_err(|error| Broken::for_now(format!("cannot read {}: {error}", path.display())))
}

/// A file that is no image may become one, once it is copied again.
fn decode(decode: Decode, frame: &Frame, file: &[u8]) -> Result<GrayImage, Broken> {
    let path = frame.image.display();
    let what = format_args!("decoding {path}");
    guard(what, || Ok::<_, String>(frame.turn.pixels(decode(file)?))).map_err(Broken::for_now)
}
