//! All real roots of a polynomial, by Descartes' rule of signs.
//!
//! Lane, Riesenfeld, "Bounds on a Polynomial", BIT 21, 1981; Collins, Akritas, "Polynomial Real
//! Root Isolation Using Descartes' Rule of Signs", SYMSAC 1976.
//!
//! With z = s / (1 - s), the half-line z > 0 becomes 0 < s < 1, and `sum c_i z^i` becomes, up to a positive
//! factor, a polynomial with the Bernstein coefficients `c_i / binomial(n, i)`. So no bound of the roots is
//! needed, and small and large roots are found in the same way. The number of sign changes in the Bernstein
//! coefficients of an interval exceeds its number of roots by an even number. Without a change there is no
//! root. With one change there is one root, which a safeguarded Newton iteration finds. With more changes the
//! interval is halved (de Casteljau); this only averages coefficients and hence loses no precision. Negative
//! roots are the positive roots of p(-z).
//!
//! A Sturm sequence isolates the same roots, but its remainders lose digits at degree 10. An eigenvalue
//! iteration also finds the complex roots and takes longer.

use super::Solutions;

/// Intervals are halved at most this often: two roots closer than `2^-32` (in s) count as one.
const MAX_DEPTH: u32 = 32;
/// Number of steps of pure Newton iteration. Roots of very different sizes slow it down, so after these steps
/// every other step halves the bracket.
const NEWTON_STEPS: usize = 50;
/// This number of steps is enough to find any root that `f64` can hold by halving alone.
const MAX_STEPS: usize = 2200;

/// The real roots of `c[0] + c[1] z + c[2] z^2 + ...`, positive ones first, to a relative
/// precision of 1e-10 or as good as the coefficients determine them.
///
/// Roots are told apart by `s = |z| / (1 + |z|)`. Roots of the same sign whose s is within `2^-31` of that of
/// another root, real or complex, may be lost or found as one root, whose s is right to `2^-32`. This applies
/// to all roots below 1e-10 or above 1e10. It also applies to roots whose distance is of the order of the
/// rounding errors. The zero polynomial, and one with coefficients that are not finite, have no roots here.
pub fn real_roots<const N: usize>(c: &[f64; N]) -> Solutions<f64, N> {
    let mut roots = Solutions::none();
    let scale = c.iter().fold(0.0_f64, |scale, c| scale.max(c.abs()));
    if scale == 0.0 || !c.iter().all(|c| c.is_finite()) {
        return roots;
    }
    let c = c.map(|c| c / scale);
    positive_roots(&c, &mut roots);
    let positive = roots.len();
    let mirrored = std::array::from_fn(|i| if i % 2 == 1 { -c[i] } else { c[i] });
    positive_roots(&mirrored, &mut roots);
    for root in &mut roots[positive..] {
        *root = -*root;
    }
    if c[0] == 0.0 && roots.len() + 1 < N {
        roots.push(0.0);
    }
    roots
}

fn positive_roots<const N: usize>(c: &[f64; N], roots: &mut Solutions<f64, N>) {
    let mut bernstein = *c;
    let mut binomial = 1.0;
    for (i, b) in bernstein.iter_mut().enumerate() {
        *b /= binomial;
        binomial *= (N - 1 - i) as f64 / (i + 1) as f64;
    }
    isolate(c, bernstein, 0.0, 1.0, 0, roots);
}

/// Finds the roots in the open interval `low < s < low + width`.
fn isolate<const N: usize>(
    c: &[f64; N],
    bernstein: [f64; N],
    low: f64,
    width: f64,
    depth: u32,
    roots: &mut Solutions<f64, N>,
) {
    let changes = sign_changes(&bernstein);
    // Rounding could invent roots beyond the degree, in pathological polynomials only.
    if changes == 0 || roots.len() + 1 >= N {
        return;
    }
    if depth == MAX_DEPTH {
        let s = low + width / 2.0;
        roots.push(s / (1.0 - s));
        return;
    }
    // Depth 0 is always halved, so that each interval lies on one side of z = 1.
    if changes == 1 && depth > 0 {
        let rising = bernstein
            .iter()
            .find(|&&b| b != 0.0)
            .is_some_and(|&b| b < 0.0);
        roots.push(root_in(c, low, low + width, rising));
        return;
    }
    let (left, right) = halve(bernstein);
    let middle = low + width / 2.0;
    isolate(c, left, low, width / 2.0, depth + 1, roots);
    if right[0] == 0.0 && roots.len() + 1 < N {
        roots.push(middle / (1.0 - middle));
    }
    isolate(c, right, middle, width / 2.0, depth + 1, roots);
}

