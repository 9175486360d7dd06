//! `matchbench list`: prints what is available, with every parameter.

use std::io::{self, Write};

use anyhow::Result;
use matchbench::config::ConfigError;
use matchbench::counted::counted;
use matchbench::datasets::KINDS;
use matchbench::datasets::rendered;
use matchbench::estimators::{ESTIMATORS, EstimatorEntry};
use matchbench::exchange::FORMATS;
use matchbench::matchers::{self, MATCHERS, MatcherEntry};
use matchbench::protocols::PROTOCOLS;
use serde_json::{Value, json};

use crate::Ending;
use crate::args::{ListArgs, Listed};

pub(crate) fn run(args: &ListArgs) -> Result<Ending> {
    let mut out = io::stdout().lock();
    let wanted = |what| args.what.is_none_or(|only| only == what);
    if wanted(Listed::Matchers) {
        list_matchers(&mut out)?;
    }
    if wanted(Listed::Estimators) {
        list_estimators(&mut out)?;
    }
    if wanted(Listed::Protocols) {
        writeln!(
            out,
            "Protocols (run --protocol ID,...; eval --protocol ID,...)\n"
        )?;
        for protocol in PROTOCOLS {
            let (id, summary) = (protocol.id, protocol.summary);
            writeln!(out, "  {id:<14} {summary}\n      {}", protocol.reference)?;
            writeln!(out, "      read in {}", protocol.source)?;
            for (what, how) in protocol.in_words() {
                writeln!(out, "      {what}: {how}")?;
            }
            writeln!(out)?;
        }
    }
    if wanted(Listed::Datasets) {
        writeln!(out, "Built-in scenes (matchbench demo)\n")?;
        for scene in rendered::scenes() {
            let images = format!("{} of {}", counted(scene.frames, "image"), scene.size);
            let pairs = counted(rendered::sequence(scene).pairs.len(), "pair");
            writeln!(
                out,
                "  {:<14} {}\n      {images}, {pairs}",
                scene.name, scene.description
            )?;
        }
        writeln!(
            out,
            "\nKinds of data that can be imported (matchbench import KIND SRC OUT)\n"
        )?;
        for kind in KINDS {
            let pairs = match &kind.default_pairs {
                Some(rule) => rule.to_string(),
                None => "those that it lists".to_owned(),
            };
            let options: Vec<String> = kind.options.iter().map(ToString::to_string).collect();
            writeln!(out, "  {:<14} {}\n      pairs: {pairs}", kind.id, kind.help)?;
            if !options.is_empty() {
                writeln!(out, "      options: {}", options.join(" "))?;
            }
        }
    }
    if wanted(Listed::Formats) {
        writeln!(
            out,
            "\nFormats of matches (run --matches NAME=PATH; export --format)\n"
        )?;
        for format in FORMATS {
            let center = match format.pixel_center {
                Some(center) => format!("first pixel's centre at {center}"),
                None => "first pixel's centre: say --pixel-center".to_owned(),
            };
            let way = if format.can_write() {
                "read and written"
            } else {
                "read"
            };
            writeln!(
                out,
                "  {:<14} {}\n      {way}; {center}",
                format.id, format.layout
            )?;
        }
    }
    Ok(Ending::Done)
}

fn list_matchers(out: &mut impl Write) -> io::Result<()> {
    writeln!(
        out,
        "Matchers (--matchers ID,...; parameters: --set ID.NAME=VALUE)\n\n{OF_ALL}\n"
    )?;
    for entry in MATCHERS {
        describe(out, &of_matcher(*entry))?;
        writeln!(out, "      estimator: {}\n", entry.estimator())?;
    }
    Ok(())
}

fn list_estimators(out: &mut impl Write) -> io::Result<()> {
    writeln!(
        out,
        "Estimators (--estimator ID,...; parameters: --set ID.NAME=VALUE)\n"
    )?;
    for entry in ESTIMATORS {
        describe(out, &of_estimator(*entry))?;
        writeln!(out)?;
    }
    Ok(())
}

