//! Importing the original datasets gives the authors' published ground truth, to its last digit.
//!
//! Needs data of others, which are no part of the repository: `MATCHBENCH_SCENES` names a folder with
//! the originals (`tum/rgbd_dataset_freiburg3_long_office_household` with the complete list of its
//! images as `rgb_full.txt`, `kitti`, `strecha-castle-P30`, `7scenes/redkitchen`),
//! `MATCHBENCH_REFERENCE` one with the authors' `Dataset`. Run with `cargo test -- --ignored`.

use std::fs;
use std::path::{Path, PathBuf};

use matchbench::datasets::{
    ImportOptions, Pair, Sequence, import, read_pairs, read_source, validate,
};

/// A file or folder of the originals.
fn scenes(path: &str) -> PathBuf {
    below("MATCHBENCH_SCENES", path)
}

/// A file or folder of what the authors published.
fn reference(path: &str) -> PathBuf {
    below("MATCHBENCH_REFERENCE", path)
}

fn below(variable: &str, path: &str) -> PathBuf {
    let root = std::env::var_os(variable).map(PathBuf::from);
    let found = root
        .unwrap_or_else(|| panic!("{variable} names no folder"))
        .join(path);
    assert!(found.exists(), "{variable}: {} is absent", found.display());
    found
}

fn with_pairs(rule: &str) -> ImportOptions<'static> {
    ImportOptions {
        pairs: Some(rule.parse().expect("a rule")),
        ..ImportOptions::default()
    }
}

/// Largest difference of an entry of R, and of one of t.
fn differences(found: &[Pair], published: &[Pair]) -> (f64, f64) {
    assert_eq!(found.len(), published.len());
    let mut worst = (0.0_f64, 0.0_f64);
    for (f, p) in found.iter().zip(published) {
        assert_eq!((f.a, f.b), (p.a, p.b));
        let (f, p) = (f.pose().unwrap(), p.pose().unwrap());
        let rotation = f.rotation.to_rotation_matrix().into_inner()
            - p.rotation.to_rotation_matrix().into_inner();
        let translation = f.translation.vector - p.translation.vector;
        worst = (
            worst.0.max(rotation.amax()),
            worst.1.max(translation.amax()),
        );
    }
    worst
}

/// Imports `src` and compares its pairs with the published ones of `sequence`.
fn compare(kind: &str, src: &Path, rule: &str, sequence: &str, tolerance: (f64, f64)) {
    let file = reference(&format!("Dataset/{sequence}/pairs.txt"));
    let folder = tempfile::tempdir().expect("a temporary folder");
    let out = folder.path().join(sequence);
    let report = import(kind, src, &out, &with_pairs(rule)).expect("the import");
    let found = Sequence::open(&out).expect("the imported dataset");
    assert_eq!(report.pairs, found.pairs.len());
    let published = read_pairs(&file).expect("the published pairs");
    let (rotation, translation) = differences(&found.pairs, &published);
    eprintln!(
        "{sequence}: {} frames, {} pairs, R within {rotation:.1e}, t within {translation:.1e}; {:?}",
        report.frames, report.pairs, report.notes
    );
    assert!(rotation < tolerance.0, "{rotation:e}");
    assert!(translation < tolerance.1, "{translation:e}");
}

/// The complete lists of TUM's office with an empty file for every image.
fn tum_office() -> (tempfile::TempDir, PathBuf) {
    let name = "rgbd_dataset_freiburg3_long_office_household";
    let original = scenes(&format!("tum/{name}"));
    let folder = tempfile::tempdir().expect("a temporary folder");
    let src = folder.path().join(name);
    fs::create_dir_all(src.join("rgb")).expect("a folder");
    let rgb = fs::read_to_string(original.join("rgb_full.txt")).expect("the list of images");
    for line in rgb.lines().filter(|line| !line.starts_with('#')) {
        let image = line.split_whitespace().nth(1).expect("a file name");
        fs::write(src.join(image), "").expect("an empty image");
    }
    fs::write(src.join("rgb.txt"), rgb).expect("a copy of the list");
    fs::copy(
        original.join("groundtruth.txt"),
        src.join("groundtruth.txt"),
    )
    .expect("a copy");
    (folder, src)
}

