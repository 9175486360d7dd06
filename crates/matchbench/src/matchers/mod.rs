//! The matchers that can be asked for by name: one file each, and the list of them all.
//!
//! To add one: write a file with an [`Entry`], add it to [`MATCHERS`]. The tests below walk the
//! list and hold every entry to the same promises.

mod orb;
mod sift;

use matchbench_vision::matching::Matcher;
use serde::{Deserialize, Serialize};
use serde_json::Value;

use crate::config::ConfigError;

/// All matchers, in the order of tables.
pub const MATCHERS: &[&dyn Entry] = &[&sift::Sift, &orb::Orb];

/// A matcher that can be asked for by name.
pub trait Entry: Sync {
    /// Its name on the command line, in records and in tables, in kebab-case.
    fn id(&self) -> &'static str;

    /// What it is, in a few words.
    fn title(&self) -> &'static str;

    /// The paper, in full.
    fn reference(&self) -> &'static str;

    /// Id of the estimator that it is run with unless another is asked for.
    fn estimator(&self) -> &'static str {
        "ransac-e"
    }

    /// Every parameter with its default.
    fn defaults(&self) -> Value;

    /// The matcher with the given parameters, a JSON object; the others keep their defaults.
    ///
    /// # Errors
    /// If a parameter is unknown, of another type, or out of range.
    fn build(&self, params: Option<&Value>) -> Result<BuiltMatcher, ConfigError>;
}

/// A matcher ready to be run, and everything that its results depend on.
pub struct BuiltMatcher {
    /// Id of its entry.
    pub id: String,
    /// Every parameter, also those left at their defaults.
    pub params: Value,
    /// What its features depend on.
    pub extraction: Extraction,
    /// The matcher.
    pub matcher: Box<dyn Matcher>,
}

/// What the features of an image depend on, besides the image. Matchers that agree in it share
/// their features: extracted for one, they are found in the cache by the others.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Extraction {
    /// Id of the extractor.
    pub extractor: String,
    /// Every parameter of the extractor.
    pub params: Value,
    /// Raised whenever the same parameters come to give other features.
    pub revision: u32,
}

/// Parameters as JSON. By way of text, which keeps the `f32` 0.8 what a person would write; as a
/// value it would become 0.800000011920929.
fn to_json<P: Serialize>(params: &P) -> Value {
    let text = serde_json::to_string(params).expect("parameters are plain JSON");
    serde_json::from_str(&text).expect("written just now")
}

/// The matcher called `id`.
///
/// # Errors
/// If there is none; the error names the nearest, and all.
pub fn find(id: &str) -> Result<&'static dyn Entry, UnknownMatcher> {
    (MATCHERS.iter().copied())
        .find(|entry| entry.id() == id)
        .ok_or_else(|| UnknownMatcher::new(id, MATCHERS))
}

/// There is no matcher of this name.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("unknown matcher `{id}`{suggestion}; the matchers are: {known}")]
pub struct UnknownMatcher {
    id: String,
    suggestion: String,
    known: String,
}

impl UnknownMatcher {
    fn new(id: &str, entries: &[&dyn Entry]) -> Self {
        let ids = || entries.iter().map(|entry| entry.id());
        let nearest = (ids().map(|known| (edits(id, known), known)))
            // With half of the letters wrong it is another word.
            .filter(|&(edits, known)| 2 * edits <= known.len())
            .min();
        Self {
            id: id.into(),
            suggestion: nearest.map_or_else(String::new, |(_, known)| {
                format!(" (did you mean `{known}`?)")
            }),
            known: ids().collect::<Vec<_>>().join(", "),
        }
    }
}

