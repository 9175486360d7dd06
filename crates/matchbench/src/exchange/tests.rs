//! Every format on the same matches: written by other tools (`tests/exchange/fixtures.zip`, made by
//! `make.py` beside it with h5py, numpy and pycolmap) and by us.

use std::fs::{self, File};
use std::path::{Path, PathBuf};

use image::GrayImage;
use matchbench_vision::geometry::{Camera, MatchedPoints, RelativePose};
use matchbench_vision::seed::Seed;
use nalgebra::{Isometry3, Point2, UnitQuaternion, UnitVector3, Vector3};
use tempfile::TempDir;
use zip::ZipArchive;

use super::*;
use crate::arrays::Hdf5Out;
use crate::datasets::{Frame, Pair, Sequence};

/// Folder in the archive of fixtures, format, and what must be said to read it.
#[expect(clippy::type_complexity, reason = "a table of one test")]
pub(super) const FIXTURES: [(&str, &str, Option<f64>, Option<[u32; 2]>); 10] = [
    ("npz", "npz", Some(0.0), None),
    ("packed", "packed", None, None),
    ("text", "text", Some(0.0), None),
    ("hloc", "hloc", None, None),
    ("hloc_old", "hloc", None, None),
    ("hloc_dense", "hloc", None, None),
    ("glue_factory", "glue-factory", None, None),
    ("colmap", "colmap", None, None),
    ("superglue", "superglue", None, Some([200, 200])),
    ("imc", "imc", None, None),
];

/// Three images of 400 x 300 pixels, all pairs, and the fixtures beside them.
pub(super) fn dataset() -> (TempDir, Sequence) {
    let folder = tempfile::tempdir().unwrap();
    let fixtures = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/exchange/fixtures.zip");
    let mut archive = ZipArchive::new(File::open(fixtures).unwrap()).unwrap();
    archive.extract(folder.path()).unwrap();
    let frame = |name: &str| {
        let image = folder.path().join("images").join(name);
        fs::create_dir_all(image.parent().unwrap()).unwrap();
        GrayImage::new(400, 300).save(&image).unwrap();
        Frame::with_pose(
            image,
            Camera::pinhole(350.0, 350.0, 199.5, 149.5),
            Isometry3::identity(),
        )
    };
    let frames = ["db/one.png", "db/two.png", "query/one.png"].map(frame);
    let pair = |(a, b)| Pair::with_pose(a, b, Isometry3::translation(1.0, 0.0, 0.0));
    let sequence = Sequence {
        name: "room".into(),
        frames: frames.into(),
        pairs: [(0, 1), (0, 2), (1, 2)].map(pair).into(),
    };
    (folder, sequence)
}

pub(super) fn options(pixel_center: Option<f64>, resized: Option<[u32; 2]>) -> ReadOptions {
    ReadOptions {
        pixel_center,
        resized,
        ..ReadOptions::default()
    }
}

/// The points and scores of all pairs, as `make.py` has them.
#[expect(clippy::type_complexity, reason = "a table of one test")]
fn expected() -> Vec<((u32, u32), Vec<[f32; 4]>, Vec<f32>)> {
    let keypoint = |i: u32, k: usize| {
        let i = i as f32;
        [
            [10.0 + 8.0 * i, 20.0 + 5.0 * i],
            [390.0 - 8.0 * i, 280.0 - 5.0 * i],
            [100.5 + i, 50.25],
            [7.0 * i + 200.0, 150.0],
        ][k]
    };
    let pair = |a, b, of_a: &[usize], of_b: &[usize], scores: &[f32]| {
        let points = of_a.iter().zip(of_b).map(|(&i, &j)| {
            let ([x_a, y_a], [x_b, y_b]) = (keypoint(a, i), keypoint(b, j));
            [x_a, y_a, x_b, y_b]
        });
        ((a, b), points.collect(), scores.to_vec())
    };
    vec![
        pair(0, 1, &[0, 1, 3], &[1, 0, 2], &[0.9, 0.5, 0.25]),
        pair(0, 2, &[1, 2], &[3, 2], &[1.0, 0.125]),
        pair(1, 2, &[0, 1, 2, 3], &[0, 1, 2, 3], &[0.5, 0.5, 0.75, 1.0]),
    ]
}

