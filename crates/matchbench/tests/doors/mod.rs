//! The doors by which bytes of others come in, and what must be true of whatever they let pass.
//!
//! Each door takes any bytes as the content of one file, offers it to the library as a command would, and
//! panics if what was accepted is not as promised. `tests/damaged.rs` tries them with damaged files, and
//! `fuzz/` with whatever a fuzzer comes upon. An error is always right; a panic or a promise that does not
//! hold never is.

pub(crate) mod archives;
pub(crate) mod cache;
#[cfg(unix)] // `sh`
pub(crate) mod children;
mod sources;

use std::fs;
use std::path::{Path, PathBuf};

use matchbench::datasets::{
    DepthFile, DepthUnit, Frame, ImportOptions, Imported, Pair, PairRule, Sequence, Truth, Turn,
    decode_gray, read_pairs, read_source,
};
use matchbench::exchange::{Export, Format, MatchFiles, PairExport, ReadOptions};
use matchbench::external::{BuiltIn, Manifest};
use matchbench::metrics::{Angle, load, load_errors};
use matchbench::records::store::{self, RecordWriter};
use matchbench::records::{MatchesFile, RunFolder, Tuned, authors};
use matchbench::study::Study;
use matchbench_vision::geometry::{Camera, MatchedPoints};
use matchbench_vision::image::Size;
use nalgebra::{Isometry3, Matrix3, Point2};

use archives::npz;
use sources::{MODEL_CAMERAS, SourceDoor, binary_cameras, source_doors, sources};

pub(crate) use sources::{intrinsics, scannet_list};

/// A door: its name, and what it does with bytes. It says whether they were accepted.
type Door = (&'static str, fn(&Doors, &[u8]) -> bool);

/// Offers bytes to a door, and says whether they were accepted.
pub(crate) fn offer(name: &str, bytes: &[u8]) -> bool {
    thread_local! {
        static HERE: Doors = Doors::new();
    }
    assert!(names().any(|door| door == name), "{name} is no door");
    let door = DOORS.iter().find(|(other, _)| *other == name);
    HERE.with(|doors| match door {
        Some((_, door)) => door(doors, bytes),
        None => doors.source(name, bytes),
    })
}

/// The names of all doors.
pub(crate) fn names() -> impl Iterator<Item = &'static str> {
    let doors = DOORS.iter().map(|(name, _)| *name);
    doors.chain(source_doors().map(|door| door.name))
}

/// All doors but those to sources.
const DOORS: &[Door] = &[
    ("image", |_, bytes| image(bytes)),
    ("depth", Doors::depth),
    ("records", Doors::records),
    ("matches", Doors::matches),
    ("plan", Doors::plan),
    ("results", Doors::results),
    ("pairs", Doors::pairs),
    ("camera", |doors, bytes| doors.dataset("camera.txt", bytes)),
    ("dataset.toml", |doors, bytes| {
        doors.dataset("dataset.toml", bytes)
    }),
    ("pose.txt", |doors, bytes| {
        doors.dataset("Images/pose.txt", bytes)
    }),
    ("homographies", |doors, bytes| {
        doors.dataset("homographies.txt", bytes)
    }),
    ("poses", Doors::poses),
    ("list of pairs", Doors::list_of_pairs),
    ("superglue", |doors, bytes| {
        doors.import("superglue", "list.txt", bytes)
    }),
    ("image pairs", |doors, bytes| {
        doors.import("image-pairs", "pairs_calibrated.txt", bytes)
    }),
    ("scannet", Doors::scannet),
    ("scannet intrinsics", Doors::intrinsics),
    ("megadepth", |doors, bytes| {
        doors.import("megadepth", "0015.npz", bytes)
    }),
    ("imc", |doors, bytes| {
        doors.import("imc", "train_labels.csv", bytes)
    }),
    ("colmap text", |doors, bytes| {
        doors.model("text", "images.txt", bytes)
    }),
    ("colmap binary", |doors, bytes| {
        doors.model("binary", "images.bin", bytes)
    }),
    ("matches of others", |doors, bytes| {
        doors.exchange(&[doors.file("0_1.txt", bytes)])
    }),
    ("features of others", |doors, bytes| {
        doors.exchange(&[
            doors.file("features.h5", bytes),
            doors.at("hloc/matches.h5"),
        ])
    }),
    ("cached features", |doors, bytes| {
        cache::features(&doors.at("cache"), bytes)
    }),
    ("cached keypoints", |doors, bytes| {
        cache::keypoints(&doors.at("cache"), bytes)
    }),
    ("tuned.json", Doors::tuned),
    ("manifest", Doors::manifest),
    ("run file", Doors::study),
    ("errors", Doors::errors),
    #[cfg(unix)]
    ("answers", Doors::answers),
    #[cfg(unix)]
    ("answered matches", Doors::answered_matches),
    #[cfg(unix)]
    ("answered features", Doors::answered_features),
];

