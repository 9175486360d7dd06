//! Extrema of the differences of Gaussians, fitted to a fraction of a pixel (sections 3 and 4).

use nalgebra::{Matrix3, Point2, Vector3};

use super::{MAX_SCALES, SiftParams};
use crate::image::Strip;
use crate::simd::{ThreeRows, find_extrema_of_differences};

/// No extrema are looked for in so many pixels along the border.
pub(super) const BORDER: usize = 5;
/// Steps of the fit, each to the pixel nearest to the extremum of the quadratic.
const MAX_STEPS: usize = 5;
/// The fit may wander less than this many pixels in all.
pub(super) const WANDERING: usize = 8;
/// Pixels to each side that the search and its fits look at.
pub(super) const REACH: usize = WANDERING;
/// Layers of an octave that has the most scales.
const MAX_LAYERS: usize = MAX_SCALES + 3;
/// Thresholds are for grey values in 0..=1, images are in 0..=255.
const GREY: f32 = 1.0 / 255.0;

/// A fitted extremum of an octave, in its pixels.
#[derive(Clone, Copy, Debug)]
pub(super) struct Extremum {
    pub(super) layer: usize,
    /// Column and row of the nearest pixel.
    pub(super) pixel: [usize; 2],
    pub(super) at: Point2<f32>,
    /// Blur at which the extremum lies.
    pub(super) scale: f32,
    /// Absolute difference of Gaussians there, for grey values in 0..=1.
    pub(super) response: f32,
}

/// Finds extrema in a scale space at work.
pub(super) struct ExtremumFinder<'a> {
    params: &'a SiftParams,
    /// Columns of each layer.
    columns: Vec<Vec<u32>>,
}

impl<'a> ExtremumFinder<'a> {
    pub(super) fn new(params: &'a SiftParams) -> Self {
        Self {
            params,
            columns: vec![Vec::new(); params.octave_layers],
        }
    }

    /// Appends the extrema that start in row `y` of a strip's own columns.
    pub(super) fn find(&mut self, strip: &Strip, y: usize, found: &mut Vec<Extremum>) {
        let SiftParams {
            contrast_threshold,
            octave_layers,
            ..
        } = *self.params;
        let size = strip.octave().size;
        if !(BORDER..size.height - BORDER).contains(&y) {
            return;
        }
        let columns = strip.columns();
        let (start, end) = (
            columns.start.max(BORDER),
            columns.end.min(size.width - BORDER),
        );
        if start >= end {
            return;
        }
        let threshold = (0.5 * contrast_threshold / octave_layers as f32 / GREY).floor();
        // All rows from one column of the image on, the same multiple of a cache line as their buffers.
        let first = (start - 1) / 16 * 16;
        // In place of the coarsest layer, which is not made, stands the one before again. The difference of the two is
        // zero, which is beaten by all that exceeds the threshold.
        let layers = strip.layers().iter().chain(strip.layers().last());
        let mut rows: [ThreeRows<'_>; MAX_LAYERS] = [[&[]; 3]; MAX_LAYERS];
        for (rows, layer) in rows.iter_mut().zip(layers) {
            let skipped = first - layer.columns().start;
            *rows = [y - 1, y, y + 1].map(|y| &layer.row(y)[skipped..]);
        }
        self.columns.iter_mut().for_each(Vec::clear);
        let within = start - first..end - first;
        let rows = &rows[..octave_layers + 3];
        find_extrema_of_differences(rows, within, threshold, &mut self.columns);
        let fit = Fit {
            params: self.params,
            strip,
        };
        for (columns, layer) in self.columns.iter().zip(1..) {
            let columns = columns.iter().map(|&x| first + x as usize);
            found.extend(columns.filter_map(|x| fit.run(layer, x, y)));
        }
    }
}

/// The pixels about a place in four neighbouring layers, of which three differences are made.
struct Cube([[[f32; 3]; 3]; 4]);

impl Cube {
    /// Difference `dl` in row `dy` and column `dx`. The place is (1, 1, 1).
    fn at(&self, dx: usize, dy: usize, dl: usize) -> f32 {
        self.0[dl + 1][dy][dx] - self.0[dl][dy][dx]
    }

    /// Whether the place is as extreme as all nine pixels of the coarser difference.
    fn beats_coarser(&self) -> bool {
        let value = self.at(1, 1, 1);
        let mut coarser = (0..3).flat_map(|dy| (0..3).map(move |dx| self.at(dx, dy, 2)));
        if value > 0.0 {
            coarser.all(|other| value >= other)
        } else {
            coarser.all(|other| value <= other)
        }
    }
}

/// The quadratic fit in the differences of Gaussians.
struct Fit<'a> {
    params: &'a SiftParams,
    strip: &'a Strip,
}

