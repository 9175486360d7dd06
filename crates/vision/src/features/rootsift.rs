//! RootSIFT: SIFT descriptors that are compared by the Hellinger kernel.
//!
//! R. Arandjelovic, A. Zisserman: "Three things everyone should know to improve object retrieval", CVPR 2012, section 3.
//!
//! A SIFT descriptor is a histogram. Histograms are compared better by their overlap than by the Euclidean
//! distance, which the largest bins dominate. So each descriptor is divided by the sum of its values (they are
//! not negative), and the root of each value is taken. The result has length 1, and the squared Euclidean
//! distance of two of them is `2 - 2 H`, with the Hellinger kernel `H(x, y) = sum of sqrt(x_i y_i)`. Keypoints
//! and parameters are those of [`Sift`].
//!
//! *Left open by the paper*: the roots are taken of the descriptor as SIFT gives it, rounded to integers. One
//! without any gradient stays zero.

use super::sift::Sift;
use super::{DescriptorKind, Descriptors, Detections, Extractor, Features, FloatRows};
use crate::image::{GrayImage, Size};

/// SIFT with the roots of its descriptors.
#[derive(Clone, Debug)]
pub struct RootSift(pub Sift);

impl Extractor for RootSift {
    fn kind(&self) -> DescriptorKind {
        Extractor::kind(&self.0)
    }

    fn extract(&self, image: &GrayImage) -> Features {
        with_roots(self.0.extract(image))
    }

    fn extract_sharing(&self, image: &GrayImage, detections: &mut dyn Detections) -> Features {
        with_roots(self.0.extract_sharing(image, detections))
    }

    fn memory(&self, size: Size) -> usize {
        self.0.memory(size)
    }
}

/// Features of SIFT with the roots of their descriptors, which take the place of these: both would be twice the memory.
pub(super) fn with_roots(features: Features) -> Features {
    let Descriptors::Float(rows) = features.descriptors else {
        unreachable!("those of SIFT are of real values");
    };
    let dim = rows.dim();
    let mut values = rows.into_vec();
    for row in values.chunks_exact_mut(dim) {
        let sum: f32 = row.iter().sum();
        // All values are 0 then.
        let sum = if sum > 0.0 { sum } else { 1.0 };
        for value in row {
            *value = (*value / sum).sqrt();
        }
    }
    Features {
        descriptors: Descriptors::Float(FloatRows::from_vec(dim, values)),
        ..features
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::features::sift::SiftParams;
    use crate::seed::Seed;

    #[test]
    fn lengths_are_one_and_distances_are_hellingers() {
        let image = GrayImage::from_fn(Size::new(120, 90), |x, y| {
            let patch = Seed(6).number((x / 9) as u64).number((y / 7) as u64);
            patch.rng().below(256) as u8
        });
        let sift = Sift::new(SiftParams::default()).unwrap();
        let (plain, rooted) = (sift.extract(&image), RootSift(sift).extract(&image));
        assert_eq!(plain.keypoints, rooted.keypoints);
        let (Descriptors::Float(plain), Descriptors::Float(rooted)) =
            (&plain.descriptors, &rooted.descriptors)
        else {
            panic!("real values");
        };
        assert!(plain.len() > 20);
        for index in 1..plain.len() {
            let [x, y] = [index - 1, index].map(|i| (plain.row(i), rooted.row(i)));
            let squared: f32 = x.1.iter().zip(y.1).map(|(x, y)| (x - y) * (x - y)).sum();
            let sums = [x.0, y.0].map(|row| row.iter().sum::<f32>());
            let overlap = x.0.iter().zip(y.0).map(|(x, y)| (x * y).sqrt());
            let kernel = overlap.sum::<f32>() / (sums[0] * sums[1]).sqrt();
            assert!((squared - (2.0 - 2.0 * kernel)).abs() < 1e-5);
            let length: f32 = y.1.iter().map(|value| value * value).sum();
            assert!((length - 1.0).abs() < 1e-5);
        }
    }

    #[test]
    fn no_second_copy_of_the_descriptors_is_made() {
        let rows = FloatRows::from_vec(2, vec![3.0, 1.0, 0.0, 0.0]);
        let values = rows.data().as_ptr();
        let plain = Features::of_descriptors(Descriptors::Float(rows));
        let Descriptors::Float(roots) = with_roots(plain).descriptors else {
            panic!("real values");
        };
        assert_eq!(roots.data(), [0.75_f32.sqrt(), 0.5, 0.0, 0.0]);
        assert_eq!(roots.data().as_ptr(), values);
    }
}
