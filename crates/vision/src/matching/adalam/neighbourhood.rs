//! The matches around a seed, and those of them that one linear map explains: steps 3 to 5 of AdaLAM.
//!
//! Coordinates are relative to those of the seed, and the radius of the neighbourhood is 1 in either image.
//! So the map has four unknowns, and a wrong match comes within r of where the map says with probability r^2.
//!
//! Pairs are drawn as in PROSAC (O. Chum, J. Matas, CVPR 2005), clearest matches first and each pair only
//! once: the first two matches, then the third with either of them, then the fourth with each of the three. A
//! pair that contains the seed, or lies on a line with it, determines no map; it is skipped but counts as
//! drawn.

use nalgebra::{Matrix2, Vector2};

use super::{AdalamParams, Candidate};

/// Two matches determine a map if the sine of the angle between them in image a exceeds about this.
const MIN_ANGLE: f64 = 1e-4;

/// The matches around a seed, the clearest first.
pub(super) struct Neighbourhood {
    /// In image a, x and y.
    a: [Vec<f64>; 2],
    /// In image b, x and y.
    b: [Vec<f64>; 2],
    /// Which of them is the seed.
    seed: usize,
}

/// The matches that agree with a map.
struct Support {
    /// Number of inliers, without the matches that determine the map.
    inliers: usize,
    /// Number of inliers expected by chance.
    expected: f64,
    /// All matches that agree, including those that determine the map.
    members: Vec<usize>,
}

impl Neighbourhood {
    /// The `members` of `candidates` around a `seed`, within `reach` in the two images. `None` if the seed is
    /// not one of them, because its own numbers are not finite.
    pub(super) fn new(
        candidates: &[Candidate],
        seed: usize,
        members: &[usize],
        reach: [f64; 2],
    ) -> Option<Self> {
        let centre = &candidates[seed];
        let (mut a, mut b) = ([const { Vec::new() }; 2], [const { Vec::new() }; 2]);
        for &member in members {
            let at_a = (candidates[member].a - centre.a) / reach[0];
            let at_b = (candidates[member].b - centre.b) / reach[1];
            for axis in 0..2 {
                a[axis].push(at_a[axis]);
                b[axis].push(at_b[axis]);
            }
        }
        let seed = members.iter().position(|&member| member == seed)?;
        Some(Self { a, b, seed })
    }

    /// The matches that agree with the best map, in their order; none if chance may explain them.
    pub(super) fn inliers(&self, params: &AdalamParams) -> Vec<usize> {
        let mut best = self.best_of_samples(params);
        if params.refit {
            best = best.and_then(|best| {
                let map = self.fitted(&best.members)?;
                let mut excess = Vec::new();
                self.support(map, &[self.seed], 0, params, &mut excess)
            });
        }
        let is_significant =
            |best: &Support| best.inliers as f64 - best.expected >= f64::from(params.min_inliers);
        best.filter(is_significant)
            .map(|best| best.members)
            .unwrap_or_default()
    }

    /// The first map with most inliers among those of `samples` pairs.
    fn best_of_samples(&self, params: &AdalamParams) -> Option<Support> {
        let count = self.a[0].len();
        if count < params.min_inliers as usize {
            return None;
        }
        let mut excess = Vec::with_capacity(count);
        let mut best: Option<Support> = None;
        let pairs = (1..count).flat_map(|later| (0..later).map(move |earlier| (earlier, later)));
        for (i, j) in pairs.take(params.samples as usize) {
            let most = best.as_ref().map_or(0, |best| best.inliers);
            let better = self
                .through(i, j)
                .and_then(|map| self.support(map, &[self.seed, i, j], most, params, &mut excess));
            best = better.or(best);
        }
        best
    }

