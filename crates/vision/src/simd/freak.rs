//! Means over the receptive fields of FREAK, and comparisons of them.

use super::truncated;

/// Fields read at once; their number is a multiple of this.
const LANES: usize = 8;

/// Square fields relative to a keypoint, the same number in each of the three.
#[derive(Clone, Copy, Debug)]
pub struct Fields<'a> {
    /// Columns of their centres.
    pub x: &'a [f32],
    /// Rows of their centres.
    pub y: &'a [f32],
    /// Half their sides.
    pub radius: &'a [f32],
}

multiversioned! {
    /// The means over fields about `centre`, rounded half up, from an integral image whose rows
    /// have `stride` values.
    ///
    /// # Panics
    /// If there are not as many fields as means, not a multiple of 8, or a field lies outside the
    /// image.
    pub fn field_means(
        sums: &[u32],
        stride: usize,
        centre: [f32; 2],
        fields: Fields<'_>,
        means: &mut [u8],
    ) {
        let Fields { x, y, radius } = fields;
        let (x, y, radius) = (x.as_chunks::<LANES>(), y.as_chunks().0, radius.as_chunks().0);
        assert!(x.1.is_empty() && 8 * x.0.len() == means.len(), "a mean for each field");
        let fields = x.0.iter().zip(y).zip(radius);
        for (means, ((x, y), radius)) in means.as_chunks_mut::<LANES>().0.iter_mut().zip(fields) {
            let (x, y, radius): (&[f32; LANES], &[f32; LANES], &[f32; LANES]) = (x, y, radius);
            let mut upper = [0_u32; LANES];
            let mut lower = [0_u32; LANES];
            let mut width = [0_u32; LANES];
            let mut area = [0_u32; LANES];
            for i in 0..LANES {
                let (x, y) = (x[i] + centre[0], y[i] + centre[1]);
                let left = truncated(x - radius[i] + 0.5) as u32;
                let right = truncated(x + radius[i] + 1.5) as u32;
                let top = truncated(y - radius[i] + 0.5) as u32;
                let bottom = truncated(y + radius[i] + 1.5) as u32;
                upper[i] = top.wrapping_mul(stride as u32).wrapping_add(left);
                lower[i] = bottom.wrapping_mul(stride as u32).wrapping_add(left);
                width[i] = right.wrapping_sub(left);
                area[i] = width[i].wrapping_mul(bottom.wrapping_sub(top));
            }
            let mut total = [0_u32; LANES];
            for i in 0..LANES {
                let width = width[i] as usize;
                let (upper, lower) = (&sums[upper[i] as usize..], &sums[lower[i] as usize..]);
                let (above, below) = (upper[width].wrapping_sub(upper[0]), lower[width].wrapping_sub(lower[0]));
                total[i] = below.wrapping_sub(above);
            }
            for i in 0..LANES {
                // Both are exact below 2^24, in fields of up to 256 pixels; the quotient may have been rounded up. In
                // larger fields a mean can be one off.
                let total = (total[i] + area[i] / 2) as i32;
                let mean = truncated(total as f32 / area[i] as i32 as f32);
                let rounded_up = mean * area[i] as i32 > total;
                means[i] = (mean - i32::from(rounded_up)) as u8;
            }
        }
    }

    /// For each pair whether the first of its means is at least the second, from the lowest bit of
    /// the first word on.
    pub fn compare_means(means: &[u8; 64], pairs: &[[u8; 2]; 512]) -> [u64; 8] {
        let mut words = [0; 8];
        for (word, pairs) in words.iter_mut().zip(pairs.as_chunks::<64>().0) {
            for &[a, b] in pairs.iter().rev() {
                let at_least = means[usize::from(a % 64)] >= means[usize::from(b % 64)];
                *word = *word << 1 | u64::from(at_least);
            }
        }
        words
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::seed::Seed;

    #[test]
    fn means_follow_the_definition() {
        let mut rng = Seed(4).rng();
        let (width, height) = (60, 50);
        let pixels: Vec<u32> = (0..width * height).map(|_| rng.below(256)).collect();
        let stride = width + 1;
        let mut sums = vec![0; stride * (height + 1)];
        for y in 0..height {
            for x in 0..width {
                let row: u32 = pixels[y * width..][..=x].iter().sum();
                sums[(y + 1) * stride + x + 1] = sums[y * stride + x + 1] + row;
            }
        }
        let x: [f32; 8] = [0.0, 3.25, -10.7, 8.1, 0.4, -0.3, 12.0, -12.0];
        let y: [f32; 8] = [0.0, -9.25, 11.7, 4.1, -10.4, 7.3, 5.0, 1.0];
        let radius = [1.0, 2.5, 7.9, 0.9, 10.0, 3.3, 5.1, 2.0];
        let centre = [30.3, 25.8];
        let mut means = [0; 8];
        let fields = Fields {
            x: &x,
            y: &y,
            radius: &radius,
        };
        field_means(&sums, stride, centre, fields, &mut means);
        for i in 0..8 {
            let range = |v: f32| (v - radius[i] + 0.5) as usize..(v + radius[i] + 1.5) as usize;
            let (columns, rows) = (range(x[i] + centre[0]), range(y[i] + centre[1]));
            let area = (columns.len() * rows.len()) as u32;
            let total: u32 = rows
                .map(|y| pixels[y * width..][columns.clone()].iter().sum::<u32>())
                .sum();
            assert_eq!(u32::from(means[i]), (total + area / 2) / area, "{i}");
        }
    }

    #[test]
    fn bits_follow_the_definition() {
        let mut rng = Seed(5).rng();
        let means = std::array::from_fn(|_| rng.below(9) as u8);
        let pairs = std::array::from_fn(|_| [0, 1].map(|_| rng.below(64) as u8));
        let words = compare_means(&means, &pairs);
        for (k, pair) in pairs.iter().enumerate() {
            let [a, b] = pair.map(|i| means[usize::from(i)]);
            assert_eq!(words[k / 64] >> (k % 64) & 1, u64::from(a >= b), "{k}");
        }
    }
}
