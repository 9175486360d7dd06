//! A grid over the points of one view: which of them are neighbours, and how much of the view they cover.

/// The cell of each point in a grid of `cells` x `cells` over all points, by rows. Points whose coordinates are
/// not finite share one additional cell, the last.
pub(super) fn cells_of(x: &[f64], y: &[f64], cells: u32) -> Vec<u64> {
    let rows = index_along(y, cells);
    let columns = index_along(x, cells);
    (rows.into_iter().zip(columns))
        .map(|cell| match cell {
            (Some(row), Some(column)) => u64::from(row) * u64::from(cells) + u64::from(column),
            _ => u64::from(cells) * u64::from(cells),
        })
        .collect()
}

/// The difference of the largest and the smallest finite value; 0 if none is finite.
pub(super) fn span(values: &[f64]) -> f64 {
    let (low, high) = finite_range(values);
    (high - low).max(0.0)
}

/// The smallest and the largest finite value; infinity and minus infinity if none is finite.
fn finite_range(values: &[f64]) -> (f64, f64) {
    let finite = || values.iter().copied().filter(|x| x.is_finite());
    (
        finite().fold(f64::INFINITY, f64::min),
        finite().fold(f64::NEG_INFINITY, f64::max),
    )
}

/// The index of the cell of each value, between the smallest and the largest finite value.
fn index_along(values: &[f64], cells: u32) -> Vec<Option<u32>> {
    let (low, high) = finite_range(values);
    // A span of zero makes NaN of the quotient, which becomes cell 0.
    let index = |x: f64| (((x - low) / (high - low) * f64::from(cells)) as u32).min(cells - 1);
    values
        .iter()
        .map(|&x| x.is_finite().then(|| index(x)))
        .collect()
}
