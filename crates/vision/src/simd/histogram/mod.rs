//! Histograms of gradient directions, for SIFT: one over a disc for the orientation, and a grid of 4 x 4 of them for
//! the descriptor of a patch.
#![allow(clippy::needless_bitwise_bool)] // a lazy `&&` is a branch, and lanes have none

#[cfg(target_arch = "x86_64")]
mod avx2;
#[cfg(target_arch = "x86_64")]
mod avx512;
mod differences;
mod gradients;

#[cfg(target_arch = "x86_64")]
use super::InstructionSet;
use super::truncated;
use differences::Eight;
pub use gradients::{Gradients, Span, Window};
use gradients::{Measured, measure};

/// Sums of a patch: `[row][column][direction]` of a grid of 4 x 4 cells with 8 directions each.
pub type PatchSums = [f32; 128];

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

multiversioned! {
    #![avx512]

    /// Adds the gradient of each pixel to the nearest bin of a circular histogram, by magnitude times
    /// weight.
    ///
    /// # Panics
    /// If rows or weights do not reach one pixel beyond the spans.
    pub fn add_directions(window: &Window<'_>, gradients: &mut Gradients, histogram: &mut [f32; 36]) {
        measure(window, None, gradients);
        let mut bins = std::mem::take(&mut gradients.bins);
        let Measured { directions, values, .. } = gradients.measured();
        bins.clear();
        bins.extend(directions.as_flattened().iter().map(|direction| whole(direction * 36.0)));
        for (&bin, value) in bins.iter().zip(values.as_flattened()) {
            histogram[if bin < 36 { bin as usize } else { 0 }] += value;
        }
        gradients.bins = bins;
    }

    /// Adds the gradient of each pixel to the eight bins around it, by magnitude times weight and the
    /// distance to the bins' centres in row, column and direction; what falls beyond the grid is lost.
    ///
    /// # Panics
    /// If rows or weights do not reach one pixel beyond the spans.
    pub fn patch_sums(window: &Window<'_>, grid: &PatchGrid, gradients: &mut Gradients) -> PatchSums {
        measure(window, Some(grid), gradients);
        #[cfg(target_arch = "x86_64")]
        match InstructionSet::in_use_unless_halved() {
            // SAFETY: what is in use was detected on this processor.
            InstructionSet::Avx512 | InstructionSet::Amx => return unsafe { avx512::sums(grid.direction, gradients.measured()) },
            // SAFETY: as before.
            InstructionSet::Avx2 => return unsafe { avx2::sums(grid.direction, gradients.measured()) },
            InstructionSet::Portable => {}
        }
        let mut histogram = PatchHistogram([0.0; 1024]);
        let Measured { columns, lines, directions, values } = gradients.measured();
        for (((columns, lines), directions), values) in columns.iter().zip(lines).zip(directions).zip(values) {
            add_block(grid.direction, [columns, lines], values, directions, &mut histogram);
        }
        std::array::from_fn(|i| {
            let (row, column, bin) = (i / 32, i / 8 % 4, i % 8);
            let place = (row + 1) * 64 + (column + 1) * 8 + bin;
            histogram.0[place] + histogram.0[512 + place]
        })
    }

    /// Adds the weighted sums of a patch to others, each rounded once.
    pub fn add_weighted(patch: &PatchSums, weight: f32, to: &mut PatchSums) {
        for (sum, value) in to.iter_mut().zip(patch) {
            *sum = weight.mul_add(*value, *sum);
        }
    }

    /// The first and the last offset x where a row of pixels, each at an offset y from `top` on, can lie
    /// within the grid and half a cell around it: `|x cos + y sin| < 2.5` and `|y cos - x sin| < 2.5`, and
    /// one more to be safe of rounding.
    pub fn grid_columns(grid: &PatchGrid, top: i32, columns: &mut [[i32; 2]]) {
        const ROWS: usize = 16;
        const HALF: f32 = 2.5;
        for (columns, start) in columns.chunks_mut(ROWS).zip((top..).step_by(ROWS)) {
            let (mut first, mut last) = ([f32::MIN; ROWS], [f32::MAX; ROWS]);
            for (slope, along) in [(grid.cos, -grid.sin), (grid.sin, grid.cos)] {
                if slope.abs() > 1e-9 {
                    for i in 0..ROWS {
                        let middle = (start + i as i32) as f32 * along;
                        let (a, b) = ((middle - HALF) / slope, (middle + HALF) / slope);
                        first[i] = first[i].max(a.min(b));
                        last[i] = last[i].min(a.max(b));
                    }
                }
            }
            let mut whole = [[0; ROWS]; 2];
            for i in 0..ROWS {
                // Within any image, so that sums of offsets do not overflow.
                whole[0][i] = floor(first[i].max(-1e6));
                whole[1][i] = -floor(-last[i].min(1e6));
            }
            for (i, columns) in columns.iter_mut().enumerate() {
                *columns = [whole[0][i], whole[1][i]];
            }
        }
    }
}

