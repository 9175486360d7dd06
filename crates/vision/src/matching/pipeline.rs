//! A matcher from parts: an extractor, a search, selectors.

use super::{
    Correspondences, Matcher, MatcherError, NearestNeighbours, RatioTest, Search, Selector, View,
};
use crate::features::{Detections, Extractor, Features};
use crate::image::{GrayImage, Size};
use crate::seed::Seed;

/// Extraction, search and any number of selectors, one after the other. Nearly every matcher is a pipeline.
///
/// ```
/// use matchbench_vision::features::{Orb, OrbParams};
/// use matchbench_vision::matching::{NearestNeighbours, Pipeline, RatioTest};
///
/// let matcher = Pipeline {
///     extractor: Box::new(Orb::new(OrbParams { features: 2000, ..OrbParams::default() })?),
///     search: Box::new(NearestNeighbours),
///     selectors: vec![Box::new(RatioTest::new(0.7)?)],
/// };
/// # Ok::<(), matchbench_vision::ParamError>(())
/// ```
pub struct Pipeline {
    /// Finds and describes features.
    pub extractor: Box<dyn Extractor>,
    /// Compares descriptors.
    pub search: Box<dyn Search>,
    /// Prunes the matches, in this order.
    pub selectors: Vec<Box<dyn Selector>>,
}

impl Pipeline {
    /// The usual pipeline for local features: `extractor`, exact nearest neighbours, ratio test at 0.8.
    pub fn of_features(extractor: impl Extractor + 'static) -> Self {
        Self {
            extractor: Box::new(extractor),
            search: Box::new(NearestNeighbours),
            selectors: vec![Box::new(RatioTest::default())],
        }
    }
}

impl Matcher for Pipeline {
    fn extract(&self, image: &GrayImage) -> Result<Features, MatcherError> {
        Ok(self.extractor.extract(image))
    }

    fn extract_sharing(
        &self,
        image: &GrayImage,
        detections: &mut dyn Detections,
    ) -> Result<Features, MatcherError> {
        Ok(self.extractor.extract_sharing(image, detections))
    }

    fn search(&self, a: &Features, b: &Features) -> Result<Correspondences, MatcherError> {
        let first = self.selectors.first().map(|first| &**first);
        Ok(self.search.search_for(a, b, first))
    }

    fn select(
        &self,
        a: View<'_>,
        b: View<'_>,
        putative: Correspondences,
        seed: Seed,
    ) -> Result<Correspondences, MatcherError> {
        let mut matches = putative;
        for (index, selector) in self.selectors.iter().enumerate() {
            selector.select(a, b, &mut matches, seed.number(index as u64));
        }
        Ok(matches)
    }

    fn uses_pixels(&self) -> bool {
        self.selectors.iter().any(|selector| selector.uses_pixels())
    }

    fn extraction_memory(&self, size: Size) -> usize {
        self.extractor.memory(size)
    }
}
