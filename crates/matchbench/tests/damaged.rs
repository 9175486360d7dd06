//! Damaged files at every door: refused, or as promised.

mod doors;

use std::fs;
use std::panic::{AssertUnwindSafe, catch_unwind, resume_unwind};
use std::path::Path;

use doors::archives::{doubles, npz};
use doors::cache;
#[cfg(unix)]
use doors::children;
use doors::{CAMERA, Doors, PAIRS, intrinsics, names, offer, scannet_list};
use hdf5_writer::{DatasetBuilder, Hdf5Builder, WriteOptions};
use matchbench::cache::FeatureCache;
use matchbench::records::store::RecordWriter;
use matchbench::records::{
    ByDepth, Counts, MatchesFile, Outcome, RunRecord, SelectedMatches, StageTimes, Task,
};
use matchbench_vision::features::{BinaryRows, Descriptors, Features, FloatRows, Keypoint};
use matchbench_vision::geometry::{MatchedPoints, RelativePose};
use matchbench_vision::image::Size;
use matchbench_vision::seed::{Rng, Seed};
use nalgebra::{Isometry3, Point2, Vector3};

/// Sound files for a door.
fn corpus(doors: &Doors, door: &str) -> Vec<Vec<u8>> {
    let text = |texts: &[&str]| texts.iter().map(|text| text.as_bytes().to_vec()).collect();
    match door {
        "image" => {
            let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/images");
            let files = fs::read_dir(folder).expect("fixtures are part of the repository");
            let mut paths: Vec<_> = files.map(|file| file.expect("readable").path()).collect();
            paths.sort();
            paths
                .iter()
                .map(|path| fs::read(path).expect("readable"))
                .collect()
        }
        "depth" => vec![
            [b"P5 4 3 65535\n".to_vec(), [3, 232].repeat(12)].concat(),
            [b"P5 8 6 65535\n".to_vec(), [0, 7, 4, 0].repeat(24)].concat(),
            depth_png(),
            depth_hdf5(),
        ],
        "records" | "matches" | "plan" | "tuned.json" | "cached features" | "cached keypoints" => {
            own_files(doors, door)
        }
        "results" => text(&[
            "0 1 50 1 0 0 -0.05 0 1 0 0 0 0 1 0\n1 2 30 0 -1 0 1 1 0 0 2 0 0 1 3\n",
            "0 2 0 1 0 0 0 0 1 0 0 0 0 1 0\r\n",
        ]),
        "pairs" => text(&[PAIRS, "\u{feff}0 1 1 0 0 0 0 1 0 0 0 0 1 0\n# a word\n"]),
        "camera" => text(&[CAMERA, "4 0 1.5 0 4 1 0 0 1\n0.1 0.01 0 0 0.001\n"]),
        "dataset.toml" => text(&[
            "version = 1\norigin = \"a\"\nnotes = [\"b\"]\n\
             distortion = { k1 = 0.1, k2 = -0.2, p1 = 0.0, p2 = 0.0, k3 = 0.1 }\n",
            "version = 1\nname = \"other\"\nimage_root = \"Images\"\n[[frames]]\nimage = \"0000.pgm\"\n\
             camera = { fx = 4.0, fy = 4.0, cx = 1.5, cy = 1.0 }\n[[frames]]\nimage = \"0001.pgm\"\n\
             [[frames]]\nimage = \"0002.pgm\"\n",
            "version = 1\ndistortion = { k1 = 0.1, k2 = -0.2, k3 = 0.0, k4 = 0.1 }\n",
            "version = 1\nimage_root = \"Images\"\ndepth = { per_unit = 5000, invalid = 65535 }\n[[frames]]\n\
             image = \"0000.pgm\"\ndepth = \"0000.pgm\"\n[[frames]]\nimage = \"0001.pgm\"\n\
             [[frames]]\nimage = \"0002.pgm\"\n",
        ]),
        "pose.txt" => text(&[POSES_KITTI]),
        "homographies" => text(&["0 1 1 0 2 0 1 3 0 0 1\n1 2 1 0.1 2 0.2 1 3 0.001 0 1\n"]),
        "list of pairs" => text(&[
            "0 1\n3 2 0.5 of no use\n",
            "# hloc's\ndb/0.pgm db/1.pgm\nquery-0 db/1.pgm\n",
            "all/db/0.pgm all/query/a-1.pgm\r\n",
        ]),
        "poses" => text(&[
            POSES_KITTI,
            "0 0 0 0 0 0 0 1\n1 1 0 0 0 0 0.6 0.8\n2 1 2 3 1 0 0 0\n",
        ]),
        "superglue" => text(&[
            "0000.pgm 0001.pgm 0 0 4 0 1.5 0 4 1 0 0 1 4 0 1.5 0 4 1 0 0 1 1 0 0 1 0 1 0 2 0 0 1 3 0 0 0 1\n",
            "0001.pgm 0002.pgm 1 2 4 0 1.5 0 4 1 0 0 1 4 0 1.5 0 4 1 0 0 1 1 0 0 1 0 1 0 2 0 0 1 3 0 0 0 1\n",
        ]),
        "image pairs" => text(&IMAGE_PAIRS),
        "imc" => text(&["dataset,scene,image,rotation_matrix,translation_vector\n\
             d,s,0000.pgm,1;0;0;0;1;0;0;0;1,0;0;0\nd,s,0001.pgm,1;0;0;0;1;0;0;0;1,1;0;0\n"]),
        "scannet" => vec![scannet_list()],
        "scannet intrinsics" => vec![intrinsics()],
        "megadepth" => vec![include_bytes!("lists/megadepth.npz").to_vec()],
        "colmap text" => text(&[
            "# Image list\n1 1 0 0 0 0 0 0 1 0000.pgm\n1.5 1 7 2 2 -1\n2 0.6 0.8 0 0 1 0 0 1 0001.pgm\n1 1 7\n",
        ]),
        "colmap binary" => vec![colmap_images()],
        "features of others" => vec![fs::read(doors.at("hloc/features.h5")).expect("readable")],
        "matches of others" => text(&["1 1 2 2\n2 1 3 2\n", "# x y x y score\n1.5,1,2,2,0.5\n"])
            .into_iter()
            .chain([npz(&[("keypoints0", &doubles("(2, 2)", &[0.0; 4]))])])
            .chain(["npz", "packed", "glue-factory", "colmap"].map(|format| {
                let files = doors.exported(format);
                fs::read(&files[0]).expect("it was written")
            }))
            .collect(),
        "manifest" => text(&[
            "name = \"mine\"\nsummary = \"mine\"\nreference = \"a paper\"\n\
             command = [\"mine\", \"--flag\"]\n\n[params]\nmax_size = 640\n",
        ]),
        "run file" => text(&[
            "matchers = [\"sift\", \"orb\"]\nestimators = \"best\"\nrepeat = 2\n[set.best]\nthreshold_px = 2\n\
             [[dataset]]\npath = \"room\"\n",
        ]),
        "errors" => text(&[
            "R_err t_err\n0.5 1.25\n180 nan\n",
            "identifiers,pose_error\n\"room#0\",3.5\nroom#1,\n",
            "scene,a,b,pose_error\nroom,0,1,3.5\nroom,1,2,\n",
        ]),
        #[cfg(unix)]
        "answers" => text(&[
            &[children::READY, children::MATCHED].concat(),
            &[children::READY, "noise\n", children::MATCHED].concat(),
            &[children::READY, children::FAILED].concat(),
        ]),
        #[cfg(unix)]
        "answered matches" => vec![children::rows()],
        #[cfg(unix)]
        "answered features" => {
            vec![doubles("(2, 2)", &[0.5, 1.0, 3.0, 2.25])]
        }
        source => vec![doors.sound(source)],
    }
}

