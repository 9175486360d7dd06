//! Student's t distribution ("The Probable Error of a Mean", Biometrika 6(1), 1908): how many standard errors a mean of
//! few values may be off.
//!
//! Formulas of Abramowitz and Stegun, "Handbook of Mathematical Functions".

/// The chance that an interval leaves out the true score, and that of calling a difference certain where there is none.
pub(super) const ALPHA: f64 = 0.05;

/// The chance that t, with so many degrees of freedom, is farther from 0 than `t`: the finite series 26.7.3 and
/// 26.7.4.
pub(super) fn beyond(t: f64, freedom: usize) -> f64 {
    if t.is_infinite() {
        return 0.0;
    }
    let angle = libm::atan(t / (freedom as f64).sqrt());
    let (sin, cos) = (libm::sin(angle), libm::cos(angle));
    let odd = freedom % 2 == 1;
    // 1 + a1 cos^2 + a1 a2 cos^4 + ..., up to cos^(freedom - 2) or, of odd ones, cos^(freedom - 3).
    let (mut term, mut series) = (1.0, 0.0);
    let mut power = if odd { 3 } else { 2 };
    while power <= freedom {
        series += term;
        term *= cos * cos * (power - 1) as f64 / power as f64;
        power += 2;
    }
    let within = if odd {
        std::f64::consts::FRAC_2_PI * (angle + sin * cos * series)
    } else {
        sin * series
    };
    (1.0 - within).max(0.0)
}

/// The t that is exceeded on either side with a chance of 5 %: by bisection, and for many degrees of freedom by the
/// expansion 26.7.5, which is exact to eight digits there.
pub(super) fn quantile(freedom: usize) -> f64 {
    /// That of the normal distribution.
    const NORMAL: f64 = 1.959_963_984_540_054;
    if freedom > 200 {
        let (n, x) = (freedom as f64, NORMAL);
        let x2 = x * x;
        let first = (x2 + 1.0) * x / 4.0;
        let second = ((5.0 * x2 + 16.0) * x2 + 3.0) * x / 96.0;
        let third = (((3.0 * x2 + 19.0) * x2 + 17.0) * x2 - 15.0) * x / 384.0;
        return x + first / n + second / (n * n) + third / (n * n * n);
    }
    let (mut low, mut high) = (NORMAL, 13.0);
    // Until the middle is one of the ends.
    loop {
        let middle = 0.5 * (low + high);
        if middle <= low || middle >= high {
            return middle;
        }
        if beyond(middle, freedom) > ALPHA {
            low = middle;
        } else {
            high = middle;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const TABLES: [(usize, f64); 10] = [
        (1, 12.706_205),
        (2, 4.302_653),
        (3, 3.182_446),
        (4, 2.776_445),
        (5, 2.570_582),
        (9, 2.262_157),
        (10, 2.228_139),
        (29, 2.045_230),
        (120, 1.979_930),
        (100_001, 1.959_988),
    ];

    #[test]
    fn t_has_the_quantiles_of_tables() {
        for (freedom, t) in TABLES {
            let p = beyond(t, freedom);
            assert!((p - 0.05).abs() < 3e-7, "{freedom}: {p}");
            assert!((quantile(freedom) - t).abs() < 1e-6, "{freedom}");
        }
        assert_eq!(beyond(0.0, 7), 1.0);
        assert_eq!(beyond(f64::INFINITY, 7), 0.0);
    }

    #[test]
    fn the_expansion_continues_the_series() {
        for freedom in [201, 202, 500] {
            assert!(
                (beyond(quantile(freedom), freedom) - 0.05).abs() < 1e-9,
                "{freedom}"
            );
        }
    }
}
