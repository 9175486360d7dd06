//! The paper again, from the data as their authors publish them: Bian et al., "MatchBench: An Evaluation of
//! Feature Matchers".
//!
//! `paper.toml` is the study: eight sequences, their rules and matchers. [`Paper::study`] imports what the user
//! has downloaded ([`DOWNLOADS`]) and says what is missing. The study is run like any other. [`times`] measures
//! what the paper's Table 3 shows, and [`write_paper`](crate::report::write_paper) writes Tables 1 to 3 and
//! Figures 1 to 3 with the published numbers beside ours. All of it is resumed where it was stopped.
//!
//! A quick look leaves out [`HEAVY`] and takes [`QUICK_PAIRS`] of each sequence, evenly spread. It is a run of its
//! own, in `quick/`, with the same datasets and features.

mod sources;
mod times;

use std::io;
use std::num::NonZeroUsize;
use std::path::{Path, PathBuf};

use crate::config::{Changes, UnknownName, find};
use crate::datasets::{DatasetError, Sequence};
use crate::records::FolderError;
use crate::report::check_paper_folder;
use crate::study::{News, Study, StudyError};
use crate::time::TimeError;

pub use sources::{DOWNLOADS, Download, where_to_find};
pub use times::times;

/// Number of pairs of each sequence in a quick look.
pub const QUICK_PAIRS: NonZeroUsize = NonZeroUsize::new(60).expect("it is not 0");
/// Number of pairs that times are measured on: as in the paper, and in a quick look.
const TIMED_PAIRS: [usize; 2] = [200, 10];
/// Matchers that take seconds for a pair; a quick look leaves them out.
pub const HEAVY: [&str; 3] = ["gaim", "code", "repmatch"];

const STUDY: &str = include_str!("paper.toml");

/// What to reproduce, and where.
#[derive(Clone, Debug, PartialEq)]
pub struct Paper {
    /// The folder of the downloaded data.
    pub data: PathBuf,
    /// The folder for all results.
    pub out: PathBuf,
    /// Numbers of sequences, such as `05`; if empty, all.
    pub sequences: Vec<String>,
    /// Whether it is a quick look.
    pub quick: bool,
    /// Changed parameters.
    pub set: Changes,
}

/// A sequence that is left out.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct LeftOut {
    /// Its name.
    pub sequence: String,
    /// Why.
    pub reason: String,
    /// Whether its data exist but something is wrong with them.
    pub is_broken: bool,
}

