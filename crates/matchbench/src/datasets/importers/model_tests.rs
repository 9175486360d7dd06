//! Importers of models, calibrations and planes on small sources; what is binary lies in `tests/lists`.

use std::fs;

use matchbench_vision::geometry::{Camera, Distortion, Fisheye, Lens};
use nalgebra::{Isometry3, Matrix3, Point3, Vector3};

use super::list_tests::{fixture, read, with_root, x_of};
use super::tests::source;
use super::{ImportOptions, KINDS, import, read_source};
use crate::datasets::{ImageStorage, Pair, Sequence, export, testing, validate};

const CAMERAS: &str =
    "# cameras\n1 SIMPLE_PINHOLE 24 17 20 12 8.5\n5 SIMPLE_RADIAL 24 17 21 12 8.5 0.125\n";
const IMAGES: &str = "# images\n9 1 0 0 0 1 0 0 5 b.png\n1.5 2.5 7 1.5 2.5 8 1.5 2.5 9 1.5 2.5 -1\n\
                      4 1 0 0 0 0 0 0 1 a.png\n1.5 2.5 9 1.5 2.5 8 1.5 2.5 11 1.5 2.5 12\n";

#[test]
fn colmap_models_are_the_same_as_text_and_binary() {
    let files = [
        ("cameras.txt", CAMERAS),
        ("images.txt", IMAGES),
        ("images/a.png", ""),
    ];
    let (folder, src) = source("model", &files);
    let text = read("colmap", &src).unwrap();
    let options = with_root(&src.join("images"));
    let binary = read_source("colmap", &fixture("model"), &options).unwrap();
    assert_eq!(text.frames, binary.frames);
    assert_eq!(text.seen, binary.seen);
    assert_eq!(text.seen, Some(vec![vec![8, 9, 11, 12], vec![7, 8, 9]]));
    assert_eq!(text.frames[0].image, src.join("images/a.png"));
    assert_eq!(
        text.frames[0].camera,
        Camera::pinhole(20.0, 20.0, 11.5, 8.0)
    );
    assert_eq!(
        text.frames[1].world_from_camera.unwrap().translation.x,
        -1.0
    );

    // Two of four points are common.
    let with = |rule: &str| ImportOptions {
        pairs: Some(rule.parse().unwrap()),
        ..ImportOptions::default()
    };
    let report = import(
        "colmap",
        &src,
        &folder.path().join("a"),
        &with("covisible:0.5..0.5"),
    );
    assert_eq!(report.unwrap().pairs, 1);
    let none = import(
        "colmap",
        &src,
        &folder.path().join("b"),
        &with("covisible:0.6..1"),
    );
    assert!(none.unwrap_err().what.contains("covisible:0.6..1"));
    let pair = crate::datasets::read_pairs(&folder.path().join("a/pairs.txt")).unwrap()[0];
    assert_eq!((pair.a, pair.b, x_of(&pair)), (0, 1, 1.0));

    // Points may be absent; then the rule must be another one.
    let no_points = "4 1 0 0 0 0 0 0 1 a.png\n\n9 1 0 0 0 1 0 0 5 b.png\n\n";
    fs::write(src.join("images.txt"), no_points).unwrap();
    let error = import(
        "colmap",
        &src,
        &folder.path().join("c"),
        &ImportOptions::default(),
    );
    assert!(error.unwrap_err().remedy.contains("another rule"));
    let report = import("colmap", &src, &folder.path().join("c"), &with("all")).unwrap();
    assert_eq!((report.frames, report.pairs), (2, 1));
}

