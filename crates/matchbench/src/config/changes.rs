//! Changes of parameters by a user: `ID.NAME=VALUE`.

use serde::Deserialize;
use serde_json::{Map, Number, Value};

use super::{ConfigError, merge};

/// The most names of a setting, from the id on. Parameters have four, and each name is a level of recursion wherever
/// they are read.
const MAX_NAMES: usize = 16;
/// Letters of a setting that an error shows.
const SHOWN: usize = 80;

/// Changed parameters: for the id of a matcher or estimator, a JSON object.
#[derive(Clone, Debug, Default, PartialEq, Deserialize)]
#[serde(transparent)]
pub struct Changes(Map<String, Value>);

impl Changes {
    /// `["sift.ratio=0.7", "sift.extractor.sigma=1"]` becomes
    /// `{"sift": {"ratio": 0.7, "extractor": {"sigma": 1}}}`. Later settings replace earlier ones.
    ///
    /// # Errors
    /// If a setting has another form or too many names, or sets a part of something to which an earlier setting gave a
    /// value.
    pub fn parse(settings: &[String]) -> Result<Self, ConfigError> {
        let mut changes = Map::new();
        for setting in settings {
            insert(&mut changes, setting)
                .map_err(|reason| ConfigError::new(&shown(setting), reason))?;
        }
        Ok(Self(changes))
    }

    /// These parameters (a JSON object) of the matcher or estimator `id`.
    pub fn of_one(id: impl Into<String>, params: Value) -> Self {
        Self(Map::from_iter([(id.into(), params)]))
    }

    /// These changes with `others` added; if both name the same parameter, `others` win.
    #[must_use]
    pub fn with(self, others: Self) -> Self {
        let mut all = Value::Object(self.0);
        merge(&mut all, Value::Object(others.0));
        match all {
            Value::Object(all) => Self(all),
            _ => unreachable!("an object stays one"),
        }
    }

    /// Whether these changes have every value of `others`.
    pub fn hold(&self, others: &Self) -> bool {
        fn holds(value: Option<&Value>, other: &Value) -> bool {
            match (value, other) {
                (Some(Value::Object(its)), Value::Object(others)) => {
                    (others.iter()).all(|(name, other)| holds(its.get(name), other))
                }
                (value, other) => value == Some(other),
            }
        }
        let mut others = others.0.iter();
        others.all(|(id, other)| holds(self.0.get(id), other))
    }

    /// The settings that [`Changes::parse`] reads as these changes. Each has one value, or all values of a part where names
    /// in it cannot stand in a setting.
    ///
    /// # Errors
    /// If a parameter itself has such a name, which programs from outside may have.
    pub fn settings(&self) -> Result<Vec<String>, ConfigError> {
        fn add(path: &str, value: &Value, settings: &mut Vec<String>) {
            let more = path.split('.').count() < MAX_NAMES;
            match value {
                Value::Object(parts)
                    if more && !parts.is_empty() && parts.keys().all(|name| is_name(name)) =>
                {
                    for (name, part) in parts {
                        add(&format!("{path}.{name}"), part, settings);
                    }
                }
                value => settings.push(format!("{path}={value}")),
            }
        }
        let mut settings = Vec::new();
        for (id, params) in &self.0 {
            let names = params.as_object().into_iter().flat_map(Map::keys);
            if let Some(name) = { names }.find(|name| !is_name(name)) {
                let reason = format!(
                    "`{name}` cannot be given as ID.NAME=VALUE, where `.` and `=` have a meaning; give it in the manifest \
                     of the matcher"
                );
                return Err(ConfigError::new(id, reason));
            }
            add(id, params, &mut settings);
        }
        Ok(settings)
    }

    /// The changed parameters of the matcher or estimator `id`, if there are any.
    pub fn of(&self, id: &str) -> Option<&Value> {
        self.0.get(id)
    }

    /// The ids that have changes.
    pub fn ids(&self) -> impl Iterator<Item = &str> {
        self.0.keys().map(String::as_str)
    }
}

/// Reads a value as JSON; if it is not JSON, it is a number like `.7`, or text. So `sift.search=exact` needs no quotes.
pub fn parse_value(text: &str) -> Value {
    let number = || Number::from_f64(text.parse().ok()?).map(Value::Number);
    serde_json::from_str(text).unwrap_or_else(|_| number().unwrap_or_else(|| text.into()))
}

/// Whether a name can stand in a setting.
fn is_name(name: &str) -> bool {
    !name.is_empty() && !name.contains(['.', '='])
}

