//! What is compared: a source of matches, with the estimators that judge it.

use std::io;
use std::path::Path;

use crate::cache::FeatureCache;
use crate::config::{Changes, ConfigError, UnknownName};
use crate::estimators::{self, BuiltEstimator, ESTIMATORS};
use crate::external::{External, Log, Manifest, ManifestError, StartError};
use crate::matchers::{self, BuiltMatcher, BuiltPointSource, MATCHERS, Source};

/// A source of matches and the estimators that turn its matches into poses.
pub struct Contender {
    /// Where the matches come from.
    pub source: Source,
    /// The estimators, at least one; all get the same matches.
    pub estimators: Vec<Variant>,
}

/// Where matchers from outside leave what they print, and the features that they describe.
#[derive(Clone, Copy, Debug)]
pub struct Outside<'a> {
    /// The folder of their logs.
    pub logs: &'a Path,
    /// The cache of features.
    pub cache: &'a FeatureCache,
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
    /// The manifest of a matcher from outside is wrong.
    #[error(transparent)]
    Manifest(#[from] ManifestError),
    /// A matcher from outside cannot be started, where none may be missing.
    #[error(transparent)]
    Start(#[from] StartError),
    /// No log can be written for a matcher from outside.
    #[error(transparent)]
    Log(#[from] io::Error),
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

    /// The matchers of these names, none of which may be missing; see [`Contender::from_names`].
    ///
    /// # Errors
    /// As [`Contender::from_names`]; if a matcher from outside does not start.
    pub fn all_of(
        names: &[String],
        estimators: &[String],
        changes: &Changes,
        outside: Option<&Outside<'_>>,
    ) -> Result<Vec<Self>, ContenderError> {
        let (contenders, absent) =
            Self::from_names(names, Vec::new(), estimators, changes, outside)?;
        match absent.into_iter().next() {
            Some(error) => Err(error.into()),
            None => Ok(contenders),
        }
    }

    /// The matchers called `names` (`all` alone for all), each with the estimators called `estimators`,
    /// or with its own where that is empty; what `changes` does not name keeps its default.
    ///
    /// A name may also be the path of a manifest (see [`external`](crate::external)): its program is
    /// started, which may take its time. Matchers that do not start are left out, and returned with the
    /// reason. After them come the `sources` of matched points, such as files; their own estimator is
    /// `best`.
    ///
    /// # Errors
    /// If a name or a parameter is unknown, a value is out of range, or `changes` names what is not
    /// asked for; if a manifest is wrong or a log cannot be written; without an `outside`, if there is
    /// a path.
    pub fn from_names(
        names: &[String],
        sources: Vec<BuiltPointSource>,
        estimators: &[String],
        changes: &Changes,
        outside: Option<&Outside<'_>>,
    ) -> Result<(Vec<Self>, Vec<StartError>), ContenderError> {
        let all: Vec<String> = MATCHERS.iter().map(|entry| entry.id().to_owned()).collect();
        let names = match names {
            [name] if name == "all" => &all,
            names => names,
        };
        let built = |own: &str| {
            let own = [own.to_owned()];
            let ids = match estimators {
                [] => &own[..],
                estimators => estimators,
            };
            let built = ids.iter().map(|id| {
                let estimator = estimators::find(id)?.build(changes.of(id))?;
                Ok(Variant::from(estimator))
            });
            built.collect::<Result<Vec<_>, ContenderError>>()
        };
        let (mut contenders, mut absent) = (Vec::new(), Vec::new());
        for name in names {
            if let Some(outside) = outside
                && Manifest::is_path(name)
            {
                let manifest = manifest(Path::new(name), changes)?;
                let estimators = built(manifest.estimator.as_deref().unwrap_or("ransac-e"))?;
                let log = outside.logs.join(format!("{}.log", manifest.name));
                match External::start(manifest, Log::open(&log)?) {
                    Err(error) => absent.push(error),
                    Ok(external) => contenders.push(Self {
                        source: Source::Points(external.into_source(outside.cache.clone())),
                        estimators,
                    }),
                }
                continue;
            }
            let entry = matchers::find(name)?;
            let estimators = built(entry.estimator())?;
            let matcher = matchers::build(entry, changes.of(entry.id()))?;
            contenders.push(Self {
                source: Source::Matcher(matcher),
                estimators,
            });
        }
        for source in sources {
            contenders.push(Self {
                source: Source::Points(source),
                estimators: built("best")?,
            });
        }
        let takes_part = |id: &str| {
            contenders.iter().any(|contender: &Self| {
                contender.source.id() == id
                    || (contender.estimators.iter()).any(|variant| variant.estimator.id == id)
            }) || absent.iter().any(|error: &StartError| error.name == id)
        };
        match changes.ids().find(|id| !takes_part(id)) {
            Some(id) => Err(ContenderError::TakesNoPart(id.into())),
            None => Ok((contenders, absent)),
        }
    }
}

/// The manifest at `path` with what `changes` has for it; it cannot be called as what is built in.
///
/// # Errors
/// If the manifest is wrong, or a change does not fit it.
pub fn manifest(path: &Path, changes: &Changes) -> Result<Manifest, ManifestError> {
    let matchers = MATCHERS.iter().map(|entry| entry.id());
    let taken: Vec<&str> = matchers
        .chain(ESTIMATORS.iter().map(|entry| entry.id()))
        .collect();
    let manifest = Manifest::read(path, &taken)?;
    match changes.of(&manifest.name) {
        Some(changes) => manifest.with(changes),
        None => Ok(manifest),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_setting_for_nobody_is_an_error() {
        let changes = Changes::parse(&["surf.ratio=0.7".to_owned()]).unwrap();
        let error = Contender::all_of(&["sift".into()], &[], &changes, None).err();
        let message = error.unwrap().to_string();
        assert!(message.contains("`surf`") && message.contains("takes no part"));
    }
}
