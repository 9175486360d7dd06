//! The house stays as `ARCHITECTURE.md` draws it: rooms look only where its tables let them, every room
//! is in a table, nothing goes in circles, unsafe code stays in two places, and no file grows without
//! being asked why.

mod circles;
mod plan;
mod source;

use std::collections::BTreeSet;
use std::path::PathBuf;

use circles::circles;
use plan::Plan;
use source::{code, repository, rust_files, sources};

/// Files that are longer than [`LONGEST_FILE`], each with the reason.
const LONG_FILES: &[(&str, &str)] = &[];
const LONGEST_FILE: usize = 600;

#[test]
fn rooms_look_only_where_they_may() {
    let plan = Plan::read();
    let mut trespasses = Vec::new();
    for (package, rooms) in &plan.rooms {
        for source in sources(&plan.packages[package]) {
            let Some(own) = source.module.first() else {
                continue;
            };
            let Some(room) = rooms.iter().find(|room| room.name == *own) else {
                trespasses.push(format!("{package}/{own} is a room without rules"));
                continue;
            };
            for (number, line) in code(&source.text) {
                for seen in line.split("crate::").skip(1) {
                    let seen: String = seen
                        .chars()
                        .take_while(|c| c.is_alphanumeric() || *c == '_')
                        .collect();
                    let may = seen == *own || room.may_look_into.contains(&seen);
                    if !seen.is_empty() && !may {
                        let path = source.path.display();
                        trespasses.push(format!("{path}:{number} looks into {seen}"));
                    }
                }
            }
        }
    }
    assert!(trespasses.is_empty(), "{}", trespasses.join("\n"));
}

#[test]
fn every_room_on_the_plan_exists() {
    let plan = Plan::read();
    for (package, rooms) in &plan.rooms {
        let sources = sources(&plan.packages[package]);
        let exist: BTreeSet<&String> = (sources.iter())
            .filter_map(|source| source.module.first())
            .collect();
        for room in rooms {
            assert!(
                exist.contains(&room.name),
                "{package} has no room {}",
                room.name
            );
        }
    }
}

#[test]
fn nothing_goes_in_circles() {
    let plan = Plan::read();
    let is_rust = |folder: &&String| repository().join(folder).join("src").is_dir();
    let packages = plan.packages.values().filter(is_rust);
    let circles: Vec<String> = packages.flat_map(|package| circles(package)).collect();
    assert!(circles.is_empty(), "{}", circles.join("\n"));
}

#[test]
fn unsafe_code_stays_in_two_places() {
    for (path, text) in own_files() {
        let in_simd = path.components().any(|part| part.as_os_str() == "simd");
        let is_allowed = in_simd || path.ends_with("matchbench/src/memory/pages.rs");
        for (number, line) in code(&text) {
            let words = line.split(|c: char| !(c.is_alphanumeric() || c == '_'));
            // This test speaks of it in strings.
            let is_unsafe = words.into_iter().any(|word| word == concat!("un", "safe"));
            assert!(
                is_allowed || !is_unsafe,
                "{}:{number} is neither in the simd room nor the allocator",
                path.display()
            );
        }
    }
}

#[test]
fn no_message_is_printed_twice() {
    // What a message holds and `source()` returns too, stands twice where chains are printed.
    for (path, text) in own_files() {
        for (number, line) in code(&text) {
            let twice = line.contains("#[error(") && line.contains(concat!("{so", "urce}"));
            assert!(
                !twice,
                "{}:{number} holds its source: call the field `error`",
                path.display()
            );
        }
    }
}

#[test]
fn an_error_may_get_a_new_reason() {
    for (path, text) in own_files() {
        let mut before = "";
        for (number, line) in code(&text) {
            let name = line
                .strip_prefix("pub enum ")
                .map(|name| name.trim_end_matches(" {"));
            assert!(
                !name.is_some_and(|name| name.ends_with("Error")) || before == "#[non_exhaustive]",
                "{}:{number}: put #[non_exhaustive] above it, or a new reason breaks the programs that match all",
                path.display()
            );
            before = line;
        }
    }
}

#[test]
fn no_file_grows_without_being_asked_why() {
    for (path, text) in own_files() {
        let lines = text.lines().count();
        let excused = LONG_FILES.iter().any(|(file, _)| path.ends_with(file));
        assert!(
            lines <= LONGEST_FILE || excused,
            "{} has {lines} lines: is it still one idea?",
            path.display()
        );
    }
}

/// The Rust files of the packages that are published, as crates or as a wheel.
fn own_files() -> Vec<(PathBuf, String)> {
    let folders = ["crates", "python"].map(|folder| repository().join(folder));
    folders
        .iter()
        .flat_map(|folder| rust_files(folder))
        .collect()
}
