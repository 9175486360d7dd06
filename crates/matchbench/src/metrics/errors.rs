//! Published pose errors, pair by pair: one table a dataset, scored without poses or images.
//!
//! A folder holds `<dataset>.txt` or `<dataset>.csv`; its first line names the columns, separated by commas or white
//! space. Known are a rotation error and a translation error in degrees, under the names that tools give them
//! ([`ROTATION`], [`TRANSLATION`]), or one pose error ([`POSE`], the larger of both); every other column is left alone.
//! Among the tables with these columns are those of ZEB (Shen et al., "GIM: Learning Generalizable Image Matcher From
//! Internet Videos", ICLR 2024): `identifiers covisible0 covisible1 R_errs t_errs t_errs2 ...`.
//!
//! AP is unknown, since it needs matches. Where there is only one pose error, the scores of one angle are unknown.
//! ZEB's errors of translations have lost their sign ([`is_without_sign`]).
//!
//! An empty field, `inf` and `nan` are pairs without a pose. The method gets the name of the folder. Where a column
//! `identifiers` names pairs as ZEB does (`scene#image a#image b`), or columns `a` and `b` name the images (and `scene` the
//! scene of a name, if that is a column too), intervals know which pairs share an image; otherwise every pair stands alone.

use std::collections::{BTreeMap, HashMap};
use std::fs;
use std::path::{Path, PathBuf};

use crate::files::{LineError, read_text_lines};

use super::{AngularError, Deviation, Failure, PairResult, ResultSet};

/// Names of the column of rotation errors, in lower case.
const ROTATION: [&str; 6] = [
    "r_errs",
    "r_err",
    "rotation_error",
    "rotation_error_deg",
    "rot_err",
    "err_r",
];
/// Names of the column of translation errors (angle between directions), in lower case.
const TRANSLATION: [&str; 6] = [
    "t_errs",
    "t_err",
    "translation_error",
    "translation_error_deg",
    "trans_err",
    "err_t",
];
/// Names of a column that holds the larger of both, in lower case.
const POSE: [&str; 4] = ["pose_error", "pose_error_deg", "pose_err", "max_error"];
/// Name of the column that tells which images a pair is of, in lower case.
const IDENTIFIERS: &str = "identifiers";
/// Names of the columns of the two images, in lower case.
const IMAGES: [&str; 2] = ["a", "b"];
/// Name of the column of the scene that the names of images belong to, in lower case.
const SCENE: &str = "scene";

/// Why a table of errors cannot be scored.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum ErrorTableError {
    /// A file or folder cannot be read.
    #[error("{}: {error}", path.display())]
    Io {
        /// The file or folder.
        path: PathBuf,
        /// What the system says.
        error: std::io::Error,
    },
    /// A line is not what it should be.
    #[error("{}:{line}: {problem}", path.display())]
    Line {
        /// The file.
        path: PathBuf,
        /// The line, from 1.
        line: usize,
        /// What is wrong and what to do.
        problem: String,
    },
    /// Two tables are of one dataset.
    #[error(
        "{} and {} are both of the dataset {}, which would count twice; take one of them out of the folder",
        files[0].display(), files[1].display(), stem(&files[0])
    )]
    Twice {
        /// The files.
        files: [PathBuf; 2],
    },
    /// There is no table.
    #[error("{}: no tables of errors here; they are <dataset>.txt or <dataset>.csv", .0.display())]
    Empty(PathBuf),
}

/// The name of the dataset that a table is of.
fn stem(file: &Path) -> String {
    let stem = file.file_stem().unwrap_or_default();
    stem.to_string_lossy().into_owned()
}

