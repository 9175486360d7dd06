//! Maps of directions, smoothed downwards where they are needed.
//!
//! An image is worked off in bands of rows, and a band in blocks of columns: smoothing downwards
//! does not look beyond a column, so that a block of a few columns goes through all smoothing while
//! it is in the cache.

use std::ops::{Range, RangeInclusive};

use super::DIRECTIONS;
use crate::image::{FloatImage, GaussianKernel, Size};
use crate::simd::{ROWS_AT_ONCE, rectified_gradients, weigh_rows};

/// Columns of a block.
const BLOCK: usize = 16;

/// The values of all maps at one pixel.
pub(super) type Histogram = [f32; DIRECTIONS];

/// One row of a block.
type BlockRow = [Histogram; BLOCK];

/// Some rows of the maps of each ring.
pub(super) struct Band {
    size: Size,
    /// The first row.
    top: usize,
    /// Rows that histograms may begin in; they need one more.
    rows: usize,
    /// Blocks in a row.
    blocks: usize,
    /// The rows that are needed of each block, relative to `top`.
    needed: Vec<Range<usize>>,
    /// For each ring the rows of all blocks.
    rings: Vec<Vec<BlockRow>>,
}

impl Band {
    /// A band of `rows` rows for histograms to begin in.
    pub(super) fn new(size: Size, rings: usize, rows: usize) -> Self {
        let blocks = size.width.div_ceil(BLOCK);
        let rows = rows.min(size.height);
        Self {
            size,
            top: 0,
            rows,
            blocks,
            needed: vec![0..0; blocks],
            rings: vec![vec![[[0.0; DIRECTIONS]; BLOCK]; blocks * (rows + 1)]; rings],
        }
    }

    /// Moves to the rows from `top` on, of which none is needed yet.
    pub(super) fn restart(&mut self, top: usize) {
        self.top = top;
        self.needed.fill(0..0);
    }

    /// Asks for some columns of `row` and the next.
    pub(super) fn need(&mut self, columns: RangeInclusive<usize>, row: usize) {
        let row = row - self.top;
        debug_assert!(row < self.rows, "row {row} of {}", self.rows);
        for needed in &mut self.needed[columns.start() / BLOCK..=columns.end() / BLOCK] {
            let first = if needed.end == 0 {
                row
            } else {
                needed.start.min(row)
            };
            *needed = first..needed.end.max(row + 2);
        }
    }

    /// Histograms in a row.
    pub(super) fn stride(&self) -> usize {
        self.blocks * BLOCK
    }

    /// All histograms of a ring, and the index among them of the one in this row and column.
    pub(super) fn map(&self, ring: usize, row: usize, column: usize) -> (&[Histogram], usize) {
        let map = self.rings[ring].as_flattened();
        (map, (row - self.top) * self.stride() + column)
    }
}

/// Makes maps of directions and smooths them downwards.
pub(super) struct Columns<'a> {
    image: &'a FloatImage,
    kernels: &'a [GaussianKernel],
    directions: [[f32; DIRECTIONS]; 2],
    /// Rows of a block before and after smoothing.
    before: Vec<BlockRow>,
    after: Vec<BlockRow>,
}

impl<'a> Columns<'a> {
    /// Maps of `image` with grey levels up to 255, to be smoothed by the first kernel and then by
    /// the kernel of each ring.
    pub(super) fn new(image: &'a FloatImage, kernels: &'a [GaussianKernel]) -> Self {
        let direction = |i: usize| {
            let angle = std::f64::consts::TAU * i as f64 / DIRECTIONS as f64;
            [libm::cos(angle), libm::sin(angle)].map(|v| (v / 255.0) as f32)
        };
        Self {
            image,
            kernels,
            directions: [0, 1].map(|axis| std::array::from_fn(|i| direction(i)[axis])),
            before: Vec::new(),
            after: Vec::new(),
        }
    }

    /// Fills all blocks that `band` needs.
    pub(super) fn fill(&mut self, band: &mut Band) {
        for block in 0..band.blocks {
            let needed = band.needed[block].clone();
            if !needed.is_empty() {
                self.fill_block(band, block, needed);
            }
        }
    }

