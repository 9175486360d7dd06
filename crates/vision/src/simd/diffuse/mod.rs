//! Explicit nonlinear diffusion, one row at a time and in place.
//!
//! What flows from a pixel into the one to its left is kept for the next pixel, so that each flow is computed once and
//! none goes through memory: the compiler keeps vectors of flows, and puts those from the left together from two of
//! them.

#[cfg(target_arch = "x86_64")]
use super::InstructionSet;

#[cfg(target_arch = "x86_64")]
mod avx2;

/// The row below the one that is diffused.
#[derive(Clone, Copy, Debug)]
pub struct Below<'a> {
    /// Its pixels.
    pub values: &'a [f32],
    /// Their conductivities.
    pub conductivity: &'a [f32],
}

/// One explicit step for one row, in place: what flows in over the four sides of each pixel,
/// times `half_time`, is added to it. What flows between two pixels is their difference times
/// the sum of their conductivities; nothing flows over the border.
///
/// `upwards` holds what flows from this row into the one above (zero for the first row), and
/// afterwards what flows from the row below into this one.
///
/// # Panics
/// If the lengths differ.
pub fn diffuse_row(
    values: &mut [f32],
    conductivity: &[f32],
    below: Option<Below<'_>>,
    upwards: &mut [f32],
    half_time: f32,
) {
    #[cfg(target_arch = "x86_64")]
    if let Some(below) = below
        && InstructionSet::in_use() == InstructionSet::Avx2
    {
        // SAFETY: what is in use was detected on this processor.
        let (x, from_left) =
            unsafe { avx2::diffuse_columns(values, conductivity, below, upwards, half_time) };
        let below = Below {
            values: &below.values[x..],
            conductivity: &below.conductivity[x..],
        };
        let (values, upwards) = (&mut values[x..], &mut upwards[x..]);
        let conductivity = &conductivity[x..];
        return diffuse_rest(
            values,
            conductivity,
            Some(below),
            upwards,
            half_time,
            from_left,
        );
    }
    diffuse_rest(values, conductivity, below, upwards, half_time, 0.0);
}

multiversioned! {
    #![avx512]

    /// The definition of [`diffuse_row`], for a row or the rest of one. What flows from its first pixel into the one
    /// to the left of it is given.
    fn diffuse_rest(
        values: &mut [f32],
        conductivity: &[f32],
        below: Option<Below<'_>>,
        upwards: &mut [f32],
        half_time: f32,
        from_left: f32,
    ) -> () {
        let n = values.len();
        assert!(conductivity.len() == n && upwards.len() == n, "rows of one width");
        let Some(last) = n.checked_sub(1) else {
            return;
        };
        let c = conductivity;
        let mut from_left = from_left;
        if let Some(below) = below {
            let (v_below, c_below) = (&below.values[..n], &below.conductivity[..n]);
            for x in 0..last {
                let from_right = (c[x] + c[x + 1]) * (values[x + 1] - values[x]);
                let from_below = (c[x] + c_below[x]) * (v_below[x] - values[x]);
                let sum = from_right - from_left + from_below - upwards[x];
                values[x] = sum.mul_add(half_time, values[x]);
                upwards[x] = from_below;
                from_left = from_right;
            }
            let from_below = (c[last] + c_below[last]) * (v_below[last] - values[last]);
            let sum = 0.0 - from_left + from_below - upwards[last];
            values[last] = sum.mul_add(half_time, values[last]);
            upwards[last] = from_below;
        } else {
            for x in 0..last {
                let from_right = (c[x] + c[x + 1]) * (values[x + 1] - values[x]);
                let sum = from_right - from_left - upwards[x];
                values[x] = sum.mul_add(half_time, values[x]);
                from_left = from_right;
            }
            let sum = 0.0 - from_left - upwards[last];
            values[last] = sum.mul_add(half_time, values[last]);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::seed::Seed;
    use crate::simd::InstructionSet;

    #[test]
    fn all_sets_of_instructions_give_the_same_bits() {
        for width in [1, 2, 8, 9, 16, 17, 33, 100] {
            let mut rng = Seed(width as u64).rng();
            let mut row = || -> Vec<f32> { (0..width).map(|_| rng.uniform() as f32).collect() };
            let [values, c, v_below, c_below, upwards] = [row(), row(), row(), row(), row()];
            let mut all = Vec::new();
            InstructionSet::for_each(|_| {
                let (mut values, mut upwards) = (values.clone(), upwards.clone());
                for values_below in [Some(&v_below), None] {
                    let below = values_below.map(|values| Below {
                        values,
                        conductivity: &c_below,
                    });
                    diffuse_row(&mut values, &c, below, &mut upwards, 0.2);
                }
                all.push((values, upwards));
            });
            assert!(all.iter().all(|rows| *rows == all[0]), "{width}");
        }
    }

    #[test]
    fn a_row_gains_what_flows_in_over_four_sides() {
        for width in [1, 2, 7, 15, 16, 17, 1100] {
            let mut rng = Seed(width as u64).rng();
            let mut row = || -> Vec<f32> { (0..width).map(|_| rng.uniform() as f32).collect() };
            let (mut values, c, v_below, c_below, mut upwards) =
                (row(), row(), row(), row(), row());
            let (before, from_above) = (values.clone(), upwards.clone());
            let below = Below {
                values: &v_below,
                conductivity: &c_below,
            };
            diffuse_row(&mut values, &c, Some(below), &mut upwards, 0.1);
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
        diffuse_row(&mut [], &[], None, &mut [], 0.1);
    }
}
