//! Matchers from outside as sources of a run's matched points.
//!
//! A matcher that answers matches is asked for each pair. One that answers features is asked for each
//! image. Its answers are kept in the cache of the run, under the content of the image, the child's version,
//! its command and its parameters; the search, the ratio test and the mutual check are native and timed here.

use std::collections::BTreeMap;
use std::mem;
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex};
use std::time::Instant;

use matchbench_vision::features::Features;
use matchbench_vision::geometry::MatchedPoints;
use matchbench_vision::seed::Seed;
use nalgebra::Point2;
use serde_json::json;

use super::answer::{Matched, Times};
use super::manifest::{Kind, Matching};
use super::pool::{Breakdown, External, Image};
use super::process::lock;
use crate::cache::{FeatureCache, Key, are_of};
use crate::datasets::read_size;
use crate::files::read_file;
use crate::matchers::{
    BuiltPointSource, Cancel, Extraction, ImageFiles, PointSource, SourceError, SourceSeconds,
    SourcedMatches,
};

/// Raised whenever the same files of features come to be read as other features.
const REVISION: u32 = 2;

impl External {
    /// The matcher as a source of matched points; the features of one that describes images are kept
    /// in `cache`, and those of the images that were used last in so many bytes of `memory`.
    pub fn into_source(self, cache: FeatureCache, memory: usize) -> BuiltPointSource {
        let identity = self.identity().clone();
        let manifest = self.manifest().clone();
        // The same pixels by another convention are other matches, which no run may mix.
        let center = match identity.pixel_center {
            0.0 => String::new(),
            center => format!(", first pixel's centre at {center}"),
        };
        let mut notes = vec![format!(
            "a program from outside: {} ({}); its times are its own word",
            manifest.summary, identity.name
        )];
        if !manifest.reference.is_empty() {
            notes.push(manifest.reference.clone());
        }
        let source: Box<dyn PointSource> = match manifest.kind {
            Kind::Matches => Box::new(Pairs(self)),
            Kind::Features(matching) => Box::new(Described {
                extraction: Extraction {
                    extractor: manifest.name.clone(),
                    params: json!({"identity": identity, "command": manifest.started(),
                                   "params": manifest.params, "hamming": matching.hamming}),
                    revision: REVISION,
                },
                external: self,
                matching,
                cache,
                known: Mutex::new(Known::new(memory)),
                unkept: Mutex::default(),
            }),
        };
        BuiltPointSource {
            id: manifest.name.clone(),
            version: Some(format!("{} {}{center}", identity.name, identity.version)),
            command: Some(manifest.started()),
            params: manifest.effective(),
            notes,
            source,
        }
    }
}

impl From<Breakdown> for SourceError {
    fn from(breakdown: Breakdown) -> Self {
        match breakdown {
            Breakdown::Said(reason) | Breakdown::Broke(reason) => Self::Pair(reason),
            Breakdown::Ended(reason) => Self::Ended(reason),
            Breakdown::Stopped => Self::Stopped,
        }
    }
}

/// A matcher that answers matches.
struct Pairs(External);

impl PointSource for Pairs {
    fn heed(&self, cancel: &Cancel) {
        self.0.heed(cancel);
    }

    fn matches(&self, pair: &ImageFiles<'_>, _: Seed) -> Result<SourcedMatches, SourceError> {
        let paths = [absolute(pair.images[0])?, absolute(pair.images[1])?];
        let [a, b] = [image(&paths[0])?, image(&paths[1])?];
        let Matched {
            rows,
            features,
            times,
        } = self.0.match_pair(pair.frames, a, b)?;
        let rest: f64 = (times.own.iter())
            .filter(|(stage, _)| *stage != "extract")
            .map(|(_, seconds)| seconds)
            .sum();
        Ok(SourcedMatches {
            points: points(&rows),
            features: features.unwrap_or_default(),
            putative: None,
            seconds: SourceSeconds {
                extract: times.of_each_image(),
                matching: (!times.own.is_empty()).then_some(rest),
                wall: Some(times.wall),
                device: times.device,
            },
        })
    }
}

/// A matcher that describes images.
struct Described {
    external: External,
    extraction: Extraction,
    matching: Matching,
    cache: FeatureCache,
    known: Mutex<Known>,
    /// See [`PointSource::take_unkept`].
    unkept: Mutex<Vec<String>>,
}

/// The features of an image, once they are known.
type Slot = Arc<Mutex<Option<Arc<Features>>>>;

