//! Known keypoints in a scale space that is computed strip by strip: each is shown in the layer of its size,
//! while that strip is in memory.

use std::ops::Range;

use nalgebra::Point2;

use super::Sift;
use super::descriptor::patch_radius;
use super::orientation::window_radius;
use super::passes::ROUNDING;
use super::patch::BEYOND;
use crate::features::Keypoint;
use crate::image::{GrayImage, LayerVisitor, Octave, Reach, RowBuffer, Strip};

/// A keypoint in the layer that belongs to its size.
pub(in crate::features) struct Place<'a> {
    /// Which of the keypoints it is.
    pub(in crate::features) index: usize,
    /// The layer, with all that a patch of the keypoint needs.
    pub(in crate::features) layer: &'a RowBuffer,
    /// Position in pixels of the layer.
    pub(in crate::features) at: Point2<f32>,
    /// Scale of the keypoint in these pixels.
    pub(in crate::features) scale: f32,
}

impl Sift {
    /// Calls `each` for every keypoint of `image`: octave after octave from the finest, strip after strip,
    /// row after row, those of one row in their order.
    ///
    /// # Panics
    /// Unless all are inside of the image and have a size.
    pub(in crate::features) fn look_at(
        &self,
        image: &GrayImage,
        keypoints: impl IntoIterator<Item = Keypoint>,
        each: impl FnMut(Place<'_>),
    ) {
        let mut pass = Places::new(self, image, keypoints, each);
        self.shape().visit(image, &mut pass);
    }
}

/// Looks at keypoints that are known.
struct Places<F> {
    /// Number of the finest octave.
    finest: i32,
    /// Of the octaves from the finest to the last with a keypoint.
    octaves: Vec<Vec<Site>>,
    /// The first site of the octave at work that is not in a row before the visitor's.
    next: usize,
    each: F,
}

/// Where a keypoint is described.
struct Site {
    index: usize,
    layer: usize,
    at: Point2<f32>,
    scale: f32,
    column: usize,
    row: usize,
    radius: usize,
}

/// Bytes that are kept of a keypoint meanwhile.
pub(in crate::features) const BYTES_PER_PLACE: usize = size_of::<Site>();

impl<F: FnMut(Place<'_>)> Places<F> {
    fn new(
        sift: &Sift,
        image: &GrayImage,
        keypoints: impl IntoIterator<Item = Keypoint>,
        each: F,
    ) -> Self {
        let octaves = sift.shape().octaves(image.size());
        let mut sites: Vec<Vec<Site>> = Vec::new();
        for (index, keypoint) in keypoints.into_iter().enumerate() {
            debug_assert!(keypoint.is_describable_in(image.size()), "{keypoint:?}");
            let (octave, layer) = sift.level(&keypoint, &octaves);
            let Octave { number, size } = octaves[octave];
            let (at, scale) = sift.in_octave(&keypoint, number);
            let inside = |v: f32, length: usize| (v.round_ties_even() as usize).min(length - 1);
            sites.resize_with(sites.len().max(octave + 1), Vec::new);
            sites[octave].push(Site {
                index,
                layer,
                at,
                scale,
                column: inside(at.x, size.width),
                row: inside(at.y, size.height),
                radius: patch_radius(size, scale).max(window_radius(size, scale)),
            });
        }
        for sites in &mut sites {
            sites.sort_by_key(|site| site.row);
        }
        Self {
            finest: sift.finest(),
            octaves: sites,
            next: 0,
            each,
        }
    }

    /// The sites in row `y` of an octave.
    fn in_row(&mut self, octave: usize, y: usize) -> Range<usize> {
        let sites = &self.octaves[octave];
        let start = if y == 0 { 0 } else { self.next };
        let count = sites[start..].iter().take_while(|site| site.row == y);
        self.next = start + count.count();
        start..self.next
    }

    fn index_of(&self, octave: Octave) -> usize {
        (octave.number - self.finest) as usize
    }
}

impl<F: FnMut(Place<'_>)> LayerVisitor for Places<F> {
    fn reach(&self, octave: Octave) -> Option<Reach> {
        let sites = self.octaves.get(self.index_of(octave))?;
        let largest = sites.iter().map(|site| site.radius).max();
        Some(Reach {
            described: largest.unwrap_or(0) + BEYOND + ROUNDING,
            all: None,
        })
    }

    fn visit(&mut self, strip: &Strip, y: usize) {
        let octave = self.index_of(strip.octave());
        let range = self.in_row(octave, y);
        for site in &self.octaves[octave][range] {
            if strip.columns().contains(&site.column) {
                (self.each)(Place {
                    index: site.index,
                    layer: strip.layer(site.layer),
                    at: site.at,
                    scale: site.scale,
                });
            }
        }
    }
}
