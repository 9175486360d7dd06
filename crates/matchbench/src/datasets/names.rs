//! Which image a name means, in lists of pairs and in files of matches.
//!
//! Tools name an image by its path below some root (`db/0001.jpg`), by its file name, or without the
//! extension; some write `-` for `/`. All of these are understood, as long as only one image has a path that ends so.
//! A name is never opened as a file.

use std::collections::{HashMap, HashSet};
use std::path::Path;

/// Folders above an image that may be part of its name.
const MAX_FOLDERS: usize = 6;

/// Largest number of bytes of a name whose first folders may be left out: that of a path on most systems.
const MAX_PATH: usize = 4096;

/// How many last bytes tell at once that a name is that of no image.
const TAIL: usize = 4;

/// What a name means.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Named {
    /// The image of this number.
    One(u32),
    /// At least these two images, so none of them for certain.
    Several(u32, u32),
}

/// The names that images answer to.
#[derive(Clone, Debug, Default)]
pub(crate) struct ImageNames {
    images: HashMap<String, Named>,
    /// The length of the longest name.
    longest: usize,
    /// The last bytes of names that have so many.
    tails: HashSet<[u8; TAIL]>,
}

impl Named {
    /// The image, if it is certain which.
    pub(crate) fn one(self) -> Option<u32> {
        match self {
            Self::One(number) => Some(number),
            Self::Several(..) => None,
        }
    }

    fn or(self, other: u32) -> Self {
        match self {
            Self::One(number) if number != other => Self::Several(number, other),
            named => named,
        }
    }

    /// What a name means that is known in two ways.
    pub(crate) fn and(self, other: Self) -> Self {
        match other {
            Self::One(number) => self.or(number),
            several @ Self::Several(..) => several,
        }
    }
}

impl ImageNames {
    /// The names of images at these paths, which are numbered in their order.
    pub(crate) fn of<'a>(paths: impl Iterator<Item = &'a Path>) -> Self {
        let mut images = HashMap::new();
        for (path, number) in paths.zip(0..) {
            for name in names_of(path) {
                (images.entry(name))
                    .and_modify(|named: &mut Named| *named = named.or(number))
                    .or_insert(Named::One(number));
            }
        }
        let longest = images.keys().map(String::len).max().unwrap_or(0);
        let tails = images.keys().filter_map(|name| tail(name)).collect();
        Self {
            images,
            longest,
            tails,
        }
    }

    /// The image whose path ends with that name.
    pub(crate) fn whole(&self, name: &str) -> Option<Named> {
        // A name of others may have any length; without this, to look up all parts of a long one would take long.
        (name.len() <= self.longest)
            .then(|| self.images.get(name).copied())
            .flatten()
    }

    /// The image of that name without its first folders, which are those of another root: of the longest rest which is
    /// a name. Where `-` stands for `/`, it also stands for itself. So the rest may begin after any `-`, and no shorter
    /// one may be the name of one other image.
    pub(crate) fn end(&self, name: &str) -> Option<Named> {
        if name.len() > MAX_PATH {
            return None;
        }
        let found = |separators| (self.rests(name, separators)).filter_map(|rest| self.whole(rest));
        if let Some(named) = found(b"/").next() {
            return Some(named);
        }
        let mut rests = found(b"/-");
        let longest = rests.next()?;
        Some(rests.filter_map(Named::one).fold(longest, Named::or))
    }

    /// The name and what is behind each separator, the longest first, without what is no name for its length or its
    /// last bytes: a joined name is split at many places, and each part has rests.
    fn rests<'a>(
        &self,
        name: &'a str,
        separators: &'static [u8],
    ) -> impl Iterator<Item = &'a str> + use<'a> {
        let longest = if tail(name).is_some_and(|tail| self.tails.contains(&tail)) {
            self.longest
        } else {
            self.longest.min(TAIL - 1)
        };
        let whole = (name.len() <= longest).then_some(name);
        // The separator before a rest of the longest length.
        let first = name.len().saturating_sub(longest + 1);
        let ends = (name.bytes().enumerate().skip(first))
            .filter(|(_, byte)| separators.contains(byte))
            .map(|(at, _)| &name[at + 1..]);
        whole.into_iter().chain(ends)
    }
}

fn tail(name: &str) -> Option<[u8; TAIL]> {
    name.as_bytes().last_chunk().copied()
}

