//! How files that are named otherwise than the images of a dataset are understood.

use std::fs;
use std::path::Path;

use image::GrayImage;
use matchbench_vision::geometry::MatchedPoints;
use nalgebra::Point2;

use super::tests::dataset;
use super::*;
use crate::arrays::Hdf5Out;
use crate::datasets::Sequence;

fn open(
    path: &Path,
    sequence: &Sequence,
    pixel_center: Option<f64>,
) -> Result<MatchFiles, ExchangeError> {
    let options = ReadOptions {
        pixel_center,
        ..ReadOptions::default()
    };
    MatchFiles::open(&[path.to_owned()], sequence, &options)
}

#[test]
fn the_root_of_a_tool_may_lie_above_in_every_format_with_names() {
    let (folder, mut sequence) = dataset();
    let moved = folder.path().join("moved");
    let mut narrow = sequence.clone();
    for frame in &mut narrow.frames {
        let end = frame
            .image
            .strip_prefix(folder.path().join("images"))
            .unwrap();
        let image = moved.join(end);
        fs::create_dir_all(image.parent().unwrap()).unwrap();
        fs::copy(&frame.image, &image).unwrap();
        frame.image = image;
    }
    // An image that is elsewhere makes the root of the others wider.
    let mut other = sequence.frames[0].clone();
    other.image = folder.path().join("other.png");
    GrayImage::new(4, 3).save(&other.image).unwrap();
    sequence.frames.push(other);
    let pairs = (sequence.pairs.iter()).map(|pair| {
        let mut points = MatchedPoints::default();
        points.push(
            Point2::new(10.0 + f64::from(pair.a), 2.0),
            Point2::new(300.0, 200.0),
            0.5,
        );
        points.push(Point2::new(390.0, 290.0), Point2::new(1.0, 2.0), 0.5);
        PairExport {
            frames: (pair.a, pair.b),
            points,
            two_view: None,
        }
    });
    let export = Export::new(&sequence, pairs.collect()).unwrap();
    let mut dense = Hdf5Out::default();
    for pair in &export.pairs {
        let names = export.image_names();
        let name = |frame: u32| names[frame as usize].replace('/', "-");
        let group = format!("{}/{}", name(pair.frames.0), name(pair.frames.1));
        for (number, points) in pair.coordinates().iter().enumerate() {
            dense.floats(format!("{group}/keypoints{number}"), &[2, 2], points);
        }
    }
    fs::create_dir(folder.path().join("dense")).unwrap();
    dense
        .write(&folder.path().join("dense/matches.h5"))
        .unwrap();
    for id in ["hloc", "glue-factory", "colmap", "dense"] {
        let files = folder.path().join(id).join("wide");
        let files = if id == "dense" {
            folder.path().join(id)
        } else {
            Format::find(id).unwrap().write(&files, &export).unwrap();
            files
        };
        let found = open(&files, &narrow, None).unwrap();
        assert_eq!(found.survey().found, 3, "{id}");
        assert_eq!(found.understood().named_by, NamedBy::ImageEnd, "{id}");
        assert_eq!(found.survey().warnings, [""; 0], "{id}");
        let points = found.matches(1, 2).unwrap().unwrap().points;
        assert!((points.a[0].x - 11.0).abs() < 1e-4, "{id}: {:?}", points.a);
    }
    let mut twice = sequence.clone();
    twice.frames.push(twice.frames[0].clone());
    let export = Export::new(&twice, Vec::new()).unwrap();
    for id in ["hloc", "glue-factory", "colmap"] {
        let written = Format::find(id)
            .unwrap()
            .write(&folder.path().join("twice").join(id), &export);
        let error = written.unwrap_err().to_string();
        assert!(error.contains("its name would be that of"), "{id}: {error}");
    }
    let list = fs::read_to_string(folder.path().join("hloc/wide/pairs.list")).unwrap();
    let first = "images/db/one.png images/db/two.png\n";
    assert!(
        list.starts_with(first) && list.lines().count() == 3,
        "{list}"
    );
}

/// hloc's list of pairs has one pair a line, with a blank between its names.
#[test]
fn names_that_a_list_of_pairs_cannot_say_are_refused_before_anything_is_written() {
    for name in ["db/on e.png", "db/one\n.png"] {
        if cfg!(windows) && name.contains('\n') {
            continue; // no file has such a name there
        }
        let (folder, mut sequence) = dataset();
        sequence.frames[1].image = folder.path().join("images").join(name);
        GrayImage::new(400, 300)
            .save(&sequence.frames[1].image)
            .unwrap();
        let pairs = vec![PairExport {
            frames: (0, 1),
            points: MatchedPoints::default(),
            two_view: None,
        }];
        let export = Export::new(&sequence, pairs).unwrap();
        let out = folder.path().join("out");
        let error = Format::find("hloc").unwrap().write(&out, &export);
        let error = error.unwrap_err();
        assert_eq!(error.file, sequence.frames[1].image);
        assert!(error.what.contains("a space or a line break"), "{error}");
        assert!(!out.join("features.h5").exists());
        Format::find("npz").unwrap().write(&out, &export).unwrap();
    }
}

