//! Runs of datasets that know homographies.

use super::*;
use crate::datasets::Truth;
use crate::estimators;

/// A street whose images are files of their own, of which homographies are known, and a toy with these
/// estimators of the library.
fn bench(estimators: &[&str]) -> Bench {
    let mut contender = Toy::default().contender("bright", &[]);
    contender.estimators = (estimators.iter())
        .map(|id| estimators::find(id).unwrap().build(None).unwrap().into())
        .collect();
    let mut bench = Bench::new(vec![contender]);
    bench.datasets.truncate(1);
    let sequence = &mut bench.datasets[0].sequence;
    for frame in &mut sequence.frames {
        let pixels = fs::read(&frame.image).unwrap();
        frame.image.set_extension("pgm");
        fs::write(&frame.image, [b"P5 8 8 255\n", &pixels[..]].concat()).unwrap();
    }
    for pair in &mut sequence.pairs {
        pair.truth = Truth::Homography(Matrix3::identity());
    }
    bench
}

fn run(bench: &Bench, name: &str) -> Result<RunSummary, RunError> {
    let folder = bench.path(name);
    let run = Run::new(&bench.datasets, &bench.contenders, &folder);
    run.execute(&Silent, &Cancel::default())
}

#[test]
fn homographies_are_judged_by_corners_and_matches_by_the_truth() {
    let both = bench(&["best-h", "ransac-h"]);
    assert!(run(&both, "run").unwrap().is_complete());
    let records = both.records("run");
    assert_eq!(records.len(), 2 * both.datasets[0].sequence.pairs.len());
    let mut judged = 0;
    for record in &records {
        match &record.outcome {
            Outcome::Homography { corner_error, .. } => {
                judged += usize::from(corner_error.is_some_and(|error| error > 0.0));
            }
            Outcome::NoHomography { .. } => {}
            other => panic!("{other:?}"),
        }
        let correct = record.correct.expect("the truth is a homography");
        // Images of 8 x 8 pixels are 10 across.
        assert_eq!(correct[9], record.counts.selected);
        assert!(correct[0] < correct[4], "{correct:?}");
    }
    assert!(judged > 10, "{judged}");
    // One estimator, and later the other, come to the same.
    let first = bench(&["best-h"]);
    run(&first, "run").unwrap();
    assert_eq!(
        first.records("run"),
        (records.into_iter())
            .filter(|record| record.task.estimator == "best-h")
            .collect::<Vec<_>>()
    );
}

#[test]
fn keypoints_are_judged_of_pairs_whose_matches_were_there_before() {
    let mut both = bench(&["best-h", "ransac-h"]);
    run(&both, "whole").unwrap();
    let whole = both.records("whole");
    assert!(whole.iter().all(|record| record.repeated.is_some()));
    // Another estimator, later.
    let later = both.contenders[0].estimators.split_off(1);
    run(&both, "grown").unwrap();
    both.contenders[0].estimators.extend(later);
    run(&both, "grown").unwrap();
    assert_eq!(both.records("grown"), whole);
    // Killed between the matches of a pair and its records.
    run(&both, "killed").unwrap();
    for estimator in ["best-h", "ransac-h"] {
        let file = both
            .path("killed")
            .join(format!("records/street/bright+{estimator}.jsonl"));
        let text = fs::read_to_string(&file).unwrap();
        let (kept, _) = text.trim_end().rsplit_once('\n').unwrap();
        fs::write(&file, format!("{kept}\n")).unwrap();
    }
    run(&both, "killed").unwrap();
    assert_eq!(both.records("killed"), whole);
}

