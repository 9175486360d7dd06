//! Step 2 of KAZE: maxima of the determinant of the Hessian among 26 neighbours, fitted in place and scale. Of
//! those near each other in neighbouring levels the strongest is kept.

use crate::features::peak::offset;
use crate::image::{RowBuffer, Size};
use crate::simd::find_extrema;

/// Side of the cells in which maxima are looked up, in pixels.
const CELL: usize = 32;

/// A maximum that may become a keypoint.
#[derive(Clone, Copy, Debug)]
pub(super) struct Maximum {
    /// Number of the level.
    pub(super) level: usize,
    /// Column and row.
    pub(super) pixel: [usize; 2],
    /// The determinant there.
    pub(super) response: f32,
    /// From there to the top of the quadratic through the neighbours, along x, y and level; none
    /// if that is more than one away.
    pub(super) offset: Option<[f32; 3]>,
}

/// Appends to `found` the maxima above `threshold` in row `y` of the middle one of three levels;
/// `level` is its number.
pub(super) fn find_maxima(
    determinants: [&RowBuffer; 3],
    level: usize,
    y: usize,
    threshold: f32,
    found: &mut Vec<Maximum>,
) {
    let width = determinants[1].size().width;
    if width < 3 {
        return;
    }
    let rows = determinants.map(|rows| [y - 1, y, y + 1].map(|y| rows.row(y)));
    let mut columns = Vec::new();
    find_extrema(&rows, 1..width - 1, threshold, &mut columns);
    for x in columns.into_iter().map(|x| x as usize) {
        let response = rows[1][1][x];
        if response > 0.0 {
            found.push(Maximum {
                level,
                pixel: [x, y],
                response,
                offset: offset(&rows, x),
            });
        }
    }
}

/// The strongest maxima of all levels so far.
pub(super) struct Strongest {
    maxima: Vec<Maximum>,
    /// Indices of the maxima in each cell of the image.
    cells: Vec<Vec<u32>>,
    cells_in_row: usize,
}

impl Strongest {
    pub(super) fn new(size: Size) -> Self {
        let [columns, rows] = [size.width, size.height].map(|v| v / CELL + 1);
        Self {
            maxima: Vec::new(),
            cells: vec![Vec::new(); columns * rows],
            cells_in_row: columns,
        }
    }

    /// Adds a maximum, unless there is one at least as strong less than `radius` away in its own
    /// level or a neighbouring one. If there is a weaker one, it takes its place; only the one
    /// that was added first counts.
    pub(super) fn add(&mut self, maximum: Maximum, radius: usize) {
        let Some(near) = self.first_near(&maximum, radius) else {
            let index = self.maxima.len() as u32;
            self.cell(&maximum).push(index);
            self.maxima.push(maximum);
            return;
        };
        let old = self.maxima[near];
        if maximum.response > old.response {
            self.cell(&old).retain(|&index| index as usize != near);
            self.cell(&maximum).push(near as u32);
            self.maxima[near] = maximum;
        }
    }

    /// The strongest ones in `level`.
    pub(super) fn in_level(&self, level: usize) -> impl Iterator<Item = &Maximum> {
        self.maxima.iter().filter(move |m| m.level == level)
    }

    fn first_near(&self, maximum: &Maximum, radius: usize) -> Option<usize> {
        let [columns, rows] = maximum
            .pixel
            .map(|v| v.saturating_sub(radius) / CELL..=(v + radius) / CELL);
        let mut first: Option<usize> = None;
        for cells in rows.filter_map(|row| self.cells.chunks_exact(self.cells_in_row).nth(row)) {
            let cells = columns.clone().filter_map(|column| cells.get(column));
            for &index in cells.flatten() {
                let index = index as usize;
                let other = &self.maxima[index];
                let [dx, dy] = [0, 1].map(|i| other.pixel[i].abs_diff(maximum.pixel[i]));
                if other.level.abs_diff(maximum.level) <= 1
                    && dx * dx + dy * dy < radius * radius
                    && first.is_none_or(|first| index < first)
                {
                    first = Some(index);
                }
            }
        }
        first
    }

    fn cell(&mut self, maximum: &Maximum) -> &mut Vec<u32> {
        let [column, row] = maximum.pixel.map(|v| v / CELL);
        &mut self.cells[row * self.cells_in_row + column]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_first_near_one_is_replaced_by_a_stronger_one() {
        let maximum = |level, pixel, response| Maximum {
            level,
            pixel,
            response,
            offset: None,
        };
        let mut strongest = Strongest::new(Size::new(100, 70));
        strongest.add(maximum(3, [31, 31], 2.0), 5);
        strongest.add(maximum(3, [33, 33], 1.0), 5); // weaker
        strongest.add(maximum(3, [36, 31], 1.0), 5); // 5 away
        strongest.add(maximum(4, [32, 32], 3.0), 5); // stronger, takes the place of the first
        strongest.add(maximum(6, [32, 32], 1.0), 5); // two levels away
        let pixels =
            |level| -> Vec<[usize; 2]> { strongest.in_level(level).map(|m| m.pixel).collect() };
        assert_eq!(pixels(3), [[36, 31]]);
        assert_eq!(pixels(4), [[32, 32]]);
        assert_eq!(pixels(6), [[32, 32]]);
    }
}
