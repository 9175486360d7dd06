//! Rings of pooling regions, and the gradients of a patch pooled in them (section 3.1).

use crate::image::{FloatImage, Size, gaussian_blur};
use crate::simd::{DIRECTIONS, pool, spread_gradients};

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

/// A Gaussian region as the rectangle of pixels that it weighs.
#[derive(Clone, Debug)]
struct Region {
    first: usize,
    columns: Vec<f32>,
    rows: Vec<f32>,
}

impl Region {
    fn new(centre: [f32; 2], sigma: f32) -> Self {
        let [(left, columns), (top, rows)] = centre.map(|c| weights(c, sigma));
        Self {
            first: top * INNER + left,
            columns,
            rows,
        }
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
    regions: Vec<Region>,
    spread: Vec<[f32; DIRECTIONS]>,
}

impl Pooling {
    /// Pooling in the regions of `rings`, in their order.
    pub fn new(rings: &[Ring]) -> Self {
        let regions = rings
            .iter()
            .flat_map(|ring| {
                let centres = ring.centres();
                centres
                    .into_iter()
                    .map(|centre| Region::new(centre, ring.sigma))
            })
            .collect();
        Self {
            regions,
            spread: vec![[0.0; DIRECTIONS]; INNER * INNER],
        }
    }

    /// Number of regions; each gives eight values.
    pub fn len(&self) -> usize {
        self.regions.len()
    }

    /// Whether there are no regions.
    pub fn is_empty(&self) -> bool {
        self.regions.is_empty()
    }

    /// Writes the pooled gradients of a patch, eight directions for each region, in `[0, 1]`.
    ///
    /// # Panics
    /// If the patch does not have [`SIDE`] x [`SIDE`] pixels or `pooled` one value per region.
    pub fn compute(&mut self, patch: &[u8], pooled: &mut [[f32; DIRECTIONS]]) {
        assert_eq!(pooled.len(), self.regions.len(), "one for each region");
        let patch: Vec<f32> = patch.iter().map(|&v| f32::from(v)).collect();
        let patch = gaussian_blur(&FloatImage::from_vec(Size::new(SIDE, SIDE), patch), BLUR);
        for (y, spread) in self.spread.chunks_exact_mut(INNER).enumerate() {
            spread_gradients(
                &patch.row(y)[1..=INNER],
                patch.row(y + 1),
                &patch.row(y + 2)[1..=INNER],
                spread,
            );
        }
        let scale = 1.0 / (CLIP * self.root_mean_square()).max(1e-3);
        for (region, pooled) in self.regions.iter().zip(pooled) {
            let values = pool(
                &self.spread,
                INNER,
                region.first,
                &region.columns,
                &region.rows,
            );
            *pooled = values.map(|value| (value * scale).min(1.0));
        }
    }

    /// Root mean square of the patch's gradients.
    fn root_mean_square(&self) -> f32 {
        let mut sums = [0.0_f32; DIRECTIONS];
        for shares in &self.spread {
            for i in 0..DIRECTIONS {
                // The magnitude is the sum of the two shares; their product is left out of the
                // square, which makes directions between two bins count up to half as much.
                sums[i] = shares[i].mul_add(shares[i], sums[i]);
            }
        }
        (sums.iter().sum::<f32>() / self.spread.len() as f32).sqrt()
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