/// The features of the images that were used last: pairs come grouped by their first image.
struct Known {
    /// How many bytes they may take; the image that was used last is kept in any case.
    budget: usize,
    uses: u64,
    images: BTreeMap<PathBuf, KnownImage>,
}

#[derive(Default)]
struct KnownImage {
    slot: Slot,
    /// What its features take; 0 while they are not known.
    bytes: usize,
    /// Its last use, counted over all images.
    used: u64,
}

impl Known {
    fn new(budget: usize) -> Self {
        Self {
            budget,
            uses: 0,
            images: BTreeMap::new(),
        }
    }

    /// The place of the features of an image, which are used now.
    fn slot(&mut self, path: &Path) -> Slot {
        self.uses += 1;
        let image = self.images.entry(path.into()).or_default();
        image.used = self.uses;
        Arc::clone(&image.slot)
    }

    /// Notes what the features of an image take; those of the images that were used longest ago go, until all fit.
    fn note(&mut self, path: &Path, bytes: usize) {
        self.images.entry(path.into()).or_default().bytes = bytes;
        let mut held: usize = self.images.values().map(|image| image.bytes).sum();
        while held > self.budget {
            let others = self
                .images
                .iter()
                .filter(|(other, image)| *other != path && image.bytes > 0);
            let Some(oldest) = others
                .min_by_key(|(_, image)| image.used)
                .map(|(path, _)| path.clone())
            else {
                return;
            };
            held -= self.images.remove(&oldest).map_or(0, |image| image.bytes);
        }
    }
}

impl PointSource for Described {
    fn heed(&self, cancel: &Cancel) {
        self.external.heed(cancel);
    }

    fn matches(&self, pair: &ImageFiles<'_>, _: Seed) -> Result<SourcedMatches, SourceError> {
        let (a, times_a) = self.features(pair.images[0])?;
        let (b, times_b) = self.features(pair.images[1])?;
        let (kind_a, kind_b) = (a.descriptors.kind(), b.descriptors.kind());
        // Whoever found nothing need not know how long a descriptor is.
        if kind_a != kind_b && !a.is_empty() && !b.is_empty() {
            let reason = format!("its descriptors changed from {kind_a} to {kind_b}");
            return Err(SourceError::Pair(reason));
        }
        let start = Instant::now();
        let (points, putative) = self.matching.matches(&a, &b);
        let matching = start.elapsed().as_secs_f64();
        let times = [&times_a, &times_b].map(Option::as_ref);
        let extract = |times: &Times| times.own.get("extract").copied().unwrap_or(times.wall);
        let walls = times.iter().flatten().map(|times| times.wall);
        Ok(SourcedMatches {
            points,
            features: [a.len() as u32, b.len() as u32],
            putative: Some(putative as u32),
            seconds: SourceSeconds {
                extract: times.map(|times| times.map(extract)),
                matching: Some(matching),
                wall: Some(walls.sum::<f64>() + matching),
                device: times
                    .into_iter()
                    .flatten()
                    .find_map(|times| times.device.clone()),
            },
        })
    }

    fn take_unkept(&self) -> Vec<String> {
        mem::take(&mut *lock(&self.unkept))
    }
}

impl Described {
    /// The features of an image, and how long that took, if they were not known.
    fn features(&self, path: &Path) -> Result<(Arc<Features>, Option<Times>), SourceError> {
        let path = absolute(path)?;
        let slot = lock(&self.known).slot(&path);
        // Held while the image is described: whoever else needs it waits.
        let mut slot = lock(&slot);
        if let Some(features) = &*slot {
            return Ok((Arc::clone(features), None));
        }
        let file = read_file(&path).map_err(|error| {
            SourceError::Pair(format!("cannot read {}: {error}", path.display()))
        })?;
        let key = Key::new(&file, 0, &self.extraction);
        let image = image(&path)?;
        let kept = self.cache.load(key);
        let kept = kept.filter(|features| are_of(features, image.size));
        let (features, times) = if let Some(features) = kept {
            (features, None)
        } else {
            let (described, _until_saved) = self.external.describe_to_save(image)?;
            // A cache that cannot be written costs time and no result.
            if let Err(error) = self.cache.save(key, &described.features) {
                lock(&self.unkept).push(error.to_string());
            }
            (described.features, Some(described.times))
        };
        let features = Arc::new(features);
        *slot = Some(Arc::clone(&features));
        lock(&self.known).note(&path, features.memory());
        Ok((features, times))
    }
}

