//! Progressive sampling: the best matches first.
//!
//! Chum, Matas, "Matching with PROSAC - Progressive Sample Consensus", CVPR 2005.
//!
//! Data are sorted, the most certain first. Sample number t is drawn from the first n(t) data, where
//! n grows such that after `horizon` samples the draws are as if they had all been uniform: of
//! T_N uniform samples, `T_n = T_N prod_{i < m} (n - i) / (N - i)` lie within the first n
//! (eq. 3), so n is increased when that many were drawn (eqs. 4-5), and until then every sample holds
//! datum n.
//!
//! | symbol | argument | default | source |
//! | --- | --- | --- | --- |
//! | T_N | `horizon` | 200,000 | the paper, sec. 2.1 |
//!
//! *Choice*: the termination is that of uniform sampling (see [`consensus`](super::consensus())), which
//! draws at least as many samples as the paper's maximality criterion.

use super::Sampling;
use crate::seed::Rng;

/// A sampler that draws from a growing set of the most certain data.
#[derive(Clone, Debug)]
pub struct Prosac {
    /// Indices of the data, the most certain first.
    order: Vec<u32>,
    horizon: f64,
    drawn: usize,
    /// Number of data in the set, n; 0 before the first draw.
    set: usize,
    /// T_n.
    expected: f64,
    /// T'_n: the number of samples after which the set grows.
    until: usize,
}

impl Prosac {
    /// A sampler for as many data as there are `ambiguities`. The smallest come first (NaN last, equal ones by
    /// index), and after about `horizon` samples all are equally likely.
    ///
    /// # Panics
    /// If there are more than `u32` can number.
    pub fn new(ambiguities: &[f32], horizon: usize) -> Self {
        let count = u32::try_from(ambiguities.len()).expect("data are numbered by u32");
        let mut order: Vec<u32> = (0..count).collect();
        order.sort_by(|&i, &j| {
            let [i, j] = [i, j].map(|i| ambiguities[i as usize]);
            i.is_nan().cmp(&j.is_nan()).then(i.total_cmp(&j))
        });
        Self {
            order,
            horizon: horizon as f64,
            drawn: 0,
            set: 0,
            expected: 0.0,
            until: 0,
        }
    }

    fn start(&mut self, sample: usize) {
        self.set = sample;
        let shares = (0..sample).map(|i| (sample - i) as f64 / (self.order.len() - i) as f64);
        self.expected = shares.fold(self.horizon, |product, share| product * share);
        self.until = 1;
    }
}

impl Sampling for Prosac {
    /// # Panics
    /// If `sample` is empty or longer than there are data.
    fn draw(&mut self, rng: &mut Rng, sample: &mut [u32]) {
        let m = sample.len();
        assert!(
            (1..=self.order.len()).contains(&m),
            "enough data for a sample"
        );
        if self.set == 0 {
            self.start(m);
        }
        self.drawn += 1;
        while self.drawn > self.until && self.set < self.order.len() {
            let next = self.expected * (self.set + 1) as f64 / (self.set + 1 - m) as f64;
            self.until += (next - self.expected).ceil() as usize;
            self.expected = next;
            self.set += 1;
        }
        // Until the whole set has had its share of samples, the newest datum is in every sample.
        let newest = self.drawn <= self.until;
        let (free, below) = if newest {
            (m - 1, self.set - 1)
        } else {
            (m, self.set)
        };
        for i in 0..free {
            sample[i] = loop {
                let drawn = self.order[rng.below(below as u32) as usize];
                if !sample[..i].contains(&drawn) {
                    break drawn;
                }
            };
        }
        if newest {
            sample[m - 1] = self.order[self.set - 1];
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::seed::Seed;

    #[test]
    fn the_most_certain_come_first_and_all_come_in_the_end() {
        let ambiguities: Vec<f32> = (0..50).map(|i| 1.0 - i as f32 / 50.0).collect();
        let mut prosac = Prosac::new(&ambiguities, 2000);
        let mut rng = Seed(1).rng();
        let mut sample = [0; 5];
        prosac.draw(&mut rng, &mut sample);
        sample.sort_unstable();
        assert_eq!(sample, [45, 46, 47, 48, 49]);
        let mut counts = [0; 50];
        let mut early = [0; 50];
        for t in 0..6000 {
            prosac.draw(&mut rng, &mut sample);
            for (i, drawn) in sample.iter().enumerate() {
                assert!(!sample[..i].contains(drawn));
                counts[*drawn as usize] += 1;
                early[*drawn as usize] += i32::from(t < 100);
            }
        }
        assert!(counts.iter().all(|&n| n > 350), "{counts:?}");
        assert_eq!(early[..20], [0; 20]);
    }

    #[test]
    fn a_set_of_one_sample_and_ambiguities_that_are_not_numbers_are_fine() {
        let mut prosac = Prosac::new(&[f32::NAN, 0.5, f32::INFINITY, 0.1, -1.0], 10);
        let mut rng = Seed(1).rng();
        for _ in 0..100 {
            let mut sample = [0; 5];
            prosac.draw(&mut rng, &mut sample);
            sample.sort_unstable();
            assert_eq!(sample, [0, 1, 2, 3, 4]);
        }
        assert_eq!(prosac.order, [4, 3, 1, 2, 0]);
    }
}
