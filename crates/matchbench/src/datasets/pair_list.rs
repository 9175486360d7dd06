//! A list of pairs as a text file: `a b` in each line, where further columns are ignored. `a` and `b` are numbers of
//! frames, counted from 0, or names of images. The first line says which: two whole numbers are those of frames. A tab
//! separates names that have blanks. Images that were copied or linked into the dataset answer to their former names
//! too, if all names of the list are such names. A list that means other pairs by these is refused.

use std::collections::HashSet;

use super::names::{ImageNames, Named};
use super::text::TextFile;
use super::{DatasetError, Frame};

/// What is said of a pair that is listed again.
const TWICE: &str = "the pair stands here a second time";

/// The pairs of a list of numbers, which are below `frames` if that is known.
pub(super) fn numbered(
    file: &TextFile,
    frames: Option<usize>,
) -> Result<Vec<(u32, u32)>, DatasetError> {
    distinct(file, |row| pair_indices(row, frames))
}

/// The pairs of a list among `frames`.
pub(super) fn listed(file: &TextFile, frames: &[Frame]) -> Result<Vec<(u32, u32)>, DatasetError> {
    if is_numbered(file) {
        return numbered(file, Some(frames.len()));
    }
    let images = ImageNames::of(frames.iter().map(|frame| &*frame.image));
    if frames.iter().all(|frame| frame.name.is_none()) {
        return named(file, frames, &images);
    }
    let former = ImageNames::of(frames.iter().map(Frame::former_image));
    // Names that start from another root may end as others do.
    match [&images, &former].map(|names| has_whole(file, names)) {
        [true, false] => return named(file, frames, &images),
        [false, true] => return named(file, frames, &former),
        _ => {}
    }
    match (named(file, frames, &images), named(file, frames, &former)) {
        (Ok(now), Ok(before)) if now != before => {
            let differs = now
                .iter()
                .zip(&before)
                .position(|(now, before)| now != before);
            let row = differs.expect("each row is a pair");
            let (line, _) = file.rows().nth(row).expect("there are as many rows");
            let [(a, b), (former_a, former_b)] = [now[row], before[row]];
            let what = format!(
                "by the names that images have, these are frames {a} and {b}; by those that they had before they came \
                 into the dataset, {former_a} and {former_b}"
            );
            Err(file.error(what, "write numbers of frames").at(line))
        }
        (Err(_), before @ Ok(_)) => before,
        (now, _) => now,
    }
}

/// The pairs of a list of names.
fn named(
    file: &TextFile,
    frames: &[Frame],
    names: &ImageNames,
) -> Result<Vec<(u32, u32)>, DatasetError> {
    // The names may start from another root. If some do not, the others mean other images.
    let any_whole = has_whole(file, names);
    let find = |name: &str| match if any_whole {
        names.whole(name)
    } else {
        names.end(name)
    } {
        Some(Named::One(number)) => Ok(number),
        Some(Named::Several(one, other)) => {
            let image = |number: u32| frames[number as usize].image.display();
            let (one, other) = (image(one), image(other));
            Err(format!("`{name}` is the name of {one} and of {other}"))
        }
        None => {
            let first = (frames.first()).map_or_else(String::new, |frame| {
                format!("; the first is `{}`", frame.image.display())
            });
            Err(format!(
                "`{name}` is the name of no image of the dataset{first}"
            ))
        }
    };
    distinct(file, |row| {
        let [a, b] = two_names(row)
            .ok_or("two names of images are expected (a tab separates names with blanks; a comma separates nothing)")?;
        let (a, b) = (find(a)?, find(b)?);
        if a == b {
            return Err(format!(
                "{} is matched with itself",
                frames[a as usize].image.display()
            ));
        }
        Ok((a, b))
    })
}

/// Whether both names of a pair are the ends of paths.
fn has_whole(file: &TextFile, names: &ImageNames) -> bool {
    let is_whole = |name: &str| names.whole(name).is_some();
    (file.rows())
        .any(|(_, row)| two_names(row).is_some_and(|words| words.map(is_whole) == [true; 2]))
}

