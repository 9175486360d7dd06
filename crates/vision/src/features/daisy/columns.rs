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

const EMPTY: BlockRow = [[0.0; DIRECTIONS]; BLOCK];

/// Some rows of the maps of each ring.
pub(super) struct Band {
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
            top: 0,
            rows,
            blocks,
            needed: vec![0..0; blocks],
            rings: vec![vec![EMPTY; blocks * (rows + 1)]; rings],
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
    size: Size,
    /// The image with its outermost pixels again around it.
    framed: FloatImage,
    kernels: &'a [GaussianKernel],
    directions: [[f32; DIRECTIONS]; 2],
    /// Rows of a block before and after smoothing.
    before: Vec<BlockRow>,
    after: Vec<BlockRow>,
}

impl<'a> Columns<'a> {
    /// Maps of `image` with grey levels up to 255, to be smoothed by the first kernel and then by
    /// the kernel of each ring.
    pub(super) fn new(image: &FloatImage, kernels: &'a [GaussianKernel]) -> Self {
        let direction = |i: usize| {
            let angle = std::f64::consts::TAU * i as f64 / DIRECTIONS as f64;
            [libm::cos(angle), libm::sin(angle)].map(|v| (v / 255.0) as f32)
        };
        Self {
            size: image.size(),
            framed: frame(image),
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
        let height = self.size.height;
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

    /// Fills `before` with the maps of some rows.
    fn gradients(&mut self, left: usize, rows: Range<usize>) {
        let count = BLOCK.min(self.size.width - left);
        self.before.resize(rows.len(), EMPTY);
        for (y, maps) in rows.zip(&mut self.before) {
            // Row y of the image is row y + 1 of the framed one.
            let around = [y, y + 1, y + 2].map(|y| &self.framed.row(y)[left..left + count + 2]);
            rectified_gradients(around, &self.directions, &mut maps[..count]);
        }
    }
}

/// An image with its outermost pixels again around it.
fn frame(image: &FloatImage) -> FloatImage {
    let Size { width, height } = image.size();
    let mut pixels = Vec::with_capacity((width + 2) * (height + 2));
    for y in 0..height + 2 {
        let row = image.row(y.saturating_sub(1).min(height - 1));
        pixels.push(row[0]);
        pixels.extend_from_slice(row);
        pixels.push(row[width - 1]);
    }
    FloatImage::from_vec(Size::new(width + 2, height + 2), pixels)
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
    after.resize(made.len(), EMPTY);
    let mut outputs: Vec<&mut [f32]> = (after.iter_mut())
        .map(|row| row.as_flattened_mut())
        .collect();
    for (i, outputs) in outputs.chunks_mut(ROWS_AT_ONCE).enumerate() {
        let count = kernel.taps().len() + outputs.len() - 1;
        weigh_rows(&inputs[ROWS_AT_ONCE * i..][..count], kernel.taps(), outputs);
    }
}
