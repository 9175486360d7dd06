//! Tests of folders that importers read: lists of pairs, what is expected of a folder, and formats of numbers.

use std::fs;

use super::tests::source;
use super::*;
use crate::datasets::{testing, validate};

#[test]
fn a_list_names_images_or_numbers_the_frames_that_are_left() {
    let pose = "1 0 0 0\n0 1 0 0\n0 0 1 0\n0 0 0 1\n";
    let names: Vec<_> = (0..4).map(|i| format!("frame-00000{i}")).collect();
    let files: Vec<_> = (names.iter())
        .flat_map(|name| {
            [
                (format!("{name}.color.png"), ""),
                (format!("{name}.pose.txt"), pose),
            ]
        })
        .collect();
    let files: Vec<_> = files.iter().map(|(name, text)| (&**name, *text)).collect();
    let (folder, src) = source("mine", &files);
    fs::write(
        src.join("frame-000001.pose.txt"),
        pose.replace('1', "-1.#IND"),
    )
    .unwrap();
    let list = folder.path().join("list.txt");
    let import_as = |name: &str, text: &str| {
        fs::write(&list, text).unwrap();
        let options = ImportOptions {
            pairs: Some(format!("list:{}", list.display()).parse().unwrap()),
            ..ImportOptions::default()
        };
        import("7scenes", &src, &folder.path().join(name), &options)
    };
    let numbered = import_as("numbered", "0 2\n").unwrap();
    let note = numbered.notes.last().unwrap();
    assert!(
        note.contains("from 0: 2 is frame-000003.color.png"),
        "{note}"
    );
    let named = import_as("named", "frame-000000.color.png frame-000002.color.png\n").unwrap();
    assert_eq!(named.notes, numbered.notes[..numbered.notes.len() - 1]);
    let pairs = Sequence::open(&folder.path().join("named")).unwrap().pairs;
    assert_eq!((pairs[0].a, pairs[0].b), (0, 1));
    let gone = import_as("gone", "frame-000000.color.png frame-000001.color.png\n").unwrap_err();
    assert_eq!(gone.line, Some(1), "{gone}");
}

#[test]
fn the_numbers_of_a_part_of_a_sequence_are_those_of_its_frames() {
    let frames = |first: usize| {
        let mut frames = testing::frames(3);
        for (frame, number) in frames.iter_mut().zip(first..) {
            frame.image = format!("image_0/{number:06}.png").into();
        }
        frames
    };
    let note = |first| {
        let (frames, pairs) = PairRule::All.apply(frames(first)).unwrap();
        numbers_of_frames(&frames, &pairs, &[])
    };
    assert_eq!(note(0), None);
    let note = note(100).unwrap();
    assert!(note.contains("0 is 000100.png"), "{note}");
}

#[test]
fn a_folder_above_is_told_what_is_expected() {
    let (_folder, src) = source("above", &[("inner/rgb.txt", "")]);
    for (kind, expected) in [
        ("tum", "rgb.txt: "),
        ("kitti", "sequences: "),
        ("euroc", "sensor.yaml: "),
        ("colmap", "cameras.txt: "),
        ("scannet-raw", "intrinsic_color.txt: "),
    ] {
        let error = read_source(kind, &src, &ImportOptions::default()).unwrap_err();
        let help = find(kind).unwrap().help;
        let message = error.to_string();
        assert!(
            message.contains(expected) && message.ends_with(help),
            "{message}"
        );
    }
}