/// Reads every table of a folder, in the order of their names.
///
/// # Errors
/// A file that cannot be read, a header without errors or with two columns of one kind, or a line that makes no sense,
/// named by file and line; two tables of one dataset.
pub fn load_errors(folder: &Path) -> Result<Vec<ResultSet>, ErrorTableError> {
    let io = |path: &Path| {
        let path = path.to_path_buf();
        move |error| ErrorTableError::Io { path, error }
    };
    let mut files = Vec::new();
    for entry in fs::read_dir(folder).map_err(io(folder))? {
        let path = entry.map_err(io(folder))?.path();
        let is_table =
            (path.extension()).is_some_and(|extension| extension == "txt" || extension == "csv");
        if is_table && path.is_file() {
            files.push(path);
        }
    }
    if files.is_empty() {
        return Err(ErrorTableError::Empty(folder.to_path_buf()));
    }
    files.sort();
    let mut of_datasets = HashMap::new();
    for file in &files {
        if let Some(other) = of_datasets.insert(stem(file), file) {
            let files = [other, file].map(PathBuf::clone);
            return Err(ErrorTableError::Twice { files });
        }
    }
    let whole = fs::canonicalize(folder).map_err(io(folder))?;
    let method = whole.file_name().unwrap_or_default();
    (files.iter())
        .map(|file| {
            let wrong = |(line, problem)| ErrorTableError::Line {
                path: file.clone(),
                line,
                problem,
            };
            let text = read_text_lines(file).map_err(|error| match error {
                LineError::Io(error) => io(file)(error),
                LineError::TooLong { line, what } => {
                    wrong((line, format!("{what}; a table has one pair a line")))
                }
            })?;
            let pairs = parse(&text).map_err(wrong)?;
            Ok(ResultSet {
                dataset: stem(file),
                matcher: method.to_string_lossy().into_owned(),
                estimator: String::new(),
                repetitions: 1,
                pairs,
                ignored: 0,
                lacking: 0,
            })
        })
        .collect()
}

/// Wrong poses of which the directions of some are more than 90 degrees off, unless errors have lost their sign. It
/// happens by chance in one case of a thousand.
const WRONG_POSES: usize = 10;
/// Degrees from which on a direction counts as wrong there.
const WRONG_DEG: f64 = 20.0;

/// Whether the errors of translations look as if an opposite direction counted as right: many poses are wrong, and none
/// has an error above 90 degrees. The scores that use the sign (AUC, SP, those of translations) are then too high. A table of
/// pose errors alone does not tell: each may be that of a rotation.
pub fn is_without_sign(set: &ResultSet) -> bool {
    let translations = set.pairs.iter().filter_map(|pair| match pair.outcome {
        Ok(Deviation::Pose(error)) => error.translation,
        _ => None,
    });
    let (mut wrong, mut largest) = (0, 0.0_f64);
    for error in translations {
        wrong += usize::from(error > WRONG_DEG);
        largest = largest.max(error);
    }
    wrong >= WRONG_POSES && largest <= 90.0
}

/// Where the errors of a row are.
enum Columns {
    Apart { rotation: usize, translation: usize },
    Larger(usize),
}

/// Where names of images are.
#[derive(Clone, Copy)]
enum Names {
    Identifiers(usize),
    Apart {
        images: [usize; 2],
        scene: Option<usize>,
    },
}

impl Names {
    /// Where they are, if they are there; or what is wrong with the header. Identifiers know the scene, so they go first.
    fn among(header: &[String]) -> Result<Option<Self>, String> {
        if let Some(identifiers) = column(header, &[IDENTIFIERS])? {
            return Ok(Some(Self::Identifiers(identifiers)));
        }
        let [a, b] = IMAGES.map(|name| column(header, &[name]));
        let (Some(a), Some(b)) = (a?, b?) else {
            return Ok(None);
        };
        Ok(Some(Self::Apart {
            images: [a, b],
            scene: column(header, &[SCENE])?,
        }))
    }

    /// The pair of a row, as a message names it.
    fn pair(self, fields: &[String]) -> String {
        match self {
            Self::Identifiers(column) => fields[column].clone(),
            Self::Apart { images, scene } => {
                let columns = scene.into_iter().chain(images);
                let names: Vec<&str> = columns.map(|column| &*fields[column]).collect();
                names.join(" ")
            }
        }
    }

    /// The images of a row; `None` if an identifier does not tell them.
    ///
    /// # Errors
    /// If an image has no name, or both are the same.
    fn images(self, fields: &[String]) -> Result<Option<[String; 2]>, String> {
        let named = match self {
            Self::Identifiers(column) => images(&fields[column]),
            Self::Apart { images, scene } => {
                if let Some(index) = (0..2).find(|&index| fields[images[index]].is_empty()) {
                    return Err(format!("column `{}` names no image", IMAGES[index]));
                }
                let scene = scene.map_or("", |column| &*fields[column]);
                Some(images.map(|column| format!("{scene}#{}", fields[column])))
            }
        };
        if named.as_ref().is_some_and(|[a, b]| a == b) {
            let pair = self.pair(fields);
            return Err(format!(
                "in the pair `{pair}` an image is matched with itself; delete the line"
            ));
        }
        Ok(named)
    }
}