/// Sound files for a door to what this program wrote.
fn own_files(doors: &Doors, door: &str) -> Vec<Vec<u8>> {
    match door {
        "records" => vec![records(doors)],
        "matches" => vec![matches(doors)],
        "plan" => vec![PLAN.into()],
        "tuned.json" => vec![TUNED.into()],
        "cached features" => cached_features(doors),
        _ => vec![cached_keypoints(doors)],
    }
}

const IMAGE_PAIRS: [&str; 2] = [
    "0000.pgm 0001.pgm 4 0 2 0 4 1.5 0 0 1 4 0 2 0 4 1.5 0 0 1 1 0 0 0 1 0 0 0 1 1 2 3\n",
    "0001.pgm 0002.pgm 4 0 2 0 4 1.5 0 0 1 4 0 2 0 4 1.5 0 0 1 1 0 0 1 0 1 0 2 0 0 1 3 0 0 0 1\n",
];
const PLAN: &str = r#"{"format":2,"version":"0.1.0","settings":{"seed":0,"repetitions":1,"limit":null},
    "datasets":[{"name":"room","path":"/room","frames":3,"pairs":3,"fingerprint":"00"}],
    "matchers":[{"id":"sift","params":{},"extraction":null,
    "estimators":[{"id":"ransac-e","params":{"threshold_px":1.0}}]}]}"#;
