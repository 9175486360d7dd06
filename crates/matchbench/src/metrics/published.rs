//! Results in the authors' layout, and the truth that stands beside them.
//!
//! The authors publish `<sequence>/<matcher>.txt` (see [`authors`]) together with
//! `<sequence>/groundtruth.txt`. The latter is no result of a matcher but holds the true pose of every
//! pair, one a line: either `a b` and the 12 numbers of `b_from_a`, or the 12 numbers alone, in the order
//! of the rows of the matchers' files. It is used where no `pairs.txt` is named. A `pairs.txt` has
//! precedence: it says which pairs count, while a truth only says what is true.

use std::collections::{BTreeMap, HashMap};
use std::path::{Path, PathBuf};

use crate::datasets::{Pair, Sequence, is_dataset, read_pairs, read_poses_of_pairs};
use crate::files::{LineError, read_text_lines};
use crate::protocols;
use crate::records::authors::{self, Row, TRUTH};

use super::listed::listed_pairs;
use super::pair_choice::{PairChoice, frames_at_hand};
use super::pair_result::scored;
use super::results::{files, folders, sort, twice};
use super::{Failure, FileResults, PairResult, ResultSet, ResultsError};

/// Every set of results of a folder in the authors' layout, in the order of names.
pub(super) fn load_published(
    results: &Path,
    datasets: Option<&Path>,
    choice: &PairChoice,
) -> Result<Vec<ResultSet>, ResultsError> {
    if is_dataset(results) {
        return Err(ResultsError::Layout {
            path: results.to_path_buf(),
            problem: "a dataset, and no results; `matchbench run` makes some".to_owned(),
        });
    }
    let mut sets = Vec::new();
    for (dataset, folder) in folders(results)? {
        let Some(Judged {
            mut listed, files, ..
        }) = judged(results, &dataset, &folder, datasets)?
        else {
            continue;
        };
        let chosen = choice.of(&dataset, || frames_at_hand(&dataset, datasets, None))?;
        listed.retain(|pair| chosen(pair.a, pair.b));
        for (stem, file) in files {
            sets.push(set_of(&dataset, &stem, &file, &listed)?);
        }
    }
    if sets.is_empty() {
        return Err(ResultsError::Layout {
            path: results.to_path_buf(),
            problem: "no results here: neither plan.json nor <sequence>/<matcher>.txt".to_owned(),
        });
    }
    sort(&mut sets);
    Ok(sets)
}

/// The results in each file of a folder in the authors' layout by themselves.
pub(super) fn each_published(
    results: &Path,
    datasets: Option<&Path>,
) -> Result<Vec<FileResults>, ResultsError> {
    let mut each = Vec::new();
    for (dataset, folder) in folders(results)? {
        match judged(results, &dataset, &folder, datasets) {
            Ok(None) => {}
            Err(error) => each.push(FileResults {
                file: folder,
                truth: None,
                has_own_truth: false,
                results: Err(error),
            }),
            Ok(Some(Judged {
                listed,
                of_dataset,
                files,
            })) => {
                let fingerprint = |pairs: &[Pair]| {
                    let pairs = pairs.to_vec();
                    let (name, frames) = (String::new(), Vec::new());
                    Sequence {
                        name,
                        frames,
                        pairs,
                    }
                    .fingerprint()
                };
                let has_own_truth = of_dataset.is_none();
                let whole = of_dataset.and_then(|dir| Sequence::open(&dir).ok());
                let truth = match whole {
                    Some(sequence) => sequence.fingerprint(),
                    None => fingerprint(&listed),
                };
                for (stem, file) in files {
                    let results = set_of(&dataset, &stem, &file, &listed);
                    let truth = Some(truth.clone());
                    each.push(FileResults {
                        file,
                        truth,
                        has_own_truth,
                        results,
                    });
                }
            }
        }
    }
    Ok(each)
}

