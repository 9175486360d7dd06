//! The Gaussian scale space: an image at increasing blur, halved in size after each doubling of the blur.
//!
//! D. G. Lowe: "Distinctive Image Features from Scale-Invariant Keypoints", International Journal
//! of Computer Vision 60(2), 91-110, 2004, section 3; after T. Lindeberg's theory (1994).
//!
//! A pixel of octave `o` is `2^o` pixels of the image wide. Layer `l` of the octave is blurred to
//! `sigma 2^(o + l / intervals)`. There are the layers `0 ..= intervals + 2`, so that there are `intervals` differences of
//! neighbouring layers that have another difference on both sides. Each layer is made from the one before by
//! the missing blur. Every second pixel of layer `intervals` is the base of the next octave.
//!
//! *Layers are not kept.* An octave is made in strips of columns. They are narrow enough that the rows in use
//! stay in the second-level cache. In a strip the layers are made together, from top to bottom, each some rows
//! behind the one before. A [`LayerVisitor`] goes down the strip and looks at a row as soon as all that lies
//! within its reach is there; rows out of reach are dropped. Only the base of the next octave is kept whole.
//! Columns within reach of two neighbouring strips are made twice. At 3072 x 2048 pixels all layers would take
//! 1.2 GB, and to pass each of them through memory would take more time than the sums.
//!
//! *The coarsest layer is not made.* Only extrema in the last of the differences meet the one beyond it, so few
//! pixels of layer `intervals + 2`, whose blur is the widest, are ever looked at. They are computed when they are
//! ([`Strip::coarsest_about`]).

use std::ops::Range;

use super::blur::{ALIGNED, Border, GaussianKernel, RowBlur};
use super::blur_at::blur_at;
use super::{FloatImage, GrayImage, RowBuffer, Size};
use crate::simd::{ROWS_AT_ONCE, double_row, halve_row, rows_together, second_level_cache};

/// Columns of a strip, without the columns that its neighbours make as well: the fastest choice with a second-level cache
/// of a megabyte (Zen 4, Zen 5).
const STRIP: usize = 1024;

/// The fastest choice with two megabytes (Intel), in which the rows of wider strips stay too. Fewer columns are made twice.
const WIDER_STRIP: usize = 1536;

/// The fastest choice with half a megabyte (Zen 3), where strips of fewer columns than [`STRIP`] gain nothing.
const WIDEST_STRIP: usize = 2048;

/// Columns of a strip on this processor: the [fastest choice](STRIP) with its second-level cache.
pub(crate) fn columns_of_strips() -> usize {
    const MEGABYTE: usize = 1 << 20;
    match second_level_cache() {
        Some(bytes) if bytes < MEGABYTE => WIDEST_STRIP,
        Some(bytes) if bytes >= 2 * MEGABYTE => WIDER_STRIP,
        _ => STRIP,
    }
}

/// Shape of a scale space.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ScaleSpaceShape {
    /// Whether the first octave has number -1, which is the image at twice its resolution.
    pub double: bool,
    /// Scales per octave (Lowe's s).
    pub intervals: usize,
    /// Blur of layer 0 of an octave, in its pixels.
    pub sigma: f64,
    /// Blur that the image is assumed to have, in pixels.
    pub input_sigma: f64,
    /// An octave whose width or height is smaller than this is not made; at least 2.
    pub smallest: usize,
}

/// An octave: its number, and its size in its own pixels. One of them is `2^number` pixels of the image wide.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Octave {
    /// Binary logarithm of the width of its pixels.
    pub number: i32,
    /// Width and height in its own pixels.
    pub size: Size,
}

/// How far from a pixel a visitor looks, in pixels of the octave.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Reach {
    /// Columns and rows to each side in layers `1 ..= intervals`, which are the layers of keypoints.
    pub described: usize,
    /// The same in all layers; `None` if layers beyond `intervals` are not looked at.
    pub all: Option<usize>,
}

