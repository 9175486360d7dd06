//! Explicit nonlinear diffusion, one row at a time and in place.

/// The row below the one that is diffused.
#[derive(Clone, Copy, Debug)]
pub struct Below<'a> {
    /// Its pixels.
    pub values: &'a [f32],
    /// Their conductivities.
    pub conductivity: &'a [f32],
}

/// Columns that pass through the level-1 cache together.
const CHUNK: usize = 512;
/// Room for what flows between the pixels of a piece of a row.
pub type Flows = [f32; CHUNK + 1];
/// [`Flows`] of any content, to be used again and again.
pub const NO_FLOWS: Flows = [0.0; CHUNK + 1];

multiversioned! {
    #![avx512]
    /// One explicit step for one row, in place: what flows in over the four sides of each pixel,
    /// times `half_time`, is added to it. What flows between two pixels is their difference times
    /// the sum of their conductivities; nothing flows over the border.
    ///
    /// `upwards` holds what flows from this row into the one above (zero for the first row), and
    /// afterwards what flows from the row below into this one. What `leftwards` holds does not
    /// matter.
    ///
    /// # Panics
    /// If the lengths differ.
    pub fn diffuse_row(
        values: &mut [f32],
        conductivity: &[f32],
        below: Option<Below<'_>>,
        upwards: &mut [f32],
        half_time: f32,
        leftwards: &mut Flows,
    ) {
        let n = values.len();
        assert!(conductivity.len() == n && upwards.len() == n, "rows of one width");
        // Entry x is what flows from pixel `start + x` into the one to its left.
        leftwards[0] = 0.0;
        let mut start = 0;
        while start < n {
            let count = CHUNK.min(n - start);
            let inner = count.min(n - 1 - start);
            let (v, v_right) = (&values[start..][..inner], &values[start + 1..][..inner]);
            let (c, c_right) = (&conductivity[start..][..inner], &conductivity[start + 1..][..inner]);
            for (x, out) in leftwards[1..=inner].iter_mut().enumerate() {
                *out = (c[x] + c_right[x]) * (v_right[x] - v[x]);
            }
            leftwards[inner + 1..=count].fill(0.0);

            let values = &mut values[start..][..count];
            let upwards = &mut upwards[start..][..count];
            let (from_left, from_right) = (&leftwards[..count], &leftwards[1..=count]);
            if let Some(below) = below {
                let c = &conductivity[start..][..count];
                let (v_below, c_below) =
                    (&below.values[start..][..count], &below.conductivity[start..][..count]);
                for x in 0..count {
                    let from_below = (c[x] + c_below[x]) * (v_below[x] - values[x]);
                    let sum = from_right[x] - from_left[x] + from_below - upwards[x];
                    values[x] = sum.mul_add(half_time, values[x]);
                    upwards[x] = from_below;
                }
            } else {
                for x in 0..count {
                    let sum = from_right[x] - from_left[x] - upwards[x];
                    values[x] = sum.mul_add(half_time, values[x]);
                }
            }
            leftwards[0] = leftwards[count];
            start += count;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::seed::Seed;

    #[test]
    fn a_row_gains_what_flows_in_over_four_sides() {
        let mut leftwards = [f32::NAN; CHUNK + 1];
        for width in [1, 2, 7, 511, 512, 513, 1100] {
            let mut rng = Seed(width as u64).rng();
            let mut row = || -> Vec<f32> { (0..width).map(|_| rng.uniform() as f32).collect() };
            let (mut values, c, v_below, c_below, mut upwards) =
                (row(), row(), row(), row(), row());
            let (before, from_above) = (values.clone(), upwards.clone());
            let below = Below {
                values: &v_below,
                conductivity: &c_below,
            };
            diffuse_row(
                &mut values,
                &c,
                Some(below),
                &mut upwards,
                0.1,
                &mut leftwards,
            );
            let flow = |x: usize, right: usize| (c[x] + c[right]) * (before[right] - before[x]);
            for x in 0..width {
                let left = if x > 0 { flow(x - 1, x) } else { 0.0 };
                let right = if x + 1 < width { flow(x, x + 1) } else { 0.0 };
                let down = (c[x] + c_below[x]) * (v_below[x] - before[x]);
                let sum: f32 = right - left + down - from_above[x];
                assert_eq!(values[x], sum.mul_add(0.1, before[x]), "{x} of {width}");
                assert_eq!(upwards[x], down);
            }
        }
        diffuse_row(&mut [], &[], None, &mut [], 0.1, &mut leftwards);
    }
}
