//! The Gaussian scale space: an image at ever larger blur, halved after each doubling of it.
//!
//! D. G. Lowe: "Distinctive Image Features from Scale-Invariant Keypoints", International Journal
//! of Computer Vision 60(2), 91-110, 2004, section 3; after T. Lindeberg's theory (1994).
//!
//! Octave `o` has pixels of `2^o` pixels of the image. Its layer `l` is blurred to
//! `sigma 2^(o + l / intervals)`; layers `0 ..= intervals + 2` are made, so that differences of
//! neighbours frame `intervals` scales on both sides. Each layer is made from the one before by
//! the missing blur; every second pixel of layer `intervals` is the base of the next octave.
//!
//! The layers of an octave are made together, from top to bottom, each some rows behind the one
//! before, and a visitor sees every row of them all. Only layers `1 ..= intervals` are kept whole,
//! where keypoints are described; of the others the few rows under work, which stay in the cache.
//! At 3072 x 2048 pixels that is 0.4 GB instead of 1.5 GB with differences, and faster.

use super::blur::{GaussianKernel, RowBlur};
use super::{GrayImage, RowBuffer, Size};
use crate::simd::{ROWS_AT_ONCE, double_row, halve_row};

/// Shape of a scale space.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ScaleSpaceShape {
    /// Whether the first octave is number -1, the image at twice its resolution.
    pub double: bool,
    /// Scales per octave (Lowe's s).
    pub intervals: usize,
    /// Blur of layer 0 of an octave, in its pixels.
    pub sigma: f64,
    /// Blur that the image is assumed to have, in pixels.
    pub input_sigma: f64,
    /// Octaves whose width or height is smaller are not made; at least 2.
    pub smallest: usize,
}

/// One resolution of a scale space.
#[derive(Clone, Debug)]
pub struct Octave {
    /// A pixel of this octave is `2^number` pixels of the image.
    pub number: i32,
    size: Size,
    layers: Vec<RowBuffer>,
}

impl Octave {
    /// Width and height in its own pixels.
    pub fn size(&self) -> Size {
        self.size
    }

    /// Layer `layer`; in a finished octave of `intervals` scales `1 ..= intervals` are whole.
    pub fn layer(&self, layer: usize) -> &RowBuffer {
        &self.layers[layer]
    }

    /// All layers.
    pub fn layers(&self) -> &[RowBuffer] {
        &self.layers
    }
}

/// All octaves of an image.
#[derive(Clone, Debug)]
pub struct ScaleSpace {
    /// From the finest to the coarsest; none if the image is too small.
    pub octaves: Vec<Octave>,
}

impl ScaleSpace {
    /// Builds the scale space of `image`. `visit(octave, y)` is called once for each row `y` of
    /// each octave, in order, when every layer holds that row.
    pub fn build(
        image: &GrayImage,
        shape: &ScaleSpaceShape,
        mut visit: impl FnMut(&Octave, usize),
    ) -> Self {
        let mut octaves: Vec<Octave> = Vec::new();
        loop {
            let (number, size) = match octaves.last() {
                Some(finer) => (
                    finer.number + 1,
                    Size::new(finer.size.width / 2, finer.size.height / 2),
                ),
                None if shape.double => (-1, Size::new(2 * image.width(), 2 * image.height())),
                None => (0, image.size()),
            };
            if size.width.min(size.height) < shape.smallest.max(2) {
                return Self { octaves };
            }
            let mut builder = OctaveBuilder::new(number, size, shape);
            if let Some(finer) = octaves.last() {
                builder.run(&mut Halved(finer.layer(shape.intervals)), &mut visit);
            } else {
                builder.run(&mut BlurredImage::new(image, shape), &mut visit);
            }
            octaves.push(builder.octave);
        }
    }
}

/// What layer 0 of an octave is made of.
trait Base {
    /// Makes the next rows.
    fn advance(&mut self, output: &mut RowBuffer);
}

/// Layer 0 of a further octave: every second pixel of every second row.
struct Halved<'a>(&'a RowBuffer);

impl Base for Halved<'_> {
    fn advance(&mut self, output: &mut RowBuffer) {
        let first = output.made();
        for (i, out) in output.append(ROWS_AT_ONCE).enumerate() {
            halve_row(self.0.row(2 * (first + i)), out);
        }
    }
}

/// Layer 0 of the first octave: the image, doubled if need be, blurred to the first scale.
struct BlurredImage<'a> {
    image: &'a GrayImage,
    double: bool,
    pixels: RowBuffer,
    blur: RowBlur,
}

impl<'a> BlurredImage<'a> {
    fn new(image: &'a GrayImage, shape: &ScaleSpaceShape) -> Self {
        let zoom = if shape.double { 2 } else { 1 };
        let size = Size::new(zoom * image.width(), zoom * image.height());
        let before = shape.input_sigma * zoom as f64;
        let missing = (shape.sigma * shape.sigma - before * before)
            .max(0.01)
            .sqrt();
        let kernel = GaussianKernel::new(missing);
        Self {
            image,
            double: shape.double,
            pixels: RowBuffer::new(size, 2 * kernel.radius() + 2 * ROWS_AT_ONCE),
            blur: RowBlur::new(kernel, size.width),
        }
    }

