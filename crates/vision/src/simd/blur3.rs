//! A symmetric 3 x 3 filter on 8-bit pixels, in fixed point.

multiversioned! {
    /// One row of the separable filter with weights `side`, `256 - 2 side` and `side` 256ths in
    /// both directions, rounded half up; beyond its ends the row is mirrored about its outermost
    /// pixels. `sums` is scratch space.
    ///
    /// # Panics
    /// If a row is shorter than `out`, `sums` is not 2 longer, or `side` is above 128.
    pub fn blur3_row(rows: [&[u8]; 3], side: u16, sums: &mut [u16], out: &mut [u8]) {
        let width = out.len();
        assert!(sums.len() == width + 2 && side <= 128, "one more sum at each end");
        if width == 0 {
            return;
        }
        let middle = 256 - 2 * side;
        let [above, here, below] = rows.map(|row| &row[..width]);
        let inner = &mut sums[1..=width];
        for x in 0..width {
            // At most 256 * 255.
            let sides = u16::from(above[x]) + u16::from(below[x]);
            inner[x] = side * sides + middle * u16::from(here[x]);
        }
        sums[0] = sums[if width > 1 { 2 } else { 1 }];
        sums[width + 1] = sums[if width > 1 { width - 1 } else { 1 }];
        let (side, middle) = (u32::from(side), u32::from(middle));
        let (left, centre, right) = (&sums[..width], &sums[1..=width], &sums[2..]);
        for x in 0..width {
            let sides = u32::from(left[x]) + u32::from(right[x]);
            out[x] = ((side * sides + middle * u32::from(centre[x]) + (1 << 15)) >> 16) as u8;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::seed::Seed;

    #[test]
    fn rows_follow_the_definition() {
        let mut rng = Seed(8).rng();
        let width = 75;
        let rows: [Vec<u8>; 3] =
            std::array::from_fn(|_| (0..width).map(|_| rng.below(256) as u8).collect());
        let mut out = vec![0; width];
        let views = rows.each_ref().map(|row| &row[..]);
        blur3_row(views, 82, &mut vec![0; width + 2], &mut out);
        for x in 0..width {
            let columns = [
                x.max(1) - if x > 0 { 1 } else { 0 },
                x,
                if x + 1 < width { x + 1 } else { x - 1 },
            ];
            let mut sum = 0;
            for (row, v) in rows.iter().zip([82, 92, 82]) {
                for (column, h) in columns.into_iter().zip([82, 92, 82]) {
                    sum += v * h * u32::from(row[column]);
                }
            }
            assert_eq!(u32::from(out[x]), (sum + 32768) / 65536, "{x}");
        }
    }
}