#[test]
fn damaged_models_are_refused() {
    let (_folder, src) = source("model", &[("cameras.txt", CAMERAS), ("images.txt", IMAGES)]);
    let with = |name: &str, from: &str, to: &str| {
        let text = if name == "images.txt" {
            IMAGES
        } else {
            CAMERAS
        };
        assert!(text.contains(from));
        fs::write(src.join(name), text.replacen(from, to, 1)).unwrap();
        let error = read("colmap", &src).unwrap_err();
        fs::write(src.join(name), text).unwrap();
        error.to_string()
    };
    let error = with("cameras.txt", "SIMPLE_RADIAL", "THIN_PRISM_FISHEYE");
    assert!(
        error.contains("the camera model THIN_PRISM_FISHEYE is not supported"),
        "{error}"
    );
    assert!(
        error.contains("image_undistorter") && !error.contains("again"),
        "{error}"
    );
    let lens = with("cameras.txt", "0.125", "1e9");
    assert!(lens.contains("line 3 of cameras.txt: k1 is"), "{lens}");
    assert!(with("cameras.txt", "24 17", "24 h").contains("cameras.txt:2: `h` is no width"));
    assert!(with("images.txt", "5 b.png", "6 b.png").contains("camera 6, which is not there"));
    assert!(with("images.txt", "9 1 0 0 0", "9 1 1 0 0").contains("images.txt:2: the quaternion"));
    assert!(with("images.txt", "2.5 -1", "2.5 -2").contains("images.txt:3: `-2`"));
    assert!(with("images.txt", "1 a.png", "1 b.png").contains("b.png is there twice"));
    let binary = fs::read(fixture("model/images.bin")).unwrap();
    fs::copy(fixture("model/cameras.bin"), src.join("cameras.bin")).unwrap();
    for bytes in [&binary[..100], &[0xff; 8], &[&binary[..], &[0]].concat()] {
        fs::write(src.join("images.bin"), bytes).unwrap();
        assert!(
            read("colmap", &src)
                .unwrap_err()
                .file
                .ends_with("images.bin")
        );
    }
    let mut cameras = fs::read(fixture("model/cameras.bin")).unwrap();
    cameras.copy_within(8..12, 56); // the number of the first camera for that of the second
    fs::write(src.join("cameras.bin"), cameras).unwrap();
    let error = read("colmap", &src).unwrap_err();
    assert!(error.file.ends_with("cameras.bin"), "{error}");
    assert!(error.what.contains("a second time"), "{error}");
    fs::copy(fixture("model/cameras.bin"), src.join("cameras.bin")).unwrap();
    for name in ["images.bin", "images.txt"] {
        fs::remove_file(src.join(name)).unwrap();
    }
    let error = read("colmap", &src).unwrap_err();
    assert!(error.file.ends_with("images.bin"), "{error}");
}

#[test]
fn cameras_that_are_not_supported_matter_only_where_an_image_has_them() {
    let (_folder, src) = source("model", &[("a.png", "")]);
    let mut cameras = fs::read(fixture("model/cameras.bin")).unwrap();
    let models = super::colmap::lens::MODELS;
    cameras[..8].copy_from_slice(&(2 + models.len() as u64).to_le_bytes());
    for (number, (_, parameters)) in (0_u32..).zip(models) {
        cameras.extend([100 + number, number].map(u32::to_le_bytes).as_flattened());
        cameras.extend([24_u64, 17].map(u64::to_le_bytes).as_flattened());
        cameras.extend(1_f64.to_le_bytes().repeat(parameters));
    }
    fs::write(src.join("cameras.bin"), &cameras).unwrap();
    let mut images = fs::read(fixture("model/images.bin")).unwrap();
    fs::write(src.join("images.bin"), &images).unwrap();
    assert_eq!(read("colmap", &src).unwrap().frames.len(), 2);

    images[68..72].copy_from_slice(&111_u32.to_le_bytes()); // the camera of the first
    fs::write(src.join("images.bin"), images).unwrap();
    let error = read("colmap", &src).unwrap_err();
    let named =
        "the camera 111 of b.png: the camera model RAD_TAN_THIN_PRISM_FISHEYE is not supported";
    assert!(error.what.starts_with(named), "{error}");
    assert!(error.remedy.contains("image_undistorter"), "{error}");

    cameras[12..16].copy_from_slice(&99_u32.to_le_bytes()); // the model of the first
    fs::write(src.join("cameras.bin"), cameras).unwrap();
    let error = read("colmap", &src).unwrap_err();
    assert!(error.what.contains("model 99 is not known"), "{error}");
    assert!(error.remedy.contains("as text"), "{error}");
}

#[test]
fn images_of_another_size_than_their_camera_are_refused() {
    let larger = CAMERAS.replace("24 17 20 12", "48 34 20 12");
    let files = [
        ("cameras.txt", larger.as_str()),
        ("images.txt", IMAGES),
        ("a.png", ""),
    ];
    let (_folder, src) = source("model", &files);
    let error = read("colmap", &src).unwrap_err();
    assert!(error.file.ends_with("cameras.txt"), "{error}");
    let what = "the camera 1 of a.png is for 48x34 pixels, its image has 24x17";
    assert_eq!(error.what, what);
    assert!(error.remedy.contains("original images"), "{error}");
    fs::remove_file(src.join("a.png")).unwrap();
    assert!(read("colmap", &src).is_ok(), "images may be added later");
}

