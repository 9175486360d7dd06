//! A buffer of rows: an image, or a strip of its columns, that is made row by row and may drop its oldest rows.

use std::ops::Range;

use super::Size;
use crate::simd::ROWS_AT_ONCE;

/// Pixels of a cache line. Rows start at multiples of it.
const LINE: usize = 16;

/// Rows of an image that are appended from top to bottom. The last rows (or all) are kept.
///
/// Filters that run over an image from top to bottom, each some rows behind the one before, need only a few
/// rows of each intermediate image, and these few stay in the cache. If the rows are too long for that, the
/// image is made in strips, and a buffer holds only some of the columns.
#[derive(Clone, Debug)]
pub struct RowBuffer {
    size: Size,
    columns: Range<usize>,
    stride: usize,
    capacity: usize,
    made: usize,
    /// The row that is stored first in `data`. It is a multiple of the capacity, so the other rows are found
    /// without a division.
    first: usize,
    data: Vec<f32>,
    /// Offset in `data` where the first row starts.
    start: usize,
}

impl RowBuffer {
    /// A buffer for an image of `size`, without rows at first, that keeps at least the last `keep` rows.
    pub fn new(size: Size, keep: usize) -> Self {
        Self::strip(size, 0..size.width, keep)
    }

    /// A buffer for the `columns` of an image of `size`, without rows at first, that keeps at least the last
    /// `keep` rows.
    ///
    /// # Panics
    /// If the image has fewer columns.
    pub fn strip(size: Size, columns: Range<usize>, keep: usize) -> Self {
        Self::strip_in(Vec::new(), size, columns, keep)
    }

    /// As [`Self::strip`], in the memory of a buffer of any size that is no longer needed. The first use of
    /// fresh memory takes more time than the sums that are made in it.
    pub(crate) fn strip_in(
        memory: Vec<f32>,
        size: Size,
        columns: Range<usize>,
        keep: usize,
    ) -> Self {
        assert!(columns.end <= size.width, "columns {columns:?} of {size}");
        // Blocks of rows must not wrap around the end of the buffer.
        let capacity = keep
            .clamp(1, size.height.max(1))
            .next_multiple_of(ROWS_AT_ONCE);
        // Rows at a distance of a multiple of 4 KiB would fall into the same places of the cache.
        let stride = columns.len().next_multiple_of(LINE) | LINE;
        let needed = capacity * stride + LINE;
        let mut data = memory;
        if data.capacity() < needed {
            drop(data);
            data = vec![0.0; needed];
        } else {
            data.resize(needed, 0.0);
        }
        let start = data.as_ptr().align_offset(LINE * size_of::<f32>());
        Self {
            size,
            columns,
            stride,
            capacity,
            made: 0,
            first: 0,
            data,
            // A place not found costs time only.
            start: start.min(LINE),
        }
    }

    /// A buffer that keeps all rows.
    pub fn whole(size: Size) -> Self {
        Self::new(size, size.height)
    }

    /// Its memory, for another buffer.
    pub(crate) fn into_memory(self) -> Vec<f32> {
        self.data
    }

    /// Drops all rows. The buffer is then filled again.
    pub(crate) fn restart(&mut self) {
        self.made = 0;
        self.first = 0;
    }

    /// Width and height of the finished image.
    pub fn size(&self) -> Size {
        self.size
    }

    /// The columns of the image that the rows hold.
    pub fn columns(&self) -> Range<usize> {
        self.columns.clone()
    }

    /// Number of rows made so far.
    pub fn made(&self) -> usize {
        self.made
    }

    /// Whether every row was made.
    pub fn is_complete(&self) -> bool {
        self.made == self.size.height
    }

    /// Row `y`, from left to right: the pixels of [`Self::columns`].
    ///
    /// # Panics
    /// If the row was not made yet or was dropped.
    #[inline]
    pub fn row(&self, y: usize) -> &[f32] {
        assert!(
            y < self.made && self.made <= y + self.capacity,
            "row {y} is not among the last {} of {}",
            self.capacity,
            self.made
        );
        let place = if y >= self.first {
            y - self.first
        } else {
            y + self.capacity - self.first
        };
        &self.data[self.start + place * self.stride..][..self.columns.len()]
    }

    /// Some consecutive rows, each as [`Self::row`].
    ///
    /// # Panics
    /// If one of them was not made yet or was dropped.
    pub fn rows(&self, range: Range<usize>) -> impl ExactSizeIterator<Item = &[f32]> {
        assert!(
            range.end <= self.made && self.made <= range.start + self.capacity,
            "rows {range:?} are not all among the last {} of {}",
            self.capacity,
            self.made
        );
        let place = range.start + self.capacity - self.first;
        let mut start = place % self.capacity * self.stride;
        let end = self.capacity * self.stride;
        let data = &self.data[self.start..][..end];
        range.map(move |_| {
            let row = &data[start..][..self.columns.len()];
            start += self.stride;
            if start == end {
                start = 0;
            }
            row
        })
    }

    /// The next `count` rows (fewer at the end), to be written together.
    ///
    /// # Panics
    /// If the rows do not lie in one piece, as they do if each call has the same `count`, a divisor of `ROWS_AT_ONCE`.
    pub fn append(&mut self, count: usize) -> impl Iterator<Item = &mut [f32]> {
        if self.made == self.first + self.capacity {
            self.first = self.made;
        }
        let place = self.made - self.first;
        assert!(place + count <= self.capacity, "{count} rows in one piece");
        let count = count.min(self.size.height - self.made);
        let start = self.start + place * self.stride;
        self.made += count;
        self.data[start..][..count * self.stride]
            .chunks_exact_mut(self.stride)
            .map(|row| &mut row[..self.columns.len()])
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
