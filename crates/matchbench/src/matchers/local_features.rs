//! The paper's first category of matchers: local features, nearest neighbours, the ratio test.
//!
//! D. G. Lowe, "Distinctive Image Features from Scale-Invariant Keypoints", International Journal
//! of Computer Vision 60(2), 2004, section 7.1, for the ratio test; the paper's evaluation uses it
//! with every local feature. Each of these matchers is a file with its [`LocalFeatures`]; they differ only in
//! the extractor.
//!
//! | parameter | default | source |
//! | --- | --- | --- |
//! | `extractor` | the extractor's | OpenCV's, as in the paper's evaluation |
//! | `selection` | `ratio` | which matches are kept: `ratio`, Lowe's test, as in the paper's evaluation; `mutual`, nearest of each other; `smnn`, Lowe's test in both directions; `fginn`, Lowe's test with the second neighbour of another place |
//! | `ratio` | 0.8 | Lowe, section 7.1; refused with `mutual`, which has none |
//! | `radius_px` | 10 | Mishkin et al. 2015; refused but with `fginn` |
//! | `search` | `exact` | `kdforest` is the paper's evaluation (FLANN), for real-valued descriptors |
//! | `kdforest` | 4 trees, 32 checks | FLANN; refused where the search is exact |
//!
//! *Differs from the paper's evaluation* in the search for real-valued descriptors. It is exact here unless
//! `kdforest` is asked for, and approximate there.

use matchbench_vision::ParamError;
use matchbench_vision::features::{DescriptorKind, Extractor};
use matchbench_vision::matching::{
    Fginn, KdForest, KdForestParams, MutualCheck, NearestNeighbours, Pipeline, RatioTest, Search,
    Selector, SymmetricRatioTest,
};
use schemars::JsonSchema;
use serde::de::DeserializeOwned;
use serde::{Deserialize, Serialize};
use serde_json::Value;

use super::{BuiltMatcher, Extraction, MatcherEntry};
use crate::config::{ConfigError, Parameter, parameters, parse_params, to_json};

/// A matcher that is an extractor with parameters `P`, followed by search and ratio test.
pub(super) struct LocalFeatures<P> {
    /// Id of the matcher and of its extractor.
    pub(super) id: &'static str,
    /// What it is, in a few words.
    pub(super) summary: &'static str,
    /// The paper, in full.
    pub(super) reference: &'static str,
    /// Increased whenever the same image and parameters give other features than before, so that cached
    /// features are not used again.
    pub(super) revision: u32,
    /// Parameters of earlier versions that had no effect: where they were (a JSON pointer), and their name.
    pub(super) removed: &'static [(&'static str, &'static str)],
    /// Everything that its keypoints depend on, if other matchers use the same keypoints.
    pub(super) detection: fn(&P) -> Option<Extraction>,
    /// The extractor with these parameters.
    pub(super) extractor: fn(P) -> Result<Box<dyn Extractor>, ParamError>,
}

#[derive(Clone, Debug, Serialize, Deserialize, JsonSchema)]
#[serde(
    default,
    deny_unknown_fields,
    bound(deserialize = "P: DeserializeOwned + Default")
)]
#[schemars(bound = "P: JsonSchema + Serialize + Default")]
struct Params<P> {
    extractor: P,
    selection: SelectionName,
    /// Largest ratio of the distances of the nearest and the other neighbour, itself excluded; in `(0, 1]`. `mutual`
    /// does not use it.
    ratio: f32,
    /// Only for `fginn`: neighbours that lie nearer to the first, in pixels, are at the same place.
    radius_px: f32,
    search: SearchName,
    kdforest: KdForestParams,
}

/// Which nearest neighbours are kept.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
enum SelectionName {
    /// Those that are clearly nearer than the second neighbour.
    #[default]
    Ratio,
    /// Those where each is the nearest of the other.
    Mutual,
    /// Those that are clearly nearer than the second neighbour, in both directions.
    Smnn,
    /// Those that are clearly nearer than the first neighbour at another place.
    Fginn,
}

/// How the nearest neighbours are searched.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
enum SearchName {
    /// Every descriptor of one image is compared with every descriptor of the other.
    #[default]
    Exact,
    /// Randomised kd-trees, as in the paper's evaluation.
    KdForest,
}

impl<P: Default> Default for Params<P> {
    fn default() -> Self {
        Self {
            extractor: P::default(),
            selection: SelectionName::default(),
            ratio: RatioTest::default().ratio,
            radius_px: Fginn::default().radius_px,
            search: SearchName::default(),
            kdforest: KdForestParams::default(),
        }
    }
}

