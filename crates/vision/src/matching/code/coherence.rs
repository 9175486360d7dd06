//! The two functions of CODE that say whether a match is coherent with others, the likelihood and the motion:
//! how they are learned from some matches (the seeds) and evaluated for any match.

use nalgebra::{DMatrix, Matrix2, Point2, Vector2};

use super::CodeParams;
use super::regression::{Point, SparseRow, evaluate, fit, kernels};
use crate::features::Features;
use crate::matching::Correspondence;
use crate::seed::Rng;

/// Number of kernels of the motion; each has three coefficients.
const MOTION_CENTRES: usize = 60;
/// A seed is verified if its likelihood is above this.
const VERIFIED: f64 = 0.5;
/// Number of matches that determine an affine motion.
const MIN_VERIFIED: usize = 3;

/// Matches in the form that the learned functions take.
pub(in crate::matching) struct Motions {
    /// `None` for matches that the functions cannot judge.
    points: Vec<Option<Point>>,
    /// Their places in image b, normalised.
    places_b: Vec<Point2<f64>>,
}

impl Motions {
    pub(in crate::matching) fn new(
        a: &Features,
        b: &Features,
        matches: &[Correspondence],
        params: &CodeParams,
    ) -> Self {
        let places_a = normalised(a, matches, |m| m.a);
        let places_b = normalised(b, matches, |m| m.b);
        let frames = |m: &Correspondence| (a.frame(m.a as usize), b.frame(m.b as usize));
        let points = (matches.iter().zip(&places_a).zip(&places_b))
            .map(|((m, &from), &to)| point(frames(m), from, to, params))
            .collect();
        Self { points, places_b }
    }
}

/// The functions that were learned from some matches.
pub(in crate::matching) struct Coherence {
    centres: Vec<Point>,
    likelihood: Vec<[f64; 1]>,
    motion_centres: Vec<Point>,
    motion: Vec<[f64; 2]>,
}

impl Coherence {
    /// Learns from at most `params.seeds` of the matches with the indices `candidates`, drawn at random. `None`
    /// if they do not determine the functions.
    pub(in crate::matching) fn learn(
        motions: &Motions,
        mut candidates: Vec<usize>,
        params: &CodeParams,
        rng: &mut Rng,
    ) -> Option<Self> {
        let points = &motions.points;
        candidates.retain(|&i| points[i].is_some());
        shuffle_first(&mut candidates, params.seeds, rng);
        let seeds: Vec<Point> = candidates.iter().filter_map(|&i| points[i]).collect();
        let centres = seeds[..seeds.len().min(params.centres)].to_vec();
        let likelihood = learn_likelihood(&seeds, &centres, params)?;
        let verified: Vec<(Point, Point2<f64>)> = (candidates.iter().zip(&seeds))
            .filter(|(_, point)| evaluate(&kernels(point, &centres), &likelihood)[0] > VERIFIED)
            .map(|(&i, &point)| (point, motions.places_b[i]))
            .collect();
        // With fewer matches the ridge would still give a motion; with none at all, one to the middle of b.
        if verified.len() < MIN_VERIFIED {
            return None;
        }
        let motion_centres: Vec<Point> = (verified.iter().map(|&(point, _)| point))
            .take(MOTION_CENTRES)
            .collect();
        let motion = learn_motion(&verified, &motion_centres, params)?;
        Some(Self {
            centres,
            likelihood,
            motion_centres,
            motion,
        })
    }

    /// Whether match `index` has a likelihood above `least`, or ends where the motion maps it.
    pub(in crate::matching) fn accepts(
        &self,
        motions: &Motions,
        index: usize,
        least: f64,
        squared_transfer: f64,
    ) -> bool {
        motions.points[index].is_some_and(|point| {
            let [likelihood] = evaluate(&kernels(&point, &self.centres), &self.likelihood);
            if likelihood > least {
                return true;
            }
            let [u, v] = evaluate(&affine_row(&point, &self.motion_centres), &self.motion);
            let to = motions.places_b[index];
            let (du, dv) = (u - to.x, v - to.y);
            du * du + dv * dv < squared_transfer
        })
    }
}

/// A match as a point; `None` if its frames differ too much or are invalid.
fn point(
    (a, b): ([f32; 4], [f32; 4]),
    from: Point2<f64>,
    to: Point2<f64>,
    params: &CodeParams,
) -> Option<Point> {
    let matrix = |m: [f32; 4]| Matrix2::from_row_slice(&m.map(f64::from));
    let relative = matrix(b) * matrix(a).try_inverse()?;
    let scale = relative.determinant().abs().sqrt();
    let m = relative / scale;
    // With determinant 1 the squared norm is r + 1 / r for the ratio r of the axes.
    let aspect = params.max_aspect;
    let regular = m.norm_squared() <= aspect + 1.0 / aspect;
    let moved = (to - from) * params.displacement_scale;
    (regular && moved.x.is_finite() && moved.y.is_finite())
        .then_some([from.x, from.y, moved.x, moved.y, m.m11, m.m12, m.m21, m.m22])
}

