//! Sources outside fail, end, and may do better another time.

use std::sync::{Arc, Mutex};

use matchbench_vision::geometry::MatchedPoints;
use matchbench_vision::seed::Seed;
use nalgebra::Point2;
use serde_json::json;

use super::*;
use crate::matchers::{
    BuiltPointSource, ImageFiles, PointSource, SourceError, SourceSeconds, SourcedMatches,
};

/// The same matches for all pairs, but for those that it fails over and the one that it ends at.
#[derive(Default)]
pub(super) struct Flaky {
    fails: Vec<[u32; 2]>,
    /// Pairs that it will never have an answer for.
    lacks: Vec<[u32; 2]>,
    /// Pairs that it has no matches of, and tells no features.
    empty: Vec<[u32; 2]>,
    /// How many matches it finds beside the others.
    more: u32,
    /// Whether it says that it finds the same whenever it is asked.
    repeats: bool,
    ends: Option<[u32; 2]>,
    /// The pair that it is stopped at.
    stops: Option<[u32; 2]>,
    heeded: Mutex<Cancel>,
    /// How often it was asked.
    asked: Arc<AtomicUsize>,
}

impl PointSource for Flaky {
    fn repeats(&self) -> bool {
        self.repeats
    }

    fn matches(&self, pair: &ImageFiles<'_>, _: Seed) -> Result<SourcedMatches, SourceError> {
        self.asked.fetch_add(1, Ordering::Relaxed);
        if self.ends == Some(pair.frames) {
            return Err(SourceError::Ended("as the test wants".into()));
        }
        if self.stops == Some(pair.frames) {
            self.heeded.lock().unwrap().set();
            return Err(SourceError::Stopped);
        }
        if self.fails.contains(&pair.frames) {
            return Err(SourceError::Pair("as the test wants".into()));
        }
        if self.lacks.contains(&pair.frames) {
            return Err(SourceError::Lacking("as the test wants".into()));
        }
        let mut points = MatchedPoints::default();
        let is_empty = self.empty.contains(&pair.frames);
        for x in 0..if is_empty { 0 } else { 40 + self.more } {
            let at = Point2::new(f64::from(x % 8), f64::from(x / 8));
            points.push(at, at, 0.5);
        }
        Ok(SourcedMatches {
            points,
            features: if is_empty { [0; 2] } else { [50, 60] },
            putative: None,
            seconds: SourceSeconds {
                matching: Some(0.25),
                wall: Some(0.5),
                device: Some("abacus".into()),
                ..SourceSeconds::default()
            },
        })
    }

    fn heed(&self, cancel: &Cancel) {
        *self.heeded.lock().unwrap() = cancel.clone();
    }
}

impl Flaky {
    pub(super) fn on(fails: &[[u32; 2]], empty: &[[u32; 2]]) -> Self {
        Self {
            fails: fails.into(),
            empty: empty.into(),
            ..Self::default()
        }
    }

    pub(super) fn contender(self) -> Contender {
        self.with(&["first", "second"])
    }

    pub(super) fn with(self, estimators: &[&str]) -> Contender {
        let estimators = estimators.iter().map(|id| Toy::default().estimator(id));
        Contender {
            source: Source::Points(BuiltPointSource {
                id: "flaky".into(),
                version: Some("1".into()),
                command: None,
                params: json!({}),
                notes: Vec::new(),
                source: Box::new(self),
            }),
            estimators: estimators.map(Variant::from).collect(),
        }
    }
}

fn whole() -> Vec<RunRecord> {
    let bench = Bench::new(vec![Flaky::default().contender()]);
    assert!(bench.run("whole").unwrap().is_complete());
    bench.records("whole")
}

