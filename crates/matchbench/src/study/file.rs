//! Reads a run file: TOML, with paths relative to its folder, and errors with file and line.

use std::collections::BTreeMap;
use std::mem;
use std::path::{Path, PathBuf};

use serde::Deserialize;

use super::error::CORRECT;
use super::{Study, StudyError};
use crate::config::readable;
use crate::datasets::{PairRule, RENDERED};
use crate::external::Manifest;
use crate::files::read_text;

impl Study {
    /// Whether a path is that of a run file; otherwise it may be that of a dataset.
    pub fn is_file(path: &Path) -> bool {
        path.extension()
            .is_some_and(|extension| extension == "toml")
            && !path.is_dir()
    }

    /// The study in a run file. Relative paths in it start from the folder of the file.
    ///
    /// # Errors
    /// If the file cannot be read, or a key, a name, a parameter or a value in it is wrong.
    pub fn read(path: &Path) -> Result<Self, StudyError> {
        let text = read_text(path).map_err(|error| StudyError::File {
            file: path.to_path_buf(),
            line: None,
            what: error.to_string(),
            remedy: "check its path",
        })?;
        let mut study = Self::parse(&text, path)?;
        let folder = path.parent().unwrap_or(Path::new(""));
        study.start_from(folder);
        Ok(study)
    }

    /// The study in a text, with paths unchanged; errors name `file`.
    ///
    /// # Errors
    /// If a key, a name, a parameter or a value is wrong.
    pub fn parse(text: &str, file: &Path) -> Result<Self, StudyError> {
        let wrong = |error: toml::de::Error| StudyError::File {
            file: file.to_path_buf(),
            line: error.span().map(|span| line_of(text, span.start)),
            what: readable(&error.message().replace('\n', ", ")),
            remedy: CORRECT,
        };
        let mut study: Self = toml::from_str(text).map_err(wrong)?;
        let places: Places = toml::from_str(text).map_err(wrong)?;
        let at = |start: usize| (file.to_path_buf(), line_of(text, start));
        let ids = places.set.into_keys().map(|id| {
            let at = at(id.span().start);
            (id.into_inner(), at)
        });
        study.set_at = ids.collect();
        let own = places.datasets.iter().flat_map(|place| &place.matchers);
        let manifests = places.matchers.iter().chain(own);
        study.manifests_at = manifests
            .filter(|name| Manifest::is_path(name.get_ref()))
            .map(|name| (name.get_ref().clone(), at(name.span().start)))
            .collect();
        for (dataset, place) in study.datasets.iter_mut().zip(places.datasets) {
            dataset.at = Some(at(place.path.span().start));
        }
        Ok(study)
    }

    /// Makes all relative paths start from `folder`.
    fn start_from(&mut self, folder: &Path) {
        let place = |path: &mut PathBuf| *path = folder.join(&path);
        let place_some = |path: &mut Option<PathBuf>| {
            if let Some(path) = path {
                place(path);
            }
        };
        let placed = |name: &String| folder.join(name).to_string_lossy().into_owned();
        let place_manifests = |names: &mut Vec<String>| {
            for name in names.iter_mut().filter(|name| Manifest::is_path(name)) {
                *name = placed(name);
            }
        };
        let manifests_at = mem::take(&mut self.manifests_at).into_iter();
        self.manifests_at = (manifests_at.map(|(name, at)| (placed(&name), at))).collect();
        place_some(&mut self.out);
        place_some(&mut self.cache);
        self.tuned.iter_mut().for_each(place);
        place_manifests(&mut self.matchers);
        for dataset in &mut self.datasets {
            place(&mut dataset.path);
            dataset.matchers.iter_mut().for_each(place_manifests);
            if let Some(import) = &mut dataset.import {
                if import.kind != RENDERED {
                    place(&mut import.source);
                }
                place_some(&mut import.camera);
                place_some(&mut import.poses);
                place_some(&mut import.image_root);
                place_some(&mut import.intrinsics);
                if let Some(PairRule::List { file }) = &mut import.pairs {
                    place(file);
                }
            }
        }
        for matches in &mut self.matches {
            matches.files.iter_mut().for_each(place);
        }
    }
}

