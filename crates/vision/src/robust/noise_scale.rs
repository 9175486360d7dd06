//! How large the noise of the matches of one pair is.
//!
//! The distances of matches from a good model are a mixture of three kinds:
//!
//! - *Right* matches: half-normal, with the standard deviation sigma that is wanted.
//! - *Nearly right* matches: half-normal too, but wider. A neighbour that looks alike was matched, or one that
//!   moves with the others, as selectors by motion keep them (GMS, CODE).
//! - *Wrong* matches: uniform, since near an epipolar line no distance is likelier than another.
//!
//! Expectation maximisation (Dempster, Laird, Rubin, Journal of the Royal Statistical Society B 39, 1977) finds the
//! shares of the kinds and sigma, as MLESAC does for one share alone (Torr, Zisserman, CVIU 78, 2000, sec. 4). It
//! uses the distances below 10 pixels. The densities are not renormalised to these, which matters only for the wide one
//! where sigma is large:
//!
//! 1. Compute for each match the probabilities to be right, nearly right or wrong, from the current shares and
//!    sigma.
//! 2. The means of these are the new shares.
//! 3. The new sigma^2 is a weighted mean with these probabilities as weights: of the squared distances of right
//!    matches, and of the squared distances of nearly right ones divided by the square of how much wider these are.
//!
//! Right matches that are all inexact look like nearly right ones of a smaller sigma. Two rules prevent this
//! mistake. There are at most twice as many nearly right matches as right ones. And since the steps may end at
//! either answer, they are run twice: from half a pixel, and from the sigma that is found without nearly right
//! matches. The likelier of the two ends is the answer.
//!
//! A few matches tell little of sigma, and a wrong model has no right ones. So there is a prior: 20 additional
//! matches with a standard deviation of half a pixel are taken to have been seen (the conjugate prior of a
//! variance), and one of each kind.
//!
//! | symbol | value | source |
//! | --- | --- | --- |
//! | - | nearly right: 5 sigma | tuned on the kitchen of 7-Scenes and four rendered scenes: 3 to 8 |
//! | - | at most twice as many as right | tuned on these: 1/4 to 2; with 4, noise of 2 pixels is taken for 0.5 |
//! | - | 20 matches of 0.5 pixels | tuned on these and KITTI, without nearly right ones: 3 to 100, 0.4 to 0.7 |
//! | - | distances below 10 pixels | 6 does as well |
//! | sigma | 0.1 to 3.2 pixels | no keypoint is located better; matches that deviate more are not called right |

/// Distances above this carry no information, in pixels.
const REACH_PX: f64 = 10.0;
/// How much wider the distribution of nearly right matches is, and the largest number of them per right match.
const NEARLY_RIGHT_SIGMAS: f64 = 5.0;
const MOST_NEARLY_RIGHT: f64 = 2.0;
/// A prior, as if this many matches had been seen, and their standard deviation in pixels.
const PRIOR_MATCHES: f64 = 20.0;
const PRIOR_PX: f64 = 0.5;
/// Smallest and largest sigma in pixels.
const MIN_PX: f64 = 0.1;
const MAX_PX: f64 = 3.2;
/// Rounds of expectation maximisation, without and with nearly right matches.
const ROUNDS_OF_TWO: usize = 15;
const ROUNDS_OF_THREE: usize = 30;

/// Standard deviation of the distances of right matches, in pixels. It is computed from the squared distances
/// of all matches from a model. Distances that are not finite are left out.
pub(super) fn noise_scale(squared_distances_px: impl Iterator<Item = f64>) -> f64 {
    let near: Vec<f64> = squared_distances_px
        .filter(|&squared| squared < REACH_PX * REACH_PX)
        .collect();
    let from = |right, nearly_right, variance| Mixture {
        right,
        nearly_right,
        variance,
    };
    let prior = PRIOR_PX * PRIOR_PX;
    let two_kinds = from(0.5, 0.0, prior).refined(&near, 0.0, ROUNDS_OF_TWO);
    let [narrow, wide] = [prior, two_kinds.variance]
        .map(|start| from(0.4, 0.4, start).refined(&near, MOST_NEARLY_RIGHT, ROUNDS_OF_THREE));
    let likelier = if narrow.log_likelihood(&near) > wide.log_likelihood(&near) {
        narrow
    } else {
        wide
    };
    likelier.variance.sqrt().clamp(MIN_PX, MAX_PX)
}