/// Points of a pair sorted by image a, since a reversed pair comes in the order of image b.
fn rows(
    MatchedPoints {
        a, b, ambiguity, ..
    }: &MatchedPoints,
) -> Vec<([f32; 4], f32)> {
    let points = a
        .iter()
        .zip(b)
        .map(|(a, b)| [a.x, a.y, b.x, b.y].map(|x| x as f32));
    let mut rows: Vec<_> = points.zip(ambiguity.iter().copied()).collect();
    rows.sort_by(|one, other| one.0.partial_cmp(&other.0).unwrap());
    rows
}

#[test]
fn each_fixture_is_recognised_by_its_format_alone() {
    let (folder, _) = dataset();
    for (fixture, id, ..) in FIXTURES {
        let probe = Probe::new(&[folder.path().join(fixture)], "room").unwrap();
        let found: Vec<_> = (FORMATS.iter())
            .filter(|format| (format.recognises)(&probe))
            .map(|format| format.id)
            .collect();
        assert_eq!(found, [id], "{fixture}");
    }
    for format in FORMATS {
        assert!(
            FIXTURES.iter().any(|(_, id, ..)| *id == format.id),
            "{format:?} has no fixture"
        );
        assert_eq!(Format::find(format.id).unwrap().id, format.id);
        assert!(!format.layout.is_empty() && !format.layout.ends_with('.'));
    }
}

#[test]
fn every_format_gives_the_same_matches() {
    let (folder, sequence) = dataset();
    for (fixture, id, center, resized) in FIXTURES {
        let path = folder.path().join(fixture);
        let files = MatchFiles::open(&[path], &sequence, &options(center, resized)).unwrap();
        assert_eq!(files.understood().format, id);
        assert_eq!(files.survey().absent, []);
        assert_eq!(
            (files.survey().found, files.survey().matches),
            (3, 9),
            "{fixture}"
        );
        assert_eq!(files.survey().warnings, [""; 0], "{fixture}");
        let scored = files.understood().scores != Scores::None;
        assert_eq!(scored, !["colmap", "imc"].contains(&id), "{fixture}");
        for ((a, b), points, scores) in expected() {
            let found = rows(&files.matches(a, b).unwrap().unwrap().points);
            let mut expected: Vec<_> = points.into_iter().zip(scores).collect();
            expected.sort_by(|one, other| one.0.partial_cmp(&other.0).unwrap());
            for ((found, ambiguity), (point, score)) in found.iter().zip(&expected) {
                for (found, expected) in found.iter().zip(point) {
                    // Resizing rounds; the fixtures are exact in half precision.
                    let tolerance = if resized.is_some() { 1e-4 } else { 0.0 };
                    assert!(
                        (found - expected).abs() <= tolerance,
                        "{fixture}: {found} {expected}"
                    );
                }
                let expected = if scored { 1.0 - score } else { 0.0 };
                // hloc's scores are of half precision.
                assert!(
                    (ambiguity - expected).abs() < 5e-4,
                    "{fixture}: {ambiguity}"
                );
            }
            assert_eq!(found.len(), expected.len());
            let reversed = files.matches(b, a).unwrap();
            assert!(reversed.is_none(), "the dataset has no such pair");
        }
    }
}

#[test]
fn a_pair_is_found_in_either_order() {
    let (folder, mut sequence) = dataset();
    for pair in &mut sequence.pairs {
        (pair.a, pair.b) = (pair.b, pair.a);
    }
    for (fixture, _, center, resized) in FIXTURES {
        let path = folder.path().join(fixture);
        let files = MatchFiles::open(&[path], &sequence, &options(center, resized)).unwrap();
        for ((a, b), points, _) in expected() {
            let mut swapped = files.matches(b, a).unwrap().unwrap().points;
            std::mem::swap(&mut swapped.a, &mut swapped.b);
            let mut expected = points;
            expected.sort_by(|one, other| one.partial_cmp(other).unwrap());
            for ((found, _), expected) in rows(&swapped).iter().zip(&expected) {
                let far = found
                    .iter()
                    .zip(expected)
                    .any(|(x, y)| (x - y).abs() > 1e-4);
                assert!(!far, "{fixture}: {found:?} {expected:?}");
            }
        }
    }
}

