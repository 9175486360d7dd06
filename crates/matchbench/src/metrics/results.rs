//! Results from disk: a run folder, or anybody's results in the authors' layout.
//!
//! - A [`RunFolder`] holds records. Poses were compared with the truth when they were recorded.
//! - The authors' layout is `<sequence>/<matcher>.txt`, one row `a b count` + 3x4 pose a pair; a row
//!   with a zero translation is a pair without a pose. The truth comes from
//!   `<datasets>/<sequence>/pairs.txt` or from a `groundtruth.txt` beside the matchers' files (see
//!   `published.rs`). A file may be called `<matcher>+<estimator>.txt`.
//!
//! What is scored are the pairs that the dataset lists, of these only those that a [`PairChoice`]
//! leaves, or, for a run whose datasets are not at
//! hand, the pairs that any of its matchers has a record of. Rows for other pairs are ignored and
//! counted, listed pairs without a row are failures, and a second row for the same pair is an
//! error: nobody could say which one counts.

use std::collections::BTreeMap;
use std::fs;
use std::io;
use std::mem;
use std::path::{Path, PathBuf};

use crate::counted::counted;
use crate::datasets::{DatasetError, Pair, read_dataset_pairs};
use crate::records::authors::AuthorsError;
use crate::records::{FolderError, Plan, RunFolder, StoreError};

use super::broken::count_broken;
use super::pair_choice::PairChoice;
use super::{Failure, PairResult, ResultSet};

/// One file of records, or of results in the authors' layout: what stands in it, or why that cannot be scored.
#[derive(Debug)]
pub struct FileResults {
    /// The file; a folder of files where none of them can be scored.
    pub file: PathBuf,
    /// Hash of the true poses that results in the authors' layout were judged by: of a dataset that is at hand
    /// its [fingerprint](crate::datasets::Sequence::fingerprint), else that of the listed pairs alone. A run has
    /// it in its plan.
    pub truth: Option<String>,
    /// What stands in it.
    pub results: Result<ResultSet, ResultsError>,
}