/// Looks at a scale space while it is made.
pub trait LayerVisitor {
    /// How far it looks in an octave; `None` ends the scale space before that octave.
    fn reach(&self, octave: Octave) -> Option<Reach>;

    /// Looks at row `y` of a strip: at its own columns and at what is within reach of them. Called once for
    /// each row of each strip of each octave, from top to bottom.
    fn visit(&mut self, strip: &Strip, y: usize);
}

impl ScaleSpaceShape {
    /// The octaves of an image, from the finest to the coarsest; none if it is too small.
    pub fn octaves(&self, image: Size) -> Vec<Octave> {
        let (mut number, mut size) = if self.double {
            (-1, Size::new(2 * image.width, 2 * image.height))
        } else {
            (0, image)
        };
        let mut octaves = Vec::new();
        while size.width.min(size.height) >= self.smallest.max(2) {
            octaves.push(Octave { number, size });
            number += 1;
            size = Size::new(size.width / 2, size.height / 2);
        }
        octaves
    }

    /// Makes the scale space of `image` for a visitor.
    ///
    /// # Panics
    /// If there are no `intervals`, or if blurs between layers are not between 0.001 and 10,000 pixels.
    pub fn visit(&self, image: &GrayImage, visitor: &mut impl LayerVisitor) {
        self.visit_in_strips(image, columns_of_strips(), visitor);
    }

    /// [`Self::visit`] in strips of so many columns.
    fn visit_in_strips(&self, image: &GrayImage, strip: usize, visitor: &mut impl LayerVisitor) {
        let mut base = None;
        let mut spare = Vec::new();
        for octave in self.octaves(image.size()) {
            let Some(reach) = visitor.reach(octave) else {
                break;
            };
            let half = Size::new(octave.size.width / 2, octave.size.height / 2);
            let mut next = FloatImage::filled(half, 0.0);
            let count = octave.size.width.div_ceil(strip);
            let width = octave.size.width.div_ceil(count);
            let width = width.next_multiple_of(ALIGNED as usize);
            for start in (0..octave.size.width).step_by(width) {
                let columns = start..octave.size.width.min(start + width);
                let mut builder = StripBuilder::new(self, octave, columns, reach, &mut spare);
                if let Some(base) = &base {
                    builder.run(&mut Halved(base), &mut next, visitor);
                } else {
                    let columns = builder.strip.layers[0].columns();
                    let mut base = BlurredImage::new(image, self, &columns);
                    builder.run(&mut base, &mut next, visitor);
                }
                let layers = builder.strip.layers.into_iter();
                spare.extend(layers.map(RowBuffer::into_memory));
            }
            base = Some(next);
        }
    }

    /// The kernels that make layers `1 ..= intervals + 2`, each from the layer before.
    fn kernels(&self) -> Vec<GaussianKernel> {
        let step = libm::exp2(1.0 / self.intervals as f64);
        (0..self.intervals + 2)
            .map(|layer| {
                let before = self.sigma * libm::pow(step, layer as f64);
                GaussianKernel::new(before * (step * step - 1.0).sqrt())
            })
            .collect()
    }
}

/// Some columns of an octave while they are made.
#[derive(Clone, Debug)]
pub struct Strip {
    octave: Octave,
    columns: Range<usize>,
    layers: Vec<RowBuffer>,
    /// Makes layer `intervals + 2` from the one before, if it is looked at.
    coarsest: Option<GaussianKernel>,
}

impl Strip {
    /// The octave.
    pub fn octave(&self) -> Octave {
        self.octave
    }

    /// The strip's own columns.
    pub fn columns(&self) -> Range<usize> {
        self.columns.clone()
    }

    /// Layer `layer`: the rows and columns within reach.
    pub fn layer(&self, layer: usize) -> &RowBuffer {
        &self.layers[layer]
    }

