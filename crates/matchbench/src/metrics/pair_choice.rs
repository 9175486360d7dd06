//! Which of the pairs that a dataset lists are scored.

use std::path::Path;

use crate::datasets::{DatasetError, Frame, PairRule, Sequence, Unpaired};
use crate::records::RunFolder;

/// Gives the frames of the dataset with a name, if it is at hand.
pub(super) type FramesOf<'a> = dyn Fn(&str) -> Result<Option<Vec<Frame>>, DatasetError> + 'a;

/// Which of the listed pairs are scored.
#[derive(Clone, Debug, Default, PartialEq)]
pub enum PairChoice {
    /// All of them.
    #[default]
    Listed,
    /// Those that a rule chooses too. Frames are numbered as the results number them, so a stride
    /// has been applied already.
    Rule(PairRule),
    /// What the paper scores: of its sequences 06 to 08 every image with the next 9, of all others
    /// the listed pairs. The authors' folders hold all pairs of 06 to 08.
    Paper,
}

impl PairChoice {
    /// The rule for a dataset.
    fn rule(&self, dataset: &str) -> PairRule {
        let number = dataset.split(|c: char| !c.is_ascii_digit()).next();
        match self {
            Self::Rule(rule) => rule.clone(),
            Self::Paper if matches!(number, Some("06" | "07" | "08")) => {
                PairRule::Window { size: 9, stride: 1 }
            }
            Self::Listed | Self::Paper => PairRule::All,
        }
    }

    /// Whether a pair of a dataset is scored, whose frames are asked for if the rule is a list of names.
    ///
    /// # Errors
    /// If the list of pairs that the rule names cannot be read, or names images and no frame has this name.
    pub(super) fn of(
        &self,
        dataset: &str,
        frames: impl FnOnce() -> Result<Option<Vec<Frame>>, DatasetError>,
    ) -> Result<Box<dyn Fn(u32, u32) -> bool>, DatasetError> {
        self.rule(dataset).chooser(frames)
    }
}

/// The frames of a dataset of results, which a list of names is about: in its folder in `datasets`, or, if there is none,
/// where the `run` had it, if its cameras, pairs and truth are those of then.
///
/// # Errors
/// If the folder in `datasets` is there, and cannot be read.
pub fn frames_at_hand(
    dataset: &str,
    datasets: Option<&Path>,
    run: Option<&RunFolder>,
) -> Result<Option<Vec<Frame>>, DatasetError> {
    let named = datasets.map(|datasets| datasets.join(dataset));
    if let Some(named) = named.filter(|named| named.exists()) {
        return Unpaired::open(&named).map(|unpaired| Some(unpaired.into_frames()));
    }
    let planned = run.and_then(|run| {
        let mut all = run.plan().datasets.iter();
        all.find(|planned| planned.name == dataset)
    });
    let sequence =
        planned.and_then(|planned| Sequence::open_same(&planned.path, &planned.fingerprint));
    Ok(sequence.map(|sequence| sequence.frames))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_paper_cuts_its_wide_sequences_of_video_alone() {
        for (dataset, chosen) in [
            ("05-castle", true),
            ("06-office-wide", false),
            ("08", false),
            ("060-mine", true),
            ("mine", true),
        ] {
            let choice = PairChoice::Paper
                .of(dataset, || Ok(None))
                .expect("no file is needed");
            assert_eq!(choice(0, 10), chosen, "{dataset}");
            assert!(choice(1, 10), "{dataset}");
        }
    }

    #[test]
    fn what_is_listed_counts_in_either_order() {
        let window = PairChoice::Rule("window:2".parse().expect("a rule"));
        for choice in [PairChoice::Listed, window] {
            let chosen = choice.of("room", || Ok(None)).expect("no file is needed");
            assert!(chosen(3, 1) && chosen(1, 3), "{choice:?}");
        }
    }
}