/// A folder with a dataset and room for files.
pub(crate) struct Doors {
    folder: tempfile::TempDir,
}

impl Doors {
    /// Files go into memory where there is such a place.
    pub(crate) fn new() -> Self {
        let memory = Path::new("/dev/shm");
        let folder = if memory.is_dir() {
            tempfile::tempdir_in(memory)
        } else {
            tempfile::tempdir()
        };
        let doors = Self {
            folder: folder.expect("a temporary folder"),
        };
        for dataset in ["sound", "changed", "truth/sound"] {
            let at = |file: &str| doors.at(&format!("{dataset}/{file}"));
            fs::create_dir_all(at("Images")).expect("writable");
            fs::create_dir_all(at("Images/d")).expect("writable"); // of the labels of `imc`
            for image in [
                "0000.pgm",
                "0001.pgm",
                "0002.pgm",
                "d/0000.pgm",
                "d/0001.pgm",
            ] {
                let pixels = [&b"P5 4 3 255\n"[..], &[7; 12]].concat();
                fs::write(at(&format!("Images/{image}")), pixels).expect("writable");
            }
            fs::write(at("camera.txt"), CAMERA).expect("writable");
            fs::write(at("pairs.txt"), PAIRS).expect("writable");
        }
        for folder in ["run", "text", "binary", "results/sound", "source", "errors"] {
            fs::create_dir_all(doors.at(folder)).expect("writable");
        }
        fs::write(doors.at("text/cameras.txt"), MODEL_CAMERAS).expect("writable");
        fs::write(doors.at("binary/cameras.bin"), binary_cameras()).expect("writable");
        for (path, content) in sources() {
            let path = doors.at(path);
            fs::create_dir_all(path.parent().expect("a folder")).expect("writable");
            fs::write(path, content).expect("writable");
        }
        doors.exported("hloc");
        doors
    }

    /// Matches of two pairs in a format of other tools; returns the files.
    pub(crate) fn exported(&self, format: &str) -> Vec<PathBuf> {
        let sequence = Sequence::open(&self.at("truth/sound")).expect("it is sound");
        let points = |by: f64| (0..3).map(|i| Point2::new(f64::from(i), by)).collect();
        let pair = |frames| PairExport {
            frames,
            points: MatchedPoints::new(points(0.5), points(1.5), vec![0.25, 0.5, 0.75]),
            two_view: None,
        };
        let pairs = vec![pair((0, 1)), pair((1, 2))];
        let export = Export::new(&sequence, pairs).expect("images of some size");
        let format = Format::find(format).expect("a format");
        let folder = self.at(format.id);
        fs::create_dir_all(&folder).expect("writable");
        format.write(&folder, &export).expect("writable")
    }

