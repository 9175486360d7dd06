//! Parameters that are written as TOML, in a run file or a manifest.

use serde_json::{Number, Value};

/// The value of a parameter as JSON, in which parameters are kept; `name` is how an error calls it.
///
/// # Errors
/// If JSON lacks it: it, or a part of it, is a number that is not finite, or a date. In words.
pub(crate) fn from_toml(name: &str, value: toml::Value) -> Result<Value, String> {
    Ok(match value {
        toml::Value::String(text) => text.into(),
        toml::Value::Integer(number) => number.into(),
        toml::Value::Float(number) => match Number::from_f64(number) {
            Some(number) => Value::Number(number),
            None if number.is_nan() => return Err(format!("`{name}` is nan, which is no number")),
            None => return Err(format!("`{name}` is {number}, and numbers are finite")),
        },
        toml::Value::Boolean(flag) => flag.into(),
        toml::Value::Datetime(date) => {
            return Err(format!("`{name}` is the date {date}; text has quotes"));
        }
        toml::Value::Array(values) => (values.into_iter().enumerate())
            .map(|(index, value)| from_toml(&format!("{name}[{index}]"), value))
            .collect::<Result<_, _>>()?,
        toml::Value::Table(table) => (table.into_iter())
            .map(|(key, value)| {
                let name = match name {
                    "" => key.clone(),
                    outer => format!("{outer}.{key}"),
                };
                Ok((key, from_toml(&name, value)?))
            })
            .collect::<Result<_, String>>()?,
    })
}

#[cfg(test)]
mod tests {
    use serde_json::json;

    use super::*;

    fn read(text: &str) -> Result<Value, String> {
        from_toml("", toml::Value::Table(toml::from_str(text).unwrap()))
    }

    #[test]
    fn what_json_has_stays_what_it_is() {
        let text = "a = 1\nb = -0.5\nc = 'text'\nd = true\ne = [1, [2.0]]\nf = { g = 'h' }\n";
        let expected = json!({
            "a": 1, "b": -0.5, "c": "text", "d": true, "e": [1, [2.0]], "f": {"g": "h"}
        });
        assert_eq!(read(text), Ok(expected));
    }

    #[test]
    fn what_json_lacks_is_named_as_it_was_written() {
        for (text, expected) in [
            ("ratio = nan", "`ratio` is nan, which is no number"),
            ("ratio = -nan", "`ratio` is nan, which is no number"),
            (
                "[part]\nsigma = inf",
                "`part.sigma` is inf, and numbers are finite",
            ),
            (
                "list = [1, { x = -inf }]",
                "`list[1].x` is -inf, and numbers are finite",
            ),
            (
                "when = 2024-02-29",
                "`when` is the date 2024-02-29; text has quotes",
            ),
        ] {
            assert_eq!(read(text), Err(expected.to_owned()), "{text}");
        }
    }
}