/// The results of a sequence, and by what they are judged.
struct Judged {
    /// The pairs that count, with their truth.
    listed: Vec<Pair>,
    /// The folder of the dataset that lists them, if they are not those of a truth beside the results.
    of_dataset: Option<PathBuf>,
    /// Files, with their names without ending.
    files: Vec<(String, PathBuf)>,
}

/// The results of the sequence `dataset` in its `folder` of `results`; `None` where there are none.
fn judged(
    results: &Path,
    dataset: &str,
    folder: &Path,
    datasets: Option<&Path>,
) -> Result<Option<Judged>, ResultsError> {
    let mut files = files(folder, "txt")?;
    let truth = (files.iter().position(|(stem, _)| stem == TRUTH)).map(|i| files.remove(i).1);
    if files.is_empty() {
        return Ok(None);
    }
    let (listed, of_dataset) = match (datasets, truth) {
        (Some(datasets), truth) if truth.is_none() || lists_pairs(datasets, dataset) => {
            let dir = datasets.join(dataset);
            let mut listed = listed_pairs(datasets, dataset)?;
            let has_pairs = !listed.is_empty();
            listed.retain(|pair| pair.pose().is_some());
            if has_pairs && listed.is_empty() {
                return Err(ResultsError::Layout {
                    path: dir,
                    problem: "the dataset has no true poses, and results in the authors' layout are poses alone, so \
                              nothing can be scored; give the folder of the run (its --out), which holds homographies"
                        .to_owned(),
                });
            }
            (listed, Some(dir))
        }
        (_, Some(truth)) => (read_truth(&truth, &files)?, None),
        _ => {
            return Err(ResultsError::Layout {
                path: results.to_path_buf(),
                problem: "not a run folder (no plan.json); for results in the authors' layout, put a groundtruth.txt \
                          beside the results, or (eval, report) name the folder that holds <sequence>/pairs.txt with \
                          --datasets"
                    .to_owned(),
            });
        }
    };
    Ok(Some(Judged {
        listed,
        of_dataset,
        files,
    }))
}

/// The results in one file, whose name tells the matcher.
fn set_of(
    dataset: &str,
    stem: &str,
    file: &Path,
    listed: &[Pair],
) -> Result<ResultSet, ResultsError> {
    let parts = (stem.rsplit_once('+')).filter(|parts| !parts.0.is_empty() && !parts.1.is_empty());
    let (matcher, estimator) = parts.unwrap_or((stem, ""));
    let min_support = protocols::of_estimator(estimator).min_support;
    Ok(ResultSet {
        dataset: dataset.to_owned(),
        matcher: matcher.to_owned(),
        estimator: estimator.to_owned(),
        ..score_rows(file, listed, min_support)?
    })
}

fn lists_pairs(datasets: &Path, name: &str) -> bool {
    datasets.join(name).join("pairs.txt").is_file()
}

/// The true poses of a `groundtruth.txt`; where its rows name no pairs, they are those of the results in the first of
/// the `files`, and the others must have their order.
fn read_truth(truth: &Path, files: &[(String, PathBuf)]) -> Result<Vec<Pair>, ResultsError> {
    let path = || truth.to_path_buf();
    let text = read_text_lines(truth).map_err(|error| match error {
        LineError::Io(error) => ResultsError::Io {
            path: path(),
            error,
        },
        LineError::TooLong { line, what } => ResultsError::Line {
            path: path(),
            line,
            problem: format!(
                "{what}; a row is `a b` and the 12 numbers of [R | t], or these alone"
            ),
        },
    })?;
    let row = text.lines().find(|line| !line.trim().is_empty());
    if row.is_some_and(|row| row.split_whitespace().count() == 12) {
        let first = &files[0].1;
        let pairs: Vec<(u32, u32)> = (authors::read(first)?.iter())
            .map(|row| (row.a, row.b))
            .collect();
        let places: HashMap<(u32, u32), usize> = pairs.iter().copied().zip(0..).collect();
        for (_, file) in &files[1..] {
            refuse_other_order(truth, first, &places, file)?;
        }
        Ok(read_poses_of_pairs(truth, &pairs)?)
    } else {
        Ok(read_pairs(truth)?)
    }
}

