//! One matcher with its estimators on one dataset: what is recorded, what is left.

use std::path::{Path, PathBuf};

use super::observer::has_failed;
use super::{Contender, RunError, RunSummary};
use crate::datasets::{Pair, Sequence};
use crate::records::{RunRecord, RunWriter, Settings, StoreError, Task};

/// One matcher on one dataset.
pub(super) struct Part<'a> {
    pub(super) sequence: &'a Sequence,
    pub(super) contender: &'a Contender,
    pairs: &'a [Pair],
    repetitions: u32,
    /// One file of records for each estimator.
    sheets: Vec<Sheet>,
}

/// The records of one estimator. They stand in the order of the tasks (pair by pair, repetition by
/// repetition), so their number says which are done.
struct Sheet {
    file: PathBuf,
    done: usize,
    failed: usize,
}

/// A pair with what is left to be done of it.
#[derive(Debug)]
pub(super) struct Unit<'a> {
    pub(super) pair: &'a Pair,
    pub(super) due: Vec<Due>,
}

/// A task of a pair.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Due {
    pub(super) repetition: u32,
    /// Index among the contender's estimators.
    pub(super) estimator: usize,
}

impl<'a> Part<'a> {
    /// The part as earlier processes left it; a torn last line is cut off.
    ///
    /// # Errors
    /// If records cannot be read or are not those of this part.
    pub(super) fn recover(
        folder: &RunWriter,
        sequence: &'a Sequence,
        contender: &'a Contender,
        settings: Settings,
    ) -> Result<Self, RunError> {
        let pairs = settings
            .limit
            .unwrap_or(usize::MAX)
            .min(sequence.pairs.len());
        let mut part = Self {
            sequence,
            contender,
            pairs: &sequence.pairs[..pairs],
            repetitions: settings.repetitions.get(),
            sheets: Vec::new(),
        };
        for variant in &contender.estimators {
            let matcher = contender.source.id();
            let (file, records) = folder.recover(&sequence.name, matcher, &variant.name)?;
            part.check(&file, &variant.name, &records)?;
            part.sheets.push(Sheet {
                file,
                done: records.len(),
                failed: records.iter().filter(|record| has_failed(record)).count(),
            });
        }
        Ok(part)
    }

    /// Each record must be that of the task whose turn it was.
    fn check(&self, file: &Path, estimator: &str, records: &[RunRecord]) -> Result<(), StoreError> {
        let mut tasks = self.pairs.iter().flat_map(|pair| {
            (0..self.repetitions).map(|repetition| self.task(pair, estimator, repetition))
        });
        let foreign =
            (records.iter()).position(|record| tasks.next().as_ref() != Some(&record.task));
        foreign.map_or(Ok(()), |index| {
            Err(StoreError::Corrupt {
                path: file.into(),
                line: index + 1,
                reason: "the plan has another task here".into(),
            })
        })
    }

    pub(super) fn task(&self, pair: &Pair, estimator: &str, repetition: u32) -> Task {
        Task {
            dataset: self.sequence.name.clone(),
            matcher: self.contender.source.id().into(),
            estimator: estimator.into(),
            a: pair.a,
            b: pair.b,
            repetition,
        }
    }

    pub(super) fn files(&self) -> impl Iterator<Item = &Path> {
        self.sheets.iter().map(|sheet| &*sheet.file)
    }

    pub(super) fn is_done(&self) -> bool {
        self.summary().is_complete()
    }

    pub(super) fn summary(&self) -> RunSummary {
        RunSummary {
            total: self.pairs.len() * self.repetitions as usize * self.sheets.len(),
            before: self.sheets.iter().map(|sheet| sheet.done).sum(),
            now: 0,
            failed: self.sheets.iter().map(|sheet| sheet.failed).sum(),
        }
    }

    /// What is left, pair by pair; within a pair repetition by repetition.
    pub(super) fn units(&self) -> Vec<Unit<'a>> {
        let mut units = Vec::new();
        let mut first_task = 0;
        for pair in self.pairs {
            let due: Vec<Due> = (0..self.repetitions)
                .flat_map(|repetition| {
                    (0..self.sheets.len()).map(move |estimator| Due {
                        repetition,
                        estimator,
                    })
                })
                .filter(|due| {
                    first_task + due.repetition as usize >= self.sheets[due.estimator].done
                })
                .collect();
            if !due.is_empty() {
                units.push(Unit { pair, due });
            }
            first_task += self.repetitions as usize;
        }
        units
    }
}
