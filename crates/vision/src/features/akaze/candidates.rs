//! Step 2 of AKAZE: maxima of the determinant of the Hessian. Of those near each other in one level or in
//! neighbouring levels, only the strongest survives; the order of suppression is OpenCV's.

use crate::image::RowBuffer;
use crate::simd::find_maxima;

/// A maximum of the determinant of the Hessian in one level.
#[derive(Clone, Copy, Debug)]
pub(super) struct Candidate {
    /// Column and row.
    pub(super) pixel: [usize; 2],
    /// The determinant there.
    pub(super) response: f32,
    /// From the pixel to the top of the quadratic through its neighbours, along x and y.
    pub(super) offset: [f32; 2],
    /// Whether neither its own level nor the next has a stronger one near.
    alive: bool,
    /// Whether the level before has no stronger one near either.
    kept: bool,
}

impl Candidate {
    fn remove(&mut self) {
        (self.alive, self.kept) = (false, false);
    }
}

/// The candidates of one level, in the order of rows.
pub(super) struct Candidates {
    /// Distance within which only the strongest survives, in pixels of the level.
    radius: usize,
    items: Vec<Candidate>,
    /// Index of the first candidate of each row that was searched.
    rows: Vec<usize>,
    columns: Vec<u32>,
}

impl Candidates {
    pub(super) fn new(radius: usize) -> Self {
        Self {
            radius,
            items: Vec::new(),
            rows: Vec::new(),
            columns: Vec::new(),
        }
    }

    /// Searches row `y` but for `border` pixels at each end; the rows before and after it exist.
    /// A new candidate takes the place of the first weaker one near it, in the order of rows.
    pub(super) fn search(
        &mut self,
        determinant: &RowBuffer,
        y: usize,
        border: usize,
        threshold: f32,
    ) {
        let width = determinant.size().width;
        if width <= 2 * border {
            return;
        }
        let rows = [y - 1, y, y + 1].map(|y| determinant.row(y));
        self.columns.clear();
        find_maxima(&rows, border..width - border, threshold, &mut self.columns);
        self.rows.resize(y + 1, self.items.len());
        for i in 0..self.columns.len() {
            let x = self.columns[i] as usize;
            let response = rows[1][x];
            if let Some(near) = self.near([x, y], self.radius, |candidate| candidate.alive) {
                if response <= self.items[near].response {
                    continue;
                }
                self.items[near].remove();
            }
            self.items.push(Candidate {
                pixel: [x, y],
                response,
                offset: offset(rows, x),
                alive: true,
                kept: true,
            });
        }
    }

    /// Removes what is weaker than a candidate near it in the `next` level, whose pixels are
    /// `ratio` times as wide.
    pub(super) fn suppress_by_next(&mut self, next: &Candidates, ratio: usize) {
        for stronger in next.items.iter().filter(|candidate| candidate.alive) {
            let at = stronger.pixel.map(|v| v * ratio);
            let radius = next.radius * ratio;
            if let Some(near) = self.near(at, radius, |candidate| candidate.alive)
                && stronger.response > self.items[near].response
            {
                self.items[near].remove();
            }
        }
    }

    /// Removes what is weaker than a candidate near it in the level `before`, of whose pixels this
    /// one has `ratio` in one.
    pub(super) fn suppress_by_previous(&mut self, before: &Candidates, ratio: usize) {
        for stronger in before.items.iter().filter(|candidate| candidate.alive) {
            let at = stronger.pixel.map(|v| v / ratio);
            if let Some(near) = self.near(at, self.radius, |candidate| candidate.kept)
                && stronger.response > self.items[near].response
            {
                self.items[near].kept = false;
            }
        }
    }

    /// What is left, but for those whose quadratic has its top more than a pixel away.
    pub(super) fn survivors(&self) -> impl Iterator<Item = &Candidate> {
        let is_stable = |c: &&Candidate| c.offset.iter().all(|v| v.abs() <= 1.0);
        self.items.iter().filter(|c| c.kept).filter(is_stable)
    }

