//! The numbers that README prints are those of the files in `docs/results`, and every folder there says how its
//! numbers came about.

use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};

use matchbench::estimators;
use matchbench::matchers::{self, MATCHERS};
use matchbench::protocols::{self, EstimatorRule};
use serde_json::Value;

fn repository() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../..")
}

fn text(path: &str) -> String {
    let path = repository().join(path);
    fs::read_to_string(&path).unwrap_or_else(|error| panic!("{}: {error}", path.display()))
}

/// The rows of a CSV file without quotes, by the columns of its header.
fn rows(path: &str) -> Vec<BTreeMap<String, String>> {
    let text = text(path);
    let mut lines = text.lines().map(|line| line.split(',').map(str::to_owned));
    let header: Vec<String> = lines.next().expect("a header").collect();
    let rows: Vec<BTreeMap<String, String>> = lines
        .map(|cells| header.iter().cloned().zip(cells).collect())
        .collect();
    assert!(rows.iter().all(|row| row.len() == header.len()), "{path}");
    rows
}

fn number(row: &BTreeMap<String, String>, column: &str) -> f64 {
    (row[column].parse()).unwrap_or_else(|_| panic!("{column}: {}", row[column]))
}

/// What a command sets of this estimator: `--set ID.NAME=VALUE`.
fn set_of<'a>(commands: &'a str, id: &str) -> Vec<(&'a str, Value)> {
    let words: Vec<&str> = commands.split_whitespace().collect();
    (words.windows(2))
        .filter(|two| two[0] == "--set")
        .filter_map(|two| two[1].strip_prefix(id)?.strip_prefix('.')?.split_once('='))
        .map(|(name, value)| (name, serde_json::from_str(value).expect("JSON")))
        .collect()
}

/// The cells of the row that begins with this id, in the first table of `text` below the line `heading`.
fn cells<'a>(text: &'a str, heading: &str, id: &str) -> Vec<&'a str> {
    let below = text.lines().skip_while(|line| *line != heading);
    let row = below
        .skip(1)
        .find(|line| line.starts_with(&format!("| `{id}` |")));
    let row = row.unwrap_or_else(|| panic!("no row of {id} below `{heading}`"));
    row_cells(row)
}

/// The cells of a row of a table in Markdown.
fn row_cells(row: &str) -> Vec<&str> {
    row.trim_matches('|').split('|').map(str::trim).collect()
}

/// Scores by matcher and estimator, as `docs/results/<name>/scores.csv` has them.
struct Scores(Vec<BTreeMap<String, String>>);

impl Scores {
    fn of(name: &str) -> Self {
        let scores = rows(&format!("docs/results/{name}/scores.csv"));
        assert!(scores.len() >= 57, "{name}: {} rows", scores.len());
        Self(scores)
    }

    /// Columns of a row; `None` where the file has no such run.
    fn get<const N: usize>(
        &self,
        matcher: &str,
        estimator: &str,
        columns: [&str; N],
    ) -> Option<[f64; N]> {
        let is_wanted = |row: &&BTreeMap<String, String>| {
            row["matcher"] == matcher && row["estimator"] == estimator
        };
        let row = self.0.iter().find(is_wanted)?;
        Some(columns.map(|column| number(row, column)))
    }

    /// As tables print it.
    fn auc(&self, matcher: &str, estimator: &str) -> String {
        let auc = self.get(matcher, estimator, ["auc"]);
        auc.map_or_else(|| UNKNOWN.to_owned(), |[auc]| format!("{auc:.3}"))
    }

    /// The same with its interval.
    fn auc_and_interval(&self, matcher: &str, estimator: &str) -> String {
        let interval = self.get(matcher, estimator, ["auc_low", "auc_high"]);
        let interval = interval.map(|[low, high]| format!(" [{low:.3}, {high:.3}]"));
        self.auc(matcher, estimator) + &interval.unwrap_or_default()
    }

    /// Whether the row is the mean of five repetitions, as tables say that it is unless they mark it.
    fn is_repeated(&self, matcher: &str, estimator: &str) -> bool {
        self.get(matcher, estimator, ["repetitions"]) == Some([5.0])
    }
}

