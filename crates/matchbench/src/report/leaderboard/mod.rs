//! A leaderboard: runs and result files of many people on one page. Every score is computed from the records.
//!
//! 1. `entries` finds what lies below a folder and reads every file on its own. A file that is damaged, or is
//!    not what it claims to be, is refused with the reason; the others are still read.
//! 2. Results that can be compared form one group: the same dataset by name and fingerprint, the same pairs of
//!    it, the same protocol. Scores for different truths or different pairs are never in one table.
//! 3. The methods of a group are scored and compared as in a report ([`Content`]): intervals
//!    over images, letters by Holm's test.

mod entries;
mod truth;

use std::collections::BTreeMap;
use std::io;
use std::path::Path;

use crate::metrics::{Angle, Groups, Model, ResultSet, Summary, groups, ranks};

use super::content::{Content, RunFacts};
use entries::{Entries, Scored};

/// All that was found, in groups that can be compared.
#[derive(Clone, Debug, Default)]
pub struct Leaderboard {
    /// Sorted by the names of datasets and protocols.
    pub groups: Vec<Group>,
    /// What was refused, in the order in which it was found.
    pub refused: Vec<Refused>,
}

/// Something that is not on the leaderboard.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Refused {
    /// Its path, relative to the folder that was read.
    pub place: String,
    /// Why.
    pub reason: String,
}

/// Methods that can be compared: they are judged on the same pairs, by the same truth and protocol.
#[derive(Clone, Debug)]
pub struct Group {
    /// Name of the dataset.
    pub dataset: String,
    /// Hash of its cameras and pairs with their truth. For result files whose dataset is not available, hash of
    /// the pairs with their truth only.
    pub fingerprint: String,
    /// What is estimated: poses or homographies.
    pub model: Model,
    /// Id of the protocol.
    pub protocol: &'static str,
    /// How many of its pairs count, and how many the dataset lists.
    pub pairs: [usize; 2],
    /// How many datasets have the same name and another fingerprint.
    pub namesakes: usize,
    /// The methods, the highest AUC first, and equal ones by name.
    pub rows: Vec<Row>,
    /// The same data for figures. Each method has a name of its own there.
    pub(super) content: Content,
}

/// One method of one entry.
#[derive(Clone, Debug)]
pub struct Row {
    /// Its rank: one more than the number of methods that are better.
    pub rank: usize,
    /// Its name in the group: the matcher, followed by the entry if several entries have this matcher.
    pub label: String,
    /// Its scores.
    pub summary: Summary,
    /// What it was computed from.
    pub source: Source,
}

/// What a row was computed from.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Source {
    /// The run, or the folder of results, relative to the folder that was read.
    pub entry: String,
    /// Its file of records or results, relative to the entry.
    pub file: String,
    /// BLAKE3 hash of that file.
    pub blake3: String,
    /// The version of matchbench that ran it; empty if it was another program.
    pub version: String,
    /// What its errors rest on.
    pub errors: Errors,
    /// The commands that compute it again.
    pub commands: Vec<String>,
    /// What the commands need, in words; may be empty.
    pub note: String,
}

/// What the errors of a row rest on.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Errors {
    /// Computed from the estimates, by the truth of a dataset that is at hand.
    Checked,
    /// Stated by the records, since the dataset is not at hand.
    #[default]
    Stated,
    /// Computed from the poses, by a truth that was handed in beside them: whoever did so could choose it.
    OwnTruth,
}

impl Errors {
    /// The same as the page says it.
    pub(super) fn words(self) -> &'static str {
        match self {
            Self::Checked => "checked",
            Self::Stated => "as stated",
            Self::OwnTruth => "by its own truth",
        }
    }
}

