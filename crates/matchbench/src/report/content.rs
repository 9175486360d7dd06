//! The input of a report: results, what is known of their pairs, pictures, facts about the run.

use std::collections::BTreeMap;

use rayon::prelude::*;

use crate::metrics::{
    DatasetGeometry, Groups, Lead, ResultSet, Summary, Unfinished, groups, leads,
};
use crate::records::{Plan, RunFolder};

use super::{DatasetFacts, Format, Lacking, PairView, render, render_with_intervals};

/// The version of this program.
pub(super) const THIS_VERSION: &str = env!("CARGO_PKG_VERSION");
/// The name of a fact that says which parameter was tuned, and on what.
pub(super) const TUNED: &str = "tuned parameter";

/// What a reader should know about the run besides its scores.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct RunFacts {
    /// Title of the page.
    pub title: String,
    /// Names and values in the order in which they are shown: version, seed, machine ...
    pub facts: Vec<(String, String)>,
    /// The plan of the run as text.
    pub plan: Option<String>,
    /// If the results came from files and not from a run: the arguments of `matchbench eval` that score the
    /// same results again (their folder, and which pairs count).
    pub results: Vec<String>,
}

/// All that a report shows.
#[derive(Clone, Debug, Default)]
pub struct Content {
    /// The datasets, as far as they are available.
    pub datasets: Vec<DatasetFacts>,
    /// Scores, one for each set of results.
    pub summaries: Vec<Summary>,
    /// On each dataset, the best method compared with the others.
    pub leads: Vec<Lead>,
    /// The results pair by pair.
    pub results: Vec<ResultSet>,
    /// Baseline, angle and overlap of the pairs, by dataset. What is missing is not shown.
    pub geometry: BTreeMap<String, DatasetGeometry>,
    /// How each matcher gets its features, by its id. Matchers with the same text have the same features, and
    /// the run extracts and times these once.
    pub extractions: BTreeMap<String, String>,
    /// What is known of the matchers that are not built in, in a few words, by their ids:
    /// `from outside, cuda, 1024 pixels`.
    pub outside: BTreeMap<String, String>,
    /// Pairs that are shown with pictures.
    pub views: Vec<PairView>,
    /// Why the truth of a dataset looks wrong, in sentences; see [`doubts`](crate::metrics::doubts()).
    pub doubts: Vec<String>,
    /// What the run has planned but not recorded, if it is not finished.
    pub lacking: Option<Lacking>,
    /// Facts about the run.
    pub facts: RunFacts,
}

impl Content {
    /// Scores the results. Threads are used, and do not change the result.
    pub fn new(results: Vec<ResultSet>, facts: RunFacts) -> Self {
        let groups = groups(&results);
        Self::compared(results, groups, facts)
    }

    /// The same of results that were compared before.
    pub(super) fn compared(results: Vec<ResultSet>, groups: Groups, facts: RunFacts) -> Self {
        let mut summaries: Vec<Summary> = (results.par_iter()).map(Summary::new).collect();
        let leads = leads(&results, &groups);
        let letters = groups.letters.into_iter().zip(groups.beyond_letters);
        for (summary, (letters, beyond)) in summaries.iter_mut().zip(letters) {
            summary.group = letters;
            summary.beyond_letters = beyond;
        }
        Self {
            summaries,
            leads,
            results,
            facts,
            ..Self::default()
        }
    }

    /// Takes note of `what` the `run` that its results are of has planned and not recorded.
    pub fn take_lacking(&mut self, run: &RunFolder, what: Option<Unfinished>) {
        self.lacking = Lacking::of(run, what);
    }

    /// The scores as text, as [`render`](super::render()) gives them; with a note above tables for people if the run is not
    /// finished.
    pub fn render(&self, format: Format) -> String {
        self.noted(format, render(format, &self.summaries))
    }

    /// The same with intervals; see [`render_with_intervals`](super::render_with_intervals()).
    pub fn render_with_intervals(&self, format: Format) -> Option<String> {
        let table = render_with_intervals(format, &self.summaries)?;
        Some(self.noted(format, table))
    }

    /// A table of its results in this format; with a note above tables for papers and pages if the run is not finished.
    pub fn noted(&self, format: Format, table: String) -> String {
        match &self.lacking {
            Some(lacking) => lacking.above(format, table),
            None => table,
        }
    }

    /// Says of each score how all listed pairs of its dataset are made, where the dataset is available: if only some
    /// of the pairs were scored, that cannot be told from them.
    pub(super) fn take_portions(&mut self) {
        for summary in &mut self.summaries {
            let facts = (self.datasets.iter()).find(|facts| facts.name == summary.dataset);
            summary.portion = facts.map_or(summary.portion, |facts| facts.portion);
        }
    }

    /// How many pairs of a dataset were scored, if any were: a run may take only some of them.
    pub(super) fn scored_pairs(&self, dataset: &str) -> Option<usize> {
        let sets = self.summaries.iter().filter(|set| set.dataset == dataset);
        sets.map(|set| set.pairs / set.repetitions.max(1) as usize)
            .max()
    }

    /// The plan of the run, as this version would write it: commands are for this version. `None` if the results
    /// did not come from a run.
    pub(super) fn plan(&self) -> Option<Plan> {
        let plan: Plan = serde_json::from_str(self.facts.plan.as_deref()?).ok()?;
        Some(plan.modernized())
    }

    /// The version of matchbench that the results are of: the one that did the run, or, of results of other programs, this one,
    /// which scores them.
    pub(super) fn version(&self) -> String {
        (self.plan()).map_or_else(|| THIS_VERSION.to_owned(), |plan| plan.version)
    }
}

#[cfg(test)]
mod tests {
    use serde_json::json;

    use super::super::again::Again;
    use super::super::names::defaults;
    use super::super::{method, tests};

    #[test]
    fn commands_and_words_have_no_parameter_of_an_earlier_version() {
        let mut content = tests::content(&[("room", "sift", 6)]);
        content.summaries[0].estimator = "lmeds-e".into();
        let mut lmeds = defaults("lmeds-e").expect("it is built in");
        lmeds["threshold_px"] = json!(1.0); // which had no effect, and is refused now
        let plan = json!({
            "version": "0.1.0",
            "settings": {"seed": 7, "repetitions": 1, "limit": null},
            "datasets": [
                {"name": "room", "path": "/x/room", "frames": 3, "pairs": 3, "fingerprint": "ab"},
            ],
            "matchers": [{
                "id": "sift", "params": defaults("sift"),
                "extraction": {"extractor": "x", "params": {}, "revision": 1},
                "estimators": [{"id": "lmeds-e", "params": lmeds}],
            }],
        });
        content.facts.plan = Some(plan.to_string());
        let room = &Again::of(&content).datasets[0];
        let (whole, cell) = (room.whole.first(), room.cells[0].run.as_ref());
        for line in [whole, cell] {
            let line = line.expect("a command can");
            assert!(
                line.contains("lmeds-e") && !line.contains("--set"),
                "{line}"
            );
        }
        let text = method::plain(&content);
        assert!(
            text.contains("lmeds-e") && !text.contains("threshold_px"),
            "{text}"
        );
    }
}
