//! What a run has planned but not recorded yet.

use super::ResultSet;
use crate::counted::counted;
use crate::records::Plan;

/// Methods that are named one by one.
const NAMED: usize = 4;

/// Of each method of the plan whose records are not as many as its tasks a sentence: the scores of a run that
/// was stopped, or has lost records, are not those of all its pairs. None of a shard, which has a part of the pairs.
pub fn unfinished(plan: &Plan, sets: &[ResultSet]) -> Vec<String> {
    let mut sentences = Vec::new();
    if plan.shard.is_some() {
        return sentences;
    }
    for dataset in &plan.datasets {
        let takes_part = |id: &String| (dataset.matchers.iter()).all(|ids| ids.contains(id));
        for matcher in plan
            .matchers
            .iter()
            .filter(|matcher| takes_part(&matcher.id))
        {
            for estimator in &matcher.estimators {
                let names = [&dataset.name, &matcher.id, &estimator.id];
                let set =
                    (sets.iter()).find(|set| [&set.dataset, &set.matcher, &set.estimator] == names);
                let (done, planned) = (set.map_or(0, recorded), plan.tasks_on(dataset));
                if done != planned {
                    sentences.push(format!(
                        "{} with {} on {}: {done} of {} recorded",
                        matcher.id,
                        estimator.id,
                        dataset.name,
                        counted(planned, "planned task")
                    ));
                }
            }
        }
    }
    if sentences.len() > NAMED + 1 {
        let more = sentences.split_off(NAMED).len();
        sentences.push(format!(
            "not finished either: {}",
            counted(more, "more method")
        ));
    }
    sentences
}

/// Tasks of a method that have a record.
fn recorded(set: &ResultSet) -> usize {
    set.ignored + set.pairs.len() - set.missing()
}