#[test]
fn what_the_files_do_not_say_must_be_said() {
    let (folder, sequence) = dataset();
    for (fixture, named) in [
        ("npz", "--pixel-center 0 (as OpenCV, numpy indices) or 0.5"),
        ("text", "--pixel-center"),
        ("superglue", "--resized WxH"),
    ] {
        let path = folder.path().join(fixture);
        let error = MatchFiles::open(&[path], &sequence, &ReadOptions::default()).err();
        let message = error.unwrap().to_string();
        assert!(message.contains(named), "{message}");
    }
    let wrong = ReadOptions {
        format: Some(Format::find("hloc").unwrap()),
        ..ReadOptions::default()
    };
    let error = MatchFiles::open(&[folder.path().join("colmap")], &sequence, &wrong).err();
    let message = error.unwrap().to_string();
    assert!(
        message.contains("its content is `colmap`, not `hloc`"),
        "{message}"
    );
}

#[test]
fn absent_pairs_are_listed_and_strangers_counted() {
    let (folder, mut sequence) = dataset();
    let npz = folder.path().join("npz");
    fs::remove_file(npz.join("0_2.npz")).unwrap();
    fs::copy(npz.join("0_1.npz"), npz.join("0_7.npz")).unwrap();
    let open = |sequence: &Sequence| {
        MatchFiles::open(
            std::slice::from_ref(&npz),
            sequence,
            &options(Some(0.0), None),
        )
    };
    let files = open(&sequence).unwrap();
    assert_eq!(files.survey().absent, [(0, 2)]);
    let paths = std::slice::from_ref(&npz);
    let source = MatchSource::open(paths, &[&sequence], &options(Some(0.0), None), None);
    let notes = source.unwrap().build("mine").notes;
    // A limit may leave them out.
    assert_eq!(
        notes[1],
        "room: absent: 1 pair; what is run of them counts as failed. Score the others alone by `matchbench eval RUN \
         --pairs list:FILE`"
    );
    assert_eq!(files.survey().others, 1);
    assert!(files.matches(0, 2).unwrap().is_none());
    sequence.pairs.retain(|pair| (pair.a, pair.b) == (0, 2));
    let message = open(&sequence).err().unwrap().to_string();
    assert!(
        message.contains("none of its pairs is one of the dataset `room`"),
        "{message}"
    );
}

/// A folder with the matches of the pair 0 1 as text.
fn text(lines: &str) -> (TempDir, PathBuf, Sequence) {
    let (folder, mut sequence) = dataset();
    sequence.pairs.truncate(1);
    let path = folder.path().join("lines");
    fs::create_dir(&path).unwrap();
    fs::write(path.join("0_1.txt"), lines).unwrap();
    (folder, path, sequence)
}

#[test]
fn points_outside_the_image_name_pair_and_match() {
    for (lines, center, accepted) in [
        ("0 0 399.5 299.5", 0.0, true),
        ("-0.5 0 1 1", 0.0, true),
        ("-0.6 0 1 1", 0.0, false),
        ("-0.1 0 1 1", 0.5, false),
        ("0 0 1 1\n0 0 399.6 0", 0.0, false),
        ("0 0 400 300", 0.5, true),
        ("nan 0 1 1", 0.0, false),
        ("0 0 1 inf", 0.0, false),
        ("1e300 0 1 1", 0.0, false),
    ] {
        let (_folder, path, sequence) = text(lines);
        let files = MatchFiles::open(&[path], &sequence, &options(Some(center), None));
        match files {
            Ok(_) => assert!(accepted, "{lines}"),
            Err(error) => {
                let message = error.to_string();
                assert!(!accepted, "{message}");
                let number = lines.lines().count() - 1;
                assert!(
                    message.contains(&"pair 0 1, ".to_string()) || message.contains("pair 0 1:")
                );
                assert!(
                    message.contains(&format!("match {number}: the point")),
                    "{message}"
                );
                let is_finite = !lines.contains("nan") && !lines.contains("inf");
                assert!(message.contains("0_1.txt"), "{message}");
                assert_eq!(message.contains("--resized"), is_finite, "{message}");
                assert_eq!(message.contains("finite numbers"), !is_finite, "{message}");
            }
        }
    }
}