/// Behind numbers: learned on these images, looked at there, one repetition.
const MARKS: [char; 4] = ['*', '†', '¹', ' '];

/// The estimators of the table of all matchers, in its order.
const ESTIMATORS: [&str; 4] = ["ransac-e", "rich", "best", "adaptive"];

/// What tables print where a file has no row.
const UNKNOWN: &str = "–";

/// Milliseconds as the tables print them.
fn rounded(ms: f64) -> String {
    match ms {
        ms if ms < 10.0 => format!("{ms:.1}"),
        ms => format!("{ms:.0}"),
    }
}

/// Times of the stages of a matcher together, medians in milliseconds.
fn milliseconds(matcher: &str, stages: &[&str]) -> Option<f64> {
    let times = rows("docs/results/times-amd-avx512/times.csv");
    let row = times.iter().find(|row| row["matcher"] == matcher)?;
    let stage = |stage: &&str| number(row, &format!("{stage}_ms_median"));
    Some(stages.iter().map(stage).sum())
}

/// The same as tables print it.
fn time(matcher: &str, stages: &[&str]) -> String {
    milliseconds(matcher, stages).map_or_else(|| UNKNOWN.to_owned(), rounded)
}

#[test]
fn the_table_of_the_readme_is_what_the_files_say() {
    let (readme, castle) = (text("README.md"), Scores::of("castle"));
    for entry in MATCHERS {
        let id = entry.id();
        let cells = cells(&readme, "## Matchers", id);
        for (cell, estimator) in [(cells[2], "ransac-e"), (cells[3], "best")] {
            let expected = castle.auc_and_interval(id, estimator);
            assert_eq!(cell.trim_end_matches(MARKS), expected, "{id} + {estimator}");
            let is_marked = cell.ends_with('¹');
            assert_ne!(is_marked, castle.is_repeated(id, estimator), "{id}");
        }
        let expected = [
            time(id, &["detection"]),
            time(id, &["matching", "selection"]),
        ];
        assert_eq!(cells[4..6], expected, "{id}");
    }
}

#[test]
fn the_tables_of_results_are_what_the_files_say() {
    let book = text("docs/results.md");
    let [castle, kitti, tum, kitchen] = ["castle", "kitti", "tum", "kitchen"].map(Scores::of);
    let placed = Scores::of("kitchen-camera");
    for entry in MATCHERS {
        let id = entry.id();
        let reference = cells(&book, "## Matchers with the reference estimator", id);
        let expected =
            [&castle, &kitti, &tum, &kitchen].map(|scene| scene.auc_and_interval(id, "ransac-e"));
        let found = [2, 3, 4, 5].map(|column| reference[column].trim_end_matches(MARKS));
        assert_eq!(found, expected, "{id}");
        let matches = castle.get(id, "ransac-e", ["ap5"]);
        let matches = matches.map_or_else(|| UNKNOWN.to_owned(), |[ap5]| format!("{ap5:.0}"));
        assert_eq!(reference[6], matches, "{id}");
        let others = cells(&book, "## Matchers with other estimators", id);
        for (cell, scene) in others[1..].iter().zip([&castle, &tum, &kitchen]) {
            let expected = ESTIMATORS.map(|estimator| scene.auc(id, estimator));
            let expected = expected.join(" / ");
            assert_eq!(cell.trim_end_matches(MARKS), expected, "{id}");
            assert_ne!(cell.ends_with('¹'), scene.is_repeated(id, "best"), "{id}");
        }
        let with_camera = cells(&book, "## The truth of the kitchen", id);
        let expected = ESTIMATORS.map(|estimator| placed.auc(id, estimator));
        let expected = [expected.join(" / "), placed.auc_and_interval(id, "best")];
        let found = [1, 2].map(|column| with_camera[column].trim_end_matches(MARKS));
        assert_eq!(found, expected, "{id}");
        assert!(placed.is_repeated(id, "best"), "{id}");
    }
}