/// Coefficients of the likelihood.
fn learn_likelihood(
    seeds: &[Point],
    centres: &[Point],
    params: &CodeParams,
) -> Option<Vec<[f64; 1]>> {
    let rows: Vec<SparseRow> = seeds.iter().map(|seed| kernels(seed, centres)).collect();
    // The penalty is on the coefficients and not on the norm of the function, since truncated kernels are not
    // positive definite. A seed on its own would get 1 / (1 + ridge) by squares alone. By Huber's loss it gets less where
    // `huber` is below ridge / (1 + ridge): nearly huber / ridge.
    let penalty = DMatrix::identity(centres.len(), centres.len()) * params.ridge;
    fit(&rows, &vec![[1.0]; seeds.len()], &penalty, params.huber)
}

/// Coefficients of the motion, from matches and the places where they end.
fn learn_motion(
    verified: &[(Point, Point2<f64>)],
    centres: &[Point],
    params: &CodeParams,
) -> Option<Vec<[f64; 2]>> {
    let (rows, targets): (Vec<_>, Vec<_>) = (verified.iter())
        .map(|(point, to)| (affine_row(point, centres), [to.x, to.y]))
        .unzip();
    let count = 3 * (centres.len() + 1);
    // The affine motion that all matches share has next to no penalty: enough that the system stays regular.
    let penalty = DMatrix::from_fn(count, count, |i, j| match (i == j, i < 3) {
        (false, _) => 0.0,
        (true, true) => 1e-9,
        (true, false) => params.ridge,
    });
    fit(&rows, &targets, &penalty, params.huber)
}

/// The row of the linear system for an affine motion that varies with the match.
fn affine_row(point: &Point, centres: &[Point]) -> SparseRow {
    let monomials = [point[0], point[1], 1.0];
    let mut row: SparseRow = monomials.into_iter().enumerate().collect();
    for (index, k) in kernels(point, centres) {
        let first = 3 * (index + 1);
        row.extend((0..3).map(|i| (first + i, k * monomials[i])));
    }
    row
}

/// Places of matched keypoints, shifted to zero mean and scaled to a mean distance of sqrt(2) from it.
fn normalised(
    features: &Features,
    matches: &[Correspondence],
    index: fn(&Correspondence) -> u32,
) -> Vec<Point2<f64>> {
    let places: Vec<Point2<f64>> = (matches.iter())
        .map(|m| features.keypoints[index(m) as usize].at.cast())
        .collect();
    let finite = || places.iter().filter(|p| p.x.is_finite() && p.y.is_finite());
    let count = finite().count().max(1) as f64;
    let mean = finite().fold(Vector2::zeros(), |sum, p| sum + p.coords) / count;
    let distance = finite().map(|p| (p.coords - mean).norm()).sum::<f64>() / count;
    let scale = std::f64::consts::SQRT_2 / distance.max(f64::MIN_POSITIVE);
    (places.iter())
        .map(|p| Point2::from((p.coords - mean) * scale))
        .collect()
}

