//! The input of a report: results, what is known of their pairs, pictures, facts about the run.

use std::collections::BTreeMap;

use rayon::prelude::*;

use crate::metrics::{Bootstrap, DatasetGeometry, Groups, Lead, ResultSet, Summary, groups, leads};
use crate::records::Plan;

use super::{DatasetFacts, PairView};

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
    /// Facts about the run.
    pub facts: RunFacts,
}

impl Content {
    /// Scores the results. Threads are used, and do not change the result.
    pub fn new(results: Vec<ResultSet>, bootstrap: &Bootstrap, facts: RunFacts) -> Self {
        let groups = groups(&results);
        Self::compared(results, groups, bootstrap, facts)
    }

    /// The same of results that were compared before.
    pub(super) fn compared(
        results: Vec<ResultSet>,
        groups: Groups,
        bootstrap: &Bootstrap,
        facts: RunFacts,
    ) -> Self {
        let mut summaries: Vec<Summary> = (results.par_iter())
            .map(|set| Summary::new(set, bootstrap))
            .collect();
        let leads = leads(&results, &groups, bootstrap);
        for (summary, letters) in summaries.iter_mut().zip(groups.letters) {
            summary.group = letters;
        }
        Self {
            summaries,
            leads,
            results,
            facts,
            ..Self::default()
        }
    }

    /// The plan of the run; `None` if the results did not come from a run.
    pub(super) fn plan(&self) -> Option<Plan> {
        serde_json::from_str(self.facts.plan.as_deref()?).ok()
    }
}
