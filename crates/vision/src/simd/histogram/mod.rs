//! Histograms of gradient directions, one for a disc and a grid of them for a patch.
#![allow(clippy::needless_bitwise_bool)] // a lazy `&&` is a branch, and lanes have none

#[cfg(target_arch = "x86_64")]
mod wide;

#[cfg(target_arch = "x86_64")]
use super::InstructionSet;
use super::gradient::turns;

/// Bins of a patch histogram, as two histograms whose sum counts: `[half][row][column][direction]`
/// with 2 x 8 x 8 x 8 places, of which a grid of 4 x 4 cells and its border use 6 x 6 x 8 of each.
pub type PatchHistogram = [f32; 1024];

/// How a rotated grid of 4 x 4 cells lies on the pixels.
#[derive(Clone, Copy, Debug)]
pub struct PatchGrid {
    /// Cosine of the grid's rotation (from x towards y), divided by the width of a cell.
    pub cos: f32,
    /// Its sine, divided by the width of a cell.
    pub sin: f32,
    /// What the direction bins are counted from, in turns.
    pub direction: f32,
}

/// The pixels about a keypoint, which offsets are counted from.
#[derive(Clone, Copy, Debug)]
pub struct Window<'a> {
    /// Rows of the image, from the one before the first span to the one after the last, all from the
    /// same column on.
    pub rows: &'a [&'a [f32]],
    /// Offset of that column.
    pub left: i32,
    /// Offset of the row of the first span.
    pub top: i32,
    /// What counts of each row.
    pub spans: &'a [Span],
    /// Weights of the offsets from `-radius` on, of rows and of columns: a pixel has the product.
    pub weights: &'a [f32],
    /// See `weights`.
    pub radius: i32,
}

/// Neighbouring pixels of a row.
#[derive(Clone, Copy, Debug)]
pub struct Span {
    /// Offset of the first.
    pub first: i32,
    /// How many.
    pub count: usize,
}

/// Gradients of the pixels of all spans, one after the other; used again and again.
#[derive(Clone, Debug, Default)]
pub struct Gradients {
    /// First the differences along x, then the directions in turns.
    directions: Vec<f32>,
    /// Differences along y (upwards).
    rises: Vec<f32>,
    /// First the weights, then the magnitudes times weight.
    values: Vec<f32>,
    bins: Vec<u32>,
}

multiversioned! {
    #![avx512]

    /// Adds the gradient of each pixel to the nearest bin of a circular histogram, by magnitude times
    /// weight.
    ///
    /// # Panics
    /// If rows or weights do not reach one pixel beyond the spans.
    pub fn add_directions(window: &Window<'_>, gradients: &mut Gradients, histogram: &mut [f32; 36]) {
        measure(window, gradients);
        let Gradients { directions, values, bins, .. } = gradients;
        bins.resize(directions.len(), 0);
        for (bin, direction) in bins.iter_mut().zip(&*directions) {
            *bin = whole(*direction * 36.0);
        }
        for (&bin, value) in bins.iter().zip(&*values) {
            histogram[if bin < 36 { bin as usize } else { 0 }] += value;
        }
    }

    /// Adds the gradient of each pixel to the eight bins around it, by magnitude times weight and the
    /// distance to the bins' centres in row, column and direction.
    ///
    /// # Panics
    /// If rows or weights do not reach one pixel beyond the spans.
    pub fn add_patch(window: &Window<'_>, grid: &PatchGrid, gradients: &mut Gradients, histogram: &mut PatchHistogram) {
        measure(window, gradients);
        let mut start = 0;
        for (span, y) in window.spans.iter().zip(window.top..) {
            let row = PatchRow {
                y: y as f32,
                x: span.first as f32,
                values: &gradients.values[start..][..span.count],
                directions: &gradients.directions[start..][..span.count],
            };
            start += span.count;
            #[cfg(target_arch = "x86_64")]
            if InstructionSet::in_use() == InstructionSet::Avx512 {
                // SAFETY: what is in use was detected on this processor.
                unsafe { wide::add_row(grid, &row, histogram) };
                continue;
            }
            let mut x = 0;
            while x + 8 <= span.count {
                patch_block::<8>(grid, &row, x, histogram);
                x += 8;
            }
            while x < span.count {
                patch_block::<1>(grid, &row, x, histogram);
                x += 1;
            }
        }
    }
}

