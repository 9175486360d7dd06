//! Which image a name means, in lists of pairs and in files of matches.
//!
//! Tools name an image by its path below some root (`db/0001.jpg`), by its file name, or without the
//! extension; some write `-` for `/`. All of these are understood, as long as only one image has a path that ends so.
//! A name is never opened as a file.

use std::collections::HashMap;
use std::iter;
use std::path::Path;

/// Folders above an image that may be part of its name.
const MAX_FOLDERS: usize = 6;

/// Largest number of bytes of a name whose first folders may be left out: that of a path on most systems.
const MAX_PATH: usize = 4096;

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
        Self { images, longest }
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
        let rests = |separators: &'static [char]| {
            iter::successors(Some(name), move |rest| Some(rest.split_once(separators)?.1))
                .filter_map(|rest| self.whole(rest))
        };
        if let Some(named) = rests(&['/']).next() {
            return Some(named);
        }
        let mut rests = rests(&['/', '-']);
        let longest = rests.next()?;
        Some(rests.filter_map(Named::one).fold(longest, Named::or))
    }
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
}
