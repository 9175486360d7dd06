//! Takes over what was recorded before a run grew, line by line. `records` says where it is until then.

use std::collections::{BTreeMap, HashMap};
use std::path::PathBuf;

use crate::datasets::Pair;
use crate::records::store::{Lines, Place, RecordLine, RecordWriter};
use crate::records::{RunRecord, RunWriter, StoreError};

/// Records of before. They are read again when their turn has come.
#[derive(Default)]
pub(super) struct Earlier {
    file: PathBuf,
    /// Where the line of a task stands, by the index of the task.
    places: BTreeMap<usize, Place>,
}

impl Earlier {
    /// Whether there is one of the task with this index.
    pub(super) fn contains(&self, task: usize) -> bool {
        self.places.contains_key(&task)
    }

    /// How many there are.
    pub(super) fn len(&self) -> usize {
        self.places.len()
    }
}

/// The records of these `names` of before, of the tasks from number `done` on, of these `pairs` and so many
/// `repetitions`; those that are not `wanted` are left out.
///
/// # Errors
/// If they cannot be read or are not those of tasks of the plan.
pub(super) fn earlier(
    folder: &RunWriter,
    names: [&str; 3],
    pairs: &[&Pair],
    repetitions: u32,
    done: usize,
    mut wanted: impl FnMut(&RunRecord) -> bool,
) -> Result<Earlier, StoreError> {
    let (mut places, mut earlier, mut foreign) = (HashMap::new(), Earlier::default(), None);
    let file = folder.for_each_earlier(names, |line, at, record| {
        if places.is_empty() {
            places.extend((pairs.iter().zip(0_usize..)).map(|(pair, i)| ((pair.a, pair.b), i)));
        }
        let task = &record.task;
        let is_of_names = [&*task.dataset, &*task.matcher, &*task.estimator] == names;
        let place = places.get(&(task.a, task.b));
        match place.filter(|_| is_of_names && task.repetition < repetitions) {
            Some(place) => {
                let index = place * repetitions as usize + task.repetition as usize;
                if index >= done && wanted(&record) {
                    earlier.places.insert(index, at);
                }
            }
            None => {
                foreign.get_or_insert(line);
            }
        }
        Ok::<_, StoreError>(())
    })?;
    if let Some(file) = &file {
        earlier.file.clone_from(file);
    }
    match (file, foreign) {
        (Some(path), Some(line)) => Err(StoreError::Corrupt {
            path,
            line,
            reason: "the plan has no such task".into(),
        }),
        (Some(_), None) if done == pairs.len().saturating_mul(repetitions as usize) => {
            folder.remove_earlier(names)?;
            Ok(earlier)
        }
        _ => Ok(earlier),
    }
}

/// Appends the records of one estimator in the order of the tasks: new ones as they are computed, and between them those
/// of before.
pub(super) struct InOrder<'e> {
    writer: RecordWriter,
    earlier: &'e Earlier,
    lines: Option<Lines>,
    /// The index of the task whose record comes next.
    next: usize,
}

impl<'e> InOrder<'e> {
    /// Behind the first `done` records.
    ///
    /// # Errors
    /// If a record of before cannot be read or written.
    pub(super) fn new(
        writer: RecordWriter,
        earlier: &'e Earlier,
        done: usize,
    ) -> Result<Self, StoreError> {
        let mut in_order = Self {
            writer,
            earlier,
            lines: None,
            next: done,
        };
        in_order.take_over()?;
        Ok(in_order)
    }

    /// Appends the record of the next task of which there is none.
    ///
    /// # Errors
    /// If it cannot be written.
    pub(super) fn append_line(&mut self, line: &RecordLine) -> Result<(), StoreError> {
        self.writer.append_line(line)?;
        self.next += 1;
        self.take_over()
    }

    fn take_over(&mut self) -> Result<(), StoreError> {
        while let Some(&place) = self.earlier.places.get(&self.next) {
            let lines = match &mut self.lines {
                Some(lines) => lines,
                none => none.insert(Lines::of(&self.earlier.file)?),
            };
            self.writer.append_line(&lines.at(place)?)?;
            self.next += 1;
        }
        Ok(())
    }

    /// Makes what was appended safe from the power supply.
    ///
    /// # Errors
    /// If the system cannot.
    pub(super) fn sync(&mut self) -> Result<(), StoreError> {
        self.writer.sync()
    }

    /// How many records there are now.
    pub(super) fn recorded(&self) -> usize {
        self.next
    }
}