/// Value, gradient and Hessian at a pixel, in the order column, row, layer.
struct Derivatives {
    value: f32,
    gradient: Vector3<f32>,
    hessian: Matrix3<f32>,
}

impl Fit<'_> {
    /// The extremum near pixel (`x`, `y`) of `layer`, unless the fit leaves the image or does not
    /// settle, or the contrast is low or the place on an edge. In the last layer the pixel may be none among its
    /// coarser neighbours, which were not there to be searched.
    fn run(&self, layer: usize, x: usize, y: usize) -> Option<Extremum> {
        let start = [x as i32, y as i32];
        let mut place = [x as i32, y as i32, layer as i32];
        for step in 0..MAX_STEPS {
            let [x, y, layer] = place.map(|v| v as usize);
            let cube = self.cube(layer, x, y);
            if step == 0 && layer == self.params.octave_layers && !cube.beats_coarser() {
                return None;
            }
            let derivatives = derivatives(&cube);
            let offset = -solve(&derivatives.hessian, &derivatives.gradient);
            if offset.iter().all(|v| v.abs() < 0.5) {
                return accepted(self.params, [x, y], layer, &derivatives, &offset);
            }
            for (v, step) in place.iter_mut().zip(&offset) {
                *v = v.saturating_add(step.round_ties_even() as i32);
            }
            if !self.is_inside(place, start) {
                return None;
            }
        }
        None
    }

    fn is_inside(&self, [x, y, layer]: [i32; 3], start: [i32; 2]) -> bool {
        let size = self.strip.octave().size;
        let within = |v: i32, start: i32, length: usize| {
            v >= BORDER as i32
                && v < (length - BORDER) as i32
                && v.abs_diff(start) < WANDERING as u32
        };
        (1..=self.params.octave_layers as i32).contains(&layer)
            && within(x, start[0], size.width)
            && within(y, start[1], size.height)
    }

    fn cube(&self, layer: usize, x: usize, y: usize) -> Cube {
        let mut cube = [[[0.0; 3]; 3]; 4];
        let layers = &self.strip.layers()[layer - 1..];
        for (rows, layer) in cube.iter_mut().zip(layers) {
            for (row, y) in rows.iter_mut().zip(y - 1..) {
                let pixels = &layer.row(y)[x - 1 - layer.columns().start..];
                *row = *pixels.first_chunk().expect("a column on each side");
            }
        }
        if layers.len() < cube.len() {
            cube[layers.len()] = self.strip.coarsest_about(x, y);
        }
        Cube(cube)
    }
}

/// The extremum that was fitted, unless its contrast is low or it lies on an edge.
fn accepted(
    params: &SiftParams,
    [x, y]: [usize; 2],
    layer: usize,
    derivatives: &Derivatives,
    offset: &Vector3<f32>,
) -> Option<Extremum> {
    let Derivatives {
        value,
        gradient,
        hessian,
    } = derivatives;
    let layers = params.octave_layers as f32;
    let contrast = (value + 0.5 * gradient.dot(offset)).abs();
    if contrast * layers < params.contrast_threshold {
        return None;
    }
    // The ratio of the principal curvatures, section 4.1.
    let trace = hessian[(0, 0)] + hessian[(1, 1)];
    let determinant = hessian[(0, 0)] * hessian[(1, 1)] - hessian[(0, 1)] * hessian[(0, 1)];
    let r = params.edge_threshold;
    if determinant <= 0.0 || trace * trace * r >= (r + 1.0) * (r + 1.0) * determinant {
        return None;
    }
    let exponent = (layer as f32 + offset.z) / layers;
    Some(Extremum {
        layer,
        pixel: [x, y],
        at: Point2::new(x as f32 + offset.x, y as f32 + offset.y),
        scale: params.sigma as f32 * libm::exp2f(exponent),
        response: contrast,
    })
}

/// The derivatives at the place in the middle.
fn derivatives(cube: &Cube) -> Derivatives {
    let at = |dx, dy, dl| cube.at(dx, dy, dl);
    let value = at(1, 1, 1);
    let first = |a: f32, b: f32| 0.5 * GREY * (b - a);
    let second = |a: f32, b: f32| GREY * (a + b - 2.0 * value);
    let mixed = |aa: f32, ab: f32, ba: f32, bb: f32| 0.25 * GREY * (bb - ba - ab + aa);
    let xx = second(at(0, 1, 1), at(2, 1, 1));
    let yy = second(at(1, 0, 1), at(1, 2, 1));
    let ss = second(at(1, 1, 0), at(1, 1, 2));
    let xy = mixed(at(0, 0, 1), at(0, 2, 1), at(2, 0, 1), at(2, 2, 1));
    let xs = mixed(at(0, 1, 0), at(0, 1, 2), at(2, 1, 0), at(2, 1, 2));
    let ys = mixed(at(1, 0, 0), at(1, 0, 2), at(1, 2, 0), at(1, 2, 2));
    Derivatives {
        value: GREY * value,
        gradient: Vector3::new(
            first(at(0, 1, 1), at(2, 1, 1)),
            first(at(1, 0, 1), at(1, 2, 1)),
            first(at(1, 1, 0), at(1, 1, 2)),
        ),
        hessian: Matrix3::new(xx, xy, xs, xy, yy, ys, xs, ys, ss),
    }
}