/// Keeps `count` at most, drawn at random and in random order.
fn shuffle_first(values: &mut Vec<usize>, count: usize, rng: &mut Rng) {
    for i in 0..count.min(values.len()) {
        let other = i + rng.below((values.len() - i) as u32) as usize;
        values.swap(i, other);
    }
    values.truncate(count);
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::features::{Descriptors, FloatRows, Keypoint};
    use crate::image::Size;

    #[test]
    fn a_point_is_a_place_a_displacement_and_a_map_without_its_scale() {
        let (from, to) = (Point2::new(0.5, -1.0), Point2::new(1.5, -3.0));
        let of = |a, b| point((a, b), from, to, &CodeParams::default());
        // Of twice the size, and turned by 90 degrees.
        let found = of([2.0, 0.0, 0.0, 2.0], [0.0, -4.0, 4.0, 0.0]).unwrap();
        assert_eq!(found, [0.5, -1.0, 3.0, -6.0, 0.0, -1.0, 1.0, 0.0]);
        // The map takes the frame of a to that of b: across, 4 instead of 1, that is 2 and 1/2 without the scale of 2.
        let found = of([0.5, 0.0, 0.0, 2.0], [2.0, 0.0, 0.0, 2.0]).unwrap();
        assert_eq!(found[4..], [2.0, 0.0, 0.0, 0.5]);
    }

    #[test]
    fn maps_that_stretch_too_much_and_broken_ones_are_no_points() {
        let at = Point2::new(0.5, -1.0);
        let is_point = |b: [f32; 4], to: Point2<f64>| {
            point(([3.0, 0.0, 0.0, 3.0], b), at, to, &CodeParams::default()).is_some()
        };
        assert!(is_point([9.8, 0.0, 0.0, 2.0], at) && is_point([0.0, 2.0, -9.8, 0.0], at));
        assert!(!is_point([10.2, 0.0, 0.0, 2.0], at) && !is_point([0.0, 2.0, -10.2, 0.0], at));
        assert!(!is_point([3.0, 0.0, 0.0, 3.0], Point2::new(f64::NAN, 0.0)));
        assert!(!is_point(
            [3.0, 0.0, 0.0, 3.0],
            Point2::new(0.0, f64::INFINITY)
        ));
        assert!(
            point(
                ([0.0; 4], [1.0, 0.0, 0.0, 1.0]),
                at,
                at,
                &CodeParams::default()
            )
            .is_none()
        );
    }

    #[test]
    fn places_have_no_mean_and_a_mean_distance_of_the_root_of_two() {
        let places = [(10.0, 20.0), (16.0, 20.0), (10.0, 28.0), (16.0, 28.0)];
        let keypoint = |(x, y)| Keypoint {
            at: Point2::new(x, y),
            size: 4.0,
            angle: None,
            response: 1.0,
            octave: 0,
        };
        let mut keypoints = places.map(keypoint).to_vec();
        // A place that is nowhere counts for nothing.
        keypoints.push(keypoint((f32::NAN, 0.0)));
        let descriptors = Descriptors::Float(FloatRows::from_vec(1, vec![0.0; 5]));
        let features = Features::new(Size::new(40, 40), keypoints, descriptors);
        let matches: Vec<Correspondence> = (0..5)
            .map(|a| Correspondence {
                a,
                b: 0,
                distance: 0.0,
                second: 1.0,
            })
            .collect();
        // Each is 3 and 4, so 5 away from the middle at (13, 24).
        let unit = std::f64::consts::SQRT_2 / 5.0;
        let found = normalised(&features, &matches, |m| m.a);
        for (found, (x, y)) in found.iter().zip([(-3, -4), (3, -4), (-3, 4), (3, 4)]) {
            let expected = Point2::new(f64::from(x), f64::from(y)) * unit;
            assert!((found - expected).norm() < 1e-12, "{found}");
        }
    }

    /// A match of a layer of the scene that moves by an affine map of its own, at a random place.
    fn of_layer(layer: usize, rng: &mut Rng) -> (Point, Point2<f64>) {
        let mut coordinate = || 2.4 * rng.uniform() - 1.2;
        let from = Point2::new(coordinate(), coordinate());
        let (map, shift) = [
            (Matrix2::new(1.1, 0.1, -0.1, 0.9), Vector2::new(0.5, 0.0)),
            (Matrix2::new(0.8, 0.0, 0.2, 1.1), Vector2::new(-0.8, 0.3)),
        ][layer];
        let to = map * from + shift;
        let frames = ([1.0, 0.0, 0.0, 1.0], [1.0, 0.0, 0.0, 1.0]);
        let params = CodeParams::default();
        (point(frames, from, to, &params).expect("regular"), to)
    }

    #[test]
    fn layers_of_the_scene_that_move_differently_are_both_followed() {
        let (rng, params) = (&mut crate::seed::Seed(4).rng(), CodeParams::default());
        let verified: Vec<_> = (0..600).map(|i| of_layer(i % 2, rng)).collect();
        let centres: Vec<Point> = verified.iter().map(|&(point, _)| point).take(60).collect();
        let motion = learn_motion(&verified, &centres, &params).expect("it is determined");
        let mut is_followed = || {
            let (point, to) = of_layer(rng.below(2) as usize, rng);
            let [u, v] = evaluate(&affine_row(&point, &centres), &motion);
            (Point2::new(u, v) - to).norm_squared() < params.squared_transfer
        };
        let followed = (0..500).filter(|_| is_followed()).count();
        assert!(followed > 480, "{followed} of 500");
    }

    #[test]
    fn as_many_as_are_asked_for_are_drawn_and_none_twice() {
        let rng = &mut crate::seed::Seed(3).rng();
        let mut values: Vec<usize> = (0..50).collect();
        shuffle_first(&mut values, 20, rng);
        assert_eq!(values.len(), 20);
        assert!(values.iter().any(|&value| value >= 20));
        let mut sorted = values.clone();
        sorted.sort_unstable();
        assert_ne!(sorted, values, "in random order");
        sorted.dedup();
        assert_eq!(sorted.len(), 20);
    }
}
