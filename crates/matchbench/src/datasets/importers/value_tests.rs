//! Values that importers give, worked out by hand.

use std::fs;

use nalgebra::Point3;

use super::list_tests::read;
use super::tests::source;
use crate::datasets::Frame;

/// x, y, z and w of a rotation of which no two agree.
const Q: [&str; 4] = ["0.1", "0.3", "-0.5", "0.806225774829855"];

/// Where the motion by `Q` and then by (10, 20, 30) takes (1, 2, 3). The rows of its rotation are 0.32, 0.866226, 0.383735
/// and -0.746226, 0.48, -0.461245 and -0.583735, -0.138755, 0.8.
fn assert_moved(found: Point3<f64>, what: &str) {
    let expected = Point3::new(13.203657945, 18.830038760, 31.538754845);
    assert!((found - expected).norm() < 1e-8, "{what}: {found}");
}

fn moved(frame: &Frame) -> Point3<f64> {
    frame.world_from_camera.expect("it has a pose") * Point3::new(1.0, 2.0, 3.0)
}

#[test]
fn the_coordinates_of_quaternions_are_in_the_order_of_the_format() {
    let [x, y, z, w] = Q;
    let w_last = format!("1.0 10 20 30 {x} {y} {z} {w}\n");
    let camera = "20 0 12\n0 20 8\n0 0 1\n";
    let sensor = "T_BS:\n  data: [1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0,\n         0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0]\nintrinsics: [20.0, 21.0, 11.5, 8.0]\ndistortion_model: radial-tangential\ndistortion_coefficients: [0.0, 0.0, 0.0, 0.0]\n";
    let state = format!("1000000000,10,20,30,{w},{x},{y},{z},0,0,0\n");
    for (kind, files) in [
        (
            "tum",
            &[
                ("groundtruth.txt", &*w_last),
                ("rgb.txt", "1.0 rgb/a.png\n"),
                ("rgb/a.png", ""),
                ("camera.txt", camera),
            ][..],
        ),
        (
            "folder",
            &[
                ("poses.txt", &*w_last),
                ("a.png", ""),
                ("camera.txt", camera),
            ],
        ),
        (
            "euroc",
            &[
                ("mav0/cam0/sensor.yaml", sensor),
                ("mav0/cam0/data.csv", "1000000000,a.png\n"),
                ("mav0/cam0/data/a.png", ""),
                ("mav0/state_groundtruth_estimate0/data.csv", &state),
            ],
        ),
    ] {
        let (_folder, src) = source("room", files);
        let found = read(kind, &src).unwrap_or_else(|error| panic!("{kind}: {error}"));
        assert_moved(moved(&found.frames[0]), kind);
    }
}

#[test]
fn the_coordinates_of_quaternions_of_colmap_have_w_first() {
    let [x, y, z, w] = Q;
    let image = format!("9 {w} {x} {y} {z} 10 20 30 1 a.png\n\n");
    let (_folder, src) = source(
        "model",
        &[
            ("cameras.txt", "1 SIMPLE_PINHOLE 24 17 20 12 8.5\n"),
            ("images.txt", &image),
        ],
    );
    let camera_from_world = |what: &str| {
        let found = read("colmap", &src).unwrap_or_else(|error| panic!("{what}: {error}"));
        let pose = found.frames[0].world_from_camera.expect("it has a pose");
        assert_moved(pose.inverse() * Point3::new(1.0, 2.0, 3.0), what);
    };
    camera_from_world("text");
    // One camera with the number 1, of the first model; one image with the number 9, without keypoints.
    let numbers = |numbers: &[f64]| numbers.iter().flat_map(|n| n.to_le_bytes()).collect();
    let params: Vec<u8> = numbers(&[20.0, 12.0, 8.5]);
    let [x, y, z, w] = Q.map(|number| number.parse().expect("a number"));
    let pose: Vec<u8> = numbers(&[w, x, y, z, 10.0, 20.0, 30.0]);
    let (one, id) = (1_u64.to_le_bytes(), 1_u32.to_le_bytes());
    let size = [24_u64, 17].map(u64::to_le_bytes).concat();
    let cameras = [&one[..], &id, &0_u32.to_le_bytes(), &size, &params].concat();
    fs::write(src.join("cameras.bin"), cameras).unwrap();
    let nine = 9_u32.to_le_bytes();
    let images = [&one[..], &nine, &pose, &id, b"a.png\0", &[0; 8]].concat();
    fs::write(src.join("images.bin"), images).unwrap();
    camera_from_world("binary");
}

#[test]
fn depth_of_seven_scenes_has_millimetres_and_65535_where_nothing_was_measured() {
    let files = [
        ("frame-000000.color.png", ""),
        (
            "frame-000000.pose.txt",
            "1 0 0 3\n0 1 0 0\n0 0 1 0\n0 0 0 1\n",
        ),
    ];
    let (_folder, src) = source("chess", &files);
    // 24 x 17 pixels, as the image: nothing in the first row, then 2 metres.
    let values = (0..24 * 17).flat_map(|i| {
        if i < 24 {
            [255; 2]
        } else {
            2000_u16.to_ne_bytes()
        }
    });
    let values: Vec<u8> = values.collect();
    let path = src.join("frame-000000.depth.png");
    image::save_buffer(path, &values, 24, 17, image::ExtendedColorType::L16).unwrap();
    let found = read("7scenes", &src).unwrap();
    let depth = found.frames[0].read_depth().unwrap().expect("it has depth");
    let at = |y: f64| depth.at(nalgebra::Point2::new(5.0, y));
    assert_eq!((at(0.0), at(9.0)), (None, Some(2.0)));
}

/// An image that is turned but not there is as large as if its centre were the principal point: twice 649.095 and one more
/// across, so that the centre stays where it is.
#[test]
fn the_principal_point_of_an_image_that_is_not_there_is_its_centre() {
    let k = "1165.72 0 649.095 0 1165.74 484.765 0 0 1";
    let list = format!("a.png b.png 1 3 {k} {k} 1 0 0 1 0 1 0 0 0 0 1 0 0 0 0 1\n");
    let (_folder, src) = source("sg", &[("list.txt", &list)]);
    let found = read("superglue", &src.join("list.txt")).unwrap();
    for frame in &found.frames {
        let camera = frame.camera;
        assert_eq!((camera.fx, camera.fy), (1165.74, 1165.72));
        assert!((camera.cx - 484.765).abs() < 1e-9, "{}", camera.cx);
        assert!((camera.cy - 649.095).abs() < 1e-9, "{}", camera.cy);
    }
    assert!(found.about.notes[0].starts_with("2 times an image"));
}
