//! Importers of lists of pairs on small sources. What is binary lies in `tests/lists`,
//! with the program that made it; texts are written here in their authors' form; `.npz` are zipped
//! here as numpy's are.

use std::fs;
use std::path::{Path, PathBuf};

use matchbench_vision::geometry::Camera;
use nalgebra::{Isometry3, Point3, Vector3};

use super::tests::source;
use super::{ImportOptions, Imported, import, read_source};
use crate::arrays::testing::{npy, write_npz};
use crate::datasets::{
    DatasetError, DepthFile, DepthUnit, ImageStorage, Pair, Sequence, Turn, export, testing,
    validate,
};

/// Names, turns, K_0, K_1, T_0to1: a turn of 0.1 radians about y and a step.
fn superglue_row(names: [&str; 2], turns: [u8; 2], step: &str) -> String {
    let k = "1165.72 0. 649.095 0. 1165.74 484.765 0. 0. 1.";
    let t =
        format!("0.995004 0. 0.0998334 {step} 0. 1. 0. 0.5 -0.0998334 0. 0.995004 0. 0. 0. 0. 1.");
    format!(
        "{} {} {} {} {k} {k} {t}\n",
        names[0], names[1], turns[0], turns[1]
    )
}

pub(super) fn fixture(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR"))
        .join("tests/lists")
        .join(name)
}

pub(super) fn with_root(root: &Path) -> ImportOptions<'static> {
    ImportOptions {
        image_root: Some(root.to_owned()),
        ..ImportOptions::default()
    }
}

pub(super) fn read(kind: &str, src: &Path) -> Result<Imported, DatasetError> {
    read_source(kind, src, &ImportOptions::default())
}

pub(super) fn x_of(pair: &Pair) -> f64 {
    pair.pose().unwrap().translation.x
}

#[test]
fn a_superglue_list_names_frames_once() {
    let list = [
        superglue_row(["a.png", "b.png"], [0, 0], "-0.03968"),
        superglue_row(["b.png", "c.png"], [0, 0], "2"),
    ]
    .concat();
    let (folder, src) = source("sg", &[("list.txt", &list), ("a.png", ""), ("b.png", "")]);
    let out = folder.path().join("out");
    let report = import(
        "superglue",
        &src.join("list.txt"),
        &out,
        &ImportOptions::default(),
    );
    let report = report.unwrap();
    assert_eq!((report.frames, report.pairs, report.rule), (3, 2, None));
    assert!(
        report.notes[0].starts_with("not there (yet): 1 of 3 images ("),
        "{:?}",
        report.notes
    );
    let pairs = crate::datasets::read_pairs(&out.join("pairs.txt")).unwrap();
    assert_eq!((pairs[1].a, pairs[1].b, x_of(&pairs[0])), (1, 2, -0.03968));
    let problems = validate(&out);
    assert!(
        problems
            .iter()
            .any(|problem| problem.error.file.ends_with("c.png")),
        "{problems:?}"
    );

    for (from, to, word) in [
        (" 0 0 1165", " 0 1165", "37 columns"),
        (" 0 0 1165", " 0 5 1165", "a turn of 5"),
        (
            "0.995004 0. 0.0998334 -0",
            "1.995004 0. 0.0998334 -0",
            "not a rotation",
        ),
        (" -0.03968", " 1e308", "coordinate"),
        ("b.png 0 0", "a.png 0 0", "matched with itself"),
    ] {
        fs::write(src.join("list.txt"), list.replacen(from, to, 1)).unwrap();
        let error = read("superglue", &src.join("list.txt")).unwrap_err();
        assert_eq!(error.line, Some(1), "{error}");
        assert!(error.what.contains(word), "{error}");
    }
}

