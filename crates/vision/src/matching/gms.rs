//! GMS: right matches have neighbours that move with them, wrong ones do not.
//!
//! J. Bian, W.-Y. Lin, Y. Matsushita, S.-K. Yeung, T.-D. Nguyen, M.-M. Cheng, "GMS: Grid-based Motion
//! Statistics for Fast, Ultra-robust Feature Correspondence", CVPR 2017.
//!
//! 1. Both images are divided into cells; `statistics[i][j]` counts the matches from cell i of a to
//!    cell j of b. Cell i is paired with the j of the highest count.
//! 2. The pair is supported by the matches between the nine cells around i and those around j (eq. 7).
//!    It is accepted if they are at least `factor * sqrt(n)`, where n is the mean number of matches
//!    of the nine cells of a (eq. 8, where features are counted; each has one match): a wrong pair
//!    collects support by chance only, a right one in proportion to n.
//! 3. A match is kept if its cells are an accepted pair. Matches near the border of a cell are lost
//!    that way, so all is done four times with the grid of a moved by half a cell (sec. 4), and what
//!    is kept once is kept.
//! 4. With `scales`, the grid of b is tried with five sizes, and with `rotations`, the nine cells
//!    around j in eight orders; the variant that keeps most matches counts.
//!
//! | symbol | field | default | source |
//! | --- | --- | --- | --- |
//! | alpha | `factor` | 6 | sec. 3.2 |
//! | | `scales` | false | sec. 4 |
//! | | `rotations` | false | sec. 4 |
//! | | cells along each side, `CELLS` | 20 | sec. 4 |
//!
//! *Choices*, as in the authors' program: a match that a moved grid does not reach is not counted in
//! it; cells that are outside of image a, or whose partner is outside of image b, leave the mean; of
//! cells with equal counts the first is taken.

use nalgebra::Point2;

use super::correspondence::retain_masked;
use super::{Correspondences, Selector, View};
use crate::image::Size;
use crate::params::ParamError;
use crate::seed::Seed;

/// Cells along each side of the grid of image a.
const CELLS: usize = 20;
/// Cells along each side of the grid of image b, one number for each scale: 20, then 20 divided by 2 and by
/// sqrt 2, then 20 times sqrt 2 and times 2.
const CELLS_B: [usize; 5] = [20, 10, 14, 28, 40];
/// The neighbours of a cell, in the order around it. A rotation by 45 degrees is a shift by one.
const RING: [(isize, isize); 8] = [
    (-1, -1),
    (0, -1),
    (1, -1),
    (1, 0),
    (1, 1),
    (0, 1),
    (-1, 1),
    (-1, 0),
];

/// Parameters of [`Gms`].
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[cfg_attr(feature = "serde", serde(default, deny_unknown_fields))]
pub struct GmsParams {
    /// How far the support must exceed what is expected by chance.
    pub factor: f64,
    /// Whether five relative scales of the images are tried.
    pub scales: bool,
    /// Whether eight relative rotations of the images are tried.
    pub rotations: bool,
}

impl Default for GmsParams {
    fn default() -> Self {
        Self {
            factor: 6.0,
            scales: false,
            rotations: false,
        }
    }
}

/// Keeps the matches of grid cells that move together.
#[derive(Clone, Copy, Debug)]
pub struct Gms {
    params: GmsParams,
}

impl Gms {
    /// A selector with these parameters.
    ///
    /// # Errors
    /// If `factor` is negative or not finite.
    pub fn new(params: GmsParams) -> Result<Self, ParamError> {
        let factor = params.factor;
        let allowed = factor >= 0.0 && factor.is_finite();
        ParamError::unless(allowed, "factor", factor, "at least 0 and finite")?;
        Ok(Self { params })
    }

