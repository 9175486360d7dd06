//! From two image files to matched points, by a source that has no stages of its own here: a matcher
//! outside, or files of matches.
//!
//! What comes from outside is checked before it is used: both images have equally many points, not more
//! than can be kept; positions are finite; ambiguities lie between 0 and 1.

use matchbench_vision::geometry::MatchedPoints;
use matchbench_vision::seed::Seed;

use super::RunError;
use super::guard::{Broken, guard};
use super::matching::count;
use super::seeds::selection_seed;
use crate::counted::counted;
use crate::matchers::{
    BuiltPointSource, ImageFiles, MAX_MATCHES, SourceError, SourcedMatches, check_seconds,
};
use crate::records::{Counts, SelectedMatches, StageTimes};

/// The matched points of a pair, or why there are none; `seed` is that of the pair.
///
/// # Errors
/// [`RunError::SourceEnded`] if there will be none for any pair, [`RunError::Stopped`] if the pair was not begun.
pub(super) fn sourced(
    source: &BuiltPointSource,
    pair: &ImageFiles<'_>,
    seed: Seed,
    counts: &mut Counts,
    times: &mut StageTimes,
    device: &mut Option<String>,
) -> Result<Result<SelectedMatches, Broken>, RunError> {
    let seed = selection_seed(seed);
    let (mut ended, mut is_lacking) = (None, false);
    let matches = guard(format_args!("matching by {}", source.id), || {
        source.source.matches(pair, seed).inspect_err(|error| {
            ended = match error {
                SourceError::Pair(_) => None,
                SourceError::Lacking(_) => {
                    is_lacking = true;
                    None
                }
                SourceError::Ended(reason) => Some(RunError::SourceEnded {
                    id: source.id.clone(),
                    reason: reason.clone(),
                }),
                SourceError::Stopped => Some(RunError::Stopped),
            };
        })
    });
    if let Some(ended) = ended {
        return Err(ended);
    }
    let matches = matches.and_then(|matches| {
        check(&matches).map_err(|reason| format!("matching by {} failed: {reason}", source.id))?;
        [times.extract_a, times.extract_b] = matches.seconds.extract;
        times.search = matches.seconds.matching;
        times.outside = matches.seconds.wall;
        *device = matches.seconds.device;
        let selected = count(matches.points.a.len());
        *counts = Counts {
            features_a: matches.features[0],
            features_b: matches.features[1],
            putative: matches.putative.unwrap_or(selected),
            selected,
        };
        Ok(SelectedMatches::new(*counts, &matches.points))
    });
    Ok(matches.map_err(|reason| {
        if is_lacking {
            reason.into()
        } else {
            // Another program may do better another time.
            Broken::for_now(reason)
        }
    }))
}

fn check(matches: &SourcedMatches) -> Result<(), String> {
    let SourcedMatches {
        points, seconds, ..
    } = matches;
    let MatchedPoints {
        a,
        b,
        ambiguity,
        turns,
        growths,
    } = points;
    if a.len() != b.len() || a.len() != ambiguity.len() {
        return Err(format!(
            "{} in a, {} in b and {}: these numbers must be equal",
            counted(a.len(), "point"),
            b.len(),
            counted(ambiguity.len(), "ambiguity")
        ));
    }
    if a.len() > MAX_MATCHES {
        return Err(format!("{} matches; {MAX_MATCHES} are the most", a.len()));
    }
    if let Some(index) =
        (a.iter().zip(b)).position(|(a, b)| ![a.x, a.y, b.x, b.y].iter().all(|x| x.is_finite()))
    {
        return Err(format!("match {index} has a position that is not finite"));
    }
    if let Some(index) = (ambiguity.iter()).position(|x| !(0.0..=1.0).contains(x)) {
        return Err(format!(
            "match {index} has the ambiguity {}; it must be from 0 to 1",
            ambiguity[index]
        ));
    }
    for (name, column) in [("turn", turns), ("growth", growths)] {
        let Some(column) = column else { continue };
        if column.len() != a.len() {
            return Err(format!("{} {name}s for {} matches", column.len(), a.len()));
        }
        if let Some(index) = column.iter().position(|value| !value.is_finite()) {
            return Err(format!("match {index} has a {name} that is not finite"));
        }
    }
    let seconds = [
        seconds.extract[0],
        seconds.extract[1],
        seconds.matching,
        seconds.wall,
    ];
    seconds.into_iter().flatten().try_for_each(check_seconds)
}

#[cfg(test)]
mod tests {
    use nalgebra::Point2;
    use serde_json::json;

    use super::super::testing::{Toy, records_of};
    use super::super::{Contender, Variant};
    use super::*;
    use crate::matchers::{PointSource, Source, SourceSeconds};
    use crate::records::{MatchesFile, Outcome, RunFolder, matches};

    /// Matches that are spoiled before they are handed over.
    struct Outside(fn(&mut SourcedMatches) -> Result<(), SourceError>);

