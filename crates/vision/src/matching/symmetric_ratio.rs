//! The ratio test in both directions: a match is trusted where each feature is the other's nearest, and
//! clearly so.
//!
//! D. G. Lowe, "Distinctive Image Features from Scale-Invariant Keypoints", IJCV 60(2), 2004, section 7.1,
//! asks from `a` to `b`; here `b` is asked too. That search is exact, whichever search made the matches, and
//! made only for the features of `b` that are still matched.
//!
//! | symbol | field | default | source |
//! | --- | --- | --- | --- |
//! | - | [`SymmetricRatioTest::ratio`] | 0.8 | as [`RatioTest`] |

use super::mutual::keep_mutual;
use super::{Correspondences, RatioTest, Selector, View};
use crate::params::ParamError;
use crate::seed::Seed;

/// Keeps a match if it passes the [`RatioTest`] in both directions: its feature of `b` must also have this
/// feature of `a` as its nearest, and that match must pass the test too.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct SymmetricRatioTest {
    /// The test that is applied in each direction.
    one_way: RatioTest,
}

impl SymmetricRatioTest {
    /// A test with this ratio.
    ///
    /// # Errors
    /// If it is not in `(0, 1]`.
    pub fn new(ratio: f32) -> Result<Self, ParamError> {
        let one_way = RatioTest::new(ratio)?;
        Ok(Self { one_way })
    }
}

impl Selector for SymmetricRatioTest {
    fn select(&self, a: View<'_>, b: View<'_>, matches: &mut Correspondences, seed: Seed) {
        self.one_way.select(a, b, matches, seed);
        keep_mutual(a, b, matches, |back| self.one_way.select(b, a, back, seed));
    }

    fn ratio(&self) -> Option<f32> {
        self.one_way.ratio()
    }

    fn uses_seed(&self) -> bool {
        self.one_way.uses_seed()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::features::{Descriptors, Features, FloatRows};
    use crate::matching::{NearestNeighbours, Search};

    fn features(values: &[f32]) -> Features {
        let rows = FloatRows::from_vec(1, values.to_vec());
        Features::of_descriptors(Descriptors::Float(rows))
    }

    #[test]
    fn both_directions_must_be_clear() {
        // 0 and 0.4 both have 0.1 as their clear nearest, which is nearer to 0, but not clearly enough at
        // 0.3; 9 and 10 are a clear pair.
        let (a, b) = (features(&[0.0, 0.4, 10.0]), features(&[0.1, 9.0]));
        let left = |ratio| {
            let mut matches = NearestNeighbours.search(&a, &b);
            let [a, b] = [&a, &b].map(|features| View {
                features,
                image: None,
                camera: None,
            });
            let test = SymmetricRatioTest::new(ratio).unwrap();
            test.select(a, b, &mut matches, Seed(0));
            matches.iter().map(|m| (m.a, m.b)).collect::<Vec<_>>()
        };
        assert_eq!(left(0.8), [(0, 0), (2, 1)]);
        assert_eq!(left(0.3), [(2, 1)]);
        assert!(SymmetricRatioTest::new(0.0).is_err());
    }
}
