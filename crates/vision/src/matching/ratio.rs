//! The ratio test: a match is trusted where the second nearest is clearly further away.
//!
//! D. G. Lowe, "Distinctive Image Features from Scale-Invariant Keypoints", IJCV 60(2), 2004,
//! section 7.1.
//!
//! | symbol | field | default | source |
//! | --- | --- | --- | --- |
//! | - | [`RatioTest::ratio`] | 0.8 | section 7.1; the evaluation setting of the MatchBench paper |
//!
//! *Left open by the paper*: the comparison is strict and made in `f32`, so two equally near
//! features are dropped, also if both are at distance 0. Where there is no second neighbour the test is
//! undefined, and the match is dropped too.

use super::{Correspondence, Correspondences, Selector, View};
use crate::params::ParamError;
use crate::seed::Seed;

/// Keeps a match if its distance is below [`RatioTest::ratio`] times the distance to the second nearest.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[cfg_attr(feature = "serde", serde(default, deny_unknown_fields))]
pub struct RatioTest {
    /// Largest ratio of the two distances, itself excluded; sensible in `(0, 1]`.
    pub ratio: f32,
}

impl Default for RatioTest {
    fn default() -> Self {
        Self { ratio: 0.8 }
    }
}

impl RatioTest {
    /// A test with this ratio.
    ///
    /// # Errors
    /// If it is not in `(0, 1]`.
    pub fn new(ratio: f32) -> Result<Self, ParamError> {
        let allowed = ratio > 0.0 && ratio <= 1.0;
        ParamError::unless(allowed, "ratio", ratio, "above 0 and at most 1")?;
        Ok(Self { ratio })
    }

    /// Whether a match is kept.
    pub fn keeps(&self, found: &Correspondence) -> bool {
        found.second.is_finite() && found.distance < self.ratio * found.second
    }
}

impl Selector for RatioTest {
    fn select(&self, _a: View<'_>, _b: View<'_>, matches: &mut Correspondences, _seed: Seed) {
        matches.retain(|found| self.keeps(found));
    }

    fn ratio(&self) -> Option<f32> {
        Some(self.ratio)
    }

    fn uses_seed(&self) -> bool {
        false
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::features::{DescriptorKind, Descriptors, Features};
    use crate::image::Size;

    #[test]
    fn only_clear_matches_stay_and_in_their_order() {
        let cases = [
            (7.9, 10.0, true),
            (8.0, 10.0, false), // strict
            (8.1, 10.0, false),
            (0.0, 1.0, true),
            (0.0, 0.0, false),
            (1.0, f32::INFINITY, false),
            (f32::NAN, 1.0, false),
        ];
        let mut matches: Correspondences = (0..)
            .zip(cases)
            .map(|(a, (distance, second, _))| Correspondence {
                a,
                b: 0,
                distance,
                second,
            })
            .collect();
        let features = Features::new(
            Size::new(1, 1),
            Vec::new(),
            Descriptors::empty(DescriptorKind::Float { dim: 1 }),
        );
        let view = View {
            features: &features,
            image: None,
            camera: None,
        };
        RatioTest::default().select(view, view, &mut matches, Seed(0));
        let kept: Vec<u32> = matches.iter().map(|m| m.a).collect();
        assert_eq!(kept, [0, 3]);
        assert!(
            (0..)
                .zip(cases)
                .all(|(a, case)| case.2 == kept.contains(&a))
        );
    }
}
