//! An image that is made row by row and may forget its oldest rows.

use super::Size;
use crate::simd::ROWS_AT_ONCE;

/// Rows of an image, appended from top to bottom, of which the last ones (or all) are kept.
///
/// Filters that run over an image from top to bottom, each some rows behind the one before, need
/// only a few rows of each intermediate image; those few stay in the cache.
#[derive(Clone, Debug)]
pub struct RowBuffer {
    size: Size,
    stride: usize,
    capacity: usize,
    made: usize,
    data: Vec<f32>,
}

impl RowBuffer {
    /// A buffer for an image of `size`, yet without rows, that keeps at least the last `keep` rows.
    pub fn new(size: Size, keep: usize) -> Self {
        // Blocks of rows must not wrap around the end of the buffer.
        let capacity = keep
            .clamp(1, size.height.max(1))
            .next_multiple_of(ROWS_AT_ONCE);
        // Rows at a distance of a multiple of 4 KiB would fall into the same places of the cache.
        let stride = size.width.next_multiple_of(16) | 16;
        Self {
            size,
            stride,
            capacity,
            made: 0,
            data: vec![0.0; capacity * stride],
        }
    }

    /// A buffer that keeps all rows.
    pub fn whole(size: Size) -> Self {
        Self::new(size, size.height)
    }

    /// Forgets all rows, to be filled again.
    pub(crate) fn restart(&mut self) {
        self.made = 0;
    }

    /// Width and height of the finished image.
    pub fn size(&self) -> Size {
        self.size
    }

    /// Number of rows made so far.
    pub fn made(&self) -> usize {
        self.made
    }

    /// Whether every row was made.
    pub fn is_complete(&self) -> bool {
        self.made == self.size.height
    }

    /// Row `y`, from left to right.
    ///
    /// # Panics
    /// If the row was not made yet or is forgotten.
    #[inline]
    pub fn row(&self, y: usize) -> &[f32] {
        assert!(
            y < self.made && self.made <= y + self.capacity,
            "row {y} is not among the last {} of {}",
            self.capacity,
            self.made
        );
        &self.data[y % self.capacity * self.stride..][..self.size.width]
    }

    /// The next `count` rows (fewer at the end), to be written at once.
    ///
    /// # Panics
    /// Unless `count` is a divisor of [`ROWS_AT_ONCE`], and the same in each call.
    pub fn append(&mut self, count: usize) -> impl Iterator<Item = &mut [f32]> {
        let place = self.made % self.capacity;
        assert!(place + count <= self.capacity, "{count} rows in one piece");
        let count = count.min(self.size.height - self.made);
        let start = place * self.stride;
        self.made += count;
        self.data[start..][..count * self.stride]
            .chunks_exact_mut(self.stride)
            .map(|row| &mut row[..self.size.width])
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_last_rows_are_kept() {
        let mut rows = RowBuffer::new(Size::new(3, 10), 5);
        let mut y = 0.0;
        while !rows.is_complete() {
            for row in rows.append(ROWS_AT_ONCE) {
                row.fill(y);
                y += 1.0;
            }
        }
        assert_eq!(rows.made(), 10);
        for y in 5..10 {
            assert_eq!(rows.row(y), [y as f32; 3]);
        }
        assert!(std::panic::catch_unwind(|| rows.row(0).len()).is_err());
    }
}
