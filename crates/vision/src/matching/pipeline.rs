//! A matcher from parts: an extractor, a search, selectors.

use super::{
    Correspondence, Correspondences, Matcher, MatcherError, NearestNeighbours, RatioTest, Search,
    Selector, View,
};
use crate::features::{DescriptorKind, Detections, Extractor, Features};
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
#[derive(Debug)]
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

    fn descriptors(&self) -> Option<DescriptorKind> {
        Some(self.extractor.kind())
    }

    fn search(&self, a: &Features, b: &Features) -> Result<Correspondences, MatcherError> {
        let [of_a, of_b] = [a, b].map(|features| features.descriptors.kind());
        if of_a != of_b {
            let message = format!("descriptors of different kinds, {of_a:?} and {of_b:?}");
            return Err(MatcherError(message));
        }
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
        let exist = |found: &Correspondence| {
            (found.a as usize) < a.features.len() && (found.b as usize) < b.features.len()
        };
        if let Some(wrong) = putative.iter().find(|found| !exist(found)) {
            let message = format!("{wrong:?} names a feature that does not exist");
            return Err(MatcherError(message));
        }
        if self.uses_pixels() && (a.image.is_none() || b.image.is_none()) {
            return Err(MatcherError(
                "a selector needs the pixels of both images".into(),
            ));
        }
        let mut matches = putative;
        for (index, selector) in self.selectors.iter().enumerate() {
            selector.select(a, b, &mut matches, seed.number(index as u64));
        }
        Ok(matches)
    }

    fn uses_pixels(&self) -> bool {
        self.selectors.iter().any(|selector| selector.uses_pixels())
    }

    fn uses_seed(&self) -> bool {
        self.selectors.iter().any(|selector| selector.uses_seed())
    }

    fn extraction_memory(&self, size: Size) -> usize {
        self.extractor.memory(size)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::features::{BinaryRows, Descriptors, FloatRows, Orb, OrbParams};
    use crate::matching::{Kvld, KvldParams, MutualCheck};

    fn of_orb(selector: Box<dyn Selector>) -> Pipeline {
        let mut pipeline = Pipeline::of_features(Orb::new(OrbParams::default()).expect("defaults"));
        pipeline.selectors = vec![selector];
        pipeline
    }

    fn nothing(kind: DescriptorKind) -> Features {
        Features::new(Size::new(20, 20), Vec::new(), Descriptors::empty(kind))
    }

    #[test]
    fn a_matcher_can_be_printed_whatever_its_parts_are() {
        let printed = format!("{:?}", of_orb(Box::new(MutualCheck)));
        assert_eq!(
            printed,
            "Pipeline { extractor: dyn Extractor of 256 bits, search: dyn Search, selectors: [dyn Selector] }"
        );
    }

    #[test]
    fn what_does_not_belong_together_is_an_error() {
        let pipeline = of_orb(Box::new(MutualCheck));
        let [floats, bits] = [
            DescriptorKind::Float { dim: 8 },
            DescriptorKind::Binary { bits: 256 },
        ]
        .map(nothing);
        assert!(pipeline.search(&bits, &bits).is_ok());
        assert!(pipeline.search(&floats, &bits).is_err());
        let view = View {
            features: &bits,
            image: None,
            camera: None,
        };
        assert!(pipeline.select(view, view, Vec::new(), Seed(0)).is_ok());
        let unknown = vec![Correspondence {
            a: 0,
            b: 0,
            distance: 0.0,
            second: 1.0,
        }];
        let refused = pipeline.select(view, view, unknown.clone(), Seed(0));
        assert!(refused.is_err());
        // Of one image it is known, of the other it is not.
        let row = BinaryRows::from_vec(256, vec![0; 4]);
        let one = Features::of_descriptors(Descriptors::Binary(row));
        let some = View {
            features: &one,
            ..view
        };
        for [a, b] in [[some, view], [view, some]] {
            let refused = pipeline.select(a, b, unknown.clone(), Seed(0));
            assert!(refused.is_err_and(|error| error.to_string().contains("does not exist")));
        }
        let kvld = of_orb(Box::new(
            Kvld::new(KvldParams::default()).expect("defaults"),
        ));
        let pixels = GrayImage::filled(Size::new(20, 20), 0);
        let seen = View {
            image: Some(&pixels),
            ..view
        };
        for [a, b] in [[view, view], [seen, view], [view, seen]] {
            let refused = kvld.select(a, b, Vec::new(), Seed(0));
            assert!(refused.is_err_and(|error| error.to_string().contains("pixels")));
        }
        assert!(kvld.select(seen, seen, Vec::new(), Seed(0)).is_ok());
    }

    #[test]
    fn selectors_get_the_images_in_their_order() {
        let features = |values: &[f32]| {
            let rows = FloatRows::from_vec(1, values.to_vec());
            Features::of_descriptors(Descriptors::Float(rows))
        };
        // The first of b is nearest to both of a, and the second of a to it.
        let (a, b) = (features(&[5.0, 0.1]), features(&[0.2, 50.0]));
        let [view_a, view_b] = [&a, &b].map(|features| View {
            features,
            image: None,
            camera: None,
        });
        let pipeline = of_orb(Box::new(MutualCheck));
        let putative = pipeline.search(&a, &b).expect("of one kind");
        let kept = pipeline.select(view_a, view_b, putative, Seed(0));
        let kept = kept.expect("it needs no pixels");
        assert_eq!(
            kept.iter().map(|m| (m.a, m.b)).collect::<Vec<_>>(),
            [(1, 0)]
        );
    }

    /// A search that says what it was asked for: how many features, and which ratio, 0 for none.
    struct Echo;

    impl Search for Echo {
        fn search(&self, a: &Features, b: &Features) -> Correspondences {
            self.search_below(a, b, 0.0)
        }

        fn search_below(&self, a: &Features, b: &Features, ratio: f32) -> Correspondences {
            let [a, b] = [a, b].map(|features| features.len() as u32);
            vec![Correspondence {
                a,
                b,
                distance: ratio,
                second: 1.0,
            }]
        }
    }

    #[test]
    fn only_a_ratio_that_comes_first_spares_the_search() {
        let none = nothing(DescriptorKind::Float { dim: 1 });
        let two =
            Features::of_descriptors(Descriptors::Float(FloatRows::from_vec(1, vec![0.0; 2])));
        let ratio = || -> Box<dyn Selector> { Box::new(RatioTest::new(0.7).expect("in range")) };
        let mutual = || -> Box<dyn Selector> { Box::new(MutualCheck) };
        for (selectors, expected) in [
            (vec![], 0.0),
            (vec![ratio()], 0.7),
            (vec![ratio(), mutual()], 0.7),
            (vec![mutual(), ratio()], 0.0),
        ] {
            let mut pipeline = of_orb(mutual());
            (pipeline.search, pipeline.selectors) = (Box::new(Echo), selectors);
            let asked = pipeline.search(&two, &none).expect("of one kind")[0];
            assert_eq!((asked.a, asked.b, asked.distance), (2, 0, expected));
        }
    }
}
