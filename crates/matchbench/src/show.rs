//! One pair as a picture: matched and estimated as a run does it, its matches coloured by how far they are from the
//! truth.
//!
//! ```text
//! dataset, pair, contender --run::evaluate--> matches, outcome --report::view--> PairView --> PNG or SVG
//! ```

use std::io;
use std::sync::Arc;

use crate::counted::counted;
use crate::datasets::{DatasetError, Frame, Pair};
use crate::matchers::ImageFiles;
use crate::metrics::PairResult;
use crate::protocols::of_estimator;
use crate::records::{Counts, Outcome};
use crate::report::{PairView, Thumbnail, agrees_below, picture_png, picture_svg, sentence, view};
use crate::run::{
    Contender, Dataset, Evaluation, EvaluationError, ImagePair, RunError, check_truth, check_turns,
    evaluate, pair_seed,
};

/// Longest side of an image in the picture, and its JPEG quality.
const DRAWN: (u32, u8) = (1600, 88);

/// A pair that was matched, ready to be drawn.
#[derive(Debug)]
pub struct Shown {
    /// What is drawn.
    pub view: PairView,
    /// Dataset, pair, method and result, in a line.
    pub caption: String,
    /// How many features and matches there were.
    pub counts: Counts,
}

/// Why a pair cannot be shown.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum ShowError {
    /// The dataset does not list the pair.
    #[error("{dataset} has no pair {a} {b}; {}", if *.is_turned { "it has the two in the other order".to_owned() } else { format!("its {listed_in} lists those that it has") })]
    NoPair {
        /// The folder of the dataset.
        dataset: String,
        /// First frame.
        a: u32,
        /// Second frame.
        b: u32,
        /// Whether it lists the pair of the second and the first.
        is_turned: bool,
        /// Its file that lists its pairs.
        listed_in: &'static str,
    },
    /// The matcher cannot have the images, or the estimator has no truth to be compared with.
    #[error(transparent)]
    Contradiction(#[from] RunError),
    /// An image cannot be read.
    #[error(transparent)]
    Image(#[from] DatasetError),
    /// The pair could not be matched.
    #[error(transparent)]
    Evaluation(#[from] EvaluationError),
    /// The estimator broke.
    #[error("{0}")]
    Broke(String),
}

impl Shown {
    /// Matches the pair of frames `a` and `b` by the `contender`, whose first estimator is shown, with the random
    /// draws of the first repetition of a run with this `seed`. With `keypoints`, those without a match are drawn too.
    ///
    /// # Errors
    /// If the dataset has no such pair or no truth of it for the estimator, an image cannot be read, or matcher or
    /// estimator break.
    pub fn new(
        dataset: &Dataset,
        [a, b]: [u32; 2],
        contender: &Contender,
        seed: u64,
        keypoints: bool,
    ) -> Result<Self, ShowError> {
        let sequence = &dataset.sequence;
        check_turns(sequence, contender)?;
        let mut pairs = sequence.pairs.iter();
        let pair = pairs.find(|pair| (pair.a, pair.b) == (a, b));
        let pair = pair.ok_or_else(|| ShowError::NoPair {
            dataset: dataset.path.display().to_string(),
            a,
            b,
            is_turned: (sequence.pairs.iter()).any(|pair| (pair.a, pair.b) == (b, a)),
            listed_in: match sequence.pairs.first() {
                Some(pair) if pair.pose().is_none() => "homographies.txt",
                _ => "pairs.txt",
            },
        })?;
        check_truth(&sequence.name, [pair], contender)?;
        let frames = [a, b].map(|frame| &sequence.frames[frame as usize]);
        let evaluation = evaluated(&sequence.name, frames, pair, contender, seed)?;
        let (outcome, matches) = (&evaluation.outcomes[0], evaluation.matches);
        if let Outcome::Failed { reason, .. } = outcome {
            return Err(ShowError::Broke(reason.clone()));
        }
        let images = [frames[0].planes()?, frames[1].planes()?]
            .map(|planes| Arc::new(Thumbnail::new(&planes, DRAWN.0, DRAWN.1)));
        let mut view = view(sequence, pair, &matches, outcome, images)
            .expect("the truth that the estimator needs was checked");
        let features = evaluation.features.iter().flatten().filter(|_| keypoints);
        for (points, features) in view.keypoints.iter_mut().zip(features) {
            let keypoints = features.keypoints.iter();
            *points = keypoints.map(|keypoint| keypoint.at.cast()).collect();
        }
        let (matcher, estimator) = (contender.source.id(), &contender.estimators[0].name);
        let result = PairResult::of(a, b, outcome);
        let result = sentence(&result, of_estimator(estimator));
        Ok(Self {
            caption: format!(
                "{} {a} – {b}, {matcher} + {estimator}: {result}",
                sequence.name
            ),
            counts: matches.counts,
            view,
        })
    }

    /// The picture as a PNG.
    ///
    /// # Errors
    /// If an image cannot be decoded or encoded.
    pub fn png(&self) -> io::Result<Vec<u8>> {
        picture_png(&self.view, &self.caption)
    }

    /// The picture as an SVG.
    pub fn svg(&self) -> String {
        picture_svg(&self.view, &self.caption)
    }

    /// `1207 and 1190 features, 1207 putative and 340 selected matches, of which 300 are within 1 px of the estimate`.
    pub fn in_words(&self) -> String {
        // A matcher from outside may have no features, or not state their number.
        let Counts {
            features_a,
            features_b,
            putative,
            selected,
        } = self.counts;
        let features = match (features_a, features_b) {
            (0, 0) if putative > 0 => String::new(),
            (a, b) => format!("{a} and {}, ", counted(b, "feature")),
        };
        let selected = counted(selected, "selected match");
        let agree = self.view.tally.agree;
        format!(
            "{features}{putative} putative and {selected}, of which {agree} are within {} px of the estimate",
            agrees_below(self.view.model)
        )
    }
}

/// The pair, matched and estimated with the seed that it has in a run.
fn evaluated(
    dataset: &str,
    frames: [&Frame; 2],
    pair: &Pair,
    contender: &Contender,
    seed: u64,
) -> Result<Evaluation, ShowError> {
    let gray = [frames[0].pixels()?, frames[1].pixels()?];
    let matcher = contender.source.id();
    let seed = pair_seed(seed, dataset, matcher, (pair.a, pair.b), 0);
    let images = ImagePair {
        images: gray.each_ref(),
        cameras: frames.map(|frame| &frame.camera),
        truth: &pair.truth,
        files: Some(ImageFiles {
            dataset,
            frames: [pair.a, pair.b],
            images: frames.map(|frame| &*frame.image),
        }),
    };
    Ok(evaluate(contender, &images, seed)?)
}
