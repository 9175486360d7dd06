//! Turns a study into what is run: opens or imports datasets, builds or starts matchers.

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};
use std::slice;

use serde_json::Value;

use super::error::CORRECT;
use super::names::check_name;
use super::{MatchesFrom, Study, StudyDataset, StudyError};
use crate::cache::FeatureCache;
use crate::config::Changes;
use crate::datasets::{
    DatasetError, ImportReport, Problem, Sequence, camera_problems, pair_pose_problem,
};
use crate::exchange::{MatchSource, ReadOptions};
use crate::external::{Manifest, ManifestError, StartError};
use crate::files::place_of;
use crate::front_door::SETTINGS;
use crate::matchers::{self, BuiltPointSource, expanded};
use crate::protocols;
use crate::records::{KeepMatches, Plan, RunFolder, RunSettings, Tuned};
use crate::run::{
    Cancel, Contender, ContenderError, Dataset, Outside, Run, built_in, default_estimators,
    manifest,
};

/// A study that is ready to run: its datasets are open, and its matchers are built.
#[derive(Debug)]
pub struct Prepared {
    /// The datasets, each with the matchers that are run on it.
    pub datasets: Vec<Dataset>,
    /// The matchers with their estimators.
    pub contenders: Vec<Contender>,
    /// The names of the estimators of all matchers; none where each has its own.
    pub estimators: Vec<String>,
    /// Matchers from outside that did not start.
    pub absent: Vec<StartError>,
    /// The folder of the run.
    pub folder: PathBuf,
    /// The other settings that the records depend on.
    pub settings: RunSettings,
    /// The tuned choices that are used.
    pub tuned: Vec<Tuned>,
    cache: FeatureCache,
    keep_matches: KeepMatches,
    retry_failed: bool,
}

/// Events while a study is prepared.
#[derive(Debug)]
pub enum News<'a> {
    /// A dataset was imported into this folder.
    Imported(&'a Path, &'a ImportReport),
    /// The camera of a dataset looks wrong, or its pairs contradict its poses.
    Problem(&'a Problem),
    /// Matches of this name were read from files.
    Matches(&'a str, &'a MatchSource),
}

impl Prepared {
    /// The run.
    pub fn run(&self) -> Run<'_> {
        Run {
            settings: self.settings,
            tuned: &self.tuned,
            cache: self.cache.clone(),
            keep_matches: self.keep_matches,
            retry_failed: self.retry_failed,
            ..Run::new(&self.datasets, &self.contenders, &self.folder)
        }
    }
}