/// The images of a pair, as ZEB writes it: `scene#image a#image b`, or `image a#image b`.
fn images(identifier: &str) -> Option<[String; 2]> {
    let (first, second) = identifier.rsplit_once('#')?;
    let scene = first.rsplit_once('#').map(|(scene, _)| scene);
    let second = scene.map_or_else(|| second.to_owned(), |scene| format!("{scene}#{second}"));
    Some([first.to_owned(), second])
}

/// The pairs of a table; or what is wrong in which line. Images are numbered in the order of their names. Without names
/// each pair has two of its own: the number of its row, and another one counted from the end.
fn parse(text: &str) -> Result<Vec<PairResult>, (usize, String)> {
    let mut lines = (text.lines().enumerate())
        .map(|(index, line)| (index + 1, line.trim()))
        .filter(|(_, line)| !line.is_empty());
    let (at, header) = lines.next().ok_or((1, "the table is empty".to_owned()))?;
    let commas = header.contains(',');
    let split = |line: &str| -> Vec<String> {
        let clean = |field: &str| field.trim().trim_matches('"').to_owned();
        if commas {
            line.split(',').map(clean).collect()
        } else {
            line.split_whitespace().map(clean).collect()
        }
    };
    let header = split(header);
    let columns = columns(&header).map_err(|problem| (at, problem))?;
    let columns = columns.ok_or_else(|| {
        let problem = format!(
            "no columns of errors among `{}`; name them {} and {}, or {}",
            header.join(" "),
            ROTATION[2],
            TRANSLATION[2],
            POSE[0]
        );
        (at, problem)
    })?;
    let names = Names::among(&header).map_err(|problem| (at, problem))?;
    let lines: Vec<(usize, Vec<String>)> = lines.map(|(line, row)| (line, split(row))).collect();
    if lines.is_empty() {
        return Err((at, "the table has no pair".to_owned()));
    }
    // Rows are refused in their order, below.
    let named = |fields: &[String]| match names {
        Some(names) if fields.len() == header.len() => names.images(fields),
        _ => Ok(None),
    };
    let known = (lines.iter()).filter_map(|(_, fields)| named(fields).ok()?);
    let mut numbers: BTreeMap<String, u32> = known.flatten().map(|image| (image, 0)).collect();
    for (number, next) in numbers.values_mut().zip(0..) {
        *number = next;
    }
    let mut first_lines = HashMap::new();
    (lines.iter())
        .zip(0..)
        .map(|((line, fields), index)| {
            let line = *line;
            if fields.len() != header.len() {
                let problem = format!("{} fields under {} heads", fields.len(), header.len());
                return Err((line, problem));
            }
            let angle = |column: usize| angle(&fields[column]).map_err(|problem| (line, problem));
            let deviation = match columns {
                Columns::Larger(pose) => angle(pose)?.map(Deviation::Larger),
                Columns::Apart {
                    rotation,
                    translation,
                } => (angle(rotation)?.zip(angle(translation)?)).map(|(rotation, translation)| {
                    Deviation::Pose(AngularError {
                        rotation,
                        translation: Some(translation),
                    })
                }),
            };
            if let Some(names) = names {
                let pair = names.pair(fields);
                if let Some(first) = first_lines.insert(pair.clone(), line) {
                    let problem = format!(
                        "the pair `{pair}` is listed on line {first} already; delete one of the two lines"
                    );
                    return Err((line, problem));
                }
            }
            // From the end, so that no image has the number of a row or of a name.
            let [a, b] = named(fields)
                .map_err(|problem| (line, problem))?
                .map_or([u32::MAX - index, numbers.len() as u32 + index], |its| {
                    its.map(|image| numbers[&image])
                });
            let mut pair = PairResult::failed(a, b, Failure::Unexplained);
            if let Some(deviation) = deviation {
                pair.outcome = Ok(deviation);
                pair.correspondences = None; // the tables tell errors alone
            }
            Ok(pair)
        })
        .collect()
}

