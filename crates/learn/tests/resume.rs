//! A run that is killed and started again ends with the bytes of one that was not.

use std::fmt::Write as _;
use std::fs;
use std::path::Path;
use std::process::{Command, Stdio};
use std::thread::sleep;
use std::time::{Duration, Instant};

/// A dataset in `folder`: three photographs of a wall of grey stones, from places side by side.
fn dataset(folder: &Path, stones: usize) {
    fs::create_dir_all(folder.join("Images")).expect("writable");
    let mut pairs = String::new();
    for a in 0..3 {
        let mut image = b"P5 160 120 255\n".to_vec();
        for y in 0..120 {
            image.extend((0..160).map(|x| {
                let (x, y) = ((x + 5 * a) / stones, y / 7);
                ((7919 * x + 104_729 * y) ^ (31 * x * y)) as u8
            }));
        }
        fs::write(folder.join(format!("Images/{a:04}.pgm")), image).expect("writable");
        for b in a + 1..3 {
            let shift = -0.05 * (b - a) as f64;
            writeln!(pairs, "{a} {b} 1 0 0 {shift} 0 1 0 0 0 0 1 0").expect("a string");
        }
    }
    fs::write(folder.join("camera.txt"), "100 0 79.5\n0 100 59.5\n0 0 1\n").expect("writable");
    fs::write(folder.join("pairs.txt"), pairs).expect("writable");
}

fn learn(folder: &Path, command: &str, out: &str) -> Command {
    let mut learn = Command::new(env!("CARGO_BIN_EXE_matchbench-learn"));
    learn.current_dir(folder).args(command.split(' '));
    learn.args(["--out", out]).stdout(Stdio::null());
    learn
}

/// Runs `command` into `stopped`, and kills it as soon as `begun` exists.
fn start_and_stop(folder: &Path, command: &str, begun: &str) {
    let mut run = learn(folder, command, "stopped")
        .spawn()
        .expect("it starts");
    let start = Instant::now();
    while !folder.join(begun).exists() {
        assert!(
            start.elapsed() < Duration::from_secs(60),
            "{command}: {begun} never came"
        );
        sleep(Duration::from_millis(1));
    }
    run.kill().expect("it runs");
    run.wait().expect("it was started");
}

/// Runs `command` once to its end, and once more with a stop as soon as `begun` exists.
fn unbroken_and_stopped(folder: &Path, command: &str, begun: &str, done: &str) {
    assert!(
        learn(folder, command, "unbroken")
            .status()
            .expect("it starts")
            .success()
    );
    start_and_stop(folder, command, begun);
    assert!(
        !folder.join(done).exists(),
        "{command}: was done before it could be stopped"
    );
    assert!(
        learn(folder, command, "stopped")
            .status()
            .expect("it starts")
            .success()
    );
    assert!(!folder.join(begun).exists(), "{command}: {begun} was left");
}

#[test]
fn a_killed_run_goes_on_and_ends_with_the_same_bytes() {
    let folder = tempfile::tempdir().expect("a folder");
    let folder = folder.path();
    for (name, stones) in [("wall", 9), ("floor", 8), ("door", 11)] {
        dataset(&folder.join(name), stones);
    }
    let same = |file: &str| {
        let read = |run: &str| fs::read(folder.join(format!("{run}{file}"))).expect(file);
        assert!(!read("unbroken").is_empty());
        assert!(read("unbroken") == read("stopped"), "{file} differs");
    };

    unbroken_and_stopped(
        folder,
        "patches --train wall floor --test door --blurred --warps 1",
        "stopped/unfinished/train-0/manifest.json",
        "stopped/manifest.json",
    );
    for file in [
        "patches-64.bin",
        "patches-32.bin",
        "sift.bin",
        "triplets.bin",
    ] {
        same(&format!("/train/{file}"));
        same(&format!("/test/{file}"));
    }
    same("/manifest.json");

    // One scene that is written in two ways is in two parts.
    let output = learn(
        folder,
        "patches --train wall --test ./floor/../wall",
        "shared",
    )
    .output();
    let message = String::from_utf8(output.expect("it starts").stderr).expect("text");
    assert!(message.contains("named twice (as wall)"), "{message}");
    // So is one place that is rendered twice, with other frames.
    let output = learn(
        folder,
        "patches --train rendered:cabinet --test rendered:cabinet-wide",
        "shared",
    )
    .output();
    let message = String::from_utf8(output.expect("it starts").stderr).expect("text");
    assert!(
        message.contains("rendered:cabinet-wide: shows the place of rendered:cabinet"),
        "{message}"
    );

    // A folder is in the way of the table that is made next.
    fs::rename(folder.join("unbroken"), folder.join("set")).expect("both are there");
    fs::remove_dir_all(folder.join("stopped")).expect("it is there");
    for (command, expected) in [
        ("bgm set --tries 0", "must be 1 at least"),
        ("bgm set --boxes 0", "must be 1 at least"),
        ("binboost set --pairs 1", "must be 2 at least"),
        ("binboost set --step nan", "must be above 0"),
        ("dlco set --gamma 0", "must be above 0"),
        ("dlco set --mu=-1", "must be 0 at least"),
        (
            "dlco set --values 7 --ring-triplets 20",
            "no pooling regions of at most 7 values",
        ),
    ] {
        let output = learn(folder, command, "none").output();
        let message = String::from_utf8(output.expect("it starts").stderr).expect("text");
        assert!(message.contains(expected), "{command}: {message}");
    }
    // A run that was stopped with more bits than the next one asks for.
    let bits = |bits: usize| format!("bgm set --bits {bits} --boxes 32 --tries 16");
    start_and_stop(folder, &bits(1600), "stopped.part");
    for table in ["unbroken", "stopped"] {
        let run = learn(folder, &bits(4), table).status();
        assert!(run.expect("it starts").success());
    }
    same("");
    for table in ["unbroken", "stopped"] {
        fs::remove_file(folder.join(table)).expect("it is there");
    }
    for command in [
        "binboost set --bits 240 --learners 4 --boxes 32 --tries 4",
        "bgm set --bits 1600 --boxes 32 --tries 16",
        "dlco set --values 128 --ring-triplets 50 --triplets 200 --principal 64 --dimensions 4 \
         --batch 50 --steps 100",
    ] {
        unbroken_and_stopped(folder, command, "stopped.part", "stopped");
        same("");
        for table in ["unbroken", "stopped"] {
            fs::remove_file(folder.join(table)).expect("it is there");
        }
    }
}