/// The parameters that every matcher has, see [`matchers::build`].
const OF_ALL: &str = "  \
  Every matcher also has one of these two. Without either, images keep their size.
      extractor.max_size   images that are wider or higher than so many pixels are made smaller
      extractor.size       every image is made this size, for example 640x480
  And every matcher has
      refine               true: matches are moved to where the pixels about their points agree best";

/// All parameters of an entry where some are given.
type Build = dyn Fn(&Value) -> Result<Value, ConfigError>;

/// What matchers and estimators have in common.
struct Entry {
    id: &'static str,
    summary: &'static str,
    reference: &'static str,
    defaults: Value,
    build: Box<Build>,
}

fn of_matcher(entry: &'static dyn MatcherEntry) -> Entry {
    Entry {
        id: entry.id(),
        summary: entry.summary(),
        reference: entry.reference(),
        defaults: entry.defaults(),
        build: Box::new(move |given| Ok(matchers::build(entry, Some(given))?.params)),
    }
}

fn of_estimator(entry: &'static dyn EstimatorEntry) -> Entry {
    Entry {
        id: entry.id(),
        summary: entry.summary(),
        reference: entry.reference(),
        defaults: entry.defaults(),
        build: Box::new(move |given| Ok(entry.build(Some(given))?.params)),
    }
}

fn describe(out: &mut impl Write, entry: &Entry) -> io::Result<()> {
    writeln!(out, "  {:<14} {}", entry.id, entry.summary)?;
    writeln!(out, "      {}", entry.reference)?;
    for (name, value) in parameters("", &entry.defaults) {
        write!(out, "      {name} = {value}")?;
        if value.is_string() {
            write!(out, "  ({})", values(&name, &entry.build).join(", "))?;
        }
        writeln!(out)?;
    }
    Ok(())
}

/// All values that the parameter `name`, a word, may have: the refusal of any other word names them. Names of earlier
/// versions, which become others, are left out.
fn values(name: &str, build: &Build) -> Vec<String> {
    let with = |word: &str| {
        let given = (name.rsplit('.')).fold(json!(word), |inner, part| json!({part: inner}));
        build(&given)
    };
    let reason = with("?").map_or_else(|error| error.reason, |_| String::new());
    let (_, expected) = reason.split_once("expected ").unwrap_or_default();
    let words = expected.split('`').skip(1).step_by(2);
    let place = format!("/{}", name.replace('.', "/"));
    let is_kept = |word: &&str| {
        with(word).map_or(true, |params| {
            params.pointer(&place).and_then(Value::as_str) == Some(*word)
        })
    };
    words.filter(is_kept).map(str::to_owned).collect()
}

/// Every parameter by its full name: `{"extractor": {"sigma": 1.6}}` is `extractor.sigma`.
fn parameters(prefix: &str, value: &Value) -> Vec<(String, Value)> {
    match value {
        Value::Object(object) => object
            .iter()
            .flat_map(|(name, value)| {
                let dot = if prefix.is_empty() { "" } else { "." };
                parameters(&format!("{prefix}{dot}{name}"), value)
            })
            .collect(),
        value => vec![(prefix.to_owned(), value.clone())],
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_parameter_that_is_a_word_has_its_values() {
        let mut count = 0;
        let matchers = MATCHERS.iter().map(|entry| of_matcher(*entry));
        let estimators = ESTIMATORS.iter().map(|entry| of_estimator(*entry));
        for entry in matchers.chain(estimators) {
            for (name, value) in parameters("", &entry.defaults) {
                let Some(word) = value.as_str() else { continue };
                let values = values(&name, &entry.build);
                let given = values.iter().any(|value| value == word);
                assert!(given && values.len() > 1, "{}.{name}: {values:?}", entry.id);
                assert!(!values.contains(&"median".into()), "now `lmeds`");
                count += 1;
            }
        }
        assert!(count > 50, "{count}");
    }

    #[test]
    fn what_every_matcher_has_is_listed_once() {
        for name in matchers::SIZES {
            assert!(OF_ALL.contains(&format!("extractor.{name} ")), "{name}");
        }
        assert!(OF_ALL.contains(&format!("      {} ", matchers::REFINE)));
    }
}
