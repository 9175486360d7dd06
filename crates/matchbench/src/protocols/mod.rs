//! Evaluation protocols of published benchmarks: all that is decided between one set of matches and the score
//! that a paper prints.
//!
//! Every benchmark of relative pose resizes images, estimates poses, and counts pairs below an angle, but each
//! does it in its own way. A [`Protocol`] defines all of these steps. It includes the oddities of the original
//! program if they change the score, since the published numbers have them. Each protocol has a file here, with
//! what was read in its program, and a line in [`PROTOCOLS`].
//!
//! A protocol makes choices at three times. Before the run: the size of the images, the estimator with its
//! settings, and the number of repetitions with other random choices. For each pair ([`Protocol::view`]): the
//! pixels in which the threshold is measured, the coordinates of points, and the number of matches that is
//! enough. After the run: which scores are shown, and over which repetitions errors are pooled.
//!
//! An estimator under a protocol is called `ID@PROTOCOL` in plans, records and tables. Without one, the
//! protocol is [`MATCHBENCH`], that of the paper.

mod glue_factory;
mod imc;
mod loftr;
mod matchbench;
mod roma;
mod superglue;
mod view;
mod zeb;

use matchbench_vision::geometry::{Camera, MatchedPoints};
use matchbench_vision::image::Size;
use matchbench_vision::robust::NoModel;
use serde::Serialize;
use serde_json::{Value, json};

use crate::config::{self, UnknownName, to_json};

pub use glue_factory::GLUE_FACTORY;
pub use imc::IMC;
pub use loftr::LOFTR;
pub use matchbench::MATCHBENCH;
pub use roma::ROMA;
pub use superglue::SUPERGLUE;
pub use view::PixelView;
pub use zeb::ZEB;

/// All protocols, in the order of tables. To add one, write a file in this folder and add a line here.
pub const PROTOCOLS: &[&Protocol] = &[
    &MATCHBENCH,
    &SUPERGLUE,
    &LOFTR,
    &ROMA,
    &GLUE_FACTORY,
    &IMC,
    &ZEB,
];

/// The rules of a benchmark in all details.
#[derive(Clone, Copy, Debug)]
pub struct Protocol {
    /// The name in commands, plans and tables; lower case, words joined by `-`.
    pub id: &'static str,
    /// Who defined it and for which data, in one sentence.
    pub summary: &'static str,
    /// The paper.
    pub reference: &'static str,
    /// Where the details were read: the files of the program.
    pub source: &'static str,
    /// The size to which images are reduced before matching.
    pub size: SizeRule,
    /// The estimator of the pose.
    pub estimator: EstimatorRule,
    /// The pixels in which a threshold is measured.
    pub pixels: Pixels,
    /// Which focal length turns the threshold into an angle.
    pub focal: Focal,
    /// Where points are after images were resized.
    pub centres: Centres,
    /// How often the pose of a pair is estimated, each time with other random choices; the errors are pooled.
    pub shuffles: u32,
    /// Least number of matches; with fewer no pose is estimated.
    pub min_matches: usize,
    /// Least number of inliers of the model; with fewer the pair failed.
    pub min_inliers: usize,
    /// Least number of matches in front of both cameras; with fewer the pair failed.
    pub min_support: usize,
    /// Ids of the scores that it reports, out of [`SCORES`](crate::metrics::SCORES).
    pub scores: &'static [&'static str],
    /// The error of a pair without a pose, in degrees. It is above every threshold of the scores, so it changes
    /// none of them. It changes only means and medians, which are not shown.
    pub failure: f64,
    /// What else its program does, in sentences: what is reproduced here, and what is not.
    pub notes: &'static [&'static str],
}

/// The size to which images are reduced.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum SizeRule {
    /// Their own size.
    AsIs,
    /// This many pixels along the longer side. Matchers of this program do not enlarge smaller images.
    LongSide(u32),
    /// This width and height, whatever the aspect ratio.
    Exactly(u32, u32),
}

/// The estimator of the pose.
#[derive(Clone, Copy, Debug)]
pub enum EstimatorRule {
    /// The estimator that belongs to the matcher, with its defaults.
    Own,
    /// A fixed estimator.
    Of {
        /// Its id.
        id: &'static str,
        /// Its settings, a JSON object. Settings that are not in it keep their defaults.
        params: fn() -> Value,
    },
}

/// The pixels in which a threshold is measured.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Pixels {
    /// Pixels of the original images.
    Original,
    /// Pixels of the images in the size of the protocol, whether matches were found in this size or not.
    Resized,
}

/// The focal length by which a threshold in pixels is divided.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Focal {
    /// The mean of fx and fy of both cameras.
    Mean,
    /// The mean of fx of the first camera and fy of the second.
    FirstXSecondY,
    /// The inverse of the mean of the inverses of both cameras' focal lengths.
    Harmonic,
}

/// Where points of resized images are assumed to be.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Centres {
    /// At their true places: the centre of a pixel stays at the centre of the area that it became.
    Kept,
    /// At their coordinates times the ratio of the sizes. This moves all of them by `(1 - ratio) / 2` pixels.
    Scaled,
}

