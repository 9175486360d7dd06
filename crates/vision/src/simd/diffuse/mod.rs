//! Explicit nonlinear diffusion, in place, one or two rows at a time.
//!
//! What flows from a pixel into the one to its left is kept for the next pixel, so that each flow is computed once and
//! none goes through memory: the compiler keeps vectors of flows, and puts those from the left together from two of
//! them. Two rows at once, with vectors of 64 bytes, keep the flows between them too.

#[cfg(target_arch = "x86_64")]
use super::InstructionSet;

#[cfg(target_arch = "x86_64")]
mod avx2;
#[cfg(target_arch = "x86_64")]
mod avx512;

/// The row below those that are diffused.
#[derive(Clone, Copy, Debug)]
pub struct Below<'a> {
    /// Its pixels.
    pub values: &'a [f32],
    /// Their conductivities.
    pub conductivity: &'a [f32],
}

impl Below<'_> {
    /// Its columns from `x` to `end`.
    #[cfg(target_arch = "x86_64")]
    fn from(&self, x: usize, end: usize) -> Self {
        Self {
            values: &self.values[x..end],
            conductivity: &self.conductivity[x..end],
        }
    }
}

/// Two rows of one width, the row below them, and what flows from the first into the row above it.
#[cfg(target_arch = "x86_64")]
struct TwoRows<'a> {
    values: [&'a mut [f32]; 2],
    conductivity: [&'a [f32]; 2],
    below: Below<'a>,
    upwards: &'a mut [f32],
}

/// Most rows that are diffused faster together than one by one.
pub const DIFFUSED_AT_ONCE: usize = 2;

/// One explicit step for one row, or for rows that lie one after the other, in place: what flows in over the four sides
/// of each pixel, times `half_time`, is added to it. What flows between two pixels is their difference times
/// the sum of their conductivities; nothing flows over the border.
///
/// `upwards`, which has the width of a row, holds what flows from the first of these rows into the one above (zero for
/// the first row of the image), and afterwards what flows from the row below into the last of them.
///
/// # Panics
/// If the lengths differ.
pub fn diffuse_rows(
    values: &mut [f32],
    conductivity: &[f32],
    below: Option<Below<'_>>,
    upwards: &mut [f32],
    half_time: f32,
) {
    assert_eq!(values.len(), conductivity.len(), "rows of one size");
    let width = upwards.len();
    if width == 0 {
        return;
    }
    assert!(values.len().is_multiple_of(width), "whole rows");
    #[cfg(target_arch = "x86_64")]
    if let Some(below) = below
        && values.len() == 2 * width
        && InstructionSet::in_use() >= InstructionSet::Avx512
    {
        let (first, second) = values.split_at_mut(width);
        let (conductivity_first, conductivity_second) = conductivity.split_at(width);
        let rows = TwoRows {
            values: [first, second],
            conductivity: [conductivity_first, conductivity_second],
            below: below.from(0, width),
            upwards,
        };
        // SAFETY: what is in use was detected on this processor.
        return unsafe { avx512::diffuse_two_rows(rows, half_time) };
    }
    let (mut rest, mut conductivity) = (values, conductivity);
    while !rest.is_empty() {
        let (row, others) = rest.split_at_mut(width);
        let (of_row, conductivities) = conductivity.split_at(width);
        let next = Below {
            values: others,
            conductivity: conductivities,
        };
        let below = if others.is_empty() { below } else { Some(next) };
        diffuse_row(row, of_row, below, upwards, half_time);
        (rest, conductivity) = (others, conductivities);
    }
}

/// [`diffuse_rows`] for one row.
fn diffuse_row(
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
        let width = values.len();
        // SAFETY: what is in use was detected on this processor.
        let (x, from_left) =
            unsafe { avx2::diffuse_columns(values, conductivity, below, upwards, half_time) };
        return diffuse_rest(
            &mut values[x..],
            &conductivity[x..],
            Some(below.from(x, width)),
            &mut upwards[x..],
            half_time,
            from_left,
        );
    }
    diffuse_rest(values, conductivity, below, upwards, half_time, 0.0);
}

multiversioned! {
    /// The definition of [`diffuse_rows`], for one row or the rest of one. What flows from its first pixel into the one
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
        for width in [1, 2, 8, 9, 16, 17, 31, 32, 33, 48, 49, 100] {
            let mut rng = Seed(width as u64).rng();
            let mut rows = |count: usize| -> Vec<f32> {
                (0..count * width).map(|_| rng.uniform() as f32).collect()
            };
            for count in [1, 2, 3] {
                let [values, c] = [rows(count), rows(count)];
                let [v_below, c_below, upwards] = [rows(1), rows(1), rows(1)];
                let mut all = Vec::new();
                InstructionSet::for_each(|_| {
                    let (mut values, mut upwards) = (values.clone(), upwards.clone());
                    for values_below in [Some(&v_below), None] {
                        let below = values_below.map(|values| Below {
                            values,
                            conductivity: &c_below,
                        });
                        diffuse_rows(&mut values, &c, below, &mut upwards, 0.2);
                    }
                    all.push((values, upwards));
                });
                assert!(all.iter().all(|rows| *rows == all[0]), "{count} of {width}");
            }
        }
    }

    #[test]
    fn a_row_gains_what_flows_in_over_four_sides() {
        for width in [1, 2, 7, 15, 16, 17, 1100] {
            let mut rng = Seed(width as u64).rng();
            let mut rows = |count: usize| -> Vec<f32> {
                (0..count * width).map(|_| rng.uniform() as f32).collect()
            };
            // The row above, two rows, and the one below.
            let (before, c) = (rows(4), rows(4));
            let flow = |from: usize, to: usize| (c[to] + c[from]) * (before[from] - before[to]);
            let mut values = before[width..3 * width].to_vec();
            let mut upwards: Vec<f32> = (0..width).map(|x| flow(width + x, x)).collect();
            let below = Below {
                values: &before[3 * width..],
                conductivity: &c[3 * width..],
            };
            let two = &c[width..3 * width];
            diffuse_rows(&mut values, two, Some(below), &mut upwards, 0.1);
            for (i, value) in values.iter().enumerate() {
                let (x, at) = (i % width, width + i);
                let left = if x > 0 { flow(at, at - 1) } else { 0.0 };
                let right = if x + 1 < width { flow(at + 1, at) } else { 0.0 };
                let sum = right - left + flow(at + width, at) - flow(at, at - width);
                let expected = sum.mul_add(0.1, before[at]);
                assert_eq!(*value, expected, "{i} of two rows of {width}");
            }
            let last = |x: usize| flow(3 * width + x, 2 * width + x);
            assert!((0..width).all(|x| upwards[x] == last(x)));
        }
        diffuse_rows(&mut [], &[], None, &mut [], 0.1);
    }
}
