//! A grid over the points of one view: which of them are neighbours, and how much of the view they cover.
//!
//! The grid reaches from the smallest to the largest coordinate. A few points that are far beside the image (a wrong
//! match where the model of a lens folds, or what a caller gives) would make it so coarse that all other points share
//! one cell. So a caller that knows in what units the points are says from where on a coordinate is *far*. Far
//! coordinates do not widen the grid, and such points are in its outermost cells. If most coordinates are far, they
//! are in other units than the caller thinks, and then all of them count.

/// Coordinates at depth 1 are far beyond this, 76 degrees from the axis of the camera. No image of a perspective camera
/// reaches there, so the grid over points in images does not depend on this.
pub(super) const FAR_AT_DEPTH_1: f64 = 4.0;

/// For points in units that are not known, no coordinate is far.
pub(super) const NOTHING_IS_FAR: f64 = f64::INFINITY;

/// Most cells across and down.
pub(super) const MAX_CELLS: u32 = 1000;

/// The cell of each point in a grid of `cells` x `cells` over all points, by rows. Points whose coordinates are
/// not finite share one additional cell, the last.
pub(super) fn cells_of(x: &[f64], y: &[f64], cells: u32, far: f64) -> Vec<u64> {
    let rows = index_along(y, cells, far);
    let columns = index_along(x, cells, far);
    (rows.into_iter().zip(columns))
        .map(|cell| match cell {
            (Some(row), Some(column)) => u64::from(row) * u64::from(cells) + u64::from(column),
            _ => u64::from(cells) * u64::from(cells),
        })
        .collect()
}

/// The difference of the largest and the smallest value that is finite and not far; 0 if there is none.
pub(super) fn span(values: &[f64], far: f64) -> f64 {
    let (low, high) = range(values, far);
    (high - low).max(0.0)
}

/// The smallest and the largest value that is finite and not far; infinity and minus infinity if there is none.
fn range(values: &[f64], far: f64) -> (f64, f64) {
    let (low, high, finite) = range_within(values, f64::MAX);
    if -far <= low && high <= far {
        return (low, high);
    }
    let (near_low, near_high, near) = range_within(values, far);
    if 2 * near < finite {
        (low, high)
    } else {
        (near_low, near_high)
    }
}

/// The smallest and the largest of the values whose size is at most `most`, and their number.
fn range_within(values: &[f64], most: f64) -> (f64, f64, usize) {
    let within = values.iter().filter(|x| x.abs() <= most);
    within.fold(
        (f64::INFINITY, f64::NEG_INFINITY, 0),
        |(low, high, count), &x| (low.min(x), high.max(x), count + 1),
    )
}

/// The index of the cell of each value.
fn index_along(values: &[f64], cells: u32, far: f64) -> Vec<Option<u32>> {
    let (low, high) = range(values, far);
    // A span of zero makes NaN of the quotient, which becomes cell 0. Far values are cut off at both ends.
    let index = |x: f64| (((x - low) / (high - low) * f64::from(cells)) as u32).min(cells - 1);
    values
        .iter()
        .map(|&x| x.is_finite().then(|| index(x)))
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::seed::Seed;

    /// Coordinates as a lens of 90 degrees has them.
    fn coordinates(count: usize) -> Vec<f64> {
        let mut rng = Seed(1).rng();
        (0..count).map(|_| 2.0 * rng.uniform() - 1.0).collect()
    }

    #[test]
    fn what_is_far_is_at_the_border_and_leaves_the_other_cells_as_they_are() {
        for count in [20, 1000] {
            let (x, y) = (coordinates(count), coordinates(count));
            let cells = cells_of(&x, &y, 10, FAR_AT_DEPTH_1);
            let size = span(&x, FAR_AT_DEPTH_1);
            for (far, column) in [(10.0, 9), (100.0, 9), (-1e6, 0), (1e308, 9)] {
                let (mut x, mut y) = (x.clone(), y.clone());
                x.push(far);
                y.push(y[0]);
                let with_far = cells_of(&x, &y, 10, FAR_AT_DEPTH_1);
                assert_eq!(with_far[..count], cells, "{far}");
                assert_eq!(with_far[count], cells[0] / 10 * 10 + column, "{far}");
                assert_eq!(span(&x, FAR_AT_DEPTH_1).to_bits(), size.to_bits(), "{far}");
                // Without a limit all others are in one column, or in two.
                let coarse = cells_of(&x, &y, 10, NOTHING_IS_FAR);
                let mut columns = coarse[..count].iter().map(|cell| cell % 10);
                assert!(columns.all(|other| other.abs_diff(column) >= 8), "{far}");
            }
        }
    }

    #[test]
    fn where_nothing_is_far_the_limit_has_no_effect() {
        let crowded = |x: &f64| if x.abs() < 0.98 { 0.01 * x } else { *x };
        for count in [0, 1, 5, 1000] {
            let (x, y) = (coordinates(count), coordinates(count));
            let crowd: Vec<f64> = x.iter().map(crowded).collect();
            let mut broken = x.clone();
            broken.extend([f64::NAN, f64::INFINITY, f64::NEG_INFINITY]);
            for x in [&x, &crowd, &broken] {
                let mut y = y.clone();
                y.resize(x.len(), 0.0);
                let of = |far| (cells_of(x, &y, 10, far), span(x, far).to_bits());
                assert_eq!(of(FAR_AT_DEPTH_1), of(NOTHING_IS_FAR));
            }
        }
    }

    #[test]
    fn cells_are_counted_by_rows_and_what_is_nowhere_has_one_more() {
        let x = [0.0, 1.0, 0.0, 1.0, 0.55, f64::NAN, 0.5];
        let y = [0.0, 0.0, 2.0, 2.0, 0.7, 1.0, f64::INFINITY];
        let cells = cells_of(&x, &y, 10, NOTHING_IS_FAR);
        assert_eq!(cells, [0, 9, 90, 99, 35, 100, 100]);
        assert_eq!((span(&y, NOTHING_IS_FAR), span(&x[5..6], 4.0)), (2.0, 0.0));
    }

    #[test]
    fn half_of_the_coordinates_may_be_far_and_no_more() {
        assert_eq!(span(&[0.0, 1.0, 10.0, 20.0], 4.0), 1.0);
        assert_eq!(span(&[0.0, 10.0, 20.0], 4.0), 20.0);
    }

    #[test]
    fn points_in_other_units_are_not_all_far() {
        let pixels: Vec<f64> = (0..640).map(f64::from).collect();
        let of = |far| cells_of(&pixels, &pixels, 10, far);
        assert_eq!(of(FAR_AT_DEPTH_1), of(NOTHING_IS_FAR));
    }
}
