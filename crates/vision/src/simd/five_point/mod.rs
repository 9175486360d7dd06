//! Essential matrices of five matches, for eight samples at once.
//!
//! [`crate::geometry::solvers::five_point`] says what is computed and why. Nearly all of it is the same arithmetic
//! for every sample, so each sample has a lane. Samples have different numbers of roots; so roots are put together
//! eight at a time, whichever sample they belong to.

#![expect(
    clippy::needless_range_loop,
    reason = "places in rows, columns and lanes are the subject"
)]

mod polish;
mod polynomials;
mod roots;

use super::lanes::{LANES, Lanes, Mask, Portable};
use polish::{Candidate, candidates, polish};
use polynomials::polynomials;
use roots::{Root, roots_of_eight};

#[cfg(test)]
pub use roots::roots_of_each;

/// Samples that are solved together.
pub const SAMPLES: usize = LANES;
/// Coordinates of a sample: x and y in view a of its five points, then those in view b.
pub const COORDINATES: usize = 20;
/// Models of so many samples, at most.
pub const MODELS: usize = 10 * SAMPLES;

/// The models of eight samples, those of one sample after those of the one before.
#[derive(Clone, Debug)]
pub struct FivePointModels {
    /// Row after row, of Frobenius norm 1.
    pub models: [[f64; 9]; MODELS],
    /// How many models each sample has.
    pub counts: [usize; SAMPLES],
}

impl FivePointModels {
    /// No models.
    pub const NONE: Self = Self {
        models: [[0.0; 9]; MODELS],
        counts: [0; SAMPLES],
    };
}

/// Writes the essential matrices of eight samples (see [`crate::geometry::solvers::five_point`]); `samples` has
/// the coordinates of each in turn, and a sample of NaN has no models. With `oriented`, only those that
/// [agree in orientation](crate::geometry::agree_in_orientation) with all five matches.
pub fn five_point_of_eight(
    samples: &[[f64; COORDINATES]; SAMPLES],
    oriented: bool,
    out: &mut FivePointModels,
) {
    #[cfg(target_arch = "x86_64")]
    {
        use super::InstructionSet;
        use super::lanes::{Avx2, Avx512};

        type Samples = [[f64; COORDINATES]; SAMPLES];

        #[target_feature(enable = "avx2,fma")]
        fn avx2(samples: &Samples, oriented: bool, out: &mut FivePointModels) {
            solve::<Avx2>(samples, oriented, out);
        }

        #[target_feature(enable = "avx2,fma,avx512f,avx512bw,avx512cd,avx512dq,avx512vl")]
        fn avx512(samples: &Samples, oriented: bool, out: &mut FivePointModels) {
            solve::<Avx512>(samples, oriented, out);
        }

        match InstructionSet::in_use() {
            // SAFETY: no more is in use than was detected on this processor.
            InstructionSet::Avx512 | InstructionSet::Amx => {
                return unsafe { avx512(samples, oriented, out) };
            }
            // SAFETY: as before.
            InstructionSet::Avx2 => return unsafe { avx2(samples, oriented, out) },
            InstructionSet::Portable => {}
        }
    }
    solve::<Portable>(samples, oriented, out);
}

#[inline(always)]
fn solve<V: Lanes>(
    samples: &[[f64; COORDINATES]; SAMPLES],
    oriented: bool,
    out: &mut FivePointModels,
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
    let mut roots = [Root::NONE; MODELS];
    let count = roots_of_eight(&reduced.determinant, &mut roots);
    let mut kept = [Candidate::NONE; MODELS];
    let mut number = 0;
    for start in (0..count).step_by(LANES) {
        let some = &roots[start..count.min(start + LANES)];
        let (found, keep) = candidates(&reduced, &points, some, oriented);
        for lane in 0..some.len() {
            if keep.at(lane) {
                kept[number] = found[lane];
                number += 1;
            }
        }
    }
    out.counts = [0; SAMPLES];
    let mut next = 0;
    for start in (0..number).step_by(LANES) {
        let some = &kept[start..number.min(start + LANES)];
        let (models, good) = polish(&reduced, some);
        for (lane, candidate) in some.iter().enumerate() {
            if good.at(lane) {
                for i in 0..9 {
                    out.models[next][i] = models[i][lane];
                }
                out.counts[candidate.sample as usize] += 1;
                next += 1;
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
                let mut portable = FivePointModels::NONE;
                solve::<Portable>(&samples, oriented, &mut portable);
                let models: usize = portable.counts.iter().sum();
                assert!(models > 0 && portable.counts[2] == 0);
                InstructionSet::for_each(|set| {
                    let mut wide = FivePointModels::NONE;
                    five_point_of_eight(&samples, oriented, &mut wide);
                    assert_eq!(wide.counts, portable.counts, "{set:?}");
                    assert_eq!(wide.models[..models], portable.models[..models], "{set:?}");
                });
            }
        }
    }
}