/// Whether a list has numbers of frames.
pub(super) fn is_numbered(file: &TextFile) -> bool {
    let is_number = |word: &str| word.parse::<u32>().is_ok();
    (file.rows().next()).is_none_or(|(_, row)| row.split_whitespace().take(2).all(is_number))
}

/// The first two columns of a row: what tabs separate if there are any, so that names may have blanks, or else white
/// space.
fn two_names(row: &str) -> Option<[&str; 2]> {
    if row.contains('\t') {
        let mut names = row
            .split('\t')
            .map(str::trim)
            .filter(|name| !name.is_empty());
        return Some([names.next()?, names.next()?]);
    }
    let mut names = row.split_whitespace();
    Some([names.next()?, names.next()?])
}

/// The pairs of all rows, each of them once.
fn distinct(
    file: &TextFile,
    pair: impl Fn(&str) -> Result<(u32, u32), String>,
) -> Result<Vec<(u32, u32)>, DatasetError> {
    let mut seen = HashSet::new();
    file.rows()
        .map(|(line, row)| {
            let pair = pair(row).map_err(|what| file.error_at(line, what))?;
            if !seen.insert(pair) {
                return Err(file.error_at(line, TWICE));
            }
            Ok(pair)
        })
        .collect()
}

/// Checks pairs that come from no file as those of a list.
///
/// # Errors
/// The first pair that is not two different ones of the `frames`, or stands there before: its index, and in words what is
/// wrong.
pub(super) fn check_numbers(pairs: &[(u32, u32)], frames: usize) -> Result<(), (usize, String)> {
    let mut seen = HashSet::new();
    let check = |&(a, b): &(u32, u32)| {
        existing(a, frames)?;
        existing(b, frames)?;
        different(a, b)?;
        (seen.insert((a, b)).then_some(())).ok_or_else(|| TWICE.to_owned())
    };
    let mut checked = pairs.iter().map(check).enumerate();
    checked.try_for_each(|(row, checked)| checked.map_err(|what| (row, what)))
}

/// The two frames at the start of a row, if they are different and below `frames`.
pub(super) fn pair_indices(row: &str, frames: Option<usize>) -> Result<(u32, u32), String> {
    let mut words = row.split_whitespace();
    let mut index = || {
        let word = words.next().ok_or("two frame numbers are expected")?;
        let index: u32 = word
            .parse()
            .map_err(|_| format!("`{word}` is not the number of a frame"))?;
        existing(index, frames.unwrap_or(usize::MAX))
    };
    let (a, b) = (index()?, index()?);
    different(a, b)
}

/// The number of a frame, if it is below `frames`.
fn existing(index: u32, frames: usize) -> Result<u32, String> {
    if index as usize >= frames {
        return Err(format!(
            "frame {index} does not exist: there are {frames}, numbered from 0"
        ));
    }
    Ok(index)
}