const TUNED: &str = r#"{"setting":"sift.ratio=0.7","datasets":[{"name":"room","fingerprint":"00","images":["11"]}],
    "matchers":["sift"],"auc":[[0.7,0.5],[0.8,0.25]]}"#;
const POSES_KITTI: &str =
    "1 0 0 0 0 1 0 0 0 0 1 0\n0 -1 0 1 1 0 0 2 0 0 1 3\n1 0 0 5 0 1 0 0 0 0 1 0\n";

fn depth_png() -> Vec<u8> {
    let mut png = std::io::Cursor::new(Vec::new());
    let stored: Vec<u8> = (1..13_u16).flat_map(|i| (100 * i).to_ne_bytes()).collect();
    let (kind, format) = (image::ExtendedColorType::L16, image::ImageFormat::Png);
    image::write_buffer_with_format(&mut png, &stored, 4, 3, kind, format).expect("in memory");
    png.into_inner()
}

fn depth_hdf5() -> Vec<u8> {
    let values: Vec<f32> = (0..12_u8).map(|i| f32::from(i) / 2.0).collect();
    let array = DatasetBuilder::typed_data("depth", vec![3, 4], &values).expect("12 numbers");
    let plan = Hdf5Builder::default().dataset(array).into_plan();
    let bytes = plan.and_then(|plan| plan.encode(WriteOptions::default()));
    bytes.expect("in memory")
}

fn records(doors: &Doors) -> Vec<u8> {
    let path = doors.at("corpus.jsonl");
    let _ = fs::remove_file(&path);
    let mut writer = RecordWriter::open(&path).expect("writable");
    let motion = Isometry3::new(Vector3::new(1.0, 0.5, 0.0), Vector3::new(0.1, 0.2, 0.3));
    let pose = RelativePose::from_isometry(&motion).expect("it moves");
    let judged = Outcome::judged(&pose, &Isometry3::translation(1.0, 0.0, 0.0), 9, 12, 100);
    let failed = Outcome::Failed {
        reason: "cannot read x".into(),
        may_pass: true,
    };
    for (b, outcome) in [(1, judged), (2, failed)] {
        let record = RunRecord {
            task: Task {
                dataset: "room".into(),
                matcher: "sift".into(),
                estimator: "ransac-e".into(),
                a: 0,
                b,
                repetition: 0,
            },
            counts: Counts {
                selected: 12,
                ..Counts::default()
            },
            correct: None,
            repeated: None,
            by_depth: Some(ByDepth {
                overlap: Some(0.5),
                judged: 0,
                within: [0; 10],
                repeated: None,
            }),
            outcome,
            times: StageTimes {
                search: Some(0.25),
                ..StageTimes::default()
            },
            device: None,
        };
        writer.append(&record).expect("writable");
    }
    fs::read(path).expect("readable")
}

fn keypoints() -> Vec<Keypoint> {
    let keypoint = |x: u8| Keypoint {
        at: Point2::new(f32::from(x), 0.5),
        size: 3.5,
        angle: (x == 1).then_some(1.25),
        response: 0.1,
        octave: -1,
    };
    vec![keypoint(0), keypoint(1)]
}