#[test]
fn wrong_keypoints_name_their_own_file() {
    let hloc = [
        "db/one.png/keypoints",
        "db/two.png/keypoints",
        "db-one.png/db-two.png/matches0",
    ];
    for (arrays, shape) in [(hloc, &[2][..]), (["0", "1", "0-1"], &[2, 1])] {
        for (columns, words) in [(1, "[2, 1]"), (2, "(900, 1)")] {
            let (folder, mut sequence) = dataset();
            sequence.pairs.truncate(1);
            let [a, b, pair] = arrays.map(str::to_owned);
            let (mut keypoints, mut matches) = (Hdf5Out::default(), Hdf5Out::default());
            keypoints.floats(a, &[2, columns], &[900.0, 1.0, 2.0, 2.0][..2 * columns]);
            keypoints.floats(b, &[2, 2], &[1.0; 4]);
            matches.integers(pair, shape, &[0, 0]);
            let paths = ["keypoints.h5", "matches.h5"].map(|name| folder.path().join(name));
            for (out, path) in [keypoints, matches].into_iter().zip(&paths) {
                out.write(path).unwrap();
            }
            let found = MatchFiles::open(&paths, &sequence, &ReadOptions::default());
            let error = found.err().unwrap();
            assert_eq!(error.file, paths[0], "{error}");
            assert!(error.to_string().contains(words), "{error}");
        }
    }
}

#[test]
fn points_that_never_fill_their_image_are_warned_about() {
    let warnings = |lines, resized| {
        let (_folder, path, sequence) = text(lines);
        let files = MatchFiles::open(&[path], &sequence, &options(Some(0.0), resized)).unwrap();
        files.survey().warnings.clone()
    };
    let small = "0 0 10 10\n150 100 190 120";
    assert!(warnings(small, None)[0].contains("--resized WxH"));
    assert_eq!(warnings(small, Some([200, 150])), [""; 0]);
    let told = &warnings(small, Some([800, 600]))[0];
    assert!(
        told.ends_with("were the images resized to 800x600?"),
        "{told}"
    );
    assert_eq!(warnings("0 0 10 10\n250 100 200 120", None), [""; 0]);
    assert_eq!(warnings("", None), [""; 0]);
}

#[test]
fn points_of_resized_images_are_scaled_about_the_pixels_edges() {
    let (_folder, path, sequence) = text("0 0 99 49");
    let files = MatchFiles::open(&[path], &sequence, &options(Some(0.0), Some([100, 50]))).unwrap();
    let matches = files.matches(0, 1).unwrap().unwrap().points;
    // 4 and 6 original pixels in one: its centre lies in their middle.
    assert_eq!(matches.a, [Point2::new(1.5, 2.5)]);
    assert_eq!(matches.b, [Point2::new(397.5, 296.5)]);
}

#[test]
fn scores_beyond_the_unit_interval_keep_their_order() {
    let (_folder, path, sequence) =
        text("0 0 1 1 -1000\n0 0 1 1 -0.5\n0 0 1 1 0\n0 0 1 1 30\n0 0 1 1 inf");
    let files = MatchFiles::open(&[path], &sequence, &options(Some(0.0), None)).unwrap();
    assert_eq!(files.understood().scores, Scores::Unbounded);
    let ambiguity = files.matches(0, 1).unwrap().unwrap().points.ambiguity;
    assert!(
        ambiguity.is_sorted_by(|one, other| one > other),
        "{ambiguity:?}"
    );
    assert_eq!((ambiguity[2], ambiguity[4]), (0.5, 0.0));
    let (_folder, path, sequence) = text("0 0 1 1 nan");
    let error = MatchFiles::open(&[path], &sequence, &options(Some(0.0), None)).err();
    assert!(
        error
            .unwrap()
            .to_string()
            .contains("match 0 has the score NaN")
    );
}

#[test]
fn a_pair_that_is_there_twice_is_named_with_both_files() {
    let (_folder, path, sequence) = text("0 0 1 1");
    fs::write(path.join("00_01.txt"), "0 0 1 1").unwrap();
    let error = MatchFiles::open(&[path], &sequence, &options(Some(0.0), None)).err();
    let message = error.unwrap().to_string();
    let named = "0_1.txt: pair 0 1 is there twice, as `0_1` and as `00_01` in ";
    assert!(
        message.contains(named) && message.contains("00_01.txt; keep one"),
        "{message}"
    );
}