#[test]
fn names_of_several_images_are_told() {
    let (folder, sequence) = dataset();
    let files = folder.path().join("lines");
    fs::create_dir(&files).unwrap();
    fs::write(files.join("one_two.txt"), "0 0 399 299\n").unwrap();
    let told = |message: &str| {
        assert!(message.contains("1 pair cannot be told"), "{message}");
        assert!(message.contains("`one` is "), "{message}");
        for image in [0, 2] {
            let image = sequence.frames[image].image.display().to_string();
            assert!(message.contains(&image), "{message}");
        }
    };
    let refused = open(&files, &sequence, Some(0.0))
        .err()
        .unwrap()
        .to_string();
    assert!(refused.contains("none of its pairs"), "{refused}");
    told(&refused);
    fs::write(files.join("db-one_two.txt"), "0 0 399 299\n").unwrap();
    let found = open(&files, &sequence, Some(0.0)).unwrap();
    assert_eq!((found.survey().found, found.survey().absent.len()), (1, 2));
    told(&found.survey().warnings.join("\n"));
}

/// Points are those of the images that the dataset has found in the name of the pair.
#[test]
fn a_joined_name_is_split_as_the_file_of_keypoints_says() {
    let (folder, mut sequence) = dataset();
    sequence.pairs.truncate(1);
    for (id, separator) in [("imc", '-'), ("hloc", '_')] {
        let joined = |names: [&str; 2]| format!("{}{separator}{}", names[0], names[1]);
        let (ab, bc) = (joined(["a", "b"]), joined(["b", "c"]));
        let pair = joined([&ab, "c"]);
        let own = folder.path().join(format!("own-{id}"));
        fs::create_dir(&own).unwrap();
        for (frame, name) in sequence.frames.iter_mut().zip([&*ab, "c"]) {
            frame.image = own.join(format!("{name}.png"));
            GrayImage::new(400, 300).save(&frame.image).unwrap();
        }
        let read = |images: &[&str]| {
            let files = folder.path().join(format!("{id} of {}", images.join(" ")));
            fs::create_dir(&files).unwrap();
            let (mut keypoints, mut matches) = (Hdf5Out::default(), Hdf5Out::default());
            for (number, image) in images.iter().enumerate() {
                let name = match id {
                    "imc" => (*image).to_owned(),
                    _ => format!("{image}/keypoints"),
                };
                keypoints.floats(name, &[1, 2], &[10.0 + 100.0 * number as f32, 20.0]);
            }
            match id {
                "imc" => matches.integers(pair.clone(), &[2, 1], &[0, 0]),
                _ => matches.integers(format!("{pair}/matches0"), &[1], &[0]),
            }
            keypoints.write(&files.join("keypoints.h5")).unwrap();
            matches.write(&files.join("matches.h5")).unwrap();
            let found = open(&files, &sequence, None).map_err(|error| error.to_string())?;
            assert_eq!(found.understood().format, id);
            let points = found.matches(0, 1).unwrap().unwrap().points;
            Ok::<_, String>([points.a[0].x, points.b[0].x])
        };
        assert_eq!(read(&["a", &ab, "c"]), Ok([110.0, 210.0]), "{id}");
        // Those of another pair, which the dataset does not have.
        let other = read(&["a", &bc]).unwrap_err();
        assert!(other.contains("none of its pairs"), "{id}: {other}");
        let several = read(&["a", &bc, &ab, "c"]).unwrap_err();
        let ways = format!("`{pair}` can be the pair `a` and `{bc}` and the pair `{ab}` and `c`");
        assert!(several.contains(&ways), "{id}: {several}");
    }
}

/// In names of pairs `-` stands for `/`, so images of two names may have one there.
#[test]
fn hlocs_pairs_do_not_take_keypoints_of_one_image_for_those_of_another() {
    let (folder, mut sequence) = dataset();
    sequence.pairs.truncate(1);
    let own = folder.path().join("own");
    fs::create_dir_all(own.join("x")).unwrap();
    for (frame, name) in sequence.frames.iter_mut().zip(["x/1.png", "y.png"]) {
        frame.image = own.join(name);
        GrayImage::new(400, 300).save(&frame.image).unwrap();
    }
    for (number, pair) in ["x-1.png/y.png", "x-1.png_y.png"].into_iter().enumerate() {
        let read = |images: &[&str]| {
            let files = (folder.path()).join(format!("dashes {number} {}", images.len()));
            fs::create_dir(&files).unwrap();
            let (mut keypoints, mut matches) = (Hdf5Out::default(), Hdf5Out::default());
            for (x, image) in (0..).zip(images) {
                let points = [10.0 + 100.0 * x as f32, 20.0];
                keypoints.floats(format!("{image}/keypoints"), &[1, 2], &points);
            }
            matches.integers(format!("{pair}/matches0"), &[1], &[0]);
            keypoints.write(&files.join("keypoints.h5")).unwrap();
            matches.write(&files.join("matches.h5")).unwrap();
            let found = open(&files, &sequence, None).map_err(|error| error.to_string())?;
            let points = found.matches(0, 1).map_err(|error| error.to_string())?;
            let points = points.unwrap().points;
            Ok::<_, String>([points.a[0].x, points.b[0].x])
        };
        assert_eq!(read(&["y.png", "x/1.png"]), Ok([110.0, 10.0]), "{pair}");
        let several = read(&["y.png", "x/1.png", "x-1.png"]).unwrap_err();
        let ways = ["x-1.png", "x/1.png"].map(|image| format!("the pair `{image}` and `y.png`"));
        assert!(ways.iter().all(|way| several.contains(way)), "{several}");
    }
}