    /// All layers that are made: `0 ..= intervals + 1`, or up to `intervals` if no others are within reach.
    pub fn layers(&self) -> &[RowBuffer] {
        &self.layers
    }

    /// The pixels of layer `intervals + 2` about (`x`, `y`), row after row.
    ///
    /// # Panics
    /// If one of them is out of [`Reach::all`] or of the image.
    pub fn coarsest_about(&self, x: usize, y: usize) -> [[f32; 3]; 3] {
        let finer = self.layers.last().expect("more than intervals");
        let kernel = self.coarsest.as_ref().expect("all layers within reach");
        blur_at(finer, kernel, x, y)
    }
}

/// The input of layer 0 of an octave.
trait Base {
    /// Makes the next rows.
    fn advance(&mut self, output: &mut RowBuffer);
}

/// Layer 0 of a later octave, which was made with the octave before.
struct Halved<'a>(&'a FloatImage);

impl Base for Halved<'_> {
    fn advance(&mut self, output: &mut RowBuffer) {
        let first = output.made();
        let columns = output.columns();
        for (i, out) in output.append(rows_together()).enumerate() {
            out.copy_from_slice(&self.0.row(first + i)[columns.clone()]);
        }
    }
}

/// Layer 0 of the first octave: the image, doubled if asked for, blurred to the first scale.
struct BlurredImage<'a> {
    image: &'a GrayImage,
    double: bool,
    pixels: RowBuffer,
    blur: RowBlur,
}

impl<'a> BlurredImage<'a> {
    /// Makes `columns` of layer 0.
    fn new(image: &'a GrayImage, shape: &ScaleSpaceShape, columns: &Range<usize>) -> Self {
        let zoom = if shape.double { 2 } else { 1 };
        let size = Size::new(zoom * image.width(), zoom * image.height());
        let before = shape.input_sigma * zoom as f64;
        let missing = (shape.sigma * shape.sigma - before * before)
            .max(0.01)
            .sqrt();
        let kernel = GaussianKernel::new(missing);
        // The pixel at either end of a doubled row is out unless the image ends there.
        let margin = kernel.radius() + 1;
        let needed = around(columns, margin, size.width);
        let keep = 2 * kernel.radius() + 2 * ROWS_AT_ONCE;
        Self {
            image,
            double: shape.double,
            pixels: RowBuffer::strip(size, needed, keep),
            blur: RowBlur::of_columns(kernel, columns, Border::Mirror),
        }
    }

    /// Makes the next rows of the image in floating point.
    fn append_pixels(&mut self) {
        let first = self.pixels.made();
        let last = self.image.height() - 1;
        let columns = self.pixels.columns();
        for (i, out) in self.pixels.append(rows_together()).enumerate() {
            let y = first + i;
            if self.double {
                // Rows 2 y and 2 y + 1 lie a quarter pixel above and below row y.
                let near = y / 2;
                let far = if y.is_multiple_of(2) {
                    near.saturating_sub(1)
                } else {
                    last.min(near + 1)
                };
                let [near, far] =
                    [near, far].map(|y| &self.image.row(y)[columns.start / 2..columns.end / 2]);
                double_row(near, far, out);
            } else {
                for (out, &pixel) in out.iter_mut().zip(&self.image.row(y)[columns.clone()]) {
                    *out = f32::from(pixel);
                }
            }
        }
    }
}

impl Base for BlurredImage<'_> {
    fn advance(&mut self, output: &mut RowBuffer) {
        let needed = self.blur.needs(output.made(), self.pixels.size().height);
        while self.pixels.made() < needed {
            self.append_pixels();
        }
        let start = self.pixels.columns().start;
        self.blur.advance(start, |y| self.pixels.row(y), output);
    }
}

/// A strip under construction.
struct StripBuilder {
    strip: Strip,
    intervals: usize,
    /// Rows below the visited one that must exist, for each layer.
    below: Vec<usize>,
    /// `blurs[l]` makes layer `l + 1` from layer `l`.
    blurs: Vec<RowBlur>,
}