#[test]
fn a_folder_for_each_dataset_is_understood() {
    let (folder, sequence) = dataset();
    let all = folder.path().join("all");
    fs::create_dir(&all).unwrap();
    fs::rename(folder.path().join("hloc"), all.join("room")).unwrap();
    let files = MatchFiles::open(&[all], &sequence, &ReadOptions::default()).unwrap();
    assert_eq!(files.survey().matches, 9);
    let line = files.understood().to_string();
    assert!(line.starts_with("hloc: features.h5 (blake3 "), "{line}");
    assert!(line.contains("frames by image name; first pixel's centre at 0; scores in 0..1"));
}

#[test]
fn what_is_no_file_of_matches_is_refused() {
    let (folder, sequence) = dataset();
    let open = |path: PathBuf| {
        let error = MatchFiles::open(&[path], &sequence, &ReadOptions::default()).err();
        error.unwrap().to_string()
    };
    #[cfg(unix)]
    assert!(open("/dev/null".into()).contains("where a file is needed"));
    assert!(open(folder.path().join("nothing")).contains("check the path"));
    assert!(open(folder.path().join("images/db/one.png")).contains("no .npz, HDF5, SQLite"));
    assert!(open(folder.path().join("images")).contains("no file of matches"));
    let mixed = folder.path().join("mixed");
    fs::create_dir(&mixed).unwrap();
    fs::copy(
        folder.path().join("packed/matches.npz"),
        mixed.join("a.npz"),
    )
    .unwrap();
    fs::copy(folder.path().join("colmap/database.db"), mixed.join("b.db")).unwrap();
    assert!(open(mixed).contains("of another kind"));
}

/// Every fixture with one byte changed or cut short: an error or matches, never a panic, and all
/// points that are accepted lie in their images.
#[test]
fn damaged_files_are_refused_or_give_sound_points() {
    let (folder, sequence) = dataset();
    let mut draws = Seed(7).rng();
    for (fixture, _, center, resized) in FIXTURES {
        let path = folder.path().join(fixture);
        let mut files: Vec<_> = fs::read_dir(&path)
            .unwrap()
            .map(|e| e.unwrap().path())
            .collect();
        files.sort();
        for file in files {
            let whole = fs::read(&file).unwrap();
            for round in 0..24 {
                let place = draws.below(whole.len() as u32) as usize;
                let mut bytes = whole.clone();
                if round % 4 == 0 {
                    bytes.truncate(place);
                } else {
                    bytes[place] ^= 1 << draws.below(8);
                }
                fs::write(&file, bytes).unwrap();
                let paths = [path.clone()];
                let Ok(files) = MatchFiles::open(&paths, &sequence, &options(center, resized))
                else {
                    continue;
                };
                for pair in &sequence.pairs {
                    let Some(matches) = files.matches(pair.a, pair.b).unwrap() else {
                        continue;
                    };
                    let matches = matches.points;
                    for p in matches.a.iter().chain(&matches.b) {
                        assert!((-1.0..401.0).contains(&p.x) && (-1.0..301.0).contains(&p.y));
                    }
                    assert!(matches.ambiguity.iter().all(|x| (0.0..=1.0).contains(x)));
                }
            }
            fs::write(&file, &whole).unwrap();
        }
    }
}

