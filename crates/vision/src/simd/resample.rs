//! Rows at twice and at half the resolution.

/// Columns that [`double_row`] makes pairs between at once.
const COLUMNS: usize = 128;

multiversioned! {
    #![avx512]

    /// Row between `near` (weight 3/4) and `far` (1/4) at twice the resolution: bilinear, pixel
    /// centres at half pixels, so that output `2 x` and `2 x + 1` lie a quarter pixel left and
    /// right of input `x`. Exact in f32.
    ///
    /// # Panics
    /// If the lengths do not fit.
    pub fn double_row(near: &[u8], far: &[u8], out: &mut [f32]) {
        const WEIGHT: f32 = 1.0 / 16.0;
        let n = near.len();
        assert!(far.len() == n && out.len() == 2 * n, "a row of twice the length");
        let column = |x: usize| 3 * u16::from(near[x]) + u16::from(far[x]);
        let (Some(first), Some(last)) = (out.first_mut(), n.checked_sub(1)) else {
            return;
        };
        *first = f32::from(4 * column(0)) * WEIGHT;
        // Sums of columns first, then pairs between them: two loops that become vectors.
        let mut sums = [0_u16; COLUMNS + 1];
        let mut x = 0;
        for pairs in out[1..2 * n - 1].chunks_mut(2 * COLUMNS) {
            let count = pairs.len() / 2;
            let (near, far) = (&near[x..=x + count], &far[x..=x + count]);
            for (sum, (&near, &far)) in sums.iter_mut().zip(near.iter().zip(far)) {
                *sum = 3 * u16::from(near) + u16::from(far);
            }
            for (pair, sums) in pairs.as_chunks_mut::<2>().0.iter_mut().zip(sums.windows(2)) {
                let (a, b) = (sums[0], sums[1]);
                *pair = [f32::from(3 * a + b) * WEIGHT, f32::from(a + 3 * b) * WEIGHT];
            }
            x += count;
        }
        out[2 * n - 1] = f32::from(4 * column(last)) * WEIGHT;
    }

    /// Every second pixel of `row`, from the first on.
    pub fn halve_row(row: &[f32], out: &mut [f32]) {
        for (out, pair) in out.iter_mut().zip(row.as_chunks::<2>().0) {
            *out = pair[0];
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn doubled_pixels_are_bilinear_and_clamped() {
        let mut out = [0.0; 6];
        double_row(&[0, 16, 32], &[16, 32, 48], &mut out);
        assert_eq!(out, [4.0, 8.0, 16.0, 24.0, 32.0, 36.0]);
        let mut out = [0.0; 2];
        double_row(&[7], &[7], &mut out);
        assert_eq!(out, [7.0, 7.0]);
        double_row(&[], &[], &mut []);
        // Rows longer than one block: a ramp stays a ramp.
        let ramp: Vec<u8> = (0..=255).collect();
        let mut out = [0.0; 512];
        double_row(&ramp, &ramp, &mut out);
        for (x, value) in out[1..511].iter().enumerate() {
            assert_eq!(*value, 0.25 + 0.5 * x as f32);
        }
    }

    #[test]
    fn an_odd_row_is_halved_to_its_floor() {
        let mut out = [0.0; 2];
        halve_row(&[1.0, 2.0, 3.0, 4.0, 5.0], &mut out);
        assert_eq!(out, [1.0, 3.0]);
    }
}