/// The names that an image answers to: the ends of its path, also without the ending, and with `-`
/// for `/`.
fn names_of(image: &Path) -> Vec<String> {
    let parts: Vec<_> = (image.iter().rev().take(1 + MAX_FOLDERS))
        .map(|part| part.to_string_lossy())
        .collect();
    let mut names = Vec::new();
    for depth in 1..=parts.len() {
        let name = parts[..depth]
            .iter()
            .rev()
            .map(AsRef::as_ref)
            .collect::<Vec<&str>>();
        let name = name.join("/");
        let stem = match name.rsplit_once('.') {
            Some((stem, ending)) if !ending.contains('/') => Some(stem.to_owned()),
            _ => None,
        };
        for name in [Some(name), stem].into_iter().flatten() {
            if name.contains('/') {
                names.push(name.replace('/', "-"));
            }
            names.push(name);
        }
    }
    names
}

#[cfg(test)]
mod tests {
    use super::Named::{One, Several};
    use super::*;

    fn names(images: &[&str]) -> ImageNames {
        ImageNames::of(images.iter().map(Path::new))
    }

    #[test]
    fn an_image_answers_to_the_ends_of_its_path() {
        let names = names(&[
            "/data/db/0007.jpg",
            "/data/query/0007.jpg",
            "/data/db/1.2.png",
        ]);
        for (name, image) in [
            ("db/0007.jpg", Some(One(0))),
            ("query/0007.jpg", Some(One(1))),
            ("query-0007.jpg", Some(One(1))),
            ("data/db/0007", Some(One(0))),
            ("elsewhere/query/0007.jpg", None),
            ("1.2", Some(One(2))),
            ("1.2.png", Some(One(2))),
            ("0007.jpg", Some(Several(0, 1))),
            ("0008.jpg", None),
            ("../../../etc/passwd", None),
            ("", None),
        ] {
            assert_eq!(names.whole(name), image, "{name}");
        }
    }

    #[test]
    fn the_first_folders_may_be_those_of_another_root() {
        let names = names(&[
            "/data/db/7.jpg",
            "/data/query/7.jpg",
            "/data/b-1.jpg",
            "/data/1.jpg",
        ]);
        for (name, image) in [
            ("elsewhere/query/7.jpg", Some(One(1))),
            ("elsewhere/7.jpg", Some(Several(0, 1))),
            ("elsewhere/8.jpg", None),
            ("elsewhere-query-7.jpg", Some(One(1))),
            ("my-data-query-7", Some(One(1))),
            ("elsewhere-7.jpg", Some(Several(0, 1))),
            ("elsewhere-8.jpg", None),
            // The name of one image ends with that of another, so a `-` may belong to either.
            ("elsewhere-b-1.jpg", Some(Several(2, 3))),
            ("elsewhere/b-1.jpg", Some(One(2))),
            ("elsewhere-1.jpg", Some(One(3))),
            ("", None),
        ] {
            assert_eq!(names.end(name), image, "{name}");
        }
    }

    #[test]
    fn only_rests_that_may_be_names_are_looked_up() {
        let names = names(&["/d/ä/7.jpg", "/data/query/7.jpg"]);
        assert_eq!(names.longest, "/data/query/7.jpg".len() + 1);
        for folder in ["-/", "/", "ä-", "elsewhere-", "x/y-z/"] {
            for length in [0, 1, 2, 3, 5, 19, 20, 400] {
                let name = [&folder.repeat(length), "data/query-7.jpg"].concat();
                for separators in [&b"/"[..], b"/-"] {
                    let is_separator = |c: char| separators.contains(&(c as u8)) && c.is_ascii();
                    let behind = name.match_indices(is_separator).map(|(at, _)| at + 1);
                    let all = std::iter::once(0).chain(behind).map(|at| &name[at..]);
                    let may_be: Vec<_> = all.filter(|rest| rest.len() <= names.longest).collect();
                    let rests: Vec<_> = names.rests(&name, separators).collect();
                    assert_eq!(rests, may_be, "{name}");
                }
                assert_eq!(names.end(&name), Some(One(1)), "{name}");
            }
        }
        let rests = |name| names.rests(name, b"/-").collect::<Vec<_>>();
        assert_eq!(rests("data/query-7.gif"), [""; 0]);
        assert_eq!(rests("data/b-7"), ["b-7", "7"]);
        assert_eq!(rests("/--/"), ["--/", "-/", "/", ""]);
        assert_eq!(names.end("x/query-7"), Some(One(1)));
        assert_eq!(names.end("data/q-7"), Some(Several(0, 1)));
    }
}