/// The estimators of the table of the others, in its order.
const OTHERS: [&str; 8] = [
    "prosac-e",
    "lo-ransac-e",
    "mlesac-e",
    "magsac-e",
    "lmeds-e",
    "ransac-f",
    "usac-f",
    "lmeds-f",
];

#[test]
fn the_table_of_the_other_estimators_is_what_the_files_say() {
    let (book, castle) = (text("docs/results.md"), Scores::of("castle"));
    let header = OTHERS.map(|estimator| format!("`{estimator}`")).join(" | ");
    assert!(book.contains(&format!("| matcher | {header} |")));
    for entry in MATCHERS {
        let id = entry.id();
        let expected = OTHERS.map(|estimator| castle.auc(id, estimator));
        assert!(!expected.iter().any(|auc| auc == UNKNOWN), "{id}");
        assert_eq!(
            cells(&book, "### The other estimators", id)[1..],
            expected,
            "{id}"
        );
    }
}

#[test]
fn the_times_of_speed_are_what_the_files_say() {
    let book = text("docs/speed.md");
    for entry in MATCHERS {
        let id = entry.id();
        let cells = cells(&book, "## Times of the matchers", id);
        let expected = ["detection", "matching", "selection"].map(|stage| time(id, &[stage]));
        assert_eq!(cells[2..5], expected, "{id}");
    }
}

/// Cells of the rows of a table in Markdown.
fn rows_of(table: &str) -> impl Iterator<Item = Vec<&str>> {
    let rows = table.lines().filter(|line| line.starts_with('|'));
    rows.map(row_cells)
}

/// A ratio as `docs/speed.md` prints it: beside OpenCV as it comes, and in brackets the other one where there is one.
fn ratios(first: &str, second: Option<&str>) -> String {
    let second = second.map(|ratio| format!(" ({})", ratio.trim_end_matches(" x")));
    first.to_owned() + &second.unwrap_or_default()
}

#[test]
fn ratios_of_speed_are_what_the_files_say() {
    let book = text("docs/speed.md");
    let processors: Vec<(usize, String)> = rows_of(&book)
        .find(|cells| cells[0] == "one thread")
        .expect("the heads of columns")
        .iter()
        .enumerate()
        .filter_map(|(column, head)| {
            let path = head.split_once("](")?.1.trim_end_matches(')');
            Some((column, text(&format!("docs/{path}"))))
        })
        .collect();
    assert_eq!(processors.len(), 6);
    let printed = |row: &str, column: usize| {
        let cells = rows_of(&book).find(|cells| cells[0] == row);
        cells.unwrap_or_else(|| panic!("no row of {row}"))[column].to_owned()
    };
    for (column, table) in &processors {
        for size in ["640 x 480", "3072 x 2048"] {
            let rows: Vec<_> = rows_of(table)
                .filter(|cells| cells[1] == size.replace(' ', ""))
                .collect();
            assert_eq!(rows.len(), 8);
            for cells in rows {
                let kept = (cells.len() == 9).then(|| cells[6]);
                let row = format!("{}, {size}", cells[0]);
                assert_eq!(printed(&row, *column), ratios(cells[4], kept), "{row}");
            }
        }
        for row in [
            "SIFT, 500 x 500",
            "SIFT, 1000 x 1000",
            "SIFT, 2000 x 2000",
            "SIFT, 9810 x 6103",
            "ORB, 500 x 500",
            "ORB, 33372 x 20238",
            "BRISK, 500 x 500",
            "BRISK, 8387 x 5074",
        ] {
            let (descriptor, size) = row.split_once(", ").expect("a descriptor and a size");
            let cells = rows_of(table).find(|cells| cells[..2] == [descriptor, size]);
            let ratio = cells.expect("the search was measured")[4];
            let (ratio, flann) = match ratio.split_once(", ") {
                Some((ratio, flann)) => (ratio, Some(flann.trim_end_matches(" x FLANN"))),
                None => (ratio, None),
            };
            assert_eq!(printed(row, *column), ratios(ratio, flann), "{row}");
        }
    }
}