    impl PointSource for Outside {
        fn matches(
            &self,
            pair: &ImageFiles<'_>,
            seed: Seed,
        ) -> Result<SourcedMatches, SourceError> {
            assert!(pair.images.iter().all(|image| image.is_file()));
            let mut rng = seed.rng();
            let mut matches = SourcedMatches {
                features: [90, 80],
                seconds: SourceSeconds {
                    extract: [Some(0.5), None],
                    matching: Some(0.25),
                    ..SourceSeconds::default()
                },
                ..SourcedMatches::default()
            };
            for _ in 0..40 {
                let point = Point2::new(f64::from(rng.below(64)) + 0.1, 1.5);
                (matches.points).push(point, Point2::new(f64::from(pair.frames[1]), 2.5), 0.5);
            }
            (self.0)(&mut matches).map(|()| matches)
        }
    }

    fn contender(change: fn(&mut SourcedMatches) -> Result<(), SourceError>) -> Contender {
        let source = BuiltPointSource {
            id: "outside".into(),
            version: Some("2.1".into()),
            command: None,
            params: json!({"keypoints": 90}),
            notes: vec!["weights of somewhere".into()],
            source: Box::new(Outside(change)),
        };
        Contender {
            source: Source::Points(source),
            estimators: vec![Variant::from(Toy::default().estimator("first"))],
        }
    }

    #[test]
    fn a_source_is_an_entry_as_any_other() {
        let folder = tempfile::tempdir().unwrap();
        let both = [
            contender(|_| Ok(())),
            Toy::default().contender("bright", &["first"]),
        ];
        let records = records_of(folder.path(), &both);
        let (outside, native): (Vec<_>, Vec<_>) =
            (records.iter()).partition(|record| record.task.matcher == "outside");
        assert_eq!((outside.len(), native.len()), (2 * 21, 2 * 21));
        for record in &outside {
            let Counts {
                features_a,
                putative,
                selected,
                ..
            } = record.counts;
            assert_eq!((features_a, putative, selected), (90, 40, 40));
            assert!(!matches!(record.outcome, Outcome::Failed { .. }));
        }
        let run = RunFolder::open(&folder.path().join("run")).unwrap();
        let plan = run.plan().matcher("outside").unwrap();
        assert_eq!(
            (plan.version.as_deref(), &plan.extraction),
            (Some("2.1"), &None)
        );
        let kept = MatchesFile::open(&matches::path(run.path(), "street", "outside")).unwrap();
        let kept = kept.read((0, 2, 1)).unwrap().unwrap();
        assert_eq!((kept.points.len(), kept.points.b[0].x), (40, 2.0));
    }

    #[test]
    fn what_is_no_match_fails_the_pair_and_says_why() {
        type Change = fn(&mut SourcedMatches) -> Result<(), SourceError>;
        let cases: [(Change, &str); 9] = [
            (
                |m| {
                    let MatchedPoints {
                        a, b, ambiguity, ..
                    } = &mut m.points;
                    a.resize(MAX_MATCHES + 1, Point2::origin());
                    b.resize(MAX_MATCHES + 1, Point2::origin());
                    ambiguity.resize(MAX_MATCHES + 1, 0.5);
                    Ok(())
                },
                "5000001 matches; 5000000 are the most",
            ),
            (
                |m| {
                    m.points.b.truncate(39);
                    Ok(())
                },
                "40 points in a, 39 in b",
            ),
            (
                |m| {
                    m.points.a[3].x = f64::NAN;
                    Ok(())
                },
                "match 3 has a position",
            ),
            (
                |m| {
                    m.points.ambiguity[7] = 1.5;
                    Ok(())
                },
                "the ambiguity 1.5",
            ),
            (
                |m| {
                    m.points.turns = Some(vec![0.5; 39]);
                    Ok(())
                },
                "39 turns for 40 matches",
            ),
            (
                |m| {
                    let mut turns = vec![0.5; 40];
                    turns[7] = f32::INFINITY;
                    m.points.turns = Some(turns);
                    Ok(())
                },
                "match 7 has a turn",
            ),
            (
                |m| {
                    m.points.growths = Some(vec![f32::NAN; 40]);
                    Ok(())
                },
                "match 0 has a growth",
            ),
            (
                |m| {
                    m.seconds.matching = Some(-1.0);
                    Ok(())
                },
                "-1.0 seconds",
            ),
            (|_| Err(SourceError::Pair("too dark".into())), "too dark"),
        ];
        for (change, named) in cases {
            let folder = tempfile::tempdir().unwrap();
            for record in records_of(folder.path(), &[contender(change)]) {
                let Outcome::Failed {
                    reason,
                    may_pass: true,
                } = record.outcome
                else {
                    panic!("{named}: {:?}", record.outcome);
                };
                assert!(
                    reason.contains(named) && reason.contains("outside"),
                    "{reason}"
                );
            }
        }
    }

    #[test]
    fn a_source_that_ends_ends_the_run() {
        let Source::Points(source) =
            contender(|_| Err(SourceError::Ended("see log".into()))).source
        else {
            panic!("it is a source");
        };
        let file = tempfile::NamedTempFile::new().unwrap();
        let files = ImageFiles {
            dataset: "street",
            frames: [0, 1],
            images: [file.path(), file.path()],
        };
        let (mut counts, mut times) = (Counts::default(), StageTimes::default());
        let mut device = None;
        let ended = sourced(
            &source,
            &files,
            Seed(1),
            &mut counts,
            &mut times,
            &mut device,
        );
        let error = ended.unwrap_err();
        assert_eq!(error.to_string(), "outside has ended: see log");
    }
}
