//! Whether a run has lost the notes of the images that its results are of.

use super::images::{FIRST_WITH_NOTES, ImageNotes};
use super::{FolderError, RunFolder, StoreError, earlier};

impl RunFolder {
    /// Refuses to go on without these `notes` of the images of a dataset: they are not there, but the run has results of it.
    ///
    /// # Errors
    /// [`FolderError::LostNotes`]; or if a file of records cannot be read.
    pub(crate) fn refuse_lost(&self, notes: &ImageNotes) -> Result<(), FolderError> {
        let has_notes = notes.is_there() || self.plan().format < FIRST_WITH_NOTES;
        if !has_notes && self.has_results_of(notes.dataset())? {
            return Err(notes.lost());
        }
        Ok(())
    }

    /// Whether a task of a dataset was recorded that did not fail, also if it waits since the run grew.
    fn has_results_of(&self, dataset: &str) -> Result<bool, StoreError> {
        let plan = self.plan();
        let mut has_results = false;
        for planned in (plan.datasets.iter()).filter(|planned| planned.name == dataset) {
            for matcher in plan.matchers_on(planned) {
                for estimator in &matcher.estimators {
                    let names = [dataset, &matcher.id, &estimator.id];
                    self.for_each_of(names, |record| {
                        has_results |= !record.outcome.has_failed();
                    })?;
                    earlier::for_each_waiting(self.path(), plan.format, names, |_, record| {
                        has_results |= !record.outcome.has_failed();
                        Ok::<_, StoreError>(())
                    })?;
                }
            }
        }
        Ok(has_results)
    }
}
