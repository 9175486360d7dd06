//! Each importer on a small source made by hand.

use std::fs;
use std::path::{Path, PathBuf};

use matchbench_vision::image::FloatImage;

use super::super::{Severity, testing, validate};
use super::*;

/// Writes files (images where the name ends in `.png`) into a new folder.
pub(super) fn source(name: &str, files: &[(&str, &str)]) -> (tempfile::TempDir, PathBuf) {
    let folder = tempfile::tempdir().unwrap();
    let src = folder.path().join(name);
    for (index, (file, text)) in files.iter().enumerate() {
        let path = src.join(file);
        fs::create_dir_all(path.parent().unwrap()).unwrap();
        if path.extension().is_some_and(|extension| extension == "png") {
            let image = testing::pixels(index);
            let (width, height) = (image.width() as u32, image.height() as u32);
            let color = image::ExtendedColorType::L8;
            image::save_buffer(&path, image.data(), width, height, color).unwrap();
        } else {
            fs::write(path, text).unwrap();
        }
    }
    (folder, src)
}

fn xs(imported: &Imported) -> Vec<f64> {
    let x = |frame: &Frame| frame.world_from_camera.unwrap().translation.x;
    imported.frames.iter().map(x).collect()
}

fn read(kind: &str, src: &Path) -> Result<Imported, DatasetError> {
    read_source(kind, src, &ImportOptions::default())
}

const K: &str = "20 0 12\n0 20 8\n0 0 1\n";
const KITTI_POSES: &str =
    "1 0 0 0 0 1 0 0 0 0 1 0\n1 0 0 1 0 1 0 0 0 0 1 0\n1 0 0 2 0 1 0 0 0 0 1 0";
const TUM_POSES: &str = "# t x y z q\n1.00 0 0 0 0 0 0 1\n1.01 1 0 0 0 0 0 1\n2.00 2 0 0 0 0 0 1\n";

#[test]
fn tum_associates_by_time_and_reports_what_it_leaves_out() {
    let rgb = "# color images\n1.004 rgb/a.png\n1.009 rgb/b.png\n1.5 rgb/gone.png\n2.0 rgb/c.png\n";
    let files = [
        ("rgb.txt", rgb),
        ("groundtruth.txt", TUM_POSES),
        ("rgb/a.png", ""),
        ("rgb/b.png", ""),
        ("rgb/c.png", ""),
    ];
    let (_folder, src) = source("rgbd_dataset_freiburg1_x", &files);
    let found = read("tum", &src).unwrap();
    assert_eq!(xs(&found), [0.0, 1.0, 2.0]);
    assert_eq!(found.frames[0].camera.fx, 517.3);
    assert_eq!(
        found.about.notes,
        ["left out: 1 image without a pose within 0.02 s (rgb/gone.png)"]
    );
    let strict = ImportOptions {
        tolerance: Some(1e-5),
        ..ImportOptions::default()
    };
    fs::write(src.join("rgb.txt"), "1.004 rgb/a.png\n1.5 rgb/gone.png\n").unwrap();
    let error = read_source("tum", &src, &strict).unwrap_err();
    assert_eq!(
        error.what,
        "no image has a pose; left out: 2 images without a pose within 0.00001 s (rgb/a.png, rgb/gone.png)"
    );
    fs::write(src.join("rgb.txt"), rgb).unwrap();
    let options = ImportOptions {
        interpolate: true,
        ..ImportOptions::default()
    };
    let between = xs(&read_source("tum", &src, &options).unwrap());
    assert!((between[0] - 0.4).abs() < 1e-9 && (between[1] - 0.9).abs() < 1e-9);
}