impl SelectionName {
    /// The selector; or an error if the options contradict each other.
    fn build(self, ratio: f32, radius_px: f32) -> Result<Box<dyn Selector>, ParamError> {
        let test = RatioTest::new(ratio)?;
        if self == Self::Mutual && test != RatioTest::default() {
            let message =
                "`ratio` is set, but `selection` is \"mutual\", which has none; set it to \"smnn\"";
            return Err(ParamError(message.into()));
        }
        if self != Self::Fginn && radius_px != Fginn::default().radius_px {
            let message = "`radius_px` is set, but `selection` is not \"fginn\"; set it so";
            return Err(ParamError(message.into()));
        }
        Ok(match self {
            Self::Ratio => Box::new(test),
            Self::Mutual => Box::new(MutualCheck),
            Self::Smnn => Box::new(SymmetricRatioTest::new(ratio)?),
            Self::Fginn => Box::new(Fginn::new(test, radius_px)?),
        })
    }
}

impl SearchName {
    /// The search for descriptors of this `kind`; or an error if there is none.
    fn build(
        self,
        kdforest: KdForestParams,
        kind: DescriptorKind,
    ) -> Result<Box<dyn Search>, ParamError> {
        match (self, kind) {
            (Self::Exact, _) if kdforest != KdForestParams::default() => {
                let message =
                    "`kdforest` is set, but `search` is \"exact\"; set it to \"kdforest\"";
                Err(ParamError(message.into()))
            }
            (Self::Exact, _) => Ok(Box::new(NearestNeighbours)),
            (Self::KdForest, DescriptorKind::Float { .. }) => {
                Ok(Box::new(KdForest::new(kdforest)?))
            }
            (Self::KdForest, DescriptorKind::Binary { .. }) => {
                let message = "`search` is \"kdforest\", but bits are searched exactly alone; \
                               leave it \"exact\"";
                Err(ParamError(message.into()))
            }
        }
    }
}

