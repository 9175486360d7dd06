//! How large the noise of the matches of one pair is.
//!
//! Distances from a good model are of two kinds: those of right matches are half-normal, with the standard
//! deviation sigma that is wanted, those of wrong ones uniform, since near an epipolar line no distance is likelier
//! than another. Expectation maximisation (Dempster, Laird, Rubin, Journal of the Royal Statistical Society B 39,
//! 1977) finds the share of the right ones and sigma, as MLESAC does for the share alone (Torr, Zisserman, CVIU 78,
//! 2000, sec. 4), over the distances below 10 pixels:
//!
//! 1. The probability of each match to be right, from the current share and sigma.
//! 2. Their mean is the new share; the mean of the squared distances with these weights is the new sigma^2.
//!
//! A few matches tell little of sigma, and a wrong model has no right ones. So 20 matches more, of a standard
//! deviation of half a pixel, are taken to have been seen (the conjugate prior of a variance).
//!
//! | symbol | value | source |
//! | --- | --- | --- |
//! | - | 20 matches of 0.5 pixels | tuned on the kitchen of 7-Scenes, KITTI and four rendered scenes: 3 to 100, 0.4 to 0.7 |
//! | - | distances below 10 pixels | 6 does as well |
//! | sigma | 0.1 to 3.2 pixels | a keypoint is not more exact, a right match not less |

/// Distances from here on say nothing, in pixels.
const REACH_PX: f64 = 10.0;
/// Matches that are taken to have been seen, and their standard deviation in pixels.
const PRIOR_MATCHES: f64 = 20.0;
const PRIOR_PX: f64 = 0.5;
/// Least and largest sigma in pixels.
const LEAST_PX: f64 = 0.1;
const LARGEST_PX: f64 = 3.2;
/// Rounds of expectation maximisation.
const ROUNDS: usize = 30;

/// Standard deviation of the distances of right matches, in pixels, given the squared distances of all from a
/// model. Those that are not finite are left out.
pub(super) fn noise_scale(squared_distances_px: impl Iterator<Item = f64>) -> f64 {
    let near: Vec<f64> = squared_distances_px
        .filter(|&squared| squared < REACH_PX * REACH_PX)
        .collect();
    let (mut share, mut variance) = (0.5, PRIOR_PX * PRIOR_PX);
    for _ in 0..ROUNDS {
        let (mut right, mut sum) = (0.0, 0.0);
        let at_zero = share * (2.0 / (std::f64::consts::PI * variance)).sqrt();
        let wrong = (1.0 - share) / REACH_PX;
        for squared in &near {
            let density = at_zero * libm::exp(-0.5 * squared / variance);
            let probability = density / (density + wrong);
            right += probability;
            sum += probability * squared;
        }
        // Of one match more, half is right, so that no share is 0 or 1.
        share = (right + 1.0) / (near.len() as f64 + 2.0);
        variance = (sum + PRIOR_MATCHES * PRIOR_PX * PRIOR_PX) / (right + PRIOR_MATCHES);
    }
    variance.sqrt().clamp(LEAST_PX, LARGEST_PX)
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
    fn few_matches_move_it_little_and_none_not_at_all() {
        assert!((noise_scale(std::iter::empty()) - PRIOR_PX).abs() < 1e-12);
        let broken = [f64::NAN, f64::INFINITY, f64::MAX];
        assert!((noise_scale(broken.into_iter()) - PRIOR_PX).abs() < 1e-12);
        let five = noise_scale(distances(5, 2.0, 0).into_iter());
        assert!((0.4..1.0).contains(&five), "{five}");
    }

    #[test]
    fn exact_matches_and_hopeless_ones_stay_within_the_limits() {
        assert!((noise_scale(std::iter::repeat_n(0.0, 9000)) - LEAST_PX).abs() < 1e-12);
        let far = noise_scale(std::iter::repeat_n(99.0, 9000));
        assert!(far <= LARGEST_PX, "{far}");
    }
}
