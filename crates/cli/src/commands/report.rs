//! `matchbench report`: the report of a run, `RUN/report/index.html` and what belongs to it.

use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::io::Write;
use std::path::{Path, PathBuf};

use anyhow::{Context, Result};
use matchbench::datasets::Sequence;
use matchbench::metrics::{Bootstrap, PairGeometry, load};
use matchbench::report::{Content, RunFacts, write_report};
use matchbench::run::{FeatureCache, Plan};

use super::pictures::{self, Keypoints};
use super::tune::Tuned;
use crate::Ending;
use crate::args::ReportArgs;

/// Pairs of each dataset that have pictures, where nothing else is asked for.
pub(crate) const PICTURES: usize = 16;

pub(crate) fn run(args: &ReportArgs) -> Result<Ending> {
    let page = write(
        &args.run,
        args.out.as_deref(),
        args.cache.as_deref(),
        args.pictures,
    )?;
    writeln!(std::io::stdout(), "{}", page.display())?;
    Ok(Ending::Done)
}

/// Writes the report of the run in `folder`, with pictures of so many pairs of each dataset, and
/// returns its page; keypoints come from the feature `cache`, if not from the usual one.
pub(crate) fn write(
    folder: &Path,
    out: Option<&Path>,
    cache: Option<&Path>,
    pictures: usize,
) -> Result<PathBuf> {
    let file = folder.join("plan.json");
    let text =
        fs::read_to_string(&file).with_context(|| format!("cannot read {}", file.display()))?;
    let plan: Plan = serde_json::from_str(&text)
        .with_context(|| format!("{} is not the plan of a run", file.display()))?;
    let mut facts = RunFacts {
        title: "matchbench report".into(),
        facts: vec![
            ("version".into(), format!("matchbench {}", plan.version)),
            ("seed".into(), plan.settings.seed.to_string()),
            (
                "platform".into(),
                format!("{} {}", std::env::consts::OS, std::env::consts::ARCH),
            ),
        ],
        plan: Some(text),
    };
    let tuned = Tuned::noted(folder)?;
    facts
        .facts
        .extend((tuned.iter()).map(|tuned| ("tuned parameter".to_owned(), tuned.in_words())));
    let mut content = Content::new(load(folder, None)?, &Bootstrap::default(), facts);
    let sequences = sequences(&plan);
    content.geometry = (sequences.iter())
        .map(|(name, sequence)| (name.clone(), PairGeometry::of_sequence(sequence)))
        .collect();
    // A run may be limited to some of the pairs; the others are no part of easy or hard.
    for (name, geometry) in &mut content.geometry {
        let sets = content.results.iter().filter(|set| set.dataset == *name);
        let run: BTreeSet<_> = sets
            .flat_map(|set| &set.pairs)
            .map(|p| (p.a, p.b))
            .collect();
        geometry.retain(|pair, _| run.contains(pair));
    }
    content.extractions = (plan.matchers.iter())
        .map(|matcher| {
            Ok((
                matcher.id.clone(),
                serde_json::to_string(&matcher.extraction)?,
            ))
        })
        .collect::<Result<_>>()?;
    let cache = cache.map_or_else(|| folder.join("cache"), Path::to_path_buf);
    let keypoints = Keypoints::new(&plan, FeatureCache::new(cache));
    content.views = pictures::sample(folder, &content.results, &sequences, keypoints, pictures)?;
    let default = folder.join("report");
    Ok(write_report(out.unwrap_or(&default), &content)?)
}

/// The datasets of a run that are still where they were; the report does without the others.
fn sequences(plan: &Plan) -> BTreeMap<String, Sequence> {
    let mut sequences = BTreeMap::new();
    for dataset in &plan.datasets {
        match Sequence::open(&dataset.path) {
            Ok(sequence) => {
                sequences.insert(dataset.name.clone(), sequence);
            }
            Err(error) => eprintln!(
                "note: no pictures and no baselines of {} in the report: {error}",
                dataset.name
            ),
        }
    }
    sequences
}
