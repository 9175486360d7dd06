//! `matchbench tune`: finds the best value of one parameter of an estimator, on scenes that are not reported.

use std::io::Write;
use std::num::NonZeroUsize;
use std::path::Path;

use anyhow::Result;
use matchbench::config::parse_value;
use matchbench::records::{RunSettings, Tuned};
use matchbench::run::ContenderError;
use matchbench::study::sources_for;
use matchbench::tune::{TuneError, Tuning, tune};
use serde_json::Value;

use super::job::{AFTER_PAIRS, cache, changes, check_names, open, tell, tell_news};
use super::matches;
use crate::Ending;
use crate::args::TuneArgs;
use crate::output::{say, stdout};
use crate::progress::Progress;
use crate::stop::Stop;

pub(crate) fn run(args: &TuneArgs) -> Result<Ending> {
    check_names(&args.matchers)?;
    let values: Vec<Value> = args.values.iter().map(|text| parse_value(text)).collect();
    let datasets = open(&args.datasets)?;
    let sources = sources_for(&matches::asked(&args.files)?, &datasets, &tell_news)?;
    let tuning = Tuning {
        datasets: &datasets,
        matchers: &args.matchers,
        parameter: &args.parameter,
        values: &values,
        changes: &changes(&args.set)?,
        settings: RunSettings {
            seed: args.seed,
            repetitions: args.repeat,
            limit: args.limit.map(NonZeroUsize::get),
            ..RunSettings::default()
        },
        folder: &args.out,
        cache: &cache(args.cache.as_deref(), &args.out),
    };
    let stop = Stop::on_ctrl_c(AFTER_PAIRS)?;
    let cancel = stop.begin();
    let bar = Progress::new();
    let done = tune(&tuning, sources, &bar, cancel);
    bar.finish();
    let done = match done {
        Err(TuneError::Contender(ContenderError::Start(_))) if cancel.is_set() => {
            say!("stopped before all matchers were ready; the same command begins anew");
            return Ok(Ending::Stopped);
        }
        done => done?,
    };
    let ending = tell(&done.summary, &args.out, cancel);
    match &done.tuned {
        Some(tuned) => ending.after(print(tuned, &args.parameter, &args.out)),
        None => Ok(ending),
    }
}

fn print(tuned: &Tuned, parameter: &str, folder: &Path) -> Result<()> {
    let mut out = stdout();
    writeln!(out, "{parameter}: mean AUC over datasets and matchers")?;
    let chosen = |value: &Value| tuned.setting == format!("{parameter}={value}");
    let best = tuned.auc.iter().find(|(value, _)| chosen(value));
    let all_equal = tuned.auc.windows(2).all(|two| two[0].1 == two[1].1);
    for (value, auc) in &tuned.auc {
        let mark = match best {
            _ if all_equal => "",
            _ if chosen(value) => "  <- best",
            Some((_, best)) if best == auc => "  as good",
            _ => "",
        };
        // `Value` ignores the width that a format asks for.
        let value = value.to_string();
        writeln!(out, "  {value:<12} {auc:.4}{mark}")?;
    }
    if all_equal {
        writeln!(
            out,
            "all values are equally good on these datasets: they give no reason to choose one, and {} is taken \
             as the first",
            tuned.setting
        )?;
    }
    let ends = [tuned.auc.first(), tuned.auc.last()];
    let mut ends = ends.into_iter().flatten();
    if !all_equal && ends.any(|(value, _)| value.is_number() && chosen(value)) {
        writeln!(
            out,
            "the best value is at the end of those that were tried: try further ones"
        )?;
    }
    let path = folder.join("tuned.json");
    writeln!(
        out,
        "\nwritten to {0}; on other scenes: matchbench run ... --tuned {0}",
        path.display()
    )?;
    Ok(())
}