    /// The map from a to b through two matches, if they determine one.
    fn through(&self, i: usize, j: usize) -> Option<Matrix2<f64>> {
        let a = Matrix2::from_columns(&[self.at_a(i), self.at_a(j)]);
        let b = Matrix2::from_columns(&[self.at_b(i), self.at_b(j)]);
        let determinant = a.determinant();
        let determined = determinant.abs() > MIN_ANGLE * a.norm_squared();
        determined.then(|| b * adjugate(&a) / determinant)
    }

    /// The map with the least squared residuals over these `members`, if they determine one.
    fn fitted(&self, members: &[usize]) -> Option<Matrix2<f64>> {
        let (mut normal, mut moment) = (Matrix2::zeros(), Matrix2::zeros());
        for &member in members {
            let (a, b) = (self.at_a(member), self.at_b(member));
            normal += a * a.transpose();
            moment += b * a.transpose();
        }
        let determinant = normal.determinant();
        let trace = normal.trace();
        let determined = determinant > MIN_ANGLE * MIN_ANGLE * trace * trace;
        determined.then(|| moment * adjugate(&normal) / determinant)
    }

    /// The support of a map that is determined by the matches `fixed`; `None` unless it has more than `most`
    /// inliers and changes no length by too much. `excess` is working space.
    fn support(
        &self,
        map: Matrix2<f64>,
        fixed: &[usize],
        most: usize,
        params: &AdalamParams,
        excess: &mut Vec<f64>,
    ) -> Option<Support> {
        let others = self.a[0].len().checked_sub(fixed.len())?;
        if others <= most || !is_moderate(&map, params.max_stretch) {
            return None;
        }
        // The k nearest are inliers if each of them has a squared residual of at most k / (N t_c); so these are
        // measured in units of 1 / (N t_c).
        let unit = others as f64 * params.confidence;
        excess.clear();
        let [ax, ay] = &self.a;
        let [bx, by] = &self.b;
        for (((ax, ay), bx), by) in ax.iter().zip(ay).zip(bx).zip(by) {
            let x = map.m11 * ax + map.m12 * ay - bx;
            let y = map.m21 * ax + map.m22 * ay - by;
            excess.push((x * x + y * y) * unit);
        }
        for &fixed in fixed {
            excess[fixed] = f64::INFINITY;
        }
        let within = |bound: f64| excess.iter().filter(|&&excess| excess <= bound).count();
        // Starts from the largest number: no more than this can be inliers, so no inlier can be farther than
        // this number allows.
        let mut inliers = others;
        loop {
            let left = within(inliers as f64);
            if left <= most {
                return None;
            }
            if left == inliers {
                break;
            }
            inliers = left;
        }
        let bound = inliers as f64;
        let farthest = (excess.iter().copied())
            .filter(|&excess| excess <= bound)
            .fold(0.0, f64::max);
        let agrees = |&i: &usize| excess[i] <= bound || fixed.contains(&i);
        Some(Support {
            inliers,
            expected: farthest / params.confidence,
            members: (0..excess.len()).filter(agrees).collect(),
        })
    }

    fn at_a(&self, member: usize) -> Vector2<f64> {
        Vector2::new(self.a[0][member], self.a[1][member])
    }

    fn at_b(&self, member: usize) -> Vector2<f64> {
        Vector2::new(self.b[0][member], self.b[1][member])
    }
}

/// The adjugate: the inverse times the determinant.
fn adjugate(m: &Matrix2<f64>) -> Matrix2<f64> {
    Matrix2::new(m.m22, -m.m12, -m.m21, m.m11)
}

/// Whether a map changes no length by more than a factor `most`, that is, whether its singular values are
/// between `1 / most` and `most`.
pub(super) fn is_moderate(map: &Matrix2<f64>, most: f64) -> bool {
    // Sum and product of the squared singular values.
    let (sum, determinant) = (map.norm_squared(), map.determinant());
    let product = determinant * determinant;
    let half = 0.5 * sum;
    let apart = (half * half - product).max(0.0).sqrt();
    let squared = most * most;
    half + apart <= squared && (half - apart) * squared >= 1.0
}
