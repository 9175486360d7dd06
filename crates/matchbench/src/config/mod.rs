//! Names and parameters of matchers and estimators, as users write them.
//!
//! A parameter that no code reads is the worst kind of mistake: the run succeeds, but the table is about
//! something else. So every struct of parameters denies unknown fields, and the error names the field that was
//! refused.

mod changes;
mod from_toml;
mod names;
mod parameters;

use std::fmt;

use serde::de::{DeserializeOwned, Error as _};
use serde::{Deserializer, Serialize};
use serde_json::{Map, Value};

pub use changes::{Changes, parse_value};
pub(crate) use from_toml::from_toml;
use names::with_suggestion;
pub use names::{UnknownName, find};
#[cfg(test)]
pub(crate) use parameters::check_explained;
pub use parameters::{Parameter, parameters};

/// An error in the parameters of a matcher or estimator.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("parameters of `{id}`: {reason}")]
pub struct ConfigError {
    /// Id of the matcher or estimator.
    pub id: String,
    /// What is wrong, and what would be right.
    pub reason: String,
}

impl ConfigError {
    /// The error that the parameters of the matcher or estimator `id` are wrong for this `reason`.
    pub fn new(id: &str, reason: impl fmt::Display) -> Self {
        Self {
            id: id.into(),
            reason: reason.to_string(),
        }
    }
}

/// The parameters of the matcher or estimator `id`: those in `config`, a JSON object, and the defaults for all
/// others. Without a `config`, all are defaults.
///
/// `P` must carry `#[serde(default, deny_unknown_fields)]`.
///
/// # Errors
/// If `config` is not an object, names a parameter that `P` lacks or gives one the wrong type.
pub fn parse_params<P: DeserializeOwned + Default>(
    id: &str,
    config: Option<&Value>,
) -> Result<P, ConfigError> {
    match config {
        None => Ok(P::default()),
        // Checked here because serde would also accept an array, field by field.
        Some(object @ Value::Object(_)) => {
            P::deserialize(object).map_err(|error| refusal::<P>(id, object, &error))
        }
        Some(other) => Err(ConfigError::new(
            id,
            format!("expected an object like {{\"name\": value}}, found {other}"),
        )),
    }
}

/// The error that the parameters in `config` are refused, with the name of the one that is of another type.
fn refusal<P: DeserializeOwned>(
    id: &str,
    config: &Value,
    error: &serde_json::Error,
) -> ConfigError {
    let culprit = culprit::<P>(config).map_or_else(String::new, |name| format!("`{name}`: "));
    ConfigError::new(id, format!("{culprit}{}", readable(&error.to_string())))
}

/// The name of the first parameter, at any depth, that is refused by itself for its type or its size, which the error
/// does not name.
fn culprit<P: DeserializeOwned>(config: &Value) -> Option<String> {
    let mut leaves = Vec::new();
    collect_leaves(config, &mut Vec::new(), &mut leaves);
    let is_refused = |path: &[&str], value: &Value| {
        let alone = (path.iter().rev()).fold(value.clone(), |inner, part| {
            Value::Object(Map::from_iter([((*part).to_owned(), inner)]))
        });
        let refused = P::deserialize(alone).map_err(|error| error.to_string());
        refused.is_err_and(|error| {
            error.starts_with("invalid type") || error.starts_with("invalid value")
        })
    };
    let mut refused = leaves
        .into_iter()
        .filter(|(path, value)| is_refused(path, value));
    refused.next().map(|(path, _)| path.join("."))
}

/// Appends all values of an object that are no objects, each with the names on the way to it.
fn collect_leaves<'a>(
    value: &'a Value,
    path: &mut Vec<&'a str>,
    leaves: &mut Vec<(Vec<&'a str>, &'a Value)>,
) {
    let Value::Object(entries) = value else {
        return leaves.push((path.clone(), value));
    };
    for (name, value) in entries {
        path.push(name);
        collect_leaves(value, path, leaves);
        path.pop();
    }
}

/// An error of serde as users read it: without types of Rust, and with the name that was probably meant.
pub(crate) fn readable(error: &str) -> String {
    with_suggestion(&in_plain_words(error))
}

/// An error of serde, with the types of Rust as users call them.
fn in_plain_words(error: &str) -> String {
    let Some((said, wanted)) = error.rsplit_once("expected ") else {
        return error.to_owned();
    };
    let wanted = match wanted {
        "f32" | "f64" => "a number",
        "u8" => "a whole number, 0 to 255",
        "u32" | "a nonzero u32" if is_beyond_u32(said) => "a whole number, 4294967295 at most",
        "u32" | "u64" | "usize" => "a whole number, 0 or more",
        "a nonzero u32" | "a nonzero usize" => "a whole number, 1 or more",
        "a boolean" => "true or false",
        "a sequence" => "a list",
        other => other,
    };
    format!("{said}expected {wanted}")
}