impl StripBuilder {
    /// A strip whose layers reuse the memory of `spare`, the layers of the strip before.
    fn new(
        shape: &ScaleSpaceShape,
        octave: Octave,
        columns: Range<usize>,
        reach: Reach,
        spare: &mut Vec<Vec<f32>>,
    ) -> Self {
        let size = octave.size;
        let intervals = shape.intervals;
        let mut kernels = shape.kernels();
        let coarsest = kernels.pop().filter(|_| reach.all.is_some());
        let blurred = coarsest.as_ref().map_or(0, GaussianKernel::radius);
        if reach.all.is_none() {
            kernels.truncate(intervals);
        }
        let looked_at = |layer: usize| {
            let described = (1..=intervals).contains(&layer).then_some(reach.described);
            // The coarsest layer is computed from the one before.
            let further = if layer == intervals + 1 { blurred } else { 0 };
            let all = reach.all.map(|all| all + further);
            described.max(all).unwrap_or(0)
        };
        let mut ahead = rows_ahead(&kernels, looked_at);
        let mut layers = Vec::new();
        let mut blurs = Vec::new();
        let mut needed: Option<Range<usize>> = None;
        for layer in (0..=kernels.len()).rev() {
            let looked = around(&columns, looked_at(layer), size.width);
            let (needed_columns, back) = match (&needed, kernels.get(layer)) {
                (Some(next), Some(kernel)) => {
                    let blurred = around(next, kernel.radius(), size.width);
                    let both = blurred.start.min(looked.start)..blurred.end.max(looked.end);
                    (both, kernel.radius())
                }
                _ => (looked, 0),
            };
            let looked_back = ahead.pop().unwrap_or(0) + looked_at(layer);
            let keep = looked_back.max(2 * back + ROWS_AT_ONCE) + 2 * ROWS_AT_ONCE;
            if let Some(kernel) = layer.checked_sub(1).map(|before| kernels[before].clone()) {
                blurs.push(RowBlur::of_columns(kernel, &needed_columns, Border::Mirror));
            }
            // From the last layer to the first, as they were put there.
            let memory = spare.pop().unwrap_or_default();
            layers.push(RowBuffer::strip_in(
                memory,
                size,
                needed_columns.clone(),
                keep,
            ));
            needed = Some(needed_columns);
        }
        layers.reverse();
        blurs.reverse();
        Self {
            below: (0..layers.len()).map(looked_at).collect(),
            strip: Strip {
                octave,
                columns,
                layers,
                coarsest,
            },
            intervals,
            blurs,
        }
    }

    fn run(
        &mut self,
        base: &mut impl Base,
        next: &mut FloatImage,
        visitor: &mut impl LayerVisitor,
    ) {
        let height = self.strip.octave.size.height;
        let mut halved = 0;
        let mut visited = 0;
        while visited < height {
            let layers = &mut self.strip.layers;
            if !layers[0].is_complete() {
                base.advance(&mut layers[0]);
            }
            for (l, blur) in self.blurs.iter_mut().enumerate() {
                let (finer, coarser) = layers.split_at_mut(l + 1);
                let (input, output) = (&finer[l], &mut coarser[0]);
                if !output.is_complete() && input.made() >= blur.needs(output.made(), height) {
                    blur.advance(input.columns().start, |y| input.row(y), output);
                }
            }
            self.halve(next, &mut halved);
            while visited < height && self.is_within_reach(visited) {
                visitor.visit(&self.strip, visited);
                visited += 1;
            }
        }
    }

    /// Copies the new rows of the base of the next octave.
    fn halve(&self, next: &mut FloatImage, halved: &mut usize) {
        let layer = &self.strip.layers[self.intervals];
        let columns = &self.strip.columns;
        let end = next.width().min(columns.end / 2);
        while *halved < next.height() && 2 * *halved < layer.made() {
            let row = &layer.row(2 * *halved)[columns.start - layer.columns().start..];
            halve_row(row, &mut next.row_mut(*halved)[columns.start / 2..end]);
            *halved += 1;
        }
    }