/// Reads what lies below `folder`: folders of runs, and folders of results in the authors' layout. `datasets`
/// is the folder with the datasets. With it, errors are computed again, and results without a truth beside them
/// can be judged. Links are not followed. Threads of the current rayon pool are used, and do not change the
/// result.
///
/// # Errors
/// If `folder` cannot be listed. Problems below it are no error; the entry is refused.
pub fn leaderboard(folder: &Path, datasets: Option<&Path>) -> io::Result<Leaderboard> {
    let Entries { scored, refused } = entries::below(folder, datasets)?;
    let mut groups = BTreeMap::<Key, Vec<Scored>>::new();
    for scored in scored {
        groups.entry(Key::of(&scored)).or_default().push(scored);
    }
    let keys: Vec<Key> = groups.keys().cloned().collect();
    Ok(Leaderboard {
        groups: (groups.into_iter())
            .map(|(key, scored)| group(key, scored, &keys))
            .collect(),
        refused,
    })
}

/// What results must have in common to be compared.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord)]
struct Key {
    dataset: String,
    fingerprint: String,
    model: Model,
    protocol: &'static str,
    /// Hash of the pairs that count.
    pairs: String,
}

impl Key {
    fn of(scored: &Scored) -> Self {
        let set = &scored.set;
        let mut pairs: Vec<(u32, u32)> = set.pairs.iter().map(|pair| (pair.a, pair.b)).collect();
        pairs.sort_unstable();
        pairs.dedup();
        let mut hasher = blake3::Hasher::new();
        for (a, b) in pairs {
            hasher.update(&a.to_le_bytes());
            hasher.update(&b.to_le_bytes());
        }
        Self {
            dataset: set.dataset.clone(),
            fingerprint: scored.fingerprint.clone(),
            model: set.model(),
            protocol: crate::protocols::of_estimator(&set.estimator).id,
            pairs: hasher.finalize().to_hex().to_string(),
        }
    }
}

fn group(key: Key, scored: Vec<Scored>, keys: &[Key]) -> Group {
    let mut fingerprints: Vec<&str> = (keys.iter())
        .filter(|other| other.dataset == key.dataset && other.fingerprint != key.fingerprint)
        .map(|other| &*other.fingerprint)
        .collect();
    fingerprints.sort_unstable();
    fingerprints.dedup();
    let namesakes = fingerprints.len();
    let called = |set: &ResultSet| (set.matcher.clone(), set.estimator.clone());
    let names: Vec<_> = scored.iter().map(|scored| called(&scored.set)).collect();
    let listed = scored.iter().map(|scored| scored.listed).max().unwrap_or(0);
    let (mut sets, mut sources) = (Vec::new(), Vec::new());
    for scored in scored {
        let name = called(&scored.set);
        let mut set = scored.set;
        if names.iter().filter(|other| **other == name).count() > 1 {
            set.matcher = format!("{} ({})", set.matcher, scored.source.entry);
        }
        sets.push(set);
        sources.push((name.0, scored.source));
    }
    let files: Vec<&str> = sources.iter().map(|(_, source)| &*source.blake3).collect();
    let compared = compare_once(&sets, &files);
    let facts = RunFacts::default();
    let content = Content::compared(sets, compared, facts);
    let mut rows: Vec<Row> = (content.summaries.iter().zip(sources))
        .map(|(summary, (matcher, source))| Row {
            rank: 0,
            label: crate::metrics::method(&summary.matcher, &summary.estimator),
            summary: Summary {
                matcher,
                ..summary.clone()
            },
            source,
        })
        .collect();
    let auc = |row: &Row| row.summary.auc_of(Angle::Pose).value;
    let aucs: Vec<Option<f64>> = rows.iter().map(auc).collect();
    for (row, rank) in rows.iter_mut().zip(ranks(&aucs)) {
        row.rank = rank;
    }
    rows.sort_by(|one, other| (one.rank, &one.label).cmp(&(other.rank, &other.label)));
    say_what_is_twice(&mut rows);
    let repetitions = |summary: &Summary| summary.repetitions.max(1) as usize;
    let pairs =
        (content.summaries.first()).map_or(0, |summary| summary.pairs / repetitions(summary));
    Group {
        model: key.model,
        dataset: key.dataset,
        fingerprint: key.fingerprint,
        protocol: key.protocol,
        pairs: [pairs, listed.max(pairs)],
        namesakes,
        rows,
        content,
    }
}