/// A point that both cameras see is seen at the turned pixel by the turned cameras: K, T and
/// pixels turn together.
#[test]
fn turns_of_a_superglue_list_are_applied_to_pixels_k_and_t() {
    let plain = superglue_row(["a.png", "b.png"], [0, 0], "0.25");
    let turned = superglue_row(["a.png", "b.png"], [1, 3], "0.25");
    let (folder, src) = source("sg", &[("a.png", ""), ("b.png", "")]);
    let read = |text: &str| {
        fs::write(src.join("list.txt"), text).unwrap();
        read("superglue", &src.join("list.txt")).unwrap()
    };
    let (plain, turned) = (read(&plain), read(&turned));
    let size = testing::pixels(0).size();
    let see = |imported: &Imported, point: Point3<f64>, frame: usize| {
        imported.frames[frame]
            .camera
            .project((point.coords / point.z).xy().into())
    };
    let pose = |imported: &Imported| *imported.pairs.as_ref().unwrap()[0].pose().unwrap();
    let point = Point3::new(0.3, -0.2, 4.0);
    let in_turned_a = Point3::from(Turn::Quarter.rotation() * point.coords);
    let (before_a, before_b) = (see(&plain, point, 0), see(&plain, pose(&plain) * point, 1));
    let after_a = see(&turned, in_turned_a, 0);
    let after_b = see(&turned, pose(&turned) * in_turned_a, 1);
    let (right, down) = (size.width as f64 - 1.0, size.height as f64 - 1.0);
    assert!((after_a.x - before_a.y).abs() + (after_a.y - (right - before_a.x)).abs() < 1e-9);
    assert!((after_b.x - (down - before_b.y)).abs() + (after_b.y - before_b.x).abs() < 1e-9);

    // And out again, where the list is that of the stored pixels.
    let out = folder.path().join("set");
    import(
        "superglue",
        &src.join("list.txt"),
        &out,
        &ImportOptions::default(),
    )
    .unwrap();
    let sequence = Sequence::open(&out).unwrap();
    assert_eq!(sequence.frames[0].pixels().unwrap().width(), size.height);
    let list = folder.path().join("again.txt");
    let root = export("superglue", &sequence, &list).unwrap();
    let again = read_source("superglue", &list, &with_root(&root)).unwrap();
    let difference = pose(&again).to_homogeneous() - pose(&turned).to_homogeneous();
    assert!(difference.amax() < 1e-12, "{difference}");
    assert!((again.frames[1].camera.cx - turned.frames[1].camera.cx).abs() < 1e-9);
    assert_eq!(again.frames[1].turn, Turn::ThreeQuarters);
}

/// The same two pairs, in LoFTR's form (poses in single precision, K for small images) and in
/// SuperGlue's.
#[test]
fn scannet_and_superglue_lists_give_the_same_dataset() {
    let name = |frame: u16| format!("scans_test/scene0707_00/sens/frame-{frame:06}.color.jpg");
    let (a, b, c) = (name(15), name(585), name(45));
    let list = [
        superglue_row([&a, &b], [0, 0], "-0.03968"),
        superglue_row([&c, &b], [0, 0], "0.91886"),
    ]
    .concat();
    let (_folder, src) = source("lists", &[("list.txt", &list)]);
    let names: Vec<u8> = [707_u16, 0, 15, 585, 707, 0, 45, 585]
        .map(u16::to_le_bytes)
        .concat();
    let pose = |x: f32| {
        [
            0.995004, 0., 0.0998334, x, 0., 1., 0., 0.5, -0.0998334, 0., 0.995004, 0.,
        ]
        .map(f32::to_le_bytes)
        .concat()
    };
    let poses = [pose(-0.03968), pose(0.91886)].concat();
    let test = src.join("test.npz");
    write_npz(
        &test,
        &[
            ("name", npy("<u2", "(2, 4)", &names)),
            ("rel_pose", npy("<f4", "(2, 12)", &poses)),
        ],
    );
    let k = [
        1165.72 / 2.025,
        0.,
        649.095 / 2.025,
        0.,
        1165.74 * 480. / 968.,
        484.765 * 480. / 968.,
    ];
    let k = [&k[..], &[0., 0., 1.]].concat();
    let k: Vec<u8> = k
        .iter()
        .flat_map(|value: &f64| value.to_le_bytes())
        .collect();
    write_npz(
        &src.join("intrinsics.npz"),
        &[("scene0707_00", npy("<f8", "(3, 3)", &k))],
    );

    let ours = read("scannet", &test).unwrap();
    let theirs = read("superglue", &src.join("list.txt")).unwrap();
    assert_eq!(ours.pairs, theirs.pairs);
    let cameras = |imported: &Imported| -> Vec<Camera> {
        imported.frames.iter().map(|frame| frame.camera).collect()
    };
    assert_eq!(cameras(&ours), cameras(&theirs));
    assert!(ours.frames[2].image.ends_with("scene0707_00/color/45.jpg"));

    // Images of the small size have the small K, with pixel centres at integers.
    let image = src.join("scene0707_00/color/15.jpg");
    fs::create_dir_all(image.parent().unwrap()).unwrap();
    fs::write(&image, b"P5 640 484 255\n").unwrap();
    let small = read("scannet", &test).unwrap().frames[0].camera;
    assert!(
        (small.cx - (649.595 / 2.025 - 0.5)).abs() < 1e-9,
        "{small:?}"
    );

    // Its depth lies beside the folder of colour.
    let depth = |imported: &Imported| imported.frames[0].depth.clone();
    assert_eq!(depth(&read("scannet", &test).unwrap()), None);
    let file = src.join("scene0707_00/depth/15.png");
    fs::create_dir_all(file.parent().unwrap()).unwrap();
    fs::write(&file, "").unwrap();
    let found = depth(&read("scannet", &test).unwrap()).unwrap();
    assert_eq!((found.path, found.unit.per_unit), (file, 1000.0));

    let intrinsics = ImportOptions {
        intrinsics: Some(src.join("none.npz")),
        ..ImportOptions::default()
    };
    let error = read_source("scannet", &test, &intrinsics).unwrap_err();
    assert!(error.remedy.contains("--intrinsics"), "{error}");
    write_npz(
        &test,
        &[
            ("name", npy("<u2", "(2, 4)", &names)),
            ("rel_pose", npy("<f4", "(1, 12)", &pose(1.))),
        ],
    );
    assert!(
        read("scannet", &test)
            .unwrap_err()
            .what
            .contains("2 names for 1 pose")
    );
    write_npz(
        &test,
        &[
            ("name", npy("<u2", "(1, 4)", &names[..8])),
            ("rel_pose", npy("<f4", "(1, 12)", &pose(f32::NAN))),
        ],
    );
    assert!(
        read("scannet", &test)
            .unwrap_err()
            .what
            .starts_with("row 0: ")
    );
}

