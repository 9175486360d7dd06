//! Bilinear interpolation between 8-bit pixels, exact with weights of 8 bits.

/// Where a pixel of the output lies among those of the input.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Between {
    /// The input pixel before it.
    pub first: u32,
    /// Weight of the input pixel after it, in 256ths; that of `first` makes it 256.
    pub weight: u16,
}

multiversioned! {
    /// `between[x] = (256 - weight) first[x] + weight second[x]`, in 256ths.
    ///
    /// # Panics
    /// If the lengths differ or `weight` is above 256.
    pub fn blend_rows(first: &[u8], second: &[u8], weight: u16, between: &mut [u16]) {
        assert!(weight <= 256, "weights are in 256ths");
        let (first, second) = (&first[..between.len()], &second[..between.len()]);
        for (x, between) in between.iter_mut().enumerate() {
            *between = (256 - weight) * u16::from(first[x]) + weight * u16::from(second[x]);
        }
    }

    /// Pixels between those of a row in 256ths, rounded half up.
    ///
    /// # Panics
    /// If a position with its successor lies outside `row`.
    pub fn blend_columns(row: &[u16], positions: &[Between], out: &mut [u8]) {
        for (out, at) in out.iter_mut().zip(positions) {
            let pair = &row[at.first as usize..][..2];
            let weight = u32::from(at.weight);
            let sum = (256 - weight) * u32::from(pair[0]) + weight * u32::from(pair[1]);
            *out = ((sum + (1 << 15)) >> 16) as u8;
        }
    }
}
