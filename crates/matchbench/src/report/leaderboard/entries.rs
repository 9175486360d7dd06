//! Reads what lies below a folder: runs, and results in the authors' layout. Each file is read on its own.
//!
//! Anybody may have made the entries. Links are not followed, since they could lead out of the folder. The plan
//! of a run must name everything that its records belong to. An unfinished run, a tuning and a shard are not
//! results yet, and are refused. Every error is reported for the file that it is found in.

use std::collections::BTreeSet;
use std::fs;
use std::io::{self, BufRead as _, BufReader, Read as _};
use std::path::{Path, PathBuf};

use crate::counted::counted;
use crate::files::{link_in, open_file};
use crate::metrics::{Failure, FileResults, ResultSet, load_each};
use crate::protocols;
use crate::records::{DatasetPlan, EstimatorPlan, MatcherPlan, Plan, RunFolder};

use super::super::command_line::{self, CommandLine, Origin};
use super::truth::{Truth, Truths, check};
use super::{Errors, Refused, Source};

/// All that was found.
#[derive(Debug, Default)]
pub(super) struct Entries {
    pub(super) scored: Vec<Scored>,
    pub(super) refused: Vec<Refused>,
}

/// One method on one dataset.
#[derive(Debug)]
pub(super) struct Scored {
    pub(super) set: ResultSet,
    pub(super) fingerprint: String,
    /// How many pairs the dataset lists.
    pub(super) listed: usize,
    pub(super) source: Source,
}

/// Everything below `folder`, in the order of names.
///
/// # Errors
/// If `folder` cannot be listed.
pub(super) fn below(folder: &Path, datasets: Option<&Path>) -> io::Result<Entries> {
    let mut reader = Reader {
        root: folder,
        datasets,
        truths: Truths::default(),
        found: Entries::default(),
    };
    let inside = listed(folder)?;
    reader.find_datasets(folder, &inside);
    reader.read(folder, &inside);
    Ok(reader.found)
}

struct Reader<'a> {
    root: &'a Path,
    datasets: Option<&'a Path>,
    truths: Truths,
    found: Entries,
}