/// Where the errors are, if they are there; or what is wrong with the header.
fn columns(header: &[String]) -> Result<Option<Columns>, String> {
    Ok(
        match (column(header, &ROTATION)?, column(header, &TRANSLATION)?) {
            (Some(rotation), Some(translation)) => Some(Columns::Apart {
                rotation,
                translation,
            }),
            _ => column(header, &POSE)?.map(Columns::Larger),
        },
    )
}

/// The only column that has one of these names, if there is one.
fn column(header: &[String], names: &[&str]) -> Result<Option<usize>, String> {
    let is_it = |head: &String| names.contains(&&*head.to_ascii_lowercase());
    let mut found = (0..header.len()).filter(|&index| is_it(&header[index]));
    match (found.next(), found.next()) {
        (Some(first), Some(second)) => Err(format!(
            "columns {} (`{}`) and {} (`{}`) hold the same, and which of them counts is unknown; rename or take out one",
            first + 1,
            header[first],
            second + 1,
            header[second]
        )),
        (found, _) => Ok(found),
    }
}

/// An error in degrees; `None` where there is no pose.
fn angle(field: &str) -> Result<Option<f64>, String> {
    if field.is_empty() {
        return Ok(None);
    }
    let value: f64 =
        (field.parse()).map_err(|_| format!("`{field}` is not a number of degrees"))?;
    if !value.is_finite() {
        return Ok(None);
    }
    if !(0.0..=180.0).contains(&value) {
        return Err(format!("`{field}` is not an angle from 0 to 180 degrees"));
    }
    Ok(Some(value))
}

#[cfg(test)]
mod tests {
    use super::super::{Angle, Score, Scores, SuccessCurve, exact_auc};
    use super::*;

    #[cfg(unix)] // holes of files take no room
    #[test]
    fn a_line_without_an_end_is_named_before_the_rest_is_read() {
        let folder = tempfile::tempdir().expect("a temporary folder");
        let table = folder.path().join("wall.csv");
        fs::write(&table, "pose_error\n1\n").expect("writable");
        let file = fs::OpenOptions::new()
            .write(true)
            .open(table)
            .expect("it is ours");
        file.set_len(3 << 30).expect("holes take no room");
        let error = load_errors(folder.path())
            .expect_err("a long line")
            .to_string();
        assert!(
            error.ends_with(
                "wall.csv:3: the line has more than 1048576 bytes; a table has one pair a line"
            ),
            "{error}"
        );
    }

    #[test]
    fn tables_of_zeb_and_csv_hold_the_same() {
        let zeb = "identifiers covisible0 covisible1 R_errs t_errs t_errs2 Bef.Prec\n\
                   a#1#2 0.9 0.9 0.5 1.0 7.0 1.0\n\
                   a#1#3 0.9 0.9 3.0 179.0 7.0 1.0\n\
                   a#1#4 0.9 0.9 inf inf inf 0.0\n\n";
        let csv = "\"pair\",rotation_error,translation_error\r\n\
                   a,0.5,1.0\r\nb,3.0,179.0\r\nc,,\r\n";
        let (zeb, csv) = (parse(zeb).expect("in order"), parse(csv).expect("in order"));
        let errors = |pairs: &[PairResult]| pairs.iter().map(|p| p.outcome).collect::<Vec<_>>();
        assert_eq!(errors(&zeb), errors(&csv));
        let images = |pairs: &[PairResult]| pairs.iter().map(|p| (p.a, p.b)).collect::<Vec<_>>();
        assert_eq!(images(&zeb), [(0, 1), (0, 2), (0, 3)]);
        let last = u32::MAX;
        assert_eq!(images(&csv), [(last, 0), (last - 1, 1), (last - 2, 2)]);
        // Errors 1, 3 (an opposite direction is 1 degree off) and none, of three pairs.
        let expected = (0.5 + 2.0 * 1.5 + 2.0 * 2.0) / 15.0;
        assert!((exact_auc(&zeb, 5.0) - expected).abs() < 1e-12);
        let pose = parse("pose_error\n1\n3\nnan\n").expect("in order");
        assert!((exact_auc(&pose, 5.0) - expected).abs() < 1e-12);
    }

