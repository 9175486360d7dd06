//! `matchbench tune`: the best value of one parameter of an estimator, on scenes that are not reported.
//!
//! Each value becomes a variant of the estimator, and all of them run as estimators of one run: on
//! the same matches, with progress, and resumable. What is chosen is the value with the highest AUC,
//! averaged over datasets and matchers with equal weight.

use std::fs;
use std::io::Write;
use std::path::Path;

use anyhow::{Context, Result, bail, ensure};
use matchbench::files::write_whole;
use matchbench::metrics::Summary;
use matchbench::run::{Plan, Settings};
use serde::{Deserialize, Serialize};
use serde_json::Value;

use super::eval;
use super::run::{Job, open};
use crate::Ending;
use crate::args::TuneArgs;
use crate::contenders::{parse_value, variants};

/// What was chosen, and on which scenes: `tuned.json`, for `run --tuned`.
#[derive(Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct Tuned {
    /// The setting, as `--set` takes it.
    pub(crate) setting: String,
    /// Fingerprints and names of the datasets that it was chosen on.
    pub(crate) datasets: Vec<TunedOn>,
    /// The matchers whose matches were used.
    pub(crate) matchers: Vec<String>,
    /// Mean AUC with each value that was tried.
    pub(crate) auc: Vec<(Value, f64)>,
}

/// A dataset that something was tuned on.
#[derive(Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct TunedOn {
    pub(crate) name: String,
    pub(crate) fingerprint: String,
}

impl Tuned {
    /// What `matchbench tune` wrote.
    pub(crate) fn read(path: &Path) -> Result<Self> {
        let text = fs::read_to_string(path).with_context(|| {
            format!(
                "cannot read {}; `matchbench tune` writes it",
                path.display()
            )
        })?;
        serde_json::from_str(&text)
            .with_context(|| format!("{} is not what `matchbench tune` writes", path.display()))
    }

    /// Refuses a plan that reports on scenes that this was tuned on.
    pub(crate) fn check(&self, plan: &Plan) -> Result<()> {
        for dataset in &plan.datasets {
            let seen = |on: &&TunedOn| on.fingerprint == dataset.fingerprint;
            if let Some(on) = self.datasets.iter().find(seen) {
                bail!(
                    "{} was tuned on {}, which is the dataset {}: a score on it would be no test; \
                     take another dataset, or tune on others",
                    self.setting,
                    on.name,
                    dataset.name
                );
            }
        }
        Ok(())
    }
}

pub(crate) fn run(args: &TuneArgs) -> Result<Ending> {
    let (id, name) = args.parameter.split_once('.').with_context(|| {
        format!(
            "{}: expected ESTIMATOR.PARAMETER, for example ransac-e.threshold_px",
            args.parameter
        )
    })?;
    let values: Vec<Value> = args.values.iter().map(|text| parse_value(text)).collect();
    ensure!(values.len() > 1, "--values needs at least two values");
    let contenders = variants(&args.matchers, id, name, &values, &args.set)?;
    let datasets = open(&args.datasets)?;
    let job = Job {
        datasets: &datasets,
        contenders: &contenders,
        settings: Settings {
            seed: args.seed,
            repetitions: args.repeat,
            limit: args.limit,
            time_budget_ms: None,
        },
        folder: &args.out,
        cache: args.cache.as_deref(),
        threads: args.threads,
        keep_matches: true,
    };
    let ending = job.execute()?;
    if ending == Ending::Stopped {
        return Ok(ending);
    }
    let summaries = eval::summaries(&args.out, None)?;
    let auc: Vec<(Value, f64)> = (values.iter().zip(&contenders[0].estimators))
        .map(|(value, variant)| (value.clone(), mean_auc(&summaries, &variant.id)))
        .collect();
    let (best, _) = (auc.iter().rev())
        .max_by(|(_, x), (_, y)| x.total_cmp(y))
        .expect("there are values");
    let plan = Plan::new(&datasets, &contenders, job.settings)?;
    let tuned = Tuned {
        setting: format!("{}={best}", args.parameter),
        datasets: (plan.datasets.into_iter())
            .map(|dataset| TunedOn {
                name: dataset.name,
                fingerprint: dataset.fingerprint,
            })
            .collect(),
        matchers: (contenders.iter())
            .map(|contender| contender.matcher.id.clone())
            .collect(),
        auc,
    };
    let path = args.out.join("tuned.json");
    let text = serde_json::to_string_pretty(&tuned)?;
    write_whole(&path, format!("{text}\n").as_bytes())?;
    tell(&tuned, &args.parameter, &path)?;
    Ok(ending)
}

fn mean_auc(summaries: &[Summary], estimator: &str) -> f64 {
    let aucs: Vec<f64> = (summaries.iter())
        .filter(|summary| summary.estimator == estimator)
        .filter_map(|summary| summary.auc.value)
        .collect();
    aucs.iter().sum::<f64>() / aucs.len() as f64
}

fn tell(tuned: &Tuned, parameter: &str, path: &Path) -> Result<()> {
    let mut out = std::io::stdout().lock();
    writeln!(out, "{parameter}: mean AUC over datasets and matchers")?;
    for (value, auc) in &tuned.auc {
        let chosen = tuned.setting == format!("{parameter}={value}");
        let mark = if chosen { "  <- best" } else { "" };
        writeln!(out, "  {value:<12} {auc:.4}{mark}")?;
    }
    writeln!(
        out,
        "\nwritten to {0}; on other scenes: matchbench run ... --tuned {0}",
        path.display()
    )?;
    Ok(())
}
