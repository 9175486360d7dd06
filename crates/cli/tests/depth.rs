//! A dataset with depth: what runs record by it, what is shown of it, and what happens where it is wrong.

mod common;
mod steps;

use std::fmt::Write as _;
use std::fs;
use std::path::Path;

use common::dataset;
use serde_json::Value;
use steps::{go, succeeds};

/// The wall, which is one metre away wherever it is photographed from, and its depth in millimetres.
fn wall(folder: &Path) {
    const FRAMES: usize = 4;
    let wall = dataset(folder, "wall", FRAMES);
    fs::create_dir(wall.join("depth")).expect("writable");
    let mut manifest = "version = 1\ndepth = { per_unit = 1000, invalid = 65535 }\n".to_owned();
    for frame in 0..FRAMES {
        // Half as many pixels along each side.
        let depth = [b"P5 80 60 65535\n".to_vec(), [3, 232].repeat(80 * 60)].concat();
        fs::write(wall.join(format!("depth/{frame}.pgm")), depth).expect("writable");
        let files = format!("image = \"Images/{frame:04}.pgm\"\ndepth = \"depth/{frame}.pgm\"");
        writeln!(manifest, "[[frames]]\n{files}").expect("a string");
    }
    fs::write(wall.join("dataset.toml"), manifest).expect("writable");
}

fn records(folder: &Path) -> Vec<Value> {
    let file = folder.join("run/records/wall/sift+ransac-e.jsonl");
    let text = fs::read_to_string(file).expect("the run has records");
    let records = text.lines().map(serde_json::from_str);
    records.map(|record| record.expect("JSON")).collect()
}

const RUN: [&str; 6] = ["run", "wall", "--matchers", "sift", "--out", "run"];

#[test]
fn overlap_is_measured_and_matches_are_judged_by_where_depth_takes_them() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let folder = folder.path();
    wall(folder);
    succeeds(folder, &["validate", "wall"]);
    let table = succeeds(folder, &RUN);
    assert!(table.contains("Precision 3 px"), "{table}");
    for record in records(folder) {
        let by_depth = &record["by_depth"];
        // The image moves by 5 of 160 pixels from one frame to the next.
        let [a, b] = ["a", "b"].map(|frame| record["task"][frame].as_f64().expect("a frame"));
        let overlap = by_depth["overlap"].as_f64().expect("a share");
        assert!(
            (overlap - (1.0 - 5.0 * (b - a) / 160.0)).abs() < 0.02,
            "{record}"
        );
        let judged = by_depth["judged"].as_u64().expect("a count");
        assert!(
            judged > 20 && record["counts"]["selected"] == judged,
            "{record}"
        );
        let within = by_depth["within"][2].as_u64().expect("a count");
        assert!(within * 10 > judged * 9, "{record}");
        let visible = by_depth["repeated"]["visible"][0]
            .as_u64()
            .expect("a count");
        assert!((20..=judged).contains(&visible), "{record}");
    }
    // Two methods side by side are told the same overlap.
    let least = ["--set", "sift.ratio=0.5", "--out", "other"];
    succeeds(folder, &[&RUN[..4], &least].concat());
    succeeds(folder, &["compare", "run", "other", "--out", "page"]);
    let page = fs::read_to_string(folder.join("page/index.html")).expect("it was written");
    assert!(
        page.contains("overlap 0.9") && !page.contains("overlap at most"),
        "{page}"
    );
    // Without the dataset the records alone say it.
    fs::rename(folder.join("wall"), folder.join("gone")).expect("writable");
    succeeds(folder, &["report", "run"]);
    let page = fs::read_to_string(folder.join("run/report/index.html")).expect("it was written");
    assert!(page.contains("Precision 3 px") && page.contains("overlap (measured by depth)"));
    assert!(
        !page.contains("<span>Baseline</span>") && page.contains("<span>Overlap</span>"),
        "nothing is known of it"
    );
    let pairs =
        fs::read_to_string(folder.join("run/report/tables/pairs.csv")).expect("it was written");
    let (heads, row) = pairs.split_once('\n').expect("rows");
    let column = heads.split(',').position(|head| head == "measured_overlap");
    let cell = row
        .split(',')
        .nth(column.expect("it is there"))
        .expect("a cell");
    assert!(cell.parse::<f64>().is_ok_and(|share| share > 0.9), "{row}");
    let scores = succeeds(folder, &["eval", "run", "--format", "json"]);
    let scores: Value = serde_json::from_str(&scores).expect("JSON");
    let score = |id: &str| scores[0][id]["value"].as_f64().expect("a score");
    assert!(score("precision_5px") >= score("precision_3px") && score("precision_3px") > 0.9);
    assert!(
        (0.2..=1.0).contains(&score("depth_matching_score")),
        "{scores}"
    );
}