    /// Which of the matches `a[i]` to `b[i]`, in pixels of images of these sizes, are kept.
    ///
    /// # Panics
    /// If `a` and `b` have different lengths.
    pub fn mask(
        &self,
        a: &[Point2<f32>],
        size_a: Size,
        b: &[Point2<f32>],
        size_b: Size,
    ) -> Vec<bool> {
        assert_eq!(a.len(), b.len(), "a match has a point in each image");
        let scales = if self.params.scales { CELLS_B.len() } else { 1 };
        let rotations = if self.params.rotations { RING.len() } else { 1 };
        let places_of_a = grid_places(a, size_a);
        let mut best = (0, vec![false; a.len()]);
        for &cells_b in &CELLS_B[..scales] {
            let of_b = cells_of(b, size_b, cells_b);
            let mut votes = Votes::new(cells_b);
            for rotation in 0..rotations {
                let mut kept = vec![false; a.len()];
                for of_a in &places_of_a {
                    votes.count(of_a, &of_b);
                    votes.accept(rotation, self.params.factor);
                    votes.mark(of_a, &of_b, &mut kept);
                }
                let count = kept.iter().filter(|&&kept| kept).count();
                if count > best.0 {
                    best = (count, kept);
                }
            }
        }
        best.1
    }
}

impl Selector for Gms {
    fn select(&self, a: View<'_>, b: View<'_>, matches: &mut Correspondences, _seed: Seed) {
        let at_a: Vec<_> = (matches.iter())
            .map(|m| a.features.keypoints[m.a as usize].at)
            .collect();
        let at_b: Vec<_> = (matches.iter())
            .map(|m| b.features.keypoints[m.b as usize].at)
            .collect();
        let kept = self.mask(&at_a, a.features.size, &at_b, b.features.size);
        retain_masked(matches, &kept);
    }

    fn uses_seed(&self) -> bool {
        false
    }
}

/// Means "no cell".
const NONE: u32 = u32::MAX;

/// The cell of each point for the four grids of image a.
fn grid_places(points: &[Point2<f32>], size: Size) -> [Vec<u32>; 4] {
    let (width, height) = (size.width as f32, size.height as f32);
    [(0.0, 0.0), (0.5, 0.0), (0.0, 0.5), (0.5, 0.5)].map(|(right, down)| {
        let along = |x: f32, length: f32, shift: f32| {
            let cell = x / length * CELLS as f32 + shift;
            // A shifted grid begins half a cell inside the image.
            let first = if shift > 0.0 { 1.0 } else { 0.0 };
            (cell >= first && cell < CELLS as f32).then_some(cell as u32)
        };
        let place = |p: &Point2<f32>| {
            let column = along(p.x, width, right)?;
            Some(along(p.y, height, down)? * CELLS as u32 + column)
        };
        points.iter().map(|p| place(p).unwrap_or(NONE)).collect()
    })
}

/// The cell of each point of image b.
fn cells_of(points: &[Point2<f32>], size: Size, cells: usize) -> Vec<u32> {
    let along = |x: f32, length: usize| {
        let cell = x / length as f32 * cells as f32;
        (cell >= 0.0 && cell < cells as f32).then_some(cell as u32)
    };
    let place =
        |p: &Point2<f32>| Some(along(p.y, size.height)? * cells as u32 + along(p.x, size.width)?);
    points.iter().map(|p| place(p).unwrap_or(NONE)).collect()
}

/// The statistics of one pair of grids.
struct Votes {
    cells_b: usize,
    /// Matches from each cell of a (rows) to each cell of b.
    statistics: Vec<u32>,
    /// Matches in each cell of a.
    totals: [u32; CELLS * CELLS],
    /// The accepted cell of b for each cell of a, or [`NONE`].
    partners: [u32; CELLS * CELLS],
}

impl Votes {
    fn new(cells_b: usize) -> Self {
        Self {
            cells_b,
            statistics: vec![0; CELLS * CELLS * cells_b * cells_b],
            totals: [0; CELLS * CELLS],
            partners: [NONE; CELLS * CELLS],
        }
    }