/// Refuses a `file` whose pairs stand in another order than their `places` in the `first`: one of the two does not have
/// the order of a `truth` that names no pairs, and nothing tells which.
fn refuse_other_order(
    truth: &Path,
    first: &Path,
    places: &HashMap<(u32, u32), usize>,
    file: &Path,
) -> Result<(), ResultsError> {
    let mut before: Option<(usize, Row)> = None;
    for row in authors::read(file)? {
        // Pairs that the first does not have are without a truth.
        let Some(&place) = places.get(&(row.a, row.b)) else {
            continue;
        };
        if let Some((last, other)) = before
            && place < last
        {
            return Err(ResultsError::Line {
                path: file.to_path_buf(),
                line: row.line,
                problem: format!(
                    "the pair {} {} stands behind {} {}, and before it in {}; {} names no pairs, so all files must have its \
                     order; begin each of its rows with `a b`",
                    row.a,
                    row.b,
                    other.a,
                    other.b,
                    first.display(),
                    truth.display()
                ),
            });
        }
        before = Some((place, row));
    }
    Ok(())
}

/// The rows of one file against the listed pairs; the names are left empty.
fn score_rows(file: &Path, listed: &[Pair], min_support: usize) -> Result<ResultSet, ResultsError> {
    let mut rows = BTreeMap::new();
    for row in authors::read(file)? {
        let pair = (row.a, row.b);
        if let Some(first) = rows.insert(pair, row) {
            return Err(twice(file, rows[&pair].line, pair, first.line));
        }
    }
    let found = rows.len();
    let pairs: Vec<PairResult> = (listed.iter())
        .map(|pair| match rows.remove(&(pair.a, pair.b)) {
            Some(row) => score_row(&row, pair, min_support),
            None => PairResult::failed(pair.a, pair.b, Failure::Missing),
        })
        .collect();
    let missing = (pairs.iter())
        .filter(|pair| pair.outcome == Err(Failure::Missing))
        .count();
    Ok(ResultSet {
        dataset: String::new(),
        matcher: String::new(),
        estimator: String::new(),
        repetitions: 1,
        ignored: found - (pairs.len() - missing),
        lacking: 0,
        pairs,
    })
}

fn score_row(row: &Row, truth: &Pair, min_support: usize) -> PairResult {
    let failed = PairResult::failed(row.a, row.b, Failure::Unexplained);
    let Some(b_from_a) = truth.pose() else {
        return failed; // a pose cannot be judged by anything else
    };
    let (outcome, correspondences) = scored(&row.outcome(b_from_a, min_support));
    PairResult {
        // The layout does not tell why there is no pose.
        outcome: outcome.map_err(|_| Failure::Unexplained),
        correspondences: Some(correspondences),
        ..failed
    }
}

#[cfg(test)]
mod tests {
    use std::fmt::Write;
    use std::fs;

    use super::super::{load, load_chosen};
    use super::*;

    /// The published shape of two sequences: all pairs of 12 images, right where they are near.
    fn published(truth: impl Fn(u32, u32) -> String) -> tempfile::TempDir {
        let folder = tempfile::tempdir().expect("a temporary folder");
        for sequence in ["05-castle", "06-office-wide"] {
            let dir = folder.path().join(sequence);
            fs::create_dir(&dir).expect("a folder can be made");
            let (mut rows, mut poses) = (String::new(), String::new());
            for a in 0..12 {
                for b in a + 1..12 {
                    let pose = if b - a <= 9 { POSE } else { NONE };
                    writeln!(rows, "{a} {b} {} {pose}", 100 * u32::from(b - a <= 9))
                        .expect("a string takes all");
                    poses += &truth(a, b);
                }
            }
            for (name, text) in [("sift", &rows), ("groundtruth", &poses)] {
                fs::write(dir.join(format!("{name}.txt")), text).expect("it is ours");
            }
        }
        folder
    }

