//! What a run promises, tried on a toy.

mod again;
mod cache;
mod faults;
mod growth;
mod homographies;
mod joined;
mod lost;
mod outside;
mod pixels;
mod selection;
mod shards;
mod share;

use std::fs;
use std::num::NonZeroU32;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicUsize, Ordering};

use matchbench_vision::image::GrayImage;
use matchbench_vision::robust::NoModel;
use nalgebra::Matrix3;
use rayon::ThreadPoolBuilder;
use tempfile::TempDir;

use super::testing::{Toy, Trouble, dataset, decode};
use super::*;
use crate::datasets::{Pair, Turn};
use crate::matchers::Source;
use crate::records::{MIN_MATCHES, MIN_SUPPORT, Outcome, Plan, RunRecord, StageTimes, store};

/// A folder with two datasets and room for runs.
struct Bench {
    folder: TempDir,
    datasets: Vec<Dataset>,
    contenders: Vec<Contender>,
    settings: RunSettings,
    threads: usize,
    retry_failed: bool,
}

impl Bench {
    fn new(contenders: Vec<Contender>) -> Self {
        let folder = tempfile::tempdir().unwrap();
        let datasets = vec![
            dataset(folder.path(), "street", 12),
            dataset(folder.path(), "office", 5),
        ];
        Self {
            folder,
            datasets,
            contenders,
            settings: RunSettings::default(),
            threads: 2,
            retry_failed: false,
        }
    }

    fn path(&self, name: &str) -> PathBuf {
        let mut path = self.folder.path().to_owned();
        path.extend(name.split('/'));
        path
    }

    fn run_with(
        &self,
        name: &str,
        observer: &dyn Observer,
        cancel: &Cancel,
    ) -> Result<RunSummary, RunError> {
        self.run_by(self.settings, name, observer, cancel)
    }

    fn run_by(
        &self,
        settings: RunSettings,
        name: &str,
        observer: &dyn Observer,
        cancel: &Cancel,
    ) -> Result<RunSummary, RunError> {
        let folder = self.path(name);
        let run = Run {
            settings,
            decode,
            feature_memory: 20_000,
            retry_failed: self.retry_failed,
            ..Run::new(&self.datasets, &self.contenders, &folder)
        };
        let pool = ThreadPoolBuilder::new().num_threads(self.threads).build();
        pool.unwrap().install(|| run.execute(observer, cancel))
    }

    fn run(&self, name: &str) -> Result<RunSummary, RunError> {
        self.run_with(name, &Silent, &Cancel::default())
    }

    /// The records of a run, without the times.
    fn records(&self, name: &str) -> Vec<RunRecord> {
        let mut records = store::read_run(&self.path(name)).unwrap();
        for record in &mut records {
            record.times = StageTimes::default();
        }
        records
    }
}

fn two_by_two() -> Vec<Contender> {
    let darker = Toy {
        threshold: 140,
        ..Toy::default()
    };
    vec![
        Toy::default().contender("bright", &["first", "second"]),
        darker.contender("dark", &["first"]),
    ]
}

fn set_threshold(contender: &mut Contender, threshold: u8) {
    let Source::Matcher(matcher) = &mut contender.source else {
        panic!("a toy is a matcher");
    };
    matcher.params["threshold"] = threshold.into();
}

fn repeated(repetitions: u32) -> RunSettings {
    RunSettings {
        repetitions: NonZeroU32::new(repetitions).unwrap(),
        ..RunSettings::default()
    }
}

/// The files below a folder.
fn files(folder: &Path) -> Vec<PathBuf> {
    let mut found = Vec::new();
    for entry in fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        if path.is_dir() {
            found.append(&mut files(&path));
        } else {
            found.push(path);
        }
    }
    found.sort();
    found
}

