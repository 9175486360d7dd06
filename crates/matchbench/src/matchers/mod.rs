//! The matchers that can be asked for by name: one file each, and the list of them all.
//!
//! To add one, write a file with a [`MatcherEntry`] and add it to [`MATCHERS`]. The tests below go through the
//! list and check the same properties for every entry.

mod adalam;
mod adalam_asift;
mod akaze;
mod asift;
mod binboost;
mod brisk;
mod code;
mod common;
mod daisy;
mod dlco;
mod dsp_sift;
mod freak;
mod freak_sift;
mod from_files;
mod gaim;
mod gms;
mod gms_s;
mod kaze;
mod kvld;
mod latch;
mod local_features;
mod orb;
mod repmatch;
mod rootsift;
mod sift;
mod source;
mod surf;

use matchbench_vision::matching::Matcher;
use serde::{Deserialize, Serialize};
use serde_json::Value;

pub use common::{REFINE, SIZES, build};
pub use from_files::MatchesFrom;
pub use source::{
    BuiltPointSource, Cancel, ImageFiles, LONGEST_STAGE, MAX_MATCHES, PointSource, Source,
    SourceError, SourceSeconds, SourcedMatches, check_seconds, mostly_copies,
};

use crate::config::{self, ConfigError, Parameter, UnknownName};

/// All matchers, in the order of tables: that of the paper, with variants after their originals.
pub const MATCHERS: &[&dyn MatcherEntry] = &[
    &sift::SIFT,
    &rootsift::ROOTSIFT,
    &dsp_sift::DSP_SIFT,
    &surf::SURF,
    &orb::ORB,
    &brisk::BRISK,
    &kaze::KAZE,
    &akaze::AKAZE,
    &dlco::DLCO,
    &freak::FREAK,
    &freak_sift::FREAK_SIFT,
    &binboost::BINBOOST,
    &latch::LATCH,
    &daisy::DAISY,
    &kvld::KvldEntry,
    &gaim::GaimEntry,
    &asift::AsiftEntry,
    &code::CodeEntry,
    &repmatch::RepMatchEntry,
    &gms::GMS,
    &gms_s::GMS_S,
    &adalam::AdalamEntry,
    &adalam_asift::AdalamAsiftEntry,
];

/// The entry of a matcher that can be asked for by name.
pub trait MatcherEntry: Sync {
    /// Its name on the command line, in records and in tables, in kebab-case.
    fn id(&self) -> &'static str;

    /// What it is, in a few words.
    fn summary(&self) -> &'static str;

    /// Its name in publications: as its summary or its reference writes it, otherwise in capitals.
    fn title(&self) -> String {
        let is_it = |word: &&str| {
            word.eq_ignore_ascii_case(self.id()) && word.contains(|c: char| c.is_uppercase())
        };
        let words = |text: &'static str| text.split(|c: char| !c.is_alphanumeric());
        let mut words = words(self.summary()).chain(words(self.reference()));
        words
            .find(is_it)
            .map_or_else(|| self.id().to_uppercase(), str::to_owned)
    }

    /// The paper, in full.
    fn reference(&self) -> &'static str;

    /// Id of the estimator that is used if the user names none.
    fn estimator(&self) -> &'static str {
        "ransac-e"
    }

    /// Every parameter with its default.
    fn defaults(&self) -> Value;

    /// Every parameter and what it means, by name.
    fn parameters(&self) -> Vec<Parameter>;

    /// The matcher with the given parameters, a JSON object; the others keep their defaults.
    ///
    /// # Errors
    /// If a parameter is unknown, would do nothing, or is of another type or out of range.
    fn build(&self, params: Option<&Value>) -> Result<BuiltMatcher, ConfigError>;

    /// Converts the parameters `written` in the plan of an earlier version to the form that
    /// [`BuiltMatcher::params`] has now: parameters that had no effect are removed.
    fn modernized(&self, written: &Value) -> Value {
        written.clone()
    }
}

/// A matcher ready to be run, and everything that its results depend on.
#[derive(Debug)]
pub struct BuiltMatcher {
    /// Id of its entry.
    pub id: String,
    /// Every parameter, including those at their defaults.
    pub params: Value,
    /// Everything that its features depend on.
    pub extraction: Extraction,
    /// Everything that its keypoints depend on, if other matchers use the same keypoints.
    pub detection: Option<Extraction>,
    /// The matcher.
    pub matcher: Box<dyn Matcher>,
}

/// Everything that the features of an image depend on, besides the image. Matchers for which all of this is
/// equal share their features: those extracted for one are found in the cache by the others.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Extraction {
    /// Id of the extractor, or an id such as `sift-keypoints` for keypoints alone.
    pub extractor: String,
    /// Every parameter of the extractor.
    pub params: Value,
    /// Increased whenever the same parameters give other features than before.
    pub revision: u32,
}