/// A rendered place in the layouts of TUM RGB-D and 7-Scenes, with depth as these store it.
#[test]
fn depth_that_was_rendered_comes_back_from_the_layouts_that_have_it() {
    let mut scene = crate::datasets::rendered::scenes()[8].clone();
    assert_eq!(scene.name, "mural", "which is built soonest");
    scene.size = matchbench_vision::image::Size::new(60, 45);
    let world = crate::datasets::rendered::World::build(scene.place);
    let depths = [0, 1].map(|frame| world.depth(&scene, frame));
    let (folder, src) = source(
        "freiburg3",
        &[("groundtruth.txt", TUM_POSES), ("camera.txt", K)],
    );
    let save = |name: &str, per_unit: f32, depth: &FloatImage| {
        let stored = depth.data().iter().map(|z| (z * per_unit).round() as u16);
        let stored: Vec<u8> = stored.flat_map(u16::to_ne_bytes).collect();
        let path = src.join(name);
        fs::create_dir_all(path.parent().unwrap()).unwrap();
        let (width, height) = (depth.width() as u32, depth.height() as u32);
        let colour = image::ExtendedColorType::L16;
        image::save_buffer(path, &stored, width, height, colour).unwrap();
    };
    let pose = "1 0 0 3\n0 1 0 0\n0 0 1 0\n0 0 0 1\n";
    for (frame, depth) in depths.iter().enumerate() {
        save(&format!("depth/{frame}.png"), 5000.0, depth);
        save(&format!("seq-01/frame-{frame}.depth.png"), 1000.0, depth);
        // Nobody looks at the pixels.
        save(&format!("rgb/{frame}.png"), 1.0, depth);
        save(&format!("seq-01/frame-{frame}.color.png"), 1.0, depth);
        fs::write(src.join("seq-01/camera.txt"), K).unwrap();
        fs::write(src.join(format!("seq-01/frame-{frame}.pose.txt")), pose).unwrap();
    }
    fs::write(src.join("rgb.txt"), "1.0 rgb/0.png\n2.0 rgb/1.png\n").unwrap();
    // The second is the nearest to 2.0; a third is too far from any, a fourth is not there.
    let list = "0.99 depth/0.png\n1.5 depth/0.png\n1.99 depth/1.png\n2.0 depth/gone.png\n";
    fs::write(src.join("depth.txt"), list).unwrap();
    for (kind, step) in [("tum", 2e-4), ("7scenes", 1e-3)] {
        for (name, images) in [
            ("there", ImageStorage::Reference),
            ("copied", ImageStorage::Copy),
        ] {
            let out = folder.path().join(format!("{kind}-{name}"));
            let options = ImportOptions {
                images,
                pairs: Some(PairRule::All),
                ..ImportOptions::default()
            };
            import(kind, &src, &out, &options).unwrap();
            let problems = validate(&out);
            let errors = problems.iter().filter(|it| it.severity == Severity::Error);
            assert_eq!(
                errors.collect::<Vec<_>>(),
                Vec::<&crate::datasets::Problem>::new()
            );
            let sequence = Sequence::open(&out).unwrap();
            for (frame, truth) in sequence.frames.iter().zip(&depths) {
                let read = frame.read_depth().unwrap().expect("it has depth");
                for (x, y) in [(0, 0), (30, 20), (59, 44)] {
                    let at = nalgebra::Point2::new(x as f64, y as f64);
                    let off = read.at(at).expect("measured") - f64::from(truth.at(x, y));
                    assert!(off.abs() < step, "{kind} {x} {y}: {off}");
                }
            }
        }
    }
    let far = ImportOptions {
        tolerance: Some(0.005),
        ..ImportOptions::default()
    };
    let frames = read_source("tum", &src, &far).unwrap().frames;
    assert!(frames.iter().all(|frame| frame.depth.is_none()));
}

#[test]
fn tum_needs_a_known_camera() {
    let files = [
        ("rgb.txt", "1 a.png"),
        ("groundtruth.txt", TUM_POSES),
        ("a.png", ""),
    ];
    let (_folder, src) = source("my_room", &files);
    assert!(
        read("tum", &src)
            .unwrap_err()
            .what
            .contains("freiburg1, 2 or 3")
    );
    fs::write(src.join("camera.txt"), K).unwrap();
    assert_eq!(
        read("tum", &src).unwrap().frames[0].camera,
        Camera::pinhole(20.0, 20.0, 12.0, 8.0)
    );
}