#[test]
fn records_are_the_same_and_in_the_same_order_for_any_number_of_threads() {
    let mut bench = Bench::new(two_by_two());
    bench.settings = repeated(3);
    for threads in [1, 2, 5] {
        bench.threads = threads;
        let summary = bench.run(&threads.to_string()).unwrap();
        assert_eq!(
            (summary.total, summary.now),
            ((21 + 7) * 3 * 3, (21 + 7) * 3 * 3)
        );
        assert!(summary.is_complete());
    }
    let records = bench.records("1");
    assert_eq!(records, bench.records("2"));
    assert_eq!(records, bench.records("5"));

    let count = |kind: fn(&Outcome) -> bool| records.iter().filter(|r| kind(&r.outcome)).count();
    assert!(count(|outcome| matches!(outcome, Outcome::Pose { .. })) > 100);
    assert!(count(|outcome| matches!(outcome, Outcome::NoPose { .. })) > 20);
}

#[test]
fn tasks_differ_in_their_seeds() {
    let mut bench = Bench::new(two_by_two());
    bench.settings = repeated(2);
    bench.run("run").unwrap();
    let mut rotations: Vec<[u64; 9]> = (bench.records("run").iter())
        .filter_map(|record| match &record.outcome {
            Outcome::Pose { rotation, .. } => Some(rotation.map(f64::to_bits)),
            _ => None,
        })
        .collect();
    let poses = rotations.len();
    rotations.sort_unstable();
    rotations.dedup();
    assert_eq!(rotations.len(), poses);

    bench.settings.seed = 1;
    bench.run("other").unwrap();
    assert_ne!(bench.records("run"), bench.records("other"));
}

#[test]
fn all_estimators_get_the_same_matches() {
    let bench = Bench::new(vec![
        Toy::default().contender("bright", &["first", "second"]),
    ]);
    bench.run("run").unwrap();
    let read = |estimator| {
        let path = store::path(&bench.path("run"), "street", "bright", estimator);
        store::read(&path).unwrap()
    };
    let (first, second) = (read("first"), read("second"));
    assert!(!first.is_empty() && first.len() == second.len());
    for (first, second) in first.iter().zip(second) {
        assert_eq!(first.counts, second.counts);
        assert!(first.times.search.is_some() && first.times.select.is_some());
        assert_eq!((second.times.search, second.times.select), (None, None));
    }
}

#[test]
fn a_torn_file_is_completed_wherever_it_was_torn() {
    let mut bench = Bench::new(vec![
        Toy::default().contender("bright", &["first", "second"]),
    ]);
    bench.datasets.truncate(1);
    bench.settings.limit = Some(3);
    bench.run("run").unwrap();
    let expected = bench.records("run");
    let path = store::path(&bench.path("run"), "street", "bright", "first");
    let whole = fs::read(&path).unwrap();
    assert_eq!(expected.len(), 2 * 3);
    // Both ends of each line, and some places in between.
    let at_an_end = |length: &usize| {
        let near = &whole[length.saturating_sub(2)..whole.len().min(length + 2)];
        near.contains(&b'\n') || length.is_multiple_of(23)
    };
    for length in (0..whole.len()).filter(at_an_end) {
        fs::write(&path, &whole[..length]).unwrap();
        let kept = store::read(&path).unwrap().len();
        let summary = bench.run("run").unwrap();
        assert_eq!((summary.before, summary.now), (3 + kept, 3 - kept));
        assert_eq!(bench.records("run"), expected, "torn at byte {length}");
    }
}

#[test]
fn a_complete_run_is_not_done_again() {
    let bench = Bench::new(two_by_two());
    bench.run("run").unwrap();
    let records = store::read_run(&bench.path("run")).unwrap();
    let summary = bench.run("run").unwrap();
    assert_eq!((summary.before, summary.now), (summary.total, 0));
    assert_eq!(
        store::read_run(&bench.path("run")).unwrap(),
        records,
        "also in the times"
    );
}

