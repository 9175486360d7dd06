//! Extrema of the differences of Gaussians, fitted to a fraction of a pixel (sections 3 and 4).

use nalgebra::{Matrix3, Point2, Vector3};

use super::SiftParams;
use crate::image::{Octave, RowBuffer};
use crate::simd::{find_extrema, subtract};

/// No extrema are looked for in so many pixels along the border.
pub(super) const BORDER: usize = 5;
/// Steps of the fit, each to the pixel nearest to the extremum of the quadratic.
const MAX_STEPS: usize = 5;
/// Pixels that the fit may wander in all; so many rows ahead and behind are at hand.
const REACH: usize = 8;
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

/// Finds extrema while a scale space is built.
pub(super) struct ExtremumFinder<'a> {
    params: &'a SiftParams,
    /// `differences[l]` is layer `l + 1` minus layer `l` of the present octave.
    differences: Vec<RowBuffer>,
    columns: Vec<u32>,
    octaves: Vec<Vec<Extremum>>,
}

impl<'a> ExtremumFinder<'a> {
    pub(super) fn new(params: &'a SiftParams) -> Self {
        Self {
            params,
            differences: Vec::new(),
            columns: Vec::new(),
            octaves: Vec::new(),
        }
    }

    /// The extrema of each octave.
    pub(super) fn into_octaves(self) -> Vec<Vec<Extremum>> {
        self.octaves
    }

    /// Takes row `y` of all layers, and searches the rows whose surroundings are then complete.
    pub(super) fn visit(&mut self, octave: &Octave, y: usize) {
        if y == 0 {
            self.octaves.push(Vec::new());
            let buffer = RowBuffer::new(octave.size(), 2 * REACH + 1);
            self.differences = vec![buffer; octave.layers().len() - 1];
        }
        for (difference, layers) in self.differences.iter_mut().zip(octave.layers().windows(2)) {
            for out in difference.append(1) {
                subtract(layers[1].row(y), layers[0].row(y), out);
            }
        }
        let height = octave.size().height;
        let end = if y + 1 == height {
            height
        } else {
            (y + 1).saturating_sub(REACH)
        };
        let start = y.saturating_sub(REACH);
        for row in start.max(BORDER)..end.min(height - BORDER) {
            self.search_row(row);
        }
    }

    fn search_row(&mut self, y: usize) {
        let SiftParams {
            contrast_threshold,
            octave_layers,
            ..
        } = *self.params;
        let threshold = (0.5 * contrast_threshold / octave_layers as f32 / GREY).floor();
        let width = self.differences[0].size().width;
        let found = self.octaves.last_mut().expect("visit made one");
        for layer in 1..=octave_layers {
            let rows = [layer - 1, layer, layer + 1]
                .map(|l| [y - 1, y, y + 1].map(|y| self.differences[l].row(y)));
            self.columns.clear();
            find_extrema(&rows, BORDER..width - BORDER, threshold, &mut self.columns);
            let fit = Fit {
                params: self.params,
                differences: &self.differences,
            };
            found.extend(
                self.columns
                    .iter()
                    .filter_map(|&x| fit.run(layer, x as usize, y)),
            );
        }
    }
}

/// The quadratic fit in the differences of Gaussians.
struct Fit<'a> {
    params: &'a SiftParams,
    differences: &'a [RowBuffer],
}

/// Value, gradient and Hessian at a pixel, in the order column, row, layer.
struct Derivatives {
    value: f32,
    gradient: Vector3<f32>,
    hessian: Matrix3<f32>,
}

impl Fit<'_> {
    /// The extremum near pixel (`x`, `y`) of `layer`, unless the fit leaves the image or does not
    /// settle, or the contrast is low or the place on an edge.
    fn run(&self, layer: usize, x: usize, y: usize) -> Option<Extremum> {
        let start = [x as i32, y as i32];
        let mut place = [x as i32, y as i32, layer as i32];
        for _ in 0..MAX_STEPS {
            let [x, y, layer] = place.map(|v| v as usize);
            let derivatives = self.derivatives(layer, x, y);
            let offset = -solve(&derivatives.hessian, &derivatives.gradient);
            if offset.iter().all(|v| v.abs() < 0.5) {
                return self.accept([x, y], layer, &derivatives, &offset);
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
        let size = self.differences[0].size();
        let within = |v: i32, start: i32, length: usize| {
            v >= BORDER as i32 && v < (length - BORDER) as i32 && v.abs_diff(start) < REACH as u32
        };
        (1..=self.params.octave_layers as i32).contains(&layer)
            && within(x, start[0], size.width)
            && within(y, start[1], size.height)
    }

    fn accept(
        &self,
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
        let layers = self.params.octave_layers as f32;
        let contrast = (value + 0.5 * gradient.dot(offset)).abs();
        if contrast * layers < self.params.contrast_threshold {
            return None;
        }
        // The ratio of the principal curvatures, section 4.1.
        let trace = hessian[(0, 0)] + hessian[(1, 1)];
        let determinant = hessian[(0, 0)] * hessian[(1, 1)] - hessian[(0, 1)] * hessian[(0, 1)];
        let r = self.params.edge_threshold;
        if determinant <= 0.0 || trace * trace * r >= (r + 1.0) * (r + 1.0) * determinant {
            return None;
        }
        let exponent = (layer as f32 + offset.z) / layers;
        Some(Extremum {
            layer,
            pixel: [x, y],
            at: Point2::new(x as f32 + offset.x, y as f32 + offset.y),
            scale: self.params.sigma as f32 * libm::exp2f(exponent),
            response: contrast,
        })
    }

    fn derivatives(&self, layer: usize, x: usize, y: usize) -> Derivatives {
        let at = |dx: usize, dy: usize, dl: usize| {
            self.differences[layer + dl - 1].row(y + dy - 1)[x + dx - 1]
        };
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
