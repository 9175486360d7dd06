//! Several paths in one argument, with commas between them.

use std::iter;
use std::path::{Path, PathBuf};

/// The paths of a list. A comma belongs to a path if something of that name exists; every other one separates.
pub(crate) fn between_commas(list: &Path) -> Vec<PathBuf> {
    match list.to_str() {
        Some(list) => split(list, |path| Path::new(path).exists()),
        // What is not UTF-8 is one path.
        None => vec![list.to_owned()],
    }
}

fn split(list: &str, exists: impl Fn(&str) -> bool) -> Vec<PathBuf> {
    let mut paths = Vec::new();
    let mut rest = list;
    loop {
        let commas: Vec<usize> = rest.match_indices(',').map(|(at, _)| at).collect();
        let Some(&first) = commas.first() else {
            paths.push(rest.into());
            return paths;
        };
        // The longest that exists.
        let mut ends = iter::once(rest.len()).chain(commas.into_iter().rev());
        let end = ends.find(|&end| exists(&rest[..end])).unwrap_or(first);
        paths.push(rest[..end].into());
        match rest.get(end + 1..) {
            Some(more) => rest = more,
            None => return paths,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_comma_separates_unless_it_is_part_of_a_name_that_exists() {
        let there = ["a", "b", "c,d", "e,f,g"];
        let paths = |list: &str| split(list, |path| there.contains(&path));
        for (list, expected) in [
            ("a", &["a"][..]),
            ("a,b", &["a", "b"]),
            ("c,d", &["c,d"]),
            ("a,c,d", &["a", "c,d"]),
            ("c,d,e,f,g", &["c,d", "e,f,g"]),
            ("x,c,d,y", &["x", "c,d", "y"]),
            ("x,y", &["x", "y"]),
            ("a,", &["a", ""]),
            ("", &[""]),
        ] {
            let expected: Vec<PathBuf> = expected.iter().map(PathBuf::from).collect();
            assert_eq!(paths(list), expected, "{list}");
        }
    }
}