#[test]
fn failures_of_a_source_are_tried_again_and_their_records_replaced() {
    let flaky = Flaky {
        fails: vec![[0, 1], [2, 3]],
        ..Flaky::default()
    };
    let mut bench = Bench::new(vec![flaky.contender()]);
    let summary = bench.run("run").unwrap();
    // Two pairs of each of two datasets, with two estimators.
    assert_eq!((summary.failed, summary.ended), (8, 0));
    assert!(summary.is_complete());
    bench.contenders = vec![Flaky::default().contender()];
    let again = bench.run("run").unwrap();
    assert_eq!((again.before, again.now), (summary.total - 8, 8));
    assert_eq!(again.failed, 0);
    assert_eq!(bench.records("run"), whole());
    assert_eq!(bench.run("run").unwrap().now, 0);
}

#[test]
fn what_a_source_lacks_is_not_asked_for_again() {
    let lacking = Flaky {
        lacks: vec![[0, 1]],
        ..Flaky::default()
    };
    let asked = Arc::clone(&lacking.asked);
    let mut bench = Bench::new(vec![lacking.contender()]);
    let first = bench.run("run").unwrap();
    let before = asked.load(Ordering::Relaxed);
    assert_eq!((first.failed, before), (4, 21 + 7));
    let again = bench.run("run").unwrap();
    assert_eq!((again.now, again.failed), (0, 4));
    assert_eq!(asked.load(Ordering::Relaxed), before);
    bench.retry_failed = true;
    let again = bench.run("run").unwrap();
    assert_eq!((again.now, again.failed), (4, 4));
    assert_eq!(asked.load(Ordering::Relaxed), before + 2);
}

#[test]
fn what_failed_before_comes_after_what_was_never_done() {
    let stopped = Flaky {
        fails: vec![[0, 1]],
        stops: Some([1, 3]),
        ..Flaky::default()
    };
    let mut bench = Bench::new(vec![stopped.contender()]);
    bench.run("run").unwrap();
    let street = 2 * 21;
    assert!(bench.records("run").len() < street);
    // It ends at the pair that failed, and keeps no other from being done.
    let ends = Flaky {
        ends: Some([0, 1]),
        ..Flaky::default()
    };
    bench.contenders = vec![ends.contender()];
    assert_eq!(bench.run("run").unwrap().ended, 1);
    let records = bench.records("run");
    assert_eq!(records.len(), street);
    let failed = (records.iter()).filter(|record| record.outcome.has_failed());
    assert_eq!(failed.count(), 2);
    bench.contenders = vec![Flaky::default().contender()];
    assert!(bench.run("run").unwrap().is_complete());
    assert_eq!(bench.records("run"), whole());
}

#[test]
fn a_pair_that_a_source_does_not_begin_is_left_for_the_next_time() {
    let flaky = Flaky {
        stops: Some([1, 3]),
        ..Flaky::default()
    };
    let toy = || Toy::default().contender("bright", &["first"]);
    let mut bench = Bench::new(vec![flaky.contender(), toy()]);
    let stopped = Cancel::default();
    let summary = bench.run_with("run", &Silent, &stopped).unwrap();
    assert!(stopped.is_set() && !summary.is_complete());
    assert_eq!((summary.failed, summary.ended), (0, 0));
    let records = bench.records("run");
    let is_before = |record: &RunRecord| {
        let task = &record.task;
        task.matcher == "flaky" && (task.a, task.b) < (1, 3)
    };
    assert!(!records.is_empty() && records.iter().all(is_before));
    bench.contenders = vec![Flaky::default().contender(), toy()];
    assert!(bench.run("run").unwrap().is_complete());
}

#[test]
fn a_source_that_ends_ends_no_other() {
    let flaky = Flaky {
        ends: Some([1, 3]),
        ..Flaky::default()
    };
    let toy = || Toy::default().contender("bright", &["first"]);
    let mut bench = Bench::new(vec![flaky.contender(), toy()]);
    let summary = bench.run("run").unwrap();
    assert_eq!(summary.ended, 1);
    assert!(!summary.is_complete());
    let of = |bench: &Bench, id: &str| {
        let mut records = bench.records("run");
        records.retain(|record| record.task.matcher == id);
        records
    };
    assert_eq!(of(&bench, "bright").len(), 21 + 7);
    assert!(of(&bench, "flaky").len() < 2 * 21);
    bench.contenders = vec![Flaky::default().contender(), toy()];
    assert!(bench.run("run").unwrap().is_complete());
    assert_eq!(of(&bench, "flaky"), whole());
}