    #[test]
    fn an_image_has_one_number_in_either_place_and_whatever_the_order_of_rows() {
        let images = |rows: &str| {
            let table = format!("identifiers R_errs t_errs\n{rows}");
            let pairs = parse(&table).expect("in order");
            pairs.iter().map(|p| (p.a, p.b)).collect::<Vec<_>>()
        };
        assert_eq!(
            images("s#1#2 1 1\ns#2#3 1 1\nt#2#3 1 1\n"),
            [(0, 1), (1, 2), (3, 4)]
        );
        assert_eq!(
            images("t#2#3 1 1\ns#2#3 1 1\ns#1#2 1 1\n"),
            [(3, 4), (1, 2), (0, 1)]
        );
    }

    #[test]
    fn images_are_known_by_their_columns_and_their_scene() {
        let images = |table: &str| {
            let pairs = parse(table).expect("in order");
            pairs.iter().map(|p| (p.a, p.b)).collect::<Vec<_>>()
        };
        let rows = "x.png,y.png,1,s\ny.png,z.png,1,s\ny.png,z.png,1,t\n";
        let shared = images(&format!("A,b,pose_error,scene\n{rows}"));
        assert_eq!(shared, [(0, 1), (1, 2), (3, 4)]);
        let zeb =
            "identifiers R_errs t_errs\ns#x.png#y.png 1 1\ns#y.png#z.png 1 1\nt#y.png#z.png 1 1\n";
        assert_eq!(images(zeb), shared);
        // Identifiers know more, and one column alone tells no pair.
        let both = zeb.replace('\n', " 7 7\n").replacen("7 7", "a b", 1);
        assert_eq!(images(&both), shared);
        let alone = images("a pose_error\n0 1\n0 1\n");
        assert_eq!(alone, [(u32::MAX, 0), (u32::MAX - 1, 1)]);
        let refused = |table: &str| parse(table).expect_err("no pair, or one twice");
        let (line, problem) = refused("a,b,pose_error\n0,1,1\n0,,1\n");
        assert!(line == 3 && problem == "column `b` names no image");
        let (line, problem) = refused("a b pose_error\n0 1 1\n1 0 1\n0 1 9\n");
        assert!(line == 4 && problem.starts_with("the pair `0 1` is listed on line 2 already"));
    }

    #[test]
    fn errors_without_their_sign_are_known_by_many_wrong_poses_of_which_none_is_opposite() {
        let set = |errors: &[f64]| {
            let rows = errors.iter().map(|error| format!("1 {error}\n"));
            let table = format!("R_errs t_errs\n{}", rows.collect::<String>());
            ResultSet {
                dataset: "wall".into(),
                matcher: "sift".into(),
                estimator: String::new(),
                repetitions: 1,
                pairs: parse(&table).expect("in order"),
                ignored: 0,
                lacking: 0,
            }
        };
        assert!(is_without_sign(&set(&[40.0; 10])));
        assert!(!is_without_sign(&set(&[40.0; 9])));
        assert!(!is_without_sign(&set(&[2.0; 100])));
        assert!(!is_without_sign(&set(
            &[[40.0; 10].as_slice(), &[91.0]].concat()
        )));
    }

    #[test]
    fn what_a_table_does_not_tell_is_no_score() {
        let scores = |table: &str| {
            let pairs = parse(table).expect("in order");
            let curves = [Angle::Pose, Angle::Rotation, Angle::Translation]
                .map(|angle| SuccessCurve::new(&pairs, angle).at(5));
            let scores = Scores::new(&pairs);
            let ids = ["auc", "rotation_auc", "translation_auc", "ap5", "maa_10"];
            (ids.map(|id| scores.get(id)), curves)
        };
        let values = |scores: &[Score; 5]| scores.map(|score| score.value);
        let rows = "1\n3\n8\nnan\n12\n4\n6\n";
        let (pose, curves) = scores(&format!("pose_error\n{rows}"));
        // Below 1, 2, ... 15 degrees: 14, 12, 7, 0, 3, 11 and 9 of 15 thresholds.
        assert_eq!(values(&pose)[0], Some(56.0 / 105.0));
        assert_eq!(values(&pose)[1..4], [None; 3]);
        // 9, 7, 2, 0, 0, 6 and 4 of 10.
        assert_eq!(values(&pose)[4], Some(28.0 / 70.0));
        assert!(pose[0].interval.is_some() && pose[1..4].iter().all(|s| s.interval.is_none()));
        assert!(curves[0] == 3.0 / 7.0 && curves[1].is_nan() && curves[2].is_nan());
        let (apart, _) = scores("R_errs t_errs\n0.5 4.0\n3.0 2.0\n");
        // Larger: 11 and 12 of 15 thresholds, rotation: 15 and 12, translation: 11 and 13.
        let expected = [23.0 / 30.0, 27.0 / 30.0, 24.0 / 30.0];
        assert_eq!(values(&apart)[..3], expected.map(Some));
        assert_eq!(values(&apart)[3], None);
    }

