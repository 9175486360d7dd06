//! The relative poses that five matches allow: up to ten essential matrices.
//!
//! Nistér, "An Efficient Solution to the Five-Point Relative Pose Problem", IEEE Transactions on
//! Pattern Analysis and Machine Intelligence 26(6), 2004.
//!
//! 1. Each match gives one linear equation `b^T E a = 0` (eq. 5). The four-dimensional null space
//!    of the five equations, `E = x X + y Y + z Z + W` (eq. 6), comes from a Householder QR.
//! 2. E is essential if and only if `E E^T E - trace(E E^T) E / 2 = 0` (eq. 4), which implies
//!    `det E = 0` (eq. 3): ten cubic equations in x, y, z, a 10 x 20 matrix (table in sec. 3.1).
//! 3. Gaussian elimination with pivoting, of the rows that are needed, leaves the matrix B(z) of
//!    polynomials with `B(z) (x, y, 1)^T = 0` (eqs. 7-16).
//! 4. det B(z) has degree 10 (eqs. 17-21). [`real_roots`] finds all its real roots.
//! 5. For each z, the null vector of B(z) gives (x, y, 1), homogeneously, so nothing overflows
//!    where the coordinates are large.
//! 6. A few Gauss-Newton steps on step 2's equations remove what rounding did in steps 3 to 5.
//!    Candidates that do not come to satisfy them are dropped.
//!
//! | symbol | constant | value | source |
//! | --- | --- | --- | --- |
//! | residual worth a polishing step | `POLISHED` | 1e-14 | ours |
//! | largest residual of a solution | `ACCEPTED` | 1e-9 | ours |
//!
//! *Choices the paper leaves open*: the null space (the paper: any; we: orthonormal), the root
//! finder (the paper: Sturm sequences; see [`real_roots`]), polishing, and what to do with samples
//! that do not determine five equations: coinciding matches, and points on one line in both
//! images, have no solutions here.
//!
//! *Measured* (test `failure_rate`): of 100,000 random well-posed problems, 5 come back without
//! the true matrix within 1e-6; the median error is 7e-15 and the mean number of solutions 4.79.
//! About 4.3 microseconds per sample on a 2021 server core, roots half of it.

use nalgebra::{Matrix3, Matrix4, Point2, Vector3, Vector4};

use super::null_space::{Flat, null_space};
use super::{Solutions, real_roots};
use crate::geometry::epipolar::null_vector;

/// Residuals of unit-norm matrices below this are as good as rounding lets them be.
const POLISHED: f64 = 1e-14;
/// Candidates whose residual stays above this are no solutions.
const ACCEPTED: f64 = 1e-9;
/// Polishing converges quadratically: what needs more steps is not going to converge.
const MAX_POLISHING_STEPS: usize = 5;

/// All essential matrices with `b[i]^T E a[i] = 0` for five matches at depth 1, of Frobenius norm
/// 1; the sign is arbitrary.
///
/// There are none where the matches are degenerate or not finite.
pub fn five_point(a: &[Point2<f64>; 5], b: &[Point2<f64>; 5]) -> Solutions<Matrix3<f64>, 10> {
    let mut solutions = Solutions::none();
    let Some(basis) = null_space::<5, 4>(a, b) else {
        return solutions;
    };
    let Some(reduced) = eliminate(constraints(&basis)) else {
        return solutions;
    };
    let rows = reduced_polynomials(&reduced);
    for &z in real_roots(&determinant(&rows)).iter() {
        if let Some(essential) = polish(&basis, back_substitute(&rows, z)) {
            solutions.push(essential);
        }
    }
    solutions
}

/// A polynomial of degree 1 in x, y, z: coefficients of x, y, z, 1.
type Linear = [f64; 4];
/// A polynomial of degree 2: x^2, xy, xz, x, y^2, yz, y, z^2, z, 1.
type Quadratic = [f64; 10];
/// A polynomial of degree 3: x^3, y^3, x^2 y, x y^2, x^2 z, x^2, y^2 z, y^2, xyz, xy | x z^2, xz,
/// x, y z^2, yz, y, z^3, z^2, z, 1. The first ten are eliminated.
type Cubic = [f64; 20];

