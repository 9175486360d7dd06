//! From radiance to grey values: lens, exposure, photon and read noise, gamma, 8 bits.

use matchbench_vision::image::{FloatImage, GrayImage, Image};
use matchbench_vision::seed::Seed;

/// The imperfections of a camera.
#[derive(Clone, Copy, Debug)]
pub(super) struct Sensor {
    /// Time that the shutter is open, in seconds; it causes motion blur.
    pub shutter: f64,
    /// Standard deviation of the point spread of the lens, in pixels.
    pub blur: f32,
    /// Radiance that is just white, at mean exposure.
    pub white: f32,
    /// Automatic exposure varies by up to this many stops.
    pub wander: f64,
    /// Electrons in a white pixel. The fewer there are, the stronger is the photon noise.
    pub full_well: f32,
    /// Noise of a black pixel, in electrons.
    pub read_noise: f32,
}

/// Encoded values per unit of signal in the gamma table.
const STEPS: usize = 2048;

impl Sensor {
    /// The picture that the sensor takes of `radiance` at `time` (seconds). The noise of a pixel depends only
    /// on `seed` and on the number of the pixel.
    pub(super) fn expose(&self, radiance: &FloatImage, time: f64, seed: Seed) -> GrayImage {
        let seen = spread(radiance, self.blur);
        let sway = libm::sin(2.1 * time) + 0.5 * libm::sin(5.3 * time + 1.0);
        let gain = libm::exp2(self.wander * sway / 1.5) as f32 / self.white;
        let size = seen.size();
        let (cx, cy) = (0.5 * size.width as f32, 0.5 * size.height as f32);
        let corner = cx * cx + cy * cy;
        let gamma = gamma_table();
        Image::from_fn(size, |x, y| {
            let (dx, dy) = (x as f32 - cx, y as f32 - cy);
            let vignette = 1.0 - 0.25 * (dx * dx + dy * dy) / corner;
            let electrons = seen.at(x, y) * vignette * gain * self.full_well;
            let deviation = (electrons + self.read_noise * self.read_noise).sqrt();
            let pixel = seed.number((y * size.width + x) as u64);
            let signal = (electrons + deviation * bell(pixel.0)) / self.full_well;
            let place = (signal.clamp(0.0, 1.0) * STEPS as f32).min(STEPS as f32 - 0.5);
            let step = place as usize;
            let value = gamma[step] + (place - step as f32) * (gamma[step + 1] - gamma[step]);
            (value + 0.5) as u8
        })
    }
}

/// Grey value of each signal from 0 to 1, as sRGB encodes it.
fn gamma_table() -> Vec<f32> {
    (0..=STEPS)
        .map(|i| {
            let x = i as f32 / STEPS as f32;
            let encoded = if x <= 0.0031308 {
                12.92 * x
            } else {
                1.055 * libm::powf(x, 1.0 / 2.4) - 0.055
            };
            255.0 * encoded
        })
        .collect()
}

/// A nearly normal number of mean 0 and variance 1 from 64 random bits. It is the sum of four uniform numbers,
/// limited to 3.5 standard deviations.
fn bell(bits: u64) -> f32 {
    let sum: u64 = (0..4).map(|k| bits >> (16 * k) & 0xffff).sum();
    // Four uniform numbers on 0..=65535 have mean 131070 and deviation 65536 / sqrt(3).
    (sum as f32 - 131070.0) * (1.7320508 / 65536.0)
}

/// Gaussian blur. Beyond the border the outermost pixel is repeated.
fn spread(image: &FloatImage, sigma: f32) -> FloatImage {
    let radius = (3.0 * sigma).ceil() as i32;
    let weights: Vec<f32> = (-radius..=radius)
        .map(|i| libm::expf(-0.5 * (i * i) as f32 / (sigma * sigma)))
        .collect();
    let norm: f32 = weights.iter().sum();
    let inside = |i: i32, length: usize| i.clamp(0, length as i32 - 1) as usize;
    let size = image.size();
    let across = FloatImage::from_fn(size, |x, y| {
        let row = image.row(y);
        (-radius..)
            .zip(&weights)
            .map(|(i, w)| w * row[inside(x as i32 + i, size.width)])
            .sum()
    });
    FloatImage::from_fn(size, |x, y| {
        let sum: f32 = (-radius..)
            .zip(&weights)
            .map(|(i, w)| w * across.at(x, inside(y as i32 + i, size.height)))
            .sum();
        sum / (norm * norm)
    })
}

#[cfg(test)]
mod tests {
    use matchbench_vision::image::Size;

    use super::*;

    const SENSOR: Sensor = Sensor {
        shutter: 0.0,
        blur: 0.6,
        white: 1.0,
        wander: 0.0,
        full_well: 2000.0,
        read_noise: 10.0,
    };

    #[test]
    fn noise_has_the_deviation_of_photons_and_read_out() {
        let level = 0.25_f32;
        let size = Size::new(64, 64);
        let flat = FloatImage::filled(size, level);
        let image = SENSOR.expose(&flat, 0.0, Seed(5));
        // The middle, where vignetting is below 1 %.
        let values: Vec<f32> = (26..38)
            .flat_map(|y| (26..38).map(move |x| (x, y)))
            .map(|(x, y)| f32::from(image.at(x, y)))
            .collect();
        let mean = values.iter().sum::<f32>() / values.len() as f32;
        let variance =
            values.iter().map(|v| (v - mean) * (v - mean)).sum::<f32>() / (values.len() - 1) as f32;
        // sRGB of 0.25 is 137; its slope there is 231 grey values per unit of signal.
        let expected = 231.0 * (level * 2000.0 + 100.0).sqrt() / 2000.0;
        assert!((mean - 137.0).abs() < 2.0, "mean {mean}");
        assert!(
            (variance.sqrt() / expected - 1.0).abs() < 0.25,
            "{} against {expected}",
            variance.sqrt()
        );
    }

    #[test]
    fn light_beyond_white_saturates() {
        let bright = FloatImage::filled(Size::new(8, 8), 50.0);
        assert!(
            SENSOR
                .expose(&bright, 0.0, Seed(1))
                .data()
                .iter()
                .all(|&v| v == 255)
        );
        let dark = FloatImage::filled(Size::new(1, 1), 0.0);
        assert!(SENSOR.expose(&dark, 0.0, Seed(1)).at(0, 0) < 40);
    }
}
