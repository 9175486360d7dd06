//! How much matches are trusted, by how far their keypoints turned.
//!
//! The *turn* of a match is the difference of the orientations of its two keypoints. A camera that rolls turns all
//! keypoints of an image alike; perspective turns each by some tens of degrees more. So the turns of right matches
//! lie about one angle, and those of wrong ones anywhere. Jegou, Douze, Schmid, "Hamming Embedding and Weak
//! Geometric Consistency for Large Scale Image Search", ECCV 2008, section 4, find that angle: it is the maximum of
//! a histogram of the turns of all matches. They then count only the matches of that bin. Here every match gets a
//! *trust*, which the search by sample consensus uses as a weight:
//!
//! 1. The arc of 90 degrees with the most matches is found in a histogram of 5 degrees, and then its mean
//!    direction.
//! 2. A match within 45 degrees of that direction has a trust of 1. A match beyond has the density of matches beyond
//!    divided by the density within, at most 1. So the more matches share the common turn, the less the others count,
//!    and if all turns are equally frequent, all count alike. The trust is a weight, not a probability.
//! 3. The trust multiplies the weight of a match in the score. It also multiplies its certainty (1 - ambiguity), by
//!    which the most certain matches are tried first.
//!
//! No match is left out: some right matches have another turn, since a keypoint can have two orientations.
//!
//! | symbol | constant | value | source |
//! | --- | --- | --- | --- |
//! | | `REACH` | 45 degrees | tuned on the kitchen of 7-Scenes and four rendered scenes, 30 to 60 |

use std::f64::consts::TAU;

/// Bins of the histogram, of 5 degrees each.
const BINS: usize = 72;
/// A match is near the common turn if it is within this, in fractions of a circle: 45 degrees.
const REACH: f64 = 0.125;

/// The trust in each match, in (0, 1], from the turns of all matches in radians.
pub(super) fn trust(turns: &[f32]) -> Vec<f64> {
    let full: Vec<f64> = (turns.iter())
        .map(|&turn| (f64::from(turn) / TAU).rem_euclid(1.0))
        .collect();
    let common = common_turn(&full);
    let is_within = |turn: f64| {
        let off = (turn - common).rem_euclid(1.0);
        off.min(1.0 - off) <= REACH
    };
    let within = full.iter().filter(|&&turn| is_within(turn)).count();
    let beyond = full.len() - within;
    let density_within = within as f64 / (2.0 * REACH);
    let density_beyond = beyond as f64 / (1.0 - 2.0 * REACH);
    let of_those_beyond = (density_beyond / density_within).min(1.0);
    (full.into_iter())
        .map(|turn| {
            if is_within(turn) {
                1.0
            } else {
                of_those_beyond
            }
        })
        .collect()
}