/// Why results cannot be scored.
#[derive(Debug, thiserror::Error)]
pub enum ResultsError {
    /// A file or folder cannot be read.
    #[error("{path}: {error}")]
    Io {
        /// The file or folder.
        path: PathBuf,
        /// What the system says.
        error: io::Error,
    },
    /// A line is not what it should be.
    #[error("{path}:{line}: {problem}")]
    Line {
        /// The file.
        path: PathBuf,
        /// The line, from 1.
        line: usize,
        /// What is wrong and what to do.
        problem: String,
    },
    /// A list of pairs is wrong.
    #[error(transparent)]
    Pairs(#[from] DatasetError),
    /// A file in the authors' layout is wrong.
    #[error(transparent)]
    Rows(#[from] AuthorsError),
    /// The folder of a run is wrong.
    #[error(transparent)]
    Run(#[from] FolderError),
    /// A file of records is wrong.
    #[error(transparent)]
    Records(#[from] StoreError),
    /// A file or folder is not where it should be.
    #[error("{path}: {problem}")]
    Layout {
        /// Where it was looked for.
        path: PathBuf,
        /// What is wrong and what to do.
        problem: String,
    },
}

/// Every set of results of a run, in the order of its plan; what the plan does not name comes last.
/// Of the pairs only the chosen ones.
pub(super) fn of_run(
    run: &RunFolder,
    datasets: Option<&Path>,
    choice: &PairChoice,
) -> Result<Vec<ResultSet>, ResultsError> {
    let mut sets = Vec::new();
    for file in run.record_files()? {
        sets.extend(read_records(run, &file)?);
    }
    sort(&mut sets);
    order_as_planned(&mut sets, run.plan());
    complete_all(run.path(), sets.iter_mut(), datasets, choice)?;
    Ok(sets)
}

/// The results in each file of records of a run by themselves, in the order of the pairs; none of a file without
/// records. Only what is recorded: the other files may be anybody's, and do not say what this one lacks.
pub(super) fn each_of_run(run: &RunFolder) -> Result<Vec<FileResults>, ResultsError> {
    let mut each = Vec::new();
    for file in run.record_files()? {
        if let Some(results) = read_records(run, &file).transpose() {
            each.push(FileResults {
                file,
                truth: None,
                results,
            });
        }
    }
    let sound = each
        .iter_mut()
        .filter_map(|file| file.results.as_mut().ok());
    let mut sound: Vec<&mut ResultSet> = sound.collect();
    for set in &mut sound {
        set.pairs.sort_unstable_by_key(task);
    }
    count_broken(&mut sound);
    Ok(each)
}

fn task(pair: &PairResult) -> (u32, u32, u32) {
    (pair.a, pair.b, pair.repetition)
}

/// Missing results that are always made: those of 316 files with a record each of another pair, which are compared with
/// each other within seconds. A thousand such files take minutes.
const MISSING: u64 = 100_000;
/// More of them are made if there are no more than so many to each record. A run finishes one matcher after the other,
/// so there are few, but thousands of files with a line each would stand for millions.
const MISSING_FOR_EACH: u64 = 20;

/// Whether so many missing results are not made beside those that were `found`.
fn are_too_many(missing: u64, found: u64) -> bool {
    missing > MISSING.max(found.saturating_mul(MISSING_FOR_EACH))
}

/// Brings sets of results of a `run` into line with the pairs that count of their datasets.
fn complete_all<'a>(
    run: &Path,
    sets: impl Iterator<Item = &'a mut ResultSet>,
    datasets: Option<&Path>,
    choice: &PairChoice,
) -> Result<(), ResultsError> {
    let mut sets: Vec<&mut ResultSet> = sets.collect();
    let mut listed = BTreeMap::<String, Vec<(u32, u32)>>::new();
    for set in &sets {
        let pairs = listed.entry(set.dataset.clone()).or_default();
        match datasets {
            Some(datasets) if pairs.is_empty() => {
                let list = listed_pairs(datasets, &set.dataset)?;
                pairs.extend(list.iter().map(|pair| (pair.a, pair.b)));
            }
            Some(_) => {}
            None => pairs.extend(set.pairs.iter().map(|pair| (pair.a, pair.b))),
        }
        pairs.sort_unstable();
        pairs.dedup();
    }
    for (dataset, pairs) in &mut listed {
        let chosen = choice.of(dataset)?;
        pairs.retain(|&(a, b)| chosen(a, b));
    }
    let expected = |set: &&mut ResultSet| {
        (listed[&set.dataset].len() as u64).saturating_mul(u64::from(set.repetitions))
    };
    let found: u64 = sets.iter().map(|set| set.pairs.len() as u64).sum();
    let missing = (sets.iter().map(expected))
        .fold(0, u64::saturating_add)
        .saturating_sub(found);
    if are_too_many(missing, found) {
        let files = counted(sets.len(), "file");
        return Err(ResultsError::Layout {
            path: run.to_path_buf(),
            problem: format!(
                "{files} with {found} records in all stand for {missing} missing ones; finish the run, choose fewer \
                 pairs, or delete the files of matchers that were hardly begun"
            ),
        });
    }
    for set in &mut sets {
        complete(set, &listed[&set.dataset]);
    }
    count_broken(&mut sets);
    Ok(())
}

/// Brings the pairs of a run into line with the listed ones, which are sorted: others out, missing ones in.
fn complete(set: &mut ResultSet, listed: &[(u32, u32)]) {
    set.pairs.sort_unstable_by_key(task);
    let repetitions = set.repetitions;
    let expected =
        || (listed.iter()).flat_map(move |&(a, b)| (0..repetitions).map(move |r| (a, b, r)));
    // Millions of pairs are not copied where none is missing.
    if expected().eq(set.pairs.iter().map(task)) {
        return;
    }
    let found = set.pairs.len();
    let mut results = mem::take(&mut set.pairs).into_iter().peekable();
    let mut scored = 0;
    for (a, b, repetition) in expected() {
        while results
            .next_if(|other| task(other) < (a, b, repetition))
            .is_some()
        {}
        let result = results.next_if(|result| task(result) == (a, b, repetition));
        scored += usize::from(result.is_some());
        set.pairs.push(result.unwrap_or_else(|| PairResult {
            repetition,
            ..PairResult::failed(a, b, Failure::Missing)
        }));
    }
    set.ignored = found - scored;
}

/// The records of one file; none where nothing has been recorded yet.
fn read_records(run: &RunFolder, file: &Path) -> Result<Option<ResultSet>, ResultsError> {
    let mut set: Option<ResultSet> = None;
    let mut lines = Vec::new();
    run.for_each_in(file, |line, record| {
        let task = &record.task;
        lines.push(([task.a, task.b, task.repetition], line));
        let set = set.get_or_insert_with(|| ResultSet {
            dataset: task.dataset.clone(),
            matcher: task.matcher.clone(),
            estimator: task.estimator.clone(),
            repetitions: 1,
            pairs: Vec::new(),
            ignored: 0,
        });
        set.repetitions = set.repetitions.max(task.repetition.saturating_add(1));
        set.pairs.push(PairResult::from(&record));
        Ok::<_, ResultsError>(())
    })?;
    check_tasks(file, lines, run.plan().settings.repetitions.get() as usize)?;
    Ok(set)
}

/// Whether no task, a pair and a repetition of it, stands in two lines, none without the repetition before it, and
/// every pair in the `planned` number of repetitions. Only the pair that was recorded last may have fewer, so that a
/// few lines do not stand for millions of results that are missing.
fn check_tasks(
    file: &Path,
    mut lines: Vec<([u32; 3], usize)>,
    planned: usize,
) -> Result<(), ResultsError> {
    lines.sort_unstable();
    let wrong = |line, problem| {
        Err(ResultsError::Line {
            path: file.to_path_buf(),
            line,
            problem,
        })
    };
    let mut before = None;
    for &(task, line) in &lines {
        let [a, b, repetition] = task;
        if let Some((same, first)) = before
            && same == task
        {
            return Err(twice(file, line, (a, b), first));
        }
        // A run does them in their order, so a number stands for that many records.
        let follows = |(other, earlier)| other == [a, b, repetition - 1] && earlier < line;
        if repetition > 0 && !before.is_some_and(follows) {
            let problem = format!(
                "repetition {repetition} of the pair {a} {b} without the one before it; delete this line"
            );
            return wrong(line, problem);
        }
        before = Some((task, line));
    }
    let last = lines.iter().map(|&(_, line)| line).max();
    for pair in lines.chunk_by(|(task, _), (next, _)| task[..2] == next[..2]) {
        let ([a, b, repetition], line) = pair[pair.len() - 1];
        if pair.len() > planned {
            let planned = counted(planned, "planned repetition");
            let problem = format!("repetition {repetition} of the pair {a} {b}, of {planned}");
            return wrong(line, format!("{problem} from 0 on; delete this line"));
        }
        if pair.len() < planned && Some(line) != last {
            let planned = counted(planned, "planned repetition");
            let problem = format!(
                "the pair {a} {b} ends here after {} of {planned}",
                pair.len()
            );
            return wrong(line, format!("{problem}; delete its lines"));
        }
    }
    Ok(())
}

/// The pairs of a dataset in the folder `datasets`, with their truth.
pub(super) fn listed_pairs(datasets: &Path, dataset: &str) -> Result<Vec<Pair>, ResultsError> {
    let dir = datasets.join(dataset);
    if !["pairs.txt", "homographies.txt"]
        .iter()
        .any(|list| dir.join(list).is_file())
    {
        return Err(ResultsError::Layout {
            path: dir,
            problem: format!(
                "neither pairs.txt nor homographies.txt is there, which the results for {dataset} are scored by; name \
                 the folder that holds {dataset}/pairs.txt with --datasets"
            ),
        });
    }
    Ok(read_dataset_pairs(&dir)?)
}

/// Datasets, matchers and estimators in the order in which the plan names them; what it does not name comes
/// last.
fn order_as_planned(sets: &mut [ResultSet], plan: &Plan) {
    let dataset = |name: &str| (plan.datasets.iter()).position(|dataset| dataset.name == name);
    let matcher = |id: &str| (plan.matchers.iter()).position(|matcher| matcher.id == id);
    let estimators = (plan.matchers.iter()).flat_map(|matcher| &matcher.estimators);
    let estimator = |id: &str| estimators.clone().position(|estimator| estimator.id == id);
    let last = usize::MAX;
    sets.sort_by_cached_key(|set| {
        (
            dataset(&set.dataset).unwrap_or(last),
            matcher(&set.matcher).unwrap_or(last),
            estimator(&set.estimator).unwrap_or(last),
        )
    });
}

pub(super) fn sort(sets: &mut [ResultSet]) {
    let key = |set: &ResultSet| {
        let names = [&set.dataset, &set.matcher, &set.estimator];
        names.map(String::clone)
    };
    sets.sort_by_cached_key(key);
}

/// Subfolders and their names, sorted.
pub(super) fn folders(path: &Path) -> Result<Vec<(String, PathBuf)>, ResultsError> {
    let mut folders = entries(path)?;
    folders.retain(|(_, path)| path.is_dir());
    Ok(folders)
}

/// Files with this extension and their names without it, sorted.
pub(super) fn files(path: &Path, extension: &str) -> Result<Vec<(String, PathBuf)>, ResultsError> {
    let mut files = entries(path)?;
    files.retain(|(_, path)| path.is_file() && path.extension().is_some_and(|e| e == extension));
    for (name, _) in &mut files {
        name.truncate(name.len() - extension.len() - 1);
    }
    Ok(files)
}

fn entries(path: &Path) -> Result<Vec<(String, PathBuf)>, ResultsError> {
    let io = |error| ResultsError::Io {
        path: path.to_path_buf(),
        error,
    };
    let mut entries = Vec::new();
    for entry in fs::read_dir(path).map_err(io)? {
        let entry = entry.map_err(io)?;
        entries.push((
            entry.file_name().to_string_lossy().into_owned(),
            entry.path(),
        ));
    }
    entries.sort();
    Ok(entries)
}

pub(super) fn twice(file: &Path, line: usize, (a, b): (u32, u32), first: usize) -> ResultsError {
    ResultsError::Line {
        path: file.to_path_buf(),
        line,
        problem: format!(
            "pair {a} {b} is there twice, first on line {first}; delete the one that does not count"
        ),
    }
}

#[cfg(test)]
mod tests {
    use serde_json::json;

    use super::super::{load, load_each};
    use super::*;

    /// A record as a run writes it, right up to 5 degrees.
    fn line(matcher: &str, a: u32, b: u32, repetition: u32) -> String {
        format!(
            r#"{{"task":{{"dataset":"room","matcher":"{matcher}","estimator":"ransac-e","a":{a},"b":{b},"repetition":{repetition}}},"#,
        ) + r#""counts":{"features_a":900,"features_b":800,"putative":500,"selected":90},"#
            + r#""outcome":{"kind":"pose","rotation":[1,0,0,0,1,0,0,0,1],"translation":[1,0,0],"#
            + r#""inliers":70,"support":80,"iterations":12,"rotation_error":0.5,"translation_error":4.5},"#
            + r#""times":{"search":0.25}}"#
            + "\n"
    }

    fn run_folder(files: &[(&str, String)]) -> tempfile::TempDir {
        let run = tempfile::tempdir().expect("a temporary folder");
        let records = run.path().join("records/room");
        fs::create_dir_all(&records).expect("a folder can be made");
        plan(run.path(), &[], 1);
        for (matcher, text) in files {
            let name = format!("{matcher}+ransac-e.jsonl");
            fs::write(records.join(name), text).expect("it is ours");
        }
        run
    }

    /// Writes a plan of so many repetitions that names these matchers.
    fn plan(run: &Path, matchers: &[&str], repetitions: u32) {
        let matchers: Vec<_> = (matchers.iter())
            .map(|id| json!({"id": id, "params": {}, "estimators": []}))
            .collect();
        let plan = json!({
            "version": "0.1.0",
            "settings": {"seed": 0, "repetitions": repetitions, "limit": null},
            "datasets": [],
            "matchers": matchers
        });
        fs::write(run.join("plan.json"), plan.to_string()).expect("it is ours");
    }

    #[test]
    fn a_pair_that_another_matcher_has_is_missing() {
        let sift = line("sift", 0, 1, 0) + &line("sift", 0, 2, 0);
        let run = run_folder(&[("sift", sift), ("orb", line("orb", 0, 2, 0))]);
        let sets = load(run.path(), None).expect("both files are in order");
        assert_eq!((&*sets[0].matcher, &*sets[1].matcher), ("orb", "sift"));
        assert_eq!(sets[0].pairs[0].outcome, Err(Failure::Missing));
        let right = &sets[0].pairs[1];
        assert_eq!((right.a, right.b, right.correspondences), (0, 2, Some(80)));
        assert_eq!(right.times.search, Some(0.25));
        assert!(sets[1].pairs.iter().all(|pair| pair.outcome.is_ok()));
    }

    #[test]
    fn the_dataset_says_which_pairs_count() {
        let text = line("sift", 0, 1, 0) + &line("sift", 7, 9, 0);
        let run = run_folder(&[("sift", text)]);
        let dataset = run.path().join("datasets/room");
        fs::create_dir_all(&dataset).expect("a folder can be made");
        let pose = "1 0 0 0 0 1 0 0 0 0 1 1";
        fs::write(
            dataset.join("pairs.txt"),
            format!("0 1 {pose}\n0 3 {pose}\n"),
        )
        .expect("it is ours");
        let sets = load(run.path(), Some(&run.path().join("datasets"))).expect("in order");
        assert_eq!((sets[0].pairs.len(), sets[0].ignored), (2, 1));
        assert_eq!(sets[0].pairs[1].outcome, Err(Failure::Missing));
    }

    #[test]
    fn pairs_come_in_their_order_whatever_that_of_the_records() {
        let text = [(2, 3), (0, 9), (0, 4)].map(|(a, b)| line("sift", a, b, 0));
        let sets = load(run_folder(&[("sift", text.concat())]).path(), None).expect("in order");
        let pairs: Vec<_> = sets[0].pairs.iter().map(|pair| (pair.a, pair.b)).collect();
        assert_eq!(pairs, [(0, 4), (0, 9), (2, 3)]);
        assert!(sets[0].pairs.iter().all(|pair| pair.outcome.is_ok()));
    }

    #[test]
    fn each_repetition_counts() {
        let text = line("sift", 0, 1, 0) + &line("sift", 0, 1, 1) + &line("sift", 0, 2, 0);
        let run = run_folder(&[("sift", text)]);
        plan(run.path(), &[], 2);
        let sets = load(run.path(), None).expect("in order");
        assert_eq!((sets[0].repetitions, sets[0].pairs.len()), (2, 4));
        assert_eq!(sets[0].pairs[3].outcome, Err(Failure::Missing));
    }

    #[test]
    fn few_lines_do_not_stand_for_many_missing_results() {
        let short = line("sift", 0, 1, 0) + &line("sift", 0, 2, 0) + &line("sift", 0, 2, 1);
        let run = run_folder(&[("sift", short)]);
        let refused = |expected: &str| {
            let error = load(run.path(), None).expect_err(expected).to_string();
            assert!(error.contains(expected), "{error}");
        };
        refused(":3: repetition 1 of the pair 0 2, of 1 planned repetition");
        plan(run.path(), &[], 2);
        refused(":1: the pair 0 1 ends here after 1 of 2 planned repetitions");
        // By themselves files have what is recorded, whatever stands in others.
        let whole = line("orb", 0, 1, 0) + &line("orb", 0, 1, 1);
        let run = run_folder(&[("orb", whole), ("sift", line("sift", 0, 3, 0))]);
        plan(run.path(), &[], 2);
        let each = load_each(run.path(), None).expect("both can be read");
        let recorded = |file: &FileResults| file.results.as_ref().expect("in order").pairs.len();
        let recorded: Vec<usize> = each.iter().map(recorded).collect();
        assert_eq!(recorded, [2, 1]);
    }

    #[test]
    fn few_files_do_not_stand_for_many_missing_results() {
        // As many files as pairs, each with one of them.
        let sets = |count: u32| {
            let set = |i: u32| ResultSet {
                dataset: "room".into(),
                matcher: i.to_string(),
                estimator: "ransac-e".into(),
                repetitions: 1,
                pairs: vec![PairResult::failed(0, i + 1, Failure::NoSupport)],
                ignored: 0,
            };
            (0..count).map(set).collect::<Vec<_>>()
        };
        let complete = |sets: &mut [ResultSet]| {
            complete_all(Path::new("run"), sets.iter_mut(), None, &PairChoice::Listed)
        };
        let mut few = sets(30);
        complete(&mut few).expect("few are missing");
        assert!(few.iter().all(|set| set.pairs.len() == 30));
        let mut many = sets(320);
        let error = complete(&mut many).expect_err("too many").to_string();
        assert!(
            error.starts_with("run: 320 files with 320 records in all stand for 102080 missing"),
            "{error}"
        );
        assert!(many.iter().all(|set| set.pairs.len() == 1));
        // A large run may miss as many as it likes of what it has begun.
        assert!(!are_too_many(100_000_000, 5_000_000));
    }

    #[test]
    fn a_torn_last_line_is_not_there_yet() {
        let text = line("sift", 0, 1, 0) + line("sift", 0, 2, 0).trim_end();
        let sets = load(run_folder(&[("sift", text)]).path(), None).expect("in order");
        assert_eq!(sets[0].pairs.len(), 1);
        let nothing_yet = run_folder(&[("sift", String::new())]);
        assert_eq!(load(nothing_yet.path(), None).expect("in order"), []);
    }

    #[test]
    fn the_plan_gives_the_order() {
        let run = run_folder(&[
            ("orb", line("orb", 0, 1, 0)),
            ("sift", line("sift", 0, 1, 0)),
        ]);
        plan(run.path(), &["sift"], 1);
        let sets = load(run.path(), None).expect("in order");
        assert_eq!((&*sets[0].matcher, &*sets[1].matcher), ("sift", "orb"));
    }

    #[test]
    fn bad_records_are_named_by_line() {
        let cases = [
            (line("sift", 0, 1, 0) + "{}\n", ":2: not a record"),
            (
                line("sift", 0, 1, 0) + &line("orb", 0, 2, 0),
                ":2: this is a record of orb with ransac-e on",
            ),
            (
                line("sift", 0, 1, 0) + &line("sift", 0, 1, 0),
                ":2: pair 0 1 is there twice, first on line 1",
            ),
            (
                line("sift", 0, 1, 4_294_967_294),
                ":1: repetition 4294967294",
            ),
            (line("sift", 0, 1, u32::MAX), ":1: repetition 4294967295"),
        ];
        for (text, expected) in cases {
            let run = run_folder(&[("sift", text)]);
            let error = load(run.path(), None).expect_err(expected).to_string();
            assert!(error.contains(expected), "{error}");
        }
    }
}
