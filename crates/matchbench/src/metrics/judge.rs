//! Judges the estimates of records again, by what a dataset knows of its pairs.
//!
//! A record holds the pose or homography that was estimated, and its stated error. If the dataset is available,
//! the stated error need not be trusted: it is computed again from the estimate. The error of a homography is
//! measured at the corners of the first image, so the file of this image must be available too.

use std::cell::OnceCell;
use std::collections::BTreeMap;

use matchbench_vision::image::Size;
use matchbench_vision::robust::HomographyEstimate;

use crate::datasets::{Frame, Pair};
use crate::records::{Outcome, RunRecord};

/// The truth of the pairs of a dataset, and its images as far as they are available.
#[derive(Debug)]
pub(crate) struct Judge {
    pairs: BTreeMap<(u32, u32), Pair>,
    /// Each with the size of its image, read when it is first needed; none where it cannot be read.
    frames: Vec<(Frame, OnceCell<Option<Size>>)>,
}

impl Judge {
    /// By the truth of these pairs; homographies only in images of the `frames`.
    pub(crate) fn new(pairs: impl IntoIterator<Item = Pair>, frames: Vec<Frame>) -> Self {
        let unread = |frame| (frame, OnceCell::new());
        Self {
            pairs: (pairs.into_iter())
                .map(|pair| ((pair.a, pair.b), pair))
                .collect(),
            frames: frames.into_iter().map(unread).collect(),
        }
    }

    /// Its pairs, sorted, none twice.
    pub(super) fn pairs(&self) -> impl Iterator<Item = (u32, u32)> {
        self.pairs.keys().copied()
    }

    /// Judges the estimate of a record again; `None` if this is not possible, since the image is not available. An
    /// outcome without an estimate is returned unchanged.
    ///
    /// # Errors
    /// If the dataset does not list the pair, or has no truth for this kind of estimate.
    pub(crate) fn judge(&self, record: &RunRecord) -> Result<Option<Outcome>, String> {
        let (a, b) = (record.task.a, record.task.b);
        let pair = (self.pairs.get(&(a, b)))
            .ok_or_else(|| format!("the dataset does not list the pair {a} {b}"))?;
        let unknown = |what| format!("the dataset knows no {what} of the pair {a} {b}");
        if let Some(pose) = record.outcome.pose() {
            let truth = pair.pose().ok_or_else(|| unknown("pose"))?;
            return Ok(Some(Outcome::judged(&pose, truth, 0, 0, 0)));
        }
        let Some(b_from_a) = record.outcome.homography() else {
            return Ok(Some(record.outcome.clone()));
        };
        let truth = pair.homography().ok_or_else(|| unknown("homography"))?;
        let estimate = HomographyEstimate {
            b_from_a,
            inliers: Vec::new(),
            iterations: 0,
        };
        let judged = |size| Outcome::judged_homography(&estimate, truth, size);
        Ok(self.size(a).map(judged))
    }

    /// The size of the image of a frame, if its file is available.
    fn size(&self, frame: u32) -> Option<Size> {
        let (frame, size) = self.frames.get(frame as usize)?;
        *size.get_or_init(|| frame.size().ok())
    }
}