#[test]
fn a_cancelled_run_keeps_what_it_has_and_can_be_resumed() {
    /// Cancels after so many records.
    struct Impatient(AtomicUsize, Cancel);
    impl Observer for Impatient {
        fn on_record(&self, _: &RunRecord) {
            if self.0.fetch_sub(1, Ordering::Relaxed) == 1 {
                self.1.set();
            }
        }
    }
    let mut bench = Bench::new(two_by_two());
    bench.run("whole").unwrap();
    for threads in [1, 2] {
        bench.threads = threads;
        let pieces = format!("pieces by {threads}");
        loop {
            let cancel = Cancel::default();
            let observer = Impatient(AtomicUsize::new(5), cancel.clone());
            let summary = bench.run_with(&pieces, &observer, &cancel).unwrap();
            let recorded = bench.records(&pieces).len();
            assert_eq!(recorded, summary.before + summary.now);
            if summary.is_complete() {
                break;
            }
            assert!(summary.now >= 5, "{summary:?}");
            // Of several threads, one may do the work of many while another is held up.
            assert!(threads > 1 || summary.now <= 6, "a pair has two records");
        }
        assert_eq!(bench.records(&pieces), bench.records("whole"));
    }
}

#[test]
fn another_plan_is_refused_with_the_field_that_differs() {
    let mut bench = Bench::new(two_by_two());
    bench.run("run").unwrap();
    let refused = |bench: &Bench, named: &str| {
        let message = bench.run("run").unwrap_err().to_string();
        assert!(
            message.contains(named) && message.contains("another folder"),
            "{message}"
        );
    };

    bench.settings.seed = 1;
    refused(&bench, "`settings.seed` is 0 there and 1 here");
    bench.settings = RunSettings {
        limit: Some(3),
        ..RunSettings::default()
    };
    refused(&bench, "`settings.limit` is not set there and 3 here");
    bench.settings = RunSettings::default();

    let dark = bench.contenders.pop().unwrap();
    refused(&bench, "`matchers[1]` is `dark` there and absent here");
    bench.contenders.push(dark);
    set_threshold(&mut bench.contenders[0], 65);
    refused(
        &bench,
        "`matchers[0].params.threshold` is 64 there and 65 here",
    );
    set_threshold(&mut bench.contenders[0], 64);

    let pair = bench.datasets[1].sequence.pairs[2];
    let mut b_from_a = *pair.pose().unwrap();
    b_from_a.translation.x += 1e-9;
    bench.datasets[1].sequence.pairs[2] = Pair::with_pose(pair.a, pair.b, b_from_a);
    let others = "of the dataset `office` were others (`datasets[1].fingerprint`)";
    refused(&bench, others);
    bench.datasets[1].sequence.pairs[2] = pair;
    bench.datasets[1].sequence.frames[0].turn = Turn::Half;
    refused(&bench, others);
    bench.datasets[1].sequence.frames[0].turn = Turn::None;
    let planar = Pair::with_homography(pair.a, pair.b, Matrix3::identity());
    bench.datasets[1].sequence.pairs[2] = planar;
    let message = bench.run("run").unwrap_err().to_string();
    assert!(
        message.contains("knows a homography but no pose"),
        "{message}"
    );
    bench.datasets[1].sequence.pairs[2] = pair;

    bench.datasets[1].path = "elsewhere".into();
    assert!(
        bench.run("run").unwrap().is_complete(),
        "a dataset may move"
    );
    let plan = fs::read_to_string(bench.path("run").join("plan.json")).unwrap();
    assert!(plan.contains("elsewhere"));
}

#[test]
fn what_cannot_be_a_run_is_refused() {
    let refused = |change: fn(&mut Bench), named: &str| {
        let mut bench = Bench::new(two_by_two());
        change(&mut bench);
        let message = bench.run("run").unwrap_err().to_string();
        assert!(message.contains(named), "{message}");
        assert!(!bench.path("run").exists());
    };
    refused(
        |b| b.datasets[1].sequence.name = "street".into(),
        "two of the datasets are called `street`",
    );
    refused(
        |b| b.datasets[1].sequence.name = "Street".into(),
        "the datasets `street` and `Street` would be one file",
    );
    refused(
        |b| b.contenders[1] = Toy::default().contender("Bright", &["first"]),
        "the matchers `bright` and `Bright` would be one file",
    );
    refused(
        |b| b.datasets[1].sequence.name = "../street".into(),
        "`../street` cannot be the name",
    );
    refused(
        |b| b.datasets[0].sequence.pairs[4].b = 12,
        "has 12 frames, but a pair of frames 2 and 12",
    );
    refused(
        |b| b.contenders[1] = Toy::default().contender("bright", &["first"]),
        "two of the matchers",
    );
    refused(
        |b| b.contenders[0].estimators[1].name = "first".into(),
        "two of the estimators",
    );
    refused(
        |b| b.contenders[0].estimators.clear(),
        "`bright` is given no estimator",
    );
}

