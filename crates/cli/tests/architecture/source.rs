//! What the source files say: their modules, and the paths by which they name others.

use std::collections::BTreeSet;
use std::fs;
use std::path::{Path, PathBuf};

/// A source file of a package.
pub(crate) struct Source {
    pub(crate) path: PathBuf,
    /// Its module, from the root of the package: empty for `lib.rs` and `main.rs`.
    pub(crate) module: Vec<String>,
    /// Whether it is the face of a folder (`mod.rs`, `lib.rs`, `main.rs`).
    pub(crate) is_face: bool,
    pub(crate) text: String,
}

/// The root of the repository.
pub(crate) fn repository() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../..")
}

/// Every Rust file below `folder`, with its text.
pub(crate) fn rust_files(folder: &Path) -> Vec<(PathBuf, String)> {
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

/// The source files in the folder of a package.
pub(crate) fn sources(package: &str) -> Vec<Source> {
    let root = repository().join(package).join("src");
    let of = |(path, text): (PathBuf, String)| {
        let inside = path.strip_prefix(&root).expect("found below the folder");
        let mut module: Vec<String> = (inside.with_extension("").iter())
            .map(|part| part.to_str().expect("file names are UTF-8").to_owned())
            .collect();
        let is_face = ["mod", "lib", "main"].contains(&&**module.last().expect("a file name"));
        if is_face {
            module.pop();
        }
        Source {
            path,
            module,
            is_face,
            text,
        }
    };
    rust_files(&root).into_iter().map(of).collect()
}

/// The code of `text`, line by line, without line comments.
pub(crate) fn code(text: &str) -> impl Iterator<Item = (usize, &str)> {
    text.lines()
        .enumerate()
        .map(|(index, line)| (index + 1, line.split("//").next().unwrap_or("")))
}

impl Source {
    /// The code without comments and without the tests at its end, which may look anywhere; empty for
    /// a file that only tests use.
    pub(crate) fn code(&self) -> String {
        let name = self.path.file_stem().and_then(|stem| stem.to_str());
        if matches!(name, Some("tests" | "testing")) {
            return String::new();
        }
        let is_test = |line: &str| line.starts_with("#[cfg(test)]");
        let lines: Vec<&str> = code(&self.text).map(|(_, line)| line).collect();
        let end = (0..lines.len()).find(|&i| {
            let next = lines.get(i + 1).copied().unwrap_or_default();
            is_test(lines[i]) && next.contains("mod ") && next.ends_with('{')
        });
        lines[..end.unwrap_or(lines.len())].join("\n")
    }

    /// The paths that the code names by `crate::` or `super::`, from the root of the package.
    pub(crate) fn paths(&self) -> BTreeSet<Vec<String>> {
        let code = self.code();
        let mut paths = BTreeSet::new();
        for (start, _) in code.match_indices("::") {
            let head = &code[..start];
            let first = last_word(head);
            let before = head[..head.len() - first.len()].chars().next_back();
            // A path begins where nothing leads to it.
            if before == Some(':') {
                continue;
            }
            let mut base = self.module.clone();
            match first {
                "crate" => base.clear(),
                "super" => drop(base.pop()),
                "self" if self.is_face => {}
                _ => continue,
            }
            for path in trees(&code[start + 2..]) {
                paths.insert(resolved(base.clone(), path));
            }
        }
        paths
    }

    /// The names that a face takes from the modules of its folder, each with the module: what another
    /// file finds at `super::Name`.
    pub(crate) fn taken_names(&self) -> Vec<(String, String)> {
        let code = self.code();
        let mut names = Vec::new();
        for (start, _) in code.match_indices("use ") {
            for mut path in trees(&code[start + 4..]) {
                path.retain(|part| part != "self");
                if let [module, .., name] = &path[..] {
                    names.push((name.clone(), module.clone()));
                }
            }
        }
        names
    }
}

/// The path `base::path`, with every `super` taken.
fn resolved(mut base: Vec<String>, path: Vec<String>) -> Vec<String> {
    for part in path {
        match &*part {
            "super" => drop(base.pop()),
            "self" => {}
            _ => base.push(part),
        }
    }
    base
}

fn last_word(text: &str) -> &str {
    let start = text.rfind(|c: char| !is_word(c));
    &text[start.map_or(0, |start| start + 1)..]
}

fn is_word(c: char) -> bool {
    c.is_alphanumeric() || c == '_'
}

/// All paths of a tree like `a::{b, c::{D, E}}`, which `text` begins with.
fn trees(text: &str) -> Vec<Vec<String>> {
    tree(text).0
}

/// The paths, and how many bytes they took.
fn tree(text: &str) -> (Vec<Vec<String>>, usize) {
    if let Some(inside) = text.strip_prefix('{') {
        let (mut paths, mut at) = (Vec::new(), 1);
        for (index, c) in inside.char_indices() {
            let position = index + 1;
            if position < at {
                continue;
            }
            if c == '}' {
                return (paths, position + 1);
            }
            if is_word(c) || c == '{' {
                let (found, length) = tree(&text[position..]);
                // `a as b` is `a`.
                let rest = text[position + length..].trim_start();
                paths.extend(found);
                at = position + length;
                if rest.starts_with("as ") {
                    at += text[at..].find([',', '}']).unwrap_or(0);
                }
            }
        }
        return (paths, text.len());
    }
    let word: String = text.chars().take_while(|&c| is_word(c)).collect();
    if word.is_empty() {
        return (vec![Vec::new()], 0);
    }
    let mut length = word.len();
    let mut paths = vec![Vec::new()];
    if let Some(rest) = text[length..].strip_prefix("::") {
        let (found, more) = tree(rest);
        paths = found;
        length += 2 + more;
    }
    for path in &mut paths {
        path.insert(0, word.clone());
    }
    (paths, length)
}

#[test]
fn trees_of_paths_are_read() {
    let read = |text| -> Vec<String> { trees(text).iter().map(|path| path.join("::")).collect() };
    assert_eq!(read("a::b()"), ["a::b"]);
    assert_eq!(
        read("a::{b, c::{D,\n E as F}, self, g::*};"),
        ["a::b", "a::c::D", "a::c::E", "a::self", "a::g"]
    );
}

#[test]
fn paths_are_named_from_the_root() {
    let source = Source {
        path: "run/pair.rs".into(),
        module: vec!["run".into(), "pair".into()],
        is_face: false,
        text: "use super::{RunError, part::{Due, Part}};\n// crate::never\n\
               fn f() -> crate::records::Task { super::super::files::g(std::mem::take) }\n\
               #[cfg(test)]\nmod tests {\n    use crate::metrics;\n}\n"
            .into(),
    };
    let paths: Vec<String> = (source.paths().iter())
        .map(|path| path.join("::"))
        .collect();
    assert_eq!(
        paths,
        [
            "files::g",
            "records::Task",
            "run::RunError",
            "run::part::Due",
            "run::part::Part"
        ]
    );
}