/// The largest whole number that is not above `value`; `f32::floor` is a call where processors may lack
/// the instruction.
#[inline(always)]
fn floor(value: f32) -> i32 {
    let whole = truncated(value);
    whole - i32::from(whole as f32 > value)
}

/// Bins of the grid and of a border about it, as two histograms whose sum counts: `[half][row][column][direction]`
/// with 2 x 8 x 8 x 8 places, of which 4 x 4 cells and their border use 6 x 6 x 8 of each. Aligned, since a
/// sum waits for the one before it, and longer where its eight directions lie in two cache lines.
#[repr(align(64))]
struct PatchHistogram([f32; 1024]);

/// Centres of the cells are at 0, 1, 2, 3; the middle of the patch lies between 1 and 2.
const MIDDLE: f32 = 1.5;

#[inline(always)]
fn add_block(
    first_direction: f32,
    [columns, lines]: [&Eight; 2],
    values: &Eight,
    directions: &Eight,
    histogram: &mut PatchHistogram,
) {
    const L: usize = 8;
    let mut cells = [0_u32; L];
    let mut bins = [0_u32; L];
    let mut nexts = [0.0_f32; L];
    let mut corners = [[0.0_f32; L]; 4];
    for i in 0..L {
        let (column, line) = (columns[i], lines[i]);
        let inside = (line > -1.0) & (line < 4.0) & (column > -1.0) & (column < 4.0);
        let value = if inside { values[i] } else { 0.0 };
        let column = if inside { column } else { 0.0 };
        let line = if inside { line } else { 0.0 };
        let bin = (directions[i] - first_direction) * 8.0;
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
            *share = nexts[i].mul_add(UNITS[next].0[b], (1.0 - nexts[i]) * UNITS[bin].0[b]);
        }
        // Neighbouring pixels mostly fall into the same cells; two histograms by turns, and none
        // waits for the sum before.
        let around = &mut histogram.0[(i & 1) * 512 + cells[i] as usize..][..80];
        for (corner, offset) in corners.iter().zip([0, 8, 64, 72]) {
            for (sum, share) in around[offset..offset + 8].iter_mut().zip(&shares) {
                *sum = corner[i].mul_add(*share, *sum);
            }
        }
    }
}

/// Row `i` is 0 but for a 1 at place `i`.
static UNITS: [Unit; 8] = units();

/// A whole vector, so that none lies in two cache lines.
#[derive(Clone, Copy)]
#[repr(align(32))]
struct Unit(Eight);

const fn units() -> [Unit; 8] {
    let mut units = [Unit([0.0; 8]); 8];
    let mut i = 0;
    while i < units.len() {
        units[i].0[i] = 1.0;
        i += 1;
    }
    units
}

/// A sum with this leaves no place for a fraction, and the integer in the lowest bits.
const NO_FRACTION: f32 = 1.5 * (1 << 23) as f32;