/// Compares every file once, however often it was handed in: each more method to compare asks for larger differences
/// between all others. Copies differ from what the first differs from, and have its letters.
fn compare_once(sets: &[ResultSet], files: &[&str]) -> Groups {
    let mut once: Vec<&str> = Vec::new();
    let mut distinct: Vec<ResultSet> = Vec::new();
    let mut places = Vec::with_capacity(files.len());
    for (set, file) in sets.iter().zip(files) {
        let place = once.iter().position(|other| other == file);
        places.push(place.unwrap_or(once.len()));
        if place.is_none() {
            once.push(file);
            distinct.push(set.clone());
        }
    }
    groups(&distinct).of_copies(&places)
}

/// Adds a note to every file that has exactly the same bytes as that of another row.
fn say_what_is_twice(rows: &mut [Row]) {
    let files: Vec<(String, String)> = (rows.iter())
        .map(|row| (row.source.blake3.clone(), row.source.entry.clone()))
        .collect();
    for (index, row) in rows.iter_mut().enumerate() {
        let same = |(other, (hash, _)): &(usize, &(String, String))| {
            *other != index && *hash == row.source.blake3
        };
        let others: Vec<&str> = (files.iter().enumerate())
            .filter(same)
            .map(|(_, (_, entry))| &**entry)
            .collect();
        if !others.is_empty() {
            let same = format!(
                "the same file, to the byte, as that of {}",
                others.join(", ")
            );
            let note = &mut row.source.note;
            *note = if note.is_empty() {
                same
            } else {
                format!("{same}; {note}")
            };
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::metrics::{AngularError, Deviation, Failure, PairResult};

    /// A pair for each of 60 images, whose error the function gives.
    fn set(matcher: &str, error: impl Fn(u32) -> f64) -> ResultSet {
        let pair = |a| PairResult {
            outcome: Ok(Deviation::Pose(AngularError {
                rotation: error(a),
                translation: Some(0.0),
            })),
            ..PairResult::failed(a, a + 1, Failure::Missing)
        };
        ResultSet {
            dataset: "room".into(),
            matcher: matcher.into(),
            estimator: String::new(),
            repetitions: 1,
            pairs: (0..60).map(pair).collect(),
            ignored: 0,
            lacking: 0,
        }
    }

    #[test]
    fn copies_make_no_difference_to_what_is_certain_of_others() {
        // Worse on six of sixty images: enough for one comparison, not for many.
        let worse = |a: u32| if a.is_multiple_of(10) { 6.0 } else { 3.0 };
        let mut sets = vec![set("good", |_| 3.0), set("worse", worse)];
        let mut files = vec!["good", "worse"];
        let letters = |sets: &[ResultSet]| groups(sets).letters;
        assert_eq!(letters(&sets), ["a", "b"]);
        for copy in ["x", "y", "z", "u", "v", "w"] {
            sets.push(set(copy, worse));
            files.push("worse");
        }
        assert_eq!(
            letters(&sets)[0],
            letters(&sets)[1],
            "the test sees nothing"
        );
        let compared = compare_once(&sets, &files);
        let facts = RunFacts::default();
        let content = Content::compared(sets, compared, facts);
        let groups: Vec<&str> = content.summaries.iter().map(|row| &*row.group).collect();
        assert_eq!(groups, ["a", "b", "b", "b", "b", "b", "b", "b"]);
        // What the figure of the leads says agrees with the letters.
        assert_eq!(content.leads.len(), 7);
        assert!(content.leads.iter().all(|lead| lead.difference.is_certain));
    }

    #[test]
    fn the_same_tie_is_told_the_same_way_everywhere() {
        let named = |name| Scored {
            set: set(name, |a| if a < 40 { 3.0 } else { 20.0 }),
            fingerprint: "ab".into(),
            listed: 60,
            source: Source {
                blake3: name.into(),
                ..Source::default()
            },
        };
        for names in [["orb", "akaze", "sift"], ["sift", "orb", "akaze"]] {
            let mut scored = Vec::from(names.map(named));
            scored.push(Scored {
                set: set("weak", |a| if a < 10 { 3.0 } else { 20.0 }),
                ..named("weak")
            });
            let key = Key::of(&scored[0]);
            let group = group(key, scored, &[]);
            let rows: Vec<_> = (group.rows.iter())
                .map(|row| (row.rank, &*row.label))
                .collect();
            assert_eq!(rows, [(1, "akaze"), (1, "orb"), (1, "sift"), (4, "weak")]);
            let content = &group.content;
            assert!(content.leads.iter().all(|lead| lead.best.0 == "akaze"));
            let sentence = super::super::verdicts(&content.leads).join("");
            assert!(
                sentence.contains("and akaze is certainly better than weak")
                    && sentence.contains("share the highest AUC"),
                "{sentence}"
            );
            let overview = super::super::overview::Overview::new(&content.summaries);
            let ranks: Vec<_> = (overview.ranked(0).into_iter())
                .map(|(row, _)| {
                    (
                        row.matcher,
                        row.cells[0].as_ref().and_then(|cell| cell.rank),
                    )
                })
                .collect();
            let first = Some(1);
            assert_eq!(
                ranks,
                [
                    ("akaze", first),
                    ("orb", first),
                    ("sift", first),
                    ("weak", None)
                ]
            );
        }
    }

    #[test]
    fn copies_of_the_best_do_not_differ_from_it() {
        let worse = |a: u32| if a.is_multiple_of(10) { 6.0 } else { 3.0 };
        let names = ["worse", "good", "again", "copy"];
        let sets = names.map(|name| match name {
            "worse" => set(name, worse),
            _ => set(name, |_| 3.0),
        });
        let compared = compare_once(&sets, &["worse", "good", "good", "good"]);
        assert_eq!(compared.letters, ["b", "a", "a", "a"]);
        let facts = RunFacts::default();
        let content = Content::compared(sets.to_vec(), compared, facts);
        let certain: Vec<(&str, bool)> = (content.leads.iter())
            .map(|lead| (&*lead.other.0, lead.difference.is_certain))
            .collect();
        // Of the equal ones the first by name is compared with the others.
        assert_eq!(certain, [("worse", true), ("good", false), ("copy", false)]);
    }

    #[test]
    fn how_often_pairs_were_run_does_not_part_methods_and_other_protocols_are_no_namesakes() {
        let scored = |repetitions: u32, estimator: &str| {
            let mut set = set("sift", |_| 3.0);
            let once = set.pairs.clone();
            for repetition in 1..repetitions {
                let again = once.iter().cloned();
                set.pairs
                    .extend(again.map(|pair| PairResult { repetition, ..pair }));
            }
            set.repetitions = repetitions;
            set.estimator = estimator.into();
            Scored {
                set,
                fingerprint: "ab".into(),
                listed: 60,
                source: Source::default(),
            }
        };
        let key = Key::of(&scored(1, "ransac-e"));
        assert_eq!(key, Key::of(&scored(3, "ransac-e")));
        let under = Key::of(&scored(1, "ransac-e-inliers@superglue"));
        assert_ne!(key, under);
        let other = Key {
            fingerprint: "cd".into(),
            ..key.clone()
        };
        let named = |keys: &[Key]| group(key.clone(), vec![scored(1, "ransac-e")], keys).namesakes;
        assert_eq!(named(&[key.clone(), under.clone()]), 0);
        assert_eq!(named(&[key.clone(), under, other.clone(), other]), 1);
    }
}