/// The matcher called `id`.
///
/// # Errors
/// If there is none. The error names the most similar one, and lists all.
pub fn find(id: &str) -> Result<&'static dyn MatcherEntry, UnknownName> {
    config::find("matcher", MATCHERS, MatcherEntry::id, id).map_err(|unknown| {
        unknown.beside(
            "; a matcher from outside is named by the path of its manifest, such as ./mine.toml",
        )
    })
}

/// The names, with those of all matchers of [`MATCHERS`] in the place of `all`.
pub fn expanded(names: &[String]) -> Vec<String> {
    let all = || MATCHERS.iter().map(|entry| entry.id().to_owned());
    (names.iter())
        .flat_map(|name| match &**name {
            "all" => all().collect(),
            _ => vec![name.clone()],
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeSet;
    use std::fs;
    use std::path::Path;

    use super::*;
    use matchbench_vision::features::{Detections, Features, Keypoint};
    use matchbench_vision::image::{GrayImage, Size};
    use matchbench_vision::matching::{Correspondences, View};
    use matchbench_vision::seed::Seed;
    use serde_json::json;

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

    /// The matcher with only a few simulated views: with all of them it does the same but takes longer.
    fn with_few_views(entry: &dyn MatcherEntry) -> BuiltMatcher {
        let params = match entry.id() {
            "asift" | "code" | "repmatch" => json!({"extractor": {"views": {"tilts": 2}}}),
            "gaim" => json!({"extractor": {"views": {"shears": 1, "scale_steps": 0}}}),
            _ => return entry.build(None).unwrap(),
        };
        entry.build(Some(&params)).unwrap()
    }

    /// The three stages, one after the other.
    fn run(
        matcher: &dyn Matcher,
        a: &GrayImage,
        b: &GrayImage,
    ) -> (Features, Features, Correspondences) {
        let (features_a, features_b) = (matcher.extract(a).unwrap(), matcher.extract(b).unwrap());
        let matches = match_features(matcher, (a, &features_a), (b, &features_b));
        (features_a, features_b, matches)
    }

    /// Search and selection.
    fn match_features(
        matcher: &dyn Matcher,
        (a, features_a): (&GrayImage, &Features),
        (b, features_b): (&GrayImage, &Features),
    ) -> Correspondences {
        let putative = matcher.search(features_a, features_b).unwrap();
        let view = |features, image| View {
            features,
            image: matcher.uses_pixels().then_some(image),
            camera: None,
        };
        let (view_a, view_b) = (view(features_a, a), view(features_b, b));
        matcher.select(view_a, view_b, putative, Seed(3)).unwrap()
    }

    fn with_threads<T: Send>(threads: usize, work: impl FnOnce() -> T + Send) -> T {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build();
        pool.unwrap().install(work)
    }

    #[test]
    fn an_unknown_matcher_is_answered_with_how_those_from_outside_are_named() {
        let message = find("lightglue").map(MatcherEntry::id).unwrap_err();
        let message = message.to_string();
        assert!(
            message.contains("sift") && message.ends_with("such as ./mine.toml"),
            "{message}"
        );
    }

    #[test]
    fn ids_are_unique_and_in_kebab_case() {
        let ids: BTreeSet<_> = MATCHERS.iter().map(|entry| entry.id()).collect();
        assert_eq!(ids.len(), MATCHERS.len());
        for entry in MATCHERS {
            let title = entry.title().to_lowercase();
            assert_eq!(title, entry.id(), "people must find the one by the other");
        }
        for (id, title) in [
            ("binboost", "BinBoost"),
            ("repmatch", "RepMatch"),
            ("code", "CODE"),
        ] {
            assert_eq!(
                find(id).map(MatcherEntry::title).ok().as_deref(),
                Some(title)
            );
        }
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
            .filter(|stem| {
                !["mod", "common", "from-files", "local-features", "source"].contains(&&**stem)
            })
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
    fn every_parameter_is_explained_and_every_choice_can_be_made() {
        for entry in MATCHERS {
            config::check_explained(entry.id(), &entry.parameters(), |params| {
                entry.build(Some(params)).map(|built| built.params)
            });
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
            let built = with_few_views(*entry);
            let first = with_threads(1, || run(&*built.matcher, &a, &b));
            assert!(!first.0.is_empty(), "{} finds nothing", entry.id());
            assert!(!first.2.is_empty(), "{} matches nothing", entry.id());
            let again = with_threads(2, || run(&*built.matcher, &a, &b));
            assert!(first == again, "{} is not deterministic", entry.id());
            let kind = first.0.descriptors.kind();
            assert_eq!(built.matcher.descriptors(), Some(kind), "{}", entry.id());
        }
    }

    /// Remembers the keypoints of one image, and how often they were found.
    #[derive(Default)]
    struct Memory(Option<Vec<Keypoint>>, usize);

    impl Detections for Memory {
        fn recall(&mut self) -> Option<Vec<Keypoint>> {
            self.0.clone()
        }

        fn remember(&mut self, keypoints: &[Keypoint]) {
            self.1 += 1;
            let before = self.0.replace(keypoints.to_vec());
            assert!(before.is_none_or(|before| before == keypoints));
        }
    }

    #[test]
    fn matchers_of_one_detector_share_its_keypoints_and_have_the_same_features() {
        let image = textured(0);
        let mut memories: Vec<(Extraction, Memory)> = Vec::new();
        for entry in MATCHERS {
            let built = entry.build(None).unwrap();
            let Some(detection) = built.detection else {
                continue;
            };
            let known = memories.iter().position(|(known, _)| *known == detection);
            let index = known.unwrap_or_else(|| {
                memories.push((detection, Memory::default()));
                memories.len() - 1
            });
            let shared = (built.matcher).extract_sharing(&image, &mut memories[index].1);
            assert_eq!(shared, built.matcher.extract(&image), "{}", entry.id());
        }
        let found: Vec<_> = (memories.iter())
            .map(|(detection, memory)| (detection.extractor.as_str(), memory.1))
            .collect();
        // `sift` and `kvld` describe them while they find them, and leave none behind.
        assert_eq!(found, [("sift-keypoints", 1), ("surf-keypoints", 1)]);
    }

    #[test]
    fn images_without_content_have_no_features_and_no_matches() {
        let empty = GrayImage::filled(Size::new(0, 0), 0);
        let pixel = GrayImage::filled(Size::new(1, 1), 255);
        let black = GrayImage::filled(Size::new(160, 120), 0);
        let textured = textured(0);
        for entry in MATCHERS {
            let built = with_few_views(*entry);
            let extracted = |image| (image, built.matcher.extract(image).unwrap());
            let textured = extracted(&textured);
            for image in [&empty, &pixel, &black] {
                let image = extracted(image);
                for (a, b) in [(&image, &image), (&image, &textured), (&textured, &image)] {
                    let matches = match_features(&*built.matcher, (a.0, &a.1), (b.0, &b.1));
                    assert!(matches.is_empty(), "{}, {}", entry.id(), image.0.size());
                }
            }
        }
    }

    #[test]
    fn every_matcher_can_look_at_smaller_images_and_its_features_say_so() {
        let image = textured(0);
        for entry in MATCHERS {
            let params = |max_size: Value| json!({"extractor": {"max_size": max_size}});
            let full = build(*entry, Some(&params(Value::Null))).unwrap();
            assert_eq!(full.params, entry.defaults(), "{}", entry.id());
            let small = build(*entry, Some(&params(json!(120)))).unwrap();
            assert_eq!(small.params["extractor"]["max_size"], 120);
            assert_ne!(small.extraction, full.extraction, "{}", entry.id());
            assert!(small.detection.is_none() || small.detection != full.detection);
            let [features, of_full] = [&small, &full].map(|built| built.matcher.extract(&image));
            let (features, of_full) = (features.unwrap(), of_full.unwrap());
            assert!(
                features != of_full && features.size == of_full.size,
                "{}",
                entry.id()
            );
            for wrong in [json!(3), json!("x"), json!(-1), json!(0.5)] {
                assert!(
                    build(*entry, Some(&params(wrong))).is_err(),
                    "{}",
                    entry.id()
                );
            }
            let unknown = json!({"extractor": {"max_size": 99, "no-such-parameter": 1}});
            assert!(build(*entry, Some(&unknown)).is_err(), "{}", entry.id());
        }
    }

    #[test]
    fn features_of_shared_keypoints_of_another_size_are_those_of_each_alone() {
        let image = textured(0);
        for entry in MATCHERS {
            for size in [json!({"max_size": 120}), json!({"size": "96x96"})] {
                let params = json!({"extractor": size});
                let matcher = build(*entry, Some(&params)).unwrap().matcher;
                let alone = matcher.extract(&image);
                let mut memory = Memory::default();
                // Found, and then recalled.
                for _ in 0..2 {
                    let shared = matcher.extract_sharing(&image, &mut memory);
                    assert_eq!(shared, alone, "{} {params}", entry.id());
                }
            }
        }
    }

    #[test]
    fn an_unknown_parameter_of_an_extractor_is_answered_with_all_and_those_of_the_size() {
        for entry in MATCHERS {
            let unknown = json!({"extractor": {"no-such-parameter": 1}});
            let message = build(*entry, Some(&unknown)).err().unwrap().to_string();
            assert!(message.contains("`no-such-parameter`"), "{message}");
            assert!(message.ends_with("max_size, size"), "{message}");
        }
        let misspelt = json!({"extractor": {"max_sise": 640}});
        let message = build(find("sift").unwrap(), Some(&misspelt));
        let message = message.err().unwrap().to_string();
        assert!(message.contains("did you mean `max_size`?"), "{message}");
        assert!(message.contains("contrast_threshold"), "{message}");
        // One of the extractor is known though its part was left out.
        for name in ["contrast_threshold", "max_size"] {
            let message = build(find("sift").unwrap(), Some(&json!({name: 640})));
            let message = message.err().unwrap().to_string();
            let meant = format!("did you mean `extractor.{name}`?");
            assert!(message.contains(&meant), "{message}");
        }
        // What is wrong elsewhere is told as it is.
        let value = json!({"extractor": {"contrast_threshold": "x"}});
        let message = build(find("sift").unwrap(), Some(&value));
        let message = message.err().unwrap().to_string();
        assert!(!message.contains("max_size"), "{message}");
    }

    #[test]
    fn images_of_an_exact_size_are_another_extraction() {
        let entry = find("orb").unwrap();
        let params = |size: Value| json!({"extractor": {"size": size}});
        let exact = build(entry, Some(&params(json!("120x90")))).unwrap();
        assert_eq!(exact.params["extractor"]["size"], "120x90");
        let image = textured(0);
        let [found, full] =
            [exact.matcher, entry.build(None).unwrap().matcher].map(|m| m.extract(&image).unwrap());
        assert!(found != full && found.size == image.size());
        assert_eq!(exact.extraction.params["size"], "120x90");
        let revisions = |size| {
            let built = build(entry, size).unwrap();
            (
                built.extraction.revision,
                built.detection.map(|of| of.revision),
            )
        };
        // Features that an earlier program kept of such images had the orientations of what was resampled.
        assert_ne!(revisions(Some(&params(json!("120x90")))), revisions(None));
        for wrong in [json!(640), json!("640"), json!("9x480"), json!("640x-1")] {
            assert!(
                build(entry, Some(&params(wrong.clone()))).is_err(),
                "{wrong}"
            );
        }
        let both = json!({"extractor": {"size": "120x90", "max_size": 100}});
        let message = build(entry, Some(&both)).err().unwrap().to_string();
        assert!(message.contains("two things"), "{message}");
    }

    #[test]
    fn every_matcher_can_move_its_matches_and_does_so_only_if_asked() {
        for entry in MATCHERS {
            let plain = build(*entry, None).unwrap();
            let given = |refine: Value| build(*entry, Some(&json!({"refine": refine})));
            let refined = given(json!(true)).unwrap();
            assert!(refined.matcher.uses_pixels(), "{}", entry.id());
            assert_eq!(refined.params["refine"], true);
            assert_eq!(refined.extraction, plain.extraction, "the same features");
            let again = build(*entry, Some(&refined.params)).unwrap();
            assert_eq!(again.params, refined.params, "{}", entry.id());
            for off in [json!(false), Value::Null] {
                assert_eq!(given(off).unwrap().params, plain.params);
            }
            let wrong = given(json!("yes")).err().unwrap().to_string();
            assert!(wrong.ends_with("must be true or false"), "{wrong}");
            let misspelt = build(*entry, Some(&json!({"refin": true}))).err().unwrap();
            let misspelt = misspelt.to_string();
            assert!(misspelt.contains("did you mean `refine`?"), "{misspelt}");
        }
    }

    #[test]
    fn the_selection_of_a_matcher_depends_on_its_seed_only_if_it_says_so() {
        let (a, b) = (textured(0), textured(1));
        let mut random = Vec::new();
        for entry in MATCHERS {
            let matcher = with_few_views(*entry).matcher;
            let (of_a, of_b) = (matcher.extract(&a).unwrap(), matcher.extract(&b).unwrap());
            let putative = matcher.search(&of_a, &of_b).unwrap();
            let view = |features, image| View {
                features,
                image: Some(image),
                camera: None,
            };
            let select = |seed| {
                let (a, b) = (view(&of_a, &a), view(&of_b, &b));
                matcher.select(a, b, putative.clone(), seed).unwrap()
            };
            if matcher.uses_seed() {
                random.push(entry.id());
            } else {
                assert_eq!(select(Seed(1)), select(Seed(2)), "{}", entry.id());
            }
        }
        assert_eq!(random, ["code", "repmatch"]);
    }

    #[test]
    fn every_matcher_is_found_by_its_name() {
        for entry in MATCHERS {
            assert_eq!(
                find(entry.id()).ok().map(MatcherEntry::id),
                Some(entry.id())
            );
        }
        assert!(find("no-such-matcher").is_err());
    }
}
