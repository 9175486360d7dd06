//! Seeds that belong to a task, and the only random number generator.
//!
//! Every random choice of a run comes from a [`Seed`]. It is derived from what is being computed (root seed,
//! dataset, pair, matcher, estimator, repetition) and never from a thread or a clock. So one thread and sixteen
//! draw the same numbers.
//!
//! - Derivation: `SplitMix64` finaliser (Steele, Lea, Flood: "Fast Splittable Pseudorandom Number
//!   Generators", OOPSLA 2014) over the parent and the FNV-1a hash of the label.
//! - Generator: PCG-XSH-RR 64/32 (O'Neill: "PCG: A Family of Simple Fast Space-Efficient
//!   Statistically Good Algorithms for Random Number Generation", HMC-CS-2014-0905, 2014).
//!   It is written here and not taken from a library, because published results must not change with the
//!   version of a library.

/// The seed of one task; children are derived from it by label or by number.
///
/// ```
/// use matchbench_vision::seed::Seed;
///
/// let pair = Seed(0).child("office").number(3).number(7);
/// assert_eq!(pair.rng().next_u32(), pair.rng().next_u32());
/// assert_ne!(pair, Seed(0).child("office").number(7).number(3));
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Seed(pub u64);

impl Seed {
    /// The seed of the part of this task that is called `label`.
    #[must_use]
    pub fn child(self, label: &str) -> Self {
        const OFFSET: u64 = 0xcbf2_9ce4_8422_2325;
        const PRIME: u64 = 0x0000_0100_0000_01b3;
        let hash = label.bytes().fold(OFFSET, |hash, byte| {
            (hash ^ u64::from(byte)).wrapping_mul(PRIME)
        });
        self.number(hash)
    }

    /// The seed of part number `index` of this task.
    #[must_use]
    pub fn number(self, index: u64) -> Self {
        Self(mix(self.0 ^ mix(index.wrapping_add(0x9e37_79b9_7f4a_7c15))))
    }

    /// A generator that starts at this seed.
    pub fn rng(self) -> Rng {
        Rng::new(self.0, mix(self.0))
    }
}

/// Finaliser of SplitMix64: a bijection of the 64-bit integers that scatters every bit.
fn mix(mut z: u64) -> u64 {
    z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    z ^ (z >> 31)
}

/// PCG-XSH-RR 64/32.
#[derive(Clone, Debug)]
pub struct Rng {
    state: u64,
    increment: u64,
}

impl Rng {
    /// The generator that the reference implementation calls `pcg32_srandom(state, stream)`.
    pub fn new(state: u64, stream: u64) -> Self {
        let mut rng = Self {
            state: 0,
            increment: (stream << 1) | 1,
        };
        rng.next_u32();
        rng.state = rng.state.wrapping_add(state);
        rng.next_u32();
        rng
    }

    /// The next 32 random bits.
    pub fn next_u32(&mut self) -> u32 {
        let old = self.state;
        self.state = old
            .wrapping_mul(6_364_136_223_846_793_005)
            .wrapping_add(self.increment);
        let xorshifted = (((old >> 18) ^ old) >> 27) as u32;
        xorshifted.rotate_right((old >> 59) as u32)
    }

    /// A uniform integer in `0..bound`, without bias (Lemire, "Fast Random Integer Generation in
    /// an Interval", ACM TOMACS 2019).
    ///
    /// # Panics
    /// If `bound` is 0.
    pub fn below(&mut self, bound: u32) -> u32 {
        assert!(bound > 0, "no integer lies below 0");
        let mut product = u64::from(self.next_u32()) * u64::from(bound);
        if (product as u32) < bound {
            let threshold = bound.wrapping_neg() % bound;
            while (product as u32) < threshold {
                product = u64::from(self.next_u32()) * u64::from(bound);
            }
        }
        (product >> 32) as u32
    }

    /// A uniform number in `[0, 1)` with 53 random bits.
    pub fn uniform(&mut self) -> f64 {
        let high = u64::from(self.next_u32() >> 5);
        let low = u64::from(self.next_u32() >> 6);
        ((high << 26) | low) as f64 / (1_u64 << 53) as f64
    }

    /// A normally distributed number with mean 0 and variance 1 (Box and Muller, 1958).
    pub fn normal(&mut self) -> f64 {
        let radius = (-2.0 * libm::log(1.0 - self.uniform())).sqrt();
        radius * libm::cos(core::f64::consts::TAU * self.uniform())
    }

    /// Puts `items` in random order (Fisher and Yates, from the last to the first).
    ///
    /// # Panics
    /// If there are more than fit `u32`.
    pub fn shuffle<T>(&mut self, items: &mut [T]) {
        for last in (1..items.len()).rev() {
            let bound = u32::try_from(last + 1).expect("items are numbered by u32");
            items.swap(last, self.below(bound) as usize);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn generator_gives_the_published_sequence() {
        // First round of the demo program that comes with the reference implementation.
        let mut rng = Rng::new(42, 54);
        let expected = [
            0xa15c_02b7,
            0x7b47_f409,
            0xba1d_3330,
            0x83d2_f293,
            0xbfa4_784b,
            0xcbed_606e,
        ];
        assert_eq!(expected.map(|_| rng.next_u32()), expected);
    }

    #[test]
    fn children_differ_by_label_and_number() {
        let root = Seed(7);
        assert_ne!(root.child("sift"), root.child("surf"));
        assert_ne!(root.number(0), root.number(1));
        assert_ne!(root.number(0), root);
    }

    #[test]
    fn below_is_uniform() {
        let mut rng = Seed(1).rng();
        let mut counts = [0_u32; 6];
        for _ in 0..60_000 {
            counts[rng.below(6) as usize] += 1;
        }
        // 5 standard deviations of a binomial with n = 60,000 and p = 1/6.
        assert!(
            counts.iter().all(|&n| n.abs_diff(10_000) < 457),
            "{counts:?}"
        );
    }

    #[test]
    fn normal_has_mean_0_and_variance_1() {
        let mut rng = Seed(2).rng();
        let draws: Vec<f64> = (0..100_000).map(|_| rng.normal()).collect();
        let mean = draws.iter().sum::<f64>() / draws.len() as f64;
        let variance =
            draws.iter().map(|x| (x - mean) * (x - mean)).sum::<f64>() / draws.len() as f64;
        assert!(
            mean.abs() < 0.016 && (variance - 1.0).abs() < 0.025,
            "{mean} {variance}"
        );
    }
}