/// The ten cubic equations that make `x X + y Y + z Z + W` essential.
fn constraints(basis: &[Flat; 4]) -> [Cubic; 10] {
    let e: [Linear; 9] = std::array::from_fn(|i| std::array::from_fn(|k| basis[k][i]));
    // E E^T - trace(E E^T) I / 2, then times E.
    let gram = |i: usize, j: usize| -> Quadratic {
        sum((0..3).map(|k| multiply_linear(&e[3 * i + k], &e[3 * j + k])))
    };
    let (g00, g01, g02) = (gram(0, 0), gram(0, 1), gram(0, 2));
    let (g11, g12, g22) = (gram(1, 1), gram(1, 2), gram(2, 2));
    let half_trace: Quadratic = std::array::from_fn(|i| 0.5 * (g00[i] + g11[i] + g22[i]));
    let lambda = [
        [subtract(&g00, &half_trace), g01, g02],
        [g01, subtract(&g11, &half_trace), g12],
        [g02, g12, subtract(&g22, &half_trace)],
    ];
    let minor = |i: usize, j: usize| -> Quadratic {
        subtract(
            &multiply_linear(&e[3 + i], &e[6 + j]),
            &multiply_linear(&e[3 + j], &e[6 + i]),
        )
    };
    std::array::from_fn(|row| {
        if row < 9 {
            let (i, j) = (row / 3, row % 3);
            sum((0..3).map(|k| multiply_quadratic(&lambda[i][k], &e[3 * k + j])))
        } else {
            sum((0..3).map(|k| multiply_quadratic(&minor((k + 1) % 3, (k + 2) % 3), &e[k])))
        }
    })
}

fn sum<const N: usize>(polynomials: impl Iterator<Item = [f64; N]>) -> [f64; N] {
    polynomials.fold([0.0; N], |sum, p| std::array::from_fn(|i| sum[i] + p[i]))
}

fn subtract<const N: usize>(p: &[f64; N], q: &[f64; N]) -> [f64; N] {
    std::array::from_fn(|i| p[i] - q[i])
}

#[rustfmt::skip]
fn multiply_linear(p: &Linear, q: &Linear) -> Quadratic {
    [
        p[0] * q[0], p[0] * q[1] + p[1] * q[0], p[0] * q[2] + p[2] * q[0], p[0] * q[3] + p[3] * q[0],
        p[1] * q[1], p[1] * q[2] + p[2] * q[1], p[1] * q[3] + p[3] * q[1],
        p[2] * q[2], p[2] * q[3] + p[3] * q[2],
        p[3] * q[3],
    ]
}

#[rustfmt::skip]
fn multiply_quadratic(p: &Quadratic, q: &Linear) -> Cubic {
    [
        p[0] * q[0],                             // x^3
        p[4] * q[1],                             // y^3
        p[0] * q[1] + p[1] * q[0],               // x^2 y
        p[1] * q[1] + p[4] * q[0],               // x y^2
        p[0] * q[2] + p[2] * q[0],               // x^2 z
        p[0] * q[3] + p[3] * q[0],               // x^2
        p[4] * q[2] + p[5] * q[1],               // y^2 z
        p[4] * q[3] + p[6] * q[1],               // y^2
        p[1] * q[2] + p[2] * q[1] + p[5] * q[0], // xyz
        p[1] * q[3] + p[3] * q[1] + p[6] * q[0], // xy
        p[2] * q[2] + p[7] * q[0],               // x z^2
        p[2] * q[3] + p[3] * q[2] + p[8] * q[0], // xz
        p[3] * q[3] + p[9] * q[0],               // x
        p[5] * q[2] + p[7] * q[1],               // y z^2
        p[5] * q[3] + p[6] * q[2] + p[8] * q[1], // yz
        p[6] * q[3] + p[9] * q[1],               // y
        p[7] * q[2],                             // z^3
        p[7] * q[3] + p[8] * q[2],               // z^2
        p[8] * q[3] + p[9] * q[2],               // z
        p[9] * q[3],                             // 1
    ]
}

