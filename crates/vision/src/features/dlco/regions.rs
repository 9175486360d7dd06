//! Rings of pooling regions, and the gradients of a patch pooled in them (section 3.1).
//!
//! A ring is 1, 4 or 8 equal Gaussian regions about the centre of the patch ([`Ring`]). [`Pooling`] sums the
//! gradients of a patch in each region, apart for eight directions.

use std::ops::Range;

use crate::image::{GaussianKernel, RowBlur, RowBuffer, Size};
use crate::simd::{
    DIRECTIONS, POOLED_ROWS, PoolStep, PoolUse, ROWS_AT_ONCE, pool_rows, spread_and_square,
};

use super::{INNER, SIDE};

/// Blur of the patch before its gradients are taken, in its pixels.
const BLUR: f64 = 1.4;
/// Regions reach this many standard deviations to each side.
const REACH: f32 = 2.5;
/// Pooled gradients are cut off at this share of the patch's root mean square gradient: about what
/// each direction gets where gradients are as strong as everywhere and point anywhere. What is
/// left tells which directions occur, hardly how strongly.
const CLIP: f32 = 0.1;

/// Equal Gaussian regions about the centre of the patch, placed so that turning the patch by a
/// quarter or mirroring it maps the ring on itself: 1, 4 or 8 of them.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Ring {
    /// Distance of their centres from that of the patch, in pixels.
    pub radius: f32,
    /// Direction of one of them, in turns: 0 to 1/8.
    pub turn: f32,
    /// Their standard deviation, in pixels.
    pub sigma: f32,
}

impl Ring {
    /// Centres of the regions, relative to that of the patch.
    pub fn centres(&self) -> Vec<[f32; 2]> {
        if self.radius <= 0.0 {
            return vec![[0.0; 2]];
        }
        let on_axis = self.turn <= 0.0 || self.turn >= 0.125;
        let turns = if on_axis {
            vec![self.turn]
        } else {
            vec![self.turn, -self.turn]
        };
        let mut centres = Vec::new();
        for quarter in 0..4_u8 {
            for turn in &turns {
                let angle = core::f32::consts::TAU * (turn + 0.25 * f32::from(quarter));
                centres.push([
                    self.radius * libm::cosf(angle),
                    self.radius * libm::sinf(angle),
                ]);
            }
        }
        centres
    }
}

/// What is to be done with each block of rows of a patch for its regions; columns that several regions
/// weigh alike are weighed once.
#[derive(Clone, Debug, Default)]
struct Plan {
    /// For each block of [`POOLED_ROWS`] rows.
    steps: Vec<Vec<PoolStep>>,
    columns: Vec<f32>,
    uses: Vec<PoolUse>,
    regions: usize,
}

/// Regions of the same columns: where these start and their weights; their place among all; the regions, and where
/// the rows of each start and their weights.
type Strip = (
    (usize, Vec<f32>),
    Range<usize>,
    Vec<(usize, usize, Vec<f32>)>,
);

impl Plan {
    fn new(rings: &[Ring]) -> Self {
        let mut plan = Self::default();
        let mut strips: Vec<Strip> = Vec::new();
        for ring in rings {
            for centre in ring.centres() {
                let [columns, (top, rows)] = centre.map(|c| weights(c, ring.sigma));
                let region = (plan.regions, top, rows);
                plan.regions += 1;
                if let Some(strip) = strips.iter_mut().find(|strip| strip.0 == columns) {
                    strip.2.push(region);
                } else {
                    let start = plan.columns.len();
                    plan.columns.extend(&columns.1);
                    strips.push((columns, start..plan.columns.len(), vec![region]));
                }
            }
        }
        for first in (0..INNER).step_by(POOLED_ROWS) {
            let mut steps = Vec::new();
            for ((left, _), columns, regions) in &strips {
                let start = plan.uses.len();
                for (region, top, rows) in regions {
                    let weight = |r: usize| {
                        let row = (first + r).checked_sub(*top);
                        row.and_then(|row| rows.get(row)).copied()
                    };
                    if (0..POOLED_ROWS).any(|r| weight(r).is_some()) {
                        plan.uses.push(PoolUse {
                            region: *region,
                            rows: std::array::from_fn(|r| weight(r).unwrap_or(0.0)),
                        });
                    }
                }
                if start < plan.uses.len() {
                    steps.push(PoolStep {
                        left: *left,
                        columns: columns.clone(),
                        uses: start..plan.uses.len(),
                    });
                }
            }
            plan.steps.push(steps);
        }
        plan
    }
}