/// Centres of the cells are at 0, 1, 2, 3; the middle of the patch lies between 1 and 2.
const MIDDLE: f32 = 1.5;

/// Gradients along one row.
struct PatchRow<'a> {
    /// Offset of the row.
    y: f32,
    /// Offset of the first pixel.
    x: f32,
    /// Magnitudes times weight.
    values: &'a [f32],
    directions: &'a [f32],
}

/// Magnitudes and directions of the central differences: all in one go, in which vectors are full.
#[inline(always)]
fn measure(window: &Window<'_>, gradients: &mut Gradients) {
    let Gradients {
        directions,
        rises,
        values,
        ..
    } = gradients;
    for values in [&mut *directions, &mut *rises, &mut *values] {
        values.clear();
    }
    for (i, (span, y)) in window.spans.iter().zip(window.top..).enumerate() {
        let count = span.count;
        if count == 0 {
            continue;
        }
        let x = (span.first - window.left) as usize;
        let [above, here, below] = [0, 1, 2].map(|k| window.rows[i + k]);
        let (left, right) = (&here[x - 1..][..count], &here[x + 1..][..count]);
        let (above, below) = (&above[x..][..count], &below[x..][..count]);
        let weight = window.weights[(y + window.radius) as usize];
        let weights = &window.weights[(span.first + window.radius) as usize..][..count];
        extend(directions, right, left, |right, left| right - left);
        extend(rises, above, below, |above, below| above - below);
        extend(values, weights, weights, |along, _| weight * along);
    }
    let all = directions.iter_mut().zip(&*rises).zip(values);
    for ((direction, &dy), value) in all {
        let dx = *direction;
        *value *= dx.mul_add(dx, dy * dy).sqrt();
        *direction = turns(dy, dx);
    }
}

/// Appends what `f` makes of two rows of one length; rows are mostly whole blocks of eight.
#[inline(always)]
fn extend(out: &mut Vec<f32>, a: &[f32], b: &[f32], f: impl Fn(f32, f32) -> f32) {
    let start = out.len();
    out.resize(start + a.len(), 0.0);
    let (blocks, last) = out[start..].as_chunks_mut::<8>();
    let ((a, last_a), (b, last_b)) = (a.as_chunks::<8>(), b.as_chunks::<8>());
    for ((out, a), b) in blocks.iter_mut().zip(a).zip(b) {
        for i in 0..8 {
            out[i] = f(a[i], b[i]);
        }
    }
    for ((out, a), b) in last.iter_mut().zip(last_a).zip(last_b) {
        *out = f(*a, *b);
    }
}

