//! Maxima of quadratic fits, to refine keypoints of BRISK: over three by three pixels, and over three layers.

/// The least-squares quadratic over scores at `[y][x]` in -1, 0, 1: its maximum within the square,
/// as value, x and y.
///
/// Where the quadratic has no maximum the best corner is taken, and beyond the square the better
/// of the two nearest edges.
pub(super) fn quadratic_maximum(s: [[i32; 3]; 3]) -> [f32; 3] {
    let corners = s[0][0] + s[0][2] + s[2][0] + s[2][2];
    let (left, right) = (s[1][0], s[1][2]);
    let (above, below) = (s[0][1], s[2][1]);
    let middle = s[1][1];
    // 18 f(x, y) = xx x^2 + yy y^2 + x x + y y + xy x y + one
    let xx = 3 * (corners - 2 * middle + left - 2 * (above + below) + right);
    let yy = 3 * (corners - 2 * middle - 2 * (left + right) + above + below);
    let x = 3 * (s[0][2] + s[1][2] + s[2][2] - s[0][0] - s[1][0] - s[2][0]);
    let y = 3 * (s[2][0] + s[2][1] + s[2][2] - s[0][0] - s[0][1] - s[0][2]);
    let xy = 4 * (s[0][0] - s[0][2] - s[2][0] + s[2][2]);
    let one = -2 * (corners - 2 * (above + left + below + right) - 5 * middle);
    let determinant = 4 * xx * yy - xy * xy;
    if determinant == 0 {
        return [one as f32 / 18.0, 0.0, 0.0];
    }
    if determinant < 0 || xx >= 0 {
        // The first of equals is kept.
        let mut best = (i32::MIN, 0, 0);
        for (dx, dy) in [(1, 1), (-1, 1), (1, -1), (-1, -1)] {
            let slope = dx * x + dy * y + dx * dy * xy;
            if slope > best.0 {
                best = (slope, dx, dy);
            }
        }
        let value = (best.0 + xx + yy + one) as f32 / 18.0;
        return [value, best.1 as f32, best.2 as f32];
    }

    let value = |dx: f32, dy: f32| {
        let quadratic = xx as f32 * dx * dx + yy as f32 * dy * dy;
        (quadratic + x as f32 * dx + y as f32 * dy + xy as f32 * dx * dy + one as f32) / 18.0
    };
    let dx = (2 * yy * x - y * xy) as f32 / (-determinant) as f32;
    let dy = (2 * xx * y - x * xy) as f32 / (-determinant) as f32;
    if dx.abs() <= 1.0 && dy.abs() <= 1.0 {
        return [value(dx, dy), dx, dy];
    }
    // On the edge where one coordinate is +-1, the quadratic in the other one; the middle of the
    // square stands for an edge that was not left.
    let edge = |beyond: f32, slope: i32, curvature: i32| {
        let side = if beyond > 1.0 { 1 } else { -1 };
        let along = -((slope + side * xy) as f32) / (2 * curvature) as f32;
        (side as f32, along.clamp(-1.0, 1.0))
    };
    let on_x = if dx.abs() > 1.0 {
        edge(dx, y, yy)
    } else {
        (0.0, 0.0)
    };
    let on_y = if dy.abs() > 1.0 {
        edge(dy, x, xx)
    } else {
        (0.0, 0.0)
    };
    let (first, second) = (value(on_x.0, on_x.1), value(on_y.1, on_y.0));
    if first > second {
        [first, on_x.0, on_x.1]
    } else {
        [second, on_y.1, on_y.0]
    }
}

/// A parabola through the scores of three layers, over the scale relative to the middle one.
pub(super) struct ScaleFit {
    /// Relative scales between which the maximum is sought.
    range: [f32; 2],
    /// For the coefficient of each power, from the second down to the constant, the weights of
    /// the scores below, here and above.
    weights: [[i32; 3]; 3],
    /// What the weights are multiplied by.
    factor: f32,
}