#[test]
fn commas_and_4x4_matrices_are_read() {
    let files = [
        ("0.png", ""),
        ("1.png", ""),
        ("K.txt", "20,0,12\n0,20,8\n0,0,1\n"),
        (
            "poses.txt",
            "1 0 0 5 0 1 0 6 0 0 1 7 0 0 0 1\n1,0,0,8,0,1,0,6,0,0,1,7,0,0,0,1\n",
        ),
        (
            "tum.txt",
            "1, 5, 6, 7, 0, 0, 0, 1\n2, 8, 6, 7, 0, 0, 0, 1\n",
        ),
    ];
    let (_folder, src) = source("mine", &files);
    let read = |poses: &str| {
        let options = ImportOptions {
            poses: Some(src.join(poses)),
            ..ImportOptions::default()
        };
        read_source("folder", &src, &options)
    };
    let found = read("poses.txt").unwrap().frames;
    assert_eq!(found[0].camera, Camera::pinhole(20.0, 20.0, 12.0, 8.0));
    let x = |frame: &Frame| frame.world_from_camera.unwrap().translation.x;
    assert_eq!((x(&found[0]), x(&found[1])), (5.0, 8.0));
    assert_eq!(read("tum.txt").unwrap().frames, found);
    fs::write(src.join("poses.txt"), "1 0 0 5 0 1 0 6 0 0 1 7 0 0 0 2\n").unwrap();
    let error = read("poses.txt").unwrap_err();
    assert!(
        error.line == Some(1) && error.what.contains("last row"),
        "{error}"
    );
}

#[test]
fn a_scan_of_scannet_has_a_pose_in_a_file_for_each_image() {
    let pose = |x: &str| format!("1 0 0 {x}\n0 1 0 0\n0 0 1 0\n0 0 0 1\n");
    let lost = "-inf -inf -inf -inf\n".repeat(4);
    let (first, second) = (pose("0"), pose("3"));
    let files = [
        ("color/0.png", ""),
        ("color/2.png", ""),
        ("color/10.png", ""),
        ("color/11.png", ""),
        ("pose/0.txt", &*first),
        ("pose/2.txt", &lost),
        ("pose/10.txt", &second),
        ("depth/10.png", ""),
        (
            "intrinsic/intrinsic_color.txt",
            "1296 0 647.5 0\n0 968 483.5 0\n0 0 1 0\n0 0 0 1\n",
        ),
    ];
    let (_folder, src) = source("scene0000_00", &files);
    let found = read_source("scannet-raw", &src, &ImportOptions::default()).unwrap();
    let images: Vec<_> = found
        .frames
        .iter()
        .map(|frame| base_name(&frame.image))
        .collect();
    assert_eq!(images, ["0.png", "10.png"]);
    assert_eq!(
        found.frames[1].world_from_camera.unwrap().translation.x,
        3.0
    );
    let depth = found.frames[1].depth.as_ref().unwrap();
    assert!(found.frames[0].depth.is_none() && depth.path.ends_with("depth/10.png"));
    let notes = &found.about.notes;
    assert!(
        notes[0].contains("1 image whose pose is not finite (2.png)"),
        "{notes:?}"
    );
    assert!(
        notes[1].contains("1 image without a pose (11.png)"),
        "{notes:?}"
    );
    // K is scaled to the size of the images.
    let size = found.frames[0].size().unwrap();
    let (camera, width) = (found.frames[0].camera, size.width as f64);
    assert!((camera.fx - width).abs() < 1e-9 && (camera.cx - (width - 1.0) / 2.0).abs() < 1e-9);
    assert!(notes[2].contains("scaled"), "{notes:?}");
}