#[test]
fn depth_that_is_damaged_or_of_another_image_fails_its_pairs_by_name() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let folder = folder.path();
    wall(folder);
    let depth = |frame: u32| folder.join(format!("wall/depth/{frame}.pgm"));
    fs::write(depth(0), b"P5 80 60 65535\n\x03").expect("writable");
    fs::write(
        depth(3),
        [b"P5 60 60 65535\n".to_vec(), vec![3; 7200]].concat(),
    )
    .expect("writable");
    let validated = go(folder, &["validate", "wall"]);
    let said =
        String::from_utf8_lossy(&validated.stdout) + String::from_utf8_lossy(&validated.stderr);
    assert!(!validated.status.success(), "{said}");
    for (file, what) in [
        ("0.pgm", "truncated"),
        ("3.pgm", "the depth is 60x60, the image 160x120"),
    ] {
        assert!(said.contains(file) && said.contains(what), "{said}");
    }
    assert_eq!(go(folder, &RUN).status.code(), Some(2));
    let records = records(folder);
    assert_eq!(records.len(), 6);
    for record in records {
        let broken = record["task"]["a"] == 0 || record["task"]["b"] == 3;
        assert_eq!(record["outcome"]["kind"] == "failed", broken, "{record}");
        assert_eq!(record["by_depth"].is_null(), broken, "{record}");
    }
    // What is mended is done at the next start; what was good and is another now is refused.
    fs::copy(depth(1), depth(0)).expect("writable");
    fs::copy(depth(1), depth(3)).expect("writable");
    succeeds(folder, &RUN);
    let more = [&RUN[..], &["--estimator", "best,ransac-e"]].concat();
    let good = fs::read(depth(2)).expect("it is there");
    let mut other = good.clone();
    *other.last_mut().expect("pixels") ^= 1;
    fs::write(depth(2), other).expect("writable");
    let refused = go(folder, &more);
    let said = String::from_utf8_lossy(&refused.stderr);
    assert_eq!(refused.status.code(), Some(1), "{said}");
    assert!(
        said.contains("2.pgm is not the file that the run"),
        "{said}"
    );
    fs::write(depth(2), good).expect("writable");
    succeeds(folder, &more);
    fs::remove_file(depth(2)).expect("it is there");
    let missing = go(
        folder,
        &["run", "wall", "--matchers", "sift", "--out", "other"],
    );
    let said = String::from_utf8_lossy(&missing.stderr);
    assert!(
        said.contains("2.pgm") && said.contains("the depth is missing"),
        "{said}"
    );
}

#[test]
fn shards_with_depth_merge_into_the_run_of_one_machine_and_all_see_the_same_depth() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let folder = folder.path();
    wall(folder);
    succeeds(folder, &RUN);
    let plan = ["plan", "wall", "--matchers", "sift", "--shards", "2"];
    let work = |plan: &str, shard: &str| {
        succeeds(folder, &["work", plan, "--shard", shard]);
    };
    succeeds(folder, &[&plan[..], &["--out", "plan"]].concat());
    work("plan", "1");
    work("plan", "2");
    succeeds(folder, &["merge", "plan", "--out", "merged"]);
    let depth = |run: &str| fs::read(folder.join(run).join("depth/wall.txt")).expect("it is noted");
    assert_eq!(depth("merged"), depth("run"));

    succeeds(folder, &[&plan[..], &["--out", "again"]].concat());
    work("again", "1");
    for frame in 0..4 {
        let file = folder.join(format!("wall/depth/{frame}.pgm"));
        let mut other = fs::read(&file).expect("it is there");
        *other.last_mut().expect("pixels") ^= 1;
        fs::write(&file, other).expect("writable");
    }
    work("again", "2");
    let refused = go(folder, &["merge", "again", "--out", "mixed"]);
    let said = String::from_utf8_lossy(&refused.stderr);
    assert_eq!(refused.status.code(), Some(1), "{said}");
    assert!(
        said.contains("not worked with the same depth of frame") && said.contains("shards/2"),
        "{said}"
    );
}