fn sign_changes(values: &[f64]) -> usize {
    let mut changes = 0;
    let mut last = 0.0;
    for &value in values {
        if value != 0.0 {
            changes += usize::from(last != 0.0 && (value < 0.0) != (last < 0.0));
            last = value;
        }
    }
    changes
}

/// Bernstein coefficients of the two halves of an interval (de Casteljau).
fn halve<const N: usize>(mut right: [f64; N]) -> ([f64; N], [f64; N]) {
    let left = std::array::from_fn(|level| {
        let first = right[0];
        for i in 0..N - 1 - level {
            right[i] = 0.5 * (right[i] + right[i + 1]);
        }
        first
    });
    (left, right)
}

/// The only root with `low < s < high`. The polynomial goes from - to + if `rising`.
fn root_in<const N: usize>(c: &[f64; N], low: f64, high: f64, rising: bool) -> f64 {
    if high <= 0.5 {
        newton(
            &c.iter().rev(),
            low / (1.0 - low),
            high / (1.0 - high),
            rising,
        )
    } else {
        // 1 / z is the root of the polynomial with the coefficients in reverse order.
        1.0 / newton(&c.iter(), (1.0 - high) / high, (1.0 - low) / low, !rising)
    }
}

/// Newton's method inside a shrinking bracket; `c` starts at the highest power.
fn newton<'a>(
    c: &(impl Iterator<Item = &'a f64> + Clone),
    mut low: f64,
    mut high: f64,
    rising: bool,
) -> f64 {
    let mut x = f64::midpoint(low, high);
    for step in 0..MAX_STEPS {
        let (mut value, mut slope) = (0.0, 0.0);
        for c in c.clone() {
            slope = slope * x + value;
            value = value * x + c;
        }
        if (value < 0.0) == rising {
            low = x;
        } else {
            high = x;
        }
        let mut next = x - value / slope;
        let is_late = step >= NEWTON_STEPS && step % 2 == 0;
        // Also true for NaN.
        if is_late || !(next >= low && next <= high) {
            next = f64::midpoint(low, high);
        }
        let step = (next - x).abs();
        x = next;
        // Convergence is quadratic: the error left is about the square of the step.
        if step <= 1e-10 * x.abs() {
            break;
        }
    }
    x
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::seed::{Rng, Seed};
    use crate::simd::roots_of_each;

    /// Coefficients of the product of (z - root).
    fn expand<const N: usize>(roots: &[f64]) -> [f64; N] {
        let mut c = [0.0; N];
        c[0] = 1.0;
        for (degree, root) in roots.iter().enumerate() {
            for i in (0..=degree).rev() {
                c[i + 1] += c[i];
                c[i] *= -root;
            }
        }
        c
    }

    fn sorted<const N: usize>(c: &[f64; N]) -> Vec<f64> {
        let mut roots = real_roots(c).to_vec();
        roots.sort_by(f64::total_cmp);
        roots
    }

    #[test]
    fn roots_of_every_size_come_back() {
        let expected = [-2000.0, -3.5, -1.0, -1e-3, 0.25, 0.5, 1.0, 7.0, 1e4, 1e5];
        let found = sorted(&expand::<11>(&expected));
        assert_eq!(found.len(), 10, "{found:?}");
        for (found, expected) in found.iter().zip(expected) {
            assert!((found / expected - 1.0).abs() < 1e-9, "{found} {expected}");
        }
    }

    /// Ten roots of both signs and of sizes from 1e-8 to 1e8, those of one sign at least a tenth apart.
    fn of_many_sizes(rng: &mut Rng) -> [f64; 10] {
        loop {
            let mut roots: [f64; 10] = std::array::from_fn(|_| {
                let sign = [-1.0, 1.0][rng.below(2) as usize];
                sign * libm::exp10(16.0 * rng.uniform() - 8.0)
            });
            roots.sort_by(f64::total_cmp);
            let are_apart = |pair: &[f64]| {
                let ratio = pair[1] / pair[0];
                !(1.0 / 1.1..1.1).contains(&ratio)
            };
            if roots.windows(2).all(are_apart) {
                return roots;
            }
        }
    }

    #[test]
    fn roots_of_very_different_sizes_come_back() {
        let mut rng = Seed(11).rng();
        for _ in 0..300 {
            let expected = of_many_sizes(&mut rng);
            let found = sorted(&expand::<11>(&expected));
            assert_eq!(found.len(), 10, "{found:?} {expected:?}");
            for (found, expected) in found.iter().zip(expected) {
                assert!((found / expected - 1.0).abs() < 1e-9, "{found} {expected}");
            }
        }
    }

    #[test]
    fn roots_that_are_too_close_to_be_told_apart_are_found_as_one_between_them() {
        // In s they are 1e-10 apart.
        let found = sorted(&expand::<4>(&[1e-10, 2e-10, 5.0]));
        assert!(matches!(found.len(), 2 | 3), "{found:?}");
        assert!((found[0] - 1.5e-10).abs() < 2.4e-10);
        assert!((found[found.len() - 1] - 5.0).abs() < 1e-9);
    }

    #[test]
    fn complex_roots_are_not_found() {
        // (z^2 + 1)(z^2 - 2 z + 1.0001)(z - 2)
        let found = sorted(&[-2.0002, 5.0001, -6.0002, 6.0001, -4.0, 1.0]);
        assert_eq!(found.len(), 1);
        assert!((found[0] - 2.0).abs() < 1e-12);
    }

    #[test]
    fn number_of_roots_agrees_with_how_often_a_fine_scan_changes_sign() {
        let mut rng = Seed(3).rng();
        for _ in 0..200 {
            let c: [f64; 11] = std::array::from_fn(|_| rng.normal());
            let value = |s: f64| {
                // (1 - |s|)^10 p(s / (1 - |s|)): the whole line as -1 < s < 1.
                (0..11).fold(0.0, |sum, i| {
                    let powers =
                        (0..10).fold(1.0, |p, k| p * if k < i { s } else { 1.0 - s.abs() });
                    sum + c[i] * powers
                })
            };
            let scanned = (-9999..9999)
                .filter(|&k| value(f64::from(k) / 1e4) * value(f64::from(k + 1) / 1e4) < 0.0)
                .count();
            let found = real_roots(&c).len();
            assert!(found >= scanned && found % 2 == scanned % 2, "{c:?}");
        }
    }

    #[test]
    fn roots_at_zero_and_one_are_found() {
        let found = sorted(&[0.0, -1.0, 0.0, 1.0]);
        assert_eq!(found.len(), 3);
        for (found, expected) in found.iter().zip([-1.0, 0.0, 1.0]) {
            assert!((found - expected).abs() < 1e-9, "{found} {expected}");
        }
    }

    #[test]
    fn what_has_no_roots_has_none() {
        assert!(real_roots(&[0.0; 11]).is_empty());
        assert!(real_roots(&[1.0, f64::NAN, 1.0]).is_empty());
        assert!(real_roots(&[1.0, f64::INFINITY, 1.0]).is_empty());
        assert!(real_roots(&[5.0]).is_empty());
        assert!(real_roots(&[1.0, 0.0, 0.0, 0.0]).is_empty());
        assert_eq!(real_roots(&[1.0, 0.0, -1.0, 0.0, 0.0]).len(), 2);
    }

    #[test]
    fn a_double_root_is_found_once_or_twice() {
        let found = sorted(&[1.0, -2.0, 1.0]);
        assert!(matches!(found.len(), 1 | 2), "{found:?}");
        assert!((found[0] - 1.0).abs() < 1e-7);
    }

    #[test]
    fn the_kernel_finds_for_eight_polynomials_what_each_has_alone() {
        let mut rng = Seed(7).rng();
        for round in 0..500 {
            let mut polynomials = [[0.0; 11]; 8];
            for x in polynomials.as_flattened_mut() {
                *x = rng.normal();
            }
            // Ten real roots, a double one, roots of many sizes, a lower degree, a root of 0, and what has none.
            let mut known: [f64; 10] = std::array::from_fn(|_| 2.0 * rng.normal());
            if round % 2 == 0 {
                (known[0], known[1]) = (0.5, 0.5);
            }
            polynomials[0] = expand(&known);
            polynomials[1][10] = 0.0;
            polynomials[5] = expand(&of_many_sizes(&mut rng));
            polynomials[2][0] = 0.0;
            polynomials[3] = [0.0; 11];
            polynomials[4][round % 11] = [f64::NAN, f64::INFINITY][round % 2];
            for (found, polynomial) in roots_of_each(&polynomials).iter().zip(&polynomials) {
                assert_eq!(
                    found[..],
                    real_roots(polynomial)[..],
                    "{round}: {polynomial:?}"
                );
            }
        }
    }
}