/// The mixture of which the distances are drawn.
#[derive(Clone, Copy)]
struct Mixture {
    /// Share of right matches.
    right: f64,
    /// Share of nearly right matches; the others are wrong.
    nearly_right: f64,
    /// Square of sigma, in squared pixels.
    variance: f64,
}

impl Mixture {
    /// Densities of a right, a nearly right and a wrong match at a distance, times their shares.
    #[inline]
    fn densities(&self, squared: f64) -> [f64; 3] {
        let at_zero = (2.0 / (std::f64::consts::PI * self.variance)).sqrt();
        let half_normal = |squared: f64| libm::exp(-0.5 * squared / self.variance);
        // The exponentials take most of the time, so one that would be multiplied by zero is left out.
        let nearly_right = if self.nearly_right > 0.0 {
            self.nearly_right * at_zero / NEARLY_RIGHT_SIGMAS
                * half_normal(squared / (NEARLY_RIGHT_SIGMAS * NEARLY_RIGHT_SIGMAS))
        } else {
            0.0
        };
        [
            self.right * at_zero * half_normal(squared),
            nearly_right,
            (1.0 - self.right - self.nearly_right) / REACH_PX,
        ]
    }

    /// The mixture after `rounds` rounds, with at most `most` nearly right matches per right match.
    fn refined(mut self, near: &[f64], most: f64, rounds: usize) -> Self {
        for _ in 0..rounds {
            let (mut right, mut nearly_right, mut sum) = (0.0, 0.0, 0.0);
            for &squared in near {
                let [a, b, c] = self.densities(squared);
                let density = a + b + c;
                right += a / density;
                nearly_right += b / density;
                sum += (a + b / (NEARLY_RIGHT_SIGMAS * NEARLY_RIGHT_SIGMAS)) / density * squared;
            }
            self.variance = (sum + PRIOR_MATCHES * PRIOR_PX * PRIOR_PX)
                / (right + nearly_right + PRIOR_MATCHES);
            // Three additional matches, one of each kind, so that no share is 0 or 1.
            let count = near.len() as f64 + 3.0;
            (self.right, self.nearly_right) = ((right + 1.0) / count, (nearly_right + 1.0) / count);
            if self.nearly_right > most * self.right {
                // If the most likely shares exceed the limit, those on the limit are taken.
                let both = self.right + self.nearly_right;
                self.right = both / (1.0 + most);
                self.nearly_right = both - self.right;
            }
        }
        self
    }