#[test]
fn megadepth_is_read_from_loftrs_pickle() {
    let root = Path::new("/photos");
    let found = read_source("megadepth", &fixture("megadepth.npz"), &with_root(root)).unwrap();
    let names: Vec<_> = found
        .frames
        .iter()
        .map(|frame| frame.image.clone())
        .collect();
    assert_eq!(
        names,
        ["3.png", "0.png", "2.png"].map(|name| root.join(name))
    );
    for frame in &found.frames {
        assert_eq!(frame.camera, Camera::pinhole(20.0, 21.0, 11.5, 8.0));
    }
    // World to camera: x is 2, 0, 1 and the turn about y a tenth of it.
    let pose = |x: f64| Isometry3::new(Vector3::x() * x, Vector3::y() * 0.1 * x);
    let pairs = found.pairs.unwrap();
    for (pair, expected) in pairs
        .iter()
        .zip([pose(0.0) * pose(2.0).inverse(), pose(1.0)])
    {
        let difference = pair.pose().unwrap().to_homogeneous() - expected.to_homogeneous();
        assert!(difference.amax() < 1e-12);
    }
    assert_eq!((pairs[1].a, pairs[1].b), (1, 2));

    let bytes = fs::read(fixture("megadepth.npz")).unwrap();
    let (_folder, src) = source("set", &[("0.h5", "")]);
    let root = with_root(&src);
    let found = read_source("megadepth", &fixture("megadepth.npz"), &root).unwrap();
    let depths: Vec<_> = found
        .frames
        .iter()
        .map(|frame| frame.depth.clone())
        .collect();
    let there = DepthFile {
        path: src.join("0.h5"),
        unit: DepthUnit::UNITS,
    };
    assert_eq!(depths, [None, Some(there), None]);
    for end in [10, 200, bytes.len() - 1] {
        fs::write(src.join("cut.npz"), &bytes[..end]).unwrap();
        let error = read("megadepth", &src).unwrap_err();
        assert!(error.file.ends_with("cut.npz"), "{error}");
    }
    fs::write(src.join("cut.npz"), &bytes).unwrap();
    fs::write(src.join("more.npz"), &bytes).unwrap();
    assert_eq!(read("megadepth", &src).unwrap().pairs.unwrap().len(), 4);
    // In the second file image 3.png stands at 2.5 instead of 2: the end of the first row of its pose and the next row.
    let end = |x: f64| [x, 0.0, 1.0, 0.0].map(f64::to_le_bytes).concat();
    let at = bytes.windows(32).position(|bytes| bytes == end(2.0));
    let mut moved = bytes.clone();
    moved[at.unwrap()..][..32].copy_from_slice(&end(2.5));
    fs::write(src.join("more.npz"), &moved).unwrap();
    let error = read("megadepth", &src).unwrap_err();
    assert!(error.what.contains("another pose of it"), "{error}");
    fs::write(src.join("more.npz"), &bytes).unwrap();
    fs::write(src.join("zipped.npz"), b"PK\x03\x04...").unwrap();
    let error = read("megadepth", &src.join("zipped.npz")).unwrap_err();
    assert!(error.what.contains("a zip archive"), "{error}");
    assert!(error.remedy.contains("pickle.dump"), "{error}");
    fs::remove_file(src.join("zipped.npz")).unwrap();
    let out = src.join("out");
    let error = import("megadepth", &src, &out, &ImportOptions::default()).unwrap_err();
    assert!(
        error.what.starts_with("its pairs 1 and 3 are the same"),
        "{error}"
    );
    assert!(!out.exists());
}