/// As in a folder of links to files that are named after their content, or numbered otherwise.
#[cfg(unix)]
#[test]
fn frames_of_7_scenes_have_the_numbers_of_their_own_names_where_they_are_links() {
    let pose = |x: u32| format!("1 0 0 {x}\n0 1 0 0\n0 0 1 0\n0 0 0 1\n");
    let (first, second) = (pose(3), pose(5));
    let files = [
        ("blobs/3f2a.png", ""),
        ("blobs/frame-000001.color.png", ""),
        ("scene/frame-000001.pose.txt", &*first),
        ("scene/frame-000002.pose.txt", &*second),
        ("scene/frame-000002.depth.png", ""),
    ];
    let (_folder, src) = source("mine", &files);
    for (name, blob) in [
        ("frame-000001.color.png", "3f2a.png"),
        ("frame-000002.color.png", "frame-000001.color.png"),
    ] {
        let link = src.join("scene").join(name);
        std::os::unix::fs::symlink(format!("../blobs/{blob}"), link).unwrap();
    }
    let found = read_source("7scenes", &src.join("scene"), &ImportOptions::default()).unwrap();
    let x = |frame: &Frame| frame.world_from_camera.unwrap().translation.x;
    let frames: Vec<_> = (found.frames.iter())
        .map(|frame| (own_name(&frame.image), x(frame), frame.depth.is_some()))
        .collect();
    assert_eq!(
        frames,
        [
            ("frame-000001.color.png".to_owned(), 3.0, false),
            ("frame-000002.color.png".to_owned(), 5.0, true),
        ]
    );
}

#[cfg(unix)]
#[test]
fn the_camera_of_tum_is_told_by_the_name_of_a_link_or_of_its_folder() {
    let files = [
        ("rgb.txt", "1 a.png"),
        ("groundtruth.txt", "1 0 0 0 0 0 0 1\n"),
        ("a.png", ""),
    ];
    for (folder_name, link, fx) in [
        ("3f2a", "rgbd_dataset_freiburg1_desk", Some(517.3)),
        ("rgbd_dataset_freiburg2_desk", "desk", Some(520.9)),
        ("rgbd_dataset_freiburg2_desk", "freiburg1", Some(517.3)),
        ("3f2a", "desk", None),
    ] {
        let (folder, src) = source(folder_name, &files);
        let link = folder.path().join(link);
        std::os::unix::fs::symlink(src, &link).unwrap();
        let found = read_source("tum", &link, &ImportOptions::default());
        let found = found.map(|found| found.frames[0].camera.fx);
        assert_eq!(found.ok(), fx, "{}", link.display());
    }
}

#[test]
fn frames_are_in_the_order_of_time() {
    let x = |frame: &Frame| frame.world_from_camera.unwrap().translation.x;
    let poses = "1.8 2 0 0 0 0 0 1\n1.7 0 0 0 0 0 0 1\n1.722 1 0 0 0 0 0 1\n10.1 3 0 0 0 0 0 1\n";
    // Fractions of seconds that have unlike many digits are in another order by their names.
    let folder = [
        ("1.7.png", ""),
        ("1.722.png", ""),
        ("1.8.png", ""),
        ("10.1.png", ""),
        ("K.txt", "20 0 12\n0 20 8\n0 0 1\n"),
        ("poses.txt", poses),
    ];
    let tum = [
        ("rgb.txt", "1.8 c.png\n10.1 d.png\n1.7 a.png\n1.722 b.png\n"),
        ("groundtruth.txt", poses),
        ("a.png", ""),
        ("b.png", ""),
        ("c.png", ""),
        ("d.png", ""),
    ];
    let sensor = "T_BS: [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1]\nintrinsics: [20, 20, 12, 8]\n\
                  distortion_model: radial-tangential\ndistortion_coefficients: [0, 0, 0, 0]\n";
    let euroc = [
        ("cam0/sensor.yaml", sensor),
        ("cam0/data.csv", "30,c.png\n40,d.png\n10,a.png\n20,b.png\n"),
        (
            "state_groundtruth_estimate0/data.csv",
            "40,3,0,0,1,0,0,0\n30,2,0,0,1,0,0,0\n20,1,0,0,1,0,0,0\n10,0,0,0,1,0,0,0\n",
        ),
    ];
    for (kind, files) in [("folder", &folder[..]), ("tum", &tum), ("euroc", &euroc)] {
        let (_folder, src) = source("freiburg1", files);
        let found = read_source(kind, &src, &ImportOptions::default()).unwrap();
        let xs: Vec<f64> = found.frames.iter().map(x).collect();
        assert_eq!(xs, [0.0, 1.0, 2.0, 3.0], "{kind}");
    }
}

