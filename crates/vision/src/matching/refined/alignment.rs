//! The place in image `b` where the neighbourhood of a point of image `a` is found, by least squares.
//!
//! *How it works.* `T(g)` is the window of `a` at the places `g` of its samples, about its middle, and `I(p + M g)` what an
//! affine map finds of it in `b`. Both are taken less their mean and divided by their standard deviation, so that
//! neither brightness nor contrast counts. The sum of `w(g) (T(g) - I(p + M g))^2`, with a Gaussian weight `w`, becomes
//! smaller in Gauss-Newton steps. In the inverse compositional form (Baker and Matthews, 2004, section 3.2) a step is found for
//! the window of `a`, and its inverse put before the map. So gradients and normal equations are those of `a` and are
//! computed once. What a change of brightness or contrast explains is taken out of the gradients (Bartoli, "Groupwise
//! Geometric and Photometric Direct Image Registration", PAMI 30(12), 2008).

use nalgebra::{Cholesky, Matrix2, Matrix6, Point2, Vector2, Vector6};

use super::window::Piece;
use crate::image::GrayImage;
use crate::simd::{
    ALIGNED_REACH, ALIGNED_SIDE, STEP_PARAMETERS, Samples, StepEquations, normalize_window,
    product_of_windows, sample_window, sample_with_gradients, step_equations, step_sums,
};

/// Standard deviation of the weights, in samples.
const SPREAD: f32 = 0.6 * ALIGNED_REACH as f32;

/// Largest ratio of the scales of the two images.
const SCALES: f64 = 4.0;

/// Least standard deviation of a window, in grey levels: less is noise.
const CONTRAST: f32 = 1.0;

/// Farthest pixel of `b` that is looked at, from the place of its keypoint: very flat ellipses are left alone.
const LARGEST: f64 = 80.0;

/// What is added to the diagonal of the normal equations, as a share of its sum.
const DAMPING: f64 = 1e-4;

/// Steps at most.
const STEPS: usize = 12;

/// A step that moves the middle by less, in distances of samples, is the last.
const SMALL: f64 = 0.01;

/// How far the middle may move, in distances of samples.
const FARTHEST: f64 = 0.35 * ALIGNED_REACH as f64;

/// How much larger or smaller the map may make an area than the keypoints say.
const AREAS: f64 = 3.0;

/// By how much the map may grow until it leaves the pixels that are looked at.
const ROOM: f64 = 1.2;

/// Least correlation of the two windows.
const CORRELATION: f32 = 0.8;

/// The point of image `b` that corresponds to `at_a`, refined from `at_b`. `b_from_a` is the linear map between their
/// neighbourhoods, according to the keypoints. `None` if the refinement fails.
pub(super) fn aligned(
    weights: &Weights,
    [image_a, image_b]: [&GrayImage; 2],
    [at_a, at_b]: [Point2<f64>; 2],
    b_from_a: Matrix2<f64>,
) -> Option<Point2<f64>> {
    let area = b_from_a.determinant();
    let scale = area.sqrt(); // NaN where the neighbourhood is mirrored
    if !(1.0 / SCALES..=SCALES).contains(&scale) {
        return None;
    }
    // Samples are a pixel apart in the image that shows it smaller.
    let apart = [1.0_f64.max(1.0 / scale), 1.0_f64.max(scale)];
    let template = Template::of(weights, image_a, at_a, apart[0])?;
    let first = b_from_a * apart[0];
    let reach = first.row_iter().map(|row| row.abs().sum());
    // Room for the map to grow and the middle to move.
    let reach = ROOM * ALIGNED_REACH as f64 * reach.fold(0.0, f64::max) + FARTHEST * apart[1];
    if reach > LARGEST {
        return None;
    }
    let piece = Piece::about(image_b, at_b, reach, apart[1])?;
    let (mut map, mut at) = (first, at_b);
    for _ in 0..STEPS {
        let mut window = sampled(&piece, at, map)?;
        weights.normalize(&mut window)?;
        let (change, shift) = template.step(&window);
        map *= change.try_inverse()?;
        let shift = map * shift;
        at -= shift;
        if (at - at_b).norm() > FARTHEST * apart[1] {
            return None;
        }
        if shift.norm() < SMALL * apart[1] {
            let mut window = sampled(&piece, at, map)?;
            weights.normalize(&mut window)?;
            let areas = map.determinant() / first.determinant();
            let is_good = (1.0 / AREAS..=AREAS).contains(&areas)
                && weights.correlation(&template.values, &window) >= CORRELATION;
            return is_good.then_some(at);
        }
    }
    None
}