    const POSE: &str = "1 0 0 1 0 1 0 0 0 0 1 0";
    const NONE: &str = "1 0 0 0 0 1 0 0 0 0 1 0";

    fn auc(set: &ResultSet) -> f64 {
        let right = set.pairs.iter().filter(|pair| pair.outcome.is_ok()).count();
        right as f64 / set.pairs.len() as f64
    }

    #[test]
    fn the_truth_beside_the_results_is_no_matcher() {
        let named = published(|a, b| format!("{a} {b} {POSE}\n"));
        let bare = published(|_, _| format!("{POSE}\n"));
        for folder in [named, bare] {
            let sets = load(folder.path(), None).expect("the truth is there");
            let names: Vec<&str> = sets.iter().map(|set| &*set.matcher).collect();
            assert_eq!(names, ["sift", "sift"]);
            assert_eq!((sets[0].pairs.len(), sets[0].ignored), (66, 0));
            assert_eq!(auc(&sets[0]), 63.0 / 66.0);
        }
    }

    #[test]
    fn a_truth_without_names_of_pairs_asks_for_one_order_of_all_files() {
        let folder = published(|_, _| format!("{POSE}\n"));
        let castle = folder.path().join("05-castle");
        let rows = fs::read_to_string(castle.join("sift.txt")).expect("it was written");
        let other = castle.join("abc.txt");
        let mut lines: Vec<&str> = rows.lines().collect();
        // Pairs that are not there change no order, and neither do those that the other does not have.
        let fewer = [
            &lines[5..20],
            &["40 41 0 1 0 0 0 0 1 0 0 0 0 1 0"],
            &lines[30..],
        ]
        .concat();
        fs::write(castle.join("tenth.txt"), fewer.join("\n")).expect("it is ours");
        assert_eq!(load(folder.path(), None).expect("in order").len(), 3);
        lines.reverse();
        fs::write(&other, lines.join("\n")).expect("it is ours");
        let error = load(folder.path(), None)
            .expect_err("one is wrong")
            .to_string();
        let expected = "sift.txt:2: the pair 0 2 stands behind 0 1, and before it in ";
        assert!(
            error.contains(expected) && error.contains("abc.txt; ") && error.contains("`a b`"),
            "{error}"
        );
        let named = published(|a, b| format!("{a} {b} {POSE}\n"));
        let castle = named.path().join("05-castle");
        fs::write(castle.join("abc.txt"), lines.join("\n")).expect("it is ours");
        let sets = load(named.path(), None).expect("the truth has names");
        assert_eq!(auc(&sets[0]), auc(&sets[1]));
    }

    #[test]
    fn the_rule_of_the_paper_is_that_of_its_wide_sequences_alone() {
        let folder = published(|a, b| format!("{a} {b} {POSE}\n"));
        let sets = load_chosen(folder.path(), None, &PairChoice::Paper).expect("in order");
        assert_eq!((sets[0].pairs.len(), sets[0].ignored), (66, 0));
        assert_eq!((sets[1].pairs.len(), sets[1].ignored), (63, 3));
        assert_eq!(auc(&sets[1]), 1.0);
        let window = PairChoice::Rule("window:9".parse().expect("a rule"));
        let sets = load_chosen(folder.path(), None, &window).expect("in order");
        assert_eq!(sets.iter().map(|set| set.pairs.len()).max(), Some(63));
        let empty = folder.path().join("none.txt");
        fs::write(&empty, "0 77\n").expect("it is ours");
        let list = format!("list:{}", empty.display());
        let none = PairChoice::Rule(list.parse().expect("a rule"));
        let error = load_chosen(folder.path(), None, &none).expect_err("no pair is left");
        assert!(
            error.to_string().contains("no pair of 05-castle"),
            "{error}"
        );
    }