#[test]
fn damage_is_refused_with_the_place() {
    let bench = Bench::new(two_by_two());
    bench.run("run").unwrap();
    let refused = |named: &[&str]| {
        let message = bench.run("run").unwrap_err().to_string();
        assert!(
            named.iter().all(|named| message.contains(named)),
            "{message}"
        );
    };
    let path = store::path(&bench.path("run"), "office", "bright", "second");
    let text = fs::read_to_string(&path).unwrap();
    fs::write(&path, text.replacen("\"a\":1", "\"a\":2", 1)).unwrap();
    refused(&["bright+second.jsonl:3:", "checksum"]);
    fs::write(&path, text.replacen("{\"task\"", "{\"tusk\"", 1)).unwrap();
    refused(&["bright+second.jsonl:1:", "not a record"]);
    fs::write(&path, format!("{text}{text}")).unwrap();
    refused(&["bright+second.jsonl:8:", "another task"]);
    fs::write(&path, text).unwrap();

    let plan = bench.path("run").join("plan.json");
    fs::write(&plan, "{").unwrap();
    refused(&["plan.json", "not a plan"]);
    fs::remove_file(&plan).unwrap();
    refused(&["plan.json", "not the plan"]);
}

#[test]
fn a_folder_in_use_is_refused() {
    struct Second<'a>(&'a Bench);
    impl Observer for Second<'_> {
        fn on_plan(&self, _: &Plan, _: RunSummary) {
            let message = self.0.run("run").unwrap_err().to_string();
            assert!(message.contains("in use"), "{message}");
        }
    }
    let bench = Bench::new(two_by_two());
    bench
        .run_with("run", &Second(&bench), &Cancel::default())
        .unwrap();
    assert!(bench.run("run").is_ok(), "the lock ended with the run");
}

#[test]
fn what_breaks_is_recorded_and_counted() {
    for (trouble, named) in [
        (Trouble::PanicInExtraction, "0000.raw panicked: assertion"),
        (Trouble::ErrorInSearch, "search failed: as the test wants"),
        (Trouble::PanicInSelection, "selection panicked"),
        (Trouble::MatchOfNothing, "names feature 1000 of "),
        (Trouble::PanicInEstimation, "estimation by first panicked"),
        (Trouble::NotANumber, "not finite"),
    ] {
        let broken = Toy {
            trouble,
            ..Toy::default()
        };
        let contenders = vec![
            broken.contender("broken", &["first"]),
            Toy::default().contender("sound", &["first"]),
        ];
        let mut bench = Bench::new(contenders);
        bench.settings.limit = Some(4);
        let summary = bench.run("run").unwrap();
        assert!(summary.is_complete() && summary.failed > 0, "{trouble:?}");
        let records = bench.records("run");
        let reasons: Vec<&String> = (records.iter())
            .filter_map(|record| match &record.outcome {
                Outcome::Failed { reason, .. } => Some(reason),
                _ => None,
            })
            .collect();
        assert_eq!(reasons.len(), summary.failed);
        assert!(reasons[0].contains(named), "{}", reasons[0]);
        let counted = RunFolder::open(&bench.path("run"))
            .unwrap()
            .broken()
            .unwrap();
        let tasks = counted.iter().map(|broken| broken.tasks);
        assert_eq!(tasks.clone().sum::<usize>(), summary.failed);
        assert!(tasks.is_sorted_by(|x, y| x >= y));
        assert!(counted.iter().all(|broken| broken.matcher == "broken"));
        assert!(counted.iter().any(|broken| broken.reason == *reasons[0]));
        let is_broken = |record: &RunRecord| matches!(record.outcome, Outcome::Failed { .. });
        assert!(
            records
                .iter()
                .all(|r| !is_broken(r) || r.task.matcher == "broken")
        );
        assert_eq!(
            bench.run("run").unwrap().failed,
            summary.failed,
            "also when resumed"
        );
    }
}

