//! Nonlinear diffusion: blur that stops at edges, computed by fast explicit diffusion (FED).
//!
//! P. Perona, J. Malik: "Scale-Space and Edge Detection Using Anisotropic Diffusion", IEEE TPAMI
//! 12(7), 629-639, 1990. S. Grewenig, J. Weickert, A. Bruhn: "From Box Filtering to Fast Explicit
//! Diffusion", DAGM 2010.
//!
//! An image L changes over time by `dL/dt = div(c grad L)`. The conductivity c falls with the length of the
//! gradient of a slightly smoothed L (function g2 of Perona and Malik); constant c would be a Gaussian blur of
//! variance `2 t`. An explicit step is stable up to a time of 1/4. FED takes n steps of different lengths, some
//! far above that limit, which together are stable and last `(n^2 + n) / 12`. During these steps c stays the
//! same. The steps are reordered so that rounding errors do not grow.
//!
//! Several steps run through the image together and in place, some rows at a time, each step one row behind the one
//! before. So what one step reads is still in the cache from the step before.

use super::FloatImage;
use crate::simd::{Below, DIFFUSED_AT_ONCE, diffuse_rows};

/// Longest stable explicit step.
const STABLE_TIME: f32 = 0.25;
/// Bytes of all rows that are in use by steps which run together; about half of a level-2 cache.
const BYTES_IN_USE: usize = 1 << 18;

/// Lengths of the steps of one cycle that lasts `time`, in their order.
pub(crate) fn fed_steps(time: f32) -> Vec<f32> {
    let exact = (3.0 * time / STABLE_TIME + 0.25).sqrt() - 0.5;
    let n = exact.ceil().max(1.0) as usize;
    // The wanted time as a share of a whole cycle of n steps, at most 1. Every step is shortened by it.
    let share = 3.0 * time / (STABLE_TIME * (n * (n + 1)) as f32);
    let step = |k: usize| {
        let angle = core::f32::consts::PI * (2 * k + 1) as f32 / (4 * n + 2) as f32;
        let cos = libm::cosf(angle);
        0.5 * share * STABLE_TIME / (cos * cos)
    };
    if n == 1 {
        return vec![step(0)];
    }
    // Walk through the steps with a stride of n / 2, modulo a prime.
    let prime = (n + 1..=2 * n).find(|&p| is_prime(p));
    let prime = prime.expect("between n and 2 n there is a prime");
    (1..prime)
        .map(|k| k * (n / 2) % prime)
        .filter(|&index| index <= n)
        .map(|index| step(index - 1))
        .collect()
}

fn is_prime(n: usize) -> bool {
    n >= 2 && (2..n).all(|divisor| !n.is_multiple_of(divisor))
}

/// Diffuses `image` in place with the given conductivities, by explicit steps of the given lengths.
///
/// # Panics
/// If the sizes differ.
pub(crate) fn diffuse(image: &mut FloatImage, conductivity: &FloatImage, steps: &[f32]) {
    assert_eq!(
        image.size(),
        conductivity.size(),
        "one value for each pixel"
    );
    let width = image.width();
    if width == 0 {
        return;
    }
    // Each step has one row of pixels, of conductivities and of flows.
    let together = (BYTES_IN_USE / (12 * width)).max(1);
    let mut flows = vec![0.0; width * together.min(steps.len())];
    for steps in steps.chunks(together) {
        flows.fill(0.0);
        diffuse_together(image, conductivity, steps, &mut flows);
    }
}