    /// Log-likelihood of these distances and of the prior.
    fn log_likelihood(&self, near: &[f64]) -> f64 {
        let wrong = 1.0 - self.right - self.nearly_right;
        let prior = -0.5 * (libm::log(self.variance) + PRIOR_PX * PRIOR_PX / self.variance);
        let density = |&squared: &f64| libm::log(self.densities(squared).iter().sum());
        near.iter().map(density).sum::<f64>()
            + PRIOR_MATCHES * prior
            + libm::log(self.right * self.nearly_right * wrong)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::seed::Seed;

    /// Distances of right matches of this noise and of wrong ones, squared.
    fn distances(right: usize, sigma: f64, wrong: usize) -> Vec<f64> {
        let mut rng = Seed(5).rng();
        let mut squared: Vec<f64> = (0..right).map(|_| (sigma * rng.normal()).powi(2)).collect();
        squared.extend((0..wrong).map(|_| (300.0 * rng.uniform()).powi(2)));
        squared
    }

    #[test]
    fn the_noise_is_found_among_wrong_matches() {
        for sigma in [0.2, 0.5, 1.0, 2.0] {
            let found = noise_scale(distances(600, sigma, 1400).into_iter());
            assert!((found / sigma - 1.0).abs() < 0.1, "{sigma}: {found}");
        }
    }

    #[test]
    fn matches_that_are_nearly_right_do_not_widen_it() {
        for sigma in [0.2, 0.5, 1.0] {
            let mut all = distances(600, sigma, 400);
            all.extend(distances(300, 5.0 * sigma, 0));
            let found = noise_scale(all.into_iter());
            assert!((found / sigma - 1.0).abs() < 0.2, "{sigma}: {found}");
        }
    }

    /// Of a mixture with a sigma of one pixel.
    #[test]
    fn densities_of_the_kinds_integrate_to_their_shares() {
        let mixture = Mixture {
            right: 0.5,
            nearly_right: 0.2,
            variance: 1.0,
        };
        let integral = |kind: usize, reach: f64| -> f64 {
            let count = 10_000;
            let step = reach / f64::from(count);
            let at = |i: i32| mixture.densities(((f64::from(i) + 0.5) * step).powi(2))[kind];
            (0..count).map(at).sum::<f64>() * step
        };
        // Wrong matches lie anywhere below 10 pixels.
        for (kind, reach, share) in [(0, 60.0, 0.5), (1, 60.0, 0.2), (2, 10.0, 0.3)] {
            let found = integral(kind, reach);
            assert!((found - share).abs() < 1e-6, "{kind}: {found}");
        }
    }

    #[test]
    fn matches_beyond_ten_pixels_tell_nothing_and_nearer_ones_something() {
        let near = distances(60, 0.7, 0);
        let with = |far: f64| {
            let far = std::iter::repeat_n(far * far, 500);
            noise_scale(near.iter().copied().chain(far))
        };
        let alone = noise_scale(near.iter().copied());
        assert_eq!(with(10.01), alone);
        assert_ne!(with(9.99), alone);
    }

    /// What expectation maximisation promises: the likelihood of the distances, times the prior, never falls, and where the
    /// steps end it has its maximum.
    #[test]
    fn rounds_climb_to_a_maximum_of_the_likelihood() {
        let mut near = distances(600, 0.6, 0);
        near.extend(distances(300, 3.0, 0));
        near.extend((0..300).map(|i| (f64::from(i) / 30.0).powi(2)));
        near.retain(|&squared| squared < REACH_PX * REACH_PX);
        for (most, variance) in [(2.0, 0.25), (2.0, 9.0), (0.3, 0.25), (0.3, 4.0)] {
            let mut mixture = Mixture {
                right: 0.6,
                nearly_right: 0.1,
                variance,
            };
            for round in 0..300 {
                let next = mixture.refined(&near, most, 1);
                let [before, after] = [mixture, next].map(|it| it.log_likelihood(&near));
                assert!(after >= before - 1e-9, "round {round}: {before} to {after}");
                mixture = next;
            }
            let top = mixture.log_likelihood(&near);
            let is_limited = mixture.nearly_right > 0.999 * most * mixture.right;
            assert_eq!(is_limited, most < 1.0, "{}", mixture.nearly_right);
            for change in [0.99, 1.01] {
                let mut beside = [mixture; 3];
                beside[0].variance *= change;
                beside[1].right *= change;
                beside[2].nearly_right *= change;
                // On the limit the shares go together.
                beside[1].nearly_right *= if is_limited { change } else { 1.0 };
                for other in &beside[..if is_limited { 2 } else { 3 }] {
                    let other = other.log_likelihood(&near);
                    assert!(other < top, "{other} beside {top}");
                }
            }
        }
    }

    #[test]
    fn few_matches_move_it_little_and_none_not_at_all() {
        assert!((noise_scale(std::iter::empty()) - PRIOR_PX).abs() < 1e-12);
        let broken = [f64::NAN, f64::INFINITY, f64::MAX];
        assert!((noise_scale(broken.into_iter()) - PRIOR_PX).abs() < 1e-12);
        let five = noise_scale(distances(5, 2.0, 0).into_iter());
        assert!((0.4..1.0).contains(&five), "{five}");
        // Sixty exact ones beside the twenty of the prior: sigma^2 = 20 * 0.25 / 80.
        let exact = noise_scale(std::iter::repeat_n(0.0, 60));
        assert!((exact - 0.25).abs() < 0.005, "{exact}");
    }

    #[test]
    fn exact_matches_and_hopeless_ones_stay_within_the_limits() {
        assert!((noise_scale(std::iter::repeat_n(0.0, 9000)) - MIN_PX).abs() < 1e-12);
        let wide = noise_scale(distances(9000, 5.0, 0).into_iter());
        assert!((wide - MAX_PX).abs() < 1e-12, "{wide}");
        // So far away they are all taken for wrong ones, which say nothing.
        let far = noise_scale(std::iter::repeat_n(99.0, 9000));
        assert!((far - PRIOR_PX).abs() < 0.01, "{far}");
    }
}
