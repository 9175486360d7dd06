//! Which data a sample takes: the trait of samplers, and uniform sampling.

use crate::seed::Rng;

/// Draws minimal samples. One of the three parts of [`consensus`](super::consensus()).
pub trait Sampling {
    /// Fills `sample` with distinct indices of data. A sampler may depend on the number of earlier calls
    /// (PROSAC draws from more and more data).
    fn draw(&mut self, rng: &mut Rng, sample: &mut [u32]);
}

/// A sampler for which all data are equally likely.
#[derive(Clone, Copy, Debug)]
pub struct Uniform {
    count: u32,
}

impl Uniform {
    /// A sampler for `count` data.
    ///
    /// # Panics
    /// If there are more than `u32` can number.
    pub fn new(count: usize) -> Self {
        Self {
            count: u32::try_from(count).expect("data are numbered by u32"),
        }
    }
}

impl Sampling for Uniform {
    /// # Panics
    /// If `sample` is longer than there are data.
    fn draw(&mut self, rng: &mut Rng, sample: &mut [u32]) {
        assert!(
            sample.len() <= self.count as usize,
            "enough data for a sample"
        );
        for i in 0..sample.len() {
            sample[i] = loop {
                let drawn = rng.below(self.count);
                if !sample[..i].contains(&drawn) {
                    break drawn;
                }
            };
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::seed::Seed;

    #[test]
    fn samples_are_distinct_and_uniform() {
        let mut rng = Seed(1).rng();
        let mut counts = [0_u32; 8];
        for _ in 0..16_000 {
            let mut sample = [0; 5];
            Uniform::new(8).draw(&mut rng, &mut sample);
            for (i, drawn) in sample.iter().enumerate() {
                assert!(!sample[..i].contains(drawn));
                counts[*drawn as usize] += 1;
            }
        }
        // 5 standard deviations of a binomial with n = 16,000 and p = 5/8.
        assert!(
            counts.iter().all(|&n| n.abs_diff(10_000) < 306),
            "{counts:?}"
        );
    }

    #[test]
    fn all_data_make_one_sample() {
        let mut sample = [0; 5];
        Uniform::new(5).draw(&mut Seed(2).rng(), &mut sample);
        sample.sort_unstable();
        assert_eq!(sample, [0, 1, 2, 3, 4]);
    }
}
