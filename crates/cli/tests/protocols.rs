//! One set of matches under the protocols of the field, and results scored by them.

mod common;
mod planes;

use std::collections::BTreeSet;
use std::fs;
use std::path::Path;
use std::process::Output;

use common::{dataset, matchbench};
use planes::homographies;

fn told(arguments: &[&str], folder: &Path) -> String {
    let mut command = matchbench();
    let output = command.args(arguments).current_dir(folder).output();
    let output: Output = output.expect("the program starts");
    assert!(output.status.success(), "{arguments:?}: {output:?}");
    String::from_utf8(output.stdout).expect("text")
}

fn plan(run: &Path) -> serde_json::Value {
    let text = fs::read_to_string(run.join("plan.json")).expect("a plan");
    serde_json::from_str(&text).expect("a plan")
}

#[test]
fn every_protocol_is_a_row_of_its_own_on_the_same_matches() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    dataset(folder.path(), "wall", 3);
    let run = [
        "run",
        "wall",
        "--matchers",
        "orb",
        "--protocol",
        "all",
        "--out",
        "run",
    ];
    let table = told(&run, folder.path());
    assert!(
        table.contains("ransac-e-inliers@roma") && table.contains("@roma: poses"),
        "{table}"
    );
    let plan = plan(&folder.path().join("run"));
    assert_eq!(plan["settings"]["repetitions"], 5, "RoMa's");
    let estimators = plan["matchers"][0]["estimators"]
        .as_array()
        .expect("a list");
    let protocols: Vec<_> = estimators
        .iter()
        .map(|one| &one["protocol"]["id"])
        .collect();
    assert_eq!(protocols[0], &serde_json::Value::Null, "the paper's");
    assert_eq!(protocols[1], "superglue");
    assert!(
        plan["matchers"][0]["params"]["extractor"]
            .get("size")
            .is_none()
    );

    let eval = ["eval", "run", "--protocol", "all", "--format", "csv"];
    let csv = told(&eval, folder.path());
    let rows: Vec<Vec<&str>> = csv
        .lines()
        .skip(1)
        .map(|line| line.split(',').collect())
        .collect();
    let names: BTreeSet<&str> = rows.iter().map(|row| row[3]).collect();
    assert_eq!((rows.len(), names.len()), (7, 7), "{csv}");
    // Several protocols leave images as they are, and say so.
    let superglue = rows
        .iter()
        .find(|row| row[3] == "superglue")
        .expect("it is there");
    assert!(
        superglue
            .last()
            .is_some_and(|text| text.contains("640x480")),
        "{csv}"
    );
    let listed = told(&["list", "protocols"], folder.path());
    assert!(names.iter().all(|name| listed.contains(name)) && listed.contains("magicleap"));
}

const ORB_BY_SUPERGLUE: [&str; 6] = [
    "run",
    "wall",
    "--matchers",
    "orb",
    "--protocol",
    "superglue",
];

#[test]
fn one_protocol_decides_on_size_and_estimator_unless_told_otherwise() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    dataset(folder.path(), "wall", 3);
    let start = ORB_BY_SUPERGLUE;
    told(&[&start[..], &["--out", "own"]].concat(), folder.path());
    let own = plan(&folder.path().join("own"));
    assert_eq!(own["matchers"][0]["params"]["extractor"]["size"], "640x480");
    assert_eq!(
        own["matchers"][0]["estimators"][0]["id"],
        "ransac-e-inliers@superglue"
    );
    assert_eq!(own["settings"]["repetitions"], 1);
    let text = told(&["eval", "own", "--protocol", "superglue"], folder.path());
    assert!(
        text.contains("superglue: SuperGlue") && !text.contains("is not as"),
        "{text}"
    );
    let text = told(&["eval", "own", "--protocol", "imc"], folder.path());
    assert!(
        text.contains("is not as imc asks: images were of 640x480"),
        "{text}"
    );

    let other = [
        "--estimator",
        "best",
        "--set",
        "orb.extractor.max_size=120",
        "--out",
        "other",
    ];
    told(&[&start[..], &other].concat(), folder.path());
    let other = plan(&folder.path().join("other"));
    assert_eq!(other["matchers"][0]["params"]["extractor"]["max_size"], 120);
    assert_eq!(
        other["matchers"][0]["estimators"][0]["id"],
        "best@superglue"
    );
    let text = told(&["eval", "other", "--protocol", "superglue"], folder.path());
    let said = "images were of at most 120 pixels, not of 640x480 pixels; poses are by best";
    assert!(text.contains(said), "{text}");
}

#[test]
fn that_signs_are_lost_is_told_where_a_score_knows_them() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let table = format!("R_errs t_errs\n{}", "1 40\n".repeat(10));
    fs::create_dir(folder.path().join("zeb")).expect("writable");
    fs::write(folder.path().join("zeb/wall.txt"), table).expect("writable");
    let eval = ["eval", "--errors", "zeb"];
    for (protocol, is_warned) in [
        (&[][..], true),
        (&["--protocol", "matchbench,zeb"], true),
        (&["--protocol", "all"], true),
        (&["--protocol", "zeb,superglue,imc"], false),
    ] {
        let mut command = matchbench();
        let command = command.args([&eval[..], protocol].concat());
        let output = command.current_dir(folder.path()).output();
        let said = output.expect("the program starts").stderr;
        let said = String::from_utf8(said).expect("text");
        let warning = "warning: wall: many poses are wrong, but no direction by more than 90";
        assert_eq!(said.starts_with(warning), is_warned, "{protocol:?}: {said}");
    }
}

#[test]
fn of_homographies_no_scores_of_protocols_are_promised() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let wall = dataset(folder.path(), "wall", 3);
    homographies(&wall, &[(0, 1), (0, 2), (1, 2)]);
    let run = |estimators: &str, out: &str| {
        let how = ["--estimator", estimators, "--out", out];
        told(&[&ORB_BY_SUPERGLUE[..], &how].concat(), folder.path())
    };
    let (plane, both) = (run("best-h", "plane"), run("best-h,best", "both"));
    assert!(!plane.contains("eval plane --protocol"), "{plane}");
    assert!(both.contains("eval both --protocol superglue"), "{both}");
    let scored = told(&["eval", "both", "--protocol", "superglue"], folder.path());
    let said = "orb + best-h@superglue is not as superglue asks: homographies were estimated, and its scores are of poses.";
    assert!(scored.contains(said), "{scored}");
}
