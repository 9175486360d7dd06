//! Joins runs of other matchers, estimators or datasets into one run: of the learned matchers on a machine with a GPU and
//! of the others elsewhere, or of two people.
//!
//! Records depend on the plan alone, so records of two plans that agree in what both have are those of one plan, see
//! [`plan`](mod@plan). What both runs have recorded is taken from the one that has more of it, with what waits there because
//! the run grew and was stopped (`earlier`): it waits in the joined run then. A native matcher has the same
//! matches in both. A matcher from outside may not; so all that is recorded of it on a dataset comes from one run.
//!
//! A run that is being written is refused, and none begins while they are joined: its records would be those of a later
//! time than its matches. All that is joined is read and checked before anything is written, and the run appears when all
//! of it is written, see [`staged`](super::staged): a join that is stopped leaves no run. The result is a run like any
//! other: it can be scored, reported, and go on.

mod plan;

use std::collections::{BTreeMap, BTreeSet, HashMap, HashSet};
use std::io::{self, Write};
use std::path::{Path, PathBuf};

use super::folder::hold;
use super::images::ImageNotes;
use super::line::to_line;
use super::staged::StagedRun;
use super::{
    DatasetPlan, FolderError, MatcherPlan, MatchesFile, Plan, RunFolder, RunWriter, StoreError,
    Tuned, check_tasks, earlier, matches, store,
};
use crate::counted::counted;
use crate::files::{WholeFile, open_file};
use plan::joined;