#[test]
fn a_dataset_survives_as_colmap_model_and_as_list() {
    let (folder, dir) = testing::dataset();
    let mut sequence = Sequence::open(&dir).unwrap();
    sequence.frames[1].camera.fx = 33.0;
    for layout in ["colmap", "superglue"] {
        let out = folder.path().join(layout);
        let root = export(layout, &sequence, &out).unwrap();
        let options = ImportOptions {
            pairs: (layout == "colmap").then(|| "all".parse().unwrap()),
            ..with_root(&root)
        };
        let again = folder.path().join(format!("{layout}-again"));
        let report = import(layout, &out, &again, &options).unwrap();
        assert_eq!((report.frames, report.pairs), (4, 6));
        let warnings = validate(&again);
        assert!(
            warnings
                .iter()
                .all(|w| w.severity == crate::datasets::Severity::Warning)
        );
        let found = Sequence::open(&again).unwrap();
        for (f, e) in found.frames.iter().zip(&sequence.frames) {
            let (f, e) = (f.camera, e.camera);
            assert!((f.fx - e.fx).abs() + (f.cx - e.cx).abs() + (f.cy - e.cy).abs() < 1e-9);
        }
        for (f, e) in found.pairs.iter().zip(&sequence.pairs) {
            let difference =
                f.pose().unwrap().to_homogeneous() - e.pose().unwrap().to_homogeneous();
            assert!(difference.amax() < 1e-12, "{layout}");
        }
        assert!(
            export(layout, &sequence, &out).is_err(),
            "nothing is overwritten"
        );
    }
    sequence.pairs[0] = Pair::with_homography(0, 1, Matrix3::identity());
    let error = export("superglue", &sequence, &folder.path().join("x")).unwrap_err();
    assert!(error.what.contains("homography"), "{error}");
    sequence.frames[2].world_from_camera = None;
    let error = export("colmap", &sequence, &folder.path().join("x")).unwrap_err();
    assert!(error.what.contains("no pose"), "{error}");
    assert!(export("kitti", &sequence, &folder.path().join("x")).is_err());
}

#[test]
fn lenses_survive_as_colmap_models() {
    let (folder, dir) = testing::dataset();
    let mut sequence = Sequence::open(&dir).unwrap();
    let lens = |k3| {
        Lens::Brown(Distortion {
            k1: -0.2,
            k2: 0.1,
            p1: 0.001,
            p2: -0.002,
            k3,
        })
    };
    let fisheye = Lens::Fisheye(Fisheye {
        k1: 0.04,
        k2: -0.03,
        k3: 0.02,
        k4: -0.01,
    });
    let lenses = [None, Some(lens(0.0)), Some(lens(-0.03)), Some(fisheye)];
    for (frame, lens) in sequence.frames.iter_mut().zip(lenses) {
        frame.camera.distortion = lens;
    }
    let [out, again] = ["model", "again"].map(|name| folder.path().join(name));
    let options = ImportOptions {
        pairs: Some("all".parse().unwrap()),
        ..with_root(&export("colmap", &sequence, &out).unwrap())
    };
    import("colmap", &out, &again, &options).unwrap();
    let found = Sequence::open(&again).unwrap();
    assert_eq!(found.frames.len(), lenses.len());
    for (frame, lens) in found.frames.iter().zip(lenses) {
        assert_eq!(frame.camera.distortion, lens);
    }
}

#[test]
fn zeb_finds_images_by_scene() {
    let numbers =
        "0.9 0.8 20 0 12 0 20 8 0 0 1 21 0 12 0 21 8 0 0 1 1 0 0 2 0 1 0 0 0 0 1 0 0 0 0 1";
    let text = format!("image_0.jpg image_39.jpg {numbers}\n");
    let name = "2019_15_image_0_image_39.txt";
    let (_folder, src) = source(
        "gta",
        &[
            (name, &text),
            ("2019_15_image_0.png", ""),
            ("2019_15_image_39.png", ""),
        ],
    );
    let found = read("zeb", &src).unwrap();
    assert!(found.frames[0].image.ends_with("2019_15_image_0.png"));
    assert!(found.frames.iter().all(|frame| frame.image.is_file()));
    assert_eq!(
        (found.frames[1].camera.fx, x_of(&found.pairs.unwrap()[0])),
        (21.0, 2.0)
    );
    fs::write(
        src.join(name),
        text.replace("1 0 0 0 0 1\n", "1 0 0 0 0 2\n"),
    )
    .unwrap();
    assert!(
        read("zeb", &src)
            .unwrap_err()
            .to_string()
            .contains(".txt:1: the last row")
    );
}

