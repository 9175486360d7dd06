//! Gradients of a row in polar form.

multiversioned! {
    /// Magnitude and direction of the central differences along a row (twice the derivative).
    ///
    /// `here` is the row with one more pixel at each end than `above` and `below`. Directions are
    /// in turns in `[0, 1]`, from the x axis UPWARDS (against the y axis), as SIFT counts them;
    /// the polynomial of [`turns`] errs by less than 0.00003 turns (0.011 degrees).
    ///
    /// # Panics
    /// If the lengths do not fit.
    pub fn polar_gradients(
        above: &[f32],
        here: &[f32],
        below: &[f32],
        magnitudes: &mut [f32],
        directions: &mut [f32],
    ) {
        let n = magnitudes.len();
        let (left, right) = (&here[..n], &here[2..n + 2]);
        let (above, below, directions) = (&above[..n], &below[..n], &mut directions[..n]);
        for i in 0..n {
            let dx = right[i] - left[i];
            let dy = above[i] - below[i];
            magnitudes[i] = dx.mul_add(dx, dy * dy).sqrt();
            directions[i] = turns(dy, dx);
        }
    }
}

/// The direction of the vector (x, y) in turns, in `[0, 1]`; 0 for the zero vector.
///
/// An odd polynomial of degree 7 on the first octant, with the published coefficients of OpenCV's
/// `fastAtan2`, so that histograms of directions agree with it.
#[inline(always)]
pub fn turns(y: f32, x: f32) -> f32 {
    const TURN: f32 = 0.5 / core::f32::consts::PI;
    const P1: f32 = 0.999_787_84 * TURN;
    const P3: f32 = -0.325_808_4 * TURN;
    const P5: f32 = 0.155_578_65 * TURN;
    const P7: f32 = -0.044_326_555 * TURN;
    let (ax, ay) = (x.abs(), y.abs());
    // As whole numbers, which have the same order: told by one question, both answers to the next would be
    // computed, division and all, to choose between them.
    let (bits_x, bits_y) = (ax.to_bits(), ay.to_bits());
    let (small, large) = (
        f32::from_bits(bits_x.min(bits_y)),
        f32::from_bits(bits_x.max(bits_y)),
    );
    let steep = ay > ax;
    let c = small / (large + f64::EPSILON as f32);
    let c2 = c * c;
    let a = P7.mul_add(c2, P5).mul_add(c2, P3).mul_add(c2, P1) * c;
    let a = if steep { 0.25 - a } else { a };
    let a = if x < 0.0 { 0.5 - a } else { a };
    if y < 0.0 { 1.0 - a } else { a }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn directions_are_within_the_error_of_the_polynomial() {
        for degrees in 0..360 {
            let angle = f64::from(degrees).to_radians();
            let (y, x) = (libm::sin(angle) as f32, libm::cos(angle) as f32);
            let error = turns(y, x) - degrees as f32 / 360.0;
            let error = error - error.round();
            assert!(error.abs() < 3e-5, "{degrees}: {error}");
        }
        assert_eq!(turns(0.0, 0.0), 0.0);
    }

    #[test]
    fn a_ramp_has_one_gradient() {
        let row = |y: f32| -> Vec<f32> { (0..23).map(|x| 3.0 * x as f32 - 4.0 * y).collect() };
        let (mut magnitudes, mut directions) = ([0.0; 21], [0.0; 21]);
        let (above, here, below) = (row(0.0), row(1.0), row(2.0));
        polar_gradients(
            &above[1..22],
            &here,
            &below[1..22],
            &mut magnitudes,
            &mut directions,
        );
        assert_eq!(magnitudes, [10.0; 21]);
        // Brighter to the right and upwards.
        assert!(
            directions.iter().all(|t| (t - 0.147_583_6).abs() < 3e-5),
            "{directions:?}"
        );
    }
}
