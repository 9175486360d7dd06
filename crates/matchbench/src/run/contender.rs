//! A contender, which is what a run compares: a source of matches, with the estimators that judge it.

use std::io;
use std::path::Path;

use super::{Cancel, Dataset, Run};
use crate::cache::FeatureCache;
use crate::config::{Changes, ConfigError, UnknownName, together};
use crate::estimators::{self, BuiltEstimator, ESTIMATORS};
use crate::external::{BuiltIn, External, Log, Manifest, ManifestError, StartError};
use crate::matchers::{self, BuiltMatcher, BuiltPointSource, MATCHERS, SIZES, Source, expanded};
use crate::protocols::{EstimatorRule, MATCHBENCH, Protocol};

/// The estimator on datasets of homographies, unless another is asked for.
const OF_HOMOGRAPHIES: &str = "best-h";

/// The names of the estimators of all matchers on these datasets where none is asked for: none, since each has its own.
/// These are of poses, so on datasets that know homographies alone it is `best-h`.
pub fn default_estimators(datasets: &[Dataset]) -> Vec<String> {
    let mut first = (datasets.iter()).map(|dataset| dataset.sequence.pairs.first());
    let are_planes = first
        .all(|pair| pair.is_some_and(|pair| pair.homography().is_some() && pair.pose().is_none()));
    let of_homographies = (are_planes && !datasets.is_empty()).then(|| OF_HOMOGRAPHIES.to_owned());
    of_homographies.into_iter().collect()
}

/// A source of matches and the estimators that turn its matches into poses.
#[derive(Debug)]
pub struct Contender {
    /// Where the matches come from.
    pub source: Source,
    /// The estimators, at least one; all get the same matches.
    pub estimators: Vec<Variant>,
}

/// Where matchers from outside leave what they print, and the features that they describe, and what stops their start.
#[derive(Clone, Copy, Debug)]
pub struct Outside<'a> {
    /// The folder of their logs.
    pub logs: &'a Path,
    /// The cache of features.
    pub cache: &'a FeatureCache,
    /// Stops programs that are being started, which may take minutes.
    pub cancel: &'a Cancel,
}

/// An estimator under the name that it has in a run.
///
/// The name tells records apart, and nothing else: the random draws follow from the id of the
/// estimator, so that two variants of it (a parameter with two values) make the same.
#[derive(Debug)]
pub struct Variant {
    /// The name in records and tables.
    pub name: String,
    /// The estimator.
    pub estimator: BuiltEstimator,
    /// How it sees a pair, and when the pair has failed.
    pub protocol: &'static Protocol,
}

/// Why names and settings make no contenders.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
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
    #[error("`{0}` is given a setting, but is not part of this run")]
    TakesNoPart(String),
}

impl From<BuiltEstimator> for Variant {
    fn from(estimator: BuiltEstimator) -> Self {
        Self {
            name: estimator.id.clone(),
            estimator,
            protocol: &MATCHBENCH,
        }
    }
}