#[test]
fn imc_reads_calibrations_of_h5py() {
    let (folder, src) = source("set_100", &[("images/7.png", "")]);
    let calibrations = src.join("calibration");
    fs::create_dir(&calibrations).unwrap();
    fs::copy(
        fixture("calibration_7.h5"),
        calibrations.join("calibration_7.h5"),
    )
    .unwrap();
    fs::copy(
        fixture("calibration_7.h5"),
        calibrations.join("calibration_8.h5"),
    )
    .unwrap();
    let found = read("imc", &src).unwrap();
    assert_eq!(found.frames.len(), 2);
    assert_eq!(found.frames[0].image, src.join("images/7.png"));
    assert_eq!(
        found.frames[0].camera,
        Camera::pinhole(20.0, 21.0, 11.5, 8.0)
    );
    let expected = Isometry3::new(Vector3::new(1.0, 2.0, 3.0), Vector3::y() * 0.1);
    let difference = found.frames[0]
        .world_from_camera
        .unwrap()
        .inverse()
        .to_homogeneous()
        - expected.to_homogeneous();
    assert!(difference.amax() < 1e-12);
    let report = import(
        "imc",
        &src,
        &folder.path().join("out"),
        &ImportOptions::default(),
    );
    assert_eq!(report.unwrap().pairs, 1);
    let bytes = fs::read(fixture("calibration_7.h5")).unwrap();
    for bytes in [&bytes[..300], b"no HDF5"] {
        fs::write(calibrations.join("calibration_8.h5"), bytes).unwrap();
        assert!(
            read("imc", &src)
                .unwrap_err()
                .file
                .ends_with("calibration_8.h5")
        );
    }
}

#[test]
fn imc_reads_labels_of_2025() {
    let nan = "nan;nan;nan;nan;nan;nan;nan;nan;nan,nan;nan;nan";
    let labels = format!(
        "dataset,scene,image,rotation_matrix,translation_vector\n\
         fort,wall,a.png,1;0;0;0;1;0;0;0;1,0;0;0\nfort,wall,b.png,1;0;0;0;1;0;0;0;1,2;0;0\n\
         fort,wall,c.png,{nan}\nfort,outliers,d.png,{nan}\nset,x,e.png,1;0;0;0;1;0;0;0;1,0;0;0\n"
    );
    let files = [
        ("train_labels.csv", &*labels),
        ("train/fort/a.png", ""),
        ("train/fort/b.png", ""),
    ];
    let (folder, src) = source("imc", &files);
    let src = src.join("train_labels.csv");
    let with = |sequence: &str| ImportOptions {
        sequence: Some(sequence.into()),
        ..ImportOptions::default()
    };
    let found = read_source("imc", &src, &with("fort/wall")).unwrap();
    assert_eq!(found, read_source("imc", &src, &with("fort")).unwrap());
    assert_eq!(
        found.frames[1].world_from_camera.unwrap().translation.x,
        -2.0
    );
    let width = testing::pixels(0).width() as f64;
    assert_eq!(found.frames[0].camera.fx, 1.2 * width);
    assert!(
        found.about.notes[0].starts_with("left out: ")
            && found.about.notes[0].ends_with(" (c.png)"),
        "{:?}",
        found.about.notes
    );
    import("imc", &src, &folder.path().join("out"), &with("fort")).unwrap();
    assert_eq!(validate(&folder.path().join("out")), []);
    let error = read("imc", &src).unwrap_err();
    assert!(error.remedy.contains("fort/wall, set/x"), "{error}");
    assert!(
        read_source("imc", &src, &with("set"))
            .unwrap_err()
            .remedy
            .contains("--camera")
    );
    fs::write(&src, labels.replace("0;0;1,2;0;0", "0;0;2,2;0;0")).unwrap();
    assert_eq!(
        read_source("imc", &src, &with("fort")).unwrap_err().line,
        Some(3)
    );
}

