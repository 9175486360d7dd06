//! Results from disk: a run folder, or anybody's results in the authors' layout.
//!
//! - A [`RunFolder`] holds records. Poses were compared with the truth when they were recorded.
//! - The authors' layout is `<sequence>/<matcher>.txt`, one row `a b count` + 3x4 pose a pair; a row
//!   with a zero translation is a pair without a pose. The truth comes from
//!   `<datasets>/<sequence>/pairs.txt` or from a `groundtruth.txt` beside the matchers' files (see
//!   `published.rs`). A file may be called `<matcher>+<estimator>.txt`.
//!
//! What is scored are the pairs that the dataset lists, of these only those that a [`PairChoice`] leaves. Rows for other
//! pairs are ignored and counted, listed pairs without a row are failures, and a second row for the same pair is an
//! error: nobody could say which one counts. Of a run the records are scored, and the plan says how many there will be: a
//! pair that is not recorded yet has not failed. A method that lacks records that others have is not compared with
//! them ([`ResultSet::lacking`]). If the folder of datasets is given, what it lists counts for a run too.

use std::fs;
use std::path::{Path, PathBuf};

use crate::protocols;
use crate::records::{Outcome, Plan, RunFolder, RunRecord, check_tasks, is_twice};

use super::broken::count_broken;
use super::listed::{Truths, complete_all, task};
use super::pair_choice::{PairChoice, frames_at_hand};
use super::results_error::ResultsError;
use super::{PairResult, ResultSet};

/// One file of records, or of results in the authors' layout: what stands in it, or why that cannot be scored.
#[derive(Debug)]
pub struct FileResults {
    /// The file; a folder of files where none of them can be scored.
    pub file: PathBuf,
    /// Hash of the true poses that results in the authors' layout were judged by: of a dataset that is at hand
    /// its [fingerprint](crate::datasets::Sequence::fingerprint), else that of the listed pairs alone. A run has
    /// it in its plan.
    pub truth: Option<String>,
    /// Whether that truth came with the results, as a `groundtruth.txt` beside them.
    pub has_own_truth: bool,
    /// What stands in it.
    pub results: Result<ResultSet, ResultsError>,
}

/// Every set of results of a run, in the order of its plan; what the plan does not name comes last.
/// Of the pairs only the chosen ones.
pub(super) fn of_run(
    run: &RunFolder,
    datasets: Option<&Path>,
    choice: &PairChoice,
) -> Result<Vec<ResultSet>, ResultsError> {
    let mut truths = datasets.map(Truths::new);
    let mut check = |record: &RunRecord| match &mut truths {
        Some(truths) => truths.check(run, record),
        None => Ok(()),
    };
    let mut sets = Vec::new();
    for file in run.record_files()? {
        sets.extend(read_records(run, &file, &mut check)?);
    }
    sort(&mut sets);
    order_as_planned(&mut sets, run.plan());
    let frames = |dataset: &str| frames_at_hand(dataset, datasets, Some(run));
    complete_all(
        run.path(),
        sets.iter_mut(),
        truths.as_mut(),
        choice,
        &frames,
    )?;
    Ok(sets)
}