impl Variant {
    /// The estimators of a matcher whose own one is called `own`: those of these names, or where there are none
    /// those that each protocol asks for; under each of the protocols, or without any under the paper's.
    ///
    /// # Errors
    /// If a name or a parameter is unknown, or a value out of range.
    fn all_of(
        own: &str,
        names: &[String],
        protocols: &[&'static Protocol],
        changes: &Changes,
    ) -> Result<Vec<Self>, ContenderError> {
        let ours = [&MATCHBENCH];
        let protocols = if protocols.is_empty() {
            &ours[..]
        } else {
            protocols
        };
        let mut variants = Vec::new();
        for &protocol in protocols {
            let (asked, settings) = match protocol.estimator {
                EstimatorRule::Own => (own, None),
                EstimatorRule::Of { id, params } => (id, Some(params())),
            };
            let asked = [asked.to_owned()];
            for id in if names.is_empty() { &asked[..] } else { names } {
                // The settings are those of the protocol's estimator alone; what the user says comes last.
                let settings = settings.clone().filter(|_| *id == asked[0]);
                let params = together(settings, changes.of(id).cloned());
                let estimator = estimators::find(id)?.build(params.as_ref())?;
                variants.push(Self {
                    name: protocol.name_of(id),
                    estimator,
                    protocol,
                });
            }
        }
        Ok(variants)
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
            Self::from_names(names, Vec::new(), estimators, &[], changes, outside)?;
        match absent.into_iter().next() {
            Some(error) => Err(error.into()),
            None => Ok(contenders),
        }
    }

    /// The matchers called `names` (`all` stands for all native ones), each with the estimators called `estimators`,
    /// or with its own where that is empty; what `changes` does not name keeps its default.
    ///
    /// Under `protocols`, each estimator is there once for each of them, and without `estimators` it is that of the
    /// protocol. One protocol alone also says in which size native matchers look at images; several share one set of
    /// matches, of the images as they are. Without any it is the paper's.
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
        protocols: &[&'static Protocol],
        changes: &Changes,
        outside: Option<&Outside<'_>>,
    ) -> Result<(Vec<Self>, Vec<StartError>), ContenderError> {
        let built = |own: &str| Variant::all_of(own, estimators, protocols, changes);
        let size = match protocols {
            [one] => one.size.params(),
            _ => None,
        };
        let (mut contenders, mut absent) = (Vec::new(), Vec::new());
        for name in &expanded(names) {
            if let Some(outside) = outside
                && Manifest::is_path(name)
            {
                let manifest = manifest(Path::new(name), changes)?;
                let estimators = built(manifest.estimator.as_deref().unwrap_or("ransac-e"))?;
                let log = outside.logs.join(format!("{}.log", manifest.name));
                match External::start_unless(manifest, Log::open(&log)?, outside.cancel) {
                    Err(error) => absent.push(error),
                    Ok(external) => contenders.push(Self {
                        source: Source::Points(
                            external.into_source(outside.cache.clone(), Run::FEATURE_MEMORY),
                        ),
                        estimators,
                    }),
                }
                continue;
            }
            let entry = matchers::find(name)?;
            let estimators = built(entry.estimator())?;
            let changes = changes.of(entry.id());
            let says_size =
                |size| changes.is_some_and(|given| given["extractor"].get(size).is_some());
            let size = size.clone().filter(|_| !SIZES.into_iter().any(says_size));
            let params = together(size, changes.cloned());
            let matcher = matchers::build(entry, params.as_ref())?;
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

/// The matchers and estimators of this program.
pub fn built_in() -> BuiltIn {
    BuiltIn {
        matchers: MATCHERS.iter().map(|entry| entry.id()).collect(),
        estimators: ESTIMATORS.iter().map(|entry| entry.id()).collect(),
    }
}

/// The manifest at `path` with what `changes` has for it; it cannot be called as what is built in, and its
/// estimator is.
///
/// # Errors
/// If the manifest is wrong, or a change does not fit it.
pub fn manifest(path: &Path, changes: &Changes) -> Result<Manifest, ManifestError> {
    let manifest = Manifest::read(path, &built_in())?;
    match changes.of(&manifest.name) {
        Some(changes) => manifest.with(changes),
        None => Ok(manifest),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn all_may_stand_among_other_names() {
        let count = |names: &[&str]| {
            let names: Vec<String> = names.iter().map(ToString::to_string).collect();
            Contender::all_of(&names, &[], &Changes::default(), None)
                .map(|all| all.len())
                .ok()
        };
        let all = MATCHERS.len();
        assert_eq!(
            (count(&["all"]), count(&["all", "sift"])),
            (Some(all), Some(all + 1))
        );
    }

    #[test]
    fn a_setting_for_nobody_is_an_error() {
        let changes = Changes::parse(&["surf.ratio=0.7".to_owned()]).unwrap();
        let error = Contender::all_of(&["sift".into()], &[], &changes, None).err();
        let message = error.unwrap().to_string();
        assert!(message.contains("`surf`") && message.contains("is not part of this run"));
    }
}
