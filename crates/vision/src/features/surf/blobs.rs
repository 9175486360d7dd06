//! Steps 1 to 3 of SURF: maxima of the approximated determinant of the Hessian (section 3).
//!
//! The second derivatives are sums over boxes of an integral image. Rows of filters are made from top to
//! bottom, and only the last rows of each layer are kept.

use std::borrow::Cow;

use super::SurfParams;
use crate::features::peak::offset;
use crate::image::{IntegralImage, RowBuffer, Size};
use crate::simd::{BoxRows, BoxWeights, box_determinants, find_extrema};

/// Side of the smallest filter, and by how much sides grow, in steps of the octave.
const FIRST_SIDE: usize = 9;
const GROWTH: usize = 6;

/// A place where the image is a blob.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Blob {
    pub(super) at: [f32; 2],
    /// Side of the filter that responds most, a whole number.
    pub(super) size: f32,
    pub(super) response: f32,
    pub(super) octave: i16,
}

/// All blobs, octave after octave, row after row.
pub(super) fn find_blobs(integral: &IntegralImage, size: Size, params: &SurfParams) -> Vec<Blob> {
    let mut blobs = Vec::new();
    for octave in 0..params.octaves {
        let sums = Sums::new(integral, size, 1 << octave);
        find_in_octave(&sums, octave, params, &mut blobs);
    }
    blobs
}

/// Rows of filters are made from top to bottom; only the last of each layer are kept.
fn find_in_octave(sums: &Sums<'_>, octave: usize, params: &SurfParams, blobs: &mut Vec<Blob>) {
    let size = Size::new(sums.size.width / sums.step, sums.size.height / sums.step);
    let mut layers: Vec<(Filter, RowBuffer)> = (0..params.layers + 2)
        .map(|layer| (Filter::new(layer, sums.step), RowBuffer::new(size, 3)))
        .collect();
    let mut columns = Vec::new();
    for made in 1..=size.height {
        for (filter, rows) in &mut layers {
            for row in rows.append(1) {
                filter.run(sums, made - 1, row);
            }
        }
        for three in layers.windows(3) {
            // Rows and columns that have neighbours in the layer above.
            let margin = three[2].0.margin + 1;
            let Some(y) = made.checked_sub(2) else {
                continue;
            };
            if y < margin || y >= size.height.saturating_sub(margin) || size.width <= 2 * margin {
                continue;
            }
            let rows = [0, 1, 2].map(|l| [y - 1, y, y + 1].map(|y| three[l].1.row(y)));
            columns.clear();
            find_extrema(
                &rows,
                margin..size.width - margin,
                params.threshold,
                &mut columns,
            );
            for x in columns.iter().map(|&x| x as usize) {
                let response = rows[1][1][x];
                let around = rows.iter().flatten().flat_map(|row| &row[x - 1..=x + 1]);
                // The strict maximum, unlike the extrema.
                if response <= 0.0 || around.filter(|&&value| value >= response).count() > 1 {
                    continue;
                }
                let Some([dx, dy, dl]) = offset(&rows, x) else {
                    continue;
                };
                let filter = &three[1].0;
                let step = sums.step as f32;
                let growth = (GROWTH * sums.step) as f32;
                blobs.push(Blob {
                    at: [filter.centre(x) + dx * step, filter.centre(y) + dy * step],
                    size: (filter.side as f32 + dl * growth).round_ties_even(),
                    response,
                    octave: octave as i16,
                });
            }
        }
    }
}

/// An integral image whose columns are sorted by their remainder modulo the step, so that the
/// values for a row of filters lie side by side.
struct Sums<'a> {
    size: Size,
    step: usize,
    /// Values of one remainder in a row.
    each: usize,
    values: Cow<'a, [u32]>,
}

impl<'a> Sums<'a> {
    fn new(integral: &'a IntegralImage, size: Size, step: usize) -> Self {
        let each = (size.width + 1).div_ceil(step);
        let sums = if step == 1 {
            Cow::Borrowed(integral.sums())
        } else {
            let mut sums = vec![0; (size.height + 1) * each * step];
            for (y, sorted) in sums.chunks_exact_mut(each * step).enumerate() {
                let row = integral.row(y);
                for (remainder, sorted) in sorted.chunks_exact_mut(each).enumerate() {
                    let values = row.iter().skip(remainder).step_by(step);
                    for (sorted, &value) in sorted.iter_mut().zip(values) {
                        *sorted = value;
                    }
                }
            }
            Cow::Owned(sums)
        };
        Self {
            size,
            step,
            each,
            values: sums,
        }
    }

    /// The values in row `y`, columns `x`, `x + step`, ...
    fn from(&self, x: usize, y: usize) -> &[u32] {
        let start = (y * self.step + x % self.step) * self.each;
        &self.values[start..][x / self.step..self.each]
    }
}

/// The three second derivatives at one size.
struct Filter {
    /// In pixels.
    side: usize,
    step: usize,
    /// Filters that would begin outside the image, at each end of a row or column.
    margin: usize,
    /// Where the boxes of each derivative begin and end along the derivative and across it; the
    /// mixed one has the same places along both.
    along: [usize; 4],
    across: [usize; 2],
    mixed: [usize; 4],
    weights: BoxWeights,
}