#[test]
fn euroc_brings_the_camera_to_the_body() {
    let sensor = "# camera\nsensor_type: camera\nT_BS:\n  cols: 4\n  rows: 4\n  data: [0.0, -1.0, 0.0, 0.5,\n         1.0, 0.0, 0.0, 0.0,\n         0.0, 0.0, 1.0, 0.0,\n         0.0, 0.0, 0.0, 1.0]\nrate_hz: 20\nresolution: [24, 17]\ncamera_model: pinhole\nintrinsics: [20.0, 21.0, 11.5, 8.0] #fu, fv, cu, cv\ndistortion_model: radial-tangential\ndistortion_coefficients: [-0.28, 0.07, 0.0002, 1.7e-05]\n";
    let states = "#timestamp, p_RS_R_x [m], ...\n1403636580838555648,1,2,3,1,0,0,0,0,0,0\n1403636581838555648,2,2,3,1,0,0,0,0,0,0\n";
    let images = "#timestamp [ns],filename\n1403636580838555648,1.png\n1403636581838555648,2.png\n1403636582838555648,3.png\r\n";
    let files = [
        ("mav0/cam0/sensor.yaml", sensor),
        ("mav0/cam0/data.csv", images),
        ("mav0/cam0/data/1.png", ""),
        ("mav0/cam0/data/2.png", ""),
        ("mav0/state_groundtruth_estimate0/data.csv", states),
    ];
    let (folder, src) = source("MH_01", &files);
    let found = read("euroc", &src).unwrap();
    assert_eq!(found.frames.len(), 2);
    let pose = found.frames[0].world_from_camera.unwrap();
    assert!((pose * Point3::new(1.0, 0.0, 0.0) - Point3::new(1.5, 3.0, 3.0)).norm() < 1e-12);
    let camera = found.frames[0].camera;
    assert_eq!(
        (camera.fy, camera.distortion.unwrap().brown().unwrap().p2),
        (21.0, 1.7e-5)
    );
    assert!(
        found.about.notes[0].starts_with("left out: ")
            && found.about.notes[0].ends_with(" (3.png)"),
        "{:?}",
        found.about.notes
    );
    import(
        "euroc",
        &src,
        &folder.path().join("out"),
        &ImportOptions::default(),
    )
    .unwrap();
    assert_eq!(validate(&folder.path().join("out")), []);
    for name in ["1\0.png".to_owned(), format!("{}.png", "1".repeat(300))] {
        let list = src.join("mav0/cam0/data.csv");
        fs::write(list, images.replace("1.png", &name)).unwrap();
        let out = folder.path().join("other");
        let error = import("euroc", &src, &out, &ImportOptions::default()).unwrap_err();
        assert!(
            error.remedy.contains("no file can have this name"),
            "{error}"
        );
    }
    let yaml = src.join("mav0/cam0/sensor.yaml");
    fs::write(&yaml, sensor.replace("radial-tangential", "fov")).unwrap();
    assert!(
        read("euroc", &src)
            .unwrap_err()
            .what
            .contains("distortion_model")
    );
    fs::write(&yaml, sensor.replace("radial-tangential", "equidistant")).unwrap();
    let fisheye = read("euroc", &src).unwrap().frames[0].camera.distortion;
    assert!(matches!(fisheye, Some(Lens::Fisheye(_))), "{fisheye:?}");
    fs::write(&yaml, sensor.replace("-0.28", "-1e9")).unwrap();
    let error = read("euroc", &src).unwrap_err();
    assert!(error.what.starts_with("k1 is"), "{error}");
    fs::write(&yaml, sensor.replace("T_BS", "T_SB")).unwrap();
    assert!(read("euroc", &src).unwrap_err().what.contains("T_BS"));
}

const SHIFT: &str = " 1.0 0.0 3.5\n 0.0 1.0 -2.0\n 0.0 0.0 1.0\n";

