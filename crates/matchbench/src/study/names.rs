//! Checks names, paths, parameters and rules of a run file while it is read, so that errors have a line.

use std::fmt;
use std::marker::PhantomData;
use std::path::{Path, PathBuf};

use serde::de::{DeserializeSeed, Deserializer, Error, MapAccess, Visitor};
use serde::{Deserialize, de};
use serde_json::{Map, Value};

use super::StudyError;
use crate::config::{self, Changes, ConfigError, UnknownName, from_toml};
use crate::datasets::{KINDS, PairRule};
use crate::estimators::{self, ESTIMATORS};
use crate::exchange::{CENTERS, ReadOptions};
use crate::external::Manifest;
use crate::matchers::{self, MATCHERS, MatchesFrom};
use crate::protocols;
use crate::run::built_in;

/// The kinds of things that a name can name.
trait Named {
    fn check(name: &str) -> Result<(), UnknownName>;
}

struct Matcher;
struct Estimator;
struct Protocol;

impl Named for Matcher {
    fn check(name: &str) -> Result<(), UnknownName> {
        if name == "all" || Manifest::is_path(name) {
            return Ok(());
        }
        matchers::find(name).map(drop)
    }
}

impl Named for Estimator {
    fn check(name: &str) -> Result<(), UnknownName> {
        estimators::find(name).map(drop)
    }
}

impl Named for Protocol {
    fn check(name: &str) -> Result<(), UnknownName> {
        if name == "all" {
            return Ok(());
        }
        protocols::find(name).map(drop)
    }
}

/// A name that was looked up and exists.
struct Known<N>(String, PhantomData<N>);

impl<'de, N: Named> Deserialize<'de> for Known<N> {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        let name = String::deserialize(deserializer)?;
        N::check(&name).map_err(D::Error::custom)?;
        Ok(Self(name, PhantomData))
    }
}

fn known<'de, N: Named, D: Deserializer<'de>>(deserializer: D) -> Result<Vec<String>, D::Error> {
    let names = Vec::<Known<N>>::deserialize(deserializer)?;
    let mut seen: Vec<String> = Vec::with_capacity(names.len());
    for Known(name, _) in names {
        if seen.contains(&name) {
            return Err(D::Error::custom(format!("`{name}` is named twice")));
        }
        seen.push(name);
    }
    Ok(seen)
}

pub(super) fn matchers<'de, D: Deserializer<'de>>(
    deserializer: D,
) -> Result<Vec<String>, D::Error> {
    known::<Matcher, D>(deserializer)
}

pub(super) fn some_matchers<'de, D: Deserializer<'de>>(
    deserializer: D,
) -> Result<Option<Vec<String>>, D::Error> {
    matchers(deserializer).map(Some)
}

pub(super) fn estimators<'de, D: Deserializer<'de>>(
    deserializer: D,
) -> Result<Vec<String>, D::Error> {
    known::<Estimator, D>(deserializer)
}

pub(super) fn protocols<'de, D: Deserializer<'de>>(
    deserializer: D,
) -> Result<Vec<String>, D::Error> {
    known::<Protocol, D>(deserializer)
}

/// An empty path would be the folder of the run file itself.
fn check_path<E: Error>(path: &Path) -> Result<(), E> {
    if path.as_os_str().is_empty() {
        return Err(E::custom("the path is empty"));
    }
    Ok(())
}

/// A path that is not empty.
struct Place(PathBuf);

impl<'de> Deserialize<'de> for Place {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        let path = PathBuf::deserialize(deserializer)?;
        check_path(&path)?;
        Ok(Self(path))
    }
}

pub(super) fn path<'de, D: Deserializer<'de>>(deserializer: D) -> Result<PathBuf, D::Error> {
    Ok(Place::deserialize(deserializer)?.0)
}

pub(super) fn some_path<'de, D: Deserializer<'de>>(
    deserializer: D,
) -> Result<Option<PathBuf>, D::Error> {
    path(deserializer).map(Some)
}

pub(super) fn paths<'de, D: Deserializer<'de>>(deserializer: D) -> Result<Vec<PathBuf>, D::Error> {
    let places = Vec::<Place>::deserialize(deserializer)?;
    Ok(places.into_iter().map(|place| place.0).collect())
}

