//! Detection and description of SIFT while the scale space is computed strip by strip: keypoints are found,
//! given a direction and described in the strip where they lie, as long as their surroundings are in memory.

use super::Sift;
use super::descriptor::{LENGTH, PatchDescriber, patch_radius};
use super::extrema::{self, Extremum, ExtremumFinder};
use super::orientation::{Orientations, window_radius};
use super::patch::BEYOND;
use crate::features::Keypoint;
use crate::image::{LayerVisitor, Octave, Reach, Strip};

/// Pixels by which the place of a keypoint may differ from the pixel it was found at.
pub(super) const ROUNDING: usize = 2;

/// Finds the keypoints of an image.
pub(super) struct Detection<'a> {
    sift: &'a Sift,
    finder: ExtremumFinder<'a>,
    orientations: Orientations,
    extrema: Vec<Extremum>,
    /// Describes keypoints, if that is wanted.
    describer: Option<PatchDescriber>,
    /// All keypoints, in no particular order.
    pub(super) keypoints: Vec<Keypoint>,
    /// Their descriptors, if wanted: as bytes, a quarter of the memory that grows with each keypoint.
    pub(super) descriptors: Vec<[u8; LENGTH]>,
}

impl<'a> Detection<'a> {
    pub(super) fn new(sift: &'a Sift, described: bool) -> Self {
        Self {
            sift,
            finder: ExtremumFinder::new(&sift.params),
            orientations: Orientations::default(),
            extrema: Vec::new(),
            describer: described.then(PatchDescriber::default),
            keypoints: Vec::new(),
            descriptors: Vec::new(),
        }
    }

    fn add(&mut self, strip: &Strip, extremum: &Extremum) {
        let octave = strip.octave();
        let keypoint = self.sift.keypoint(octave.number, extremum);
        let layer = strip.layer(extremum.layer);
        let angles = (self.orientations).peaks(layer, extremum.pixel, extremum.scale);
        for &angle in angles {
            self.keypoints.push(Keypoint {
                angle: Some(angle),
                ..keypoint
            });
            if let Some(describer) = &mut self.describer {
                // Where the keypoint says it is, as if it came from elsewhere.
                let (at, scale) = self.sift.in_octave(&keypoint, octave.number);
                let descriptor = describer.describe(layer, at, scale, angle);
                self.descriptors.push(descriptor);
            }
        }
    }
}

impl LayerVisitor for Detection<'_> {
    fn reach(&self, octave: Octave) -> Option<Reach> {
        let scale = self.sift.largest_scale();
        let around = match self.describer {
            Some(_) => patch_radius(octave.size, scale),
            None => window_radius(octave.size, scale),
        };
        Some(Reach {
            described: extrema::REACH + around + BEYOND + ROUNDING,
            all: Some(extrema::REACH),
        })
    }

    fn visit(&mut self, strip: &Strip, y: usize) {
        let mut extrema = std::mem::take(&mut self.extrema);
        self.finder.find(strip, y, &mut extrema);
        for extremum in extrema.drain(..) {
            self.add(strip, &extremum);
        }
        self.extrema = extrema;
    }
}

impl Sift {
    /// The largest scale that a keypoint has in its octave, in pixels of that.
    fn largest_scale(&self) -> f32 {
        let layers = self.params.octave_layers as f32;
        self.params.sigma as f32 * libm::exp2f((layers + 0.5) / layers)
    }

    /// Number of the finest octave.
    pub(super) fn finest(&self) -> i32 {
        if self.params.double_image { -1 } else { 0 }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::image::Size;

    #[test]
    fn patches_of_found_keypoints_lie_within_reach() {
        let sift = Sift::new(crate::features::SiftParams::default()).expect("in range");
        let octave = Octave {
            number: 0,
            size: Size::new(900, 700),
        };
        // 3.59 pixels of scale: three times that for a cell, of which 3.5 fit half a diagonal.
        let reach = Detection::new(&sift, true).reach(octave).expect("always");
        assert_eq!(reach.described, 8 + 38 + 8 + 2);
        let reach = Detection::new(&sift, false).reach(octave).expect("always");
        assert_eq!(reach.described, 8 + 16 + 8 + 2);
    }
}