#[test]
fn planes_of_three_sets_are_read() {
    let oxford = [
        ("img1.png", ""),
        ("img2.png", ""),
        ("img3.png", ""),
        ("H1to2p", SHIFT),
        ("H1to3p", SHIFT),
    ];
    let hpatches = [
        ("i_ajuntament/1.png", ""),
        ("i_ajuntament/2.png", ""),
        ("i_ajuntament/H_1_2", SHIFT),
        ("v_wall/1.png", ""),
        ("v_wall/2.png", ""),
        ("v_wall/H_1_2", SHIFT),
    ];
    let evd = [("1/fox.png", ""), ("2/fox.png", ""), ("h/fox.txt", SHIFT)];
    for (kind, files, pairs) in [
        ("oxford", &oxford[..], 2),
        ("hpatches", &hpatches, 2),
        ("evd", &evd, 1),
    ] {
        let (folder, src) = source(kind, files);
        let out = folder.path().join("out");
        let options = ImportOptions {
            images: ImageStorage::Copy,
            ..ImportOptions::default()
        };
        let report = import(kind, &src, &out, &options).unwrap();
        assert_eq!(report.pairs, pairs, "{kind}");
        assert!(report.notes[0].contains("not known"), "{:?}", report.notes);
        assert_eq!(validate(&out), []);
        assert!(!out.join("pairs.txt").exists());
        let found = Sequence::open(&out).unwrap();
        assert_eq!(found.pairs[0].homography().unwrap()[(0, 2)], 3.5);
        assert_eq!((found.pairs[0].a, found.pairs[0].b), (0, 1));
    }
    let (_folder, src) = source("hpatches", &hpatches);
    let with = |sequence: &str| ImportOptions {
        sequence: Some(sequence.into()),
        ..ImportOptions::default()
    };
    for sequence in ["v", "v_wall"] {
        let found = read_source("hpatches", &src, &with(sequence)).unwrap();
        assert!(found.frames[1].image.ends_with("v_wall/2.png"));
    }
    assert!(read_source("hpatches", &src, &with("w")).is_err());
    fs::write(src.join("v_wall/H_1_2"), "1 0 0 0 1 0 0 0").unwrap();
    assert!(
        read("hpatches", &src)
            .unwrap_err()
            .file
            .ends_with("v_wall/H_1_2")
    );
    fs::remove_file(src.join("i_ajuntament/2.png")).unwrap();
    assert!(read("hpatches", &src).unwrap_err().what.contains("missing"));
    // A homography in the middle or at the end, and the first one.
    for missing in ["H1to2p", "H1to3p"] {
        let (_folder, src) = source("oxford", &oxford);
        fs::remove_file(src.join(missing)).unwrap();
        let error = read("oxford", &src).unwrap_err();
        assert!(error.file.ends_with(missing), "{error}");
        assert!(error.what.contains("the homography is missing"), "{error}");
    }
    fs::write(src.join("v_wall/H_1_3"), SHIFT).unwrap();
    fs::remove_file(src.join("v_wall/H_1_2")).unwrap();
    let error = read_source("hpatches", &src, &with("v")).unwrap_err();
    assert!(error.file.ends_with("v_wall/H_1_2"), "{error}");
}

#[test]
fn an_option_that_a_kind_has_not_is_refused_with_those_that_have_it() {
    let (_folder, src) = source("any", &[("x", "")]);
    let every = ImportOptions {
        sequence: Some("1".into()),
        sensor: Some("s".into()),
        pairs: Some("all".parse().unwrap()),
        camera: Some("k".into()),
        poses: Some("p".into()),
        body_from_camera: Some("b".into()),
        tolerance: Some(5.0),
        interpolate: true,
        image_root: Some("r".into()),
        intrinsics: Some("i".into()),
        property: None,
        images: ImageStorage::Reference,
    };
    for kind in KINDS {
        let error = read_source(kind.id, &src, &every).unwrap_err();
        assert!(
            error
                .what
                .contains(&format!("kind {} has no such option", kind.id)),
            "{error}"
        );
    }
    let interpolate = ImportOptions {
        interpolate: true,
        ..ImportOptions::default()
    };
    let error = read_source("kitti", &src, &interpolate)
        .unwrap_err()
        .to_string();
    assert!(
        error.contains("--interpolate") && error.contains("tum, folder, euroc"),
        "{error}"
    );
    let tolerance = ImportOptions {
        tolerance: Some(-1.0),
        ..ImportOptions::default()
    };
    let tum = [
        ("rgb.txt", ""),
        ("groundtruth.txt", ""),
        ("camera.txt", "9 0 3 0 9 2 0 0 1"),
    ];
    let (_folder, src) = source("tum", &tum);
    let error = read_source("tum", &src, &tolerance).unwrap_err();
    assert!(
        error.to_string().contains("--tolerance: -1 is no time"),
        "{error}"
    );
}