/// Why runs cannot be joined.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum JoinError {
    /// They are not runs of one plan.
    #[error(
        "{} cannot be joined with {}: {difference}; runs that are joined have the same version, seed, pairs and \
         repetitions, and the same parameters of what both have",
        first.display(), run.display()
    )]
    Differ {
        /// The first run.
        first: PathBuf,
        /// The run that has something else.
        run: PathBuf,
        /// What, in words.
        difference: String,
    },
    /// A run is a part of a larger one.
    #[error("{} is one shard of a run; make a run of all shards first, with `matchbench merge`", run.display())]
    Shard {
        /// The shard.
        run: PathBuf,
    },
    /// A matcher from outside is in two runs with other estimators, whose matches need not be the same.
    #[error(
        "{matcher} is in {} and in {} with other estimators on {dataset}, and a matcher from outside need not find the \
         same matches twice; run these estimators in one of them, whose matches they then get",
        runs[0].display(), runs[1].display()
    )]
    Twice {
        /// The matcher.
        matcher: String,
        /// The dataset.
        dataset: String,
        /// The runs.
        runs: [PathBuf; 2],
    },
    /// A matcher has estimators of poses on one dataset and of homographies on another, in different runs.
    #[error(
        "{matcher} is with {estimator} in one of the runs, and on {dataset} none of them estimated {}; the joined run would \
         want that too, which a dataset without their truth can never have: join runs of poses and of homographies apart",
        if *of_homographies { "homographies" } else { "poses" }
    )]
    NoTruth {
        /// The matcher.
        matcher: String,
        /// Its estimator.
        estimator: String,
        /// The dataset.
        dataset: String,
        /// Whether the estimator is of homographies.
        of_homographies: bool,
    },
    /// The images of a dataset are others.
    #[error(
        "the {what} of frame {frame} of {dataset} was another in {} than in the other runs; results for different \
         images are not joined",
        run.display()
    )]
    OtherImage {
        /// `image` or `depth`.
        what: &'static str,
        /// The dataset.
        dataset: String,
        /// The frame.
        frame: u32,
        /// The run that has another.
        run: PathBuf,
    },
    /// A run has a record that it did not plan, or twice.
    #[error("{}:{line}: {problem}", path.display())]
    Line {
        /// The file of records.
        path: PathBuf,
        /// The line, from 1.
        line: usize,
        /// What is wrong and what to do.
        problem: String,
    },
    /// There is a run already.
    #[error("{} holds a run already; choose another folder", out.display())]
    Taken {
        /// The folder.
        out: PathBuf,
    },
    /// A folder cannot be read or written.
    #[error(transparent)]
    Folder(#[from] FolderError),
    /// Records or matches cannot be read or written.
    #[error(transparent)]
    Store(#[from] StoreError),
    /// Another file cannot be written.
    #[error(transparent)]
    Io(#[from] io::Error),
}

/// What was joined.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Joined {
    /// Results that are planned.
    pub planned: u64,
    /// Those that are recorded.
    pub recorded: u64,
    /// Those that failed.
    pub failed: u64,
}

/// Joins these `runs` into a new one in the folder `out`.
///
/// # Errors
/// If one is no run, damaged, or written by a process, if they contradict each other, or if `out` holds a run or cannot be
/// written to. No run is left then.
pub fn join(runs: &[PathBuf], out: &Path) -> Result<Joined, JoinError> {
    if RunFolder::is_at(out) {
        return Err(JoinError::Taken { out: out.into() });
    }
    let _held = (runs.iter().map(|run| hold(run))).collect::<Result<Vec<_>, _>>()?;
    let folders = (runs.iter().map(|run| RunFolder::open(run))).collect::<Result<Vec<_>, _>>()?;
    let plan = joined(&folders)?;
    let images = Images::of(&folders, &plan)?;
    let taken = taken(&folders, &plan)?;
    let tuned = all_tuned(&folders)?;
    let noted = images.of_datasets(&plan);
    tuned
        .iter()
        .try_for_each(|tuned| tuned.check(&plan, &noted))?;
    let staged = StagedRun::start(out, plan)?;
    let done = staged.fill(|writer| {
        if !tuned.is_empty() {
            writer.note_tuned(&tuned)?;
        }
        images.write(writer)?;
        let folder = writer.folder();
        let mut done = Joined {
            planned: planned(folder.plan()),
            ..Joined::default()
        };
        for taken in &taken {
            taken.write(folder.path(), &mut done)?;
        }
        Ok(done)
    })?;
    staged.finish()?;
    Ok(done)
}

/// How many results are planned.
fn planned(plan: &Plan) -> u64 {
    let mut planned = 0_u64;
    for dataset in &plan.datasets {
        let methods = plan.matchers_on(dataset);
        let methods: usize = methods.map(|matcher| matcher.estimators.len()).sum();
        planned =
            planned.saturating_add((plan.tasks_on(dataset) as u64).saturating_mul(methods as u64));
    }
    planned
}

/// What is taken of a matcher on a dataset, and from which runs.
struct Taken<'f> {
    dataset: String,
    matcher: String,
    /// Of the selected matches, if any are kept.
    matches: Option<&'f RunFolder>,
    /// Of each estimator that has records.
    records: Vec<(String, &'f RunFolder)>,
}

/// From which run what is taken.
fn taken<'f>(folders: &'f [RunFolder], plan: &Plan) -> Result<Vec<Taken<'f>>, JoinError> {
    let mut all = Vec::new();
    let asked: Vec<Planned<'_>> =
        (folders.iter().map(|folder| Planned::of(folder.plan()))).collect();
    for dataset in &plan.datasets {
        for matcher in &plan.matchers {
            let mut found = BTreeMap::new();
            for (place, folder) in folders.iter().enumerate() {
                let Some(estimators) = asked[place].of_matcher(&dataset.name, &matcher.id) else {
                    continue;
                };
                for estimator in &matcher.estimators {
                    if !estimators.contains(&*estimator.id) {
                        continue;
                    }
                    let count = records(folder, dataset, [&matcher.id, &estimator.id])?;
                    if count.all > 0 {
                        found.insert((&*estimator.id, place), count);
                    }
                }
            }
            let places: Vec<usize> = match matcher.extraction {
                Some(_) => (0..folders.len()).collect(),
                None => vec![only(folders, &dataset.name, matcher, &found)?],
            };
            let most = |estimator: &str| {
                let has = |place: &&usize| found.contains_key(&(estimator, **place));
                // The first of those that have the most.
                let place = (places.iter().rev().filter(has))
                    .max_by_key(|place| found[&(estimator, **place)]);
                place.map(|place| (estimator.to_owned(), &folders[*place]))
            };
            let records: Vec<_> = (matcher.estimators.iter())
                .filter_map(|estimator| most(&estimator.id))
                .collect();
            let size = |place: &&usize| {
                let file = matches::path(folders[**place].path(), &dataset.name, &matcher.id);
                file.metadata().map_or(0, |file| file.len())
            };
            let largest = (places.iter().rev().filter(|place| size(place) > 0)).max_by_key(size);
            if records.is_empty() && largest.is_none() {
                continue;
            }
            all.push(Taken {
                dataset: dataset.name.clone(),
                matcher: matcher.id.clone(),
                matches: largest.map(|place| &folders[*place]),
                records,
            });
        }
    }
    Ok(all)
}

/// The run with the most records of a matcher from outside on a dataset, which must have what the others have.
fn only(
    folders: &[RunFolder],
    dataset: &str,
    matcher: &MatcherPlan,
    found: &BTreeMap<(&str, usize), Count>,
) -> Result<usize, JoinError> {
    let all = |place: usize| {
        let here = found.iter().filter(|((_, other), _)| *other == place);
        here.fold(Count::default(), |sum, (_, count)| Count {
            results: sum.results + count.results,
            all: sum.all + count.all,
        })
    };
    let place = (0..folders.len()).rev().max_by_key(|&place| all(place));
    let place = place.unwrap_or_default();
    let lacking = found
        .keys()
        .find(|(id, _)| !found.contains_key(&(*id, place)));
    match lacking {
        None => Ok(place),
        Some(&(_, other)) => Err(JoinError::Twice {
            matcher: matcher.id.clone(),
            dataset: dataset.to_owned(),
            runs: [&folders[place], &folders[other]].map(|run| run.path().to_path_buf()),
        }),
    }
}

