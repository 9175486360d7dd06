//! A cache of features that cannot be believed, or cannot be written.

use std::mem;

use matchbench_vision::features::{BinaryRows, Descriptors, Features, FloatRows};
use matchbench_vision::seed::Seed;
use serde_json::json;

use super::*;
use crate::cache::Key;
use crate::files::{Call, Fault, break_calls};
use crate::matchers::{
    BuiltMatcher, BuiltPointSource, ImageFiles, PointSource, SourceError, SourcedMatches,
};

/// The matcher of the only contender.
fn matcher(bench: &Bench) -> &BuiltMatcher {
    match &bench.contenders[0].source {
        Source::Matcher(matcher) => matcher,
        Source::Points(_) => unreachable!("the toy is a matcher"),
    }
}

#[test]
fn features_with_other_descriptors_than_the_matcher_makes_are_extracted_anew() {
    let toy = Toy::default();
    let extractions = || toy.extractions.swap(0, Ordering::Relaxed);
    let mut bench = Bench::new(vec![toy.contender("bright", &["e"])]);
    bench.datasets.truncate(1);
    bench.run("run").unwrap();
    assert_eq!(extractions(), 12);
    let cache = FeatureCache::new(bench.path("run").join("cache"));
    let forge = |frame: usize, descriptors: fn(usize) -> Descriptors| {
        let file = fs::read(&bench.datasets[0].sequence.frames[frame].image).unwrap();
        let key = Key::new(&file, 0, &matcher(&bench).extraction);
        let found = cache.load(key).expect("the run has kept it");
        let descriptors = descriptors(found.len());
        let forged = Features::new(found.size, found.keypoints, descriptors);
        cache.save(key, &forged).unwrap();
    };
    forge(3, |count| {
        Descriptors::Float(FloatRows::from_vec(2, vec![1.0; 2 * count]))
    });
    forge(5, |count| {
        Descriptors::Binary(BinaryRows::from_vec(32, vec![1; count]))
    });
    bench.run("again").unwrap();
    assert_eq!(extractions(), 12, "it has a cache of its own");
    for left in [2, 0] {
        for part in ["records", "matches"] {
            fs::remove_dir_all(bench.path("run").join(part)).unwrap();
        }
        bench.run("run").unwrap();
        assert_eq!(extractions(), left);
        assert_eq!(bench.records("run"), bench.records("again"));
    }
}

/// Remembers why nothing was kept.
#[derive(Default)]
struct Unkept(Mutex<Vec<String>>);

impl Observer for Unkept {
    fn on_unkept(&self, reason: &str) {
        self.0.lock().unwrap().push(reason.into());
    }
}

#[test]
fn a_cache_that_cannot_be_written_is_told_once_and_takes_nothing_from_the_run() {
    let bench = Bench::new(vec![Toy::default().contender("bright", &["e"])]);
    let sound = bench.run("sound").unwrap();
    assert_eq!(sound.unkept, 0);
    let (folder, cache) = (bench.path("run"), bench.path("no folder"));
    fs::write(&cache, "").unwrap();
    let run = Run {
        cache: FeatureCache::new(&cache),
        decode,
        ..Run::new(&bench.datasets, &bench.contenders, &folder)
    };
    let observer = Unkept::default();
    let summary = run.execute(&observer, &Cancel::default()).unwrap();
    assert!(summary.is_complete());
    assert_eq!(bench.records("run"), bench.records("sound"));
    assert_eq!(summary.unkept, 17, "each frame was extracted once");
    let told = observer.0.into_inner().unwrap();
    let [reason] = &told[..] else {
        panic!("{told:?}");
    };
    let cache = cache.display().to_string();
    assert!(
        reason.contains(&cache) && reason.contains("--cache"),
        "{reason}"
    );
}

/// A source whose cache keeps nothing: one file for each pair.
#[derive(Default)]
struct Forgetful(Mutex<Vec<String>>);

impl PointSource for Forgetful {
    fn matches(&self, pair: &ImageFiles<'_>, _: Seed) -> Result<SourcedMatches, SourceError> {
        let reason = format!("{:?} is not kept", pair.frames);
        self.0.lock().unwrap().push(reason);
        Ok(SourcedMatches::default())
    }

    fn take_unkept(&self) -> Vec<String> {
        mem::take(&mut *self.0.lock().unwrap())
    }
}

#[test]
fn what_a_source_outside_cannot_keep_is_told_once_too() {
    let contender = Contender {
        source: Source::Points(BuiltPointSource {
            id: "forgetful".into(),
            version: Some("1".into()),
            command: None,
            params: json!({}),
            notes: Vec::new(),
            source: Box::new(Forgetful::default()),
        }),
        estimators: vec![Variant::from(Toy::default().estimator("e"))],
    };
    let bench = Bench::new(vec![contender]);
    let observer = Unkept::default();
    let summary = (bench.run_with("run", &observer, &Cancel::default())).unwrap();
    assert!(summary.is_complete() && summary.total > 1);
    assert_eq!(summary.unkept, summary.total);
    let told = observer.0.into_inner().unwrap();
    assert!(
        told.len() == 1 && told[0].ends_with("is not kept"),
        "{told:?}"
    );
}

#[test]
fn a_full_disk_ends_the_run_only_where_its_results_are() {
    let bench = Bench::new(vec![Toy::default().contender("bright", &["e"])]);
    bench.run("sound").unwrap();
    // The first time that something is written there.
    let full = |part: &str| {
        for left in 0.. {
            let name = format!("{part} after {left}");
            let broken = break_calls(&bench.path(&name).join(part), Fault::Full, left);
            let observer = Unkept::default();
            let ended = bench.run_with(&name, &observer, &Cancel::default());
            let (call, _) = broken.happened().expect("it is written");
            if call == Call::Write {
                return (name, ended, observer.0.into_inner().unwrap());
            }
        }
        unreachable!("a run has an end")
    };
    let (name, ended, told) = full("cache");
    assert_eq!((ended.unwrap().unkept, told.len()), (1, 1));
    assert_eq!(bench.records(&name), bench.records("sound"));
    for part in ["records", "matches", "images"] {
        let (_, ended, told) = full(part);
        assert!(ended.is_err() && told.is_empty(), "{part}: {told:?}");
    }
}
