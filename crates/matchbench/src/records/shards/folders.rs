//! Where the shards are, which of them are done, and whether two copies of one agree.

use crate::counted::counted;
use std::collections::BTreeMap;
use std::iter;
use std::path::{Path, PathBuf};

use super::super::{Plan, RunFolder, RunRecord, StageTimes, store};
use super::record_file::{RecordFile, count_lines};
use super::{ShardError, ShardPlan};

/// The folder of each shard, beginning with shard 1, all of them done: those in the folder of the plan, and
/// those in `copies`, each a copy of that folder or the folder of a shard.
///
/// # Errors
/// [`ShardError::Gaps`] names those that are not there or not done; [`ShardError::Differs`] tells of two
/// folders of one shard with different results; [`ShardError::Foreign`] of a folder that is no shard
/// of the plan.
pub(super) fn gather(
    plan: &ShardPlan,
    home: &Path,
    copies: &[PathBuf],
) -> Result<Vec<PathBuf>, ShardError> {
    let found = find(plan, home, copies)?;
    let (mut folders, mut gaps) = (Vec::new(), Vec::new());
    for number in 1..=plan.shards() {
        let mut whole: Option<&PathBuf> = None;
        let mut most = None;
        let copies = found.get(&number).map_or(&[][..], Vec::as_slice);
        for folder in copies {
            let (done, planned) = progress(plan, number, folder)?;
            most = most.max(Some((done, planned)));
            if done == planned && whole.is_none() {
                whole = Some(folder);
            }
        }
        let Some(whole) = whole else {
            let found = most.map_or_else(
                || "not begun".to_owned(),
                |(done, planned)| format!("{done} of {}", counted(planned, "task")),
            );
            gaps.push((number, found));
            continue;
        };
        for other in copies.iter().filter(|other| *other != whole) {
            compare(plan.plan(), number, whole, other)?;
        }
        folders.push(whole.clone());
    }
    if gaps.is_empty() {
        Ok(folders)
    } else {
        Err(ShardError::Gaps { shards: gaps })
    }
}

/// The folders of each shard by its number.
fn find(
    plan: &ShardPlan,
    home: &Path,
    copies: &[PathBuf],
) -> Result<BTreeMap<u32, Vec<PathBuf>>, ShardError> {
    let mut found: BTreeMap<u32, Vec<PathBuf>> = BTreeMap::new();
    for number in 1..=plan.shards() {
        for place in iter::once(home).chain(copies.iter().map(PathBuf::as_path)) {
            let folder = ShardPlan::shard_folder(place, number);
            if RunFolder::is_at(&folder) {
                check(plan, &folder, Some(number))?;
                found.entry(number).or_default().push(folder);
            }
        }
    }
    for copy in copies {
        if RunFolder::is_at(copy) && ShardPlan::open(copy).is_err() {
            let number = check(plan, copy, None)?;
            found.entry(number).or_default().push(copy.clone());
        } else if !copy.is_dir() {
            return Err(ShardError::NoPlan {
                folder: copy.clone(),
            });
        }
    }
    for folders in found.values_mut() {
        // The folder of the plan may have been named as its own copy.
        let mut seen = Vec::new();
        folders.retain(|folder| {
            let place = folder.canonicalize().unwrap_or_else(|_| folder.clone());
            let is_new = !seen.contains(&place);
            seen.push(place);
            is_new
        });
    }
    Ok(found)
}

/// The number of the shard in a folder, which must be of this plan.
fn check(plan: &ShardPlan, folder: &Path, number: Option<u32>) -> Result<u32, ShardError> {
    let foreign = |reason: &str| ShardError::Foreign {
        folder: folder.into(),
        reason: reason.into(),
    };
    let found = RunFolder::open(folder)?.plan().clone();
    let of = found
        .shard
        .clone()
        .ok_or_else(|| foreign("it is a run of its own"))?;
    if of.plan != plan.hash() {
        return Err(foreign("it was made by another plan"));
    }
    if number.is_some_and(|number| number != of.number) || plan.shard(of.number).is_err() {
        return Err(foreign(&format!("it says that it is shard {}", of.number)));
    }
    let whole = Plan {
        shard: None,
        ..found
    };
    plan.check(&whole)
        .map_err(|error| foreign(&error.to_string()))?;
    Ok(of.number)
}

/// How many tasks of a shard are recorded in a folder, and how many there are to be.
fn progress(plan: &ShardPlan, number: u32, folder: &Path) -> Result<(u64, u64), ShardError> {
    let (mut done, mut planned) = (0_u64, 0_u64);
    let repetitions = u64::from(plan.plan().settings.repetitions.get());
    for (dataset, stretches) in plan.plan().datasets.iter().zip(&plan.cut().datasets) {
        let tasks = stretches.pairs_of(number).saturating_mul(repetitions);
        for (matcher, estimator) in contenders(plan.plan()) {
            let file = store::path(folder, &dataset.name, matcher, estimator);
            let lines = count_lines(&file)?;
            if lines > tasks {
                return Err(ShardError::Broken {
                    number,
                    folder: folder.into(),
                    reason: format!(
                        "{} has more than {}",
                        file.display(),
                        counted(tasks, "record")
                    ),
                });
            }
            done += lines;
            planned = planned.saturating_add(tasks);
        }
    }
    Ok((done, planned))
}

/// Every matcher with every estimator, by id, in the order of the plan.
pub(super) fn contenders(plan: &Plan) -> impl Iterator<Item = (&str, &str)> {
    plan.matchers.iter().flat_map(|matcher| {
        let estimators = matcher.estimators.iter();
        estimators.map(|estimator| (&*matcher.id, &*estimator.id))
    })
}

/// Refuses another folder of the same shard whose results differ from the first; it may have fewer.
fn compare(plan: &Plan, number: u32, first: &Path, other: &Path) -> Result<(), ShardError> {
    for dataset in &plan.datasets {
        for (matcher, estimator) in contenders(plan) {
            let path = |folder: &Path| store::path(folder, &dataset.name, matcher, estimator);
            let (mut a, mut b) = (RecordFile::new(path(first)), RecordFile::new(path(other)));
            while let Some((_, record_b)) = b.next()? {
                let same = (a.next()?)
                    .is_some_and(|(_, record_a)| timeless(record_a) == timeless(record_b));
                if !same {
                    let file = path(Path::new(""));
                    return Err(ShardError::Differs {
                        number,
                        folders: [first.into(), other.into()],
                        file,
                        line: b.line(),
                    });
                }
            }
        }
    }
    Ok(())
}

/// A record without what no two runs share.
fn timeless(record: RunRecord) -> RunRecord {
    RunRecord {
        times: StageTimes::default(),
        device: None,
        ..record
    }
}