/// Features with descriptors of bytes, of other real values, and of bits.
fn cached_features(doors: &Doors) -> Vec<Vec<u8>> {
    let folder = doors.at("cache");
    let floats = |data: &[f32]| Descriptors::Float(FloatRows::from_vec(2, data.to_vec()));
    let bits = Descriptors::Binary(BinaryRows::from_vec(70, vec![5, 1, u64::MAX, 0]));
    let kept = |features: Features| {
        let cache = FeatureCache::new(&folder);
        cache.save(cache::key(), &features).expect("writable");
        cache::content(&cache::file(&folder, "features"))
    };
    let all = [
        floats(&[0.0, 255.0, 17.0, 1.0]),
        floats(&[0.5, -1.0, 0.0, 2.0]),
        bits,
    ];
    let features = |descriptors| Features::new(Size::new(4, 3), keypoints(), descriptors);
    let framed = features(all[0].clone()).with_frames(vec![[1.5, 0.0, 0.5, 4.0]; 2]);
    let plain = all.into_iter().map(features);
    plain.chain([framed]).map(kept).collect()
}

fn cached_keypoints(doors: &Doors) -> Vec<u8> {
    let folder = doors.at("cache");
    let saved = FeatureCache::new(&folder).save_keypoints(cache::key(), &keypoints(), 0.25);
    saved.expect("writable");
    cache::content(&cache::file(&folder, "keypoints"))
}

fn matches(doors: &Doors) -> Vec<u8> {
    let path = doors.at("corpus.bin");
    let _ = fs::remove_file(&path);
    let mut file = MatchesFile::open(&path).expect("there is none");
    let points = |by: f64| {
        (0..3)
            .map(|i| Point2::new(by * f64::from(i), 1.0))
            .collect()
    };
    let points = MatchedPoints::new(points(1.5), points(0.1), vec![0.5; 3]);
    let counts = Counts {
        selected: 3,
        ..Counts::default()
    };
    let matches = SelectedMatches::new(counts, &points);
    for key in [(0, 1, 0), (0, 1, 1)] {
        file.append(key, &matches).expect("writable");
    }
    let columns = [vec![0.1, -2.0, 3.0], vec![0.7, 0.0, -0.7]].map(Some);
    let [turns, growths] = columns;
    let framed = points.with_turns(turns).with_growths(growths);
    let matches = SelectedMatches::new(counts, &framed);
    file.append((0, 2, 0), &matches).expect("writable");
    fs::read(path).expect("readable")
}

/// `images.bin` of COLMAP with two images.
fn colmap_images() -> Vec<u8> {
    let mut file = 2_u64.to_le_bytes().to_vec();
    for (id, name) in [(1_u32, "0000.pgm"), (2, "0001.pgm")] {
        file.extend(id.to_le_bytes());
        for number in [1.0, 0.0, 0.0, 0.0, f64::from(id), 0.0, 0.0] {
            file.extend(number.to_le_bytes());
        }
        file.extend(1_u32.to_le_bytes());
        file.extend(name.as_bytes());
        file.push(0);
        file.extend(1_u64.to_le_bytes());
        file.extend(1.5_f64.to_le_bytes());
        file.extend(1.0_f64.to_le_bytes());
        file.extend(7_u64.to_le_bytes());
    }
    file
}

/// Words that have broken parsers.
const WORDS: [&[u8]; 24] = [
    b"nan",
    b"inf",
    b"-inf",
    b"1e308",
    b"-1e308",
    b"1e154",
    b"1e999",
    b"1e-320",
    b"-0",
    b"-1",
    b"4294967295",
    b"4294967296",
    b"18446744073709551615",
    b"0x10",
    b"\xef\xbb\xbf",
    b"\0",
    b"\n",
    b"\r\n",
    b"\"",
    b"[[",
    b"\xff\xff\xff\xff",
    b"\x7f\xff\xff\xff",
    b"\x1b[2J",
    b" ",
];