/// What a run has planned, by its names.
struct Planned<'p> {
    /// The matchers of each dataset; `None` where it has all.
    datasets: HashMap<&'p str, Option<HashSet<&'p str>>>,
    /// The estimators of each matcher.
    matchers: HashMap<&'p str, HashSet<&'p str>>,
}

impl<'p> Planned<'p> {
    fn of(plan: &'p Plan) -> Self {
        let set = |ids: &'p Vec<String>| ids.iter().map(|id| &**id).collect();
        let estimators = |matcher: &'p MatcherPlan| {
            let estimators = matcher.estimators.iter();
            estimators.map(|estimator| &*estimator.id).collect()
        };
        Self {
            datasets: (plan.datasets.iter())
                .map(|dataset| (&*dataset.name, dataset.matchers.as_ref().map(set)))
                .collect(),
            matchers: (plan.matchers.iter())
                .map(|matcher| (&*matcher.id, estimators(matcher)))
                .collect(),
        }
    }

    /// The estimators of a matcher on a dataset, if it is run there.
    fn of_matcher(&self, dataset: &str, matcher: &str) -> Option<&HashSet<&'p str>> {
        let own = self.datasets.get(dataset)?;
        let is_run = own.as_ref().is_none_or(|own| own.contains(matcher));
        self.matchers.get(matcher).filter(|_| is_run)
    }
}

/// The records of a dataset, a matcher and an estimator. Failed tasks may be done again, so they count less than results.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord)]
struct Count {
    results: u64,
    all: u64,
}

/// The number of records of a dataset, a matcher and an estimator, which must be some that the run has planned.
fn records(
    folder: &RunFolder,
    dataset: &DatasetPlan,
    [matcher, estimator]: [&str; 2],
) -> Result<Count, JoinError> {
    let names = [&*dataset.name, matcher, estimator];
    let mut count = waiting(folder, names, folder.plan().tasks_on(dataset))?;
    let path = store::path(folder.path(), &dataset.name, matcher, estimator);
    if !path.exists() {
        return Ok(count);
    }
    let tasks = folder.plan().tasks_on(dataset);
    let mut lines = Vec::new();
    folder.for_each_in(&path, |line, record| {
        if lines.len() == tasks {
            let planned = counted(tasks, "task");
            let problem = format!("{planned} are planned; delete the file from this line on");
            return Err(JoinError::Line {
                path: path.clone(),
                line,
                problem,
            });
        }
        let task = &record.task;
        lines.push(([task.a, task.b, task.repetition], line));
        count.results += u64::from(!record.outcome.has_failed());
        count.all += 1;
        Ok(())
    })?;
    let planned = folder.plan().settings.repetitions.get() as usize;
    check_tasks(lines, planned).map_err(|(line, problem)| JoinError::Line {
        path,
        line,
        problem,
    })?;
    Ok(count)
}

/// The number of records of these names that wait in a run that grew, of so many planned `tasks`.
fn waiting(folder: &RunFolder, names: [&str; 3], tasks: usize) -> Result<Count, JoinError> {
    let (run, plan) = (folder.path(), folder.plan());
    let repetitions = plan.settings.repetitions.get();
    let (mut count, mut results) = (BTreeMap::new(), 0);
    earlier::for_each_waiting(run, plan.format, names, |line, record| {
        let task = &record.task;
        let is_of_names = [&*task.dataset, &*task.matcher, &*task.estimator] == names;
        // A process that was killed may have left some twice; the later one counts.
        let is_result = !record.outcome.has_failed();
        let before = count.insert((task.a, task.b, task.repetition), is_result);
        results += u64::from(is_result);
        results -= u64::from(before == Some(true));
        if !is_of_names || task.repetition >= repetitions || count.len() > tasks {
            return Err(JoinError::Line {
                path: earlier::path(run, names),
                line,
                problem: "the plan has no such task; delete the file from this line on".into(),
            });
        }
        Ok(())
    })?;
    Ok(Count {
        results,
        all: count.len() as u64,
    })
}