fn insert(changes: &mut Map<String, Value>, setting: &str) -> Result<(), String> {
    let (path, value) = setting.split_once('=').unwrap_or((setting, ""));
    let mut names: Vec<&str> = path.split('.').collect();
    if names.len() < 2 || value.is_empty() || names.iter().any(|name| name.is_empty()) {
        return Err("expected ID.NAME=VALUE, for example sift.ratio=0.7".into());
    }
    if names.len() > MAX_NAMES {
        let found = names.len();
        return Err(format!(
            "{found} names with a dot between them, and no parameter has more than {MAX_NAMES}; expected \
             ID.NAME=VALUE, for example sift.ratio=0.7"
        ));
    }
    let last = names.pop().expect("at least two names");
    let mut object = changes;
    for name in names {
        let inner = (object.entry(name)).or_insert_with(|| Value::Object(Map::new()));
        object = match inner {
            Value::Object(object) => object,
            _ => return Err(format!("`{name}` was given a value before")),
        };
    }
    object.insert(last.into(), parse_value(value));
    Ok(())
}

/// A setting as an error shows it.
fn shown(setting: &str) -> String {
    match setting.char_indices().nth(SHOWN) {
        Some((end, _)) => format!("{}...", &setting[..end]),
        None => setting.into(),
    }
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
        let changes = Changes::parse(&settings.map(String::from)).unwrap();
        assert_eq!(
            Value::Object(changes.0),
            json!({"sift": {"ratio": 0.7, "extractor": {"sigma": 1.2}}, "gms": {"budget": "authors"}})
        );
    }

    #[test]
    fn settings_of_changes_are_these_changes() {
        let params = json!({"ratio": 0.1, "name": "0.5", "list": [1, "a"],
                            "extractor": {"sift": {"sigma": 2.0, "upright": true}}});
        let changes = Changes::of_one("code", params);
        let settings = changes.settings().unwrap();
        assert_eq!(settings.len(), 5, "{settings:?}");
        assert_eq!(Changes::parse(&settings), Ok(changes));
    }

    #[test]
    fn settings_of_any_parameters_of_a_program_are_these_parameters() {
        let deep = (0..20).fold(json!(1), |inner, _| json!({"a": inner}));
        let params = json!({"text": "a, \"b\" c=d 'e'\n", "number": "0.50", "nothing": {}, "deep": deep,
                            "parts": {"x": {"con.thr": 0.5, "a=b": {"": 1}}, "y": 2}});
        let changes = Changes::of_one("mine", params);
        let settings = changes.settings().unwrap();
        assert!(settings.contains(&"mine.parts.y=2".to_owned()));
        assert_eq!(Changes::parse(&settings), Ok(changes));
        for name in ["con.thr", "a=b", ""] {
            let error = Changes::of_one("mine", json!({name: 0.5})).settings();
            let said = error.unwrap_err().to_string();
            let words = format!("parameters of `mine`: `{name}` cannot be given as ID.NAME=VALUE");
            assert!(
                said.starts_with(&words) && said.contains("manifest"),
                "{said}"
            );
        }
    }

    #[test]
    fn numbers_may_begin_with_a_point_and_are_finite() {
        assert_eq!(
            [".7", "+2", "1e-3"].map(parse_value),
            [json!(0.7), json!(2.0), json!(0.001)]
        );
        assert_eq!(
            ["nan", "inf", "7px"].map(parse_value),
            [json!("nan"), json!("inf"), json!("7px")]
        );
    }

    #[test]
    fn others_win_where_they_name_the_same() {
        let parse = |settings: &[&str]| {
            let settings: Vec<String> = settings.iter().map(|text| (*text).to_owned()).collect();
            Changes::parse(&settings).unwrap()
        };
        let one = parse(&["sift.ratio=0.7", "sift.extractor.sigma=1.2"]);
        let other = parse(&["sift.extractor.sigma=2", "orb.ratio=0.9"]);
        let both = ["sift.ratio=0.7", "sift.extractor.sigma=2", "orb.ratio=0.9"];
        let together = one.clone().with(other.clone());
        assert_eq!(together, parse(&both));
        assert!(together.hold(&other) && together.hold(&parse(&["sift.ratio=0.7"])));
        assert!(!together.hold(&one) && !one.hold(&other));
    }

    /// It would end the process, whose stack such an object outgrows.
    #[test]
    fn a_setting_of_endless_depth_is_refused_in_few_words() {
        let deep = format!("orb.{}b=1", "a.".repeat(100_000));
        let message = Changes::parse(&[deep]).unwrap_err().to_string();
        assert!(
            message.contains("`orb.a.a.a.") && message.len() < 300,
            "{message}"
        );
        assert!(message.contains("100002 names with a dot"), "{message}");
        let deepest = format!("orb.{}b=1", "a.".repeat(MAX_NAMES - 2));
        assert!(Changes::parse(&[deepest]).is_ok());
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
            let error = Changes::parse(&[setting.to_owned()]).expect_err(setting);
            let message = error.to_string();
            assert!(message.contains("sift.ratio=0.7"), "{setting}: {message}");
        }
    }
}
