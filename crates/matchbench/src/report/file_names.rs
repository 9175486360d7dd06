//! Names of datasets as names of files.

use std::collections::BTreeSet;

/// A file name for each dataset: letters, digits, dots and dashes, different from all others (also if upper and
/// lower case are not distinguished).
pub(super) fn file_names(datasets: &[&str]) -> Vec<String> {
    let mut taken = BTreeSet::new();
    (datasets.iter())
        .map(|dataset| file_name(dataset, &mut taken))
        .collect()
}

fn file_name(dataset: &str, taken: &mut BTreeSet<String>) -> String {
    let plain: String = (dataset.trim_start_matches('.').chars())
        .map(|c| {
            if c.is_ascii_alphanumeric() || ".-_".contains(c) {
                c
            } else {
                '-'
            }
        })
        .take(80)
        .collect();
    unique(&plain, taken)
}

/// The name, with a number after it if another has it, also if upper and lower case are not distinguished.
pub(super) fn unique(plain: &str, taken: &mut BTreeSet<String>) -> String {
    let mut name = plain.to_owned();
    let mut number = 2;
    while !taken.insert(name.to_ascii_lowercase()) {
        name = format!("{plain}-{number}");
        number += 1;
    }
    name
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_differ_and_are_plain() {
        let names = file_names(&["a/b", "A?b", "../x"]);
        assert_eq!(names, ["a-b", "A-b-2", "-x"]);
    }
}
