//! The house stays as `ARCHITECTURE.md` draws it: rooms look only where they may, every room is
//! on the plan, unsafe code stays in one room, and no file grows without being asked why.

use std::fs;
use std::path::{Path, PathBuf};

/// Package, room, and the rooms of the same package that it may look into, besides
/// [`GROUND_FLOOR`].
const MAY_LOOK_INTO: &[(&str, &str, &[&str])] = &[
    ("vision", "params", &[]),
    ("vision", "seed", &[]),
    ("vision", "simd", &[]),
    ("vision", "tables", &[]),
    ("vision", "image", &["simd"]),
    ("vision", "features", &["image", "simd", "tables"]),
    ("vision", "geometry", &["simd"]),
    ("vision", "robust", &["geometry", "simd"]),
    (
        "vision",
        "matching",
        &["features", "geometry", "image", "robust", "simd"],
    ),
    ("matchbench", "config", &[]),
    ("matchbench", "files", &[]),
    ("matchbench", "datasets", &[]),
    ("matchbench", "matchers", &["config"]),
    ("matchbench", "estimators", &["config"]),
    ("matchbench", "records", &[]),
    (
        "matchbench",
        "run",
        &["config", "datasets", "estimators", "matchers", "records"],
    ),
    ("matchbench", "metrics", &["datasets", "records"]),
    ("matchbench", "report", &["metrics", "records"]),
];

/// What every room stands on.
const GROUND_FLOOR: [&str; 3] = ["params", "seed", "files"];

/// Files that are longer than [`LONGEST_FILE`], each with the reason.
const LONG_FILES: &[(&str, &str)] = &[];
const LONGEST_FILE: usize = 600;

fn repository() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../..")
}

/// Every Rust file below `folder`, with its text.
fn rust_files(folder: &Path) -> Vec<(PathBuf, String)> {
    let mut files = Vec::new();
    for entry in fs::read_dir(folder).expect("the folder is part of the repository") {
        let path = entry.expect("the folder can be listed").path();
        if path.is_dir() {
            files.extend(rust_files(&path));
        } else if path.extension().is_some_and(|extension| extension == "rs") {
            let text = fs::read_to_string(&path).expect("source files are UTF-8");
            files.push((path, text));
        }
    }
    files
}

/// The code of `text`, line by line, without line comments.
fn code(text: &str) -> impl Iterator<Item = (usize, &str)> {
    text.lines()
        .enumerate()
        .map(|(index, line)| (index + 1, line.split("//").next().unwrap_or("")))
}

/// Rooms of a package: the folders and files directly below `src`.
fn rooms(package: &str) -> Vec<String> {
    let source = repository().join("crates").join(package).join("src");
    let mut rooms: Vec<String> = fs::read_dir(source)
        .expect("every package has a source folder")
        .filter_map(|entry| {
            let path = entry.expect("the folder can be listed").path();
            Some(path.file_stem()?.to_str()?.to_owned())
        })
        .filter(|room| room != "lib" && room != "main")
        .collect();
    rooms.sort();
    rooms
}

#[test]
fn rooms_look_only_where_they_may() {
    let mut trespasses = Vec::new();
    for package in ["vision", "matchbench"] {
        let source = repository().join("crates").join(package).join("src");
        for (path, text) in rust_files(&source) {
            let inside = path
                .strip_prefix(&source)
                .expect("found below the source folder");
            let room = inside
                .iter()
                .next()
                .and_then(|part| Path::new(part).file_stem());
            let room = room
                .and_then(|stem| stem.to_str())
                .expect("file names are UTF-8");
            if room == "lib" {
                continue;
            }
            let Some((_, _, allowed)) = MAY_LOOK_INTO
                .iter()
                .find(|entry| (entry.0, entry.1) == (package, room))
            else {
                trespasses.push(format!("{package}/{room} is a room without rules"));
                continue;
            };
            for (number, line) in code(&text) {
                for seen in line.split("crate::").skip(1) {
                    let seen: String = seen
                        .chars()
                        .take_while(|c| c.is_alphanumeric() || *c == '_')
                        .collect();
                    let known = [&[room], *allowed, &GROUND_FLOOR].concat();
                    if !seen.is_empty() && !known.contains(&seen.as_str()) {
                        trespasses.push(format!("{}:{number} looks into {seen}", path.display()));
                    }
                }
            }
        }
    }
    assert!(trespasses.is_empty(), "{}", trespasses.join("\n"));
}

#[test]
fn every_room_is_on_the_plan() {
    let plan = fs::read_to_string(repository().join("ARCHITECTURE.md")).expect("the plan exists");
    for package in ["vision", "matchbench"] {
        for room in rooms(package) {
            assert!(
                plan.contains(&format!("`{room}`")),
                "ARCHITECTURE.md does not name {package}/{room}"
            );
        }
    }
    for (package, room, _) in MAY_LOOK_INTO {
        assert!(
            rooms(package).iter().any(|name| name == room),
            "{package}/{room} does not exist"
        );
    }
}

#[test]
fn unsafe_code_stays_in_one_room() {
    for (path, text) in rust_files(&repository().join("crates")) {
        let in_simd = path.components().any(|part| part.as_os_str() == "simd");
        for (number, line) in code(&text) {
            let words = line.split(|c: char| !(c.is_alphanumeric() || c == '_'));
            // This test speaks of it in strings.
            let is_unsafe = words.into_iter().any(|word| word == concat!("un", "safe"));
            assert!(
                in_simd || !is_unsafe,
                "{}:{number} is outside the simd room",
                path.display()
            );
        }
    }
}

#[test]
fn no_file_grows_without_being_asked_why() {
    for (path, text) in rust_files(&repository().join("crates")) {
        let lines = text.lines().count();
        let excused = LONG_FILES.iter().any(|(file, _)| path.ends_with(file));
        assert!(
            lines <= LONGEST_FILE || excused,
            "{} has {lines} lines: is it still one idea?",
            path.display()
        );
    }
}