/// A pickle of a megabyte can refer to one pair a hundred thousand times, and each time to a long name.
#[test]
fn megadepth_refuses_pairs_that_are_repeated_and_paths_without_an_end() {
    let bytes = fs::read(fixture("megadepth.npz")).unwrap();
    let (_folder, src) = source("set", &[("forged.npz", "")]);
    let file = src.join("forged.npz");
    let refused = |forged: &[u8], expected: &str| {
        fs::write(&file, forged).unwrap();
        let error = read("megadepth", &file).unwrap_err();
        assert!(error.what.contains(expected), "{error}");
    };
    let pair = |i: u64, j: u64| [i, j].map(u64::to_le_bytes).concat();
    let at = bytes.windows(16).rposition(|bytes| bytes == pair(0, 2));
    let mut twice = bytes.clone();
    twice[at.unwrap()..][..16].copy_from_slice(&pair(3, 0));
    refused(
        &twice,
        "pair 1: images 3 and 0 are a pair of this file already",
    );
    // A short text has its length in one byte, a longer one in four; the length of all stands in front.
    for (name, image) in [("3.png", 3), ("0.h5", 0)] {
        let short = [&[0x8c, name.len() as u8], name.as_bytes()].concat();
        let at = bytes.windows(short.len()).position(|bytes| bytes == short);
        let long = [b"X", &5000_u32.to_le_bytes()[..], &[b'a'; 5000]].concat();
        let mut forged = bytes.clone();
        forged.splice(at.unwrap()..at.unwrap() + short.len(), long);
        let length = forged.len() as u64 - 11;
        forged[3..11].copy_from_slice(&length.to_le_bytes());
        let what = format!("the path of image {image} or of its depth has 5000 bytes");
        refused(&forged, &what);
    }
}