/// First pixel and weights, of sum 1, of a Gaussian about `centre` along one axis.
fn weights(centre: f32, sigma: f32) -> (usize, Vec<f32>) {
    let middle = centre + 0.5 * (INNER as f32 - 1.0);
    let last = INNER as f32 - 1.0;
    let first = (middle - REACH * sigma).ceil().clamp(0.0, last);
    let end = (middle + REACH * sigma).floor().clamp(first, last);
    let mut weights: Vec<f32> = (first as usize..=end as usize)
        .map(|x| {
            let d = (x as f32 - middle) / sigma;
            libm::expf(-0.5 * d * d)
        })
        .collect();
    let sum: f32 = weights.iter().sum();
    for weight in &mut weights {
        *weight /= sum;
    }
    (first as usize, weights)
}

/// Pools the gradients of patches in the regions of rings; its buffers are used again and again.
#[derive(Clone, Debug)]
pub struct Pooling {
    plan: Plan,
    pixels: Vec<f32>,
    blur: RowBlur,
    blurred: RowBuffer,
    /// Gradients of a block of rows.
    spread: Vec<[f32; DIRECTIONS]>,
}

impl Pooling {
    /// Pooling in the regions of `rings`, in their order.
    pub fn new(rings: &[Ring]) -> Self {
        Self {
            plan: Plan::new(rings),
            pixels: vec![0.0; SIDE * SIDE],
            blur: RowBlur::new(GaussianKernel::new(BLUR), SIDE),
            blurred: RowBuffer::new(Size::new(SIDE, SIDE), POOLED_ROWS + 2 + ROWS_AT_ONCE),
            spread: vec![[0.0; DIRECTIONS]; POOLED_ROWS * INNER],
        }
    }

    /// Number of regions; each gives eight values.
    pub fn len(&self) -> usize {
        self.plan.regions
    }

    /// Whether there are no regions.
    pub fn is_empty(&self) -> bool {
        self.plan.regions == 0
    }

