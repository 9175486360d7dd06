//! Essential matrices of five matches, for eight samples at once.
//!
//! [`crate::geometry::solvers::five_point`] says what is computed and why. Nearly all of it is the same arithmetic
//! for every sample, so each sample has a lane. Samples have different numbers of roots; so roots, and the intervals in which
//! they are looked for, are put together eight at a time, whichever sample they belong to.

#![expect(
    clippy::needless_range_loop,
    reason = "places in rows, columns and lanes are the subject"
)]

mod found;
mod isolation;
mod newton;
mod polish;
mod polynomials;
mod roots;

use super::lanes::{LANES, Lanes, Mask, Portable, values_of};
use polish::{Candidates, add_candidates, polish};
use polynomials::polynomials;
use roots::roots_of_eight;

#[cfg(test)]
pub use roots::roots_of_each;

/// Samples that are solved together.
pub const SAMPLES: usize = LANES;
/// Coordinates of a sample: x and y in view a of its five points, then those in view b.
pub const COORDINATES: usize = 20;
/// Models of a sample, at most.
const MODELS: usize = 10;
/// Coefficients of a polynomial that has as many roots.
const N: usize = MODELS + 1;
/// Models of all samples, and as many more as are written at once.
const ROOM: usize = MODELS * SAMPLES + LANES;

/// Finds the essential matrices of eight samples (see [`crate::geometry::solvers::five_point`]); `samples` has the
/// coordinates of each in turn, and a sample of NaN has no models. With `oriented`, only those that
/// [agree in orientation](crate::geometry::agree_in_orientation) with all five matches. `take` gets the number of a sample
/// and a model of it: row after row, of Frobenius norm 1. Those of one sample come in the order of their roots.
pub fn five_point_of_eight(
    samples: &[[f64; COORDINATES]; SAMPLES],
    oriented: bool,
    take: &mut dyn FnMut(usize, &[f64; 9]),
) {
    #[cfg(target_arch = "x86_64")]
    {
        use super::InstructionSet;
        use super::lanes::{Avx2, Avx512};

        type Samples = [[f64; COORDINATES]; SAMPLES];
        type Take<'a> = &'a mut dyn FnMut(usize, &[f64; 9]);

        #[target_feature(enable = "avx2,fma")]
        fn avx2(samples: &Samples, oriented: bool, take: Take<'_>) {
            solve::<Avx2>(samples, oriented, take);
        }

        #[target_feature(enable = "avx2,fma,avx512f,avx512bw,avx512cd,avx512dq,avx512vl")]
        fn avx512(samples: &Samples, oriented: bool, take: Take<'_>) {
            solve::<Avx512>(samples, oriented, take);
        }

        match InstructionSet::in_use() {
            // SAFETY: no more is in use than was detected on this processor.
            InstructionSet::Avx512 | InstructionSet::Amx => {
                return unsafe { avx512(samples, oriented, take) };
            }
            // SAFETY: as before.
            InstructionSet::Avx2 => return unsafe { avx2(samples, oriented, take) },
            InstructionSet::Portable => {}
        }
    }
    solve::<Portable>(samples, oriented, take);
}

#[inline(always)]
fn solve<V: Lanes>(
    samples: &[[f64; COORDINATES]; SAMPLES],
    oriented: bool,
    take: &mut dyn FnMut(usize, &[f64; 9]),
) {
    let mut points = [V::zero(); COORDINATES];
    for (i, point) in points.iter_mut().enumerate() {
        let mut values = [0.0; LANES];
        for lane in 0..LANES {
            values[lane] = samples[lane][i];
        }
        *point = V::new(values);
    }
    let reduced = polynomials(&points);
    let roots = roots_of_eight(&reduced.determinant);
    let mut kept = Candidates::new();
    for first in (0..roots.len()).step_by(LANES) {
        let (some, are_there) = roots.eight(first);
        add_candidates(&reduced, &points, some, are_there, oriented, &mut kept);
    }
    for first in (0..kept.len()).step_by(LANES) {
        let (some, are_there) = kept.eight(first);
        let (models, good) = polish(&reduced, some, are_there);
        let models = values_of(&models);
        let samples = some[4].values();
        for lane in 0..LANES {
            if good.at(lane) {
                let mut model = [0.0; 9];
                for i in 0..9 {
                    model[i] = models[i][lane];
                }
                take(samples[lane] as usize, &model);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::seed::Seed;
    use crate::simd::InstructionSet;

    #[test]
    fn every_instruction_set_gives_the_bits_of_the_portable_text() {
        let mut rng = Seed(3).rng();
        for round in 0..60 {
            let mut samples = [[0.0; COORDINATES]; SAMPLES];
            for x in samples.as_flattened_mut() {
                *x = 2.0 * rng.uniform() - 1.0;
            }
            // Matches that hardly move, the same match twice, and what is no match.
            for i in 0..10 {
                samples[1][10 + i] = samples[1][i] + 0.05 * samples[1][10 + i];
            }
            for i in [0, 1, 10, 11] {
                samples[2][i + 4] = samples[2][i];
            }
            samples[3][round % COORDINATES] = [f64::NAN, f64::INFINITY, 1e300][round % 3];
            for oriented in [false, true] {
                let mut portable = vec![Vec::new(); SAMPLES];
                solve::<Portable>(&samples, oriented, &mut |sample, model| {
                    portable[sample].push(*model);
                });
                assert!(portable.iter().any(|models| !models.is_empty()));
                assert!(portable[2].is_empty());
                InstructionSet::for_each(|set| {
                    let mut wide = vec![Vec::new(); SAMPLES];
                    five_point_of_eight(&samples, oriented, &mut |sample, model| {
                        wide[sample].push(*model);
                    });
                    assert_eq!(wide, portable, "{set:?}");
                });
            }
        }
    }
}