    /// Step 1, without the pairing.
    fn count(&mut self, of_a: &[u32], of_b: &[u32]) {
        let row = self.cells_b * self.cells_b;
        self.statistics.fill(0);
        self.totals.fill(0);
        for (&a, &b) in of_a.iter().zip(of_b) {
            if a != NONE && b != NONE {
                self.statistics[a as usize * row + b as usize] += 1;
                self.totals[a as usize] += 1;
            }
        }
    }

    /// Pairs the cells and drops the pairs with too little support: steps 1 and 2.
    fn accept(&mut self, rotation: usize, factor: f64) {
        let row = self.cells_b * self.cells_b;
        for cell in 0..CELLS * CELLS {
            self.partners[cell] = NONE;
            if self.totals[cell] == 0 {
                continue;
            }
            let counts = &self.statistics[cell * row..][..row];
            let most = counts.iter().max().expect("a grid has cells");
            let partner = counts.iter().position(|count| count == most);
            let partner = partner.expect("the largest is there");
            if self.is_supported(cell, partner, rotation, factor) {
                self.partners[cell] = partner as u32;
            }
        }
    }

    fn is_supported(&self, cell: usize, partner: usize, rotation: usize, factor: f64) -> bool {
        let row = self.cells_b * self.cells_b;
        let (mut support, mut total, mut pairs) = (
            self.statistics[cell * row + partner],
            self.totals[cell],
            1_u32,
        );
        for place in 0..RING.len() {
            let near_a = neighbour(cell, CELLS, RING[place]);
            let near_b = neighbour(partner, self.cells_b, RING[(place + rotation) % RING.len()]);
            if let (Some(a), Some(b)) = (near_a, near_b) {
                support += self.statistics[a * row + b];
                total += self.totals[a];
                pairs += 1;
            }
        }
        let mean = f64::from(total) / f64::from(pairs);
        f64::from(support) >= factor * mean.sqrt()
    }

    /// Step 3.
    fn mark(&self, of_a: &[u32], of_b: &[u32], kept: &mut [bool]) {
        for ((kept, &a), &b) in kept.iter_mut().zip(of_a).zip(of_b) {
            if a != NONE && b != NONE {
                *kept |= self.partners[a as usize] == b;
            }
        }
    }
}

/// The cell beside a `cell` of a square grid, unless that is outside.
fn neighbour(cell: usize, cells: usize, (right, down): (isize, isize)) -> Option<usize> {
    let column = (cell % cells).checked_add_signed(right)?;
    let row = (cell / cells).checked_add_signed(down)?;
    (column < cells && row < cells).then_some(row * cells + column)
}

#[cfg(test)]
mod tests {
    use super::*;

    const SIZE: Size = Size {
        width: 640,
        height: 480,
    };

    /// Matches of which the first `right` are moved by `motion` and the others are random.
    fn matches(
        right: usize,
        wrong: usize,
        motion: fn(Point2<f32>) -> Point2<f32>,
    ) -> (Vec<Point2<f32>>, Vec<Point2<f32>>) {
        let mut rng = Seed(4).rng();
        (0..right + wrong)
            .map(|i| {
                let mut point =
                    || Point2::new(639.0 * rng.uniform() as f32, 479.0 * rng.uniform() as f32);
                let (a, anywhere) = (point(), point());
                (a, if i < right { motion(a) } else { anywhere })
            })
            .unzip()
    }

    fn kept(
        params: GmsParams,
        a: &[Point2<f32>],
        b: &[Point2<f32>],
        right: usize,
    ) -> (usize, usize) {
        let mask = Gms::new(params).unwrap().mask(a, SIZE, b, SIZE);
        assert_eq!(mask.len(), a.len());
        let count = |mask: &[bool]| mask.iter().filter(|&&kept| kept).count();
        (count(&mask[..right]), count(&mask[right..]))
    }