/// The results in each file of records of a run by themselves, in the order of the pairs; none of a file without
/// records. Only what is recorded: the other files may be anybody's, and do not say what this one lacks.
pub(super) fn each_of_run(run: &RunFolder) -> Result<Vec<FileResults>, ResultsError> {
    let mut each = Vec::new();
    for file in run.record_files()? {
        if let Some(results) = read_records(run, &file, |_| Ok(())).transpose() {
            each.push(FileResults {
                file,
                truth: None,
                has_own_truth: false,
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

/// The records of one file, each of which passes the `check`; none where nothing has been recorded yet.
fn read_records(
    run: &RunFolder,
    file: &Path,
    mut check: impl FnMut(&RunRecord) -> Result<(), ResultsError>,
) -> Result<Option<ResultSet>, ResultsError> {
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
            lacking: 0,
        });
        set.repetitions = set.repetitions.max(task.repetition.saturating_add(1));
        set.pairs.push(PairResult::from(&record));
        counts_under_its_protocol(&record).map_err(|problem| ResultsError::Line {
            path: file.to_path_buf(),
            line,
            problem,
        })?;
        check(&record)
    })?;
    let planned = run.plan().settings.repetitions.get() as usize;
    check_tasks(lines, planned).map_err(|(line, problem)| ResultsError::Line {
        path: file.to_path_buf(),
        line,
        problem,
    })?;
    Ok(set)
}

/// A pair that failed by the rules has no pose: no run records one, and it would be scored.
fn counts_under_its_protocol(record: &RunRecord) -> Result<(), String> {
    let Outcome::Pose {
        inliers, support, ..
    } = record.outcome
    else {
        return Ok(());
    };
    let protocol = protocols::of_estimator(&record.task.estimator);
    let reason = (protocol.too_few(record.counts.selected as usize))
        .or_else(|| protocol.too_weak(inliers as usize, support as usize));
    reason.map_or(Ok(()), |reason| {
        Err(format!(
            "the pair {} {} has a pose, but failed by the rules of {}: {reason}",
            record.task.a, record.task.b, protocol.id
        ))
    })
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

pub(super) fn twice(file: &Path, line: usize, pair: (u32, u32), first: usize) -> ResultsError {
    ResultsError::Line {
        path: file.to_path_buf(),
        line,
        problem: is_twice(pair, first),
    }
}

#[cfg(test)]
mod tests {
    use serde_json::json;

    use super::super::{Failure, load, load_each};
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
    fn a_pair_that_another_matcher_has_is_lacking_and_has_not_failed() {
        let sift = line("sift", 0, 1, 0) + &line("sift", 0, 2, 0);
        let run = run_folder(&[("sift", sift), ("orb", line("orb", 0, 2, 0))]);
        let sets = load(run.path(), None).expect("both files are in order");
        assert_eq!((&*sets[0].matcher, &*sets[1].matcher), ("orb", "sift"));
        assert_eq!([sets[0].lacking, sets[1].lacking], [1, 0]);
        assert_eq!((sets[0].pairs.len(), sets[0].missing()), (1, 0));
        let right = &sets[0].pairs[0];
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
        // Half a degree about x, and 4.5 degrees from x towards y: the errors of the records.
        let pose = "1 0 0 0.9969173337 0 0.9999619231 -0.0087265355 0.0784590957 0 0.0087265355 0.9999619231 0";
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
    fn errors_that_the_listed_truth_contradicts_are_not_scored() {
        let run = run_folder(&[("sift", line("sift", 0, 1, 0))]);
        let dataset = run.path().join("datasets/room");
        fs::create_dir_all(&dataset).expect("a folder can be made");
        fs::write(dataset.join("pairs.txt"), "0 1 1 0 0 0 0 1 0 0 0 0 1 1\n").expect("it is ours");
        let error =
            load(run.path(), Some(&run.path().join("datasets"))).expect_err("another truth");
        let error = error.to_string().replace('\\', "/");
        for named in [
            "datasets/room: the record of the pair 0 1 states errors of 0.5000 of the rotation and 4.5000 of the translation",
            "but its pose has errors of 0.0000 of the rotation and 90.0000 of the translation (degrees) by the truth here",
        ] {
            assert!(error.contains(named), "{error}");
        }
        assert!(load(run.path(), None).is_ok(), "nothing else is at hand");
    }

    #[test]
    fn a_pose_that_failed_by_the_rules_is_not_scored() {
        let sound = line("sift", 0, 1, 0);
        let few = (sound.replace(r#""selected":90"#, r#""selected":19"#)).replace(
            r#""inliers":70,"support":80"#,
            r#""inliers":12,"support":13"#,
        );
        let weak = sound.replace(r#""support":80"#, r#""support":9"#);
        for (text, expected) in [
            (
                &few,
                "1: the pair 0 1 has a pose, but failed by the rules of matchbench: too few matches: 19, needed 20",
            ),
            (&weak, "too few matches support the model: 9, needed 10"),
        ] {
            let run = run_folder(&[("sift", text.clone())]);
            let error = load(run.path(), None).expect_err(expected).to_string();
            assert!(error.contains(expected), "{error}");
            let each = load_each(run.path(), None).expect("the folder can be read");
            assert!(each[0].results.is_err());
            // Other benchmarks ask for less.
            let text = text.replace("ransac-e", "ransac-e@loftr");
            let run = run_folder(&[("sift", text.clone())]);
            let records = run.path().join("records/room");
            fs::write(records.join("sift+ransac-e@loftr.jsonl"), text).expect("it is ours");
            fs::remove_file(records.join("sift+ransac-e.jsonl")).expect("it is ours");
            assert!(load(run.path(), None).is_ok());
        }
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
        assert_eq!((sets[0].repetitions, sets[0].pairs.len()), (2, 3));
        assert_eq!(
            [sets[0].missing(), sets[0].lacking],
            [0, 0],
            "it was not done yet"
        );
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