/// Checks that matches from files may have this name in tables. The name of something built in is refused,
/// since the matches would appear beside real runs of it.
pub(super) fn check_name(name: &str) -> Result<(), StudyError> {
    let plain = |c: char| c.is_alphanumeric() || "-_.".contains(c);
    let is_word = name.chars().all(plain) && name.starts_with(char::is_alphanumeric);
    let what = if !is_word || name.len() > 64 {
        "use up to 64 letters, digits, dashes, underscores and dots"
    } else if built_in().takes(name) {
        "that name is taken by what is built in; choose another, as in `colmap-sift`"
    } else {
        return Ok(());
    };
    let name = name.to_owned();
    Err(StudyError::Name { name, what })
}

/// Matches of another tool, whose names, files and options can be such.
struct Placed(MatchesFrom);

impl<'de> Deserialize<'de> for Placed {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        let matches = MatchesFrom::deserialize(deserializer)?;
        matches.files.iter().try_for_each(|file| check_path(file))?;
        check_name(&matches.name).map_err(D::Error::custom)?;
        ReadOptions::of(&matches).map_err(D::Error::custom)?;
        if let Some(center) = matches.pixel_center
            && !CENTERS.contains(&center)
        {
            let wrong = format!("`pixel_center` is {center}; it is 0 or 0.5");
            return Err(D::Error::custom(wrong));
        }
        if matches.resized.is_some_and(|size| size.contains(&0)) {
            return Err(D::Error::custom("`resized` has no pixels"));
        }
        Ok(Self(matches))
    }
}

pub(super) fn matches<'de, D: Deserializer<'de>>(
    deserializer: D,
) -> Result<Vec<MatchesFrom>, D::Error> {
    let placed = Vec::<Placed>::deserialize(deserializer)?;
    Ok(placed.into_iter().map(|placed| placed.0).collect())
}

pub(super) fn pair_rule<'de, D: Deserializer<'de>>(
    deserializer: D,
) -> Result<Option<PairRule>, D::Error> {
    let text = String::deserialize(deserializer)?;
    text.parse().map(Some).map_err(D::Error::custom)
}

/// The kind of an import.
pub(super) fn kind<'de, D: Deserializer<'de>>(deserializer: D) -> Result<String, D::Error> {
    let id = String::deserialize(deserializer)?;
    let ids: Vec<&str> = KINDS.iter().map(|kind| kind.id).collect();
    config::find("kind of dataset", &ids, |id| id, &id).map_err(D::Error::custom)?;
    Ok(id)
}

/// A difference in time, in seconds.
pub(super) fn tolerance<'de, D: Deserializer<'de>>(
    deserializer: D,
) -> Result<Option<f64>, D::Error> {
    let seconds = f64::deserialize(deserializer)?;
    if seconds >= 0.0 && seconds.is_finite() {
        return Ok(Some(seconds));
    }
    let message = format!("a tolerance of {seconds}; give seconds, 0 or more");
    Err(D::Error::custom(message))
}

/// The table `set`: parameters by the id of their matcher or estimator.
pub(super) fn parameters<'de, D: Deserializer<'de>>(deserializer: D) -> Result<Changes, D::Error> {
    deserializer.deserialize_map(Parameters)
}

struct Parameters;

impl<'de> Visitor<'de> for Parameters {
    type Value = Changes;

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("a table of parameters")
    }

    fn visit_map<A: MapAccess<'de>>(self, mut map: A) -> Result<Changes, A::Error> {
        let mut all = Map::new();
        while let Some(id) = map.next_key::<String>()? {
            let given = map.next_value_seed(ParametersOf(&id))?;
            all.insert(id, given);
        }
        Changes::deserialize(Value::Object(all)).map_err(de::Error::custom)
    }
}

/// The parameters of one matcher or estimator.
struct ParametersOf<'a>(&'a str);

impl<'de> DeserializeSeed<'de> for ParametersOf<'_> {
    type Value = Value;

    fn deserialize<D: Deserializer<'de>>(self, deserializer: D) -> Result<Value, D::Error> {
        let given = toml::Value::deserialize(deserializer)?;
        let given = from_toml("", given)
            .map_err(|what| D::Error::custom(ConfigError::new(self.0, what)))?;
        self.check(&given).map_err(D::Error::custom)?;
        Ok(given)
    }
}

impl ParametersOf<'_> {
    /// The parameters of a matcher from outside are defined by its manifest.
    fn check(&self, given: &Value) -> Result<(), ConfigError> {
        if let Some(entry) = MATCHERS.iter().find(|entry| entry.id() == self.0) {
            return entry.build(Some(given)).map(drop);
        }
        match ESTIMATORS.iter().find(|entry| entry.id() == self.0) {
            Some(entry) => entry.build(Some(given)).map(drop),
            None => Ok(()),
        }
    }
}