/// The mean direction of the densest arc, in fractions of a circle, as the turns are.
fn common_turn(full: &[f64]) -> f64 {
    const ARC: usize = (2.0 * REACH * BINS as f64) as usize;
    let mut counts = [0_usize; BINS];
    for turn in full {
        // A turn that is not finite becomes 0; a turn just below 0 may have become 1.
        counts[((turn * BINS as f64) as usize).min(BINS - 1)] += 1;
    }
    let bins = |start: usize| (start..start + ARC).map(|bin| bin % BINS);
    let in_arc = |start: usize| bins(start).map(|bin| counts[bin]).sum::<usize>();
    let densest = (0..BINS)
        .rev()
        .max_by_key(|&start| in_arc(start))
        .expect("there are bins");
    let (mut x, mut y) = (0.0, 0.0);
    for bin in bins(densest) {
        let angle = (bin as f64 + 0.5) / BINS as f64 * TAU;
        x += counts[bin] as f64 * libm::cos(angle);
        y += counts[bin] as f64 * libm::sin(angle);
    }
    libm::atan2(y, x) / TAU
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::seed::Seed;

    /// `right` turns about `at` degrees, and `wrong` ones anywhere.
    fn turns(at: f64, right: usize, wrong: usize) -> Vec<f32> {
        let mut rng = Seed(7).rng();
        let mut turns: Vec<f32> = (0..right)
            .map(|_| (at + 10.0 * rng.normal()).to_radians() as f32)
            .collect();
        turns.extend((0..wrong).map(|_| (rng.uniform() * TAU) as f32));
        turns
    }

    #[test]
    fn matches_that_turned_unlike_the_others_are_trusted_by_how_dense_they_are() {
        for at in [-170.0, -3.0, 0.0, 90.0, 181.0, 700.0] {
            let turns = turns(at, 100, 300);
            let trust = trust(&turns);
            assert!(trust[..100].iter().all(|&trust| trust == 1.0), "{at}");
            let low: Vec<f64> = trust.into_iter().filter(|&trust| trust < 1.0).collect();
            // Three quarters of the wrong ones; as dense within as beyond, so a trust of 75 / 175.
            assert!((200..250).contains(&low.len()), "{at}: {}", low.len());
            assert!((low[0] - 75.0 / 175.0).abs() < 0.05, "{at}: {}", low[0]);
            assert!(low.iter().all(|&trust| trust == low[0]));
        }
    }

    #[test]
    fn turns_by_whole_circles_more_are_the_same() {
        let once = turns(20.0, 30, 40);
        let more: Vec<f32> = once.iter().map(|turn| turn + TAU as f32).collect();
        assert_eq!(trust(&once), trust(&more));
    }

    #[test]
    fn few_matches_and_equal_ones_are_trusted() {
        assert!(trust(&[]).is_empty());
        assert_eq!(trust(&[3.0]), [1.0]);
        assert_eq!(trust(&[-0.5; 9]), [1.0; 9]);
        // Just below 0 the remainder rounds to a whole circle.
        assert_eq!(trust(&[-1e-20; 2]), [1.0; 2]);
        // One on each side: neither is the common one.
        let opposite = trust(&[0.0, 3.0]);
        assert_eq!(opposite.iter().filter(|&&trust| trust == 1.0).count(), 1);
        assert!(opposite.iter().all(|&trust| trust > 0.3));
    }

    #[test]
    fn turns_that_are_not_numbers_harm_nothing() {
        let strange = [f32::NAN, f32::INFINITY, 1.0, 1.1, 1.2];
        let trust = trust(&strange);
        assert!(
            trust.iter().all(|&trust| trust > 0.0 && trust <= 1.0),
            "{trust:?}"
        );
    }

    fn of_degrees(degrees: &[f32]) -> Vec<f64> {
        let turns: Vec<f32> = degrees.iter().map(|turn| turn.to_radians()).collect();
        trust(&turns)
    }

    #[test]
    fn none_is_trusted_more_than_those_of_the_common_turn() {
        // No arc of 90 degrees has more than five. The mean direction of the first, at 35 degrees, has three within 45: a density
        // of 12, and that of the twelve beyond is 16.
        let groups = [
            (2.5, 3),
            (87.5, 2),
            (142.5, 3),
            (182.5, 2),
            (267.5, 3),
            (322.5, 2),
        ];
        let turns = groups.map(|(turn, count)| vec![turn; count]).concat();
        assert_eq!(of_degrees(&turns), [1.0; 15]);
    }

    #[test]
    fn of_arcs_with_as_many_turns_the_first_is_the_common_one() {
        // Densities of 1 / 0.25 within and 1 / 0.75 beyond.
        let trust = of_degrees(&[250.0, 100.0]);
        assert_eq!((trust[0], trust[1]), (1.0 / 3.0, 1.0));
    }

    #[test]
    fn the_common_turn_is_in_the_middle_of_its_bin() {
        let mut turns = vec![2.5; 200];
        turns.extend([47.0, -42.0, 48.0, -43.0]);
        let trust = of_degrees(&turns);
        assert_eq!(trust[200..202], [1.0; 2]);
        assert!(trust[202..].iter().all(|&trust| trust < 0.1), "{trust:?}");
    }
}