/// Right half of the last six rows after Gauss-Jordan elimination: those that start with x^2 z,
/// x^2, y^2 z, y^2, xyz, xy (e to j in the paper). The rows above them are never needed, so the
/// elimination upwards stops there.
fn eliminate(mut m: [Cubic; 10]) -> Option<[[f64; 10]; 6]> {
    for k in 0..10 {
        let pivot = (k..10).fold(k, |best, row| {
            if m[row][k].abs() > m[best][k].abs() {
                row
            } else {
                best
            }
        });
        if m[pivot][k] == 0.0 || m[pivot][k].is_nan() {
            return None;
        }
        m.swap(k, pivot);
        let (head, tail) = m.split_at_mut(k + 1);
        let pivot_row = &head[k];
        for row in tail {
            let factor = row[k] / pivot_row[k];
            for (x, p) in row[k..].iter_mut().zip(&pivot_row[k..]) {
                *x -= factor * p;
            }
        }
    }
    let mut reduced: [[f64; 10]; 6] =
        std::array::from_fn(|i| std::array::from_fn(|j| m[4 + i][10 + j]));
    for i in (0..6).rev() {
        let (head, done) = reduced.split_at_mut(i + 1);
        let row = &mut head[i];
        for (offset, below) in done.iter().enumerate() {
            let factor = m[4 + i][4 + i + 1 + offset];
            for (x, b) in row.iter_mut().zip(below) {
                *x -= factor * b;
            }
        }
        let diagonal = m[4 + i][4 + i];
        *row = row.map(|x| x / diagonal);
    }
    Some(reduced)
}

/// A row of B(z): polynomials in z, lowest power first, that multiply x, y and 1.
struct Row {
    x: [f64; 4],
    y: [f64; 4],
    one: [f64; 5],
}

/// The rows k, l, m of B(z): `e - z f`, `g - z h` and `i - z j`, where the monomials on the left
/// cancel (eqs. 11-13).
fn reduced_polynomials(reduced: &[[f64; 10]; 6]) -> [Row; 3] {
    std::array::from_fn(|i| {
        let (e, f) = (&reduced[2 * i], &reduced[2 * i + 1]);
        Row {
            x: [e[2], e[1] - f[2], e[0] - f[1], -f[0]],
            y: [e[5], e[4] - f[5], e[3] - f[4], -f[3]],
            one: [e[9], e[8] - f[9], e[7] - f[8], e[6] - f[7], -f[6]],
        }
    })
}

/// det B(z), lowest power first.
fn determinant([k, l, m]: &[Row; 3]) -> [f64; 11] {
    let mut det = [0.0; 11];
    for (one, p, q) in [(&k.one, l, m), (&l.one, m, k), (&m.one, k, l)] {
        let mut minor = [0.0; 7];
        for i in 0..4 {
            for j in 0..4 {
                minor[i + j] += p.x[i] * q.y[j] - p.y[i] * q.x[j];
            }
        }
        for (i, one) in one.iter().enumerate() {
            for (j, minor) in minor.iter().enumerate() {
                det[i + j] += one * minor;
            }
        }
    }
    det
}

/// (x, y, z, 1) up to scale for a root z: the null vector of B(z).
fn back_substitute(rows: &[Row; 3], z: f64) -> Vector4<f64> {
    let at = |p: &[f64]| p.iter().rev().fold(0.0, |value, c| value * z + c);
    // Any two rows will do.
    let null = null_vector(
        rows.each_ref()
            .map(|row| Vector3::new(at(&row.x), at(&row.y), at(&row.one))),
    );
    Vector4::new(null.x, null.y, z * null.z, null.z)
}

