//! `matchbench plan`: splits a run into shards for many machines.

use std::io::Write;
use std::path::{Path, absolute};

use anyhow::{Result, ensure};
use matchbench::counted::counted;
use matchbench::external::Manifest;
use matchbench::records::ShardPlan;
use matchbench::records::shards::{Asked, Part};
use matchbench::run::{images_of_one, plan_shards};

use super::job::{changes, named, replace, tell_news};
use crate::Ending;
use crate::args::PlanArgs;
use crate::output::{say, stdout, typed};
use crate::stop::end_on_ctrl_c;

pub(crate) fn run(args: &PlanArgs) -> Result<Ending> {
    let mut study = named(&args.datasets)?;
    replace(&mut study, &args.matchers, &args.choices, &args.files)?;
    study.out = Some(args.out.clone());
    let own = study
        .datasets
        .iter_mut()
        .filter_map(|dataset| dataset.matchers.as_mut());
    for name in own.flatten().chain(&mut study.matchers) {
        *name = from_anywhere(name);
    }
    for from in &mut study.matches {
        for file in &mut from.files {
            *file = absolute(&file)?;
            ensure!(
                file.to_str().is_some(),
                "{}: a plan holds paths as text; rename the file",
                file.display()
            );
        }
    }
    end_on_ctrl_c()?;
    let prepared = study.prepare_plan(&tell_news)?;
    for error in &prepared.absent {
        say!("error: {error}");
    }
    ensure!(
        prepared.absent.is_empty(),
        "every matcher must start here, since its version and parameters belong to the plan"
    );
    // What is set wins over what was tuned, as in a run.
    let tuned = prepared.tuned.iter().map(|tuned| tuned.setting.clone());
    let changed = changes(&tuned.collect::<Vec<_>>())?.with(study.set.clone());
    let has_own = study.datasets.iter().any(|d| d.matchers.is_some());
    let asked = Asked {
        settings: changed.settings()?,
        matchers: if has_own {
            study.all_matchers()
        } else {
            study.matchers.clone()
        },
        estimators: prepared.estimators.clone(),
        protocols: study.protocols.clone(),
        matches: study.matches.clone(),
    };
    let (datasets, settings) = (&prepared.datasets, prepared.settings);
    let plan = plan_shards(
        datasets,
        &prepared.contenders,
        settings,
        args.shards.get(),
        asked,
        study.keep_matches,
        &prepared.tuned,
    )?;
    plan.write(&args.out)?;
    // Of matches from files nothing is extracted.
    let is_extracted = !plan.asked().matchers.is_empty();
    let of_one = is_extracted.then(|| images_of_one(datasets, settings));
    tell(&plan, of_one, &args.out)?;
    Ok(Ending::Done)
}

/// The path of a manifest as an absolute path; any other name is unchanged.
fn from_anywhere(name: &str) -> String {
    let path = Manifest::is_path(name)
        .then(|| absolute(name).ok())
        .flatten();
    let path = path.and_then(|path| path.into_os_string().into_string().ok());
    path.unwrap_or_else(|| name.to_owned())
}

/// What a plan is and what comes next; with how many images one machine extracts, if any are extracted.
fn tell(plan: &ShardPlan, of_one: Option<u64>, folder: &Path) -> Result<()> {
    let parts = &plan.cut().parts;
    let range = |noun: &str, count: fn(&Part) -> u64| {
        let counts = parts.iter().map(count);
        let (least, most) = (counts.clone().min(), counts.max());
        let (least, most) = (least.unwrap_or(0), most.unwrap_or(0));
        if least == most {
            counted(least, noun)
        } else {
            format!("{least} to {}", counted(most, noun))
        }
    };
    let images: u64 = parts.iter().map(|part| part.images).sum();
    let mut out = stdout();
    let (shards, folder) = (plan.shards(), typed(folder));
    writeln!(
        out,
        "{}, each of {} and {}",
        counted(shards, "shard"),
        range("pair", |part| part.pairs),
        range("image", |part| part.images)
    )?;
    if let Some(of_one) = of_one {
        writeln!(
            out,
            "{} in all for each matcher, {of_one} on one machine ({:.2} times as many)",
            counted(images, "extraction"),
            images as f64 / of_one.max(1) as f64
        )?;
    }
    writeln!(
        out,
        "\nNext: matchbench work {folder} --shard K, on any machine, for each K from 1 to {shards}"
    )?;
    writeln!(out, "Then: matchbench merge {folder} --out RUN")?;
    Ok(())
}
