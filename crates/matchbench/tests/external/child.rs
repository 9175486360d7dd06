//! The child: a program that does as it should, or misbehaves as its environment says.

use std::env;
use std::fs;
use std::io::{self, BufRead, Write};
use std::os::unix::process::CommandExt;
use std::process::Command;
use std::time::Duration;

use serde_json::{Value, json};

/// A behaviour: of the child with this name, when it is asked for this pair.
pub(crate) const BEHAVIOUR: &str = "MATCHBENCH_TEST_CHILD";
/// Features of an image.
pub(crate) const MANY: usize = 600;
/// Where the child writes its process number, a line for each start.
pub(crate) const STARTS: &str = "MATCHBENCH_TEST_STARTS";

/// A child that does as it should, unless it is asked for a pair with `b` = 13.
#[test]
#[ignore = "started by the other tests"]
fn child() {
    let behaviour = env::var(BEHAVIOUR).unwrap_or_default();
    let starts = env::var(STARTS).expect("set by the parent");
    let mut starts = (fs::OpenOptions::new()
        .append(true)
        .create(true)
        .open(starts))
    .expect("can be written");
    // At once, since others write there too.
    let line = format!("{}\n", std::process::id());
    starts.write_all(line.as_bytes()).expect("can be written");
    eprintln!("loading weights ...");
    // The harness may have begun a line.
    println!("\nnoise {{\"no\": \"type\"}}\n{{\"no\": \"type\"}}");
    let mut answers = 0;
    for line in io::stdin().lock().lines() {
        let request: Value = serde_json::from_str(&line.expect("UTF-8")).expect("JSON");
        let unlucky = request["pair"][1] == 13;
        match request["type"].as_str() {
            Some("hello") => match behaviour.as_str() {
                "never-ready" => sleep(),
                "ends-at-once" => {
                    eprintln!("ModuleNotFoundError: No module named 'weights'");
                    std::process::exit(3);
                }
                "refuses" => say(&json!({"type": "refused", "reason": "no parameter `x`"})),
                "other-protocol" => say(&ready(2, "1", 0.0)),
                "odd-pixels" => say(&ready(1, "1", 0.25)),
                "new-version" => say(&ready(1, &std::process::id().to_string(), 0.0)),
                _ => say(&ready(1, "1.0", 0.5)),
            },
            Some("match") if unlucky || behaviour == "always-ends" => {
                misbehave(&behaviour, &request);
            }
            Some("match") => {
                if behaviour == "stays" {
                    // Long enough for others to be asked meanwhile.
                    std::thread::sleep(Duration::from_millis(500));
                }
                write_matches(&request, &[[10.5, 20.5, 30.5, 40.5, 0.25], [1.0; 5]]);
                say(&matched(&request, 2));
                answers += 1;
                if behaviour == "answers-twice" && request["pair"][1] == 12 {
                    say(&matched(&request, 2));
                }
            }
            Some("describe") => {
                write_features(&request);
                say(&json!({"type": "described", "image": request["image"], "count": MANY}));
            }
            Some("bye") if behaviour == "stays" => sleep(),
            Some("bye") => {
                eprintln!("goodbye after {answers} answers");
                return;
            }
            other => panic!("{other:?}"),
        }
    }
}