impl Reader<'_> {
    /// Notes where the runs in and below a folder had their datasets. Errors are reported later, by `read`.
    fn find_datasets(&mut self, folder: &Path, inside: &[Inside]) {
        if inside.iter().any(|it| it.name == "plan.json") {
            let run = RunFolder::open(folder);
            for dataset in run.iter().flat_map(|run| &run.plan().datasets) {
                self.truths.expect(dataset, self.datasets, self.root);
            }
            return;
        }
        for it in inside.iter().filter(|it| it.is_folder) {
            if let Ok(inside) = listed(&it.path) {
                self.find_datasets(&it.path, &inside);
            }
        }
    }

    /// Reads a folder with these files and folders in it: it is an entry, or a folder of entries.
    fn read(&mut self, folder: &Path, inside: &[Inside]) {
        let has = |name: &str| inside.iter().any(|it| it.name == name);
        let is_run = has("plan.json") || has("records");
        let mut judged = Vec::new();
        let what = if has("plan.json") {
            self.run(folder)
        } else if is_run {
            Err("a run without its plan.json, which says what its records are of".to_owned())
        } else if is_of_results(inside, self.datasets) {
            self.results(folder)
        } else {
            judged = without_truth(inside);
            if judged.is_empty() {
                Ok(())
            } else {
                Err(
                    "results without a truth: put groundtruth.txt beside them, or name the folder of the datasets \
                     with --datasets"
                        .to_owned(),
                )
            }
        };
        if let Err(reason) = what {
            self.refuse(folder, reason);
        }
        if is_run {
            return; // features, reports and shards of a run are no entries
        }
        let unjudged = |it: &&Inside| it.is_folder && !judged.contains(&&*it.name);
        for it in inside.iter().filter(unjudged) {
            // What cannot be listed is refused by its name; the rest is still read.
            match listed(&it.path) {
                Ok(inside) => self.read(&it.path, &inside),
                Err(error) => self.refuse(&it.path, error.to_string()),
            }
        }
    }

    fn run(&mut self, folder: &Path) -> Result<(), String> {
        no_links(folder, &["plan.json", "tuned.json", "records"])?;
        let run = RunFolder::open(folder).map_err(|error| error.to_string())?;
        if run.plan().shard.is_some() {
            return Err("a shard of a larger run; merge it first".to_owned());
        }
        if run.tuned_file().exists() {
            return Err("a tuning: its scores chose a parameter and are no results".to_owned());
        }
        let each = load_each(folder, None).map_err(|error| error.to_string())?;
        if each.is_empty() {
            return Err("the run has no records yet".to_owned());
        }
        let plan = run.plan().modernized();
        let mut seen = Vec::new();
        for file in each {
            let path = file.file.clone();
            match self.records(&run, &plan, file, &mut seen) {
                Ok(scored) => self.found.scored.push(scored),
                Err(reason) => self.refuse(&path, reason),
            }
        }
        Ok(())
    }

    /// One file of records.
    fn records(
        &mut self,
        run: &RunFolder,
        plan: &Plan,
        FileResults { file, results, .. }: FileResults,
        seen: &mut Vec<[String; 3]>,
    ) -> Result<Scored, String> {
        let mut set = results.map_err(|error| error.to_string())?;
        let (dataset, matcher, estimator) = planned(plan, &set)?;
        is_under_its_protocol(estimator)?;
        let names = [&set.dataset, &set.matcher, &set.estimator].map(String::clone);
        if seen.contains(&names) {
            return Err("another file of this run holds the same".to_owned());
        }
        seen.push(names);
        let truth = self.truths.of(dataset);
        is_finished(plan, dataset, &set, truth)?;
        let checked = truth.map_or(Ok(false), |truth| check(run, &mut set, truth))?;
        let again = command_line::cell(plan, dataset, (matcher, estimator), "again");
        let note = match (&again, Origin::of(matcher)) {
            (_, Origin::Python) => "needs its code in Python".to_owned(),
            (None, _) => "no command asks for it; its plan says what was run".to_owned(),
            (_, Origin::Native) => String::new(),
            (_, Origin::Files) => "needs the files of its matches".to_owned(),
            (_, Origin::Outside) => format!(
                "needs the program {}",
                matcher.version.as_deref().unwrap_or_default()
            ),
        };
        let entry = self.place(run.path());
        let rescore = CommandLine::new(["eval", &*command_line::folder(&entry), "--format", "csv"]);
        Ok(Scored {
            fingerprint: dataset.fingerprint.clone(),
            listed: dataset.pairs,
            source: Source {
                file: below_folder(run.path(), &file),
                blake3: hash(&file)?,
                version: plan.version.clone(),
                errors: if checked {
                    Errors::Checked
                } else {
                    Errors::Stated
                },
                commands: again
                    .into_iter()
                    .chain([rescore])
                    .map(|line| line.to_string())
                    .collect(),
                note,
                entry,
            },
            set,
        })
    }

    fn results(&mut self, folder: &Path) -> Result<(), String> {
        no_links(folder, &[""])?;
        for file in load_each(folder, self.datasets).map_err(|error| error.to_string())? {
            let path = file.file.clone();
            match self.published(folder, file) {
                Ok(scored) => self.found.scored.push(scored),
                Err(reason) => self.refuse(&path, reason),
            }
        }
        Ok(())
    }

    /// One file of results.
    fn published(
        &self,
        folder: &Path,
        FileResults {
            file,
            truth,
            has_own_truth,
            results,
        }: FileResults,
    ) -> Result<Scored, String> {
        let set = results.map_err(|error| error.to_string())?;
        if set
            .pairs
            .iter()
            .all(|pair| pair.outcome == Err(Failure::Missing))
        {
            return Err("no row is of a pair that counts".to_owned());
        }
        let entry = self.place(folder);
        let mut words = vec!["eval".to_owned(), command_line::folder(&entry)];
        if self.datasets.is_some() {
            // Another folder on each machine; entries are named from their own.
            words.extend(["--datasets", "DATASETS"].map(str::to_owned));
        }
        words.extend(["--format", "csv"].map(str::to_owned));
        let (errors, note) = if has_own_truth {
            let note = "result files: in the folder of the entries their scoring can be done again, by the truth that came with them";
            (Errors::OwnTruth, note)
        } else {
            let note = "result files: in the folder of the entries their scoring can be done again, with DATASETS for the folder \
                        of datasets";
            (Errors::Checked, note)
        };
        Ok(Scored {
            fingerprint: truth.unwrap_or_default(),
            listed: set.pairs.len(),
            source: Source {
                file: below_folder(folder, &file),
                blake3: hash(&file)?,
                version: String::new(),
                errors,
                commands: vec![CommandLine::new(words).to_string()],
                note: note.to_owned(),
                entry,
            },
            set,
        })
    }

    fn refuse(&mut self, path: &Path, reason: String) {
        let place = self.place(path);
        // Messages about a file contain its path on this machine.
        let root = format!("{}/", self.root.display());
        let reason = reason.replace(&root, "");
        self.found.refused.push(Refused { place, reason });
    }

    fn place(&self, path: &Path) -> String {
        match &*below_folder(self.root, path) {
            "" => ".".to_owned(),
            place => place.to_owned(),
        }
    }
}

/// Something in a folder.
struct Inside {
    name: String,
    path: PathBuf,
    is_folder: bool,
}

/// What is in a folder, sorted; hidden files and links are left out.
fn listed(folder: &Path) -> io::Result<Vec<Inside>> {
    let mut inside = Vec::new();
    for entry in fs::read_dir(folder)? {
        let entry = entry?;
        let (what, name) = (entry.file_type()?, entry.file_name());
        let name = name.to_string_lossy().into_owned();
        if !what.is_symlink() && !name.starts_with('.') {
            inside.push(Inside {
                name,
                path: entry.path(),
                is_folder: what.is_dir(),
            });
        }
    }
    inside.sort_by(|one, other| one.name.cmp(&other.name));
    Ok(inside)
}

