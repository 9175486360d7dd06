//! Why tasks broke: the reasons in the records of a run, with how often each is there.

use std::cmp::Reverse;
use std::collections::BTreeMap;
use std::fmt;

use super::{Outcome, RunFolder, StoreError};
use crate::counted::counted;

/// Different reasons that are counted; what matchers from outside say may be another sentence for each pair.
const MAX_REASONS: usize = 1000;

/// Tasks of a matcher on a dataset that broke ([`Outcome::Failed`]) for the same reason.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct BrokenTasks {
    /// The dataset.
    pub dataset: String,
    /// The id of the matcher.
    pub matcher: String,
    /// What was wrong, in words.
    pub reason: String,
    /// How many tasks broke so.
    pub tasks: usize,
}

/// `3 tasks of orb on castle: out of memory`.
impl fmt::Display for BrokenTasks {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self {
            dataset,
            matcher,
            reason,
            tasks,
        } = self;
        let tasks = counted(*tasks, "task");
        write!(f, "{tasks} of {matcher} on {dataset}: {reason}")
    }
}

impl RunFolder {
    /// The tasks that broke, those of the most frequent reason first. Of more than a thousand different reasons the
    /// others are left out.
    ///
    /// # Errors
    /// As [`RunFolder::records`].
    pub fn broken(&self) -> Result<Vec<BrokenTasks>, StoreError> {
        let mut counts = BTreeMap::new();
        self.for_each(|record| {
            let Outcome::Failed { reason, .. } = record.outcome else {
                return;
            };
            let key = (record.task.dataset, record.task.matcher, reason);
            if let Some(count) = counts.get_mut(&key) {
                *count += 1;
            } else if counts.len() < MAX_REASONS {
                counts.insert(key, 1);
            }
        })?;
        let broken = counts.into_iter();
        let mut broken: Vec<_> = broken
            .map(|((dataset, matcher, reason), tasks)| BrokenTasks {
                dataset,
                matcher,
                reason,
                tasks,
            })
            .collect();
        broken.sort_by_key(|broken| Reverse(broken.tasks));
        Ok(broken)
    }
}
