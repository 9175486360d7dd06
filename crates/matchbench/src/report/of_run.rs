//! The whole report of a run. It needs nothing but the folder of the run, so anybody can make it, years later.
//!
//! Some data are not in the folder: the datasets (images, baselines and angles; overlaps that were measured by
//! depth are in the records) and the feature cache (keypoints). They are used if they are still in their
//! places. If not, [`Reported::notes`] names what is missing.

use std::collections::{BTreeMap, BTreeSet};
use std::io;
use std::path::{Path, PathBuf};

use super::bundle::write_bundle;
use super::content::{Content, RunFacts, TUNED};
use super::dataset_facts::DatasetFacts;
use super::folder::{write_inner_report, write_report};
use super::outside::outside;
use super::paper::{PaperTimes, write_paper};
use super::pictures::{self, Keypoints};
use crate::cache::FeatureCache;
use crate::datasets::Sequence;
use crate::metrics::{PairGeometry, ResultsError, Unfinished, doubts, load_run};
use crate::records::{FolderError, Plan, RunFolder, StoreError};

/// Options of a report.
#[derive(Clone, Copy, Debug)]
pub struct ReportOptions<'a> {
    /// The folder of the report. Default: `report` in the folder of the run.
    pub out: Option<&'a Path>,
    /// One file that everything is written to, instead of a folder. Default: none.
    pub bundle: Option<&'a Path>,
    /// The feature cache, from which keypoints are drawn. Default: `cache` in the folder of the run.
    pub cache: Option<&'a Path>,
    /// Pairs of each dataset that have pictures. Default: 16.
    pub pictures: usize,
}

impl Default for ReportOptions<'_> {
    fn default() -> Self {
        Self {
            out: None,
            bundle: None,
            cache: None,
            pictures: 16,
        }
    }
}

/// A report that was written.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Reported {
    /// The path of its page.
    pub page: PathBuf,
    /// What is missing in the report, and why, and which truths look wrong, in sentences.
    pub notes: Vec<String>,
}

