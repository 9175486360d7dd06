//! What a matcher is: three stages (extract, search, select), each of which the caller can time.

use std::fmt;

use super::{Correspondence, Correspondences, MatcherError};
use crate::features::{DescriptorKind, Detections, Features};
use crate::geometry::{Camera, MatchedPoints};
use crate::image::{GrayImage, Size};
use crate::seed::Seed;

/// One image, with the data that selection may use.
#[derive(Clone, Copy, Debug)]
pub struct View<'a> {
    /// Its features.
    pub features: &'a Features,
    /// Its pixels, if [`Matcher::uses_pixels`] is true for the matcher, else `None`.
    pub image: Option<&'a GrayImage>,
    /// Its camera, if it is known.
    pub camera: Option<&'a Camera>,
}

/// A feature matcher in the sense of the MatchBench paper (Bian et al.): two images in, correspondences out.
///
/// Users of the library implement it too, so every stage may fail. The benchmark counts a failure against
/// the pair and goes on.
pub trait Matcher: Send + Sync {
    /// Features of one image. Called once per image.
    ///
    /// # Errors
    /// If the stage fails, with the reason in words.
    fn extract(&self, image: &GrayImage) -> Result<Features, MatcherError>;

    /// The same features, where keypoints that another matcher with the same detector found before are taken
    /// from `detections`.
    ///
    /// # Errors
    /// If the stage fails, with the reason in words.
    fn extract_sharing(
        &self,
        image: &GrayImage,
        _detections: &mut dyn Detections,
    ) -> Result<Features, MatcherError> {
        self.extract(image)
    }

    /// Type and length of the descriptors of all its features, `None` if they are not known. Features that were kept and
    /// have others are not taken for its own.
    fn descriptors(&self) -> Option<DescriptorKind> {
        None
    }

    /// Putative correspondences. Called once per pair. Those that [`select`](Self::select) drops by its ratio may have
    /// other candidates and distances than the two nearest.
    ///
    /// # Errors
    /// If the stage fails, with the reason in words.
    fn search(&self, a: &Features, b: &Features) -> Result<Correspondences, MatcherError>;

    /// The correspondences that are kept. Called once per pair.
    ///
    /// # Errors
    /// If the stage fails, with the reason in words.
    fn select(
        &self,
        a: View<'_>,
        b: View<'_>,
        putative: Correspondences,
        seed: Seed,
    ) -> Result<Correspondences, MatcherError>;

    /// The points of the correspondences that were kept: those of their keypoints, unless a matcher finds better ones.
    /// Called once per pair.
    ///
    /// # Errors
    /// If a correspondence names a feature that does not exist, or if the stage fails, with the reason in words.
    fn place(
        &self,
        a: View<'_>,
        b: View<'_>,
        selected: &[Correspondence],
    ) -> Result<MatchedPoints, MatcherError> {
        MatchedPoints::of_matches(selected, a.features, b.features)
    }

    /// Whether [`Matcher::select`] or [`Matcher::place`] uses the pixels, so that they must be decoded for each pair.
    /// KVLD and [`Refined`](super::Refined) do.
    fn uses_pixels(&self) -> bool {
        false
    }

    /// Whether [`Matcher::select`] or [`Matcher::place`] uses its seed. If not, all repetitions of a pair share one
    /// selection. CODE and RepMatch draw random numbers.
    fn uses_seed(&self) -> bool {
        true
    }

    /// About how many bytes of memory [`Matcher::extract`] needs for an image of this `size`. With it, an image
    /// that would not fit into memory is refused beforehand. 0 if it is not known.
    fn extraction_memory(&self, _size: Size) -> usize {
        0
    }

    /// Runs all stages on two images, for callers that have one pair and need not keep features. The `cameras`
    /// of `a` and `b` are used only by matchers that select with a pose (RepMatch).
    ///
    /// # Errors
    /// If a stage fails.
    fn match_images(
        &self,
        a: &GrayImage,
        b: &GrayImage,
        cameras: Option<(&Camera, &Camera)>,
        seed: Seed,
    ) -> Result<MatchedPoints, MatcherError> {
        let (features_a, features_b) = (self.extract(a)?, self.extract(b)?);
        let putative = self.search(&features_a, &features_b)?;
        let view_a = View {
            features: &features_a,
            image: self.uses_pixels().then_some(a),
            camera: cameras.map(|(camera, _)| camera),
        };
        let view_b = View {
            features: &features_b,
            image: self.uses_pixels().then_some(b),
            camera: cameras.map(|(_, camera)| camera),
        };
        let selected = self.select(view_a, view_b, putative, seed)?;
        self.place(view_a, view_b, &selected)
    }
}

/// Finds putative correspondences by comparing descriptors.
pub trait Search: Send + Sync {
    /// For each feature of `a`, the nearest of `b` or several candidates, in the order of `a`.
    ///
    /// # Panics
    /// If the two images were described by descriptors of different kinds.
    fn search(&self, a: &Features, b: &Features) -> Correspondences;

    /// The same for a [`Selector`] that drops what is not below a `ratio`, in less time. Every correspondence with
    /// `distance < ratio * second` is exactly that of [`search`](Self::search). For the other features of `a` it may be any
    /// that fails this test too.
    fn search_below(&self, a: &Features, b: &Features, _ratio: f32) -> Correspondences {
        self.search(a, b)
    }

    /// Searches for a pipeline whose first selector is `first`. If that has a ratio, this is
    /// [`search_below`](Self::search_below) with it, since what it drops reaches no later selector.
    fn search_for(
        &self,
        a: &Features,
        b: &Features,
        first: Option<&dyn Selector>,
    ) -> Correspondences {
        match first.and_then(Selector::ratio) {
            Some(ratio) => self.search_below(a, b, ratio),
            None => self.search(a, b),
        }
    }
}

/// Drops correspondences that look wrong.
pub trait Selector: Send + Sync {
    /// Keeps only the good ones of `matches`, in their order.
    fn select(&self, a: View<'_>, b: View<'_>, matches: &mut Correspondences, seed: Seed);

    /// A ratio, if this selector drops every correspondence that fails `distance < ratio * second`, and if those that it
    /// drops so do not influence which others it keeps. Only then may a search [save work](Search::search_below).
    fn ratio(&self) -> Option<f32> {
        None
    }

    /// Whether it needs [`View::image`].
    fn uses_pixels(&self) -> bool {
        false
    }

    /// Whether what it keeps depends on the seed. If not, it may be asked once for several seeds.
    fn uses_seed(&self) -> bool {
        true
    }
}

/// What holds a matcher can be printed, whatever that is.
impl fmt::Debug for dyn Matcher + '_ {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("dyn Matcher")
    }
}

impl fmt::Debug for dyn Search + '_ {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("dyn Search")
    }
}

impl fmt::Debug for dyn Selector + '_ {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("dyn Selector")
    }
}