    /// The first candidate in the order of rows that `counts` and lies within `radius` pixels.
    /// Like OpenCV, which the order of suppression is taken from, this looks one pixel less far
    /// to the right and down.
    fn near(
        &self,
        [x, y]: [usize; 2],
        radius: usize,
        counts: impl Fn(&Candidate) -> bool,
    ) -> Option<usize> {
        for row in y.saturating_sub(radius)..(y + radius).min(self.rows.len()) {
            let start = self.rows[row];
            let end = self.rows.get(row + 1).map_or(self.items.len(), |&end| end);
            let row = &self.items[start..end];
            let first = row.partition_point(|c| c.pixel[0] + radius < x);
            let found = row[first..]
                .iter()
                .take_while(|c| c.pixel[0] < x + radius)
                .position(|c| {
                    let [dx, dy] = [c.pixel[0].abs_diff(x), c.pixel[1].abs_diff(y)];
                    counts(c) && dx * dx + dy * dy <= radius * radius
                });
            if let Some(found) = found {
                return Some(start + first + found);
            }
        }
        None
    }
}

/// From a pixel to the extremum of the quadratic through its 8 neighbours; zero if there is none.
fn offset([above, here, below]: [&[f32]; 3], x: usize) -> [f32; 2] {
    let value = here[x];
    let dx = 0.5 * (here[x + 1] - here[x - 1]);
    let dy = 0.5 * (below[x] - above[x]);
    let xx = here[x + 1] + here[x - 1] - 2.0 * value;
    let yy = below[x] + above[x] - 2.0 * value;
    let xy = 0.25 * (below[x + 1] + above[x - 1] - above[x + 1] - below[x - 1]);
    let determinant = xx * yy - xy * xy;
    if determinant == 0.0 {
        return [0.0, 0.0];
    }
    [
        (xy * dy - yy * dx) / determinant,
        (xy * dx - xx * dy) / determinant,
    ]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::image::Size;

    fn level(radius: usize, maxima: &[([usize; 2], f32)]) -> Candidates {
        let mut rows = RowBuffer::whole(Size::new(60, 40));
        for y in 0..40 {
            for row in rows.append(1) {
                row.fill(0.0);
                for &([x, row_of], value) in maxima {
                    if row_of == y {
                        row[x] = value;
                    }
                }
            }
        }
        let mut candidates = Candidates::new(radius);
        for y in 2..38 {
            candidates.search(&rows, y, 2, 0.1);
        }
        candidates
    }

    fn left(candidates: &Candidates) -> Vec<[usize; 2]> {
        candidates.survivors().map(|c| c.pixel).collect()
    }

    #[test]
    fn the_stronger_of_two_neighbours_survives() {
        let candidates = level(3, &[([10, 10], 1.0), ([12, 12], 2.0), ([30, 10], 0.05)]);
        assert_eq!(left(&candidates), [[12, 12]]);
        let candidates = level(2, &[([10, 10], 1.0), ([13, 12], 2.0), ([40, 20], 0.5)]);
        assert_eq!(left(&candidates), [[10, 10], [13, 12], [40, 20]]);
    }

    #[test]
    fn levels_suppress_each_other() {
        let mut fine = level(2, &[([20, 20], 1.0), ([40, 20], 3.0), ([30, 30], 1.0)]);
        let mut coarse = level(2, &[([10, 10], 2.0), ([20, 10], 2.0)]);
        fine.suppress_by_next(&coarse, 2);
        assert_eq!(left(&fine), [[40, 20], [30, 30]]);
        coarse.suppress_by_previous(&fine, 2);
        assert_eq!(left(&coarse), [[10, 10]]);
    }

    #[test]
    fn the_top_of_a_paraboloid_is_found() {
        let at = |x: f32, y: f32| 5.0 - (x - 0.25).powi(2) - 2.0 * (y + 0.5).powi(2) + 0.3 * x * y;
        let rows = [-1.0, 0.0, 1.0].map(|y| [-1.0, 0.0, 1.0].map(|x| at(x, y)));
        let [x, y] = offset([&rows[0], &rows[1], &rows[2]], 1);
        // Where both derivatives vanish: 2 (0.25 - x) + 0.3 y = 0 and -4 (y + 0.5) + 0.3 x = 0.
        assert!((2.0 * (0.25 - x) + 0.3 * y).abs() < 1e-5);
        assert!((-4.0 * (y + 0.5) + 0.3 * x).abs() < 1e-5);
        assert_eq!(offset([&[1.0; 3]; 3], 1), [0.0, 0.0]);
    }
}