#[test]
fn kitti_takes_the_pose_with_the_number_of_the_image() {
    let calib = "P0: 20 0 12 0 0 20 8 0 0 0 1 0\nP1: 1\n";
    let files = [
        ("sequences/06/image_0/000000.png", ""),
        ("sequences/06/image_0/000001.gif", ""),
        ("sequences/06/image_0/000002.png", ""),
        ("sequences/06/image_0/000003.png", ""),
        ("sequences/06/calib.txt", calib),
        (
            "sequences/06/times.txt",
            "0\n0.1\n0.2\n0.3\n0.4\n0.5\n0.6\n",
        ),
        ("poses/06.txt", KITTI_POSES),
        ("poses/07.txt", KITTI_POSES),
        ("sequences/08/image_0/000000.png", ""),
    ];
    let (_folder, src) = source("kitti", &files);
    let found = read("kitti", &src).unwrap();
    assert_eq!(xs(&found), [0.0, 2.0]);
    assert_eq!(
        found.about.notes[0],
        "left out: 1 image without a pose (000003.png)"
    );
    let unread = "left out: 1 image in formats that are not read (000001.gif)";
    assert_eq!(found.about.notes[1], unread);
    assert!(
        found.about.notes[3].starts_with("times.txt has 7 lines"),
        "{:?}",
        found.about.notes
    );
    assert_eq!(found.about.origin, "KITTI odometry, sequence 06");

    let with = |number: &str| ImportOptions {
        sequence: Some(number.into()),
        ..ImportOptions::default()
    };
    assert_eq!(read_source("kitti", &src, &with("6")).unwrap(), found);
    assert_eq!(found.sequence.as_deref(), Some("06"));
    let error = read_source("kitti", &src, &with("08")).unwrap_err();
    assert!(error.to_string().contains("those here: 06"), "{error}");
    fs::create_dir(src.join("sequences/07")).unwrap();
    fs::create_dir(src.join("sequences/07/image_0")).unwrap();
    let error = read("kitti", &src).unwrap_err();
    assert!(
        error.to_string().contains("choose one of 06, 07"),
        "{error}"
    );
}

#[test]
fn strecha_gives_each_image_its_camera() {
    let camera = |f: u32, x: u32| {
        format!("{f} 0 12\n0 {f} 8\n0 0 1\n0 0 0\n1 0 0\n0 1 0\n0 0 1\n{x} 0 0\n24 17\n")
    };
    let (first, second) = (camera(20, 0), camera(21, 1));
    let files = [
        ("images/0000.png", ""),
        ("images/0001.png", ""),
        ("images/0002.png", ""),
        ("images/0003.jp2", ""),
        ("images/0000.png.camera", first.as_str()),
        ("gt_dense_cameras/0001.png.camera", second.as_str()),
    ];
    let (folder, src) = source("castle", &files);
    let found = read("strecha", &src).unwrap();
    assert_eq!(xs(&found), [0.0, 1.0]);
    assert_eq!(found.frames[1].camera.fx, 21.0);
    assert!(
        found.about.notes[0].starts_with("left out: ")
            && found.about.notes[0].ends_with(" (0002.png)")
    );
    assert!(found.about.notes[1].ends_with("are not read (0003.jp2)"));
    // Cameras that differ stand in dataset.toml.
    let out = folder.path().join("05");
    import("strecha", &src, &out, &ImportOptions::default()).unwrap();
    assert_eq!(Sequence::open(&out).unwrap().frames[1].camera.fx, 21.0);
    assert_eq!(validate(&out), []);

    fs::write(
        src.join("images/0000.png.camera"),
        first.replace("24 17", "48 34"),
    )
    .unwrap();
    let error = read("strecha", &src).unwrap_err();
    assert!(
        error.what.contains("48x34 pixels, its image has 24x17"),
        "{error}"
    );
}