    pub(crate) fn at(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    /// The path of a file with this content.
    fn file(&self, name: &str, bytes: &[u8]) -> PathBuf {
        let path = self.at(name);
        fs::write(&path, bytes).expect("writable");
        path
    }

    fn records(&self, bytes: &[u8]) -> bool {
        let Ok(records) = store::read(&self.file("records.jsonl", bytes)) else {
            return false;
        };
        let again = self.at("again.jsonl");
        let _ = fs::remove_file(&again);
        let mut writer = RecordWriter::open(&again).expect("writable");
        for record in &records {
            record.check().expect("what is read was checked");
            if let Some(pose) = record.outcome.pose() {
                assert!((pose.direction.norm() - 1.0).abs() < 1e-9);
            }
            if let Some(homography) = record.outcome.homography() {
                assert!(homography.try_inverse().is_some());
            }
            writer.append(record).expect("writable");
        }
        assert_eq!(store::read(&again).expect("it was written"), records);
        !records.is_empty()
    }

    fn matches(&self, bytes: &[u8]) -> bool {
        let Ok(file) = MatchesFile::open(&self.file("sift.bin", bytes)) else {
            return false;
        };
        let mut any = false;
        for key in [(0, 1, 0), (0, 1, 1), (0, 2, 0), (1, 2, 0)] {
            let Ok(Some(matches)) = file.read(key) else {
                continue;
            };
            any = true;
            let points = &matches.points;
            assert!(points.a.len() == points.b.len() && points.a.len() == points.ambiguity.len());
            for point in points.a.iter().chain(&points.b) {
                assert!(point.x.is_finite() && point.y.is_finite());
            }
            for column in points.turns.iter().chain(&points.growths) {
                assert!(column.len() == points.a.len() && column.iter().all(|v| v.is_finite()));
            }
            let again = self.at("again.bin");
            let _ = fs::remove_file(&again);
            let mut written = MatchesFile::open(&again).expect("there is none");
            written.append(key, &matches).expect("writable");
            let read = MatchesFile::open(&again).and_then(|file| file.read(key));
            assert_eq!(read.expect("it was written").as_ref(), Some(&matches));
        }
        any
    }

    fn plan(&self, bytes: &[u8]) -> bool {
        self.file("run/plan.json", bytes);
        let Ok(run) = RunFolder::open(&self.at("run")) else {
            return false;
        };
        assert_eq!(run.records().expect("there are none"), []);
        true
    }

    /// What a tuning found, which a run takes over.
    fn tuned(&self, bytes: &[u8]) -> bool {
        let Ok(tuned) = Tuned::read(&self.file("tuned.json", bytes)) else {
            return false;
        };
        let again = self.at("tuned-again.json");
        tuned.write(&again).expect("writable");
        assert_eq!(Tuned::read(&again).expect("it was written"), tuned);
        true
    }

    fn results(&self, bytes: &[u8]) -> bool {
        let file = self.file("results/sound/x.txt", bytes);
        for row in authors::read(&file).unwrap_or_default() {
            if let Some(pose) = row.b_from_a {
                assert!((pose.direction.norm() - 1.0).abs() < 1e-9, "{row:?}");
                assert!((pose.rotation.norm() - 1.0).abs() < 1e-9, "{row:?}");
            }
        }
        let Ok(sets) = load(&self.at("results"), Some(&self.at("truth"))) else {
            return false;
        };
        for pair in sets.iter().flat_map(|set| &set.pairs) {
            let Some(error) = pair.angular_error() else {
                continue;
            };
            for angle in [Some(error.rotation), error.translation]
                .into_iter()
                .flatten()
            {
                assert!((0.0..=180.0).contains(&angle), "{pair:?}");
            }
        }
        true
    }

    fn pairs(&self, bytes: &[u8]) -> bool {
        let Ok(pairs) = read_pairs(&self.file("changed/pairs.txt", bytes)) else {
            return false;
        };
        check_pairs(&pairs);
        if let Ok(sequence) = Sequence::open(&self.at("changed")) {
            check_sequence(&sequence);
        }
        true
    }

    /// A sound dataset but for one file.
    fn dataset(&self, name: &str, bytes: &[u8]) -> bool {
        let path = self.at("sound").join(name);
        let before = fs::read(&path).ok();
        fs::write(&path, bytes).expect("writable");
        let opened = Sequence::open(&self.at("sound"));
        match before {
            Some(before) => fs::write(&path, before).expect("writable"),
            None => fs::remove_file(&path).expect("it was just written"),
        }
        let Ok(sequence) = opened else { return false };
        check_sequence(&sequence);
        true
    }

    /// Depth of any size for an image of 4 x 3 pixels, in all four turns.
    fn depth(&self, bytes: &[u8]) -> bool {
        let unit = DepthUnit {
            invalid: Some(7),
            ..DepthUnit::MILLIMETRES
        };
        let file = DepthFile {
            path: self.file("depth.png", bytes),
            unit,
        };
        let mut any = false;
        for quarters in 0..4 {
            let turn = Turn::try_from(quarters).expect("a turn");
            let Ok(depth) = file.read(Size::new(4, 3), turn) else {
                continue;
            };
            any = true;
            assert!((0.0..=1.0).contains(&depth.coverage()));
            for place in [
                (0.0, 0.0),
                (1.7, 0.4),
                (-0.5, 2.5),
                (3.49, 3.49),
                (f64::NAN, 1.0),
            ] {
                let found = depth.at(Point2::new(place.0, place.1));
                assert!(found.is_none_or(|z| z > 0.0 && z.is_finite()), "{found:?}");
            }
        }
        any
    }

    fn poses(&self, bytes: &[u8]) -> bool {
        let options = ImportOptions {
            poses: Some(self.file("poses.txt", bytes)),
            camera: Some(self.at("truth/sound/camera.txt")),
            ..ImportOptions::default()
        };
        let source = self.at("truth/sound/Images");
        check_imported(read_source("folder", &source, &options).ok())
    }

    /// A list among four images.
    fn list_of_pairs(&self, bytes: &[u8]) -> bool {
        let file = self.file("list.txt", bytes);
        let camera = Camera::pinhole(4.0, 4.0, 1.5, 1.0);
        let frames = ["db/0.pgm", "db/1.pgm", "query/0.pgm", "query/a-1.pgm"]
            .map(|image| Frame::with_pose(image, camera, Isometry3::identity()));
        let Ok((frames, pairs)) = (PairRule::List { file }).apply(frames.into()) else {
            return false;
        };
        check_pairs(&pairs);
        let is_there = |pair: &Pair| (pair.a.max(pair.b) as usize) < frames.len();
        assert!(pairs.iter().all(is_there));
        true
    }

    fn import(&self, kind: &str, name: &str, bytes: &[u8]) -> bool {
        let source = self.file(&format!("source/{name}"), bytes);
        let options = ImportOptions {
            image_root: Some(self.at("truth/sound/Images")),
            ..ImportOptions::default()
        };
        check_imported(read_source(kind, &source, &options).ok())
    }

    /// LoFTR's list of ScanNet, whose intrinsics are sound.
    fn scannet(&self, bytes: &[u8]) -> bool {
        self.scannet_of(bytes, &intrinsics())
    }

    /// The array of the intrinsics of LoFTR's list of ScanNet, which is sound.
    fn intrinsics(&self, bytes: &[u8]) -> bool {
        self.scannet_of(&scannet_list(), bytes)
    }

    fn scannet_of(&self, list: &[u8], intrinsics: &[u8]) -> bool {
        let source = self.file("source/test.npz", list);
        let intrinsics = npz(&[("scene0707_00", intrinsics)]);
        let options = ImportOptions {
            intrinsics: Some(self.file("intrinsics.npz", &intrinsics)),
            ..ImportOptions::default()
        };
        check_imported(read_source("scannet", &source, &options).ok())
    }

    /// A table of errors of poses.
    fn errors(&self, bytes: &[u8]) -> bool {
        self.file("errors/x.txt", bytes);
        let Ok(sets) = load_errors(&self.at("errors")) else {
            return false;
        };
        for pair in sets.iter().flat_map(|set| &set.pairs) {
            let angles = [Angle::Pose, Angle::Rotation, Angle::Translation];
            for angle in angles.into_iter().filter_map(|angle| pair.error(angle)) {
                assert!((0.0..=180.0).contains(&angle), "{pair:?}");
            }
        }
        true
    }

    /// A model whose cameras are sound.
    fn model(&self, folder: &str, name: &str, bytes: &[u8]) -> bool {
        self.file(&format!("{folder}/{name}"), bytes);
        let options = ImportOptions {
            image_root: Some(self.at("truth/sound/Images")),
            ..ImportOptions::default()
        };
        check_imported(read_source("colmap", &self.at(folder), &options).ok())
    }

    /// A source of a dataset, sound but for the file of this door.
    fn source(&self, door: &str, bytes: &[u8]) -> bool {
        let SourceDoor { kind, file, .. } = source_door(door);
        let (path, sound) = (self.at(file), self.sound(door));
        fs::write(&path, bytes).expect("writable");
        let folder = file.split('/').next().expect("a folder");
        let imported = read_source(kind, &self.at(folder), &ImportOptions::default());
        fs::write(&path, sound).expect("writable");
        check_imported(imported.ok())
    }

    /// The file of a door to a source, as it is between offers.
    pub(crate) fn sound(&self, door: &str) -> Vec<u8> {
        fs::read(self.at(source_door(door).file)).expect("it is there")
    }

    fn exchange(&self, paths: &[PathBuf]) -> bool {
        let sequence = Sequence::open(&self.at("truth/sound")).expect("it is sound");
        let options = ReadOptions {
            pixel_center: Some(0.0),
            ..ReadOptions::default()
        };
        let Ok(files) = MatchFiles::open(paths, &sequence, &options) else {
            return false;
        };
        for pair in &sequence.pairs {
            let Ok(Some(matches)) = files.matches(pair.a, pair.b) else {
                continue;
            };
            let points = matches.points;
            for point in points.a.iter().chain(&points.b) {
                assert!(point.x.is_finite() && point.y.is_finite());
            }
        }
        true
    }

    fn manifest(&self, bytes: &[u8]) -> bool {
        let text = String::from_utf8_lossy(bytes);
        let built_in = BuiltIn {
            matchers: vec!["sift"],
            ..BuiltIn::default()
        };
        Manifest::parse(&self.at("matcher.toml"), &text, &built_in).is_ok()
    }

    fn study(&self, bytes: &[u8]) -> bool {
        let text = String::from_utf8_lossy(bytes);
        Study::parse(&text, &self.at("study.toml")).is_ok()
    }
}

/// The door to a source that has this name.
fn source_door(name: &str) -> SourceDoor {
    (source_doors().find(|door| door.name == name)).expect("it is listed")
}

fn image(bytes: &[u8]) -> bool {
    let Ok(image) = decode_gray(bytes) else {
        return false;
    };
    let size = image.size();
    assert_eq!(image.data().len(), size.area());
    let header = format!("P5 {} {} 255\n", size.width, size.height);
    let plain = [header.as_bytes(), image.data()].concat();
    if size.area() > 0 {
        assert!(decode_gray(&plain).is_ok_and(|again| again == image));
    }
    true
}

fn check_imported(imported: Option<Imported>) -> bool {
    let Some(imported) = imported else {
        return false;
    };
    for frame in &imported.frames {
        check_camera(&frame.camera);
        if let Some(pose) = &frame.world_from_camera {
            check_pose(pose);
        }
    }
    check_pairs(imported.pairs.as_deref().unwrap_or_default());
    true
}

fn check_sequence(sequence: &Sequence) {
    for frame in &sequence.frames {
        check_camera(&frame.camera);
    }
    for pair in &sequence.pairs {
        assert!((pair.a.max(pair.b) as usize) < sequence.frames.len());
    }
    check_pairs(&sequence.pairs);
}

fn check_pairs(pairs: &[Pair]) {
    for pair in pairs {
        assert_ne!(pair.a, pair.b);
        if let Some(pose) = pair.pose() {
            check_pose(pose);
        }
        if let Truth::Homography(homography) | Truth::Both { homography, .. } = &pair.truth {
            assert!(homography.iter().all(|x| x.is_finite()));
        }
    }
}

fn check_camera(camera: &Camera) {
    camera.check().expect("what is read was checked");
}

/// Finite, a rotation, and a translation whose length is a number.
fn check_pose(pose: &Isometry3<f64>) {
    let rotation = pose.rotation.to_rotation_matrix().into_inner();
    let off = rotation * rotation.transpose() - Matrix3::identity();
    assert!(off.iter().all(|x| x.abs() < 1e-9), "{pose:?}");
    assert!(rotation.determinant() > 0.0, "{pose:?}");
    assert!(pose.translation.vector.norm().is_finite(), "{pose:?}");
}

pub(crate) const CAMERA: &str = "4 0 1.5\n0 4 1\n0 0 1\n";
pub(crate) const PAIRS: &str = "0 1 1 0 0 -0.05 0 1 0 0 0 0 1 0\n0 2 1 0 0 -0.1 0 1 0 0 0 0 1 0\n1 2 0 -1 0 1 1 0 0 2 0 0 1 3\n";