/// The integer nearest to `x` (even if there are two) modulo 2^22, for `|x|` below 2^21. Unlike
/// a cast it needs no care for other values.
#[inline(always)]
fn whole(x: f32) -> u32 {
    (x + NO_FRACTION).to_bits() & 0x003f_ffff
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
            // Rows and columns of cells, and what is about them, are met from all sides.
            for (cos, sin) in [(0.11, -0.07), (-0.07, 0.13), (0.02, 0.16), (-0.12, -0.1)] {
                let grid = PatchGrid {
                    cos,
                    sin,
                    direction: 0.8,
                };
                let mut all: Vec<(PatchSums, [f32; 36])> = Vec::new();
                with_row(-20, &differences, |window| {
                    InstructionSet::for_each(|_| {
                        let gradients = &mut Gradients::default();
                        let patch = patch_sums(window, &grid, gradients);
                        let mut directions = [0.0; 36];
                        // Twice, so that there are sums to be added to.
                        for _ in 0..2 {
                            add_directions(window, gradients, &mut directions);
                        }
                        all.push((patch, directions));
                    });
                });
                assert!(count < 24 || all[0].0.iter().any(|&sum| sum > 0.0));
                assert!(all.iter().all(|sums| *sums == all[0]), "{count} pixels");
            }
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
        // To the right: a quarter turn before the first bin.
        with_row(0, &[[8.0, 0.0]], |window| {
            let sums = patch_sums(window, &grid, &mut Gradients::default());
            for cell in [5, 6, 9, 10] {
                assert_eq!(sums[8 * cell..][6..8], [2.0, 0.0]);
            }
            assert_eq!(sums.iter().sum::<f32>(), 8.0);
        });
    }

    #[test]
    fn rows_that_end_within_a_block_lose_no_pixel() {
        let grid = PatchGrid {
            cos: 0.1,
            sin: 0.06,
            direction: 0.3,
        };
        let row: Vec<f32> = (0..40).map(|x| ((x * x) % 17) as f32).collect();
        for count in 1..20 {
            let spans = [Span { first: -9, count }; 8];
            let sums = |beyond: usize| {
                let rows = [&row[..count + 2 + beyond]; 10];
                let window = Window {
                    rows: &rows,
                    left: -10,
                    top: -4,
                    spans: &spans,
                    weights: &[1.0; 40],
                    radius: 12,
                };
                patch_sums(&window, &grid, &mut Gradients::default())
            };
            let (ending, longer) = (sums(0), sums(8));
            let difference = |i: usize| (ending[i] - longer[i]).abs();
            assert!((0..128).all(|i| difference(i) < 1e-3), "{count} pixels");
        }
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
        let offset = |i: usize| i as i32 - 22;
        let gradients = &mut Gradients::default();
        let mut together: PatchSums = [0.0; 128];
        with_row(offset(0), &differences, |window| {
            together = patch_sums(window, &grid, gradients);
        });
        let mut single: PatchSums = [0.0; 128];
        for (i, difference) in differences.iter().enumerate() {
            with_row(offset(i), &[*difference], |window| {
                let sums = patch_sums(window, &grid, gradients);
                for (sum, more) in single.iter_mut().zip(sums) {
                    *sum += more;
                }
            });
        }
        for (a, b) in together.iter().zip(single) {
            assert!((a - b).abs() < 1e-3);
        }
        // Of a pixel less than a cell outside of the outermost centres a part is kept.
        let kept = |v: f32| (v + 2.5).min(2.5 - v).clamp(0.0, 1.0);
        let inside: f32 = (0..n)
            .map(|i| {
                let x = offset(i) as f32;
                let share = kept(0.15 * x) * kept(-0.2 * x);
                share * differences[i][0].hypot(differences[i][1])
            })
            .sum();
        assert!((together.iter().sum::<f32>() - inside).abs() < 0.01);
    }

    #[test]
    fn no_pixel_of_the_grid_is_left_out() {
        for degrees in [0.0, 30.0, 90.0, 200.0_f32] {
            let (sin, cos) = libm::sincosf(degrees.to_radians());
            let grid = PatchGrid {
                cos: cos / 4.7,
                sin: sin / 4.7,
                direction: 0.0,
            };
            let mut columns = [[0; 2]; 43];
            grid_columns(&grid, -21, &mut columns);
            for ([first, last], y) in columns.into_iter().zip(-21..) {
                let (mut inside, y) = (0, y as f32);
                for x in -50..50 {
                    let along = (x as f32 * grid.cos + y * grid.sin).abs();
                    let across = (y * grid.cos - x as f32 * grid.sin).abs();
                    if along.max(across) < 2.5 {
                        inside += 1;
                        assert!((first..=last).contains(&x), "{degrees}: {x}, {y}");
                    }
                }
                assert!(inside == 0 || last - first < inside + 4, "{degrees}: {y}");
            }
        }
    }
}