    #[test]
    fn what_is_no_table_is_named_by_line() {
        for (text, expected) in [
            ("", "the table is empty"),
            ("a,pose_error\n", "the table has no pair"),
            ("a,b\n1,2\n", "no columns of errors among `a b`"),
            (
                "R_errs,rotation_error,t_errs\n1,2,3\n",
                "columns 1 (`R_errs`) and 2 (`rotation_error`) hold the same",
            ),
            ("max_error pose_err\n1 1\n", "columns 1 (`max_error`)"),
            (
                "pose_error Identifiers identifiers\n1 a#b a#b\n",
                "columns 2 (`Identifiers`)",
            ),
            ("R_errs t_errs\n1\n", "1 fields under 2 heads"),
            ("R_errs t_errs\n1 x\n", "`x` is not a number"),
            ("R_errs t_errs\n1 -4\n", "`-4` is not an angle"),
            ("R_errs t_errs\n1 181\n", "`181` is not an angle"),
        ] {
            let (line, problem) = parse(text).expect_err(expected);
            assert!(problem.contains(expected), "{problem}");
            assert_eq!(line, 1 + usize::from(text.starts_with("R_errs t_errs")));
        }
    }

    #[test]
    fn a_pair_that_is_listed_twice_is_named_by_both_lines() {
        let table = "identifiers R_errs t_errs\na#b 1 1\na#c 50 50\na#b 1 1\n";
        let (line, problem) = parse(table).expect_err("a#b counts once");
        assert!(
            line == 4 && problem.contains("`a#b` is listed on line 2 already"),
            "{problem}"
        );
    }

    #[test]
    fn a_pair_of_an_image_with_itself_is_refused() {
        for table in [
            "identifiers R_errs t_errs\na#b#c 1 1\na#c#c 0 0\n",
            "a,b,scene,pose_error\nx,y,1,2\nx,x,1,0\n",
        ] {
            let (line, problem) = parse(table).expect_err("it is no pair");
            assert!(line == 3 && problem.contains("with itself"), "{problem}");
        }
        // Frames of two scenes may have one number.
        assert!(parse("identifiers pose_error\na#1#b#1 2\n").is_ok());
    }

    #[test]
    fn a_folder_is_a_method_and_a_file_a_dataset() {
        let root = tempfile::tempdir().expect("a temporary folder");
        let folder = root.path().join("root_sift");
        fs::create_dir(&folder).expect("a folder can be made");
        let empty = load_errors(&folder);
        assert!(matches!(empty, Err(ErrorTableError::Empty(_))));
        for name in ["KITTI.txt", "ICL.csv", "notes.md"] {
            fs::write(folder.join(name), "pose_error\n1\n2\n").expect("it is ours");
        }
        let sets = load_errors(&folder).expect("two tables");
        let names: Vec<_> = (sets.iter())
            .map(|set| (&*set.dataset, &*set.matcher, set.pairs.len()))
            .collect();
        assert_eq!(names, [("ICL", "root_sift", 2), ("KITTI", "root_sift", 2)]);
        fs::write(folder.join("ICL.txt"), "pose_error\n1\n").expect("it is ours");
        let error = load_errors(&folder)
            .expect_err("ICL would count twice")
            .to_string();
        assert!(
            error.contains("ICL.csv and ") && error.contains("ICL.txt are both of the dataset ICL"),
            "{error}"
        );
    }
}
