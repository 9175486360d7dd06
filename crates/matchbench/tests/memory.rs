//! Matchers say beforehand about how much memory an image takes; here it is measured.
#![cfg(target_os = "linux")]

use std::process::Command;
use std::{env, fs};

use matchbench::matchers::{MATCHERS, build, find};
use matchbench_vision::image::{GrayImage, Size};
use matchbench_vision::seed::Seed;

/// Names the matcher that a child process is to measure, its parameters, and width and height of the image.
const MATCHER: &str = "MATCHBENCH_TEST_MATCHER";
const PARAMS: &str = "MATCHBENCH_TEST_PARAMS";
const IMAGE: [&str; 2] = ["MATCHBENCH_TEST_WIDTH", "MATCHBENCH_TEST_HEIGHT"];
const SIZE: Size = Size {
    width: 1000,
    height: 700,
};
/// What a process takes whatever the size of the image, and what its allocator keeps.
const BESIDE: f64 = 8e6;

/// A wall of small patches with a little noise.
fn wall(size: Size) -> GrayImage {
    let mut rng = Seed(5).rng();
    let patches: Vec<u8> = (0..10_007).map(|_| 40 + rng.below(170) as u8).collect();
    GrayImage::from_fn(size, |x, y| {
        let patch = (x / 9 * 7919 + y / 7 * 104_729) % patches.len();
        patches[patch] + rng.below(6) as u8
    })
}

fn status(field: &str) -> f64 {
    let text = fs::read_to_string("/proc/self/status").expect("a file of Linux");
    let line = text.lines().find(|line| line.starts_with(field));
    let number = line.and_then(|line| line.split_whitespace().nth(1));
    let kibibytes: f64 = number.expect("it is there").parse().expect("a number");
    1024.0 * kibibytes
}

/// The rest of the file calls this one in a process of its own, whose peak is that of one extraction.
#[test]
#[ignore = "the other tests run it"]
fn child() {
    let Ok(id) = env::var(MATCHER) else { return };
    let entry = find(&id).expect("it is listed");
    let given = |name| env::var(name).expect("given with the matcher");
    let params = serde_json::from_str(&given(PARAMS)).expect("JSON");
    let built = build(entry, Some(&params)).expect("they are in range");
    let matcher = built.matcher;
    let [width, height] = IMAGE.map(|name| given(name).parse().expect("a number"));
    let image = wall(Size::new(width, height));
    let said = matcher.extraction_memory(image.size()) as f64;
    fs::write("/proc/self/clear_refs", "5").expect("Linux resets the peak");
    let before = status("VmRSS");
    let features = matcher.extract(&image).expect("it cannot fail");
    assert!(!features.is_empty() || height < 100, "strips have none");
    println!("\n{MATCHER} {said} {}", status("VmHWM") - before);
}

/// What a matcher says, and what it takes, in bytes.
fn measure(id: &str, params: &str, size: Size) -> (f64, f64) {
    let output = Command::new(env::current_exe().expect("it runs"))
        .args(["--exact", "child", "--ignored", "--nocapture"])
        .env(MATCHER, id)
        .env(PARAMS, params)
        .envs(
            IMAGE
                .into_iter()
                .zip([size.width, size.height].map(|v| v.to_string())),
        )
        .env("RAYON_NUM_THREADS", "1")
        // What was freed is given back at once, so that the peak is that of what is in use.
        .env("MALLOC_ARENA_MAX", "1")
        .env("MALLOC_MMAP_THRESHOLD_", "131072")
        .output()
        .expect("it starts");
    let text = String::from_utf8_lossy(&output.stdout);
    let line = text.lines().find_map(|line| line.strip_prefix(MATCHER));
    let line = line.unwrap_or_else(|| panic!("{id}: {}", String::from_utf8_lossy(&output.stderr)));
    let mut numbers = line
        .split_whitespace()
        .map(|number| number.parse().expect("a number"));
    let mut next = || numbers.next().expect("two numbers");
    (next(), next())
}

fn near_the_truth(id: &str, params: &str, size: Size) {
    let (said, taken) = measure(id, params, size);
    let area = size.area() as f64;
    let id = format!("{id} {params} {size}");
    println!(
        "{id}: said {:.1}, taken {:.1} bytes a pixel",
        said / area,
        taken / area
    );
    assert!(
        taken < 1.1 * said + BESIDE,
        "{id}: {taken} taken, {said} said"
    );
    assert!(
        said < 2.0 * taken + BESIDE,
        "{id}: {taken} taken, {said} said"
    );
}

#[test]
fn what_is_said_is_near_what_is_taken() {
    for id in ["sift", "orb", "kaze", "akaze"] {
        near_the_truth(id, "{}", SIZE);
    }
}

/// Rows and columns beyond the borders of a strip take more than its pixels.
#[test]
fn what_is_said_of_strips_is_near_what_is_taken() {
    near_the_truth("kaze", "{}", Size::new(600_000, 1));
    near_the_truth("akaze", "{}", Size::new(300_000, 3));
}

#[test]
fn parameters_that_find_more_features_are_known_to_take_more() {
    let sift = r#"{"extractor": {"octave_layers": 16, "contrast_threshold": 0.0}}"#;
    near_the_truth("sift", sift, SIZE);
    near_the_truth(
        "sift",
        r#"{"extractor": {"sigma": 0.5}}"#,
        Size::new(1500, 1000),
    );
    let orb = r#"{"extractor": {"features": 1000000}}"#;
    near_the_truth("orb", orb, Size::new(3000, 2500));
}

#[test]
#[ignore = "takes minutes"]
fn what_any_matcher_says_is_near_what_it_takes() {
    for entry in MATCHERS {
        near_the_truth(entry.id(), "{}", SIZE);
    }
}