impl<P: Serialize + DeserializeOwned + Default + JsonSchema> MatcherEntry for LocalFeatures<P> {
    fn id(&self) -> &'static str {
        self.id
    }

    fn summary(&self) -> &'static str {
        self.summary
    }

    fn reference(&self) -> &'static str {
        self.reference
    }

    fn defaults(&self) -> Value {
        to_json(&Params::<P>::default())
    }

    fn parameters(&self) -> Vec<Parameter> {
        parameters::<Params<P>>(&self.defaults())
    }

    fn modernized(&self, written: &Value) -> Value {
        let mut params = written.clone();
        for (part, name) in self.removed {
            if let Some(part) = params.pointer_mut(part).and_then(Value::as_object_mut) {
                part.remove(*name);
            }
        }
        // Before there was a choice, all matchers did what these defaults do.
        if let (Some(params), Value::Object(defaults)) = (params.as_object_mut(), self.defaults()) {
            for name in ["selection", "radius_px"] {
                params.entry(name).or_insert_with(|| defaults[name].clone());
            }
        }
        params
    }

    fn build(&self, params: Option<&Value>) -> Result<BuiltMatcher, ConfigError> {
        let params: Params<P> = parse_params(self.id, params)?;
        let refused = |error| ConfigError::new(self.id, error);
        let selector = params.selection.build(params.ratio, params.radius_px);
        let selector = selector.map_err(refused)?;
        let json = to_json(&params);
        let extraction = Extraction {
            extractor: self.id.into(),
            params: to_json(&params.extractor),
            revision: self.revision,
        };
        let detection = (self.detection)(&params.extractor);
        let extractor = (self.extractor)(params.extractor).map_err(refused)?;
        let search = params.search.build(params.kdforest, extractor.kind());
        Ok(BuiltMatcher {
            id: self.id.into(),
            params: json,
            extraction,
            detection,
            matcher: Box::new(Pipeline {
                extractor,
                search: search.map_err(refused)?,
                selectors: vec![selector],
            }),
        })
    }
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeSet;

    use matchbench_vision::image::{GrayImage, Size};
    use matchbench_vision::matching::View;
    use matchbench_vision::seed::Seed;
    use serde_json::json;

    use super::super::orb::ORB;
    use super::super::sift::SIFT;
    use super::*;

    #[test]
    fn parameters_are_plain_numbers() {
        assert_eq!(SIFT.defaults()["ratio"], json!(0.8));
        assert_eq!(
            SIFT.defaults()["extractor"]["contrast_threshold"],
            json!(0.04)
        );
    }

    #[test]
    fn the_ratio_does_not_change_the_features_but_the_extractor_does() {
        let extraction = |params: &Value| SIFT.build(Some(params)).unwrap().extraction;
        let default = extraction(&json!({}));
        assert_eq!(extraction(&json!({"ratio": 0.7})), default);
        assert_ne!(extraction(&json!({"extractor": {"sigma": 1.5}})), default);
    }

    #[test]
    fn values_out_of_range_are_refused_by_name() {
        for (params, named) in [
            (json!({"ratio": 0}), "ratio"),
            (json!({"ratio": 1.01}), "ratio"),
            (json!({"ratio": "0.8"}), "0.8"),
            (json!({"extractor": {"octave_layers": 0}}), "octave_layers"),
            (json!({"search": "flann"}), "flann"),
            (
                json!({"search": "kdforest", "kdforest": {"checks": 1}}),
                "checks",
            ),
            (json!({"kdforest": {"trees": 8}}), "kdforest"),
            (json!({"selection": "lowe"}), "lowe"),
            (json!({"selection": "mutual", "ratio": 0.9}), "ratio"),
            (json!({"radius_px": 5}), "radius_px"),
            (json!({"selection": "fginn", "radius_px": -1}), "radius_px"),
        ] {
            let message = SIFT.build(Some(&params)).expect_err("refused").to_string();
            assert!(
                message.contains(named) && message.contains("sift"),
                "{message}"
            );
        }
    }

    #[test]
    fn every_feature_has_every_selection_and_each_parameter_of_it_acts() {
        let image = |shift: usize| {
            GrayImage::from_fn(Size::new(160, 120), |x, y| {
                let patch = Seed(6)
                    .number(((x + shift) / 9) as u64)
                    .number((y / 7) as u64);
                let noise = Seed(shift as u64).number(x as u64).number(y as u64);
                (patch.rng().below(240) + noise.rng().below(16)) as u8
            })
        };
        let images = [image(0), image(4)];
        for entry in [&SIFT as &dyn MatcherEntry, &ORB] {
            let selected = |params: Value| {
                let matcher = entry.build(Some(&params)).unwrap().matcher;
                let [a, b] = [0, 1].map(|index| matcher.extract(&images[index]).unwrap());
                let putative = matcher.search(&a, &b).unwrap();
                let [a, b] = [&a, &b].map(|features| View {
                    features,
                    image: None,
                    camera: None,
                });
                let selected = matcher.select(a, b, putative, Seed(0)).unwrap();
                selected.iter().map(|m| (m.a, m.b)).collect::<BTreeSet<_>>()
            };
            let [ratio, mutual, smnn, fginn] = ["ratio", "mutual", "smnn", "fginn"]
                .map(|name| selected(json!({"selection": name})));
            assert!(smnn.is_subset(&ratio) && smnn.is_subset(&mutual) && smnn.len() > 10);
            assert!(ratio.is_subset(&fginn) && ratio.len() < fginn.len());
            assert!(mutual != ratio && mutual != fginn);
            for changed in [
                json!({"selection": "smnn", "ratio": 0.5}),
                json!({"selection": "fginn", "ratio": 0.5}),
                json!({"selection": "fginn", "radius_px": 2}),
            ] {
                let with = |name: &str| json!({"selection": name});
                let before = selected(with(changed["selection"].as_str().unwrap()));
                assert_ne!(
                    selected(changed.clone()),
                    before,
                    "{}: {changed}",
                    entry.id()
                );
            }
        }
    }

    #[test]
    fn kd_trees_find_what_the_exact_search_finds_with_enough_checks() {
        let image = GrayImage::from_fn(Size::new(160, 120), |x, y| {
            let patch = Seed(6).number((x / 9) as u64).number((y / 7) as u64);
            patch.rng().below(256) as u8
        });
        let matches = |params: Value| {
            let matcher = SIFT.build(Some(&params)).unwrap().matcher;
            let features = matcher.extract(&image).unwrap();
            matcher.search(&features, &features).unwrap()
        };
        let exact = matches(json!({}));
        assert!(exact.len() > 50);
        let kdforest = |params: Value| matches(json!({"search": "kdforest", "kdforest": params}));
        assert_eq!(kdforest(json!({"checks": exact.len()})), exact);
        assert_ne!(kdforest(json!({"checks": 2, "trees": 1})), exact);
    }

    #[test]
    fn bits_are_not_searched_by_kd_trees() {
        let refused = ORB.build(Some(&json!({"search": "kdforest"}))).err();
        let message = refused.expect("refused").to_string();
        assert!(
            message.contains("orb") && message.contains("kdforest") && message.contains("bits"),
            "{message}"
        );
    }
}
