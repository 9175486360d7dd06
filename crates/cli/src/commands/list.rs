//! `matchbench list`: prints what is available, with its parameters.

use std::io::{self, Write};

use anyhow::Result;
use clap::ValueEnum;
use matchbench::config::Parameter;
use matchbench::counted::counted;
use matchbench::datasets::KINDS;
use matchbench::datasets::rendered;
use matchbench::estimators::{self, ESTIMATORS, EstimatorEntry};
use matchbench::exchange::FORMATS;
use matchbench::matchers::{self, MATCHERS, MatcherEntry};
use matchbench::protocols::{self, PROTOCOLS, Protocol};

use crate::Ending;
use crate::args::{ListArgs, Listed};
use crate::output::stdout;

pub(crate) fn run(args: &ListArgs) -> Result<Ending> {
    let mut out = stdout();
    match args.what.as_deref() {
        None => {
            for list in Listed::value_variants() {
                write_list(&mut out, *list)?;
            }
        }
        Some(what) => match Listed::from_str(what, false) {
            Ok(list) => write_list(&mut out, list)?,
            Err(_) => explain_id(&mut out, what)?,
        },
    }
    out.flush()?;
    Ok(Ending::Done)
}

fn write_list(out: &mut impl Write, list: Listed) -> io::Result<()> {
    match list {
        Listed::Matchers => list_matchers(out),
        Listed::Estimators => list_estimators(out),
        Listed::Protocols => list_protocols(out),
        Listed::Datasets => list_datasets(out),
        Listed::Formats => list_formats(out),
    }
}

/// Writes all about the matcher, the estimator or the protocol called `id`. A protocol may be called as a matcher is.
fn explain_id(out: &mut impl Write, id: &str) -> io::Result<()> {
    if let Ok(entry) = matchers::find(id) {
        explain(out, &of_matcher(entry))?;
        writeln!(
            out,
            "\n{OF_ALL}\n\nIts estimator, unless --estimator names another: {}",
            entry.estimator()
        )?;
    }
    if let Ok(entry) = estimators::find(id) {
        explain(out, &of_estimator(entry))?;
    }
    if let Ok(protocol) = protocols::find(id) {
        describe_protocol(out, protocol)?;
    }
    Ok(())
}

fn list_matchers(out: &mut impl Write) -> io::Result<()> {
    writeln!(
        out,
        "Matchers (--matchers ID,...; parameters: --set ID.NAME=VALUE; what they mean: matchbench list ID)\n\n\
         {OF_ALL}\n"
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
        "Estimators (--estimator ID,...; parameters: --set ID.NAME=VALUE; what they mean: matchbench list ID)\n"
    )?;
    for entry in ESTIMATORS {
        describe(out, &of_estimator(*entry))?;
        writeln!(out)?;
    }
    Ok(())
}

fn list_protocols(out: &mut impl Write) -> io::Result<()> {
    writeln!(
        out,
        "Protocols (run --protocol ID,...; eval --protocol ID,...)\n"
    )?;
    for protocol in PROTOCOLS {
        describe_protocol(out, protocol)?;
        writeln!(out)?;
    }
    Ok(())
}

fn describe_protocol(out: &mut impl Write, protocol: &Protocol) -> io::Result<()> {
    let (id, summary) = (protocol.id, protocol.summary);
    writeln!(out, "  {id:<16} {summary}\n      {}", protocol.reference)?;
    writeln!(out, "      read in {}", protocol.source)?;
    for (what, how) in protocol.in_words() {
        writeln!(out, "      {what}: {how}")?;
    }
    Ok(())
}

fn list_datasets(out: &mut impl Write) -> io::Result<()> {
    writeln!(out, "Built-in scenes (matchbench demo)\n")?;
    for scene in rendered::scenes() {
        let images = format!("{} of {}", counted(scene.frames, "image"), scene.size);
        let pairs = counted(rendered::sequence(scene).pairs.len(), "pair");
        writeln!(
            out,
            "  {:<16} {}\n      {images}, {pairs}",
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
        writeln!(out, "  {:<16} {}\n      pairs: {pairs}", kind.id, kind.help)?;
        if !options.is_empty() {
            writeln!(out, "      options: {}", options.join(" "))?;
        }
    }
    Ok(())
}

fn list_formats(out: &mut impl Write) -> io::Result<()> {
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
            "  {:<16} {}\n      {way}; {center}",
            format.id, format.layout
        )?;
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

/// What matchers and estimators have in common.
struct Entry {
    id: &'static str,
    summary: &'static str,
    reference: &'static str,
    parameters: Vec<Parameter>,
}

fn of_matcher(entry: &dyn MatcherEntry) -> Entry {
    Entry {
        id: entry.id(),
        summary: entry.summary(),
        reference: entry.reference(),
        parameters: entry.parameters(),
    }
}

fn of_estimator(entry: &dyn EstimatorEntry) -> Entry {
    Entry {
        id: entry.id(),
        summary: entry.summary(),
        reference: entry.reference(),
        parameters: entry.parameters(),
    }
}

/// An entry and its parameters, one on a line.
fn describe(out: &mut impl Write, entry: &Entry) -> io::Result<()> {
    writeln!(out, "  {:<16} {}", entry.id, entry.summary)?;
    writeln!(out, "      {}", entry.reference)?;
    for parameter in &entry.parameters {
        write!(out, "      {} = {}", parameter.name, parameter.default)?;
        if !parameter.choices.is_empty() {
            let words = parameter.choices.iter().map(|(word, _)| &**word);
            write!(out, "  ({})", words.collect::<Vec<_>>().join(", "))?;
        }
        writeln!(out)?;
    }
    Ok(())
}

/// An entry, and what each of its parameters means.
fn explain(out: &mut impl Write, entry: &Entry) -> io::Result<()> {
    writeln!(
        out,
        "{}: {}\n{}\n",
        entry.id, entry.summary, entry.reference
    )?;
    for parameter in &entry.parameters {
        writeln!(out, "  {} = {}", parameter.name, parameter.default)?;
        writeln!(out, "      {}", parameter.meaning)?;
        for (word, meaning) in &parameter.choices {
            writeln!(out, "      {word:<14} {meaning}")?;
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_every_matcher_has_is_listed_once() {
        for name in matchers::SIZES {
            assert!(OF_ALL.contains(&format!("extractor.{name} ")), "{name}");
        }
        assert!(OF_ALL.contains(&format!("      {} ", matchers::REFINE)));
    }
}