#[test]
fn times_of_a_source_are_recorded_with_its_device_and_what_was_waited() {
    let bench = Bench::new(vec![Flaky::default().contender()]);
    bench.run("run").unwrap();
    let records = store::read_run(&bench.path("run")).unwrap();
    let told = |estimator: &str| {
        let mut records = records.iter();
        let record = records.find(|record| record.task.estimator == estimator);
        let record = record.unwrap();
        (
            record.times.search,
            record.times.outside,
            record.device.clone(),
        )
    };
    assert_eq!(
        told("first"),
        (Some(0.25), Some(0.5), Some("abacus".into()))
    );
    assert_eq!(told("second"), (None, None, None), "matched once for both");
}

#[test]
fn nothing_from_outside_is_called_as_what_is_built_in() {
    for name in ["sift", "best", "all"] {
        let mut bench = Bench::new(vec![Flaky::default().contender()]);
        let Source::Points(source) = &mut bench.contenders[0].source else {
            panic!("it is a source")
        };
        source.id = name.into();
        let error = bench.run("run").unwrap_err().to_string();
        assert!(
            error.contains("is the name of something built in"),
            "{error}"
        );
        assert!(!bench.path("run").exists());
    }
}

#[test]
fn another_version_is_refused() {
    let mut bench = Bench::new(vec![Flaky::default().contender()]);
    bench.run("run").unwrap();
    let Source::Points(source) = &mut bench.contenders[0].source else {
        panic!("it is a source")
    };
    source.version = Some("2".into());
    let error = bench.run("run").unwrap_err().to_string();
    assert!(error.contains("version"), "{error}");
}

#[test]
fn another_command_is_refused_unless_the_plan_is_of_a_version_that_wrote_none() {
    let mut bench = Bench::new(vec![Flaky::default().contender()]);
    let mut run_with = |argument: Option<&str>| {
        let Source::Points(source) = &mut bench.contenders[0].source else {
            panic!("it is a source")
        };
        source.command = argument.map(|argument| vec!["flaky".into(), argument.into()]);
        bench.run("run").map_err(|error| error.to_string())
    };
    run_with(None).unwrap();
    run_with(Some("--model=a")).unwrap();
    let error = run_with(Some("--model=b")).unwrap_err();
    assert!(
        error.contains("`matchers[0].command[1]` is \"--model=a\" there and \"--model=b\" here"),
        "{error}"
    );
    run_with(Some("--model=a")).unwrap();
}

#[test]
fn another_estimator_asks_only_for_the_matches_that_are_not_stored() {
    let failing = || vec![[0, 1], [2, 3]];
    for (repetitions, fails_again) in [(1, true), (1, false), (3, true), (3, false)] {
        let first = Flaky {
            fails: failing(),
            ..Flaky::default()
        };
        let mut bench = Bench::new(vec![first.with(&["first"])]);
        bench.settings = repeated(repetitions);
        bench.run("run").unwrap();
        let fails = if fails_again { failing() } else { Vec::new() };
        let second = Flaky {
            fails,
            ..Flaky::default()
        };
        let asked = second.asked.clone();
        bench.contenders = vec![second.contender()];
        assert!(bench.run("run").unwrap().is_complete());
        // Two pairs of each of two datasets have no matches; those that fail again are asked for once more.
        let tries = if fails_again { 2 } else { 1 };
        let expected = tries * 4 * repetitions as usize;
        assert_eq!(asked.load(Ordering::Relaxed), expected);
        if !fails_again {
            bench.contenders = vec![Flaky::default().contender()];
            bench.run("whole").unwrap();
            // The device is told once: by the estimator that came first to the matches of a pair.
            let but_for_devices = |run: &str| {
                let mut records = bench.records(run);
                for record in &mut records {
                    record.device = None;
                }
                records
            };
            assert_eq!(but_for_devices("run"), but_for_devices("whole"));
        }
    }
}