    /// Makes the next rows of the image in floating point.
    fn append_pixels(&mut self) {
        let first = self.pixels.made();
        let last = self.image.height() - 1;
        for (i, out) in self.pixels.append(ROWS_AT_ONCE).enumerate() {
            let y = first + i;
            if self.double {
                // Rows 2 y and 2 y + 1 lie a quarter pixel above and below row y.
                let near = y / 2;
                let far = if y.is_multiple_of(2) {
                    near.saturating_sub(1)
                } else {
                    last.min(near + 1)
                };
                double_row(self.image.row(near), self.image.row(far), out);
            } else {
                for (out, &pixel) in out.iter_mut().zip(self.image.row(y)) {
                    *out = f32::from(pixel);
                }
            }
        }
    }
}

impl Base for BlurredImage<'_> {
    fn advance(&mut self, output: &mut RowBuffer) {
        let size = self.pixels.size();
        let needed = self.blur.needs(output.made(), size.height);
        while self.pixels.made() < needed {
            self.append_pixels();
        }
        self.blur.advance(size, |y| self.pixels.row(y), output);
    }
}

/// An octave under construction.
struct OctaveBuilder {
    octave: Octave,
    /// `blurs[l]` makes layer `l + 1` from layer `l`.
    blurs: Vec<RowBlur>,
}

impl OctaveBuilder {
    fn new(number: i32, size: Size, shape: &ScaleSpaceShape) -> Self {
        let step = libm::exp2(1.0 / shape.intervals as f64);
        let count = shape.intervals + 3;
        let blurs: Vec<RowBlur> = (1..count)
            .map(|layer| {
                let before = shape.sigma * libm::pow(step, (layer - 1) as f64);
                let missing = before * (step * step - 1.0).sqrt();
                RowBlur::new(GaussianKernel::new(missing), size.width)
            })
            .collect();
        let lag = |blur: &RowBlur| blur.radius() + 2 * ROWS_AT_ONCE;
        let layers = (0..count)
            .map(|layer| {
                if (1..=shape.intervals).contains(&layer) {
                    return RowBuffer::whole(size);
                }
                // The visitor is behind by the lag of all further blurs, the next blur looks back
                // by its radius once more.
                let behind: usize = blurs[layer..].iter().map(lag).sum();
                let back = blurs.get(layer).map_or(0, RowBlur::radius);
                RowBuffer::new(size, behind + back + 2 * ROWS_AT_ONCE)
            })
            .collect();
        Self {
            octave: Octave {
                number,
                size,
                layers,
            },
            blurs,
        }
    }

    fn run(&mut self, base: &mut impl Base, visit: &mut impl FnMut(&Octave, usize)) {
        let height = self.octave.size.height;
        let mut visited = 0;
        while visited < height {
            let layers = &mut self.octave.layers;
            if !layers[0].is_complete() {
                base.advance(&mut layers[0]);
            }
            for (l, blur) in self.blurs.iter_mut().enumerate() {
                let (finer, coarser) = layers.split_at_mut(l + 1);
                let (input, output) = (&finer[l], &mut coarser[0]);
                if !output.is_complete() && input.made() >= blur.needs(output.made(), height) {
                    blur.advance(input.size(), |y| input.row(y), output);
                }
            }
            for y in visited..layers[self.blurs.len()].made() {
                visit(&self.octave, y);
            }
            visited = self.octave.layers[self.blurs.len()].made();
        }
    }
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

    #[test]
    fn rows_made_together_are_the_blurred_images() {
        let image = noise(Size::new(41, 150));
        let mut visited = Vec::new();
        let space = ScaleSpace::build(&image, &SHAPE, |octave, y| {
            for layer in octave.layers() {
                assert_eq!(layer.row(y).len(), octave.size().width);
            }
            visited.push((octave.number, y));
        });
        let heights = [150, 75, 37, 18];
        let expected = heights
            .iter()
            .zip(0..)
            .flat_map(|(&h, o)| (0..h).map(move |y| (o, y)));
        assert_eq!(visited, expected.collect::<Vec<_>>());

        let mut base = gaussian_blur(&image.map(|&v| f32::from(v)), (1.6 * 1.6_f64 - 0.25).sqrt());
        for octave in &space.octaves {
            let mut layer = base;
            for l in 1..=3 {
                let step = libm::exp2(1.0 / 3.0);
                let missing = 1.6 * libm::pow(step, f64::from(l - 1)) * (step * step - 1.0).sqrt();
                layer = gaussian_blur(&layer, missing);
                for y in 0..layer.height() {
                    assert_eq!(
                        octave.layer(l as usize).row(y),
                        layer.row(y),
                        "layer {l} row {y}"
                    );
                }
            }
            let half = Size::new(layer.width() / 2, layer.height() / 2);
            base = FloatImage::from_fn(half, |x, y| layer.at(2 * x, 2 * y));
        }
    }

    #[test]
    fn too_small_images_have_no_octave() {
        for (width, height) in [(0, 0), (1, 1), (0, 9), (3, 100)] {
            let image = noise(Size::new(width, height));
            assert!(
                ScaleSpace::build(&image, &SHAPE, |_, _| ())
                    .octaves
                    .is_empty()
            );
        }
        let double = ScaleSpaceShape {
            double: true,
            ..SHAPE
        };
        let space = ScaleSpace::build(&noise(Size::new(3, 2)), &double, |_, _| ());
        assert_eq!(space.octaves.len(), 1);
        assert_eq!(
            (space.octaves[0].number, space.octaves[0].size()),
            (-1, Size::new(6, 4))
        );
    }
}
