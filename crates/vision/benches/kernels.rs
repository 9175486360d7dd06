//! How fast the main extractors and searches are with each set of instructions, and whether all give
//! the same answers.
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

use std::collections::BTreeMap;
use std::process::{Command, ExitCode};
use std::time::Instant;

use matchbench_vision::InstructionSet;
use matchbench_vision::features::{
    Akaze, AkazeParams, BinaryRows, Brisk, BriskParams, Descriptors, Extractor, Features,
    FloatRows, Orb, OrbParams, Sift, SiftParams,
};
use matchbench_vision::image::{GrayImage, Size};
use matchbench_vision::matching::{Correspondence, two_nearest};
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
    let image = texture(Size::new(640, 480));
    let extractors: [(&str, Box<dyn Extractor>); 4] = [
        (
            "sift",
            Box::new(Sift::new(SiftParams::default()).expect("in range")),
        ),
        (
            "orb",
            Box::new(Orb::new(OrbParams::default()).expect("in range")),
        ),
        (
            "brisk",
            Box::new(Brisk::new(BriskParams::default()).expect("in range")),
        ),
        (
            "akaze",
            Box::new(Akaze::new(AkazeParams::default()).expect("in range")),
        ),
    ];
    for (name, extractor) in extractors.iter().filter(|(name, _)| chosen(name)) {
        let (milliseconds, features) = shortest(|| extractor.extract(&image));
        assert!(
            features.len() > 100,
            "{name} finds {} features",
            features.len()
        );
        println!("{name} {milliseconds} {:016x}", hash_of_features(&features));
    }
    let searches = [
        ("hamming-256", bits(256, 3000)),
        ("hamming-512", bits(512, 3000)),
        ("l2-128", values(128, 3000)),
    ];
    for (name, rows) in searches.iter().filter(|(name, _)| chosen(name)) {
        let [a, b] = rows;
        let (milliseconds, matches) = shortest(|| two_nearest(a, b));
        for found in matches.iter().step_by(100) {
            assert_eq!(*found, defined(a, b, found.a), "{name}: not the definition");
        }
        let words = matches.iter().flat_map(|m| {
            let distances = [m.distance, m.second].map(f32::to_bits);
            [m.a, m.b, distances[0], distances[1]]
        });
        println!("{name} {milliseconds} {:016x}", hash(words));
    }
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

/// Boxes and blobs of all sizes over each other, and noise.
fn texture(size: Size) -> GrayImage {
    let mut rng = Seed(23).rng();
    let mut image = GrayImage::filled(size, 128);
    for _ in 0..1500 {
        let side = (3.0 / (0.02 + rng.uniform())) as usize;
        let (x, y) = (rng.below(size.width as u32), rng.below(size.height as u32));
        let (grey, round) = (rng.below(256) as u8, rng.below(2) == 0);
        for dy in 0..side.min(size.height - y as usize) {
            for dx in 0..side.min(size.width - x as usize) {
                let from_middle = [dx, dy].map(|v| 2.0 * v as f64 / side as f64 - 1.0);
                if !round || from_middle[0].hypot(from_middle[1]) <= 1.0 {
                    image.set(x as usize + dx, y as usize + dy, grey);
                }
            }
        }
    }
    image.map(|&grey| grey.saturating_add(rng.below(9) as u8))
}

/// Two sets of random bits, of which each row of the first is near to one of the second.
fn bits(length: usize, rows: usize) -> [Descriptors; 2] {
    let mut rng = Seed(24).rng();
    let mut word = || u64::from(rng.next_u32()) << 32 | u64::from(rng.next_u32());
    let b: Vec<u64> = (0..rows * length / 64).map(|_| word()).collect();
    let a = b.iter().map(|b| b ^ (word() & word() & word())).collect();
    [a, b].map(|data| Descriptors::Binary(BinaryRows::from_vec(length, data)))
}

/// Two sets of rows of bytes, of which each row of the first is near to one of the second.
fn values(dim: usize, rows: usize) -> [Descriptors; 2] {
    let mut rng = Seed(25).rng();
    let mut draw = |width: f64| (width * rng.uniform()).floor() as f32;
    let b: Vec<f32> = (0..rows * dim).map(|_| draw(150.0)).collect();
    let a = b.iter().map(|b| b + draw(40.0)).collect();
    [a, b].map(|data| Descriptors::Float(FloatRows::from_vec(dim, data)))
}

/// The definition of a search, for one row of `a`.
fn defined(a: &Descriptors, b: &Descriptors, row: u32) -> Correspondence {
    let distances: Vec<f32> = match (a, b) {
        (Descriptors::Binary(a), Descriptors::Binary(b)) => (0..b.len())
            .map(|i| {
                let words = a.row(row as usize).iter().zip(b.row(i));
                words.map(|(a, b)| (a ^ b).count_ones()).sum::<u32>() as f32
            })
            .collect(),
        (Descriptors::Float(a), Descriptors::Float(b)) => (0..b.len())
            .map(|i| {
                let values = a.row(row as usize).iter().zip(b.row(i));
                values
                    .fold(0.0_f32, |sum, (a, b)| (a - b).mul_add(a - b, sum))
                    .sqrt()
            })
            .collect(),
        _ => unreachable!("both are of one kind"),
    };
    let mut order: Vec<usize> = (0..distances.len()).collect();
    order.sort_by(|&i, &j| distances[i].total_cmp(&distances[j]));
    Correspondence {
        a: row,
        b: order[0] as u32,
        distance: distances[order[0]],
        second: distances[order[1]],
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