#[test]
fn seven_scenes_skips_lost_and_missing_poses() {
    let pose = "1 0 0 3\n0 1 0 0\n0 0 1 0\n0 0 0 1\n";
    let lost = pose.replace('3', "nan");
    let files = [
        ("seq-01/frame-000000.color.png", ""),
        ("seq-01/frame-000000.depth.png", ""),
        ("seq-01/frame-000000.pose.txt", pose),
        ("seq-01/frame-000002.color.jxl", ""),
        ("seq-01/frame-000002.depth.pfm", ""),
        ("seq-01/frame-000001.color.png", ""),
        ("seq-01/frame-000001.pose.txt", lost.as_str()),
        ("seq-01/frame-000003.color.png", ""),
    ];
    let (_folder, src) = source("chess", &files);
    let found = read("7scenes", &src).unwrap();
    assert_eq!(xs(&found), [3.0]);
    assert_eq!(
        found.frames[0].camera,
        Camera::pinhole(525.0, 525.0, 320.0, 240.0)
    );
    assert!(found.about.notes[0].contains("was assumed"));
    assert!(
        found.about.notes[1].starts_with("left out: ")
            && found.about.notes[1].ends_with(" (frame-000001.color.png)")
    );
    let without = "left out: 1 image without a pose (frame-000003.color.png)";
    assert_eq!(found.about.notes[2], without);
    assert!(found.about.notes[3].ends_with("are not read (frame-000002.color.jxl)"));
    assert!(found.about.notes[4].starts_with("the poses are those of the depth camera; "));
    fs::create_dir(src.join("seq-02")).unwrap();
    assert!(
        read("7scenes", &src)
            .unwrap_err()
            .remedy
            .contains("seq-01, seq-02")
    );
    fs::write(src.join("K.txt"), K).unwrap();
    let options = ImportOptions {
        sequence: Some("1".into()),
        camera: Some(src.join("K.txt")),
        ..ImportOptions::default()
    };
    assert_eq!(
        read_source("7scenes", &src, &options).unwrap().frames[0]
            .camera
            .fx,
        20.0
    );
    let first = ImportOptions {
        camera: None,
        sequence: Some("seq-01".into()),
        ..options.clone()
    };
    let focal = || Ok::<_, DatasetError>(read_source("7scenes", &src, &first)?.frames[0].camera.fx);
    assert_eq!(focal().unwrap(), 20.0, "K.txt beside the sequences");
    fs::write(src.join("seq-01/camera.txt"), K.replace("20 0", "30 0")).unwrap();
    assert_eq!(focal().unwrap(), 30.0, "the nearer one");
    #[cfg(unix)]
    {
        fs::remove_file(src.join("seq-01/camera.txt")).unwrap();
        std::os::unix::fs::symlink("nowhere", src.join("seq-01/camera.txt")).unwrap();
        assert!(focal().unwrap_err().file.ends_with("seq-01/camera.txt"));
    }
    fs::remove_file(src.join("seq-01/frame-000000.pose.txt")).unwrap();
    let error = read_source("7scenes", &src, &options).unwrap_err();
    let without =
        "left out: 2 images without a pose (frame-000000.color.png, frame-000003.color.png)";
    assert!(error.what.starts_with("no image has a pose; ") && error.what.contains(without));
}

#[test]
fn a_plain_folder_takes_poses_in_either_format() {
    let files = [
        ("img1.png", ""),
        ("img2.png", ""),
        ("img10.png", ""),
        ("poses.txt", KITTI_POSES),
        ("tum.txt", TUM_POSES),
        (
            "falling.txt",
            "3 0 0 0 0 0 0 1\n2 1 0 0 0 0 0 1\n1 2 0 0 0 0 0 1\n",
        ),
        ("K.txt", K),
    ];
    let (_folder, src) = source("mine", &files);
    let found = read("folder", &src).unwrap();
    assert_eq!(xs(&found), [0.0, 1.0, 2.0]);
    assert!(
        found.frames[2].image.ends_with("img10.png"),
        "natural order"
    );
    let with = |poses: &str| ImportOptions {
        poses: Some(src.join(poses)),
        ..ImportOptions::default()
    };
    assert_eq!(
        read_source("folder", &src, &with("tum.txt")).unwrap(),
        found
    );
    // Without times in the names of the images, a line belongs to the image of its place, whatever its time.
    let falling = read_source("folder", &src, &with("falling.txt")).unwrap();
    assert_eq!(xs(&falling), [0.0, 1.0, 2.0]);
    let error = read_source("folder", &src, &with("K.txt")).unwrap_err();
    assert_eq!(error.what, "these are no poses");
    // Where nothing has a time there is nothing to be interpolated.
    for poses in ["poses.txt", "tum.txt"] {
        let timed = ImportOptions {
            interpolate: true,
            ..with(poses)
        };
        let error = read_source("folder", &src, &timed).unwrap_err();
        assert!(error.what.starts_with("--interpolate"), "{error}");
    }

    fs::remove_file(src.join("img2.png")).unwrap();
    assert_eq!(
        read("folder", &src).unwrap_err().what,
        "3 poses for 2 images"
    );
    // Named by their times, images need not be as many as the poses.
    fs::rename(src.join("img1.png"), src.join("1.005.png")).unwrap();
    fs::rename(src.join("img10.png"), src.join("2.5.png")).unwrap();
    let found = read_source("folder", &src, &with("tum.txt")).unwrap();
    assert_eq!(xs(&found), [0.0]);
    fs::remove_file(src.join("K.txt")).unwrap();
    assert!(
        read("folder", &src)
            .unwrap_err()
            .file
            .ends_with("camera.txt")
    );
}