fn points(rows: &[[f32; 5]]) -> MatchedPoints {
    let mut points = MatchedPoints::default();
    for &[x_a, y_a, x_b, y_b, ambiguity] in rows {
        let [x_a, y_a, x_b, y_b] = [x_a, y_a, x_b, y_b].map(f64::from);
        points.push(Point2::new(x_a, y_a), Point2::new(x_b, y_b), ambiguity);
    }
    points
}

/// Children run in a folder of their own.
fn absolute(path: &Path) -> Result<PathBuf, SourceError> {
    std::path::absolute(path)
        .map_err(|error| SourceError::Pair(format!("{}: {error}", path.display())))
}

fn image(path: &Path) -> Result<Image<'_>, SourceError> {
    let size = read_size(path).map_err(|error| SourceError::Pair(error.to_string()))?;
    Ok(Image { path, size })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn features_are_kept_by_their_bytes() {
        let mut known = Known::new(100);
        let mut take = |name: &str, bytes: usize| {
            let path = Path::new(name);
            known.slot(path);
            known.note(path, bytes);
            let names = known.images.keys().map(|path| path.display().to_string());
            names.collect::<Vec<_>>().concat()
        };
        assert_eq!(take("a", 40), "a");
        assert_eq!(take("b", 40), "ab");
        take("a", 40);
        assert_eq!(take("c", 40), "ac", "`b` was used longest ago");
        assert_eq!(take("d", 10), "acd");
        assert_eq!(take("e", 1000), "e", "more than may be kept, but in use");
        assert_eq!(take("f", 1), "f");
    }

    /// A program in the language of the shell that finds one feature, and notes that it was asked.
    #[cfg(unix)]
    const PROGRAM: &str = r#"
field() { printf '%s' "$line" | sed "s/.*\"$1\":\"\([^\"]*\)\".*/\1/"; }
while read -r line; do
    case $line in
    *hello*) echo '{"type":"ready","protocol":1,"name":"x","version":"1","pixel_center":0}' ;;
    *describe*)
        echo asked >>asked
        cp one.npz "$(field out)"
        echo '{"type":"described","image":"'"$(field image)"'","count":1}'
        ;;
    esac
done
"#;

    #[cfg(unix)] // `sh`
    #[test]
    fn what_is_kept_of_another_image_is_described_anew() {
        use std::fs;

        use matchbench_vision::image::Size;

        use crate::arrays::testing::{floats, write_npz};
        use crate::external::{BuiltIn, Log, Manifest};

        let folder = tempfile::tempdir().unwrap();
        let at = |name: &str| folder.path().join(name);
        let points = ("keypoints", floats("(1, 2)", &[3.0, 4.0]));
        let rows = ("descriptors", floats("(1, 2)", &[1.0, 2.0]));
        write_npz(&at("one.npz"), &[points, rows]);
        fs::write(at("x.sh"), PROGRAM).unwrap();
        let text = "name = 'x'\ncommand = ['sh', 'x.sh']\nkind = 'features'\n";
        let manifest = Manifest::parse(&at("x.toml"), text, &BuiltIn::default()).unwrap();
        let external = External::start(manifest, Log::open(&at("x.log")).unwrap()).unwrap();
        let pixels = [b"P5 8 6 255\n".to_vec(), vec![0; 48]].concat();
        fs::write(at("image.pgm"), &pixels).unwrap();
        let described = || Described {
            extraction: Extraction {
                extractor: "x".into(),
                params: json!({}),
                revision: 1,
            },
            external: External::start(
                external.manifest().clone(),
                Log::open(&at("x.log")).unwrap(),
            )
            .unwrap(),
            matching: Matching::default(),
            cache: FeatureCache::new(at("cache")),
            known: Mutex::new(Known::new(1 << 20)),
            unkept: Mutex::default(),
        };
        let asked = || {
            fs::read_to_string(at("asked"))
                .unwrap_or_default()
                .lines()
                .count()
        };
        let features = || described().features(&at("image.pgm")).unwrap().0;
        let sound = features();
        assert_eq!((sound.len(), asked()), (1, 1));
        assert_eq!((features(), asked()), (Arc::clone(&sound), 1));
        let key = Key::new(&pixels, 0, &described().extraction);
        let mut outside = Features::clone(&sound);
        outside.keypoints[0].at.x = 9.5;
        let larger = Features {
            size: Size::new(1 << 40, 6),
            ..Features::clone(&sound)
        };
        for (times, forged) in [(2, outside), (3, larger)] {
            described().cache.save(key, &forged).unwrap();
            assert_eq!((features(), asked()), (Arc::clone(&sound), times));
        }
    }
}
