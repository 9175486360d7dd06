//! Sums over areas of 8-bit images.

/// The input pixels that one output pixel covers.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Cover {
    /// The first of them.
    pub first: u32,
    /// Their shares of the area, of sum 1; at most four, the rest 0.
    pub shares: [f32; 4],
}

multiversioned! {
    /// `out[x]` is the sum of `shares[i] * rows[i][x]`.
    ///
    /// # Panics
    /// If a row is shorter than `out`.
    pub fn cover_rows(rows: [&[u8]; 4], shares: [f32; 4], out: &mut [f32]) {
        let n = out.len();
        let [a, b, c, d] = [&rows[0][..n], &rows[1][..n], &rows[2][..n], &rows[3][..n]];
        for x in 0..n {
            let sum = shares[0] * f32::from(a[x]) + shares[1] * f32::from(b[x]);
            out[x] = sum + shares[2] * f32::from(c[x]) + shares[3] * f32::from(d[x]);
        }
    }

    /// Each pixel of `out` from those of `row` that it covers, rounded to the nearest integer,
    /// half to even. A share of 0 still reads its pixel.
    ///
    /// # Panics
    /// If a covered pixel lies beyond the end of `row`.
    pub fn cover_columns(row: &[f32], covers: &[Cover], out: &mut [u8]) {
        /// Adding this leaves the rounded integer in the lowest bits of the mantissa.
        const ROUND: f32 = 1.5 * (1 << 23) as f32;
        for (out, cover) in out.iter_mut().zip(covers) {
            let [a, b, c, d] = *row[cover.first as usize..]
                .first_chunk::<4>()
                .expect("four pixels from the first one on");
            let shares = &cover.shares;
            let sum = shares[0] * a + shares[1] * b + shares[2] * c + shares[3] * d;
            *out = (sum + ROUND).to_bits() as u8;
        }
    }

    /// Means of two by two pixels of two rows, rounded half up.
    pub fn halve_rows_u8(first: &[u8], second: &[u8], out: &mut [u8]) {
        let pairs = first.as_chunks::<2>().0.iter().zip(second.as_chunks::<2>().0);
        for (out, (a, b)) in out.iter_mut().zip(pairs) {
            let sum = u16::from(a[0]) + u16::from(a[1]) + u16::from(b[0]) + u16::from(b[1]);
            *out = ((sum + 2) / 4) as u8;
        }
    }

    /// The next row of an integral image: `sums[x + 1] = above[x + 1] + row[0] + ... + row[x]`,
    /// and `sums[0] = 0`, modulo 2^32.
    ///
    /// # Panics
    /// If the sums are not one longer than the row.
    pub fn integrate_row(row: &[u8], above: &[u32], sums: &mut [u32]) {
        let n = row.len();
        assert!(above.len() == n + 1 && sums.len() == n + 1, "one sum more than pixels");
        sums[0] = 0;
        let (above, sums) = (&above[1..], &mut sums[1..]);
        let mut total = 0_u32;
        for x in 0..n {
            total = total.wrapping_add(u32::from(row[x]));
            sums[x] = above[x].wrapping_add(total);
        }
    }
}