fn diffuse_together(
    image: &mut FloatImage,
    conductivity: &FloatImage,
    steps: &[f32],
    flows: &mut [f32],
) {
    let (width, height) = (image.width(), image.height());
    let mut front = 0;
    while front < height + steps.len() {
        for (behind, (step, flow)) in steps.iter().zip(flows.chunks_exact_mut(width)).enumerate() {
            let row = |front: usize| front.saturating_sub(behind).min(height);
            let (first, end) = (row(front), row(front + DIFFUSED_AT_ONCE));
            let (above, below) = image.data_mut().split_at_mut(end * width);
            let below = (end < height).then(|| Below {
                values: &below[..width],
                conductivity: conductivity.row(end),
            });
            let values = &mut above[first * width..];
            let conductivity = &conductivity.data()[first * width..end * width];
            diffuse_rows(values, conductivity, below, flow, 0.5 * step);
        }
        front += DIFFUSED_AT_ONCE;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::image::Size;
    use crate::seed::Seed;

    fn noise(size: Size) -> FloatImage {
        let mut rng = Seed(8).rng();
        FloatImage::from_fn(size, |_, _| rng.uniform() as f32)
    }

    #[test]
    fn steps_fill_the_time_and_are_all_different() {
        for time in [0.01, 0.25, 0.53, 1.5, 6.0, 68.0] {
            let steps = fed_steps(time);
            let sum: f32 = steps.iter().sum();
            assert!((sum / time - 1.0).abs() < 1e-5, "{time}: {sum}");
            let n = steps.len() as f32;
            assert!((n * n + n) / 12.0 >= 0.9999 * time, "{time}: {n} steps");
            assert!((n * n - n) / 12.0 < time, "{time}: {n} steps");
            let mut sorted = steps.clone();
            sorted.sort_by(f32::total_cmp);
            assert!(sorted.windows(2).all(|pair| pair[0] < pair[1]));
        }
    }

    #[test]
    fn with_constant_conductivity_variance_grows_by_twice_the_time() {
        let size = Size::new(61, 41);
        let mut image = FloatImage::filled(size, 0.0);
        image.set(30, 20, 1.0);
        diffuse(&mut image, &FloatImage::filled(size, 1.0), &fed_steps(8.0));
        let moment = |f: fn(f32, f32) -> f32| -> f32 {
            let at = |i: usize| ((i % 61) as f32 - 30.0, (i / 61) as f32 - 20.0);
            let values = image.data().iter().enumerate();
            values.map(|(i, v)| f(at(i).0, at(i).1) * v).sum()
        };
        assert!((moment(|_, _| 1.0) - 1.0).abs() < 1e-4);
        assert!((moment(|x, _| x * x) - 16.0).abs() < 0.01);
        assert!((moment(|_, y| y * y) - 16.0).abs() < 0.01);
    }

    #[test]
    fn steps_that_run_together_are_the_same_bits_as_one_by_one() {
        // Wide enough that not all steps run together.
        for size in [Size::new(9000, 7), Size::new(3, 40), Size::new(1, 1)] {
            let conductivity = noise(size);
            let mut together = noise(size);
            let mut single = together.clone();
            let steps = fed_steps(6.0);
            diffuse(&mut together, &conductivity, &steps);
            for step in &steps {
                let mut flows = vec![0.0; size.width];
                diffuse_together(&mut single, &conductivity, &[*step], &mut flows);
            }
            assert_eq!(together, single);
        }
    }

    #[test]
    fn nothing_is_lost_and_nothing_crosses_an_insulator() {
        let size = Size::new(30, 20);
        let mut image = FloatImage::from_fn(size, |x, _| if x < 15 { 0.0 } else { 1.0 });
        let step = image.clone();
        diffuse(&mut image, &FloatImage::filled(size, 0.0), &fed_steps(3.0));
        assert_eq!(image, step);
        diffuse(&mut image, &FloatImage::filled(size, 1.0), &fed_steps(3.0));
        let sum: f32 = image.data().iter().sum();
        assert!((sum - 300.0).abs() < 1e-2, "{sum}");
        diffuse(
            &mut FloatImage::filled(Size::new(0, 3), 0.0),
            &FloatImage::filled(Size::new(0, 3), 0.0),
            &[0.1],
        );
    }
}
