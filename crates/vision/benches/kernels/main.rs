//! How fast features, searches, solvers and an estimator are with each set of instructions, and whether
//! all give the same answers.
//!
//! ```text
//! cargo bench -p matchbench-vision [-- NAME]
//! ```
//!
//! Runs itself once for each set of instructions that the processor has (`MATCHBENCH_SIMD`), by turns,
//! and prints the shortest time of each kernel in milliseconds and how many times faster than AVX2 the
//! widest set is. Images and descriptors are drawn from a seed. The answers of a search are compared
//! with the definition on some rows; all answers are compared between the sets, bit by bit. The exit
//! status is a failure if one differs. Times of one run on a machine at rest are comparable; nothing
//! fails because of them.

mod data;

use std::collections::BTreeMap;
use std::process::{Command, ExitCode};
use std::time::Instant;

use matchbench_vision::InstructionSet;
use matchbench_vision::features::{
    Akaze, AkazeParams, BinBoost, BinBoostParams, Brisk, BriskParams, Daisy, DaisyParams,
    Descriptors, DetectThenDescribe, Dlco, DlcoParams, DspSift, DspSiftParams, Extractor, Features,
    Freak, FreakParams, Kaze, KazeParams, Latch, LatchParams, Orb, OrbParams, Sift, SiftParams,
    Surf, SurfParams,
};
use matchbench_vision::geometry::PointPairs;
use matchbench_vision::geometry::solvers::{
    SAMPLES_AT_ONCE, five_point_of_each, homography, seven_point,
};
use matchbench_vision::image::{Size, gaussian_blur};
use matchbench_vision::matching::two_nearest;
use matchbench_vision::nalgebra::{Matrix3, Point2};
use matchbench_vision::robust::{PoseEstimator, SampleConsensus, TwoViews, presets};
use matchbench_vision::seed::Seed;

/// Times that every process is started for each set.
const ROUNDS: usize = 3;

/// Set in the processes that measure.
const CHILD: &str = "MATCHBENCH_BENCH_CHILD";

fn main() -> ExitCode {
    let filter: Vec<String> = std::env::args().skip(1).collect();
    let filter = filter.iter().find(|argument| !argument.starts_with('-'));
    let chosen = |name: &str| filter.is_none_or(|filter| name.contains(filter.as_str()));
    if std::env::var_os(CHILD).is_some() {
        measure(&chosen);
        return ExitCode::SUCCESS;
    }
    compare(filter.map(String::as_str))
}

/// Prints `name milliseconds hash` for each chosen kernel.
fn measure(chosen: &impl Fn(&str) -> bool) {
    let image = data::texture(Size::new(640, 480));
    for (name, extractor) in extractors().iter().filter(|(name, _)| chosen(name)) {
        let (milliseconds, features) = shortest(|| extractor.extract(&image));
        assert!(
            features.len() > 100,
            "{name} finds {} features",
            features.len()
        );
        println!("{name} {milliseconds} {:016x}", hash_of_features(&features));
    }
    let searches = [
        ("hamming-256", data::bits(256, 3000)),
        ("hamming-512", data::bits(512, 3000)),
        ("l2-128", data::values(128, 3000)),
    ];
    for (name, rows) in searches.iter().filter(|(name, _)| chosen(name)) {
        let [a, b] = rows;
        // The second search and those after it, for which the first has prepared the candidates.
        let (milliseconds, matches) = shortest(|| two_nearest(a, b));
        for found in matches.iter().step_by(100) {
            let expected = data::defined(a, b, found.a);
            assert_eq!(*found, expected, "{name}: not the definition");
        }
        let words = matches.iter().flat_map(|m| {
            let distances = [m.distance, m.second].map(f32::to_bits);
            [m.a, m.b, distances[0], distances[1]]
        });
        println!("{name} {milliseconds} {:016x}", hash(words));
    }
    if chosen("blur") {
        let grey = image.map(|&grey| f32::from(grey));
        let (milliseconds, blurred) = shortest(|| gaussian_blur(&grey, 1.6));
        let words = blurred.data().iter().map(|value| value.to_bits());
        println!("blur {milliseconds} {:016x}", hash(words));
    }
    measure_poses(chosen);
}