#[test]
fn images_that_are_not_read_leave_no_doubt_about_poses() {
    let files = [
        ("1.gif", "GIF89a"),
        ("2.JP2", ""),
        ("a.png", ""),
        ("a.nef", ""),
        ("b.png", ""),
        (
            "poses.txt",
            "1 0 0 0 0 1 0 0 0 0 1 0\n1 0 0 1 0 1 0 0 0 0 1 0\n",
        ),
        ("tum.txt", TUM_POSES),
        ("K.txt", K),
    ];
    let (_folder, src) = source("mine", &files);
    let refused = |named: &str| {
        let error = read("folder", &src).unwrap_err();
        assert!(error.what.contains(named), "{error}");
        assert!(error.remedy.contains("convert"), "{error}");
    };
    refused(
        "2 poses for 2 images, and 2 images in formats that are not read beside them (1.gif, 2.JP2)",
    );
    // Named by their times, images have the poses of their times, and the others are noted.
    fs::rename(src.join("a.png"), src.join("1.005.png")).unwrap();
    fs::rename(src.join("b.png"), src.join("2.5.png")).unwrap();
    let options = ImportOptions {
        poses: Some(src.join("tum.txt")),
        ..ImportOptions::default()
    };
    let found = read_source("folder", &src, &options).unwrap();
    let notes = found.about.notes.join("\n");
    assert!(
        notes.contains("left out: 3 images in formats that are not read (1.gif, 2.JP2, a.nef)"),
        "{notes}"
    );
    for name in ["1.005.png", "2.5.png", "a.nef"] {
        fs::remove_file(src.join(name)).unwrap();
    }
    refused("2 poses for 0 images, and 2 images");
    fs::rename(src.join("1.gif"), src.join("1.png")).unwrap();
    fs::rename(src.join("2.JP2"), src.join("2.png")).unwrap();
    fs::write(src.join("2.nef"), "").unwrap();
    assert_eq!(xs(&read("folder", &src).unwrap()), [0.0, 1.0]);
}

#[test]
fn an_import_is_a_sound_dataset_with_the_frames_of_its_rule() {
    let images: Vec<_> = (0..7).map(|i| format!("{i}.png")).collect();
    let rows: Vec<_> = (0..7)
        .map(|i| format!("1 0 0 {i} 0 1 0 0 0 0 1 0"))
        .collect();
    let poses = rows.join("\n");
    let mut files: Vec<_> = images.iter().map(|name| (name.as_str(), "")).collect();
    files.extend([("poses.txt", poses.as_str()), ("camera.txt", K)]);
    let (folder, src) = source("mine", &files);
    let import_as = |name: &str, rule: &str| {
        let options = ImportOptions {
            pairs: Some(rule.parse().unwrap()),
            ..ImportOptions::default()
        };
        import("folder", &src, &folder.path().join(name), &options)
    };
    let report = import_as("wide", "window:2,stride:3").unwrap();
    assert_eq!((report.frames, report.pairs), (3, 3));
    let out = folder.path().join("wide");
    assert_eq!(validate(&out), []);
    let sequence = Sequence::open(&out).unwrap();
    assert!(sequence.frames[1].image.ends_with("3.png"));
    assert_eq!(sequence.pairs[0].pose().unwrap().translation.x, -3.0);

    fs::write(src.join("list.txt"), "0 6\n5 1\n").unwrap();
    let list = format!("list:{}", src.join("list.txt").display());
    assert_eq!(import_as("listed", &list).unwrap().pairs, 2);
    let pairs = Sequence::open(&folder.path().join("listed")).unwrap().pairs;
    assert_eq!((pairs[1].a, pairs[1].b), (5, 1));
    let error = import_as("none", "window:2,stride:9").unwrap_err();
    assert!(error.what.contains("no pair of"), "{error}");
    assert!(import_as("wide", "all").is_err(), "nothing is overwritten");
}