impl Taken<'_> {
    /// Writes it into the run `out`: matches first, since records refer to them.
    fn write(&self, out: &Path, done: &mut Joined) -> Result<(), StoreError> {
        if let Some(folder) = self.matches {
            let path = |run: &Path| matches::path(run, &self.dataset, &self.matcher);
            copy_matches(&path(folder.path()), &path(out))?;
        }
        for (estimator, folder) in &self.records {
            let inliers =
                |run: &Path| matches::inliers_path(run, &self.dataset, &self.matcher, estimator);
            if inliers(folder.path()).exists() {
                copy_matches(&inliers(folder.path()), &inliers(out))?;
            }
            let names = [&*self.dataset, &*self.matcher, estimator];
            copy_waiting(folder, names, out)?;
            if !store::path(folder.path(), &self.dataset, &self.matcher, estimator).exists() {
                continue;
            }
            let path = store::path(out, &self.dataset, &self.matcher, estimator);
            let unwritable = StoreError::io("write", &path);
            let mut file = WholeFile::create(&path).map_err(unwritable)?;
            let mut written = Ok(());
            folder.for_each_of(names, |record| {
                if written.is_ok() {
                    written = file.write_all(&to_line(&record));
                }
                done.recorded += 1;
                done.failed += u64::from(record.outcome.has_failed());
            })?;
            written.and_then(|()| file.finish()).map_err(unwritable)?;
        }
        Ok(())
    }
}

/// Writes what waits of these names in a run that grew into the run `out`.
fn copy_waiting(folder: &RunFolder, names: [&str; 3], out: &Path) -> Result<(), StoreError> {
    let mut copy = None;
    let (run, format) = (folder.path(), folder.plan().format);
    let path = earlier::path(out, names);
    let unwritable = StoreError::io("write", &path);
    earlier::for_each_waiting(run, format, names, |_, record| {
        let file = match &mut copy {
            Some(file) => file,
            none => none.insert(WholeFile::create(&path).map_err(unwritable)?),
        };
        (file.write_all(&to_line(&record))).map_err(unwritable)
    })?;
    copy.map_or(Ok(()), |file| file.finish().map_err(unwritable))
}

/// Copies a file of matches that is none but that.
fn copy_matches(from: &Path, to: &Path) -> Result<(), StoreError> {
    MatchesFile::open(from)?;
    let mut source = open_file(from).map_err(StoreError::io("read", from))?;
    let unwritable = StoreError::io("write", to);
    let mut copy = WholeFile::create(to).map_err(unwritable)?;
    io::copy(&mut source, &mut copy).map_err(unwritable)?;
    copy.finish().map_err(unwritable)
}

/// The notes of the images, and of their depth, of each dataset.
struct Images {
    notes: Vec<(String, &'static str, BTreeMap<u32, blake3::Hash>)>,
}

impl Images {
    /// Those of all runs, which must agree.
    fn of(folders: &[RunFolder], plan: &Plan) -> Result<Self, JoinError> {
        let mut notes = Vec::new();
        for dataset in &plan.datasets {
            for what in ["image", "depth"] {
                let mut all = BTreeMap::new();
                for folder in folders {
                    let notes = noted(folder, what, &dataset.name)?;
                    if what == "image" {
                        folder.refuse_lost(&notes)?;
                    }
                    for (&frame, &hash) in notes.known() {
                        if *all.entry(frame).or_insert(hash) != hash {
                            return Err(JoinError::OtherImage {
                                what,
                                dataset: dataset.name.clone(),
                                frame,
                                run: folder.path().into(),
                            });
                        }
                    }
                }
                notes.push((dataset.name.clone(), what, all));
            }
        }
        Ok(Self { notes })
    }

    /// The hashes of the images of each dataset of the plan.
    fn of_datasets(&self, plan: &Plan) -> Vec<BTreeSet<String>> {
        let of_one = |dataset: &DatasetPlan| {
            let its = (self.notes.iter())
                .filter(|(name, what, _)| *name == dataset.name && *what == "image");
            let hashes = its.flat_map(|(_, _, known)| known.values());
            hashes.map(|hash| hash.to_hex().to_string()).collect()
        };
        plan.datasets.iter().map(of_one).collect()
    }

    fn write(&self, writer: &RunWriter) -> Result<(), FolderError> {
        for (dataset, what, all) in &self.notes {
            let mut notes = noted(writer.folder(), what, dataset)?;
            if *what == "image" {
                // Also where no run has noted any, being of the first format.
                notes.begin()?;
            }
            for (&frame, &hash) in all {
                notes.note(frame, writer.folder().path(), hash)?;
            }
        }
        Ok(())
    }
}

fn noted(folder: &RunFolder, what: &str, dataset: &str) -> Result<ImageNotes, FolderError> {
    match what {
        "image" => folder.images_of(dataset),
        _ => folder.depth_of(dataset),
    }
}

/// The settings that any of the runs took over from tuning, each once.
fn all_tuned(folders: &[RunFolder]) -> Result<Vec<Tuned>, FolderError> {
    let of_each = folders.iter().map(RunFolder::tuned);
    let of_each = of_each.collect::<Result<Vec<_>, _>>()?;
    Ok(Tuned::each_once(of_each.into_iter().flatten()))
}
