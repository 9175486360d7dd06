//! `ARCHITECTURE.md`, read: the packages, their rooms, and which room may look into which.

use std::collections::BTreeMap;
use std::fs;

use crate::source::repository;

/// A room of a package.
pub(crate) struct Room {
    pub(crate) name: String,
    /// The rooms that it may look into, besides itself.
    pub(crate) may_look_into: Vec<String>,
}

/// The page.
pub(crate) struct Plan {
    /// Folders of the packages by name.
    pub(crate) packages: BTreeMap<String, String>,
    /// The rooms of each package that has a table of them, by its name, in the order of the table.
    pub(crate) rooms: BTreeMap<String, Vec<Room>>,
}

impl Plan {
    /// Reads the tables of packages and of rooms.
    ///
    /// # Panics
    /// If a room may look into one that stands below it, or into none that there is: then the page is
    /// wrong.
    pub(crate) fn read() -> Self {
        let page =
            fs::read_to_string(repository().join("ARCHITECTURE.md")).expect("the plan exists");
        let mut plan = Self {
            packages: BTreeMap::new(),
            rooms: BTreeMap::new(),
        };
        for section in page.split("\n## ").skip(1) {
            let (title, text) = section.split_once('\n').unwrap_or((section, ""));
            if title == "Packages" {
                for row in rows(text) {
                    if let [name, folder, ..] = &quoted(row[0])[..] {
                        plan.packages.insert(name.clone(), folder.clone());
                    }
                }
            } else if let Some(package) = title.strip_prefix("Rooms of ") {
                let rooms = rooms(text);
                assert!(!rooms.is_empty(), "{title} has no table");
                plan.rooms
                    .insert(package.trim_matches('`').to_owned(), rooms);
            }
        }
        assert!(
            plan.packages.len() > 3 && plan.rooms.len() > 1,
            "the page has other headings"
        );
        plan
    }
}

fn rooms(text: &str) -> Vec<Room> {
    // "Every room may use `seed` and `params`." stands below the table.
    let everybody = text
        .split_once("Every room may use")
        .map_or("", |(_, rest)| rest);
    let everybody = quoted(everybody.split('.').next().unwrap_or_default());
    let mut rooms: Vec<Room> = Vec::new();
    for row in rows(text) {
        let [first, .., last] = row[..] else { continue };
        let [name] = &quoted(first)[..] else { continue };
        let above = rooms.iter().map(|room| room.name.clone());
        let mut may_look_into = match last {
            "nothing" => Vec::new(),
            "all of the above" => above.collect(),
            _ => quoted(last),
        };
        for seen in &may_look_into {
            assert!(
                rooms.iter().any(|room| room.name == *seen),
                "`{name}` may look into `{seen}`, which does not stand above it"
            );
        }
        may_look_into.extend(everybody.iter().cloned());
        rooms.push(Room {
            name: name.clone(),
            may_look_into,
        });
    }
    rooms
}

/// The cells of the rows of a table, without its head.
fn rows(text: &str) -> impl Iterator<Item = Vec<&str>> {
    (text.lines().map(str::trim))
        .filter(|line| line.starts_with("| `"))
        .map(|line| line.trim_matches('|').split('|').map(str::trim).collect())
}

/// What stands between backquotes.
fn quoted(text: &str) -> Vec<String> {
    (text.split('`').skip(1).step_by(2))
        .map(str::to_owned)
        .collect()
}