/// Letters to be inserted, removed or replaced to turn `a` into `b`, whatever their case
/// (Levenshtein, "Binary codes capable of correcting deletions, insertions, and reversals", 1966).
fn edits(a: &str, b: &str) -> usize {
    let b: Vec<char> = b.to_lowercase().chars().collect();
    let mut row: Vec<usize> = (0..=b.len()).collect();
    for (i, letter_a) in a.to_lowercase().chars().enumerate() {
        let mut diagonal = std::mem::replace(&mut row[0], i + 1);
        for (j, letter_b) in b.iter().enumerate() {
            let replaced = diagonal + usize::from(letter_a != *letter_b);
            diagonal = row[j + 1];
            row[j + 1] = replaced.min(diagonal + 1).min(row[j] + 1);
        }
    }
    row[b.len()]
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeSet;
    use std::fs;
    use std::path::Path;

    use matchbench_vision::features::Features;
    use matchbench_vision::image::{GrayImage, Size};
    use matchbench_vision::matching::{Correspondences, View};
    use matchbench_vision::seed::Seed;
    use serde_json::json;

    use super::*;

    /// Patches of random grey with a little noise, moved by `shift` pixels: corners, blobs and
    /// edges for every detector.
    fn textured(shift: usize) -> GrayImage {
        let mut noise = Seed(5).number(shift as u64).rng();
        GrayImage::from_fn(Size::new(160, 120), |x, y| {
            let (column, row) = ((x + shift) / 9, y / 7);
            let patch = Seed(6).number(column as u64).number(row as u64);
            let grey = 40 + patch.rng().below(170) + noise.below(6);
            grey as u8
        })
    }

    /// The three stages, one after the other.
    fn run(
        matcher: &dyn Matcher,
        a: &GrayImage,
        b: &GrayImage,
    ) -> (Features, Features, Correspondences) {
        let (features_a, features_b) = (matcher.extract(a).unwrap(), matcher.extract(b).unwrap());
        let putative = matcher.search(&features_a, &features_b).unwrap();
        let view = |features, image| View {
            features,
            image: matcher.selects_by_pixels().then_some(image),
        };
        let selected = matcher
            .select(
                view(&features_a, a),
                view(&features_b, b),
                putative,
                Seed(3),
            )
            .unwrap();
        (features_a, features_b, selected)
    }

    fn with_threads<T: Send>(threads: usize, work: impl FnOnce() -> T + Send) -> T {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build();
        pool.unwrap().install(work)
    }

    #[test]
    fn ids_are_unique_and_in_kebab_case() {
        let ids: BTreeSet<_> = MATCHERS.iter().map(|entry| entry.id()).collect();
        assert_eq!(ids.len(), MATCHERS.len());
        for id in ids {
            let allowed = |c: char| c.is_ascii_lowercase() || c.is_ascii_digit() || c == '-';
            assert!(!id.is_empty() && id.chars().all(allowed), "{id}");
        }
    }

    #[test]
    fn every_file_of_this_folder_is_on_the_list() {
        let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("src/matchers");
        let files: BTreeSet<String> = (fs::read_dir(folder).unwrap())
            .map(|entry| entry.unwrap().path())
            .map(|path| {
                path.file_stem()
                    .unwrap()
                    .to_str()
                    .unwrap()
                    .replace('_', "-")
            })
            .filter(|stem| stem != "mod")
            .collect();
        let ids: BTreeSet<String> = MATCHERS.iter().map(|entry| entry.id().into()).collect();
        assert_eq!(
            files, ids,
            "a file is named as its matcher, with `_` for `-`"
        );
    }

    #[test]
    fn defaults_are_what_is_built_and_can_be_given_back() {
        for entry in MATCHERS {
            let built = entry.build(None).unwrap();
            assert_eq!(built.id, entry.id());
            assert_eq!(built.params, entry.defaults(), "{}", entry.id());
            let again = entry.build(Some(&entry.defaults())).unwrap();
            assert_eq!(again.params, built.params, "{}", entry.id());
            assert_eq!(again.extraction, built.extraction, "{}", entry.id());
        }
    }

    #[test]
    fn an_unknown_parameter_is_refused_by_name_at_every_depth() {
        for entry in MATCHERS {
            let mut objects = vec![json!({"no-such-parameter": 1})];
            for (name, value) in entry.defaults().as_object().unwrap() {
                if value.is_object() {
                    objects.push(json!({name: {"no-such-parameter": 1}}));
                }
            }
            for params in objects {
                let refused = entry.build(Some(&params)).err();
                let refused = refused.unwrap_or_else(|| panic!("{}: {params}", entry.id()));
                assert!(
                    refused.to_string().contains("no-such-parameter"),
                    "{refused}"
                );
            }
        }
    }

    #[test]
    fn results_do_not_depend_on_the_run_or_on_the_number_of_threads() {
        let (a, b) = (textured(0), textured(7));
        for entry in MATCHERS {
            let built = entry.build(None).unwrap();
            let first = with_threads(1, || run(&*built.matcher, &a, &b));
            assert!(!first.0.is_empty(), "{} finds nothing", entry.id());
            assert!(!first.2.is_empty(), "{} matches nothing", entry.id());
            let again = with_threads(2, || run(&*built.matcher, &a, &b));
            assert!(first == again, "{} is not deterministic", entry.id());
        }
    }

    #[test]
    fn images_without_content_have_no_features_and_no_matches() {
        let empty = GrayImage::filled(Size::new(0, 0), 0);
        let pixel = GrayImage::filled(Size::new(1, 1), 255);
        let black = GrayImage::filled(Size::new(160, 120), 0);
        let textured = textured(0);
        for entry in MATCHERS {
            let built = entry.build(None).unwrap();
            for image in [&empty, &pixel, &black] {
                for (a, b) in [(image, image), (image, &textured), (&textured, image)] {
                    let (_, _, matches) = run(&*built.matcher, a, b);
                    assert!(matches.is_empty(), "{}, {}", entry.id(), image.size());
                }
            }
        }
    }

    #[test]
    fn letters_are_counted() {
        for (a, b, count) in [("", "", 0), ("sift", "SIFT", 0), ("sfit", "sift", 2)] {
            assert_eq!((edits(a, b), edits(b, a)), (count, count), "{a} {b}");
        }
        for (a, b, count) in [("sif", "sift", 1), ("surf", "sift", 3), ("", "orb", 3)] {
            assert_eq!((edits(a, b), edits(b, a)), (count, count), "{a} {b}");
        }
    }

    #[test]
    fn an_unknown_name_is_answered_with_the_nearest_known_one() {
        struct Named(&'static str);
        impl Entry for Named {
            fn id(&self) -> &'static str {
                self.0
            }
            fn title(&self) -> &'static str {
                ""
            }
            fn reference(&self) -> &'static str {
                ""
            }
            fn defaults(&self) -> Value {
                json!({})
            }
            fn build(&self, _: Option<&Value>) -> Result<BuiltMatcher, ConfigError> {
                Err(ConfigError::new(self.0, "only a name"))
            }
        }
        let entries: [&dyn Entry; 2] = [&Named("sift"), &Named("binboost")];
        let message = |id| UnknownMatcher::new(id, &entries).to_string();
        assert_eq!(
            message("binbost"),
            "unknown matcher `binbost` (did you mean `binboost`?); the matchers are: sift, binboost"
        );
        assert_eq!(
            message("superglue"),
            "unknown matcher `superglue`; the matchers are: sift, binboost"
        );
        assert!(find("no-such-matcher").is_err());
    }
}
