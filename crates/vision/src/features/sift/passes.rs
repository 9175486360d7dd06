//! What is done in a scale space on its way past: keypoints are found, turned and described where they
//! lie, as long as their surroundings are there.

use std::ops::Range;

use super::descriptor::{LENGTH, PatchDescriber, patch_radius};
use super::extrema::{self, Extremum, ExtremumFinder};
use super::orientation::{Orientations, window_radius};
use super::patch::BEYOND;
use super::{Sift, is_inside};
use crate::features::Keypoint;
use crate::image::{GrayImage, LayerVisitor, Octave, Reach, Strip};

/// Pixels by which the place of a keypoint may differ from the pixel it was found at.
const ROUNDING: usize = 2;

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
    /// Their descriptors, if wanted.
    pub(super) descriptors: Vec<[f32; LENGTH]>,
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

/// Describes keypoints that are known.
pub(super) struct Description<'a> {
    sift: &'a Sift,
    describer: PatchDescriber,
    orientations: Orientations,
    /// Of the octaves from the finest to the last with a keypoint.
    octaves: Vec<Vec<PatchSite>>,
    /// The first place of the octave at work that is not in a row before the visitor's.
    next: usize,
    keypoints: &'a mut [Keypoint],
    /// Their descriptors.
    pub(super) descriptors: Vec<f32>,
}

/// Where a keypoint is described.
struct PatchSite {
    index: usize,
    layer: usize,
    column: usize,
    row: usize,
    radius: usize,
}

impl<'a> Description<'a> {
    /// For keypoints inside of `image`.
    pub(super) fn new(sift: &'a Sift, image: &GrayImage, keypoints: &'a mut [Keypoint]) -> Self {
        let octaves = sift.shape().octaves(image.size());
        let mut places: Vec<Vec<PatchSite>> = Vec::new();
        for (index, keypoint) in keypoints.iter().enumerate() {
            debug_assert!(is_inside(keypoint, image), "{keypoint:?}");
            let (octave, layer) = sift.level(keypoint, &octaves);
            let Octave { number, size } = octaves[octave];
            let (at, scale) = sift.in_octave(keypoint, number);
            let inside = |v: f32, length: usize| (v.round_ties_even() as usize).min(length - 1);
            places.resize_with(places.len().max(octave + 1), Vec::new);
            places[octave].push(PatchSite {
                index,
                layer,
                column: inside(at.x, size.width),
                row: inside(at.y, size.height),
                radius: patch_radius(size, scale).max(window_radius(size, scale)),
            });
        }
        for places in &mut places {
            places.sort_by_key(|place| place.row);
        }
        Self {
            sift,
            describer: PatchDescriber::default(),
            orientations: Orientations::default(),
            octaves: places,
            next: 0,
            descriptors: vec![0.0; LENGTH * keypoints.len()],
            keypoints,
        }
    }

    /// The places in row `y` of an octave.
    fn in_row(&mut self, octave: usize, y: usize) -> Range<usize> {
        let places = &self.octaves[octave];
        let start = if y == 0 { 0 } else { self.next };
        let count = places[start..].iter().take_while(|place| place.row == y);
        self.next = start + count.count();
        start..self.next
    }

    fn describe(&mut self, strip: &Strip, &PatchSite { index, layer, .. }: &PatchSite) {
        let keypoint = &mut self.keypoints[index];
        let (at, scale) = self.sift.in_octave(keypoint, strip.octave().number);
        let layer = strip.layer(layer);
        let angle = *keypoint.angle.get_or_insert_with(|| {
            let pixel = [at.x, at.y].map(|v| v.round_ties_even().max(0.0) as usize);
            self.orientations.strongest(layer, pixel, scale)
        });
        let descriptor = self.describer.describe(layer, at, scale, angle);
        self.descriptors[LENGTH * index..][..LENGTH].copy_from_slice(&descriptor);
    }

    fn index_of(&self, octave: Octave) -> usize {
        (octave.number - self.sift.finest()) as usize
    }
}

impl LayerVisitor for Description<'_> {
    fn reach(&self, octave: Octave) -> Option<Reach> {
        let places = self.octaves.get(self.index_of(octave))?;
        let largest = places.iter().map(|place| place.radius).max();
        Some(Reach {
            described: largest.unwrap_or(0) + BEYOND + ROUNDING,
            all: None,
        })
    }

    fn visit(&mut self, strip: &Strip, y: usize) {
        let octave = self.index_of(strip.octave());
        let range = self.in_row(octave, y);
        let places = std::mem::take(&mut self.octaves[octave]);
        for place in &places[range] {
            if strip.columns().contains(&place.column) {
                self.describe(strip, place);
            }
        }
        self.octaves[octave] = places;
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