/// The values at the places `at + map g` of an image; `None` where it has not all of them.
fn sampled(piece: &Piece, at: Point2<f64>, map: Matrix2<f64>) -> Option<Samples> {
    let reach = ALIGNED_REACH as f64;
    let corners = [
        (-reach, -reach),
        (-reach, reach),
        (reach, -reach),
        (reach, reach),
    ];
    let corners = corners.map(|(x, y)| piece.inside(at + map * Vector2::new(x, y)));
    // Half a pixel for the rounding of the places between them.
    let margin = |[x, y]: [f32; 2]| piece.has([x - 0.5, y - 0.5]) && piece.has([x + 0.5, y + 0.5]);
    if !corners.into_iter().all(margin) {
        return None;
    }
    let axes = [[map.m11, map.m21], [map.m12, map.m22]];
    let axes = axes.map(|axis| axis.map(|v| v as f32));
    let at = piece.inside(at);
    Some(sample_window(&piece.pixels, piece.stride, at, axes))
}

/// The window of `a`.
struct Template {
    /// Values, of mean 0 and standard deviation 1.
    values: Samples,
    /// See [`StepEquations`].
    slopes: [Samples; STEP_PARAMETERS],
    /// The matrix of the normal equations.
    normal: Cholesky<f64, nalgebra::Const<STEP_PARAMETERS>>,
}

impl Template {
    /// The window about a place; `None` where the image does not have all of it, or where its texture does not tell the
    /// place.
    fn of(weights: &Weights, image: &GrayImage, at: Point2<f64>, apart: f64) -> Option<Self> {
        // One sample more on each side, for the gradients.
        let reach = (ALIGNED_REACH + 1) as f64 * apart;
        let piece = Piece::about(image, at, reach, apart)?;
        let middle = piece.inside(at);
        let corners = [-reach, reach].map(|reach| middle.map(|v| v + reach as f32));
        if !corners.into_iter().all(|corner| piece.has(corner)) {
            return None;
        }
        let (pixels, stride) = (&piece.pixels, piece.stride);
        let [mut values, mut across, mut down] =
            sample_with_gradients(pixels, stride, middle, apart as f32);
        let deviation = weights.normalize(&mut values)?;
        for slope in [&mut across, &mut down] {
            for slope in slope.as_flattened_mut() {
                *slope /= deviation;
            }
        }
        let StepEquations { slopes, normal } =
            step_equations(&weights.0, &values, [&across, &down]);
        let normal = Matrix6::from_fn(|i, j| f64::from(normal[i][j]));
        // Directions that the texture does not tell stay nearly as they are.
        let normal = normal + Matrix6::identity() * (DAMPING * normal.trace());
        Some(Self {
            values,
            slopes,
            normal: Cholesky::new(normal)?,
        })
    }

    /// The step that takes this window to another: the change of the linear part, and of the middle, in samples.
    fn step(&self, window: &Samples) -> (Matrix2<f64>, Vector2<f64>) {
        let sums = step_sums(&self.slopes, &self.values, window).map(f64::from);
        let step = self.normal.solve(&Vector6::from(sums));
        let linear = |i: usize| step[i] / ALIGNED_REACH as f64;
        let change = Matrix2::new(1.0 + linear(2), linear(3), linear(4), 1.0 + linear(5));
        (change, Vector2::new(step[0], step[1]))
    }
}

/// The weights of samples, whose sum is 1.
pub(super) struct Weights(pub(super) Samples);

impl Weights {
    /// A Gaussian about the middle.
    pub(super) fn new() -> Self {
        let mut weights = Samples::default();
        for (row, line) in weights.iter_mut().enumerate() {
            for (column, weight) in line[..ALIGNED_SIDE].iter_mut().enumerate() {
                let [x, y] = [column, row].map(|v| v as f32 - ALIGNED_REACH as f32);
                *weight = libm::expf(-(x * x + y * y) / (2.0 * SPREAD * SPREAD));
            }
        }
        let sum: f32 = weights.as_flattened().iter().sum();
        Self(weights.map(|line| line.map(|weight| weight / sum)))
    }

    /// Takes the mean off all values and divides them by their standard deviation, which is returned; `None` where they are
    /// nearly the same.
    fn normalize(&self, values: &mut Samples) -> Option<f32> {
        let deviation = normalize_window(&self.0, values);
        (deviation > CONTRAST).then_some(deviation)
    }

    /// The correlation of two windows of mean 0 and standard deviation 1.
    fn correlation(&self, a: &Samples, b: &Samples) -> f32 {
        product_of_windows(&self.0, a, b)
    }
}