    /// Writes the pooled gradients of a patch, eight directions for each region, in `[0, 1]`.
    ///
    /// # Panics
    /// If the patch does not have [`SIDE`] x [`SIDE`] pixels or `pooled` one value per region.
    pub fn compute(&mut self, patch: &[u8], pooled: &mut [[f32; DIRECTIONS]]) {
        assert_eq!(patch.len(), SIDE * SIDE, "a patch of {SIDE} x {SIDE}");
        assert_eq!(pooled.len(), self.len(), "one for each region");
        for (pixel, &grey) in self.pixels.iter_mut().zip(patch) {
            *pixel = f32::from(grey);
        }
        pooled.fill([0.0; DIRECTIONS]);
        // The magnitude is the sum of the two shares; their product is left out of the square, which
        // makes directions between two bins count up to half as much.
        let mut squares = [0.0; DIRECTIONS];
        self.blurred.restart();
        for (steps, first) in self.plan.steps.iter().zip((0..).step_by(POOLED_ROWS)) {
            let end = INNER.min(first + POOLED_ROWS);
            while self.blurred.made() < end + 2 {
                let row = |y: usize| &self.pixels[y * SIDE..][..SIDE];
                self.blur.advance(0, row, &mut self.blurred);
            }
            for (y, spread) in (first..end).zip(self.spread.chunks_exact_mut(INNER)) {
                spread_and_square(
                    &self.blurred.row(y)[1..=INNER],
                    self.blurred.row(y + 1),
                    &self.blurred.row(y + 2)[1..=INNER],
                    spread,
                    &mut squares,
                );
            }
            // Rows beyond the last have weights of 0, whatever they still hold.
            let rows = std::array::from_fn(|r| &self.spread[r * INNER..][..INNER]);
            pool_rows(rows, steps, &self.plan.columns, &self.plan.uses, pooled);
        }
        let mean = squares.iter().sum::<f32>() / (INNER * INNER) as f32;
        let scale = 1.0 / (CLIP * mean.sqrt()).max(1e-3);
        for values in pooled {
            *values = values.map(|value| (value * scale).min(1.0));
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rings_have_the_symmetry_of_a_square() {
        let ring = |radius, turn| Ring {
            radius,
            turn,
            sigma: 2.0,
        };
        assert_eq!(ring(0.0, 0.05).centres(), [[0.0, 0.0]]);
        assert_eq!(ring(10.0, 0.0).centres().len(), 4);
        assert_eq!(ring(10.0, 0.125).centres().len(), 4);
        let centres = ring(10.0, 0.04).centres();
        assert_eq!(centres.len(), 8);
        for [x, y] in &centres {
            assert!((x * x + y * y - 100.0).abs() < 1e-3);
            let mirrored = |[a, b]: &[f32; 2]| (a - x).abs() < 1e-4 && (b + y).abs() < 1e-4;
            let turned = |[a, b]: &[f32; 2]| (a + y).abs() < 1e-4 && (b - x).abs() < 1e-4;
            assert!(centres.iter().any(mirrored) && centres.iter().any(turned));
        }
    }

    #[test]
    fn regions_are_gaussians_of_the_same_weight() {
        let middle = 0.5 * (INNER as f32 - 1.0);
        // The last one begins at the border, where half of it is cut off.
        for (centre, sigma, pixels) in [(0.5, 2.0, 11), (-8.5, 1.6, 9), (middle, 4.0, 11)] {
            let (first, weights) = weights(centre, sigma);
            assert_eq!(weights.len(), pixels, "all within 2.5 standard deviations");
            assert!((weights.iter().sum::<f32>() - 1.0).abs() < 1e-5);
            let at = |i: usize| (first + i) as f32 - middle - centre;
            for i in 0..pixels {
                let ratio = libm::expf((at(0) * at(0) - at(i) * at(i)) / (2.0 * sigma * sigma));
                assert!((weights[i] / weights[0] / ratio - 1.0).abs() < 1e-4);
            }
        }
    }

    #[test]
    fn a_ramp_pools_to_one_direction_everywhere_and_contrast_does_not_matter() {
        let rings = [
            Ring {
                radius: 0.0,
                turn: 0.0,
                sigma: 6.0,
            },
            Ring {
                radius: 28.0,
                turn: 0.06,
                sigma: 3.0,
            },
        ];
        let mut pooling = Pooling::new(&rings);
        for contrast in [1, 3] {
            let patch: Vec<u8> = (0..SIDE * SIDE)
                .map(|i| (i % SIDE) as u8 * contrast)
                .collect();
            let mut pooled = vec![[0.0; DIRECTIONS]; pooling.len()];
            pooling.compute(&patch, &mut pooled);
            for values in pooled {
                assert_eq!(values[0], 1.0);
                assert!(values[1..].iter().all(|&value| value < 0.02), "{values:?}");
            }
        }
    }

    #[test]
    fn a_patch_without_gradients_pools_to_nothing() {
        let rings = [Ring {
            radius: 9.0,
            turn: 0.0,
            sigma: 2.0,
        }];
        let mut pooled = [[1.0; DIRECTIONS]; 4];
        Pooling::new(&rings).compute(&[77; SIDE * SIDE], &mut pooled);
        assert_eq!(pooled, [[0.0; DIRECTIONS]; 4]);
    }
}
