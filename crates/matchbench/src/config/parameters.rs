//! What the parameters of a matcher or an estimator mean, in the words of their documentation.
//!
//! The documentation of a field is written once, at its type. `schemars` turns it into a JSON Schema, from which a
//! parameter gets its meaning and, where it is a word, the words that it may be.

use schemars::JsonSchema;
use schemars::generate::SchemaSettings;
#[cfg(test)]
use serde_json::Map;
use serde_json::Value;

/// A parameter of a matcher or an estimator.
#[derive(Clone, Debug, PartialEq)]
pub struct Parameter {
    /// Its full name; `extractor.sigma` is `sigma` in the part `extractor`.
    pub name: String,
    /// Its value where the user gives none.
    pub default: Value,
    /// What it means: unit, range, and what it does.
    pub meaning: String,
    /// If it is a word: those that it may be, with their meanings.
    pub choices: Vec<(String, String)>,
}

/// The parameters of the type `P` that `defaults` has, in the order of their names.
pub fn parameters<P: JsonSchema>(defaults: &Value) -> Vec<Parameter> {
    let settings =
        SchemaSettings::draft2020_12().with(|settings| settings.inline_subschemas = true);
    let schema = settings.into_generator().into_root_schema_for::<P>();
    let mut found = Vec::new();
    collect(schema.as_value(), defaults, String::new(), &mut found);
    found
}

/// Appends the parameter `name` of this `schema`, or those in it if it is a part.
fn collect(schema: &Value, default: &Value, name: String, found: &mut Vec<Parameter>) {
    let Value::Object(parts) = default else {
        found.push(Parameter {
            name,
            default: default.clone(),
            meaning: text(schema),
            choices: choices(schema),
        });
        return;
    };
    for (part, default) in parts {
        let name = match &*name {
            "" => part.clone(),
            whole => format!("{whole}.{part}"),
        };
        collect(&schema["properties"][part], default, name, found);
    }
}

/// The words that a value of this schema may be, if it is an enumeration. A documented word is a `const`; `oneOf` joins
/// these, and `anyOf` what may be left out.
fn choices(schema: &Value) -> Vec<(String, String)> {
    let list = |key: &str| schema[key].as_array().into_iter().flatten();
    let documented = (schema["const"].as_str()).map(|word| (word.to_owned(), text(schema)));
    let plain = |word: &Value| Some((word.as_str()?.to_owned(), String::new()));
    (documented.into_iter())
        .chain(list("enum").filter_map(plain))
        .chain(list("oneOf").chain(list("anyOf")).flat_map(choices))
        .collect()
}

/// The documentation of a field, a type or a choice, for people who see JSON and not Rust: on one line, without links,
/// and with `null` for `None`.
fn text(schema: &Value) -> String {
    let words = schema["description"].as_str().unwrap_or_default();
    let words = words.split_whitespace().collect::<Vec<_>>().join(" ");
    without_links(&words).replace("`None`", "`null`")
}

/// Markdown with each link, `[text](target)` or `[text]`, replaced by its text.
fn without_links(markdown: &str) -> String {
    let mut plain = String::new();
    let mut rest = markdown;
    // A bracket after a space or at the beginning is a link; in `[0, 1)`, quoted as code, it is none.
    while let Some((before, link)) = rest.split_once('[') {
        plain += before;
        match link.split_once(']') {
            Some((words, after)) if before.is_empty() || before.ends_with([' ', '(']) => {
                plain += words;
                let target = after
                    .strip_prefix('(')
                    .and_then(|target| target.split_once(')'));
                rest = target.map_or(after, |(_, after)| after);
            }
            _ => {
                plain.push('[');
                rest = link;
            }
        }
    }
    plain + rest
}

/// Panics unless each of the parameters of the matcher or estimator `id` has a meaning in plain words, and unless one
/// that is a word can be each of its choices; `build` returns the parameters that it understood.
#[cfg(test)]
pub(crate) fn check_explained(
    id: &str,
    parameters: &[Parameter],
    build: impl Fn(&Value) -> Result<Value, super::ConfigError>,
) {
    assert!(!parameters.is_empty(), "{id}");
    for parameter in parameters {
        let (name, choices) = (&parameter.name, &parameter.choices);
        let is_plain =
            |text: &str| text.ends_with('.') && !text.contains("[`") && !text.contains("](");
        assert!(is_plain(&parameter.meaning), "{id}.{name}: {parameter:?}");
        assert_eq!(
            parameter.default.is_string(),
            choices.len() > 1,
            "{id}.{name}: {parameter:?}"
        );
        let place = format!("/{}", name.replace('.', "/"));
        for (word, meaning) in choices {
            assert!(is_plain(meaning), "{id}.{name}: {word}: {meaning}");
            let given = (name.rsplit('.')).fold(Value::from(&**word), |inner, part| {
                Value::Object(Map::from_iter([(part.to_owned(), inner)]))
            });
            match build(&given) {
                Ok(params) => assert_eq!(
                    params.pointer(&place),
                    Some(&Value::from(&**word)),
                    "{id}.{name}"
                ),
                Err(refused) => assert!(!refused.reason.contains("unknown variant"), "{refused}"),
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use schemars::JsonSchema;
    use serde::Deserialize;
    use serde_json::json;

    use super::*;

    #[expect(dead_code, reason = "only its documentation is read")]
    #[derive(JsonSchema, Deserialize)]
    struct Params {
        /// See [`Part`] for
        /// more ([unit](crate::unit)), `[0, 1)`; `None` for all.
        limit: Option<u32>,
        part: Part,
    }

    #[expect(dead_code, reason = "only its documentation is read")]
    #[derive(JsonSchema, Deserialize)]
    struct Part {
        /// How it is scored.
        score: Option<Score>,
    }

    #[derive(JsonSchema, Deserialize)]
    #[serde(rename_all = "kebab-case")]
    enum Score {
        /// The one.
        InlierCount,
        /// The other.
        Other,
    }

    #[test]
    fn parameters_are_what_their_types_say_in_the_words_of_users() {
        let defaults = json!({"limit": null, "part": {"score": "other"}});
        let found = parameters::<Params>(&defaults);
        let [limit, score] = &found[..] else {
            panic!("{found:?}")
        };
        assert_eq!((&*limit.name, &limit.default), ("limit", &Value::Null));
        assert_eq!(
            limit.meaning,
            "See `Part` for more (unit), `[0, 1)`; `null` for all."
        );
        assert!(limit.choices.is_empty());
        assert_eq!(
            (&*score.name, &score.default),
            ("part.score", &json!("other"))
        );
        assert_eq!(score.meaning, "How it is scored.");
        let words: Vec<_> = score
            .choices
            .iter()
            .map(|(word, meaning)| (&**word, &**meaning))
            .collect();
        assert_eq!(
            words,
            [("inlier-count", "The one."), ("other", "The other.")]
        );
    }
}