/// Makes `x X + y Y + z Z + w W` satisfy eq. 4 to rounding; `None` where that does not succeed.
fn polish(basis: &[Flat; 4], start: Vector4<f64>) -> Option<Matrix3<f64>> {
    let basis = basis.map(|b| Matrix3::from_row_slice(&b));
    // The basis is orthonormal, so a unit vector of coordinates is a matrix of norm 1.
    let mut at = start / start.norm();
    let mut steps = 0;
    loop {
        let e: Matrix3<f64> = (0..4).map(|i| basis[i] * at[i]).sum();
        let gram = e * e.transpose();
        let residual = gram * e - e * (0.5 * gram.trace());
        let size = residual.norm();
        if size < POLISHED || steps == MAX_POLISHING_STEPS {
            return (size < ACCEPTED).then_some(e);
        }
        // A candidate this far off is no root at all.
        if size > 0.1 || size.is_nan() {
            return None;
        }
        steps += 1;
        let ete = e.transpose() * e;
        let derivatives = basis.map(|d| {
            d * ete + (e * d.transpose()) * e + gram * d - e * e.dot(&d) - d * (0.5 * gram.trace())
        });
        // Normal equations, plus one equation that forbids a change of length.
        let normal = Matrix4::from_fn(|i, j| derivatives[i].dot(&derivatives[j]) + at[i] * at[j]);
        let gradient = Vector4::from_fn(|i, _| derivatives[i].dot(&residual));
        at -= normal.cholesky()?.solve(&gradient);
        at /= at.norm();
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::{Rotation3, Unit};

    use super::*;
    use crate::seed::{Rng, Seed};

    struct Scene {
        essential: Matrix3<f64>,
        a: [Point2<f64>; 5],
        b: [Point2<f64>; 5],
    }

    /// Two cameras with 90 degrees of view, up to 60 degrees apart, one baseline long, and points
    /// at 1 to 10 baselines; drawn again until all points are visible in both.
    fn draw(rng: &mut Rng) -> Scene {
        loop {
            let mut direction = || Unit::new_normalize(Vector3::from_fn(|_, _| rng.normal()));
            let (axis, translation) = (direction(), direction().into_inner());
            let rotation = Rotation3::from_axis_angle(&axis, rng.uniform() * 60_f64.to_radians());
            let mut a = [Point2::origin(); 5];
            let mut b = a;
            for i in 0..5 {
                let depth = 1.0 + 9.0 * rng.uniform();
                a[i] = Point2::new(2.0 * rng.uniform() - 1.0, 2.0 * rng.uniform() - 1.0);
                let x = rotation * (a[i].to_homogeneous() * depth) + translation;
                b[i] = if x.z > 0.1 {
                    Point2::new(x.x / x.z, x.y / x.z)
                } else {
                    Point2::new(f64::INFINITY, 0.0)
                };
            }
            if b.iter().all(|b| b.x.abs() < 1.0 && b.y.abs() < 1.0) {
                let essential = (translation.cross_matrix() * rotation.matrix()).normalize();
                return Scene { essential, a, b };
            }
        }
    }

    fn distance(p: &Matrix3<f64>, q: &Matrix3<f64>) -> f64 {
        (p - q).norm().min((p + q).norm())
    }

    /// Distance from the true matrix to the nearest solution.
    fn error(scene: &Scene) -> f64 {
        five_point(&scene.a, &scene.b)
            .iter()
            .map(|e| distance(e, &scene.essential))
            .fold(f64::INFINITY, f64::min)
    }

    /// Asserts that what is returned solves both sets of equations.
    fn assert_solved(a: &[Point2<f64>; 5], b: &[Point2<f64>; 5]) {
        for e in five_point(a, b).iter() {
            assert!((e.norm() - 1.0).abs() < 1e-12);
            for (a, b) in a.iter().zip(b) {
                let (a, b) = (a.to_homogeneous(), b.to_homogeneous());
                assert!(b.dot(&(e * a)).abs() < 1e-13 * a.norm() * b.norm());
            }
            let singular = e.singular_values();
            assert!(
                (singular[0] - singular[1]).abs() < 1e-8 && singular[2] < 1e-8,
                "{singular}"
            );
        }
    }

    #[test]
    fn the_true_matrix_is_among_the_solutions() {
        let mut rng = Seed(1).rng();
        for _ in 0..2000 {
            let scene = draw(&mut rng);
            assert_solved(&scene.a, &scene.b);
            assert!(error(&scene) < 1e-9, "{}", error(&scene));
        }
    }

    #[test]
    #[ignore = "measures; run with --release --ignored --nocapture"]
    fn failure_rate() {
        const DRAWS: usize = 100_000;
        let mut rng = Seed(1).rng();
        let scenes: Vec<Scene> = (0..DRAWS).map(|_| draw(&mut rng)).collect();
        let mut errors: Vec<f64> = scenes.iter().map(error).collect();
        errors.sort_by(f64::total_cmp);
        let beyond = |limit: f64| errors.iter().filter(|&&e| e.is_nan() || e > limit).count();
        let counts: Vec<usize> = (scenes.iter())
            .map(|s| five_point(&s.a, &s.b).len())
            .collect();
        println!(
            "of {DRAWS}: error above 1e-6 in {}, 1e-9 in {}, median {:.1e}; {:.2} solutions, odd in {}",
            beyond(1e-6),
            beyond(1e-9),
            errors[DRAWS / 2],
            counts.iter().sum::<usize>() as f64 / DRAWS as f64,
            counts.iter().filter(|&n| n % 2 == 1).count(),
        );
        // The fastest of many short batches is what the solver takes when nothing interferes.
        let fastest = scenes.chunks(500).map(|batch| {
            let start = std::time::Instant::now();
            for scene in batch {
                std::hint::black_box(five_point(&scene.a, &scene.b));
            }
            start.elapsed() / 500
        });
        println!("fastest batch: {:?} per sample", fastest.min());
        assert!(beyond(1e-6) <= 10);
    }

    #[test]
    fn points_on_a_plane_are_no_obstacle() {
        let mut rng = Seed(2).rng();
        let rotation = Rotation3::from_euler_angles(0.1, -0.2, 0.05);
        let translation = Vector3::new(0.6, 0.0, 0.8);
        for _ in 0..200 {
            let a = [(); 5].map(|()| Point2::new(rng.uniform() - 0.5, rng.uniform() - 0.5));
            let b = a.map(|a| {
                let x = rotation * (a.to_homogeneous() * (4.0 / (1.0 + 0.3 * a.x))) + translation;
                Point2::new(x.x / x.z, x.y / x.z)
            });
            let essential = (translation.cross_matrix() * rotation.matrix()).normalize();
            assert!(error(&Scene { essential, a, b }) < 1e-6);
        }
    }

    #[test]
    fn a_pure_rotation_does_not_break_it() {
        let mut rng = Seed(3).rng();
        let rotation = Rotation3::from_euler_angles(0.1, -0.2, 0.05);
        for _ in 0..200 {
            let a = [(); 5].map(|()| Point2::new(rng.uniform() - 0.5, rng.uniform() - 0.5));
            let b = a.map(|a| {
                let x = rotation * a.to_homogeneous();
                Point2::new(x.x / x.z, x.y / x.z)
            });
            assert_solved(&a, &b);
        }
    }

    #[test]
    fn degenerate_samples_have_no_solutions() {
        let mut rng = Seed(4).rng();
        let good = draw(&mut rng);
        let with = |point: Point2<f64>| {
            let mut a = good.a;
            a[3] = point;
            a
        };
        let line = std::array::from_fn(|i| Point2::new(0.1 * i as f64, 0.3 - 0.2 * i as f64));
        let other = std::array::from_fn(|i| Point2::new(0.4, 0.1 * (i * i) as f64));
        let equal = [Point2::new(0.1, 0.2); 5];
        let (mut twice_a, mut twice_b) = (good.a, good.b);
        (twice_a[4], twice_b[4]) = (twice_a[0], twice_b[0]);
        for (a, b) in [
            (equal, equal),
            (line, other),
            (twice_a, twice_b),
            (with(Point2::new(f64::NAN, 0.0)), good.b),
            (with(Point2::new(0.0, f64::INFINITY)), good.b),
            (with(Point2::new(1e200, 0.0)), good.b.map(|b| b * 1e200)),
        ] {
            assert!(five_point(&a, &b).is_empty(), "{a:?} {b:?}");
        }
    }
}