/// The protocol called `id`.
///
/// # Errors
/// If there is none. The error names the most similar one, and lists all.
pub fn find(id: &str) -> Result<&'static Protocol, UnknownName> {
    config::find("protocol", PROTOCOLS, |protocol| protocol.id, id)
}

/// The protocols with these names; `all` means all of them.
///
/// # Errors
/// As [`find`].
pub fn find_all(names: &[String]) -> Result<Vec<&'static Protocol>, UnknownName> {
    match names {
        [name] if name == "all" => Ok(PROTOCOLS.to_vec()),
        names => names.iter().map(|name| find(name)).collect(),
    }
}

/// The protocol of an estimator with this name.
pub fn of_estimator(name: &str) -> &'static Protocol {
    let (_, id) = name.split_once('@').unwrap_or_default();
    find(id).unwrap_or(&MATCHBENCH)
}

/// The id of an estimator, without the protocol that its name may have.
pub fn without_protocol(name: &str) -> &str {
    match name.split_once('@') {
        Some((estimator, id)) if find(id).is_ok() => estimator,
        _ => name,
    }
}

impl Protocol {
    /// Whether it is the protocol of the paper, which every run has that names no other.
    pub fn is_ours(&self) -> bool {
        self.id == MATCHBENCH.id
    }

    /// The name of an estimator under this protocol.
    pub fn name_of(&self, estimator: &str) -> String {
        if self.is_ours() {
            estimator.to_owned()
        } else {
            format!("{estimator}@{}", self.id)
        }
    }

    /// Why so many matches are too few for a pose, if they are.
    pub fn too_few(&self, matches: usize) -> Option<NoModel> {
        let (found, needed) = (matches, self.min_matches);
        (found < needed).then_some(NoModel::TooFewMatches { found, needed })
    }

    /// Why a pose with so many inliers, and so many matches in front of both cameras, counts as failed, if it does.
    pub fn too_weak(&self, inliers: usize, support: usize) -> Option<NoModel> {
        let least = [(inliers, self.min_inliers), (support, self.min_support)];
        let (found, needed) = least.into_iter().find(|(found, needed)| found < needed)?;
        Some(NoModel::NoSupport { found, needed })
    }

    /// The rules on which the records of a run depend, besides the estimator. `None` for the protocol of the
    /// paper, whose rules belong to the version.
    pub fn rules(&self) -> Option<Value> {
        let rules = json!({
            "id": self.id,
            "size": self.size.in_words(),
            "pixels": to_json(&self.pixels),
            "focal": to_json(&self.focal),
            "centres": to_json(&self.centres),
            "min_matches": self.min_matches,
            "min_inliers": self.min_inliers,
            "min_support": self.min_support,
        });
        (!self.is_ours()).then_some(rules)
    }

    /// Whether [`Protocol::view`] needs the sizes of the images.
    pub fn needs_sizes(&self) -> bool {
        self.size != SizeRule::AsIs
            && (self.pixels == Pixels::Resized || self.centres == Centres::Scaled)
    }

    /// How its estimator sees a pair of images of these `sizes`; `None` if nothing is changed.
    ///
    /// # Panics
    /// If the sizes are needed and missing.
    pub fn view(&self, cameras: [&Camera; 2], sizes: Option<[Size; 2]>) -> Option<PixelView> {
        let factors = if self.needs_sizes() {
            let sizes = sizes.expect("who asks knows whether sizes are needed");
            sizes.map(|size| self.size.factors(size))
        } else {
            [[1.0; 2]; 2]
        };
        PixelView::new(cameras, factors, self.pixels, self.focal, self.centres)
    }

    /// The matched points of a pair of images and their cameras as its estimator sees them.
    pub fn seen(
        &self,
        cameras: [&Camera; 2],
        sizes: [Size; 2],
        points: &MatchedPoints,
    ) -> (MatchedPoints, [Camera; 2]) {
        match self.view(cameras, Some(sizes)) {
            None => (points.clone(), cameras.map(Clone::clone)),
            Some(view) => (
                view.points(points),
                cameras.map(|camera| view.camera(camera)),
            ),
        }
    }

    /// The protocol in words: what it decides, and how.
    pub fn in_words(&self) -> Vec<(&'static str, String)> {
        let estimator = match self.estimator {
            EstimatorRule::Own => "the one that belongs to the matcher".to_owned(),
            EstimatorRule::Of { id, params } => {
                let params = params();
                let params = params.as_object().into_iter().flatten();
                let settings: Vec<String> = params
                    .map(|(name, value)| format!("{name} = {value}"))
                    .collect();
                format!("{id} ({})", settings.join(", "))
            }
        };
        let shuffles = match self.shuffles {
            1 => "once".to_owned(),
            times => format!("{times} times with other random choices, the errors pooled"),
        };
        let mut words = vec![
            ("images", self.size.in_words()),
            ("pose", estimator),
            ("threshold", self.unit_in_words()),
            ("estimated", shuffles),
            ("a pair fails", self.failure_in_words()),
            ("scores", self.scores.join(", ")),
        ];
        if self.centres == Centres::Scaled {
            let points =
                "multiplied by the ratio of sizes, which moves them by (1 - ratio) / 2 pixels";
            words.insert(3, ("points", points.to_owned()));
        }
        words.extend(self.notes.iter().map(|note| ("note", (*note).to_owned())));
        words
    }