/// Whether an error of serde is about a whole number that has more than 32 bits.
fn is_beyond_u32(said: &str) -> bool {
    let found = said.split_once("integer `").map(|(_, rest)| rest);
    let digits = found.and_then(|rest| rest.split('`').next());
    digits
        .and_then(|digits| digits.parse().ok())
        .is_some_and(|number: u64| number > u32::MAX.into())
}

/// As [`parse_params`], for a matcher whose defaults are not those of the type.
///
/// # Errors
/// As [`parse_params`].
pub fn parse_params_over<P: Serialize + DeserializeOwned>(
    id: &str,
    defaults: P,
    config: Option<&Value>,
) -> Result<P, ConfigError> {
    match config {
        None => Ok(defaults),
        Some(config) => over(&defaults, config).map_err(|error| refusal::<P>(id, config, &error)),
    }
}

/// The `given` parameters, and `defaults` for all others, at any depth. It is for `#[serde(deserialize_with)]`
/// of a part whose defaults in this matcher are not those of its type. Without it, giving one parameter of the
/// part would reset the others.
///
/// # Errors
/// If `given` is not an object, names a parameter that `P` lacks, or gives one the wrong type.
pub fn over<'de, P, D>(defaults: &P, given: D) -> Result<P, D::Error>
where
    P: Serialize + DeserializeOwned,
    D: Deserializer<'de>,
{
    let given = <Map<String, Value> as serde::Deserialize>::deserialize(given)?;
    let mut all = to_json(defaults);
    merge(&mut all, Value::Object(given));
    P::deserialize(all).map_err(D::Error::custom)
}

/// The `given` parameters merged into `others`, at any depth; `given` wins.
pub fn together(others: Option<Value>, given: Option<Value>) -> Option<Value> {
    match (others, given) {
        (Some(mut all), Some(given)) => {
            merge(&mut all, given);
            Some(all)
        }
        (one, other) => one.or(other),
    }
}

fn merge(all: &mut Value, given: Value) {
    match (all, given) {
        (Value::Object(all), Value::Object(given)) => {
            for (name, value) in given {
                merge(all.entry(name).or_insert(Value::Null), value);
            }
        }
        (all, given) => *all = given,
    }
}

/// Parameters as JSON. They are converted through text, so that the `f32` 0.8 stays 0.8, as a person would
/// write it; a direct conversion would give 0.800000011920929.
pub fn to_json<P: Serialize>(params: &P) -> Value {
    let text = serde_json::to_string(params).expect("parameters are plain JSON");
    serde_json::from_str(&text).expect("written just now")
}

#[cfg(test)]
mod tests {
    use serde::{Deserialize, Serialize};
    use serde_json::json;

    use super::*;

    #[derive(Debug, Default, PartialEq, Serialize, Deserialize)]
    #[serde(default, deny_unknown_fields)]
    struct Params {
        ratio: f64,
        count: usize,
        part: Part,
    }

    #[derive(Debug, Default, PartialEq, Serialize, Deserialize)]
    #[serde(default, deny_unknown_fields)]
    struct Part {
        ratio: f64,
    }

    #[test]
    fn what_is_left_out_keeps_its_default() {
        let parsed: Params = parse_params("x", Some(&json!({"ratio": 0.8}))).unwrap();
        assert_eq!(
            parsed,
            Params {
                ratio: 0.8,
                ..Params::default()
            }
        );
        assert_eq!(parse_params::<Params>("x", None), Ok(Params::default()));
    }

    #[test]
    fn what_is_left_out_keeps_the_default_that_is_passed() {
        let defaults = || Params {
            ratio: 0.5,
            count: 7,
            part: Part::default(),
        };
        let parse = |config: Option<Value>| parse_params_over("x", defaults(), config.as_ref());
        assert_eq!(parse(None), Ok(defaults()));
        let expected = Params {
            ratio: 0.8,
            ..defaults()
        };
        assert_eq!(parse(Some(json!({"ratio": 0.8}))), Ok(expected));
        for wrong in [json!({"ratoi": 0.8}), json!({"count": {}}), json!([1])] {
            assert!(parse(Some(wrong.clone())).is_err(), "{wrong}");
        }
        let message = parse(Some(json!({"ratio": "high"})))
            .unwrap_err()
            .to_string();
        assert!(
            message.contains("`ratio`: invalid type: string \"high\", expected a number"),
            "{message}"
        );
    }

    #[test]
    fn what_is_refused_is_named() {
        for (config, named) in [
            (json!({"ratoi": 0.8}), "ratoi"),
            (
                json!({"count": -1}),
                "`count`: invalid value: integer `-1`, expected a whole number, 0 or more",
            ),
            (
                json!({"part": {"ratio": "high"}}),
                "`part.ratio`: invalid type: string \"high\", expected a number",
            ),
            (
                json!({"count": 2, "ratio": "high"}),
                "`ratio`: invalid type: string \"high\", expected a number",
            ),
            (json!([0.8, 1]), "[0.8,1]"),
            (json!(null), "null"),
        ] {
            let message = parse_params::<Params>("sift", Some(&config))
                .unwrap_err()
                .to_string();
            assert!(
                message.contains(named) && message.contains("sift"),
                "{message}"
            );
        }
    }
}