#[test]
fn wrong_kinds_and_options_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    let src = folder.path();
    assert!(
        read("nuscenes", src)
            .unwrap_err()
            .remedy
            .contains("tum, kitti, strecha, 7scenes, folder")
    );
    assert!(
        read("tum", &src.join("none"))
            .unwrap_err()
            .what
            .contains("no such file or folder")
    );
    let sequence = ImportOptions {
        sequence: Some("1".into()),
        ..ImportOptions::default()
    };
    assert!(
        read_source("tum", src, &sequence)
            .unwrap_err()
            .what
            .contains("no such option")
    );
    let poses = ImportOptions {
        poses: Some("p.txt".into()),
        ..ImportOptions::default()
    };
    assert!(read_source("kitti", src, &poses).is_err());
    for kind in KINDS {
        let error = read(kind.id, src).unwrap_err();
        assert!(!error.remedy.is_empty(), "{error}");
    }
}

#[test]
fn damage_found_after_the_import_is_explained() {
    let files = [
        ("0.png", ""),
        ("1.png", ""),
        ("2.png", ""),
        ("poses.txt", KITTI_POSES),
        ("K.txt", K),
    ];
    let (folder, src) = source("mine", &files);
    let out = folder.path().join("out");
    import("folder", &src, &out, &ImportOptions::default()).unwrap();
    fs::remove_file(src.join("1.png")).unwrap();
    let problems = validate(&out);
    assert_eq!(problems.len(), 1);
    assert_eq!(problems[0].severity, Severity::Error);
    assert!(problems[0].error.file.ends_with("mine/1.png"));
}

#[test]
fn what_was_imported_once_must_be_the_same_when_it_is_asked_for_again() {
    let files = [
        ("img1.png", ""),
        ("img2.png", ""),
        ("img3.png", ""),
        ("poses.txt", KITTI_POSES),
        ("K.txt", K),
    ];
    let (folder, src) = source("mine", &files);
    let out = folder.path().join("made");
    let with = |rule: &str| ImportOptions {
        pairs: Some(rule.parse().unwrap()),
        property: Some("indoor".into()),
        ..ImportOptions::default()
    };
    let once = |rule: &str| import_once("folder", &src, &out, &with(rule));
    assert_eq!(once("all").unwrap().map(|report| report.pairs), Some(3));
    assert_eq!(crate::datasets::describe(&out).unwrap().property, "indoor");
    assert_eq!(
        crate::datasets::describe(&out).unwrap().import,
        ["folder", "mine", "--pairs", "all", "--property", "indoor"]
    );
    // What lies beside the images is found where they are, and what lies elsewhere by its name.
    let list = folder.path().join("list.txt");
    fs::write(&list, "0 2\n").unwrap();
    let named = ImportOptions {
        camera: Some(src.join("../mine/K.txt")),
        ..with(&format!("list:{}", list.display()))
    };
    import("folder", &src, &folder.path().join("named"), &named).unwrap();
    let about = crate::datasets::describe(&folder.path().join("named")).unwrap();
    let camera = Path::new("mine").join("K.txt").display().to_string();
    let words = ["--pairs", "list:list.txt", "--camera", &camera];
    assert_eq!(about.import[2..6], words);
    assert_eq!(once("all").unwrap(), None);
    let other = once("window:1").unwrap_err();
    assert!(
        other.what.contains("other pairs") && other.remedy.contains("remove"),
        "{other}"
    );
    fs::write(src.join("K.txt"), K.replace("20 0 12", "21 0 12")).unwrap();
    assert!(once("all").unwrap_err().what.contains("another camera"));
    fs::write(src.join("K.txt"), K).unwrap();
    fs::write(
        src.join("poses.txt"),
        KITTI_POSES.replace("1 0 0 2", "1 0 0 3"),
    )
    .unwrap();
    assert!(once("all").unwrap_err().what.contains("true poses"));
    fs::rename(&src, folder.path().join("moved")).unwrap();
    let moved = import_once("folder", &folder.path().join("moved"), &out, &with("all"));
    assert!(moved.is_err());
}