    #[test]
    fn what_moves_together_stays() {
        let (a, b) = matches(4000, 4000, |p| {
            Point2::new(p.x * 0.9 + 20.0, p.y * 0.9 + 30.0)
        });
        let (right, wrong) = kept(GmsParams::default(), &a, &b, 4000);
        assert!(right > 3200 && wrong < 100, "{right} {wrong}");
    }

    #[test]
    fn chance_supports_nothing() {
        let (a, b) = matches(0, 8000, |p| p);
        assert_eq!(kept(GmsParams::default(), &a, &b, 0), (0, 0));
    }

    #[test]
    fn trying_scales_never_keeps_less() {
        let (a, b) = matches(4000, 1000, |p| {
            Point2::new(p.x * 0.5 + 40.0, p.y * 0.5 + 30.0)
        });
        let (single, _) = kept(GmsParams::default(), &a, &b, 4000);
        let scales = GmsParams {
            scales: true,
            ..GmsParams::default()
        };
        let (several, _) = kept(scales, &a, &b, 4000);
        assert!(several > 3500 && several >= single, "{several} {single}");
    }

    #[test]
    fn an_image_on_its_head_needs_rotations() {
        let (a, b) = matches(3000, 1000, |p| Point2::new(639.0 - p.x, 479.0 - p.y));
        let (upright, _) = kept(GmsParams::default(), &a, &b, 3000);
        let rotations = GmsParams {
            rotations: true,
            ..GmsParams::default()
        };
        let (turned, _) = kept(rotations, &a, &b, 3000);
        assert!(turned > 2500 && turned > 2 * upright, "{turned} {upright}");
    }

    #[test]
    fn points_that_are_nowhere_are_dropped() {
        let nowhere = [f32::NAN, -1.0, 640.0, f32::INFINITY].map(|x| Point2::new(x, 10.0));
        assert_eq!(kept(GmsParams::default(), &nowhere, &nowhere, 4), (0, 0));
        assert_eq!(kept(GmsParams::default(), &[], &[], 0), (0, 0));
        assert!(
            Gms::new(GmsParams {
                factor: f64::NAN,
                ..GmsParams::default()
            })
            .is_err()
        );
    }

    /// The middle of this quarter of a cell, in pixels: cells are 32 x 24 of them, and quarters are counted from 0 to 3.
    fn in_cell((column, row): (u8, u8), (right, down): (u8, u8)) -> Point2<f32> {
        let along = |cell: u8, quarter: u8| f32::from(cell) + (f32::from(quarter) + 0.5) / 4.0;
        Point2::new(32.0 * along(column, right), 24.0 * along(row, down))
    }

    /// How many of these matches stay.
    fn staying(params: GmsParams, ends: &[(Point2<f32>, Point2<f32>)]) -> usize {
        let (a, b): (Vec<_>, Vec<_>) = ends.iter().copied().unzip();
        kept(params, &a, &b, ends.len()).0
    }

    /// The mean of n matches over nine cells is n / 9, so a cell on its own needs n >= 6 sqrt(n / 9), which is 4. In a corner
    /// only four of the cells are there: n >= 6 sqrt(n / 4), which is 9.
    #[test]
    fn a_cell_on_its_own_needs_four_matches_and_one_in_a_corner_nine() {
        let alone = |count, a, b| {
            let ends = (in_cell(a, (0, 0)), in_cell(b, (0, 0)));
            staying(GmsParams::default(), &vec![ends; count])
        };
        let (middle, corner) = ((10, 11), (0, 0));
        assert_eq!([3, 4].map(|n| alone(n, middle, (5, 7))), [0, 4]);
        assert_eq!([8, 9].map(|n| alone(n, corner, (5, 7))), [0, 9]);
        assert_eq!([8, 9].map(|n| alone(n, middle, (19, 19))), [0, 9]);
    }