#[inline(always)]
fn patch_block<const L: usize>(
    grid: &PatchGrid,
    row: &PatchRow<'_>,
    start: usize,
    histogram: &mut PatchHistogram,
) {
    let values = lanes::<L>(row.values, start);
    let directions = lanes::<L>(row.directions, start);
    let mut cells = [0_u32; L];
    let mut bins = [0_u32; L];
    let mut nexts = [0.0_f32; L];
    let mut corners = [[0.0_f32; L]; 4];
    for i in 0..L {
        let x = row.x + (start + i) as f32;
        let column = x.mul_add(grid.cos, row.y * grid.sin) + MIDDLE;
        let line = row.y.mul_add(grid.cos, -(x * grid.sin)) + MIDDLE;
        let inside = (line > -1.0) & (line < 4.0) & (column > -1.0) & (column < 4.0);
        let value = if inside { values[i] } else { 0.0 };
        let column = if inside { column } else { 0.0 };
        let line = if inside { line } else { 0.0 };
        let bin = (directions[i] - grid.direction) * 8.0;
        let (column0, line0, bin0) = (column.floor(), line.floor(), bin.floor());
        let (column1, line1, bin1) = (column - column0, line - line0, bin - bin0);
        cells[i] = whole(line0.mul_add(64.0, column0.mul_add(8.0, 72.0)));
        bins[i] = whole(bin0) & 7;
        let below = value * line1;
        let above = value - below;
        let below_right = below * column1;
        let below_left = below - below_right;
        let above_right = above * column1;
        let above_left = above - above_right;
        corners[0][i] = above_left;
        corners[1][i] = above_right;
        corners[2][i] = below_left;
        corners[3][i] = below_right;
        nexts[i] = bin1;
    }
    for i in 0..L {
        let (bin, next) = ((bins[i] & 7) as usize, ((bins[i] + 1) & 7) as usize);
        let mut shares = [0.0_f32; 8];
        for (b, share) in shares.iter_mut().enumerate() {
            *share = nexts[i].mul_add(UNITS[7 - next + b], (1.0 - nexts[i]) * UNITS[7 - bin + b]);
        }
        // Neighbouring pixels mostly fall into the same cells; two histograms by turns, and none
        // waits for the sum before.
        let around = &mut histogram[(i & 1) * 512 + cells[i] as usize..][..80];
        for (corner, offset) in corners.iter().zip([0, 8, 64, 72]) {
            for (sum, share) in around[offset..offset + 8].iter_mut().zip(&shares) {
                *sum = corner[i].mul_add(*share, *sum);
            }
        }
    }
}

/// Eight values from place `7 - i` on are 0 but for a 1 at place `i`.
const UNITS: [f32; 15] = [
    0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0,
];

/// A sum with this leaves no place for a fraction, and the integer in the lowest bits.
const NO_FRACTION: f32 = 1.5 * (1 << 23) as f32;

/// The integer nearest to `x` (even if there are two) modulo 2^22, for `|x|` below 2^21. Unlike
/// a cast it needs no care for other values.
#[inline(always)]
fn whole(x: f32) -> u32 {
    (x + NO_FRACTION).to_bits() & 0x003f_ffff
}

