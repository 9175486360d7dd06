//! What is compared: a source of matches, with the estimators that judge it.

use crate::config::{Changes, ConfigError, UnknownName};
use crate::estimators::{self, BuiltEstimator};
use crate::matchers::{self, BuiltMatcher, MATCHERS, Source};

/// A source of matches and the estimators that turn its matches into poses.
pub struct Contender {
    /// Where the matches come from.
    pub source: Source,
    /// The estimators, at least one; all get the same matches.
    pub estimators: Vec<Variant>,
}

/// An estimator under the name that it has in a run.
///
/// The name tells records apart, and nothing else: the random draws follow from the id of the
/// estimator, so that two variants of it (a parameter with two values) make the same.
pub struct Variant {
    /// The name in records and tables.
    pub name: String,
    /// The estimator.
    pub estimator: BuiltEstimator,
}

/// Why names and settings make no contenders.
#[derive(Debug, thiserror::Error)]
pub enum ContenderError {
    /// No matcher or estimator has this name.
    #[error(transparent)]
    Name(#[from] UnknownName),
    /// A parameter is wrong.
    #[error(transparent)]
    Config(#[from] ConfigError),
    /// A setting is for a matcher or estimator that is not asked for.
    #[error("`{0}` is given a setting and takes no part in this run")]
    TakesNoPart(String),
}

impl From<BuiltEstimator> for Variant {
    fn from(estimator: BuiltEstimator) -> Self {
        Self {
            name: estimator.id.clone(),
            estimator,
        }
    }
}

impl Contender {
    /// A matcher with estimators.
    pub fn new(
        matcher: BuiltMatcher,
        estimators: impl IntoIterator<Item = BuiltEstimator>,
    ) -> Self {
        Self {
            source: Source::Matcher(matcher),
            estimators: estimators.into_iter().map(Variant::from).collect(),
        }
    }

    /// The matchers called `ids` (`all` alone for all), each with the estimators called `estimators`,
    /// or with its own where that is empty; what `changes` does not name keeps its default.
    ///
    /// # Errors
    /// If a name or a parameter is unknown, a value is out of range, or `changes` names what is not
    /// asked for.
    pub fn from_ids(
        ids: &[String],
        estimators: &[String],
        changes: &Changes,
    ) -> Result<Vec<Self>, ContenderError> {
        let entries = match ids {
            [all] if all == "all" => MATCHERS.to_vec(),
            ids => (ids.iter())
                .map(|id| matchers::find(id))
                .collect::<Result<_, _>>()?,
        };
        let mut contenders = Vec::new();
        for entry in entries {
            let own = [entry.estimator().to_owned()];
            let estimators = if estimators.is_empty() {
                &own[..]
            } else {
                estimators
            };
            let estimators = (estimators.iter())
                .map(|id| Ok(estimators::find(id)?.build(changes.of(id))?))
                .collect::<Result<Vec<_>, ContenderError>>()?;
            let matcher = entry.build(changes.of(entry.id()))?;
            contenders.push(Self::new(matcher, estimators));
        }
        let takes_part = |id: &str| {
            contenders.iter().any(|contender: &Self| {
                contender.source.id() == id
                    || (contender.estimators.iter()).any(|variant| variant.estimator.id == id)
            })
        };
        match changes.ids().find(|id| !takes_part(id)) {
            Some(id) => Err(ContenderError::TakesNoPart(id.into())),
            None => Ok(contenders),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_setting_for_nobody_is_an_error() {
        let changes = Changes::parse(&["surf.ratio=0.7".to_owned()]).unwrap();
        let error = Contender::from_ids(&["sift".into()], &[], &changes).err();
        let message = error.unwrap().to_string();
        assert!(message.contains("`surf`") && message.contains("takes no part"));
    }
}