#[test]
fn megadepth_is_read_from_glue_factorys_texts() {
    let views = "p/a.png 1 0 0 0 1 0 0 0 1 0 0 0 PINHOLE 24 17 20 21 12 8.5\n\
                 p/b.png 1 0 0 0 1 0 0 0 1 2 0 0 SIMPLE_RADIAL 24 17 20 12 8.5 0.125\n";
    let files = [
        ("views.txt", views),
        ("pairs.txt", "p/a.png p/b.png 0.3\n"),
        ("p/b.png", ""),
    ];
    let (_folder, src) = source("gf", &files);
    let found = read("megadepth", &src).unwrap();
    assert_eq!(
        found.frames[0].camera,
        Camera::pinhole(20.0, 21.0, 11.5, 8.0)
    );
    assert_eq!(
        found.frames[1]
            .camera
            .distortion
            .unwrap()
            .brown()
            .unwrap()
            .k1,
        0.125
    );
    assert_eq!(x_of(&found.pairs.unwrap()[0]), 2.0);
    assert_eq!(found.frames[0].depth, None);
    // Depth comes from an HDF5 file.
    let mut out = crate::arrays::Hdf5Out::default();
    let values: Vec<f32> = (0..24 * 17).map(|i| i as f32 / 8.0).collect();
    out.floats("depth".into(), &[17, 24], &values);
    fs::create_dir_all(src.join("depths/p")).unwrap();
    out.write(&src.join("depths/p/b.h5")).unwrap();
    let found = read("megadepth", &src).unwrap();
    let depth = found.frames[1].read_depth().unwrap().unwrap();
    let at = |x, y| depth.at(nalgebra::Point2::new(x, y));
    assert_eq!((at(0.0, 0.0), at(23.0, 16.0)), (None, Some(407.0 / 8.0)));
    assert_eq!(at(10.4, 8.0), Some(202.0 / 8.0));
    let copied = ImportOptions {
        images: ImageStorage::Copy,
        ..ImportOptions::default()
    };
    let copy = src.parent().unwrap().join("copy");
    fs::copy(src.join("p/b.png"), src.join("p/a.png")).unwrap();
    import("megadepth", &src, &copy, &copied).unwrap();
    fs::remove_file(src.join("p/a.png")).unwrap();
    let depth = Sequence::open(&copy).unwrap().frames[1].read_depth();
    assert_eq!(
        depth
            .unwrap()
            .unwrap()
            .at(nalgebra::Point2::new(23.0, 16.0)),
        Some(407.0 / 8.0)
    );
    // Images in `images`, but only if none lies beside the list.
    fs::create_dir(src.join("images")).unwrap();
    assert_eq!(
        read("megadepth", &src).unwrap().frames[1].image,
        src.join("p/b.png")
    );
    fs::rename(src.join("p"), src.join("images/p")).unwrap();
    assert_eq!(
        read("megadepth", &src).unwrap().frames[1].image,
        src.join("images/p/b.png")
    );
    let lens = views.replace("SIMPLE_RADIAL", "FOV");
    fs::write(src.join("views.txt"), lens).unwrap();
    let error = read("megadepth", &src).unwrap_err();
    assert_eq!(error.line, Some(2));
    assert!(error.remedy.contains("image_undistorter"), "{error}");
    let smaller = views.replace("RADIAL 24 17", "RADIAL 48 34");
    fs::write(src.join("views.txt"), smaller).unwrap();
    let error = read("megadepth", &src).unwrap_err();
    assert_eq!(error.line, Some(2));
    let what = "the camera of p/b.png is for 48x34 pixels, its image has 24x17";
    assert_eq!(error.what, what);
    fs::write(src.join("views.txt"), views).unwrap();
    fs::write(src.join("pairs.txt"), "p/a.png p/c.png").unwrap();
    let error = read("megadepth", &src.join("views.txt")).unwrap_err();
    assert!(
        error
            .to_string()
            .contains("pairs.txt:1: p/c.png is not in views.txt"),
        "{error}"
    );
}

#[cfg(unix)] // holes of files take no room
#[test]
fn a_line_without_an_end_is_named_whatever_file_it_stands_in() {
    let pose = "1 0 0 0 0 1 0 0 0 0 1 0\n";
    for (kind, files, from) in [
        (
            "tum",
            &[("groundtruth.txt", ""), ("rgb.txt", "# images\n")][..],
            "",
        ),
        (
            "tum",
            &[("rgb.txt", ""), ("groundtruth.txt", "# poses\n")],
            "",
        ),
        (
            "kitti",
            &[
                ("sequences/00/image_0/000000.png", ""),
                ("poses/00.txt", pose),
                ("sequences/00/calib.txt", "P0: 1\n"),
            ],
            "",
        ),
        (
            "folder",
            &[
                ("a.png", ""),
                ("camera.txt", "20 0 12 0 20 8 0 0 1\n"),
                ("poses.txt", pose),
            ],
            "",
        ),
        ("superglue", &[("list.txt", "# pairs\n")], "list.txt"),
        ("megadepth", &[("views.txt", "# views\n")], "views.txt"),
        (
            "colmap",
            &[("images.txt", ""), ("cameras.txt", "# cameras\n")],
            "",
        ),
        (
            "colmap",
            &[("cameras.txt", ""), ("images.txt", "# images\n")],
            "",
        ),
        (
            "imc",
            &[("train_labels.csv", "dataset\n")],
            "train_labels.csv",
        ),
    ] {
        let (_folder, src) = source("set", files);
        let (long, _) = files[files.len() - 1];
        // A hole of 3 GiB takes no room, and to read all of it takes seconds.
        let file = fs::OpenOptions::new()
            .write(true)
            .open(src.join(long))
            .unwrap();
        file.set_len(3 << 30).unwrap();
        let error = read(kind, &src.join(from)).unwrap_err();
        assert!(
            error.file.ends_with(long) && error.line == Some(2),
            "{kind}: {error}"
        );
        assert!(
            error.to_string().contains("the line has more than"),
            "{kind}: {error}"
        );
    }
}
