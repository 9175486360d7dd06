//! From names on the command line to matchers and estimators that are ready to run.

use anyhow::{Result, bail, ensure};
use matchbench::estimators;
use matchbench::matchers::{self, MATCHERS};
use matchbench::run::Contender;
use serde_json::{Map, Value};

/// Parameters that the user changed: id of the entry, to a JSON object for it.
type Changes = Map<String, Value>;

/// The matchers called `ids` (`all` for all), each with the estimators called `estimators`, or
/// with its own where that is empty; `settings` are `ID.NAME=VALUE`.
pub(crate) fn contenders(
    ids: &[String],
    estimators: &[String],
    settings: &[String],
) -> Result<Vec<Contender>> {
    let entries = match ids {
        [all] if all == "all" => MATCHERS.to_vec(),
        ids => ids
            .iter()
            .map(|id| matchers::find(id))
            .collect::<Result<_, _>>()?,
    };
    let changes = parse(settings)?;
    let mut contenders = Vec::new();
    for entry in entries {
        let own = [entry.estimator().to_owned()];
        let estimators = if estimators.is_empty() {
            &own[..]
        } else {
            estimators
        };
        contenders.push(Contender {
            matcher: entry.build(changes.get(entry.id()))?,
            estimators: estimators
                .iter()
                .map(|id| Ok(estimators::find(id)?.build(changes.get(id))?))
                .collect::<Result<_>>()?,
        });
    }
    let takes_part = |id: &str| {
        contenders.iter().any(|contender| {
            contender.matcher.id == id
                || contender
                    .estimators
                    .iter()
                    .any(|estimator| estimator.id == id)
        })
    };
    match changes.keys().find(|id| !takes_part(id)) {
        Some(id) => bail!("--set {id}: `{id}` takes no part in this run"),
        None => Ok(contenders),
    }
}

/// The matchers called `ids`, each with the estimator called `estimator` once for each of the
/// `values` of its parameter `name`.
pub(crate) fn variants(
    ids: &[String],
    estimator: &str,
    name: &str,
    values: &[Value],
    settings: &[String],
) -> Result<Vec<Contender>> {
    let mut contenders = contenders(ids, &[estimator.to_owned()], settings)?;
    let mut params = parse(settings)?.remove(estimator).unwrap_or_default();
    if !params.is_object() {
        params = Value::Object(Map::new());
    }
    for contender in &mut contenders {
        contender.estimators = (values.iter())
            .map(|value| {
                params[name] = value.clone();
                let mut variant = estimators::find(estimator)?.build(Some(&params))?;
                variant.id = format!("{estimator}@{}", text(value));
                Ok(variant)
            })
            .collect::<Result<_>>()?;
    }
    Ok(contenders)
}

fn text(value: &Value) -> String {
    value
        .as_str()
        .map_or_else(|| value.to_string(), str::to_owned)
}

/// A value is JSON; what is not, is text: --set sift.search=exact needs no quotes.
pub(crate) fn parse_value(text: &str) -> Value {
    serde_json::from_str(text).unwrap_or_else(|_| Value::String(text.into()))
}

/// `["sift.ratio=0.7"]` becomes `{"sift": {"ratio": 0.7}}`.
fn parse(settings: &[String]) -> Result<Changes> {
    let mut changes = Changes::new();
    for setting in settings {
        let (path, value) = setting.split_once('=').unwrap_or((setting, ""));
        let mut names: Vec<&str> = path.split('.').collect();
        ensure!(
            names.len() >= 2 && !value.is_empty() && names.iter().all(|name| !name.is_empty()),
            "--set {setting}: expected ID.NAME=VALUE, for example sift.ratio=0.7"
        );
        let last = names.pop().expect("at least two names");
        let mut object = &mut changes;
        for name in names {
            let inner = object
                .entry(name)
                .or_insert_with(|| Value::Object(Map::new()));
            object = match inner {
                Value::Object(object) => object,
                _ => bail!("--set {setting}: `{name}` was given a value before"),
            };
        }
        object.insert(last.into(), parse_value(value));
    }
    Ok(changes)
}

#[cfg(test)]
mod tests {
    use serde_json::json;

    use super::*;

    #[test]
    fn settings_become_nested_objects() {
        let settings = [
            "sift.ratio=0.7",
            "sift.extractor.sigma=1.2",
            "gms.budget=authors",
        ];
        let changes = parse(&settings.map(String::from)).expect("well-formed");
        assert_eq!(
            Value::Object(changes),
            json!({"sift": {"ratio": 0.7, "extractor": {"sigma": 1.2}}, "gms": {"budget": "authors"}})
        );
    }

    #[test]
    fn malformed_settings_are_refused_with_an_example() {
        for setting in [
            "sift",
            "sift.ratio",
            "sift.ratio=",
            "=1",
            "sift.=1",
            "ratio=0.7",
        ] {
            let error = parse(&[setting.to_owned()]).expect_err(setting).to_string();
            assert!(error.contains("sift.ratio=0.7"), "{setting}: {error}");
        }
    }

    #[test]
    fn a_setting_for_nobody_is_an_error() {
        let error = contenders(&["sift".into()], &[], &["surf.ratio=0.7".into()]).err();
        assert!(
            error
                .expect("refused")
                .to_string()
                .contains("takes no part")
        );
    }
}