/// The solution of `matrix x = right`; zero, so no step, if there is none.
fn solve(matrix: &Matrix3<f32>, right: &Vector3<f32>) -> Vector3<f32> {
    let [a, b, c] = [0, 1, 2].map(|i| matrix.column(i).into_owned());
    let bc = b.cross(&c);
    let determinant = a.dot(&bc);
    if determinant == 0.0 {
        return Vector3::zeros();
    }
    // Cramer's rule.
    let scale = 1.0 / determinant;
    Vector3::new(
        right.dot(&bc),
        right.dot(&c.cross(&a)),
        right.dot(&a.cross(&b)),
    ) * scale
}

#[cfg(test)]
mod tests {
    use super::*;

    fn params() -> SiftParams {
        SiftParams {
            contrast_threshold: 0.03,
            edge_threshold: 10.0,
            octave_layers: 3,
            ..SiftParams::default()
        }
    }

    /// A round blob of this contrast.
    fn blob(value: f32) -> Derivatives {
        Derivatives {
            value,
            gradient: Vector3::zeros(),
            hessian: Matrix3::from_diagonal(&Vector3::new(-1.0, -1.0, -2.0)),
        }
    }

    /// Section 4.1: the ratio of the principal curvatures, in whatever direction these are.
    #[test]
    fn places_on_edges_are_left_out() {
        for turn in [0.0, 0.5, 0.8, 1.6_f32] {
            let (sin, cos) = libm::sincosf(turn);
            let turned = nalgebra::Matrix2::new(cos, -sin, sin, cos);
            let is_kept = |across: f32, along: f32| {
                let curved = nalgebra::Matrix2::new(across, 0.0, 0.0, along);
                let mut derivatives = blob(0.1);
                let curved = turned * curved * turned.transpose();
                derivatives
                    .hessian
                    .fixed_view_mut::<2, 2>(0, 0)
                    .copy_from(&curved);
                accepted(&params(), [9, 9], 1, &derivatives, &Vector3::zeros()).is_some()
            };
            for sign in [-1.0, 1.0] {
                assert!(
                    is_kept(sign, sign) && is_kept(sign * 9.9, sign) && is_kept(sign, sign * 9.9)
                );
                assert!(
                    !is_kept(sign * 10.1, sign) && !is_kept(sign, sign * 10.1),
                    "{turn}"
                );
                assert!(
                    !is_kept(sign, -sign) && !is_kept(sign * 2.0, -sign),
                    "a saddle"
                );
                assert!(!is_kept(sign, 0.0));
            }
        }
    }

    /// Equation 3: the value at the fitted place is that at the pixel and half of what the gradient adds on the way.
    #[test]
    fn the_contrast_is_that_at_the_fitted_place() {
        let offset = Vector3::new(0.25, -0.5, 0.1);
        // The gradient adds 0.02 on the way to the place.
        let gradient = Vector3::new(0.04, -0.012, 0.04);
        for sign in [-1.0, 1.0] {
            let fitted = |value: f32, added: f32| {
                let derivatives = Derivatives {
                    gradient: sign * added * gradient,
                    ..blob(sign * value)
                };
                accepted(&params(), [20, 30], 2, &derivatives, &offset)
            };
            // A threshold of 0.03 for an octave is one of 0.01 for each of its three layers.
            assert!(fitted(0.0099, 0.0).is_none() && fitted(0.0101, 0.0).is_some());
            assert!(fitted(0.0049, 0.5).is_none() && fitted(0.0051, 0.5).is_some());
            assert!(fitted(0.0149, -0.5).is_none() && fitted(0.0151, -0.5).is_some());
            let found = fitted(0.02, 1.0).expect("of high contrast");
            assert!((found.response - 0.03).abs() < 1e-6, "{found:?}");
            assert_eq!((found.layer, found.pixel), (2, [20, 30]));
            assert_eq!(found.at, Point2::new(20.25, 29.5));
            let scale = params().sigma * libm::exp2(2.1 / 3.0);
            assert!(
                (f64::from(found.scale) / scale - 1.0).abs() < 1e-6,
                "{found:?}"
            );
        }
    }
}
