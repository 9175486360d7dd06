//! Why the folder of a run cannot be read or written.

use std::io;
use std::path::{Path, PathBuf};

use super::StoreError;

/// Why the folder of a run cannot be opened, read or written.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum FolderError {
    /// There is no plan, so it is no folder of a run.
    #[error("{} is not the folder of a run: it has no plan.json", folder.display())]
    NotARun {
        /// The folder.
        folder: PathBuf,
    },
    /// The folder is that of a run in parts, which is no run yet.
    #[error(
        "{} is the plan of shards and not that of a run; `matchbench merge` makes a run of them",
        path.display()
    )]
    OfShards {
        /// The plan.
        path: PathBuf,
    },
    /// The folder was written by a later program.
    #[error(
        "{} is of format {format}, and this program knows formats up to {known}; use a newer matchbench",
        path.display()
    )]
    Newer {
        /// The plan.
        path: PathBuf,
        /// The format that it names.
        format: u64,
        /// The last format that is known here.
        known: u32,
    },
    /// The folder holds a run of another plan.
    #[error(
        "{} holds a run of another plan: {difference}; to go on with it give all that it was started with, and more \
         datasets, matchers, estimators, pairs or repetitions if you like; for another run choose another folder",
        folder.display()
    )]
    OtherPlan {
        /// The folder of the run.
        folder: PathBuf,
        /// The first field that differs, and how.
        difference: String,
    },
    /// `plan.json` is missing beside records, or is not what a run writes.
    #[error("{}: {reason}; choose another folder, or delete this one to start anew", path.display())]
    Damaged {
        /// The file.
        path: PathBuf,
        /// What is wrong with it.
        reason: String,
    },
    /// Something is where a run writes, and there is no run.
    #[error(
        "{} is there, but no plan.json beside it, and a run would write into it; choose another folder for the run, or \
         delete it if a run has left it",
        path.display()
    )]
    Occupied {
        /// What is there.
        path: PathBuf,
    },
    /// The folder is that of a dataset, into which a run would write.
    #[error("{} is a dataset, and a run needs a folder of its own; choose another", folder.display())]
    IsDataset {
        /// The folder.
        folder: PathBuf,
    },
    /// A dataset is not the one that records were made from.
    #[error(
        "{dataset} is another dataset now than the run in {} was of: cameras, pairs or true poses differ; put back what \
         it was, or run it anew",
        folder.display()
    )]
    OtherDataset {
        /// The folder of the run.
        folder: PathBuf,
        /// Name of the dataset.
        dataset: String,
    },
    /// An image is not the one that records were made from.
    #[error(
        "{} is not the file that the run in {} has worked with: frame {frame} of {dataset} has \
         changed; put it back, or choose another folder for a run of the new one",
        image.display(),
        folder.display()
    )]
    ImageChanged {
        /// The image, or its depth.
        image: PathBuf,
        /// The folder of the run.
        folder: PathBuf,
        /// Name of the dataset.
        dataset: String,
        /// Index of the frame.
        frame: u32,
    },
    /// The file that notes which images the records are of is gone.
    #[error(
        "{} is gone, which notes the images of {dataset} that the run has results of; without it nobody can tell whether \
         they have changed since. Put it back, or choose another folder and run all of it anew; if you know that the images \
         are those of then, make an empty file of this name",
        path.display()
    )]
    LostNotes {
        /// The file.
        path: PathBuf,
        /// Name of the dataset.
        dataset: String,
    },
    /// Another process writes into the folder.
    #[error("{} is in use by another process; wait until it ends, or choose another folder", folder.display())]
    InUse {
        /// The folder of the run.
        folder: PathBuf,
    },
    /// A file of a run is a link, which could lead to any file of whoever runs it.
    #[error(
        "{} is a link, and a run writes into no file that a link leads to; put the file itself there, or \
         choose another folder",
        path.display()
    )]
    Link {
        /// The link.
        path: PathBuf,
    },
    /// A file is not what tuning writes.
    #[error("{}: not what `matchbench tune` writes ({reason})", path.display())]
    NotTuned {
        /// The file.
        path: PathBuf,
        /// What is wrong with it.
        reason: String,
    },
    /// A dataset of the plan is one that a setting was tuned on.
    #[error(
        "{setting} was tuned on {tuned_on}, which is the dataset {dataset}: a score on it would be no \
         test; take another dataset, or tune on others"
    )]
    TunedOn {
        /// The setting.
        setting: String,
        /// Name of the dataset when it was tuned.
        tuned_on: String,
        /// Name of the dataset in the plan.
        dataset: String,
    },
    /// Records or matches cannot be read or written.
    #[error(transparent)]
    Store(#[from] StoreError),
    /// Another file cannot be read or written; the error names it.
    #[error(transparent)]
    Io(#[from] io::Error),
}

impl FolderError {
    /// The error of trying to do `action` with the file at `path`.
    pub(super) fn io(action: &'static str, path: &Path) -> impl FnOnce(io::Error) -> Self {
        move |error| StoreError::io(action, path)(error).into()
    }

    /// The same error, where it is of a file of the folder `hidden` that becomes the folder `out`, naming it there.
    pub(super) fn staged(self, hidden: &Path, out: &Path) -> Self {
        match self {
            Self::Store(StoreError::Io {
                action,
                path,
                error,
            }) => {
                let inside = path.strip_prefix(hidden).map(|inside| out.join(inside));
                let path = inside.unwrap_or(path);
                StoreError::Io {
                    action,
                    path,
                    error,
                }
                .into()
            }
            other => other,
        }
    }
}