/// Why a report could not be made.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum ReportError {
    /// The results cannot be scored.
    #[error(transparent)]
    Results(#[from] ResultsError),
    /// The folder of the run cannot be read.
    #[error(transparent)]
    Folder(#[from] FolderError),
    /// Records or matches cannot be read.
    #[error(transparent)]
    Store(#[from] StoreError),
    /// A file of the report cannot be written; the error names the file.
    #[error(transparent)]
    Io(#[from] io::Error),
}

/// Writes the report of a run. Threads of the current rayon pool are used, and do not change the result.
///
/// # Errors
/// If the run cannot be read or the report cannot be written.
pub fn of_run(run: &RunFolder, options: &ReportOptions<'_>) -> Result<Reported, ReportError> {
    let (content, notes) = content_of_run(run, options)?;
    Ok(Reported {
        page: write(run, options, &content)?,
        notes,
    })
}

/// Writes the report of a run to `report` in `folder`, and the paper's tables and figures to `folder` itself.
/// Returns the path of the page of the paper. The options of the report apply, except for its place.
///
/// # Errors
/// As [`of_run`].
pub fn paper_of_run(
    run: &RunFolder,
    options: &ReportOptions<'_>,
    times: &PaperTimes,
    folder: &Path,
) -> Result<Reported, ReportError> {
    let (content, mut notes) = content_of_run(run, options)?;
    write_inner_report(&folder.join("report"), &content)?;
    let (page, missing) = write_paper(folder, &content, times)?;
    notes.extend(missing);
    Ok(Reported { page, notes })
}

/// The content of the report of a run, what is missing in it and why, and which truths look wrong, in sentences.
///
/// # Errors
/// If the run cannot be read.
pub fn content_of_run(
    run: &RunFolder,
    options: &ReportOptions<'_>,
) -> Result<(Content, Vec<String>), ReportError> {
    let results = load_run(run, None)?;
    let mut content = Content::new(results, facts(run)?);
    let (sequences, mut notes) = sequences(run.plan());
    content.take_lacking(run, Unfinished::of(run, &content.results)?);
    let lacking = content.lacking.iter();
    notes.extend(lacking.flat_map(|lacking| lacking.what.sentences.iter().cloned()));
    content.doubts = doubts(run, &content.results)?;
    notes.extend(content.doubts.iter().cloned());
    content.geometry = (sequences.iter())
        .map(|(name, sequence)| (name.clone(), PairGeometry::of_sequence(sequence)))
        .collect();
    for set in &content.results {
        let geometry = content.geometry.entry(set.dataset.clone()).or_default();
        PairGeometry::measure(geometry, set);
    }
    content.geometry.retain(|_, geometry| !geometry.is_empty());
    leave_out_what_was_not_run(&mut content);
    content.extractions = (run.plan().matchers.iter())
        .filter_map(|matcher| {
            let extraction = serde_json::to_string(matcher.extraction.as_ref()?);
            let text = extraction.expect("an extraction is plain JSON");
            Some((matcher.id.clone(), text))
        })
        .collect();
    content.outside = outside(run)?;
    let cache = (options.cache).map_or_else(|| run.default_cache(), Path::to_path_buf);
    let keypoints = Keypoints::new(run.plan(), FeatureCache::new(cache));
    let count = options.pictures;
    let (results, geometry) = (&content.results, &content.geometry);
    let sample = pictures::sample(run, results, &sequences, geometry, keypoints, count)?;
    content.views = sample.0;
    notes.extend(sample.1);
    content.datasets = (run.plan().datasets.iter())
        .filter_map(|dataset| {
            let sequence = sequences.get(&dataset.name)?;
            Some(DatasetFacts::of_sequence(&dataset.path, sequence))
        })
        .collect();
    content.take_portions();
    Ok((content, notes))
}

fn write(run: &RunFolder, options: &ReportOptions<'_>, content: &Content) -> io::Result<PathBuf> {
    if let Some(file) = options.bundle {
        return write_bundle(file, content);
    }
    match options.out {
        Some(out) => write_report(out, content),
        None => write_inner_report(&run.default_report(), content),
    }
}

fn facts(run: &RunFolder) -> Result<RunFacts, FolderError> {
    let plan = run.plan();
    // Nothing of the machine that writes the report: the run may have been done elsewhere.
    let mut facts = vec![
        ("version".into(), format!("matchbench {}", plan.version)),
        ("seed".into(), plan.settings.seed.to_string()),
    ];
    let tuned = run.tuned()?;
    facts.extend((tuned.iter()).map(|tuned| (TUNED.to_owned(), tuned.in_words())));
    for matcher in &plan.matchers {
        let version = matcher
            .version
            .iter()
            .map(|version| format!("version {version}"));
        let notes = version.chain(matcher.notes.iter().cloned());
        facts.extend(notes.map(|note| (matcher.id.clone(), note)));
    }
    Ok(RunFacts {
        title: "matchbench report".into(),
        facts,
        plan: Some(run.plan_text()?),
        results: Vec::new(),
    })
}

/// The datasets of a run that are still in their places, and a note for each of the others.
pub(super) fn sequences(plan: &Plan) -> (BTreeMap<String, Sequence>, Vec<String>) {
    let (mut sequences, mut notes) = (BTreeMap::new(), Vec::new());
    for dataset in &plan.datasets {
        match Sequence::open(&dataset.path) {
            Ok(sequence) if sequence.fingerprint() != dataset.fingerprint => {
                notes.push(format!(
                    "no pictures and no baselines of {} in the report: {} is another dataset now than \
                     the run was of (other cameras, pairs or true poses)",
                    dataset.name,
                    dataset.path.display()
                ));
            }
            Ok(sequence) => {
                sequences.insert(dataset.name.clone(), sequence);
            }
            Err(error) => notes.push(format!(
                "no pictures and no baselines of {} in the report: {error}",
                dataset.name
            )),
        }
    }
    (sequences, notes)
}

/// A run may be limited to some of the pairs. The other pairs must not count when pairs are divided into easy
/// and hard.
fn leave_out_what_was_not_run(content: &mut Content) {
    for (name, geometry) in &mut content.geometry {
        let sets = content.results.iter().filter(|set| set.dataset == *name);
        let run: BTreeSet<_> = sets
            .flat_map(|set| &set.pairs)
            .map(|p| (p.a, p.b))
            .collect();
        geometry.retain(|pair, _| run.contains(pair));
    }
}