#[test]
#[ignore = "needs MATCHBENCH_SCENES and MATCHBENCH_REFERENCE"]
fn tum_office_gives_sequences_01_and_06() {
    let (_folder, src) = tum_office();
    compare("tum", &src, "fragments:15", "01-office", (2e-6, 2e-6));
    compare(
        "tum",
        &src,
        "window:9,stride:15",
        "06-office-wide",
        (4e-6, 1e-5),
    );
    let imported = read_source("tum", &src, &ImportOptions::default()).expect("the source");
    assert_eq!(imported.frames.len(), 2583);
    assert!(imported.about.notes[0].starts_with("left out: 2 images without a pose"));
}

#[test]
#[ignore = "needs MATCHBENCH_SCENES and MATCHBENCH_REFERENCE"]
fn kitti_00_gives_sequence_04() {
    let poses = scenes("kitti/poses/00.txt");
    let folder = tempfile::tempdir().expect("a temporary folder");
    let src = folder.path();
    let images = src.join("sequences/00/image_0");
    fs::create_dir_all(&images).expect("a folder");
    fs::create_dir_all(src.join("poses")).expect("a folder");
    for i in 0..4541 {
        fs::write(images.join(format!("{i:06}.png")), "").expect("an empty image");
    }
    let calib = "P0: 718.856 0 607.1928 0 0 718.856 185.2157 0 0 0 1 0\n";
    fs::write(src.join("sequences/00/calib.txt"), calib).expect("a calibration");
    fs::copy(poses, src.join("poses/00.txt")).expect("a copy");
    compare("kitti", src, "fragments:5", "04-kitti", (2e-6, 1e-4));
}

#[test]
#[ignore = "needs MATCHBENCH_SCENES and MATCHBENCH_REFERENCE"]
fn castle_gives_sequence_05() {
    let src = scenes("strecha-castle-P30");
    compare("strecha", &src, "all", "05-castle", (4e-6, 2e-4));
}

#[test]
#[ignore = "needs MATCHBENCH_SCENES"]
fn all_scenes_are_imported_and_sound() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    for (kind, src, rule, frames, pairs) in [
        (
            "tum",
            "tum/rgbd_dataset_freiburg3_long_office_household",
            "all",
            19,
            171,
        ),
        ("kitti", "kitti", "fragments:5", 51, 40),
        ("strecha", "strecha-castle-P30", "all", 30, 435),
        ("7scenes", "7scenes/redkitchen", "fragments:15", 150, 140),
        (
            "7scenes",
            "7scenes/redkitchen",
            "window:9,stride:15",
            10,
            45,
        ),
    ] {
        let out = folder.path().join(format!("{kind}-{frames}"));
        let report = import(kind, &scenes(src), &out, &with_pairs(rule)).expect("the import");
        assert_eq!((report.frames, report.pairs), (frames, pairs), "{kind}");
        assert_eq!(validate(&out), [], "{kind}");
    }
}

#[test]
#[ignore = "needs MATCHBENCH_REFERENCE"]
fn the_published_ground_truth_is_read() {
    let root = reference("Dataset");
    for (name, pairs) in [
        ("01-office", 2410),
        ("02-teddy", 2244),
        ("03-large-cabinet", 938),
        ("04-kitti", 3632),
        ("05-castle", 435),
        ("06-office-wide", 1512),
        ("07-teddy-wide", 1404),
        ("08-large-cabinet-wide", 567),
    ] {
        let found = read_pairs(&root.join(name).join("pairs.txt")).expect("the published pairs");
        assert_eq!(found.len(), pairs, "{name}");
    }
}