#[inline(always)]
fn lanes<const L: usize>(row: &[f32], x: usize) -> &[f32; L] {
    row[x..].first_chunk::<L>().expect("rows of one length")
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::seed::Seed;
    use crate::simd::InstructionSet;

    #[test]
    fn whole_numbers() {
        for x in [-8_i32, -1, 0, 3, 71, 367] {
            assert_eq!(whole(x as f32), x as u32 & 0x003f_ffff);
        }
        assert_eq!((whole(2.5), whole(3.5), whole(35.6)), (2, 4, 36));
    }

    /// A row of pixels whose right-hand differences and rises are given, all of weight 1, whose
    /// first lies at offset `x`.
    fn with_row(x: i32, differences: &[[f32; 2]], each: impl FnOnce(&Window<'_>)) {
        let n = differences.len();
        let mut here = vec![0.0; n + 2];
        for (i, [dx, _]) in differences.iter().enumerate() {
            here[i + 2] = here[i] + dx;
        }
        let above: Vec<f32> = [0.0]
            .into_iter()
            .chain(differences.iter().map(|d| d[1]))
            .collect();
        let below = vec![0.0; n + 1];
        let radius = x.abs().max(x.abs() + n as i32);
        each(&Window {
            rows: &[&above, &here, &below],
            left: x - 1,
            top: 0,
            spans: &[Span { first: x, count: n }],
            weights: &vec![1.0; 2 * radius as usize + 1],
            radius,
        });
    }

    #[test]
    fn all_sets_of_instructions_give_the_same_bits() {
        let mut rng = Seed(12).rng();
        for count in [1, 8, 15, 24, 47] {
            let mut value = || rng.normal() as f32;
            let differences: Vec<[f32; 2]> = (0..count).map(|_| [value(), value()]).collect();
            let grid = PatchGrid {
                cos: 0.11,
                sin: -0.07,
                direction: 0.8,
            };
            let mut all: Vec<(PatchHistogram, [f32; 36])> = Vec::new();
            with_row(-20, &differences, |window| {
                InstructionSet::for_each(|_| {
                    let gradients = &mut Gradients::default();
                    let (mut patch, mut directions) = ([0.0; 1024], [0.0; 36]);
                    // Twice, so that there are sums to be added to.
                    for _ in 0..2 {
                        add_patch(window, &grid, gradients, &mut patch);
                        add_directions(window, gradients, &mut directions);
                    }
                    all.push((patch, directions));
                });
            });
            assert!(all[0].0.iter().any(|&sum| sum > 0.0));
            assert!(all.iter().all(|sums| *sums == all[0]), "{count} pixels");
        }
    }

    #[test]
    fn directions_go_to_the_nearest_bin() {
        let mut histogram = [0.0; 36];
        // Upwards from x: 0, 4, 6, 90, 180, 270, 354 and 356 degrees.
        let slope = |degrees: f64| {
            let radians = degrees.to_radians();
            [libm::cos(radians) as f32, libm::sin(radians) as f32]
        };
        let differences = [0.0, 4.0, 6.0, 90.0, 180.0, 270.0, 354.0, 356.0].map(slope);
        with_row(0, &differences, |window| {
            add_directions(window, &mut Gradients::default(), &mut histogram);
        });
        for (bin, sum) in histogram.iter().enumerate() {
            let expected = match bin {
                0 => 3.0,
                1 | 9 | 18 | 27 | 35 => 1.0,
                _ => 0.0,
            };
            assert!((sum - expected).abs() < 1e-5, "{sum} in bin {bin}");
        }
    }

    #[test]
    fn a_gradient_is_shared_by_eight_bins_and_none_is_lost() {
        // Cells 2 pixels wide, not turned: pixel 0 lies between the four middle cells.
        let grid = PatchGrid {
            cos: 0.5,
            sin: 0.0,
            direction: 0.25,
        };
        let mut histogram: PatchHistogram = [0.0; 1024];
        // To the right: a quarter turn before the first bin.
        with_row(0, &[[8.0, 0.0]], |window| {
            add_patch(window, &grid, &mut Gradients::default(), &mut histogram);
        });
        for cell in [
            2 * 64 + 2 * 8,
            2 * 64 + 3 * 8,
            3 * 64 + 2 * 8,
            3 * 64 + 3 * 8,
        ] {
            assert_eq!((histogram[cell + 6], histogram[cell + 7]), (2.0, 0.0));
        }
        assert_eq!(histogram.iter().sum::<f32>(), 8.0);
    }

    #[test]
    fn pixels_beyond_the_grid_add_nothing_and_blocks_equal_single_pixels() {
        let grid = PatchGrid {
            cos: 0.15,
            sin: 0.2,
            direction: 0.3,
        };
        let n = 45;
        let differences: Vec<[f32; 2]> = (0..n)
            .map(|i| [i as f32 - 20.0, 3.0 * (i % 7) as f32 - 8.0])
            .collect();
        let mut together: PatchHistogram = [0.0; 1024];
        with_row(-22, &differences, |window| {
            add_patch(window, &grid, &mut Gradients::default(), &mut together);
        });
        let mut single: PatchHistogram = [0.0; 1024];
        let mut gradients = Gradients::default();
        for (i, difference) in differences.iter().enumerate() {
            with_row(i as i32 - 22, &[*difference], |window| {
                add_patch(window, &grid, &mut gradients, &mut single);
            });
        }
        for i in 0..512 {
            let sums = [together, single].map(|h| h[i] + h[512 + i]);
            assert!((sums[0] - sums[1]).abs() < 1e-3);
        }
        // |0.15 x| < 2.5 and |0.2 x| < 2.5.
        let inside: f32 = (0..n)
            .filter(|&i| (i as f32 - 22.0).abs() < 12.5)
            .map(|i| differences[i][0].hypot(differences[i][1]))
            .sum();
        assert!((together.iter().sum::<f32>() - inside).abs() < 0.01);
    }
}
