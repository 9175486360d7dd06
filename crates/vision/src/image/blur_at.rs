//! A Gaussian blur at single places, for layers of which few pixels are looked at.

use super::RowBuffer;
use super::blur::{Border, GaussianKernel};
use crate::simd::{weigh_rows, weigh_symmetric};

/// Columns that the vertical pass makes together. SIFT's widest kernel needs no more about a place.
const BLOCK: usize = 32;
/// Columns that the horizontal pass makes together, of which three are wanted.
const LANES: usize = 8;

/// The nine pixels about (`x`, `y`) of `input` blurred by a Gaussian, row after row. Beyond its border the image is
/// mirrored. The bits are those of the whole image blurred, since both passes are the same.
///
/// # Panics
/// If `input` lacks a row or a column that the kernel reaches, or if (`x`, `y`) lies on the border of the image.
pub(super) fn blur_at(
    input: &RowBuffer,
    kernel: &GaussianKernel,
    x: usize,
    y: usize,
) -> [[f32; 3]; 3] {
    let (size, held, taps) = (input.size(), input.columns(), kernel.taps());
    assert!(
        x > 0 && x + 1 < size.width && y > 0 && y + 1 < size.height,
        "a pixel on each side of ({x}, {y}) in {size}"
    );
    let reach = kernel.radius() + 1;
    let count = 2 * reach + 1;
    // What rows hold beyond the columns that are needed is summed and not used.
    let columns = count.next_multiple_of(BLOCK);
    let is_far_inside = x >= held.start + reach
        && x - reach + columns <= held.end
        && y >= reach
        && y + reach < size.height;
    if is_far_inside {
        let start = x - reach - held.start;
        let rows = input.rows(y - reach..y + reach + 1);
        return weigh_about(rows.map(|row| &row[start..][..columns]), taps, columns);
    }
    let [first_row, first] = [y, x].map(|v| v as isize - reach as isize);
    let within = x.saturating_sub(reach)..size.width.min(x + reach + 1);
    let mut pixels = vec![0.0; count * columns];
    for (part, place) in pixels.chunks_exact_mut(columns).zip(first_row..) {
        let row = input.row(Border::Mirror.index(place, size.height));
        let part = &mut part[..count];
        part[(within.start as isize - first) as usize..][..within.len()]
            .copy_from_slice(&row[within.start - held.start..within.end - held.start]);
        Border::Mirror.fill_ends(part, first, size.width);
    }
    weigh_about(pixels.chunks_exact(columns), taps, columns)
}

/// Both passes over two more rows than there are taps, which hold so many `columns`.
fn weigh_about<'a>(
    input: impl Iterator<Item = &'a [f32]>,
    taps: &[f32],
    columns: usize,
) -> [[f32; 3]; 3] {
    let (count, width) = (taps.len() + 2, columns + LANES);
    // Nothing is allocated for a single block.
    let mut of_block: ([&[f32]; BLOCK], _) = ([&[]; BLOCK], [0.0; 3 * (BLOCK + LANES)]);
    let mut of_blocks;
    let (rows, sums) = if columns == BLOCK {
        (&mut of_block.0[..count], &mut of_block.1[..])
    } else {
        of_blocks = (vec![&[][..]; count], vec![0.0; 3 * width]);
        (&mut of_blocks.0[..], &mut of_blocks.1[..])
    };
    for (row, input) in rows.iter_mut().zip(input) {
        *row = input;
    }
    let (above, rest) = sums.split_at_mut(width);
    let (middle, below) = rest.split_at_mut(width);
    let mut sums = [above, middle, below];
    let mut blocks = sums.each_mut().map(|row| &mut row[..columns]);
    weigh_rows(rows, taps, &mut blocks);
    sums.map(|row| {
        let mut lanes = [0.0; LANES];
        weigh_symmetric(&row[..taps.len() + LANES - 1], taps, &mut lanes);
        [lanes[0], lanes[1], lanes[2]]
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::image::{FloatImage, Size, gaussian_blur};
    use crate::seed::Seed;

    #[test]
    fn every_pixel_is_that_of_the_blurred_image() {
        let mut rng = Seed(11).rng();
        for (width, height, sigma) in [
            (3, 3, 3.1),
            (11, 40, 3.1),
            (60, 35, 2.2),
            (41, 12, 0.3),
            (90, 70, 8.2),
        ] {
            let size = Size::new(width, height);
            let image = FloatImage::from_fn(size, |_, _| rng.uniform() as f32 * 255.0);
            let blurred = gaussian_blur(&image, sigma);
            let mut input = RowBuffer::whole(size);
            while !input.is_complete() {
                let made = input.made();
                for (y, row) in (made..).zip(input.append(1)) {
                    row.copy_from_slice(image.row(y));
                }
            }
            for y in 1..height - 1 {
                for x in 1..width - 1 {
                    let pixels = blur_at(&input, &GaussianKernel::new(sigma), x, y);
                    for (row, y) in pixels.iter().zip(y - 1..) {
                        assert_eq!(row, &blurred.row(y)[x - 1..=x + 1], "({x}, {y}) of {size}");
                    }
                }
            }
        }
    }
}