    /// Four matches on either side of a border are two for each cell, which is too few, until the grid is moved.
    #[test]
    fn matches_about_the_border_of_a_cell_are_found_by_a_moved_grid() {
        let b = in_cell((5, 7), (0, 0));
        let across = [in_cell((10, 11), (3, 0)), in_cell((11, 11), (0, 0))];
        let down = [in_cell((10, 11), (0, 3)), in_cell((10, 12), (0, 0))];
        for [first, second] in [across, down] {
            let ends = [(first, b), (second, b), (first, b), (second, b)];
            assert_eq!(staying(GmsParams::default(), &ends), 4);
            assert_eq!(staying(GmsParams::default(), &ends[..3]), 0);
        }
        let corner = [
            in_cell((10, 11), (3, 3)),
            in_cell((11, 11), (0, 3)),
            in_cell((10, 12), (3, 0)),
            in_cell((11, 12), (0, 0)),
        ];
        assert_eq!(staying(GmsParams::default(), &corner.map(|a| (a, b))), 4);
    }

    /// From one cell of a to two of b, which are one where b has half as many.
    #[test]
    fn larger_cells_of_b_are_tried_where_that_is_asked() {
        let a = in_cell((10, 11), (0, 0));
        let ends = [4, 5, 4, 5].map(|column| (a, in_cell((column, 7), (0, 0))));
        let with = |scales| GmsParams {
            scales,
            ..GmsParams::default()
        };
        assert_eq!(
            (staying(with(false), &ends), staying(with(true), &ends)),
            (0, 4)
        );
    }

    /// A neighbour on the right in a is on the right in b, and below it after a quarter turn.
    #[test]
    fn neighbours_support_a_cell_from_the_same_side() {
        let two_pairs = |beside: (u8, u8)| {
            let cells = [((10, 11), (5, 7)), ((11, 11), beside)];
            let ends = cells.map(|(a, b)| (in_cell(a, (0, 0)), in_cell(b, (0, 0))));
            [ends[0], ends[1], ends[0], ends[1]]
        };
        let with = |rotations| GmsParams {
            rotations,
            ..GmsParams::default()
        };
        for (beside, upright) in [((6, 7), 4), ((5, 8), 0), ((4, 7), 0), ((7, 7), 0)] {
            assert_eq!(
                staying(with(false), &two_pairs(beside)),
                upright,
                "{beside:?}"
            );
        }
        assert_eq!(staying(with(true), &two_pairs((5, 8))), 4);
        assert_eq!(staying(with(true), &two_pairs((7, 7))), 0);
    }

    #[test]
    fn a_selector_keeps_the_matches_of_the_mask() {
        use crate::features::{Descriptors, Features, FloatRows, Keypoint};

        let features = |places: [Point2<f32>; 5]| {
            let keypoint = |at| Keypoint {
                at,
                size: 4.0,
                angle: None,
                response: 1.0,
                octave: 0,
            };
            let rows = FloatRows::from_vec(1, vec![0.0; 5]);
            Features::new(
                SIZE,
                places.map(keypoint).to_vec(),
                Descriptors::Float(rows),
            )
        };
        let (near, far) = (in_cell((10, 11), (0, 0)), in_cell((2, 3), (0, 0)));
        let a = features([near, near, far, near, near]);
        let b = features([in_cell((5, 7), (0, 0)); 5]);
        let found = |(a, b)| super::super::Correspondence {
            a,
            b,
            distance: 0.0,
            second: 1.0,
        };
        let mut matches = [(0, 4), (1, 3), (2, 2), (3, 1), (4, 0)].map(found).to_vec();
        let [a, b] = [&a, &b].map(|features| View {
            features,
            image: None,
            camera: None,
        });
        let gms = Gms::new(GmsParams::default()).unwrap();
        gms.select(a, b, &mut matches, Seed(0));
        let kept: Vec<(u32, u32)> = matches.iter().map(|m| (m.a, m.b)).collect();
        assert_eq!(kept, [(0, 4), (1, 3), (3, 1), (4, 0)]);
    }
}