/// The same for solvers, a thousand calls each, and for an estimator.
fn measure_poses(chosen: &impl Fn(&str) -> bool) {
    let (points, camera) = data::two_views(1000);
    let pairs = points.at_depth_1(&camera, &camera);
    let models: [(&str, Models<'_>); 3] = [
        (
            "five-point",
            // Eight samples at every eighth call.
            Box::new(|i| {
                let samples = (i..i + SAMPLES_AT_ONCE).map(|i| sample(&pairs, i));
                let samples: Vec<_> = samples.filter(|_| i % SAMPLES_AT_ONCE == 0).collect();
                let mut found = Vec::new();
                five_point_of_each(&samples, false, &mut found);
                found.iter().flat_map(|models| models.to_vec()).collect()
            }),
        ),
        (
            "seven-point",
            Box::new(|i| {
                let [a, b] = sample(&pairs, i);
                seven_point(&a, &b).to_vec()
            }),
        ),
        (
            "homography",
            Box::new(|i| {
                let [a, b] = sample(&pairs, i);
                homography(&a, &b).into_iter().collect()
            }),
        ),
    ];
    for (name, solve) in models.iter().filter(|(name, _)| chosen(name)) {
        let all = || (0..1000).flat_map(solve).collect::<Vec<_>>();
        let (milliseconds, found) = shortest(all);
        assert!(found.len() > 100, "{name} finds {} models", found.len());
        let values = found.iter().flat_map(|model| model.iter().copied());
        println!(
            "{name} {milliseconds} {:016x}",
            hash(values.flat_map(halves))
        );
    }
    if chosen("best") {
        let estimator = SampleConsensus::new(presets::best()).expect("a preset");
        let views = TwoViews {
            points: &points,
            camera_a: &camera,
            camera_b: &camera,
        };
        let run = || {
            estimator
                .estimate(views, Seed(1))
                .expect("three quarters are right")
        };
        let (milliseconds, found) = shortest(run);
        assert!(found.inliers.len() > 700, "{} inliers", found.inliers.len());
        let direction = found.b_from_a.direction;
        let rotation = found.b_from_a.rotation.coords;
        let values = direction.iter().chain(rotation.iter()).copied();
        println!("best {milliseconds} {:016x}", hash(values.flat_map(halves)));
    }
}

/// A solver at the matches from a number on.
type Models<'a> = Box<dyn Fn(usize) -> Vec<Matrix3<f64>> + 'a>;

/// The matches from number `first` on, as many as a solver takes; after the last comes the first.
fn sample<const N: usize>(pairs: &PointPairs, first: usize) -> [[Point2<f64>; N]; 2] {
    let number = |k: usize| (first + k) % pairs.len();
    [
        std::array::from_fn(|k| Point2::new(pairs.a_x[number(k)], pairs.a_y[number(k)])),
        std::array::from_fn(|k| Point2::new(pairs.b_x[number(k)], pairs.b_y[number(k)])),
    ]
}

fn halves(value: f64) -> [u32; 2] {
    let bits = value.to_bits();
    [bits as u32, (bits >> 32) as u32]
}

/// Each with its defaults.
fn extractors() -> Vec<(&'static str, Box<dyn Extractor>)> {
    macro_rules! by_default {
        ($($name:literal $new:expr, $params:expr;)*) => {
            vec![$(($name, Box::new($new($params).expect("defaults are in range")) as Box<dyn Extractor>)),*]
        };
    }
    /// Describers work on the keypoints of SIFT.
    macro_rules! on_sift {
        ($($name:literal $new:expr, $params:expr;)*) => {
            [$(($name, Box::new(DetectThenDescribe {
                detector: Sift::new(SiftParams::default()).expect("defaults are in range"),
                describer: $new($params).expect("defaults are in range"),
            }) as Box<dyn Extractor>)),*]
        };
    }
    let mut all = by_default! {
        "sift" Sift::new, SiftParams::default();
        "dsp-sift" DspSift::new, DspSiftParams::default();
        "surf" Surf::new, SurfParams::default();
        "orb" Orb::new, OrbParams::default();
        "brisk" Brisk::new, BriskParams::default();
        "kaze" Kaze::new, KazeParams::default();
        "akaze" Akaze::new, AkazeParams::default();
    };
    all.extend(on_sift! {
        "freak-sift" Freak::new, FreakParams::default();
        "latch" Latch::new, LatchParams::default();
        "daisy" Daisy::new, DaisyParams::default();
        "dlco" Dlco::new, DlcoParams::default();
        "binboost" BinBoost::new, BinBoostParams::default();
    });
    all
}

/// Starts the processes that measure, and prints their table.
fn compare(filter: Option<&str>) -> ExitCode {
    let widest = InstructionSet::widest();
    let sets = InstructionSet::ALL.into_iter().filter(|&set| set <= widest);
    let sets: Vec<InstructionSet> = sets.collect();
    // Of each kernel, in the order of the sets: the shortest time and the answers' hash.
    let mut kernels: BTreeMap<String, Vec<(f64, String)>> = BTreeMap::new();
    let program = std::env::current_exe().expect("the path of this program");
    for round in 0..ROUNDS {
        for (number, set) in sets.iter().enumerate() {
            let mut command = Command::new(&program);
            let command = command.args(filter).env(CHILD, "1");
            let output = command.env("MATCHBENCH_SIMD", set.name()).output();
            let output = output.expect("this program can be started");
            if !output.status.success() {
                eprintln!(
                    "{}: {}",
                    set.name(),
                    String::from_utf8_lossy(&output.stderr)
                );
                return ExitCode::FAILURE;
            }
            for line in String::from_utf8_lossy(&output.stdout).lines() {
                let fields: Vec<&str> = line.split(' ').collect();
                let [name, milliseconds, hash] = fields[..] else {
                    panic!("three fields in `{line}`");
                };
                let times = kernels.entry(name.to_owned()).or_default();
                let time: f64 = milliseconds.parse().expect("a number");
                if round == 0 {
                    times.push((time, hash.to_owned()));
                } else {
                    times[number].0 = times[number].0.min(time);
                }
            }
        }
    }
    print!("{:<12}", "ms");
    for set in &sets {
        print!("{:>10}", set.name());
    }
    println!("  gain over avx2  answers");
    let mut equal = true;
    for (name, times) in &kernels {
        print!("{name:<12}");
        for (time, _) in times {
            print!("{time:>10.2}");
        }
        let avx2 = sets.iter().position(|&set| set == InstructionSet::Avx2);
        let gain = avx2.map(|avx2| times[avx2].0 / times[times.len() - 1].0);
        let same = times.iter().all(|(_, hash)| *hash == times[0].1);
        let gain = gain.map_or_else(|| "-".into(), |gain| format!("{gain:.2}"));
        println!("{gain:>16}  {}", if same { "equal" } else { "DIFFER" });
        equal &= same;
    }
    if equal && !kernels.is_empty() {
        ExitCode::SUCCESS
    } else {
        ExitCode::FAILURE
    }
}

/// The shortest time of some runs in milliseconds, and what the last returned.
fn shortest<T>(mut run: impl FnMut() -> T) -> (f64, T) {
    let begin = Instant::now();
    let mut least = f64::INFINITY;
    loop {
        let start = Instant::now();
        let result = run();
        least = least.min(start.elapsed().as_secs_f64() * 1e3);
        if begin.elapsed().as_secs_f64() > 0.5 {
            return (least, result);
        }
    }
}

fn hash_of_features(features: &Features) -> u64 {
    let keypoints = features.keypoints.iter().flat_map(|k| {
        let angle = k.angle.unwrap_or(-1.0);
        let values = [k.at.x, k.at.y, k.size, angle, k.response].map(f32::to_bits);
        values.into_iter().chain([k.octave as u32])
    });
    let descriptors: Vec<u32> = match &features.descriptors {
        Descriptors::Float(rows) => rows.data().iter().map(|v| v.to_bits()).collect(),
        Descriptors::Binary(rows) => {
            let words = rows.data().iter();
            words.flat_map(|w| [*w as u32, (w >> 32) as u32]).collect()
        }
    };
    hash(keypoints.chain(descriptors))
}

/// FNV-1a over words.
fn hash(words: impl IntoIterator<Item = u32>) -> u64 {
    words.into_iter().fold(0xcbf2_9ce4_8422_2325, |hash, word| {
        (hash ^ u64::from(word)).wrapping_mul(0x0000_0100_0000_01b3)
    })
}
