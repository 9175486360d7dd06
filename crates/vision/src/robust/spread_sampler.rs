//! Spatially even sampling: as many samples from a sparse part of the image as from a dense one.
//!
//! Rich matchers put tens of thousands of matches on textured surfaces, often one plane; uniform
//! samples then lie on that plane, close together, and determine the pose badly. Here a cell of a
//! grid over the points of view `a` is drawn first, then a match in it, and the cells of a sample are
//! distinct. Where fewer than twice as many cells are occupied as a sample has matches, samples are uniform.
//!
//! *Choice*: the termination is that of uniform sampling (see [`consensus`](super::consensus())). It holds if right matches
//! are as frequent in every cell; where they crowd in few cells, fewer samples are free of wrong matches than it
//! says.
//!
//! | symbol | argument | default | source |
//! | --- | --- | --- | --- |
//! | | `cells` | 20 across and down | GMS's grid |

use super::Sampling;
use super::grid::{NOTHING_IS_FAR, cells_of};
use crate::geometry::PointPairs;
use crate::seed::Rng;

/// A sampler that first draws occupied cells of a grid, then data in these cells; of too few cells it draws data
/// uniformly.
#[derive(Clone, Debug)]
pub struct SpreadSampler {
    /// Indices of the data, sorted by cell.
    data: Vec<u32>,
    /// Where each occupied cell starts in `data`, and the end.
    starts: Vec<u32>,
    /// Cells of the sample being drawn.
    chosen: Vec<u32>,
}

impl SpreadSampler {
    /// A sampler of matches, with a grid of `cells` x `cells` cells over the points of view `a`. Matches whose
    /// coordinates are not finite share a cell.
    ///
    /// # Panics
    /// If there are more than `u32` can number, or no cells.
    pub fn new(pairs: &PointPairs, cells: u32) -> Self {
        Self::within(pairs, cells, NOTHING_IS_FAR)
    }

    /// The same sampler, with a grid that [far](super::grid) coordinates do not widen.
    pub(super) fn within(pairs: &PointPairs, cells: u32, far: f64) -> Self {
        assert!(cells > 0, "a grid has cells");
        let count = u32::try_from(pairs.len()).expect("data are numbered by u32");
        let cells = cells_of(&pairs.a_x, &pairs.a_y, cells, far);
        let cell = |i: u32| cells[i as usize];
        let mut data: Vec<u32> = (0..count).collect();
        data.sort_by_key(|&i| cell(i));
        let mut starts: Vec<u32> = (0..count)
            .filter(|&at| at == 0 || cell(data[at as usize]) != cell(data[at as usize - 1]))
            .collect();
        starts.push(count);
        Self {
            data,
            starts,
            chosen: Vec::new(),
        }
    }
}

impl Sampling for SpreadSampler {
    /// # Panics
    /// If `sample` is longer than there are data.
    fn draw(&mut self, rng: &mut Rng, sample: &mut [u32]) {
        assert!(sample.len() <= self.data.len(), "enough data for a sample");
        let cells = self.starts.len() as u32 - 1;
        // With fewer than twice as many cells as needed, rejecting repeated cells would be biased or never end.
        let distinct = cells as usize >= 2 * sample.len();
        self.chosen.clear();
        for i in 0..sample.len() {
            sample[i] = if distinct {
                let cell = loop {
                    let cell = rng.below(cells);
                    if !self.chosen.contains(&cell) {
                        break cell;
                    }
                };
                self.chosen.push(cell);
                let [start, end] = [self.starts[cell as usize], self.starts[cell as usize + 1]];
                self.data[(start + rng.below(end - start)) as usize]
            } else {
                loop {
                    let drawn = rng.below(self.data.len() as u32);
                    if !sample[..i].contains(&drawn) {
                        break drawn;
                    }
                }
            };
        }
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::Point2;

    use super::*;
    use crate::seed::Seed;

    #[test]
    fn a_crowd_is_drawn_no_more_often_than_a_single_match_elsewhere() {
        // 20 single matches on a diagonal, the last place crowded by 1000.
        let pairs: PointPairs = (0..1020)
            .map(|i| {
                let at = f64::from(i.min(19));
                (Point2::new(at, at), Point2::origin())
            })
            .collect();
        let mut spread = SpreadSampler::new(&pairs, 20);
        let mut rng = Seed(1).rng();
        let mut sample = [0; 5];
        let (mut first, mut crowd) = (0, 0);
        for _ in 0..8000 {
            spread.draw(&mut rng, &mut sample);
            first += i32::from(sample.contains(&0));
            crowd += sample.iter().filter(|&&i| i >= 19).count();
        }
        // 5 standard deviations of a binomial with n = 8000 and p = 5/20.
        assert!(
            (first - 2000).abs() < 194 && crowd.abs_diff(2000) < 194,
            "{first} {crowd}"
        );
    }

    #[test]
    fn one_cell_and_points_that_are_not_finite_still_make_samples() {
        for x in [0.0, f64::NAN, f64::INFINITY] {
            let pairs: PointPairs = [(Point2::new(x, 1.0), Point2::origin()); 6]
                .into_iter()
                .collect();
            let mut sample = [0; 5];
            SpreadSampler::new(&pairs, 20).draw(&mut Seed(1).rng(), &mut sample);
            sample.sort_unstable();
            assert!(sample.windows(2).all(|w| w[0] < w[1]));
        }
    }

    #[test]
    fn with_fewer_than_twice_as_many_cells_as_a_sample_needs_all_matches_are_equally_likely() {
        // 9 or 10 places, the last of them crowded by 91 of 99 or 100 matches.
        let in_the_crowd = |places: i32| {
            let pairs: PointPairs = (0..90 + places)
                .map(|i| {
                    let at = f64::from(i.min(places - 1));
                    (Point2::new(at, at), Point2::origin())
                })
                .collect();
            let mut spread = SpreadSampler::new(&pairs, 20);
            let mut rng = Seed(1).rng();
            let mut sample = [0; 5];
            let first = places as u32 - 1;
            let mut drawn = 0;
            for _ in 0..2000 {
                spread.draw(&mut rng, &mut sample);
                drawn += sample.iter().filter(|&&i| i >= first).count();
            }
            drawn
        };
        // Of 10000, 91 / 99 and 1 / 10.
        assert!(in_the_crowd(9).abs_diff(9192) < 150);
        assert!(in_the_crowd(10).abs_diff(1000) < 150);
    }
}