/// Matches that formats find hard: odd fractions, a keypoint in several pairs, a place matched
/// twice in one pair, a pair without matches.
fn export(sequence: &Sequence) -> Export<'_> {
    let mut draws = Seed(3).rng();
    let mut point = || {
        let [x, y] = [(); 2].map(|()| draws.below(1 << 24) as f32 / (1 << 24) as f32);
        Point2::new(399.0 * x, 299.0 * y).cast::<f64>()
    };
    let mut keypoints: Vec<Vec<_>> = (0..3).map(|_| (0..60).map(|_| point()).collect()).collect();
    keypoints[0][8] = keypoints[0][7];
    let pairs = [(0, 1, 0..40), (0, 2, 5..60), (1, 2, 0..0)].map(|(a, b, range)| {
        let b_of = |i: usize| (i * 7 + 3) % 60;
        PairExport {
            frames: (a, b),
            points: MatchedPoints::new(
                range.clone().map(|i| keypoints[a as usize][i]).collect(),
                range
                    .clone()
                    .map(|i| keypoints[b as usize][b_of(i)])
                    .collect(),
                range.clone().map(|i| (i as f32 * 0.37).fract()).collect(),
            ),
            two_view: (b == 1).then(|| TwoView {
                b_from_a: Model::Pose(RelativePose {
                    rotation: UnitQuaternion::from_euler_angles(0.1, 0.2, 0.3),
                    direction: UnitVector3::new_normalize(Vector3::new(1.0, 0.2, 0.1)),
                }),
                inliers: range.map(|i| i % 3 == 0).collect(),
            }),
        }
    });
    Export::new(sequence, pairs.into()).unwrap()
}

#[test]
fn what_is_written_is_read_back_bit_for_bit() {
    let (folder, sequence) = dataset();
    let export = export(&sequence);
    for format in FORMATS.iter().filter(|format| format.can_write()) {
        let out = folder.path().join("out").join(format.id);
        let files = format.write(&out, &export).unwrap();
        assert!(
            files
                .iter()
                .all(|file| file.starts_with(&out) && file.is_file())
        );
        let center = format.pixel_center.or(Some(0.0));
        let read = MatchFiles::open(&[out], &sequence, &options(center, None)).unwrap();
        assert_eq!(read.understood().format, format.id);
        for pair in &export.pairs {
            let (a, b) = pair.frames;
            let found = read.matches(a, b).unwrap().unwrap().points;
            if format.id == "colmap" {
                // Single precision with 0.5 added, and no scores.
                let near = |one: &[Point2<f64>], other: &[Point2<f64>]| {
                    one.len() == other.len()
                        && one
                            .iter()
                            .zip(other)
                            .all(|(one, other)| (one - other).norm() < 1e-4)
                };
                assert!(near(&found.a, &pair.points.a) && near(&found.b, &pair.points.b));
                continue;
            }
            assert_eq!(found, pair.points, "{format:?}");
        }
        // Two runs write the same bytes.
        let again = folder.path().join("again").join(format.id);
        for (one, other) in files.iter().zip(format.write(&again, &export).unwrap()) {
            assert!(
                fs::read(one).unwrap() == fs::read(other).unwrap(),
                "{}",
                one.display()
            );
        }
    }
    let imc = Format::find("imc").unwrap();
    let message = imc.write(folder.path(), &export).unwrap_err().to_string();
    assert!(
        message.contains("choose one of npz, packed, hloc"),
        "{message}"
    );
}

#[test]
fn matches_whose_second_candidate_was_nearer_are_as_ambiguous_as_can_be() {
    let (folder, sequence) = dataset();
    let mut export = export(&sequence);
    export.pairs[0].points.ambiguity[..3].copy_from_slice(&[0.25, 1.5, 6.0]);
    for format in FORMATS.iter().filter(|format| format.can_write()) {
        let out = folder.path().join("out").join(format.id);
        format.write(&out, &export).unwrap();
        let center = format.pixel_center.or(Some(0.0));
        let read = MatchFiles::open(&[out], &sequence, &options(center, None)).unwrap();
        let found = read.matches(0, 1).unwrap().unwrap().points.ambiguity;
        if format.id != "colmap" {
            assert_eq!(found[..3], [0.25, 1.0, 1.0], "{format:?}");
        }
    }
}

#[test]
fn inliers_leave_alone() {
    let (folder, sequence) = dataset();
    let export = export(&sequence).inliers_alone();
    assert_eq!(export.pairs.len(), 1);
    assert_eq!(export.pairs[0].points.len(), 14);
    let out = folder.path().join("out");
    Format::find("colmap")
        .unwrap()
        .write(&out, &export)
        .unwrap();
    for verified in [false, true] {
        let options = ReadOptions {
            verified,
            ..ReadOptions::default()
        };
        let read = MatchFiles::open(std::slice::from_ref(&out), &sequence, &options).unwrap();
        assert_eq!(read.survey().matches, 14);
        assert_eq!(read.survey().absent, [(0, 2), (1, 2)]);
    }
}
