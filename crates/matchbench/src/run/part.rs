//! One matcher with its estimators on one dataset: what is recorded, what is left.

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

use super::observer::has_failed;
use super::{Contender, RunError, RunSummary};
use crate::datasets::{Pair, Sequence};
use crate::matchers::Source;
use crate::records::{RunRecord, RunWriter, Settings, StoreError, Task, store};

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
    /// What is recorded, if some of it is to be tried again.
    records: Vec<RunRecord>,
    /// Tasks that failed and are tried again, by their places among the records.
    again: BTreeSet<usize>,
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
            // A source outside may do better another time; what is here would do the same again.
            let outside = matches!(contender.source, Source::Points(_));
            let failed = (records.iter().enumerate()).filter(|(_, record)| has_failed(record));
            let failed: BTreeSet<usize> = failed.map(|(index, _)| index).collect();
            let (again, failed) = if outside {
                (failed, 0)
            } else {
                (BTreeSet::new(), failed.len())
            };
            part.sheets.push(Sheet {
                file,
                done: records.len(),
                failed,
                records: if again.is_empty() {
                    Vec::new()
                } else {
                    records
                },
                again,
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

    pub(super) fn is_done(&self) -> bool {
        self.summary().is_complete()
    }

    pub(super) fn summary(&self) -> RunSummary {
        RunSummary {
            total: self.pairs.len() * self.repetitions as usize * self.sheets.len(),
            before: (self.sheets.iter())
                .map(|sheet| sheet.done - sheet.again.len())
                .sum(),
            now: 0,
            failed: self.sheets.iter().map(|sheet| sheet.failed).sum(),
            ended: 0,
        }
    }

    /// What is tried again, in the same order.
    pub(super) fn units_again(&self) -> Vec<Unit<'a>> {
        self.units_where(|sheet, task| sheet.again.contains(&task))
    }

    /// Puts a record in the place of one that failed.
    ///
    /// # Errors
    /// If the file cannot be written.
    pub(super) fn replace(
        &mut self,
        estimator: usize,
        record: RunRecord,
    ) -> Result<(), StoreError> {
        let sheet = &mut self.sheets[estimator];
        let place = sheet.records.iter().position(|old| old.task == record.task);
        sheet.records[place.expect("it was recorded before")] = record;
        store::rewrite(&sheet.file, &sheet.records)
    }

    /// What is left, pair by pair; within a pair repetition by repetition.
    pub(super) fn units(&self) -> Vec<Unit<'a>> {
        self.units_where(|sheet, task| task >= sheet.done)
    }

    /// The tasks that are `due`, told by the sheet and the place of the task in it.
    fn units_where(&self, is_due: impl Fn(&Sheet, usize) -> bool) -> Vec<Unit<'a>> {
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
                    let task = first_task + due.repetition as usize;
                    is_due(&self.sheets[due.estimator], task)
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