#[test]
fn too_few_matches_and_too_little_support_are_no_pose() {
    let mut bench = Bench::new(two_by_two());
    bench.settings = repeated(5);
    bench.run("run").unwrap();
    let (mut few, mut little) = (0, 0);
    for record in bench.records("run") {
        let selected = record.counts.selected as usize;
        match record.outcome {
            Outcome::NoPose {
                reason: NoModel::TooFewMatches { found, needed },
            } => {
                assert_eq!((found, needed), (selected, MIN_MATCHES));
                assert!(found < 20);
                few += 1;
            }
            Outcome::NoPose {
                reason: NoModel::NoSupport { found, needed },
            } => {
                assert_eq!(needed, MIN_SUPPORT);
                assert!(found < 10);
                little += 1;
            }
            Outcome::Pose { support, .. } => assert!(selected >= 20 && support >= 10),
            other => panic!("{other:?}"),
        }
    }
    assert!(few > 20 && little > 20, "{few} {little}");
}

#[test]
fn each_frame_is_extracted_once_and_found_by_its_content() {
    let toy = Toy::default();
    let extractions = || toy.extractions.swap(0, Ordering::Relaxed);
    let other = Toy {
        threshold: 65,
        ..toy.clone()
    };
    let mut bench = Bench::new(vec![
        toy.contender("first", &["e"]),
        toy.contender("sharing", &["e"]),
    ]);
    bench.run("run").unwrap();
    // The first three frames of both datasets are equal images, and so are two more.
    assert_eq!(
        extractions(),
        12,
        "17 frames with 12 contents, two matchers"
    );
    let timed: usize = (store::read_run(&bench.path("run")).unwrap().iter())
        .map(|record| {
            let StageTimes {
                extract_a,
                extract_b,
                ..
            } = record.times;
            usize::from(extract_a.is_some()) + usize::from(extract_b.is_some())
        })
        .sum();
    assert_eq!(timed, 12, "what came from the cache has no time");
    let expected = bench.records("run");

    let again = || {
        fs::remove_dir_all(bench.path("run").join("records")).unwrap();
        fs::remove_dir_all(bench.path("run").join("matches")).unwrap();
    };
    again();
    bench.run("run").unwrap();
    assert_eq!((extractions(), bench.records("run")), (0, expected.clone()));

    // A torn file and a foreign one are made anew.
    again();
    let cached = files(&bench.path("run").join("cache"));
    assert_eq!(cached.len(), 12);
    fs::write(&cached[0], &fs::read(&cached[0]).unwrap()[..50]).unwrap();
    fs::copy(&cached[1], &cached[2]).unwrap();
    bench.run("run").unwrap();
    assert_eq!((extractions(), bench.records("run")), (2, expected));

    // Another name is the same image; another parameter is another extraction.
    let names = ["street/0004.raw", "renamed.raw"].map(|name| bench.path(name));
    fs::rename(&names[0], &names[1]).unwrap();
    bench.datasets[0].sequence.frames[4]
        .image
        .clone_from(&names[1]);
    let again = || {
        fs::remove_dir_all(bench.path("run").join("records")).unwrap();
        fs::remove_dir_all(bench.path("run").join("matches")).unwrap();
    };
    again();
    bench.run("run").unwrap();
    assert_eq!(extractions(), 0);
    again();
    fs::remove_file(bench.path("run").join("plan.json")).unwrap();
    // Without the plan nothing tells whose these are.
    let error = bench.run("run").unwrap_err().to_string();
    assert!(
        error.contains("images is there, but no plan.json"),
        "{error}"
    );
    fs::remove_dir_all(bench.path("run").join("images")).unwrap();
    bench.contenders = vec![other.contender("first", &["e"])];
    bench.run("run").unwrap();
    assert_eq!(extractions(), 12);
}