/// Around the first layer. As in OpenCV, the guessed layer below is taken at half its scale (2/3 in the paper), and the
/// maximum is sought from 0.7 on.
pub(super) const FIRST: ScaleFit = ScaleFit {
    range: [0.7, 1.5],
    weights: [[2, -4, 2], [-5, 8, -3], [3, -3, 1]],
    factor: 1.0,
};

/// Around an octave: layers at 3/4 and 3/2 of its scale.
pub(super) const OCTAVE: ScaleFit = ScaleFit {
    range: [0.75, 1.5],
    weights: [[16, -24, 8], [-40, 54, -14], [24, -27, 6]],
    factor: 3.0,
};

/// Around an intra-octave: layers at 2/3 and 4/3 of its scale.
pub(super) const INTRA_OCTAVE: ScaleFit = ScaleFit {
    range: [2.0 / 3.0, 4.0 / 3.0],
    weights: [[9, -18, 9], [-21, 36, -15], [12, -16, 6]],
    factor: 2.0,
};

impl ScaleFit {
    /// The relative scale of the maximum, and the score there.
    pub(super) fn maximum(&self, below: f32, here: f32, above: f32) -> [f32; 2] {
        // In 1024ths of a grey level.
        let scores = [below, here, above].map(|score| (1024.0 * f64::from(score) + 0.5) as i32);
        let coefficient = |power: usize| -> i32 {
            self.weights[power]
                .iter()
                .zip(scores)
                .map(|(weight, score)| weight * score)
                .sum()
        };
        let (a, b, c) = (coefficient(0), coefficient(1), coefficient(2));
        let [low, high] = self.range;
        if a >= 0 {
            return if here >= below && here >= above {
                [1.0, here]
            } else if below >= here && below >= above {
                [low, below]
            } else {
                [high, above]
            };
        }
        let at = (-(b as f32) / (2 * a) as f32).clamp(low, high);
        let value = c as f32 + a as f32 * at * at + b as f32 * at;
        [at, value / (1024.0 * self.factor)]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_paraboloid_is_found_again() {
        let s = [[52, 66, 60], [76, 90, 84], [80, 94, 88]];
        // 90 - 10 x^2 + 4 x - 10 y^2 + 14 y
        let [value, x, y] = quadratic_maximum(s);
        assert!((x - 0.2).abs() < 1e-5 && (y - 0.7).abs() < 1e-5, "{x} {y}");
        assert!((value - 95.3).abs() < 1e-4, "{value}");
    }

    #[test]
    fn maxima_stay_in_the_square() {
        assert_eq!(quadratic_maximum([[5; 3]; 3]), [5.0, 0.0, 0.0]);
        let saddle = [[4, 0, 0], [0, 3, 0], [0, 0, 4]];
        let [_, x, y] = quadratic_maximum(saddle);
        assert_eq!((x, y), (1.0, 1.0));
        // 90 - 10 x^2 + 30 x - 10 y^2 + 4 y: at x = 1.5.
        let beyond = [[46, 76, 86], [60, 90, 110], [54, 84, 104]];
        let [_, x, y] = quadratic_maximum(beyond);
        assert!(x == 1.0 && y.abs() < 1.0, "{x} {y}");
    }

    #[test]
    fn scales_of_parabolas_are_found_again() {
        // 100 - 200 (s - 1.1)^2 at the relative scales of the layers.
        for (fit, scales) in [
            (OCTAVE, [0.75, 1.0, 1.5]),
            (INTRA_OCTAVE, [2.0 / 3.0, 1.0, 4.0 / 3.0]),
        ] {
            let [below, here, above] = scales.map(|s: f32| 100.0 - 200.0 * (s - 1.1) * (s - 1.1));
            let [scale, score] = fit.maximum(below, here, above);
            assert!(
                (scale - 1.1).abs() < 1e-3 && (score - 100.0).abs() < 0.01,
                "{scale} {score}"
            );
        }
        assert_eq!(OCTAVE.maximum(10.0, 10.0, 10.0), [1.0, 10.0]);
        assert_eq!(FIRST.maximum(60.0, 20.0, 40.0), [0.7, 60.0]);
    }
}