    fn fill_block(&mut self, band: &mut Band, block: usize, needed: Range<usize>) {
        let height = self.image.height();
        let wanted = band.top + needed.start..(band.top + needed.end).min(height);
        // Each smoothing needs more rows than it makes, so the first makes most.
        let grown = |rows: &Range<usize>, reach: usize| {
            rows.start.saturating_sub(reach)..(rows.end + reach).min(height)
        };
        let mut made = vec![wanted.clone()];
        for kernel in self.kernels.iter().rev() {
            made.push(grown(&made[made.len() - 1], kernel.radius()));
        }
        let mut made = made.into_iter().rev();
        let mut rows = made.next().expect("a range for each kernel and one more");
        self.gradients(block * BLOCK, rows.clone());
        for (level, (kernel, next)) in self.kernels.iter().zip(made).enumerate() {
            smooth(
                kernel,
                height,
                (&self.before, rows),
                (&mut self.after, next.clone()),
            );
            if let Some(ring) = level.checked_sub(1) {
                for y in wanted.clone() {
                    let at = (y - band.top) * band.blocks + block;
                    band.rings[ring][at] = self.after[y - next.start];
                }
            }
            std::mem::swap(&mut self.before, &mut self.after);
            rows = next;
        }
    }

    /// Fills `before` with the maps of some rows. Differences at the border are one-sided.
    fn gradients(&mut self, left: usize, rows: Range<usize>) {
        let Size { width, height } = self.image.size();
        let count = BLOCK.min(width - left);
        self.before.clear();
        self.before.resize(rows.len(), [[0.0; DIRECTIONS]; BLOCK]);
        // Beyond the border the image goes on straight.
        let beyond = |here: f32, inner: f32| 2.0 * here - inner;
        for (y, maps) in rows.zip(&mut self.before) {
            let row = self.image.row(y);
            let mut here = [0.0; BLOCK + 2];
            here[1..=count].copy_from_slice(&row[left..left + count]);
            here[0] = match left.checked_sub(1) {
                Some(x) => row[x],
                None => beyond(row[0], row[1.min(width - 1)]),
            };
            here[count + 1] = match row.get(left + count) {
                Some(&value) => value,
                None => beyond(row[width - 1], row[width.saturating_sub(2)]),
            };
            let neighbour = |inner: usize, outer: Option<usize>| {
                let mut pixels = [0.0; BLOCK];
                match outer {
                    Some(y) => {
                        pixels[..count].copy_from_slice(&self.image.row(y)[left..left + count]);
                    }
                    None => {
                        let inner = &self.image.row(inner)[left..left + count];
                        for ((pixel, &inner), &here) in pixels.iter_mut().zip(inner).zip(&here[1..])
                        {
                            *pixel = beyond(here, inner);
                        }
                    }
                }
                pixels
            };
            let next = (y + 1 < height).then_some(y + 1);
            let above = neighbour(1.min(height - 1), y.checked_sub(1));
            let below = neighbour(height.saturating_sub(2), next);
            let (above, below) = (&above[..count], &below[..count]);
            rectified_gradients(
                above,
                &here[..count + 2],
                below,
                &self.directions,
                &mut maps[..count],
            );
        }
    }
}

/// Smooths some rows of an image of `height` rows, which is continued by its outermost ones.
fn smooth(
    kernel: &GaussianKernel,
    height: usize,
    (before, there): (&[BlockRow], Range<usize>),
    (after, made): (&mut Vec<BlockRow>, Range<usize>),
) {
    let row = |y: usize| {
        let y = y.saturating_sub(kernel.radius()).min(height - 1);
        before[y - there.start].as_flattened()
    };
    let inputs: Vec<&[f32]> = (made.start..made.end + 2 * kernel.radius())
        .map(row)
        .collect();
    after.resize(made.len(), [[0.0; DIRECTIONS]; BLOCK]);
    let mut outputs: Vec<&mut [f32]> = (after.iter_mut())
        .map(|row| row.as_flattened_mut())
        .collect();
    for (i, outputs) in outputs.chunks_mut(ROWS_AT_ONCE).enumerate() {
        let count = kernel.taps().len() + outputs.len() - 1;
        weigh_rows(&inputs[ROWS_AT_ONCE * i..][..count], kernel.taps(), outputs);
    }
}