    /// Whether all rows exist that a visitor of row `y` looks at.
    fn is_within_reach(&self, y: usize) -> bool {
        let height = self.strip.octave.size.height;
        let mut layers = self.strip.layers.iter().zip(&self.below);
        layers.all(|(layer, below)| layer.made() >= height.min(y + below + 1))
    }
}

/// By how many rows each layer may be ahead of the row that is visited next.
///
/// If a row is not visited yet, some layer lacks a row that the visitor looks at. The layers before that one
/// are ahead of it by the rows that their blurs need, and by less than a block of rows more. The layers after
/// it are behind it by the rows that their blurs need, or else they wait for nothing and are themselves the
/// layer that is missing.
fn rows_ahead(kernels: &[GaussianKernel], looked_at: impl Fn(usize) -> usize) -> Vec<usize> {
    let mut ahead = vec![looked_at(0)];
    for (before, kernel) in kernels.iter().enumerate() {
        let behind = ahead[before].saturating_sub(kernel.radius());
        ahead.push(behind.max(looked_at(before + 1)));
    }
    for (before, kernel) in kernels.iter().enumerate().rev() {
        let needed = ahead[before + 1] + kernel.radius() + ROWS_AT_ONCE;
        ahead[before] = ahead[before].max(needed);
    }
    ahead
}