/// The lines of matchers, of the ids of settings and of the folders of datasets.
#[derive(Deserialize)]
struct Places {
    #[serde(default)]
    matchers: Vec<toml::Spanned<String>>,
    #[serde(default)]
    set: BTreeMap<toml::Spanned<String>, toml::Value>,
    #[serde(default, rename = "dataset")]
    datasets: Vec<DatasetPlace>,
}

#[derive(Deserialize)]
struct DatasetPlace {
    path: toml::Spanned<toml::Value>,
    #[serde(default)]
    matchers: Vec<toml::Spanned<String>>,
}

fn line_of(text: &str, byte: usize) -> usize {
    text.bytes().take(byte).filter(|&b| b == b'\n').count() + 1
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::super::StudyDataset;
    use super::*;

    fn parse(text: &str) -> Result<Study, StudyError> {
        Study::parse(text, Path::new("study.toml"))
    }

    #[test]
    fn what_is_left_out_has_the_defaults_of_the_command_line() {
        assert_eq!(parse("").unwrap(), Study::default());
        let study = parse("matchers = ['sift']\nseed = 3\n[[dataset]]\npath = 'office'\n").unwrap();
        let expected = Study {
            matchers: vec!["sift".into()],
            seed: 3,
            datasets: vec![StudyDataset {
                at: Some(("study.toml".into(), 4)),
                ..StudyDataset::at("office")
            }],
            ..Study::default()
        };
        assert_eq!(study, expected);
    }

    #[test]
    fn every_mistake_is_named_with_its_line() {
        for (text, line, named) in [
            ("seed = 1\ncolour = 3\n", 2, "colour"),
            ("\nmatchers = ['sift',\n 'srf']\n", 2, "did you mean `surf`"),
            ("matchers = ['sift', 'sift']\n", 1, "named twice"),
            ("estimators = ['ransac']\n", 1, "ransac-e"),
            ("seed = -1\n", 1, "-1"),
            ("repeat = 0\n", 1, "0"),
            ("repeat = 'x'\n", 1, "expected a whole number, 1 or more"),
            (
                "repeat = 4294967296\n",
                1,
                "expected a whole number, 4294967295 at most",
            ),
            ("limit = 0\n", 1, "0"),
            ("limit = 1.5\n", 1, "expected a whole number, 1 or more"),
            ("seed = 'x'\n", 1, "expected a whole number, 0 or more"),
            ("matchers = 'sift'\n", 1, "expected a list"),
            ("report = 1\n", 1, "expected true or false"),
            ("sample = 0\n", 1, "0"),
            ("protocols = ['superglu']\n", 1, "superglue"),
            ("seed = 1\n[set]\nsift.ratoi = 0.7\n", 3, "ratoi"),
            ("[set.sift]\nratio = 7\n", 1, "7"),
            ("[set]\nrich.threshold_px = -1\n", 2, "rich"),
            (
                "[set]\nsift.ratio = nan\n",
                2,
                "parameters of `sift`: `ratio` is nan",
            ),
            (
                "seed = 1\n[set]\nmine.part.x = -inf\n",
                3,
                "parameters of `mine`: `part.x` is -inf",
            ),
            (
                "[[dataset]]\nimport = { kind = 'tum', source = 'x' }\n",
                1,
                "path",
            ),
            ("[[dataset]]\npath = 'x'\nmatchers = ['gsm']\n", 3, "gms"),
            (
                "[[dataset]]\npath = 'x'\nimport = { kind = 'tum', source = 'y', pairs = 'few' }\n",
                3,
                "unknown pair rule `few`",
            ),
            (
                "[[dataset]]\npath = 'x'\nimport = { kind = 'tmu', source = 'y' }\n",
                3,
                "there are: tum, kitti",
            ),
            (
                "[[dataset]]\npath = 'x'\nimport = { kind = 'tum', source = 'y', tolerance = -1 }\n",
                3,
                "a tolerance of -1",
            ),
            ("seed = 1\nout = ''\n", 2, "the path is empty"),
            ("\ncache = ''\n", 2, "the path is empty"),
            ("\ntuned = ['t.json', '']\n", 2, "the path is empty"),
            ("[[dataset]]\npath = ''\n", 2, "the path is empty"),
            (
                "[[dataset]]\npath = 'x'\nimport.kind = 'tum'\nimport.source = ''\n",
                4,
                "the path is empty",
            ),
            (
                "[[dataset]]\npath = 'x'\n[dataset.import]\nkind = 'tum'\nsource = 'y'\nposes = ''\n",
                6,
                "the path is empty",
            ),
            (
                "seed = 1\n[[matches]]\nname = 'x'\nfiles = ['a', '']\n",
                2,
                "the path is empty",
            ),
            ("matchers = [\n", 1, ""),
        ] {
            is_at_line(text, line, named);
        }
    }

    /// Whether this text is refused for something of this name in this line.
    fn is_at_line(text: &str, line: usize, named: &str) {
        let Err(StudyError::File {
            line: found, what, ..
        }) = parse(text)
        else {
            panic!("{text}");
        };
        assert_eq!(found, Some(line), "{text}: {what}");
        assert!(what.contains(named), "{text}: {what}");
    }

    #[test]
    fn mistakes_in_matches_are_named_with_their_line() {
        for (of_matches, named) in [
            ("name = 'x'\nformat = 'nope'", "nope"),
            ("name = 'sift'", "that name is taken by what is built in"),
            (
                "name = 'x'\npixel_center = 0.3",
                "`pixel_center` is 0.3; it is 0 or 0.5",
            ),
            ("name = 'x'\nresized = [0, 4]", "`resized` has no pixels"),
        ] {
            let text = format!("seed = 1\n[[matches]]\nfiles = ['a']\n{of_matches}\n");
            is_at_line(&text, 2, named);
        }
    }

    #[test]
    fn paths_start_from_the_folder_of_the_file() {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("study.toml");
        let elsewhere = std::env::temp_dir().join("t.json");
        let text = "out = 'run'\nmatchers = ['sift', 'mine.toml']\ntuned = ['ELSEWHERE']\n\
            [[dataset]]\npath = 'set'\nimport = { kind = 'folder', source = 'photos', pairs = 'list:p' }\n\
            [[dataset]]\npath = 'wall'\nimport = { kind = 'rendered', source = 'mural' }\n";
        let text = text.replace("ELSEWHERE", &elsewhere.to_string_lossy());
        std::fs::write(&file, text).unwrap();
        let study = Study::read(&file).unwrap();
        let at = |name: &str| folder.path().join(name);
        assert_eq!(study.out, Some(at("run")));
        assert_eq!(study.matchers[1], at("mine.toml").to_string_lossy());
        assert_eq!(study.tuned, [elsewhere]);
        let import = study.datasets[0].import.as_ref().unwrap();
        assert_eq!(import.source, at("photos"));
        assert_eq!(import.pairs, Some(PairRule::List { file: at("p") }));
        // The name of a built-in scene is no path.
        let built_in = study.datasets[1].import.as_ref().unwrap();
        assert_eq!(built_in.source, Path::new("mural"));
        let absent = Study::read(&at("absent.toml")).unwrap_err().to_string();
        assert!(absent.contains("absent.toml"), "{absent}");
    }

    proptest! {
        #[test]
        fn no_text_panics(text in "(matchers = \\['sift'\\]\n)?(\\[set\\]\n)?.{0,60}") {
            let _ = parse(&text);
        }
    }
}
