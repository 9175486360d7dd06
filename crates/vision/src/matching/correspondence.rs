//! A feature of image `a` together with a feature of image `b`.

/// Feature `a` of the first image is taken to show the same point as feature `b` of the second.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Correspondence {
    /// Index of the feature in image `a`.
    pub a: u32,
    /// Index of the feature in image `b`.
    pub b: u32,
    /// Distance of the two descriptors: Euclidean, or the number of differing bits.
    pub distance: f32,
    /// Distance from `a` to the second nearest feature of `b`; infinite where there is none. It
    /// travels with the match so that the ratio test needs nothing else.
    pub second: f32,
}

impl Correspondence {
    /// Nearest over second nearest distance: 0 is certain, 1 is where nothing tells them apart,
    /// also where both distances are zero.
    pub fn ambiguity(&self) -> f32 {
        let ratio = self.distance / self.second;
        if ratio.is_nan() { 1.0 } else { ratio }
    }
}

/// Correspondences between two images, ordered by `a` unless a selector says otherwise.
pub type Correspondences = Vec<Correspondence>;