impl Study {
    /// Opens its datasets, imports those that do not exist, reads matches from files, builds its matchers and
    /// starts those from outside. `tell` is called with each event.
    ///
    /// # Errors
    /// If it names no dataset, no matcher or no folder; if one of them, a parameter or a tuning is wrong; or if
    /// no matcher could be started.
    pub fn prepare(&self, tell: &dyn Fn(News<'_>)) -> Result<Prepared, StudyError> {
        self.prepare_with(Dataset::open, tell)
    }

    /// The same for [`plan_shards`](crate::run::plan_shards). Of datasets with many pairs, only few pairs are
    /// kept in memory.
    ///
    /// # Errors
    /// As [`Study::prepare`].
    pub fn prepare_plan(&self, tell: &dyn Fn(News<'_>)) -> Result<Prepared, StudyError> {
        // All pairs are needed to find out which file belongs to which pair.
        let needs_pairs = !self.matches.is_empty();
        let open = if needs_pairs {
            Dataset::open
        } else {
            Dataset::survey
        };
        self.prepare_with(open, tell)
    }

    fn prepare_with(
        &self,
        open_dataset: fn(&Path) -> Result<Dataset, DatasetError>,
        tell: &dyn Fn(News<'_>),
    ) -> Result<Prepared, StudyError> {
        self.folder()?;
        if self.datasets.is_empty() {
            return Err(StudyError::Incomplete {
                what: "dataset",
                remedy: "its folder, or [[dataset]] in the run file",
            });
        }
        if self.all_matchers().is_empty() && self.matches.is_empty() {
            return Err(StudyError::Incomplete {
                what: "matcher",
                remedy: "--matchers or --matches, or `matchers` in the run file",
            });
        }
        // Before datasets are imported, which may take long.
        let tuned = self.checked()?;
        let datasets = (self.datasets.iter())
            .map(|dataset| open(dataset, open_dataset, tell))
            .collect::<Result<Vec<_>, _>>()?;
        self.prepare_tuned(datasets, Vec::new(), tuned, &Cancel::default(), tell)
    }

    /// The same on `datasets` that are open already, in the order of those of the study if it names any, and with
    /// further `sources` of matches, which come last. Once `cancel` is set, no program is waited for any more that is not
    /// ready; it counts as one that does not start.
    ///
    /// # Errors
    /// As [`Study::prepare`].
    pub fn prepare_on(
        &self,
        datasets: Vec<Dataset>,
        sources: Vec<BuiltPointSource>,
        cancel: &Cancel,
        tell: &dyn Fn(News<'_>),
    ) -> Result<Prepared, StudyError> {
        self.prepare_tuned(datasets, sources, self.checked()?, cancel, tell)
    }

    fn prepare_tuned(
        &self,
        mut datasets: Vec<Dataset>,
        sources: Vec<BuiltPointSource>,
        tuned: Vec<Tuned>,
        cancel: &Cancel,
        tell: &dyn Fn(News<'_>),
    ) -> Result<Prepared, StudyError> {
        let folder = self.folder()?;
        let protocols = protocols::find_all(&self.protocols).map_err(ContenderError::from)?;
        let run_settings = self.settings().map_err(ContenderError::from)?;
        let settings: Vec<String> = tuned.iter().map(|tuned| tuned.setting.clone()).collect();
        let changes = Changes::parse(&settings)?.with(self.set.clone());
        for (tuned, file) in tuned.iter().zip(&self.tuned) {
            if !changes.hold(&Changes::parse(slice::from_ref(&tuned.setting))?) {
                return Err(StudyError::TunedOtherwise {
                    file: file.clone(),
                    setting: tuned.setting.clone(),
                });
            }
        }
        for dataset in &datasets {
            if is_same(folder, &dataset.path) {
                return Err(StudyError::OutIsDataset {
                    folder: folder.to_path_buf(),
                });
            }
            let (path, sequence) = (&dataset.path, &dataset.sequence);
            let problems = camera_problems(path, sequence).into_iter();
            for problem in problems.chain(pair_pose_problem(path, sequence)) {
                tell(News::Problem(&problem));
            }
        }
        self.check_manifests(&changes)?;
        let mut all_sources = sources_for(&self.matches, &datasets, tell)?;
        all_sources.extend(sources);
        for (dataset, asked) in datasets.iter_mut().zip(&self.datasets) {
            dataset.matchers = match &asked.matchers {
                None if self.datasets.iter().all(|other| other.matchers.is_none()) => None,
                own => {
                    let names = expanded(own.as_deref().unwrap_or(&self.matchers));
                    let ids = names.iter().map(|name| id(name, &changes));
                    let mut ids = ids.collect::<Result<BTreeSet<_>, _>>()?;
                    ids.extend(all_sources.iter().map(|source| source.id.clone()));
                    Some(ids)
                }
            };
        }
        let cache = (self.cache.clone()).unwrap_or_else(|| RunFolder::default_cache_at(folder));
        let cache = FeatureCache::new(cache);
        let outside = Outside {
            logs: &RunFolder::logs_at(folder),
            cache: &cache,
            cancel,
        };
        let estimators = self.estimators_for(&datasets);
        let (contenders, absent) = Contender::from_names(
            &self.all_matchers(),
            all_sources,
            &estimators,
            &protocols,
            &changes,
            Some(&outside),
        )
        .map_err(|error| self.placed(error, &tuned))?;
        if contenders.is_empty() {
            let reasons: Vec<String> = absent.iter().map(ToString::to_string).collect();
            return Err(StudyError::NotStarted(reasons.join("; ")));
        }
        Ok(Prepared {
            datasets,
            contenders,
            estimators,
            absent,
            folder: folder.to_path_buf(),
            settings: run_settings,
            tuned,
            cache,
            keep_matches: self.keep_matches,
            retry_failed: self.retry_failed,
        })
    }

    /// The names of the estimators of all matchers; none where each has its own.
    fn estimators_for(&self, datasets: &[Dataset]) -> Vec<String> {
        if self.estimators.is_empty() && self.protocols.is_empty() {
            default_estimators(datasets)
        } else {
            self.estimators.clone()
        }
    }

    /// The folder of the run.
    fn folder(&self) -> Result<&Path, StudyError> {
        self.out.as_deref().ok_or(StudyError::Incomplete {
            what: "folder for the run",
            remedy: "--out RUN, or `out` in the run file",
        })
    }

    /// What the files of tunings chose, once no name of a protocol or of a native matcher is unknown: all that can be
    /// told before a dataset is open.
    fn checked(&self) -> Result<Vec<Tuned>, StudyError> {
        protocols::find_all(&self.protocols).map_err(ContenderError::from)?;
        let names = self.all_matchers();
        for name in names.iter().filter(|name| !Manifest::is_path(name)) {
            matchers::find(name).map_err(ContenderError::from)?;
        }
        let tuned = self.tuned.iter().map(|path| Tuned::read(path));
        Ok(tuned.collect::<Result<_, _>>()?)
    }

    /// Whether the manifests can be read and what `changes` has for them fits; errors of what the run file says name its
    /// line.
    fn check_manifests(&self, changes: &Changes) -> Result<(), StudyError> {
        let names = self.all_matchers();
        for name in names.iter().filter(|name| Manifest::is_path(name)) {
            let place = self.manifests_at.get(name);
            // What is wrong inside a manifest stands there, but not that there is none.
            let place = place.filter(|_| !Path::new(name).exists());
            let read = Manifest::read(Path::new(name), &built_in());
            let read = read.map_err(|error| {
                let what = format!("{}: {}", error.file.display(), error.what);
                in_run_file(place, what, error)
            })?;
            if let Some(changes) = changes.of(&read.name) {
                let place = self.set_at.get(&read.name);
                read.with(changes).map_err(|error| {
                    // Here it is no option that is wrong.
                    let option = format!("{SETTINGS} ");
                    let what = error.what.strip_prefix(&option).unwrap_or(&error.what);
                    in_run_file(place, what.to_owned(), error)
                })?;
            }
        }
        Ok(())
    }

    /// The error, with the line of the run file or with the file of a tuning if it is about one of these.
    fn placed(&self, error: ContenderError, tuned: &[Tuned]) -> StudyError {
        let place = match &error {
            ContenderError::TakesNoPart(id) => self.set_at.get(id),
            _ => None,
        };
        match place {
            None => match error {
                ContenderError::TakesNoPart(id) => self.nothing_tuned(id, tuned),
                error => error.into(),
            },
            Some((file, line)) => StudyError::File {
                file: file.clone(),
                line: Some(*line),
                what: error.to_string(),
                remedy: "ask for it too, or remove its setting here",
            },
        }
    }

    /// The error that a setting is for something that takes no part, with the file of the tuning if the setting
    /// comes from one.
    fn nothing_tuned(&self, id: String, tuned: &[Tuned]) -> StudyError {
        let sets = |tuned: &Tuned| tuned.setting.split('.').next() == Some(&*id);
        match tuned.iter().zip(&self.tuned).find(|(tuned, _)| sets(tuned)) {
            Some((_, file)) => StudyError::NothingTuned {
                file: file.clone(),
                id,
            },
            None => ContenderError::TakesNoPart(id).into(),
        }
    }

    /// The names of the matchers that are run on any dataset, in the order in which they are named: first those
    /// of the study, unless each dataset has its own, then those that datasets add.
    pub fn all_matchers(&self) -> Vec<String> {
        let mut all = Vec::new();
        let each_has_own = (self.datasets.iter()).all(|dataset| dataset.matchers.is_some());
        if self.datasets.is_empty() || !each_has_own {
            // Unchanged: the run itself reports a name that is there twice.
            all = expanded(&self.matchers);
        }
        for own in self
            .datasets
            .iter()
            .filter_map(|dataset| dataset.matchers.as_ref())
        {
            for name in expanded(own) {
                if !all.contains(&name) {
                    all.push(name);
                }
            }
        }
        all
    }
}

/// Matches from files for `datasets`; `tell` is called with each of them.
///
/// # Errors
/// If a name is taken or no name, or if files cannot be read or their matches are wrong.
pub fn sources_for(
    matches: &[MatchesFrom],
    datasets: &[Dataset],
    tell: &dyn Fn(News<'_>),
) -> Result<Vec<BuiltPointSource>, StudyError> {
    let sequences: Vec<_> = datasets.iter().map(|dataset| &dataset.sequence).collect();
    (matches.iter())
        .map(|from| {
            let source = open_matches(from, &sequences, None)?;
            tell(News::Matches(&from.name, &source));
            Ok(source.build(&from.name))
        })
        .collect()
}

/// Matches from files for `datasets` that have only some of the pairs of a `plan`. The files are read as the
/// plan interpreted them for all pairs.
///
/// # Errors
/// If files cannot be read or their matches are wrong; or if the files are not those in the plan.
pub fn sources_as_planned(
    matches: &[MatchesFrom],
    datasets: &[Dataset],
    plan: &Plan,
) -> Result<Vec<BuiltPointSource>, StudyError> {
    let sequences: Vec<_> = datasets.iter().map(|dataset| &dataset.sequence).collect();
    (matches.iter())
        .map(|from| {
            let planned = plan.matcher(&from.name).map(|matcher| &matcher.params);
            Ok(open_matches(from, &sequences, planned)?.build(&from.name))
        })
        .collect()
}

fn open_matches(
    from: &MatchesFrom,
    sequences: &[&Sequence],
    planned: Option<&Value>,
) -> Result<MatchSource, StudyError> {
    check_name(&from.name)?;
    let options = ReadOptions::of(from).map_err(ContenderError::from)?;
    MatchSource::open(&from.files, sequences, &options, planned).map_err(|error| {
        StudyError::Matches {
            name: from.name.clone(),
            error,
        }
    })
}

/// Opens the dataset; imports it first if it does not exist.
fn open(
    asked: &StudyDataset,
    open_dataset: fn(&Path) -> Result<Dataset, DatasetError>,
    tell: &dyn Fn(News<'_>),
) -> Result<Dataset, StudyError> {
    let imported = (asked.import.as_ref()).map_or(Ok(()), |import| import.once(&asked.path, tell));
    let opened = imported.and_then(|()| open_dataset(&asked.path));
    opened.map_err(|error| StudyError::Dataset {
        at: asked.at.clone(),
        error: Box::new(error),
    })
}

/// What is wrong with a line of a run file, if there is a `place`; else the error, which is one of a manifest.
fn in_run_file(place: Option<&(PathBuf, usize)>, what: String, error: ManifestError) -> StudyError {
    match place {
        None => error.into(),
        Some((file, line)) => StudyError::File {
            file: file.clone(),
            line: Some(*line),
            what,
            remedy: CORRECT,
        },
    }
}

/// The id that a matcher of this name has in a run.
fn id(name: &str, changes: &Changes) -> Result<String, StudyError> {
    if Manifest::is_path(name) {
        return Ok(manifest(Path::new(name), changes)?.name);
    }
    Ok(name.to_owned())
}

/// Whether both paths lead to the same place.
fn is_same(a: &Path, b: &Path) -> bool {
    matches!((place_of(a), place_of(b)), (Ok(a), Ok(b)) if a == b)
}

#[cfg(test)]
mod tests {
    use matchbench_vision::geometry::Camera;
    use nalgebra::{Isometry3, Matrix3};

    use super::*;
    use crate::datasets::{Frame, Pair, Turn};
    use crate::matchers::MATCHERS;

    #[test]
    fn matchers_of_a_dataset_take_the_place_of_those_of_the_study() {
        let study = |text: &str| Study::parse(text, Path::new("study.toml")).unwrap();
        let text = "matchers = ['sift', 'orb']\n[[dataset]]\npath = 'a'\n\
            [[dataset]]\npath = 'b'\nmatchers = ['orb', 'gms']\n";
        assert_eq!(study(text).all_matchers(), ["sift", "orb", "gms"]);
        let text = "matchers = ['sift']\n[[dataset]]\npath = 'b'\nmatchers = ['orb']\n";
        assert_eq!(study(text).all_matchers(), ["orb"]);
        let all = study("matchers = ['all']\n[[dataset]]\npath = 'b'\n").all_matchers();
        assert_eq!(all.len(), MATCHERS.len());
    }

    #[test]
    fn what_is_missing_is_named() {
        let prepare = |study: &Study| match study.prepare(&|_| {}) {
            Ok(_) => panic!("something is missing"),
            Err(error) => error.to_string(),
        };
        let mut study = Study::default();
        assert!(prepare(&study).contains("--out"));
        study.out = Some("run".into());
        assert!(prepare(&study).contains("[[dataset]]"));
        study.datasets = vec![StudyDataset::at("absent")];
        assert!(prepare(&study).contains("--matchers"));
        study.matchers = vec!["srf".into()];
        assert!(prepare(&study).contains("surf"));
        study.matchers = vec!["sift".into()];
        assert!(prepare(&study).contains("absent: no such folder"));

        let text = "out = 'run'\nmatchers = ['sift']\n[[dataset]]\npath = 'absent'\n";
        let study = Study::parse(text, Path::new("study.toml")).unwrap();
        let error = prepare(&study);
        assert!(error.starts_with("study.toml:4: "), "{error}");
    }

    #[test]
    fn what_a_run_file_says_of_manifests_is_named_with_its_line() {
        let folder = tempfile::tempdir().unwrap();
        let text = "name = 'mine'\ncommand = ['true']\nkind = 'features'\n";
        std::fs::write(folder.path().join("mine.toml"), text).unwrap();
        let refused = |text: &str| {
            let file = folder.path().join("study.toml");
            std::fs::write(&file, format!("out = 'run'\n{text}")).unwrap();
            let study = Study::read(&file).unwrap();
            let prepared = study.prepare_on(Vec::new(), Vec::new(), &Cancel::default(), &|_| {});
            (file, prepared.expect_err("it is wrong").to_string())
        };
        for (text, line, named) in [
            ("matchers = ['sift',\n 'gone.toml']\n", 3, "gone.toml: "),
            (
                "[[dataset]]\npath = 'x'\nmatchers = ['gone.toml']\n",
                4,
                "gone.toml: ",
            ),
            (
                "matchers = ['mine.toml']\n[set]\nmine.matching.ratoi = 1\n",
                4,
                ": mine.matching: unknown field `ratoi`",
            ),
        ] {
            let (file, error) = refused(text);
            let place = format!("{}:{line}: ", file.display());
            assert!(
                error.starts_with(&place) && error.contains(named),
                "{error}"
            );
            assert!(
                !error.contains("--set") && !error.contains("mine.toml"),
                "{error}"
            );
        }
    }

    #[test]
    fn where_homographies_alone_are_known_they_are_estimated() {
        let frame = Frame {
            image: "0.png".into(),
            name: None,
            turn: Turn::None,
            camera: Camera::pinhole(8.0, 8.0, 3.5, 3.5),
            world_from_camera: None,
            depth: None,
        };
        let dataset = |pair: Pair| Dataset {
            path: "wall".into(),
            sequence: Sequence {
                name: "wall".into(),
                frames: vec![frame.clone(), frame.clone()],
                pairs: vec![pair],
            },
            matchers: None,
            whole: None,
            pair_frames: None,
        };
        let (pose, homography) = (Isometry3::identity(), Matrix3::identity());
        let plane = Pair::with_homography(0, 1, homography);
        let views = Pair::with_pose(0, 1, pose);
        let folder = tempfile::tempdir().unwrap();
        let mut study = Study {
            out: Some(folder.path().join("run")),
            matchers: vec!["gms".into(), "sift".into()],
            ..Study::default()
        };
        let estimators = |study: &Study, pairs: &[Pair]| {
            let datasets = pairs.iter().map(|&pair| dataset(pair)).collect();
            let prepared = study
                .prepare_on(datasets, Vec::new(), &Cancel::default(), &|_| {})
                .unwrap();
            let names = |contender: &Contender| contender.estimators[0].name.clone();
            let used: Vec<String> = prepared.contenders.iter().map(names).collect();
            (prepared.estimators, used)
        };
        let own = (Vec::new(), vec!["rich".to_owned(), "ransac-e".to_owned()]);
        assert_eq!(estimators(&study, &[plane, plane]).1, ["best-h", "best-h"]);
        assert_eq!(
            estimators(&study, &[plane]).0,
            ["best-h"],
            "for shards, too"
        );
        assert_eq!(estimators(&study, &[views]), own);
        assert_eq!(estimators(&study, &[plane, views]), own);
        study.estimators = vec!["ransac-h".into()];
        assert_eq!(estimators(&study, &[plane]).1, ["ransac-h", "ransac-h"]);
    }
}