/// The pairs are those of all images, and what is missing can be put there.
#[test]
fn images_of_a_recording_that_are_not_there_are_named_and_keep_their_frames() {
    let sensor = "T_BS: [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1]\nintrinsics: [20, 20, 12, 8]\n\
                  resolution: [24, 17]\ndistortion_model: radial-tangential\ndistortion_coefficients: [0, 0, 0, 0]\n";
    let tum = [
        ("rgb.txt", "1.0 a.png\n1.01 b.png\n2.0 c.png\n"),
        (
            "groundtruth.txt",
            "1 0 0 0 0 0 0 1\n1.01 1 0 0 0 0 0 1\n2 2 0 0 0 0 0 1\n",
        ),
        ("camera.txt", "20 0 12\n0 20 8\n0 0 1\n"),
        ("a.png", ""),
        ("b.png", ""),
        ("c.png", ""),
    ];
    let euroc = [
        ("cam0/sensor.yaml", sensor),
        ("cam0/data.csv", "10,a.png\n20,b.png\n30,c.png\n"),
        ("cam0/data/a.png", ""),
        ("cam0/data/b.png", ""),
        ("cam0/data/c.png", ""),
        (
            "state_groundtruth_estimate0/data.csv",
            "10,0,0,0,1,0,0,0\n20,1,0,0,1,0,0,0\n30,2,0,0,1,0,0,0\n",
        ),
    ];
    for (kind, files, missing) in [
        ("tum", &tum[..], "b.png"),
        ("euroc", &euroc, "cam0/data/a.png"),
    ] {
        let (folder, src) = source("freiburg1", files);
        let (out, aside) = (folder.path().join("out"), folder.path().join("aside"));
        let missing = src.join(missing);
        fs::rename(&missing, &aside).unwrap();
        let report = import(kind, &src, &out, &ImportOptions::default()).unwrap();
        assert_eq!((report.frames, report.pairs), (3, 2), "{kind}");
        let note = format!("not there (yet): 1 of 3 images ({})", missing.display());
        assert_eq!(report.notes, [note]);
        let problems = validate(&out);
        assert!(
            matches!(&problems[..], [only] if only.error.file == missing),
            "{problems:?}"
        );
        fs::rename(&aside, &missing).unwrap();
        assert_eq!(validate(&out), [], "{kind}");
    }
}

#[test]
fn files_that_are_hidden_are_none_of_a_list() {
    // As archives of macOS have them beside each file.
    let numbers = "0.9 0.8 20 0 12 0 20 8 0 0 1 21 0 12 0 21 8 0 0 1 1 0 0 2 0 1 0 0 0 0 1 0";
    let pair = format!("0.png 1.png {numbers}");
    let zeb = [("s_0_1.txt", &*pair), ("._s_0_1.txt", "\0\u{5}\u{16}\u{7}")];
    let shift = "1 0 3.5\n0 1 0\n0 0 1\n";
    let evd = [
        ("1/fox.png", ""),
        ("2/fox.png", ""),
        ("h/fox.txt", shift),
        ("h/._fox.txt", "\0\u{5}\u{16}\u{7}"),
    ];
    for (kind, files) in [("zeb", &zeb[..]), ("evd", &evd)] {
        let (_folder, src) = source(kind, files);
        let found = read_source(kind, &src, &ImportOptions::default()).unwrap();
        assert_eq!(found.pairs.unwrap().len(), 1, "{kind}");
    }
    let (_folder, src) = source("megadepth", &[("._a.npz", "\0\u{5}\u{16}\u{7}")]);
    let error = read_source("megadepth", &src, &ImportOptions::default()).unwrap_err();
    assert!(error.what.starts_with("there is neither"), "{error}");
}