    /// The pixels in which a threshold is measured and the focal length by which it is divided, in words.
    pub fn unit_in_words(&self) -> String {
        let pixels = match self.pixels {
            Pixels::Original => "pixels of the images as they are".to_owned(),
            Pixels::Resized => format!("pixels of images {}", self.size.in_words()),
        };
        let focal = match self.focal {
            Focal::Mean => "the mean of all four focal lengths",
            Focal::FirstXSecondY => "the mean of fx of the first camera and fy of the second",
            Focal::Harmonic => "the harmonic mean of both cameras' focal lengths",
        };
        format!("{pixels} over {focal}")
    }

    /// What a pair must have at least, or it failed.
    pub(crate) fn least_in_words(&self) -> Vec<String> {
        let Self {
            min_matches,
            min_inliers,
            min_support,
            ..
        } = self;
        let mut least = vec![format!("{min_matches} matches")];
        if *min_inliers > 0 {
            least.push(format!("{min_inliers} inliers"));
        }
        if *min_support > 1 {
            least.push(format!("{min_support} in front of both cameras"));
        }
        least
    }

    fn failure_in_words(&self) -> String {
        let failure = self.failure;
        let text = format!("with fewer than {}", self.least_in_words().join(", "));
        if failure.is_finite() {
            text + &format!("; its error is {failure} degrees")
        } else {
            text + "; its error is infinite"
        }
    }
}

impl SizeRule {
    /// The parameters that make every native matcher use this size; `None` for the original size.
    pub fn params(self) -> Option<Value> {
        match self {
            Self::AsIs => None,
            Self::LongSide(pixels) => Some(json!({"extractor": {"max_size": pixels}})),
            Self::Exactly(width, height) => {
                Some(json!({"extractor": {"size": format!("{width}x{height}")}}))
            }
        }
    }

    /// The size in words, as it follows *images* in a sentence.
    pub fn in_words(self) -> String {
        match self {
            Self::AsIs => "as they are".to_owned(),
            Self::LongSide(pixels) => format!("of {pixels} pixels along the longer side"),
            Self::Exactly(width, height) => format!("of {width}x{height} pixels"),
        }
    }

    /// Size of an image in the protocol divided by its own `size`, across and down.
    fn factors(self, size: Size) -> [f64; 2] {
        let [width, height] = [size.width, size.height].map(|length| length.max(1) as f64);
        match self {
            Self::AsIs => [1.0; 2],
            Self::LongSide(pixels) => [f64::from(pixels) / width.max(height); 2],
            Self::Exactly(w, h) => [f64::from(w) / width, f64::from(h) / height],
        }
    }
}

#[cfg(test)]
mod tests {
    use std::fs;

    use super::*;
    use crate::estimators;

    #[test]
    fn every_protocol_is_listed_documented_and_can_be_built() {
        let folder = concat!(env!("CARGO_MANIFEST_DIR"), "/src/protocols");
        let files = fs::read_dir(folder)
            .expect("the folder of this file")
            .count();
        assert_eq!(files - 2, PROTOCOLS.len(), "mod.rs and view.rs are none");
        for protocol in PROTOCOLS {
            assert_eq!(
                find(protocol.id).map(|found| found.id).ok(),
                Some(protocol.id)
            );
            if let EstimatorRule::Of { id, params } = protocol.estimator {
                let entry = estimators::find(id).expect("it is listed");
                entry
                    .build(Some(&params()))
                    .unwrap_or_else(|error| panic!("{error}"));
            }
            assert!(
                protocol.shuffles > 0 && protocol.min_matches >= 5 && !protocol.scores.is_empty()
            );
            let text = format!("{:?}", protocol.in_words());
            assert!(
                protocol
                    .notes
                    .iter()
                    .all(|note| text.contains(note) && note.ends_with('.'))
            );
        }
        assert!(
            find("superglu")
                .unwrap_err()
                .to_string()
                .contains("superglue")
        );
    }

    #[test]
    fn the_name_of_an_estimator_tells_its_protocol() {
        assert_eq!(SUPERGLUE.name_of("best"), "best@superglue");
        assert_eq!(of_estimator("best@superglue").id, "superglue");
        assert_eq!(without_protocol("best@superglue"), "best");
        for name in ["best", "best@2.5", ""] {
            assert_eq!(
                (of_estimator(name).id, without_protocol(name)),
                ("matchbench", name)
            );
        }
        assert_eq!(MATCHBENCH.name_of("best"), "best");
        assert!(MATCHBENCH.rules().is_none() && SUPERGLUE.rules().is_some());
        let all = find_all(&["all".into()]).expect("all are known");
        assert_eq!(all.len(), PROTOCOLS.len());
    }
}