fn misbehave(behaviour: &str, request: &Value) {
    match behaviour {
        "hangs" => sleep(),
        "always-ends" | "ends" => std::process::exit(0),
        "crashes" => std::process::abort(),
        "leaves-another" => {
            // It has this program's output, and its group is another.
            let mut other = Command::new("sleep");
            (other.arg("60").process_group(0).spawn()).expect("there is `sleep`");
            std::process::exit(1);
        }
        "floods" => {
            let line = vec![b'x'; 1 << 16];
            for _ in 0..64 {
                io::stdout().write_all(&line).expect("the parent reads");
            }
            sleep();
        }
        "chatters" => (0..200_000).for_each(|i| println!("still working on it: {i}")),
        "no-json" => {
            println!("{{\"type\":\"matched\",\"count\":NaN}}");
            sleep();
        }
        "counts-wrong" => {
            write_matches(request, &[[1.0; 5]]);
            say(&matched(request, 2));
        }
        "too-few-features" => {
            write_matches(request, &[[1.0; 5]]);
            let mut answer = matched(request, 1);
            answer["features"] = json!([0, 8]);
            say(&answer);
        }
        "keeps-writing" => {
            write_matches(request, &[[1.0; 5]; 3]);
            let path = request["out"].as_str().expect("a path");
            let mut file = (fs::OpenOptions::new().append(true).open(path)).expect("it is there");
            say(&matched(request, 2));
            // Until somebody ends it.
            loop {
                file.write_all(&[0; 100]).expect("can be written");
                std::thread::sleep(Duration::from_millis(1));
            }
        }
        "writes-nothing" => say(&matched(request, 2)),
        "not-a-number" => {
            write_matches(request, &[[1.0, f32::NAN, 1.0, 1.0, 0.0]]);
            say(&matched(request, 1));
        }
        "outside" => {
            write_matches(request, &[[1.0, 481.0, 1.0, 1.0, 0.0]]);
            say(&matched(request, 1));
        }
        "too-certain" => {
            write_matches(request, &[[1.0, 1.0, 1.0, 1.0, -0.1]]);
            say(&matched(request, 1));
        }
        "other-pair" => {
            write_matches(request, &[]);
            let mut answer = matched(request, 0);
            answer["pair"] = json!([0, 99]);
            say(&answer);
        }
        "misspells" => {
            let mut answer = matched(request, 0);
            answer["feature"] = json!([1, 2]);
            say(&answer);
        }
        "negative-time" => {
            let mut answer = matched(request, 0);
            answer["seconds"] = json!({"match": -1.0});
            say(&answer);
        }
        "endless-time" => {
            let mut answer = matched(request, 0);
            answer["seconds"] = json!({"extract": 1e308, "match": 1e308});
            say(&answer);
        }
        "extracts-three" => {
            let mut answer = matched(request, 0);
            answer["extracted"] = json!(3);
            say(&answer);
        }
        "greets-again" => say(&ready(1, "1.0", 0.5)),
        "cannot" => {
            say(&json!({"type": "failed", "pair": request["pair"], "reason": "no\x07 memory"}));
        }
        "gives-no-reason" => {
            say(&json!({"type": "failed", "pair": request["pair"], "reason": " "}));
        }
        other => panic!("no behaviour is called {other}"),
    }
}

fn ready(protocol: u32, version: &str, pixel_center: f32) -> Value {
    json!({"type": "ready", "protocol": protocol, "name": "test", "version": version,
           "pixel_center": pixel_center})
}

fn matched(request: &Value, count: usize) -> Value {
    json!({"type": "matched", "pair": request["pair"], "count": count, "features": [7, 8],
           "seconds": {"match": 0.5}, "device": "abacus"})
}

fn say(message: &Value) {
    println!("{message}");
}

fn write_matches(request: &Value, rows: &[[f32; 5]]) {
    let bytes: Vec<u8> = rows
        .iter()
        .flatten()
        .flat_map(|value| value.to_le_bytes())
        .collect();
    fs::write(request["out"].as_str().expect("a path"), bytes).expect("can be written");
}

/// Features of a size for which memory is asked before they are read: [`MANY`] with 4096 values each.
fn write_features(request: &Value) {
    let path = request["out"].as_str().expect("a path");
    let mut file = zip::ZipWriter::new(fs::File::create(path).expect("can be written"));
    let stored =
        zip::write::SimpleFileOptions::default().compression_method(zip::CompressionMethod::Stored);
    for (name, columns) in [("keypoints", 2), ("descriptors", 4096)] {
        let header =
            format!("{{'descr': '<f4', 'fortran_order': False, 'shape': ({MANY}, {columns}), }}\n");
        let length = u16::try_from(header.len()).expect("short").to_le_bytes();
        let start = [&b"\x93NUMPY\x01\x00"[..], &length, header.as_bytes()].concat();
        file.start_file(format!("{name}.npy"), stored)
            .expect("can be written");
        file.write_all(&start).expect("can be written");
        file.write_all(&vec![0; 4 * MANY * columns])
            .expect("can be written");
    }
    file.finish().expect("can be written");
}

/// As a program does that has lost its way.
pub(crate) fn sleep() {
    std::thread::sleep(Duration::from_secs(600));
}
