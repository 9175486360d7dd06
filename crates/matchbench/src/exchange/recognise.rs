//! Which format files are of; and if they are of none, what they have and what may be missing.

use super::found::with_more;
use super::probe::{Content, Probe};
use super::{ExchangeError, FORMATS, Format, hloc};
use crate::arrays::Npz;
use crate::front_door::MATCHES_FORMAT;

/// The format of the files, which must be the `asked` one.
///
/// # Errors
/// If it is another, or none that is known.
pub(super) fn format_of(
    probe: &Probe,
    asked: Option<&'static Format>,
) -> Result<&'static Format, ExchangeError> {
    let found = FORMATS.iter().find(|format| (format.recognises)(probe));
    match (found, asked) {
        (Some(found), Some(asked)) if found.id != asked.id => Err(ExchangeError::new(
            &probe.files[0],
            format!("its content is `{}`, not `{}`", found.id, asked.id),
            format!("leave {MATCHES_FORMAT} out, or name the right files"),
        )),
        (Some(found), _) => Ok(found),
        (None, asked) => Err(of_no_layout(probe, asked)),
    }
}

/// Files of no known layout, or not of that of the format that was `asked` for.
fn of_no_layout(probe: &Probe, asked: Option<&Format>) -> ExchangeError {
    let first = &probe.files[0];
    if let Content::Hdf5(files) = &probe.content
        && let [(_, arrays)] = &files[..]
        && let Some(lacks) = hloc::lacks(arrays)
    {
        return ExchangeError::new(first, lacks, "give both files: features.h5,matches.h5");
    }
    let has = match &probe.content {
        Content::Npz(names) => {
            let mut file = Npz::open(first).ok();
            arrays(names, |name| file.as_mut()?.stated_shape(name))
        }
        Content::Hdf5(files) => (files.iter())
            .map(|(file, names)| arrays(names, |name| file.stated_shape(name)))
            .collect::<Vec<_>>()
            .join("; the second file has "),
        // Any file of these kinds is of the format that reads them.
        Content::Sqlite | Content::Text => "other content".to_owned(),
    };
    let remedy = match asked {
        None => "`matchbench list formats` shows what is read".to_owned(),
        Some(format) => format!("`{}` is {}", format.id, format.layout),
    };
    let what = format!("its content is of no known layout: it has {has}");
    ExchangeError::new(first, what, remedy)
}

/// The first arrays of a file, by name and shape.
fn arrays(names: &[String], mut shape: impl FnMut(&str) -> Option<Vec<usize>>) -> String {
    let shape = |name: &str| shape(name).map_or(String::new(), |shape| format!(" {shape:?}"));
    with_more(names, shape).unwrap_or_else(|| "no array of numbers".to_owned())
}

#[cfg(test)]
mod tests {
    use std::fs;
    use std::path::PathBuf;

    use super::*;
    use crate::arrays::{Hdf5Out, npz};

    fn error(paths: &[PathBuf], asked: Option<&'static Format>) -> String {
        let probe = Probe::new(paths, "room").expect("it is of a known kind");
        format_of(&probe, asked).expect_err("no format").to_string()
    }

    #[test]
    fn half_of_what_hloc_writes_asks_for_the_other_half() {
        let folder = tempfile::tempdir().expect("a temporary folder");
        for (name, array, says) in [
            ("features.h5", "one.png/keypoints", "and no matches"),
            ("matches.h5", "one.png/two.png/matches0", "and no keypoints"),
        ] {
            let path = folder.path().join(name);
            let mut out = Hdf5Out::default();
            out.integers(array.into(), &[2, 1], &[0, 0]);
            out.write(&path).expect("writable");
            let error = error(&[path], None);
            assert!(error.contains(says), "{error}");
            assert!(error.ends_with("features.h5,matches.h5"), "{error}");
        }
    }

    #[test]
    fn keypoints_of_a_pair_match_row_by_row_unless_their_numbers_are_there() {
        let folder = tempfile::tempdir().expect("a temporary folder");
        for (index, (others, format)) in [
            (&[][..], Some("hloc")),
            (&["scores"], Some("hloc")),
            (&["scores", "matches0", "matching_scores0"], Some("hloc")),
            (&["matches0"], Some("glue-factory")),
            (&["matches0", "matching_scores0"], Some("glue-factory")),
            (&["matches0", "keypoint_scores0"], Some("glue-factory")),
            (&["matches0", "matches1", "scores"], Some("glue-factory")),
            (&["keypoint_scores0"], None),
            (&["descriptors0", "descriptors1"], None),
        ]
        .into_iter()
        .enumerate()
        {
            let path = folder.path().join(format!("{index}.h5"));
            let mut out = Hdf5Out::default();
            for name in ["keypoints0", "keypoints1"].iter().chain(others) {
                out.integers(format!("one.png/two.png/{name}"), &[2, 2], &[0; 4]);
            }
            out.write(&path).expect("writable");
            let paths = std::slice::from_ref(&path);
            let probe = Probe::new(paths, "room").expect("it is of a known kind");
            let found = format_of(&probe, None).ok().map(|found| found.id);
            assert_eq!(found, format, "{others:?}");
        }
    }

    #[test]
    fn what_a_file_has_is_said_in_a_few_words() {
        let folder = tempfile::tempdir().expect("a temporary folder");
        let path = folder.path().join("0_1.npz");
        let names = ["H", "inliers", "c", "d", "e", "f"];
        let arrays = names.map(|name| (name, &[3, 1][..], "|u1", vec![0; 3]));
        fs::write(&path, npz(&arrays)).expect("writable");
        let said = error(std::slice::from_ref(&path), None);
        let has = "it has `H` [3, 1], `inliers` [3, 1], `c` [3, 1], `d` [3, 1] and 2 more; `matchbench list formats`";
        assert!(said.contains(has), "{said}");
        let asked = FORMATS[0];
        let said = error(std::slice::from_ref(&path), Some(asked));
        assert!(
            said.ends_with(&format!("`npz` is {}", asked.layout)),
            "{said}"
        );
        fs::write(&path, npz(&[])).expect("writable");
        assert!(error(&[path], None).contains("no array of numbers"));
    }

    #[test]
    fn both_files_are_described() {
        let folder = tempfile::tempdir().expect("a temporary folder");
        let paths = ["a.h5", "b.h5"].map(|name| folder.path().join(name));
        for (path, array) in paths.iter().zip(["one/x", "two/y"]) {
            let mut out = Hdf5Out::default();
            out.integers(array.into(), &[2, 1], &[0, 0]);
            out.write(path).expect("writable");
        }
        let said = error(&paths, None);
        assert!(
            said.contains("`one/x` [2, 1]; the second file has `two/y` [2, 1]"),
            "{said}"
        );
    }
}