#[test]
fn times_in_sentences_are_what_the_files_say() {
    let image = |id: &str| time(id, &["detection"]);
    let pair = |id: &str| time(id, &["matching", "selection"]);
    let whole = |id: &str| {
        let stages = ["detection", "detection", "matching", "selection"];
        milliseconds(id, &stages).expect("it was timed")
    };
    let both = |id: &str| format!("{} and {}", image(id), pair(id));
    let [fastest, slowest] = ["code", "repmatch"].map(|id| (whole(id) / whole("gms")).round());
    let paper = [
        format!(
            "CODE {} ms, RepMatch {}, GAIM {}, KVLD {}; GMS {}",
            both("code"),
            both("repmatch"),
            both("gaim"),
            both("kvld"),
            both("gms")
        ),
        format!(
            "{}, {}, {} and {} ms ({} on SIFT's keypoints) against {}",
            image("orb"),
            image("akaze"),
            image("brisk"),
            image("freak"),
            image("freak-sift"),
            image("sift")
        ),
        format!(
            "GMS {} ms, SIFT {} ms, KVLD {} ms",
            rounded(whole("gms")),
            rounded(whole("sift")),
            rounded(whole("kvld"))
        ),
        format!("take {fastest} to {slowest} times as long"),
    ];
    let of_sift = |stages| milliseconds("sift", stages).expect("it was timed");
    let of_pairs = of_sift(&["matching", "selection", "pose"]) / 3.6e6;
    let of_images = of_sift(&["detection"]) / 6e4;
    let scale = [
        format!(
            "{} ms an image, {} ms a pair), with {} ms for its pose",
            image("sift"),
            pair("sift"),
            time("sift", &["pose"])
        ),
        format!(
            "{:.1} core-hours | {:.1} core-minutes",
            1e6 * of_pairs,
            1415.0 * of_images
        ),
        format!(
            "{:.0} core-hours | {:.1} core-minutes",
            1e8 * of_pairs,
            14143.0 * of_images
        ),
    ];
    let slow = ["asift", "code", "repmatch", "adalam-asift", "gaim"];
    let range = |stages: &[&str]| {
        let times = slow.map(|id| milliseconds(id, stages).expect("it was timed"));
        let ends = [
            times.into_iter().fold(f64::INFINITY, f64::min),
            times.into_iter().fold(0.0, f64::max),
        ];
        ends.map(rounded).join(" to ")
    };
    let tutorial = [
        format!("take {} ms once for each image", range(&["detection"])),
        format!("{} ms for each pair", range(&["matching", "selection"])),
    ];
    for (page, sentences) in [
        ("docs/paper.md", &paper[..]),
        ("docs/scale.md", &scale[..]),
        ("docs/tutorial.md", &tutorial[..]),
    ] {
        let book = text(page);
        for sentence in sentences {
            assert!(book.contains(sentence), "{page}: {sentence}");
        }
    }
}