    #[test]
    fn the_list_of_a_dataset_goes_before_the_truth_beside_the_results() {
        let folder = published(|a, b| format!("{a} {b} {POSE}\n"));
        let datasets = tempfile::tempdir().expect("a temporary folder");
        let castle = datasets.path().join("05-castle");
        fs::create_dir(&castle).expect("a folder can be made");
        fs::write(castle.join("pairs.txt"), format!("0 1 {POSE}\n")).expect("it is ours");
        let sets = load(folder.path(), Some(datasets.path())).expect("in order");
        assert_eq!((sets[0].pairs.len(), sets[0].ignored), (1, 65));
        assert_eq!(sets[1].pairs.len(), 66);
    }

    #[test]
    fn poses_are_refused_where_the_dataset_has_homographies_alone() {
        let folder = published(|_, _| String::new());
        for sequence in ["05-castle", "06-office-wide"] {
            let truth = folder.path().join(sequence).join("groundtruth.txt");
            fs::remove_file(truth).expect("it is ours");
        }
        let datasets = tempfile::tempdir().expect("a temporary folder");
        let castle = datasets.path().join("05-castle");
        fs::create_dir(&castle).expect("a folder can be made");
        let homography = "0 1 1 0 0 0 1 0 0 0 1\n";
        fs::write(castle.join("homographies.txt"), homography).expect("it is ours");
        let error = load(folder.path(), Some(datasets.path())).expect_err("nothing to score by");
        let error = error.to_string();
        assert!(
            error.contains("05-castle: the dataset has no true poses"),
            "{error}"
        );
        // Of a dataset that has both, the pairs with poses are scored.
        fs::write(castle.join("pairs.txt"), format!("0 1 {POSE}\n")).expect("it is ours");
        let error = load(folder.path(), Some(datasets.path())).expect_err("the other is missing");
        let error = error.to_string();
        assert!(error.contains("06-office-wide: neither"), "{error}");
    }

    #[test]
    fn a_row_needs_the_inliers_of_the_protocol_of_its_file() {
        let folder = published(|a, b| format!("{a} {b} {POSE}\n"));
        let dir = folder.path().join("05-castle");
        for (name, inliers) in [
            ("sift+a@imc", 5),
            ("sift+b@imc", 1),
            ("sift+c@imc", 0),
            ("sift+d", 10),
            ("sift+e", 9),
        ] {
            let row = format!("0 1 {inliers} {POSE}\n");
            fs::write(dir.join(format!("{name}.txt")), row).expect("it is ours");
        }
        let sets = load(folder.path(), None).expect("in order");
        let right = |estimator: &str| {
            let is_wanted = |set: &&ResultSet| set.estimator == estimator;
            let set = sets.iter().find(is_wanted).expect("it is there");
            (set.pairs[0].outcome.is_ok(), set.pairs[0].correspondences)
        };
        assert_eq!(right("a@imc"), (true, Some(5)));
        assert_eq!(right("b@imc"), (true, Some(1)));
        assert_eq!(right("c@imc"), (false, Some(0)));
        assert_eq!(right("d"), (true, Some(10)));
        assert_eq!(right("e"), (false, Some(0)));
    }

    #[test]
    fn a_wrong_truth_is_named_by_line() {
        for (truth, expected) in [
            ("0 1 1 0 0 1 0 1 0 0 0 0 1\n", "groundtruth.txt:1"),
            ("1 0 0 1 0 1 0 0 0 0 1 0\n", "1 pose for 66 pairs"),
            (
                &"1 ".repeat(1 << 20),
                "groundtruth.txt:1: the line has more than",
            ),
        ] {
            let folder = published(|a, b| {
                if b + a == 1 {
                    truth.into()
                } else {
                    String::new()
                }
            });
            let error = load(folder.path(), None).expect_err(expected);
            assert!(error.to_string().contains(expected), "{error}");
        }
    }
}