/// Whether the folders in a folder hold results. Results are text files with a truth beside them or in
/// `datasets`. The text files of a dataset are not results.
fn is_of_results(inside: &[Inside], datasets: Option<&Path>) -> bool {
    inside.iter().filter(|it| it.is_folder).any(|sequence| {
        let has = |name: &str| sequence.path.join(name).is_file();
        let known = datasets
            .is_some_and(|datasets| datasets.join(&sequence.name).join("pairs.txt").is_file());
        !has("pairs.txt") && !has("plan.json") && (has("groundtruth.txt") || known)
    })
}

/// The folders in a folder that have text files which begin with a row of results: two frames, a count and the
/// twelve numbers of a pose.
fn without_truth(inside: &[Inside]) -> Vec<&str> {
    let has_results = |sequence: &&Inside| {
        let files = listed(&sequence.path).unwrap_or_default();
        let mut texts = files
            .iter()
            .filter(|file| file.path.extension() == Some("txt".as_ref()) && !file.is_folder);
        // The text files of a dataset are in one folder with these.
        let is_dataset = files.iter().any(|file| file.name == "pairs.txt");
        !is_dataset && texts.any(|text| begins_with_a_result(&text.path).unwrap_or(false))
    };
    let sequences = inside.iter().filter(|it| it.is_folder);
    let without = sequences.filter(has_results);
    without.map(|sequence| &*sequence.name).collect()
}

fn begins_with_a_result(file: &Path) -> io::Result<bool> {
    /// A row has about 250 bytes.
    const LONGEST_ROW: u64 = 4096;
    let mut row = String::new();
    BufReader::new(open_file(file)?.take(LONGEST_ROW)).read_line(&mut row)?;
    let numbers: Result<Vec<f64>, _> = row.split_whitespace().map(str::parse).collect();
    Ok(numbers.is_ok_and(|numbers| numbers.len() == 15))
}

/// Refuses an entry if one of its parts with these names is a link that leads elsewhere; the empty name stands
/// for the entry itself.
fn no_links(entry: &Path, parts: &[&str]) -> Result<(), String> {
    match parts.iter().find_map(|part| link_in(&entry.join(part), 3)) {
        Some(link) => Err(format!(
            "{} is a link, and links are not followed",
            link.display()
        )),
        None => Ok(()),
    }
}

/// What the plan says about these results.
fn planned<'a>(
    plan: &'a Plan,
    set: &ResultSet,
) -> Result<(&'a DatasetPlan, &'a MatcherPlan, &'a EstimatorPlan), String> {
    let dataset = plan
        .datasets
        .iter()
        .find(|dataset| dataset.name == set.dataset);
    let matcher = plan.matcher(&set.matcher);
    let estimator = matcher.and_then(|matcher| {
        matcher
            .estimators
            .iter()
            .find(|planned| planned.id == set.estimator)
    });
    match (dataset, matcher, estimator) {
        (Some(dataset), Some(matcher), Some(estimator)) => Ok((dataset, matcher, estimator)),
        _ => Err(
            "its plan does not name the dataset, matcher and estimator of these records".to_owned(),
        ),
    }
}

/// Refuses an estimator whose name says another protocol than its rules are of: by the name it is compared with
/// others.
fn is_under_its_protocol(estimator: &EstimatorPlan) -> Result<(), String> {
    let protocol = protocols::of_estimator(&estimator.id);
    if estimator.protocol == protocol.rules() {
        return Ok(());
    }
    Err(format!(
        "its plan has other rules for the estimator {} than those of the protocol {} in this version",
        estimator.id, protocol.id
    ))
}

/// Refuses results of other tasks than those that are planned. Missing pairs would count as wrong, or would not
/// count at all, and pairs that somebody chose may be easier than those of the plan.
fn is_finished(
    plan: &Plan,
    dataset: &DatasetPlan,
    set: &ResultSet,
    truth: Option<&Truth>,
) -> Result<(), String> {
    // Whoever read the records has seen that none is there twice, and each pair in its planned repetitions.
    let (recorded, planned) = (set.pairs.len(), plan.tasks_on(dataset));
    if recorded != planned {
        let planned = counted(planned, "planned task");
        return Err(format!("{recorded} of {planned} recorded"));
    }
    let pairs: BTreeSet<_> = set.pairs.iter().map(|pair| (pair.a, pair.b)).collect();
    truth.map_or(Ok(()), |truth| {
        truth.has_chosen(&plan.settings, &pairs, dataset)
    })
}

fn below_folder(folder: &Path, path: &Path) -> String {
    let below = path.strip_prefix(folder).unwrap_or(path);
    below.to_string_lossy().replace('\\', "/")
}

fn hash(file: &Path) -> Result<String, String> {
    let mut hasher = blake3::Hasher::new();
    open_file(file)
        .and_then(|mut file| io::copy(&mut file, &mut hasher))
        .map_err(|error| error.to_string())?;
    Ok(hasher.finalize().to_hex().to_string())
}