/// What `docs/paper.md` says of scores: a scene, a matcher, and an estimator or `AP5`, the matches of `ransac-e`, in braces.
const SENTENCES: [&str; 11] = [
    "KITTI {kitti gaim ransac-e} to {kitti sift ransac-e}, TUM {tum latch ransac-e} to {tum repmatch ransac-e} |",
    "castle: {castle code rich}, {castle repmatch rich}, {castle gms rich} against {castle kvld ransac-e} (KVLD) \
     and at most {castle freak ransac-e} (FREAK on SURF's keypoints)",
    "TUM: CODE {tum code rich} and RepMatch {tum repmatch rich} hold, GMS {tum gms rich} is level with SIFT \
     ({tum sift ransac-e}) and DAISY ({tum daisy ransac-e}), and below DLCO ({tum dlco ransac-e}) and KVLD \
     ({tum kvld ransac-e})",
    "Kitchen: CODE {kitchen code rich} and RepMatch {kitchen repmatch rich} hold, GMS {kitchen gms rich} is above \
     SIFT ({kitchen sift ransac-e}) and below DAISY ({kitchen daisy ransac-e}), DLCO ({kitchen dlco ransac-e}) \
     and BinBoost ({kitchen binboost ransac-e})",
    "GMS is ahead of SIFT on castle ({castle gms ransac-e}, {castle sift ransac-e}), and behind on TUM \
     ({tum gms ransac-e}, {tum sift ransac-e}) and in the kitchen ({kitchen gms ransac-e}, \
     {kitchen sift ransac-e}). With `rich` for both: {castle gms rich} and {castle sift rich}, {tum gms rich} \
     and {tum sift rich}, {kitchen gms rich} and {kitchen sift rich} |",
    "castle: GMS {castle gms AP5}, CODE {castle code AP5}, RepMatch {castle repmatch AP5}; SURF {castle surf AP5}, \
     ORB {castle orb AP5}, SIFT {castle sift AP5} |",
    "castle: {castle kvld AP5} and {castle gaim AP5} against {castle sift AP5} |",
    "castle: SURF {castle surf ransac-e}, KAZE {castle kaze ransac-e}, DLCO {castle dlco ransac-e} against \
     {castle sift ransac-e}; TUM: {tum surf ransac-e}, {tum kaze ransac-e}, {tum dlco ransac-e} against \
     {tum sift ransac-e}; kitchen: {kitchen surf ransac-e}, {kitchen kaze ransac-e}, {kitchen dlco ransac-e} \
     against {kitchen sift ransac-e}. BinBoost: {castle binboost ransac-e}, {tum binboost ransac-e}, \
     {kitchen binboost ransac-e} |",
    "but for FREAK on SURF's keypoints ({castle freak ransac-e}); TUM: all but DAISY, which is level \
     ({tum daisy ransac-e} and {tum sift ransac-e}) |",
    "castle {castle kvld ransac-e} and {castle sift ransac-e}; TUM {tum kvld ransac-e} and {tum sift ransac-e}; \
     KITTI {kitti kvld ransac-e} and {kitti sift ransac-e}; kitchen {kitchen kvld ransac-e} and \
     {kitchen sift ransac-e} |",
    "castle {castle gaim ransac-e} and {castle sift ransac-e}; TUM {tum gaim ransac-e} and {tum sift ransac-e}; \
     KITTI {kitti gaim ransac-e} and {kitti sift ransac-e}; kitchen {kitchen gaim ransac-e} and \
     {kitchen sift ransac-e} |",
];

/// What `docs/results.md` says of the figure of estimators.
const OF_ESTIMATORS: [&str; 1] = [
    "With SIFT the authors publish 0.396 with `ransac-e` (here {castle sift ransac-e}), 0.301 with `lmeds-e` \
     ({castle sift lmeds-e}), 0.219 with `ransac-f` ({castle sift ransac-f}), 0.187 with `lmeds-f` \
     ({castle sift lmeds-f}) and 0.255 with `usac-f` ({castle sift usac-f}).",
];

#[test]
fn scores_in_sentences_are_what_the_files_say() {
    let scenes = ["castle", "kitti", "tum", "kitchen"];
    let scenes = scenes.map(|name| (name, Scores::of(name)));
    let number = |cell: &str| {
        let words: Vec<&str> = cell.split(' ').collect();
        let [scene, matcher, what] = words[..] else {
            panic!("{cell}");
        };
        let (_, scores) = (scenes.iter().find(|(name, _)| *name == scene)).expect("one of these");
        match what {
            "AP5" => {
                let row = scores.get(matcher, "ransac-e", ["ap5"]);
                format!("{:.0}", row.expect("it was run")[0])
            }
            estimator => scores.auc(matcher, estimator),
        }
    };
    for (page, sentences) in [
        ("docs/paper.md", &SENTENCES[..]),
        ("docs/results.md", &OF_ESTIMATORS[..]),
    ] {
        let words = text(page);
        let words: Vec<&str> = words.split_whitespace().collect();
        let words = words.join(" ");
        for sentence in sentences {
            // What lies in braces is every second part.
            let parts = sentence.split(['{', '}']).enumerate();
            let filled: String = parts
                .map(|(place, part)| match place % 2 {
                    0 => part.to_owned(),
                    _ => number(part),
                })
                .collect();
            assert!(words.contains(&filled), "{page}: {filled}");
        }
    }
}