#[test]
fn of_some_repetitions_alone_the_matches_are_stored() {
    let mut bench = Bench::new(vec![Flaky::default().with(&["first"])]);
    bench.settings = repeated(2);
    bench.run("run").unwrap();
    let expected = bench.records("run");
    // The first repetition of the first pair stays.
    let matches = bench.path("run").join("matches/street/flaky.bin");
    let whole = fs::read(&matches).unwrap();
    fs::write(&matches, &whole[..8 + 28 + 40 * 20 + 8]).unwrap();
    let flaky = Flaky {
        repeats: true,
        ..Flaky::default()
    };
    let asked = flaky.asked.clone();
    bench.contenders = vec![flaky.with(&["first"])];
    bench.run("run").unwrap();
    assert_eq!(asked.load(Ordering::Relaxed), 2 * 21 - 1);
    assert_eq!(bench.records("run"), expected);
    assert_eq!(fs::read(&matches).unwrap(), whole);
}

/// Counts how often it is told that a source finds other matches.
#[derive(Default)]
struct Others(AtomicUsize);

impl Observer for Others {
    fn on_other_matches(&self, _: &str, matcher: &str) {
        assert_eq!(matcher, "flaky");
        self.0.fetch_add(1, Ordering::Relaxed);
    }
}

#[test]
fn a_source_is_not_asked_again_for_what_is_recorded_and_one_that_varies_is_told() {
    for more in [0, 1] {
        let mut bench = Bench::new(vec![Flaky::default().with(&["first"])]);
        bench.run("run").unwrap();
        let first = bench.records("run");
        fs::remove_dir_all(bench.path("run").join("matches")).unwrap();
        let mut again = |more: u32, estimators: &[&str]| {
            let flaky = Flaky {
                more,
                ..Flaky::default()
            };
            let asked = flaky.asked.clone();
            bench.contenders = vec![flaky.with(estimators)];
            let others = Others::default();
            let summary = bench.run_with("run", &others, &Cancel::default());
            assert!(summary.unwrap().is_complete());
            [asked, others.0.into()].map(|number| number.load(Ordering::Relaxed))
        };
        assert_eq!(again(more, &["first"]), [0, 0]);
        // Once for each dataset.
        let told = 2 * more as usize;
        assert_eq!(again(more, &["first", "second"]), [21 + 7, told]);
        // The matches of the second are there.
        assert_eq!(again(2, &["first", "second", "third"]), [0, 0]);
        let mut records = bench.records("run");
        let selected = |estimator: &str| {
            let mut of_one = records.iter().filter(|r| r.task.estimator == estimator);
            of_one.next().unwrap().counts.selected
        };
        assert_eq!([selected("second"), selected("third")], [40 + more; 2]);
        records.retain(|record| record.task.estimator == "first");
        assert_eq!(records, first);
    }
}

#[test]
fn a_run_of_a_source_without_its_matches_grows_by_what_is_new() {
    let mut bench = Bench::new(vec![Flaky::default().contender()]);
    let before = bench.run("run").unwrap().total;
    fs::remove_dir_all(bench.path("run").join("matches")).unwrap();
    let flaky = Flaky::default();
    let asked = flaky.asked.clone();
    bench.contenders = vec![flaky.contender()];
    bench.settings = repeated(2);
    let grown = bench.run("run").unwrap();
    assert_eq!((grown.before, grown.now), (before, before));
    assert_eq!(asked.load(Ordering::Relaxed), 21 + 7);
}