/// Why the paper cannot be run.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum PaperError {
    /// There is no sequence of this number.
    #[error(transparent)]
    Sequence(#[from] UnknownName),
    /// None of the data exist.
    #[error(
        "{0}: none of the paper's data can be used; `matchbench paper --where` says what belongs there"
    )]
    NoData(PathBuf),
    /// The study.
    #[error(transparent)]
    Study(#[from] StudyError),
    /// The measurement of times.
    #[error(transparent)]
    Time(#[from] TimeError),
    /// The folder of the run.
    #[error(transparent)]
    Folder(#[from] FolderError),
    /// A file cannot be read or written.
    #[error(transparent)]
    Io(#[from] io::Error),
}

impl Paper {
    /// The study of the sequences whose data exist; their datasets are imported. Also returns the sequences
    /// that are left out.
    ///
    /// # Errors
    /// If there is no sequence with a requested number, if none of the data can be used, or if the folder has files
    /// that are not of an earlier paper where its own would be.
    pub fn study(&self, tell: &dyn Fn(News<'_>)) -> Result<(Study, Vec<LeftOut>), PaperError> {
        let mut study = Study::parse(STUDY, Path::new("paper.toml"))?;
        for asked in &self.sequences {
            find("sequence", &NUMBERS, |number| number, asked)?;
        }
        check_paper_folder(&self.folder())?;
        study.set = study.set.with(self.set.clone());
        study.out = Some(self.folder().join("run"));
        study.cache = Some(self.out.join("cache"));
        if self.quick {
            study.sample = Some(QUICK_PAIRS);
        }
        let is_light = |name: &String| !self.quick || !HEAVY.contains(&&**name);
        study.matchers.retain(is_light);
        let (mut datasets, mut left_out) = (Vec::new(), Vec::new());
        for mut dataset in study.datasets {
            let name = dataset.path.to_string_lossy().into_owned();
            let is_asked = |number: &String| name.starts_with(&**number);
            if !self.sequences.is_empty() && !self.sequences.iter().any(is_asked) {
                continue;
            }
            dataset.path = self.out.join("datasets").join(&name);
            // Imported here one by one, so that a sequence that cannot be imported does not stop the others.
            let mut import = dataset.import.take().expect("every sequence has a source");
            import.source = self.data.join(&import.source);
            // Images that a list names may not be there.
            let opened = || Sequence::open(&dataset.path).map(drop);
            match import.once(&dataset.path, tell).and_then(|()| opened()) {
                Ok(()) => datasets.push(dataset),
                Err(error) => left_out.push(self.left_out(name, &error)),
            }
        }
        if datasets.is_empty() && left_out.iter().all(|sequence| !sequence.is_broken) {
            return Err(PaperError::NoData(self.data.clone()));
        }
        study.datasets = datasets;
        Ok((study, left_out))
    }

    /// The folder of tables, figures, report and run: `out`, or `quick` in it.
    pub fn folder(&self) -> PathBuf {
        if self.quick {
            self.out.join("quick")
        } else {
            self.out.clone()
        }
    }

    /// The number of pairs that times are measured on.
    pub fn timed_pairs(&self) -> usize {
        TIMED_PAIRS[usize::from(self.quick)]
    }

    fn left_out(&self, sequence: String, error: &DatasetError) -> LeftOut {
        let number = sequence.get(..2).unwrap_or_default();
        let needed = (DOWNLOADS.iter())
            .filter(|download| download.sequences.contains(&number))
            .flat_map(|download| download.folders);
        let missing: Vec<String> = needed
            .map(|folder| self.data.join(folder))
            .filter(|folder| !folder.exists())
            .map(|folder| folder.display().to_string())
            .collect();
        LeftOut {
            is_broken: missing.is_empty(),
            reason: if missing.is_empty() {
                error.to_string()
            } else {
                format!("there is no {}", missing.join(" and no "))
            },
            sequence,
        }
    }
}

/// The numbers of the sequences.
const NUMBERS: [&str; 8] = ["01", "02", "03", "04", "05", "06", "07", "08"];

#[cfg(test)]
mod tests {
    use super::*;
    use crate::matchers::MATCHERS;

    fn paper(data: &Path, out: &Path) -> Paper {
        Paper {
            data: data.to_path_buf(),
            out: out.to_path_buf(),
            sequences: Vec::new(),
            quick: false,
            set: Changes::default(),
        }
    }

    #[test]
    fn the_study_has_what_the_paper_has() {
        let study = Study::parse(STUDY, Path::new("paper.toml")).expect("it is ours");
        let names: Vec<String> = (study.datasets.iter())
            .map(|dataset| dataset.path.to_string_lossy().into_owned())
            .collect();
        assert!(
            names
                .iter()
                .zip(NUMBERS)
                .all(|(name, number)| name.starts_with(number))
        );
        assert_eq!(names.len(), NUMBERS.len());
        // All matchers of the paper; RootSIFT, DSP-SIFT, ASIFT, GMS with scales and AdaLAM, also on ASIFT, are not in it.
        let ours: Vec<&str> = (MATCHERS.iter().map(|entry| entry.id()))
            .filter(|id| !study.matchers.iter().any(|name| name == id))
            .collect();
        assert_eq!(
            ours,
            [
                "rootsift",
                "dsp-sift",
                "asift",
                "gms-s",
                "adalam",
                "adalam-asift"
            ]
        );
        for (dataset, short) in study.datasets.iter().zip([true, true, true, true, false]) {
            assert_eq!(dataset.matchers.is_some(), short, "{:?}", dataset.path);
        }
        let slow = ["kvld", "gaim", "code", "repmatch"];
        let matchers = study.datasets[0].matchers.as_ref().expect("its own");
        let rest: Vec<&String> = (study.matchers.iter())
            .filter(|name| !slow.contains(&&***name))
            .collect();
        assert_eq!(matchers.iter().collect::<Vec<_>>(), rest);
        // Every sequence can be downloaded.
        for (dataset, number) in study.datasets.iter().zip(NUMBERS) {
            let source = &dataset.import.as_ref().expect("a source").source;
            let holds = |download: &&Download| download.sequences.contains(&number);
            let download = DOWNLOADS.iter().find(holds).expect("it has a download");
            let starts = |folder: &&str| Path::new(folder).starts_with(source);
            assert!(download.folders.iter().all(starts), "{number}");
        }
    }

    #[test]
    fn what_is_not_there_is_said_and_what_is_broken_too() {
        let folder = tempfile::tempdir().expect("a temporary folder");
        let (data, out) = (folder.path().join("data"), folder.path().join("out"));
        let mut asked = paper(&data, &out);
        let nothing = asked
            .study(&|_| {})
            .expect_err("there is nothing")
            .to_string();
        assert!(nothing.contains("--where"), "{nothing}");
        std::fs::create_dir_all(data.join("castle-P30/images")).expect("writable");
        std::fs::create_dir_all(data.join("dataset/sequences/06")).expect("writable");
        let (study, left_out) = asked.study(&|_| {}).expect("something is broken");
        assert!(study.datasets.is_empty());
        let broken: Vec<&str> = (left_out.iter())
            .filter(|sequence| sequence.is_broken)
            .map(|sequence| &*sequence.sequence)
            .collect();
        assert_eq!(broken, ["05-castle"]);
        assert_eq!(left_out.len(), 8);
        assert!(
            left_out[3].reason.contains("dataset/sequences/00"),
            "{left_out:?}"
        );
        asked.sequences = vec!["5".into()];
        let unknown = asked.study(&|_| {}).expect_err("numbers have two digits");
        assert!(
            unknown.to_string().contains("did you mean `05`"),
            "{unknown}"
        );
    }

    #[test]
    fn a_sequence_of_which_images_are_missing_does_not_stop_the_others() {
        let folder = tempfile::tempdir().expect("a temporary folder");
        let (data, out) = (folder.path().join("data"), folder.path().join("out"));
        for (name, images) in [("teddy", 2), ("large_cabinet", 3)] {
            let source = data.join(format!("rgbd_dataset_freiburg3_{name}"));
            std::fs::create_dir_all(&source).expect("writable");
            let write = |name: &str, text: &str| std::fs::write(source.join(name), text);
            let pose = "0 0 0 0 0 0 1";
            write("rgb.txt", "1 0.pgm\n2 1.pgm\n3 2.pgm\n").expect("writable");
            let poses = format!("1 {pose}\n2 {pose}\n3 {pose}\n");
            write("groundtruth.txt", &poses).expect("writable");
            for image in 0..images {
                write(&format!("{image}.pgm"), "P5 1 1 255\n.").expect("writable");
            }
        }
        let mut asked = paper(&data, &out);
        asked.sequences = vec!["02".into(), "03".into()];
        let (study, left_out) = asked.study(&|_| {}).expect("one is whole");
        let [
            LeftOut {
                sequence, reason, ..
            },
        ] = &left_out[..]
        else {
            panic!("{left_out:?}");
        };
        assert!(
            sequence == "02-teddy" && reason.contains("2.pgm: the image is missing"),
            "{reason}"
        );
        assert!(left_out[0].is_broken);
        let whole: Vec<_> = study.datasets.iter().map(|dataset| &dataset.path).collect();
        assert_eq!(whole, [&out.join("datasets/03-large-cabinet")]);
    }
}