#[test]
fn every_folder_of_results_says_how_they_came_about() {
    let folder = repository().join("docs/results");
    let entries = fs::read_dir(folder).expect("it is part of the repository");
    let folders: Vec<PathBuf> = entries
        .map(|entry| entry.expect("it can be listed").path())
        .filter(|path| path.is_dir())
        .collect();
    assert!(folders.len() >= 2, "{folders:?}");
    for folder in folders {
        let file = |name: &str| {
            let path = folder.join(name);
            fs::read_to_string(&path).unwrap_or_else(|error| panic!("{}: {error}", path.display()))
        };
        for name in ["commands.sh", "machine.txt"] {
            assert!(
                file(name).lines().count() >= 2,
                "{}: {name}",
                folder.display()
            );
        }
        let plan = folder.join("plan.json");
        if !plan.exists() {
            let is_of_times = ["times.csv", "table.md"].map(|name| folder.join(name).exists());
            assert!(is_of_times.contains(&true), "{}", folder.display());
            continue;
        }
        // Every score is of a matcher and an estimator of the plan.
        let plan: Value = serde_json::from_str(&file("plan.json")).expect("JSON");
        let scores = rows(&format!(
            "docs/results/{}/scores.csv",
            folder.file_name().expect("a name").to_string_lossy()
        ));
        assert!(!scores.is_empty());
        let matchers = plan["matchers"].as_array().expect("a list");
        for row in scores {
            let matcher = matchers
                .iter()
                .find(|matcher| matcher["id"] == row["matcher"]);
            let estimators = matcher.expect("it is in the plan")["estimators"].as_array();
            let estimators = estimators.expect("a list");
            assert!(
                estimators.iter().any(|e| e["id"] == row["estimator"]),
                "{row:?}"
            );
        }
    }
}

#[test]
fn matchers_estimators_and_protocols_of_published_scores_are_those_of_today() {
    let folder = repository().join("docs/results");
    let mut checked = BTreeMap::new();
    for entry in fs::read_dir(folder).expect("it is part of the repository") {
        let folder = entry.expect("it can be listed").path();
        let Ok(plan) = fs::read_to_string(folder.join("plan.json")) else {
            continue; // times alone
        };
        let plan: Value = serde_json::from_str(&plan).expect("JSON");
        let commands = fs::read_to_string(folder.join("commands.sh")).expect("it is there");
        for matcher in plan["matchers"].as_array().expect("a list") {
            let id = matcher["id"].as_str().expect("a name");
            if let Ok(entry) = matchers::find(id) {
                let written = entry.modernized(&matcher["params"]);
                assert_eq!(written, entry.defaults(), "{id}");
            }
            for planned in matcher["estimators"].as_array().expect("a list") {
                let name = planned["id"].as_str().expect("a name");
                let id = planned["variant_of"].as_str().unwrap_or(name);
                let entry = estimators::find(id).expect("it is listed");
                let protocol = protocols::of_estimator(name);
                let mut settings = match protocol.estimator {
                    EstimatorRule::Of { id: theirs, params } if theirs == id => params(),
                    _ => Value::Object(serde_json::Map::new()),
                };
                for (parameter, value) in set_of(&commands, name) {
                    settings[parameter] = value;
                }
                let today = entry.build(Some(&settings)).expect("in range").params;
                let written = entry.modernized(&planned["params"]);
                assert_eq!(written, today, "{name}");
                let rules = protocol.rules().unwrap_or_default();
                assert_eq!(planned["protocol"], rules, "{name}");
                checked.insert(name.to_owned(), protocol.id);
            }
        }
    }
    for protocol in protocols::PROTOCOLS {
        let was_used = checked.values().any(|id| *id == protocol.id);
        assert!(was_used, "{}", protocol.id);
    }
    for entry in estimators::ESTIMATORS {
        let id = entry.id();
        let was_used = (checked.keys()).any(|name| protocols::without_protocol(name) == id);
        assert!(was_used, "{id}");
    }
}