impl Filter {
    fn new(layer: usize, step: usize) -> Self {
        let side_in_steps = FIRST_SIDE + GROWTH * layer;
        let side = side_in_steps * step;
        // As in the smallest filter (figure 2), enlarged and rounded to pixels.
        let scale = side as f32 / FIRST_SIDE as f32;
        let place = |v: usize| (scale * v as f32).round_ties_even() as usize;
        let along = [0, 3, 6, 9].map(place);
        let across = [2, 7].map(place);
        let mixed = [1, 4, 5, 8].map(place);
        let weight = |value: f32, width: usize, height: usize| value / (width * height) as f32;
        let lengths = [0, 1, 2].map(|i| along[i + 1] - along[i]);
        let breadth = across[1] - across[0];
        let three = [(1.0, 0), (-2.0, 1), (1.0, 2)].map(|(v, i)| weight(v, lengths[i], breadth));
        let sides = [mixed[1] - mixed[0], mixed[3] - mixed[2]];
        Self {
            side,
            step,
            margin: side_in_steps / 2,
            along,
            across,
            mixed,
            weights: BoxWeights {
                xx: three,
                yy: three,
                xy: [
                    weight(1.0, sides[0], sides[0]),
                    weight(-1.0, sides[1], sides[0]),
                    weight(-1.0, sides[0], sides[1]),
                    weight(1.0, sides[1], sides[1]),
                ],
            },
        }
    }

    /// Where the centre of filter `index` lies, in pixels.
    fn centre(&self, index: usize) -> f32 {
        let start = self.step as f32 * (index as f32 - self.margin as f32);
        start + (self.side - 1) as f32 * 0.5
    }

    /// The determinants in row `y`, where the filter lies within the image.
    fn run(&self, sums: &Sums<'_>, y: usize, row: &mut [f32]) {
        let Some(top) = y.checked_sub(self.margin).map(|y| y * self.step) else {
            return;
        };
        if top + self.side > sums.size.height || self.side > sums.size.width {
            return;
        }
        let count = (sums.size.width - self.side) / self.step + 1;
        let rows = BoxRows {
            xx: self
                .across
                .map(|dy| self.along.map(|dx| sums.from(dx, top + dy))),
            yy: self
                .across
                .map(|dx| self.along.map(|dy| sums.from(dx, top + dy))),
            xy: self
                .mixed
                .map(|dy| self.mixed.map(|dx| sums.from(dx, top + dy))),
        };
        box_determinants(&rows, &self.weights, &mut row[self.margin..][..count]);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::image::GrayImage;
    use crate::seed::Seed;

    #[test]
    fn filters_are_sums_over_boxes() {
        let mut rng = Seed(7).rng();
        let size = Size::new(61, 47);
        let image = GrayImage::from_fn(size, |_, _| rng.below(256) as u8);
        let integral = IntegralImage::new(&image);
        for (layer, step) in [(0, 1), (1, 1), (2, 2), (0, 4)] {
            let sums = Sums::new(&integral, size, step);
            let filter = Filter::new(layer, step);
            let mut row = vec![0.0; size.width / step];
            let y = filter.margin + 1;
            filter.run(&sums, y, &mut row);
            let filters = (size.width - filter.side) / step + 1;
            for (i, &found) in row[filter.margin..][..filters].iter().enumerate() {
                // Means over boxes from (x0, y0) to (x1, y1) of the smallest filter.
                let mean = |[x0, y0, x1, y1]: [usize; 4]| {
                    let place =
                        |v: usize| (filter.side as f64 * v as f64 / 9.0).round_ties_even() as usize;
                    let (columns, rows) = (place(x0)..place(x1), place(y0)..place(y1));
                    let count = (columns.len() * rows.len()) as f64;
                    let mut sum = 0.0;
                    for y in rows {
                        for x in columns.clone() {
                            sum += f64::from(image.at(x + i * step, y + step));
                        }
                    }
                    sum / count
                };
                let xx = mean([0, 2, 3, 7]) - 2.0 * mean([3, 2, 6, 7]) + mean([6, 2, 9, 7]);
                let yy = mean([2, 0, 7, 3]) - 2.0 * mean([2, 3, 7, 6]) + mean([2, 6, 7, 9]);
                let xy = mean([1, 1, 4, 4]) + mean([5, 5, 8, 8])
                    - mean([5, 1, 8, 4])
                    - mean([1, 5, 4, 8]);
                let expected = xx * yy - 0.81 * xy * xy;
                let error = (f64::from(found) - expected).abs();
                assert!(
                    error < 1e-3 * (1.0 + expected.abs()),
                    "{found}, not {expected}"
                );
            }
        }
    }

    #[test]
    fn a_blob_is_found_where_it_is_at_its_scale() {
        for deviation in [3.0, 6.0] {
            let image = GrayImage::from_fn(Size::new(160, 150), |x, y| {
                let (x, y) = (x as f64 - 80.3, y as f64 - 70.8);
                let squared = (x * x + y * y) / (deviation * deviation);
                (20.0 + 200.0 * libm::exp(-0.5 * squared)) as u8
            });
            let integral = IntegralImage::new(&image);
            let blobs = find_blobs(&integral, image.size(), &SurfParams::default());
            let strongest = blobs
                .iter()
                .max_by(|a, b| a.response.total_cmp(&b.response))
                .expect("a blob is found");
            let [x, y] = strongest.at;
            assert!(
                (x - 80.3).abs() < 0.5 && (y - 70.8).abs() < 0.5,
                "{strongest:?}"
            );
            let scale = f64::from(strongest.size * super::super::SCALE);
            assert!((scale / deviation - 1.0).abs() < 0.3, "{strongest:?}");
        }
    }
}