/// One to four damages to a file.
fn damaged(sound: &[u8], rng: &mut Rng) -> Vec<u8> {
    let mut bytes = sound.to_vec();
    for _ in 0..=rng.below(4) {
        let at = rng.below(bytes.len() as u32 + 1) as usize;
        let to = (at + rng.below(9) as usize).min(bytes.len());
        match rng.below(7) {
            0 => bytes.truncate(at),
            1 if at < bytes.len() => bytes[at] ^= 1 << rng.below(8),
            2 if at < bytes.len() => bytes[at] = rng.below(256) as u8,
            3 => drop(bytes.splice(at..to, WORDS[rng.below(24) as usize].iter().copied())),
            4 => drop(bytes.drain(at..to)),
            5 => {
                let part = bytes[at..to].repeat(1 + rng.below(3) as usize);
                drop(bytes.splice(at..at, part));
            }
            _ => {
                // A word of the file becomes another.
                let is_space = |byte: &u8| byte.is_ascii_whitespace() || *byte == b',';
                let from = bytes[..at]
                    .iter()
                    .rposition(is_space)
                    .map_or(0, |space| space + 1);
                let end = bytes[from..].iter().position(is_space);
                let end = end.map_or(bytes.len(), |length| from + length);
                drop(bytes.splice(from..end, WORDS[rng.below(24) as usize].iter().copied()));
            }
        }
    }
    bytes
}

/// Offers so many damaged files to a door; returns how many it accepted.
fn try_door(name: &str, count: u64) -> u64 {
    let corpus = corpus(&Doors::new(), name);
    let mut accepted = 0;
    for number in 0..count {
        let mut rng = Seed(18).child(name).number(number).rng();
        let sound = &corpus[rng.below(corpus.len() as u32) as usize];
        let bytes = match corpus.get(number as usize) {
            Some(sound) => sound.clone(),
            None => damaged(sound, &mut rng),
        };
        match catch_unwind(AssertUnwindSafe(|| offer(name, &bytes))) {
            Ok(true) => accepted += 1,
            Ok(false) => {}
            Err(panic) => {
                println!(
                    "{name}, input {number}: {:?}",
                    String::from_utf8_lossy(&bytes)
                );
                resume_unwind(panic);
            }
        }
    }
    accepted
}

#[test]
fn what_any_door_lets_pass_is_as_promised() {
    for name in names() {
        assert!(try_door(name, 300) > 0, "{name} accepts nothing");
    }
}

/// `MATCHBENCH_INPUTS` says how many, `MATCHBENCH_DOOR` where, if not everywhere.
#[test]
#[ignore = "takes as long as is asked for"]
fn many_more() {
    let count = std::env::var("MATCHBENCH_INPUTS")
        .ok()
        .and_then(|count| count.parse().ok());
    let only = std::env::var("MATCHBENCH_DOOR").ok();
    for name in names() {
        if only.as_ref().is_none_or(|only| only == name) {
            let count = count.unwrap_or(10_000);
            println!("{name}: {count} inputs, {} accepted", try_door(name, count));
        }
    }
}

#[cfg(unix)] // where all doors are
#[test]
fn every_door_has_a_fuzz_target() {
    let fuzz = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../fuzz");
    let manifest = fs::read_to_string(fuzz.join("Cargo.toml")).expect("readable");
    for door in names() {
        let target = door.replace([' ', '.'], "_");
        let path = fuzz.join(format!("fuzz_targets/{target}.rs"));
        let program = fs::read_to_string(path).unwrap_or_default();
        assert!(
            program.contains(&format!("offer({door:?}, bytes)")),
            "{door}"
        );
        assert!(
            manifest.contains(&format!("path = \"fuzz_targets/{target}.rs\"")),
            "{door}"
        );
    }
    let targets = fs::read_dir(fuzz.join("fuzz_targets")).expect("readable");
    assert_eq!(targets.count(), names().count());
}

/// Writes the sound files of every door into a folder of `MATCHBENCH_CORPUS`, for a fuzzer.
#[test]
#[ignore = "writes where it is asked to"]
fn corpus_for_a_fuzzer() {
    let Some(folder) = std::env::var_os("MATCHBENCH_CORPUS") else {
        return;
    };
    for name in names() {
        let folder = Path::new(&folder).join(name.replace([' ', '.'], "_"));
        fs::create_dir_all(&folder).expect("writable");
        for (number, sound) in corpus(&Doors::new(), name).iter().enumerate() {
            fs::write(folder.join(number.to_string()), sound).expect("writable");
        }
    }
}