/// `columns` and `margin` more on each side, as far as there are any of `width`, from a multiple of
/// [`ALIGNED`] on.
fn around(columns: &Range<usize>, margin: usize, width: usize) -> Range<usize> {
    let start = columns.start.saturating_sub(margin) & !(ALIGNED as usize - 1);
    let end = (columns.end + margin).next_multiple_of(ALIGNED as usize);
    start..end.min(width)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::image::{FloatImage, gaussian_blur};
    use crate::seed::Seed;

    const SHAPE: ScaleSpaceShape = ScaleSpaceShape {
        double: false,
        intervals: 3,
        sigma: 1.6,
        input_sigma: 0.5,
        smallest: 4,
    };

    fn noise(size: Size) -> GrayImage {
        let mut rng = Seed(4).rng();
        GrayImage::from_fn(size, |_, _| rng.below(256) as u8)
    }

    /// Notes which rows it saw, and keeps the layers. The coarsest is kept if anything about it is within reach.
    struct Keeper {
        reach: Reach,
        seen: Vec<(i32, usize, usize)>,
        octaves: Vec<Vec<FloatImage>>,
    }

    impl LayerVisitor for Keeper {
        fn reach(&self, _: Octave) -> Option<Reach> {
            Some(self.reach)
        }

        fn visit(&mut self, strip: &Strip, y: usize) {
            let Octave { number, size } = strip.octave();
            let columns = strip.columns();
            self.seen.push((number, columns.start, y));
            if (columns.start, y) == (0, 0) {
                let count = strip.layers().len() + usize::from(self.reach.all > Some(0));
                self.octaves
                    .push(vec![FloatImage::filled(size, 0.0); count]);
            }
            let octave = self.octaves.last_mut().expect("made at its first row");
            for (number, (layer, kept)) in strip.layers().iter().zip(&mut *octave).enumerate() {
                let reach = match self.reach.all {
                    None if number == 0 => 0,
                    Some(all) if !(1..=SHAPE.intervals).contains(&number) => all,
                    _ => self.reach.described.max(self.reach.all.unwrap_or(0)),
                };
                let (held, first) = (layer.columns(), columns.start.saturating_sub(reach));
                assert!(held.start <= first && held.end >= size.width.min(columns.end + reach));
                for row in [y.saturating_sub(reach), (y + reach).min(size.height - 1)] {
                    assert_eq!(layer.row(row).len(), held.len(), "row {row} at {y}");
                }
                kept.row_mut(y)[held].copy_from_slice(layer.row(y));
            }
            if let (Some(all @ 1..), Some(coarsest)) = (self.reach.all, octave.last_mut()) {
                let places = |v: usize, length: usize| {
                    let (before, after) = ((v + 1).saturating_sub(all), v + all - 1);
                    [before, v, after].map(|v| v.clamp(1, length - 2))
                };
                for x in columns.flat_map(|x| places(x, size.width)) {
                    for y in places(y, size.height) {
                        for (row, y) in strip.coarsest_about(x, y).iter().zip(y - 1..) {
                            coarsest.row_mut(y)[x - 1..=x + 1].copy_from_slice(row);
                        }
                    }
                }
            }
        }
    }

    fn keep(image: &GrayImage, shape: &ScaleSpaceShape, strip: usize, reach: Reach) -> Keeper {
        let mut keeper = Keeper {
            reach,
            seen: Vec::new(),
            octaves: Vec::new(),
        };
        shape.visit_in_strips(image, strip, &mut keeper);
        keeper
    }

    #[test]
    fn layers_made_in_strips_are_the_blurred_images() {
        let wide = Size::new(2051, 9);
        for (size, strip, starts) in [
            (Size::new(41, 150), STRIP, vec![vec![0]; 4]),
            (wide, STRIP, vec![vec![0, 688, 1376], vec![0, 528]]),
            (wide, WIDEST_STRIP, vec![vec![0, 1040], vec![0]]),
        ] {
            for reach in [
                Reach {
                    described: 20,
                    all: Some(9),
                },
                Reach {
                    described: 0,
                    all: None,
                },
                Reach {
                    described: 70,
                    all: Some(0),
                },
            ] {
                let image = noise(size);
                let keeper = keep(&image, &SHAPE, strip, reach);
                let mut expected = Vec::new();
                for (octave, starts) in SHAPE.octaves(size).iter().zip(&starts) {
                    for &start in starts {
                        let rows = 0..octave.size.height;
                        expected.extend(rows.map(|y| (octave.number, start, y)));
                    }
                }
                assert_eq!(keeper.seen, expected);

                let sigma = (1.6 * 1.6_f64 - 0.25).sqrt();
                let mut base = gaussian_blur(&image.map(|&v| f32::from(v)), sigma);
                for octave in &keeper.octaves {
                    let mut layer = base;
                    let mut half = None;
                    for (l, kept) in octave.iter().enumerate() {
                        if l > 0 {
                            let step = libm::exp2(1.0 / 3.0);
                            let before = 1.6 * libm::pow(step, (l - 1) as f64);
                            layer = gaussian_blur(&layer, before * (step * step - 1.0).sqrt());
                        }
                        assert_eq!(kept, &layer, "layer {l} of {size}");
                        if l == SHAPE.intervals {
                            let size = Size::new(layer.width() / 2, layer.height() / 2);
                            half = Some(FloatImage::from_fn(size, |x, y| layer.at(2 * x, 2 * y)));
                        }
                    }
                    base = half.expect("a layer for each interval");
                }
            }
        }
    }

    #[test]
    fn too_small_images_have_no_octave() {
        for (width, height) in [(0, 0), (1, 1), (0, 9), (3, 100)] {
            assert_eq!(SHAPE.octaves(Size::new(width, height)), []);
        }
        let double = ScaleSpaceShape {
            double: true,
            ..SHAPE
        };
        let octave = Octave {
            number: -1,
            size: Size::new(6, 4),
        };
        assert_eq!(double.octaves(Size::new(3, 2)), [octave]);
        let reach = Reach {
            described: 2,
            all: Some(2),
        };
        let keeper = keep(&noise(Size::new(3, 2)), &double, STRIP, reach);
        assert_eq!(keeper.seen, [0, 1, 2, 3].map(|y| (-1, 0, y)));
    }
}
