//! Keypoints that a detector finds again in the other image of a pair whose homography or depth is known.
//!
//! Schmid, Mohr, Bauckhage, "Evaluation of Interest Point Detectors", IJCV 37(2), 2000: a keypoint of a is
//! repeated if the homography (or its depth and the true pose) takes it to within a few pixels of a
//! keypoint of b. Only the part of the scene that both images show counts. A keypoint of b repeats at most
//! one of a: the two must be each other's nearest. Places are counted, not keypoints, so a place with
//! several orientations counts once.
//!
//! Places of both images are sorted into a grid whose cells are as wide as the largest distance of
//! interest. So a place is only compared with those of nine cells.

use matchbench_vision::features::Features;
use matchbench_vision::geometry::transfer;
use matchbench_vision::image::Size;
use nalgebra::{Matrix3, Point2};

use super::matching::count;
use crate::records::Repeated;

/// The largest distance that is counted, in pixels of image b; also the width of a cell.
const MAX_PX: f64 = 10.0;

/// Which keypoints of `a` the homography `b_from_a` finds again among those of `b`; `None` where it has no inverse.
pub(super) fn repeated(b_from_a: &Matrix3<f64>, a: &Features, b: &Features) -> Option<Repeated> {
    let a_from_b = b_from_a.try_inverse()?;
    let in_b: Vec<Point2<f64>> = (places(a).into_iter())
        .map(|place| transfer(b_from_a, place))
        .filter(|seen| is_inside(seen, b.size))
        .collect();
    let of_b: Vec<Point2<f64>> = (places(b).into_iter())
        .filter(|place| is_inside(&transfer(&a_from_b, *place), a.size))
        .collect();
    Some(found_again(&in_b, &of_b, b.size))
}

/// How many places of a, taken to image b of this size, are places of b; all lie on it.
pub(super) fn found_again(in_b: &[Point2<f64>], of_b: &[Point2<f64>], size: Size) -> Repeated {
    let (grid_a, grid_b) = (Grid::new(in_b, size), Grid::new(of_b, size));
    let mut within = [0; 10];
    for (index, place) in of_b.iter().enumerate() {
        let Some((nearest, distance)) = grid_a.nearest(place) else {
            continue;
        };
        let is_mutual = (grid_b.nearest(&in_b[nearest])).is_some_and(|(back, _)| back == index);
        if is_mutual {
            for (k, within) in (1_u32..).zip(&mut within) {
                *within += u32::from(distance <= f64::from(k));
            }
        }
    }
    Repeated {
        visible: [count(in_b.len()), count(of_b.len())],
        within,
    }
}

/// Where there are keypoints, each place once.
pub(super) fn places(features: &Features) -> Vec<Point2<f64>> {
    let mut places: Vec<Point2<f32>> = (features.keypoints.iter())
        .map(|keypoint| keypoint.at)
        .collect();
    places.sort_unstable_by(|one, other| {
        (one.y.total_cmp(&other.y)).then_with(|| one.x.total_cmp(&other.x))
    });
    places.dedup();
    places.iter().map(|place| place.cast::<f64>()).collect()
}

/// Whether a place lies on the image, from the centre of its first pixel to that of its last.
pub(super) fn is_inside(place: &Point2<f64>, size: Size) -> bool {
    let inside = |x: f64, length: usize| x >= 0.0 && x <= length as f64 - 1.0;
    inside(place.x, size.width) && inside(place.y, size.height)
}

/// Places by cells of [`MAX_PX`].
struct Grid<'a> {
    places: &'a [Point2<f64>],
    columns: u64,
    /// The cell of each place and its index, in the order of the cells: row after row.
    cells: Vec<(u64, u32)>,
}

impl<'a> Grid<'a> {
    /// The cells of an image of `size`, on which all places lie.
    fn new(places: &'a [Point2<f64>], size: Size) -> Self {
        // One more at the end of each row, so that there is a cell after the last.
        let columns = (size.width as f64 / MAX_PX) as u64 + 2;
        let mut cells: Vec<(u64, u32)> = (places.iter().zip(0..))
            .map(|(place, index)| {
                let (column, row) = cell(place);
                (row * columns + column, index)
            })
            .collect();
        cells.sort_unstable();
        Self {
            places,
            columns,
            cells,
        }
    }

    /// The nearest place within [`MAX_PX`] and its distance; of equally near ones the first.
    fn nearest(&self, to: &Point2<f64>) -> Option<(usize, f64)> {
        let (column, row) = cell(to);
        let mut nearest: Option<(usize, f64)> = None;
        for row in row.saturating_sub(1)..=row + 1 {
            let first = row * self.columns + column.saturating_sub(1);
            let last = row * self.columns + column + 1;
            let start = self.cells.partition_point(|&(cell, _)| cell < first);
            let here = self.cells[start..].iter();
            for &(_, index) in here.take_while(|&&(cell, _)| cell <= last) {
                let index = index as usize;
                let distance = (self.places[index] - to).norm();
                let nearer = nearest.is_none_or(|(first, least)| {
                    distance < least || (distance == least && index < first)
                });
                if distance <= MAX_PX && nearer {
                    nearest = Some((index, distance));
                }
            }
        }
        nearest
    }
}

/// Column and row of the cell of a place on the image.
fn cell(place: &Point2<f64>) -> (u64, u64) {
    ((place.x / MAX_PX) as u64, (place.y / MAX_PX) as u64)
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::super::testing;
    use super::*;

    fn features(places: &[(f32, f32)]) -> Features {
        testing::features(Size::new(100, 80), places)
    }

    #[test]
    fn a_keypoint_is_repeated_by_one_other_of_the_part_that_both_show() {
        let shifted = Matrix3::new(1.0, 0.0, 50.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0);
        // In b: 60, 61 and 90; the last two are not on it, whose last column is 99.
        let a = features(&[
            (10.0, 10.0),
            (10.0, 10.0),
            (11.0, 10.0),
            (40.0, 50.0),
            (49.5, 50.0),
            (70.0, 5.0),
        ]);
        // The first is nearest to the first of a, and it alone counts, not the second too; the fourth has none, the last is
        // not on a.
        let b = features(&[
            (60.0, 12.5),
            (60.0, 14.0),
            (90.0, 52.0),
            (75.0, 70.0),
            (20.0, 20.0),
        ]);
        let found = repeated(&shifted, &a, &b).expect("invertible");
        assert_eq!(found.visible, [3, 4]);
        assert_eq!(found.within, [0, 1, 2, 2, 2, 2, 2, 2, 2, 2]);
        assert!(repeated(&Matrix3::zeros(), &a, &b).is_none());
        let none = repeated(&shifted, &features(&[]), &b).expect("invertible");
        assert_eq!((none.visible, none.within), ([0, 4], [0; 10]));
    }

    proptest! {
        #[test]
        fn the_grid_finds_what_looking_at_all_finds(
            places in prop::collection::vec((0.0..99.0_f64, 0.0..79.0_f64), 0..40),
            to in (0.0..99.0_f64, 0.0..79.0_f64),
        ) {
            let places: Vec<Point2<f64>> = places.into_iter().map(|(x, y)| Point2::new(x, y)).collect();
            let to = Point2::new(to.0, to.1);
            let distances = places.iter().map(|place| (place - to).norm()).enumerate();
            let expected = distances
                .filter(|(_, distance)| *distance <= MAX_PX)
                .min_by(|(_, one), (_, other)| one.total_cmp(other));
            let found = Grid::new(&places, Size::new(100, 80)).nearest(&to);
            prop_assert_eq!(found, expected);
        }
    }
}
