//! A cache of features that cannot be believed.

use matchbench_vision::features::{BinaryRows, Descriptors, Features, FloatRows};

use super::*;
use crate::cache::Key;
use crate::matchers::BuiltMatcher;

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