/// Two frames, if they are different.
fn different(a: u32, b: u32) -> Result<(u32, u32), String> {
    if a == b {
        return Err(format!("frame {a} is matched with itself"));
    }
    Ok((a, b))
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use proptest::prelude::*;

    use super::super::testing;
    use super::*;

    fn file(text: &str) -> TextFile {
        TextFile::new(Path::new("list.txt"), text)
    }

    fn frames(images: &[&str]) -> Vec<Frame> {
        let mut frames = testing::frames(images.len());
        for (frame, image) in frames.iter_mut().zip(images) {
            frame.image = image.into();
        }
        frames
    }

    #[test]
    fn a_list_may_carry_more_columns_but_no_impossible_pairs() {
        let list = |text: &str| numbered(&file(text), Some(3));
        assert_eq!(list("0 2 1 0 0\r\n\r\n2   1").unwrap(), [(0, 2), (2, 1)]);
        for (text, message) in [
            ("0 1\n0 3", "list.txt:2: frame 3 does not exist"),
            ("1 1", "list.txt:1: frame 1 is matched with itself"),
            ("0 1\n0 1", "list.txt:2: the pair stands here a second time"),
            ("0", "list.txt:1: two frame numbers"),
            ("0 -1", "list.txt:1: `-1` is not the number"),
        ] {
            let error = list(text).unwrap_err().to_string();
            assert!(error.starts_with(message), "{error}");
        }
    }

    #[test]
    fn copies_are_listed_by_the_names_that_they_have_or_those_that_they_had() {
        let mut frames = frames(&["0000.png", "0001.png", "0002.png"]);
        for (number, frame) in frames.iter_mut().enumerate() {
            frame.name = Some(format!("left/{number}5.png"));
        }
        let list = |text: &str, frames: &[Frame]| listed(&file(text), frames);
        for text in ["left/05.png left/25.png", "0000.png 0002.png"] {
            assert_eq!(list(text, &frames).unwrap(), [(0, 2)], "{text}");
        }
        let mixed = list("0000.png left/25.png", &frames).unwrap_err();
        assert!(mixed.what.contains("`left/25.png`"), "{mixed}");
        for (number, frame) in frames.iter_mut().enumerate() {
            frame.name = Some(format!("left/000{}.png", (number + 1) % 3));
        }
        let several = list("left/0001.png left/0002.png", &frames);
        assert_eq!(several.unwrap(), [(0, 1)], "no image is called so now");
        let several = list("0001.png 0002.png", &frames).unwrap_err();
        assert_eq!(several.line, Some(1));
        assert!(several.what.contains("frames 1 and 2"), "{several}");
    }

    #[test]
    fn images_are_listed_by_name() {
        let frames = frames(&["src/db/1.jpg", "src/db/2.jpg", "src/query/1.jpg"]);
        let list = |text: &str| listed(&file(text), &frames);
        let pairs = list("# hloc's\ndb/1.jpg db/2.jpg 0.83\n\nquery/1 db/1\n").unwrap();
        assert_eq!(pairs, [(0, 1), (2, 0)]);
        let wider = list("all/src/db/2.jpg all/src/query/1.jpg").unwrap();
        assert_eq!(wider, [(1, 2)]);
        assert_eq!(list("0 2\n").unwrap(), [(0, 2)], "these are numbers");
        let blanks = self::frames(&["the hall 1.jpg", "the hall 2.jpg"]);
        let tabs = listed(&file("the hall 2.jpg\tthe hall 1.jpg\t0.5\n"), &blanks);
        assert_eq!(tabs.unwrap(), [(1, 0)]);
        for (text, message) in [
            (
                "db/1.jpg db/9.jpg",
                "list.txt:1: `db/9.jpg` is the name of no image",
            ),
            (
                "2.jpg 1.jpg",
                "list.txt:1: `1.jpg` is the name of src/db/1.jpg and of src/query/1.jpg",
            ),
            (
                "db/1.jpg db/2.jpg\nx/db/2.jpg db/1.jpg",
                "list.txt:2: `x/db/2.jpg` is the name of no",
            ),
            (
                "db/1.jpg db/2.jpg\ndb/1 db/2",
                "list.txt:2: the pair stands here a second",
            ),
            (
                "2.jpg db/2.jpg",
                "list.txt:1: src/db/2.jpg is matched with itself",
            ),
            ("db/1.jpg", "list.txt:1: two names of images"),
            (
                "db/1.jpg db/2.jpg\ndb/1.jpg",
                "list.txt:2: two names of images",
            ),
            (
                "0 1\ndb/1.jpg db/2.jpg",
                "list.txt:2: `db/1.jpg` is not the number",
            ),
        ] {
            let error = list(text).unwrap_err().to_string();
            assert!(error.starts_with(message), "{error}");
        }
    }

    proptest! {
        #[test]
        fn no_text_panics(text in ".{0,40}|([ab0-3/.-]{1,4}[ \n]){0,12}") {
            let _ = numbered(&file(&text), Some(3));
            let _ = listed(&file(&text), &frames(&["a/0", "a/1", "b-a"]));
        }
    }
}