#[test]
fn an_estimator_without_its_truth_is_refused_before_anything_is_done() {
    let refused = |bench: &Bench| {
        let error = run(bench, "run").unwrap_err().to_string();
        assert!(!bench.path("run").exists());
        error
    };
    let poses = bench(&["best-h", "ransac-e"]);
    let error = refused(&poses);
    assert!(
        error.contains("`ransac-e`") && error.contains("best-h"),
        "{error}"
    );
    let mut homographies = bench(&["best-h"]);
    homographies.datasets[0].sequence = dataset(homographies.folder.path(), "street", 12).sequence;
    let error = refused(&homographies);
    assert!(error.contains("no homography of the pair 0 1"), "{error}");
    // With both, both are judged.
    let mut both = bench(&["best-h", "ransac-e"]);
    let poses = dataset(both.folder.path(), "poses", 12).sequence.pairs;
    for (pair, other) in both.datasets[0].sequence.pairs.iter_mut().zip(poses) {
        pair.truth = Truth::Both {
            b_from_a: *other.pose().unwrap(),
            homography: Matrix3::identity(),
        };
    }
    assert!(run(&both, "run").unwrap().is_complete());
    let records = both.records("run");
    let poses = records
        .iter()
        .filter(|record| record.outcome.pose().is_some());
    assert!(poses.clone().count() > 0);
    assert!(poses.into_iter().all(|record| record.correct.is_some()));
}

/// Image 0 is 8 x 8 pixels, and seen twice as wide and one and a half times as high in the others of 16 x 12.
#[test]
fn images_of_different_sizes_keep_their_places() {
    let mut stretched = bench(&["best-h"]);
    let sequence = &mut stretched.datasets[0].sequence;
    sequence.frames.truncate(2);
    sequence.pairs.truncate(1);
    sequence.pairs[0].truth = Truth::Homography(Matrix3::from_diagonal(&nalgebra::Vector3::new(
        2.0, 1.5, 1.0,
    )));
    // Bright are the pixels (7, 1) and (2, 6) of a, which are (14, 1.5) and (4, 9) of b, where it has bright ones at (14, 3)
    // and (4, 9), and another at (15, 11), which is (7.5, 7.33) of a: beside it.
    for (frame, width, height, bright) in [
        (0, 8, 8, &[(7, 1), (2, 6)][..]),
        (1, 16, 12, &[(14, 3), (4, 9), (15, 11)]),
    ] {
        let mut pixels = vec![0; width * height];
        for (x, y) in bright {
            pixels[y * width + x] = 200;
        }
        let header = format!("P5 {width} {height} 255\n");
        let file = [header.as_bytes(), &pixels].concat();
        fs::write(&sequence.frames[frame].image, file).unwrap();
    }
    run(&stretched, "run").unwrap();
    let records = stretched.records("run");
    let repeated = records[0].repeated.expect("the truth is a homography");
    assert_eq!(repeated.visible, [2, 2]);
    assert_eq!(repeated.within, [1, 2, 2, 2, 2, 2, 2, 2, 2, 2]);
}

#[test]
fn a_homography_is_judged_on_the_corners_of_its_first_image() {
    let higher = bench(&["best-h"]);
    // Each image has as many dark rows more as its number says.
    for (more, frame) in (0..).zip(&higher.datasets[0].sequence.frames) {
        let file = fs::read(&frame.image).unwrap();
        let (_, pixels) = file.split_at(b"P5 8 8 255\n".len());
        let header = format!("P5 8 {} 255\n", 8 + more);
        let dark = vec![0; 8 * more];
        fs::write(
            &frame.image,
            [header.as_bytes(), pixels, &dark[..]].concat(),
        )
        .unwrap();
    }
    run(&higher, "run").unwrap();
    let mut judged = 0;
    for record in higher.records("run") {
        let Outcome::Homography {
            homography: h,
            corner_error: Some(found),
            ..
        } = record.outcome
        else {
            continue;
        };
        // The truth is the identity.
        let moved = |x: f64, y: f64| {
            let [u, v, w] = [0, 3, 6].map(|row| h[row] * x + h[row + 1] * y + h[row + 2]);
            (u / w - x).hypot(v / w - y)
        };
        let bottom = f64::from(7 + record.task.a);
        let corners = [(0.0, 0.0), (7.0, 0.0), (0.0, bottom), (7.0, bottom)];
        let expected = corners.map(|(x, y)| moved(x, y)).iter().sum::<f64>() / 4.0;
        assert!(
            (found - expected).abs() <= 1e-9 * expected.max(1.0),
            "{found} {expected}"
        );
        judged += 1;
    }
    assert!(judged > 10, "{judged}");
}
