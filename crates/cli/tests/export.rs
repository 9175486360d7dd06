//! What is exported of a run whose methods differ from dataset to dataset, or in what they estimate, and of a dataset.

mod common;
mod planes;
mod steps;

use std::fs;
use std::path::Path;

use common::dataset;
use matchbench::datasets::Sequence;
use matchbench::exchange::{MatchFiles, ReadOptions};
use planes::homographies;
use steps::{go, succeeds};

#[test]
fn a_matcher_is_exported_on_the_datasets_that_it_was_run_on() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let folder = folder.path();
    dataset(folder, "wall", 3);
    dataset(folder, "tower", 3);
    let study = "out = 'run'\nmatchers = ['sift']\nestimators = ['ransac-e']\n\
        [[dataset]]\npath = 'wall'\n[[dataset]]\npath = 'tower'\nmatchers = ['orb']\n";
    fs::write(folder.join("study.toml"), study).expect("writable");
    succeeds(folder, &["run", "study.toml"]);
    succeeds(folder, &["export", "run", "out", "--format", "packed"]);
    let [sift, orb] = ["sift", "orb"].map(|matcher| folder.join("out").join(matcher));
    assert!(sift.join("wall").is_dir() && orb.join("tower").is_dir());
    assert!(!sift.join("tower").exists() && !orb.join("wall").exists());
}

#[test]
fn exported_matches_are_drawn_from_their_files() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let folder = folder.path();
    dataset(folder, "wall", 3);
    succeeds(
        folder,
        &["run", "wall", "--matchers", "sift", "--out", "run"],
    );
    succeeds(folder, &["export", "run", "out", "--format", "packed"]);
    let matches = "stored=out/sift/wall";
    let draw = |how: &[&str]| {
        let out = ["--estimator", "ransac-e", "--out", "pair.svg"];
        go(folder, &[&["show", "wall", "0", "1"], how, &out].concat())
    };
    let selected = |how: &[&str]| {
        let done = draw(how);
        let (said, drawn) = (
            String::from_utf8_lossy(&done.stdout).into_owned(),
            String::from_utf8_lossy(&done.stderr).into_owned(),
        );
        assert!(done.status.success(), "{drawn}");
        let (_, count) = said.split_once(" putative and ").expect("it tells them");
        let count = count.split(' ').next().map(str::to_owned);
        (count.expect("a number"), said)
    };
    let (by_matcher, _) = selected(&["--matcher", "sift"]);
    let (from_files, said) = selected(&["--matches", matches]);
    assert_eq!(from_files, by_matcher);
    assert!(said.contains("wall 0 – 1, stored + ransac-e: "), "{said}");
    fs::rename(folder.join("out/sift/wall"), folder.join("out/wall, sift")).expect("ours");
    let (from_files, _) = selected(&["--matches", "stored=out/wall, sift"]);
    assert_eq!(from_files, by_matcher);
    fs::rename(folder.join("out/wall, sift"), folder.join("out/sift/wall")).expect("ours");
    for wrong in [&[][..], &["--matcher", "sift", "--matches", matches]] {
        assert_eq!(draw(wrong).status.code(), Some(1), "one of the two");
    }
    let two = ["--matches", matches, "--matches", "more=out/sift/wall"];
    let done = draw(&two);
    assert!(
        String::from_utf8_lossy(&done.stderr).contains("one matcher"),
        "{}",
        String::from_utf8_lossy(&done.stderr)
    );
}

#[test]
fn a_dataset_that_was_moved_is_known_by_its_name_or_its_content() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let folder = folder.path();
    for name in ["wall", "tower"] {
        dataset(folder, name, if name == "wall" { 3 } else { 4 });
    }
    let run = ["run", "wall", "tower", "--matchers", "sift", "--out", "run"];
    succeeds(folder, &run);
    let export = |out: &str, datasets: &str| {
        let what = ["export", "run", out, "--format", "packed"];
        go(folder, &[&what[..], &["--datasets", datasets]].concat())
    };
    let said = |output: &std::process::Output| String::from_utf8_lossy(&output.stderr).into_owned();
    // It is written under the name that it has in the run.
    fs::rename(folder.join("wall"), folder.join("renamed")).expect("ours");
    let done = export("out", "renamed");
    assert!(done.status.success(), "{}", said(&done));
    assert!(folder.join("out/sift/wall").is_dir() && folder.join("out/sift/tower").is_dir());
    // A comma in the name of a folder that is there separates nothing.
    for name in ["wall, again", "wall,tower"] {
        fs::rename(folder.join("renamed"), folder.join(name)).expect("ours");
        for list in [
            name.to_owned(),
            format!("tower,{name}"),
            format!("{name},tower"),
        ] {
            let done = export("commas", &list);
            assert!(done.status.success(), "{list}: {}", said(&done));
        }
        fs::rename(folder.join(name), folder.join("renamed")).expect("ours");
    }
    let poses = go(folder, &["export", "run", "poses", "--datasets", "renamed"]);
    assert_eq!(poses.status.code(), Some(1), "they need no dataset");
    for (datasets, named) in [
        (
            "renamed,other",
            "names other, which is no dataset of the run",
        ),
        ("renamed,wall", "names wall, and another folder before it"),
    ] {
        dataset(folder, "other", 5);
        dataset(folder, "wall", 3);
        let refused = export("again", datasets);
        let message = said(&refused);
        assert_eq!(refused.status.code(), Some(1), "{message}");
        assert!(message.contains(named), "{message}");
    }
}

#[test]
fn inliers_are_those_of_the_matchers_that_were_run_with_the_estimator() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let folder = folder.path();
    dataset(folder, "wall", 3);
    // Each has an estimator of its own.
    succeeds(
        folder,
        &["run", "wall", "--matchers", "sift,gms", "--out", "run"],
    );
    let export = |estimator| {
        let format = ["--format", "packed", "--inliers", estimator];
        go(folder, &[&["export", "run", "out"][..], &format].concat())
    };
    let done = export("ransac-e");
    let said = String::from_utf8_lossy(&done.stderr);
    assert!(
        done.status.success() && said.contains("`gms` was not run with the estimator `ransac-e`"),
        "{said}"
    );
    assert!(folder.join("out/sift+ransac-e/wall").is_dir());
    let none = export("best");
    let said = String::from_utf8_lossy(&none.stderr);
    assert!(
        none.status.code() == Some(1) && said.contains("no matcher was run"),
        "{said}"
    );
}

#[test]
fn a_matcher_without_matches_is_left_out_of_what_is_exported() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let folder = folder.path();
    dataset(folder, "wall", 3);
    // Too few for a pose, and of a pair that is not run.
    for (name, pair) in [("few", "0_1"), ("none", "1_2")] {
        fs::create_dir(folder.join(name)).expect("writable");
        let matches = "1 2 3 4 1\n5 6 7 8 1\n9 10 11 12 1\n";
        fs::write(folder.join(name).join(format!("{pair}.txt")), matches).expect("writable");
    }
    let run = "run wall --matches few=few --matches none=none --matchers orb --estimator ransac-e --limit 1 \
               --pixel-center 0 --out run";
    go(folder, &run.split(' ').collect::<Vec<_>>());
    let export = |how: &str| {
        let done = go(folder, &how.split(' ').collect::<Vec<_>>());
        assert!(done.status.success(), "{how}");
        String::from_utf8(done.stderr).expect("UTF-8")
    };
    let failed = "`none` on `wall` is left out: all pairs failed";
    let told = export("export run out --format npz");
    assert!(told.contains(failed), "{told}");
    let no_pose =
        |name| format!("`{name}` on `wall` is left out: no pair has a pose or homography");
    let told = export("export run out --format npz --inliers ransac-e");
    assert!(
        told.contains(&no_pose("few")) && told.contains(&no_pose("none")),
        "{told}"
    );
    for written in ["few", "orb", "orb+ransac-e"] {
        assert!(folder.join("out").join(written).is_dir(), "{written}");
    }
    let run =
        "run wall --matches none=none --estimator ransac-e --limit 1 --pixel-center 0 --out alone";
    go(folder, &run.split(' ').collect::<Vec<_>>());
    let done = go(folder, &["export", "alone", "nothing", "--format", "npz"]);
    let told = String::from_utf8(done.stderr).expect("UTF-8");
    assert!(told.contains("alone holds nothing to export"), "{told}");
}

#[test]
fn inliers_are_as_many_as_the_estimator_counted_in_the_pixels_of_its_protocol() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let folder = folder.path();
    let wall = dataset(folder, "wall", 3);
    let protocols = "matchbench,superglue,roma,glue-factory";
    let run = ["run", "wall", "--matchers", "sift", "--out", "run"];
    succeeds(folder, &[&run[..], &["--protocol", protocols]].concat());
    let sequence = Sequence::open(&wall).expect("a dataset");
    let estimators = [
        "ransac-e",
        "ransac-e-inliers@superglue",
        "ransac-e-inliers@roma",
        "lo-ransac-e@glue-factory",
    ];
    let counts = estimators.map(|estimator| {
        let (exported, counted) = exported_and_counted(folder, &sequence, estimator);
        assert_eq!(exported, counted, "{estimator}");
        exported
    });
    // A pixel of an image of 1600 is a small part of one of these.
    assert!(0 < counts[3] && counts[3] < counts[0], "{counts:?}");
}

#[test]
fn inliers_of_an_estimator_without_a_threshold_are_those_that_it_counted() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let folder = folder.path();
    let wall = dataset(folder, "wall", 3);
    let run = ["run", "wall", "--matchers", "sift", "--out", "run"];
    succeeds(
        folder,
        &[&run[..], &["--estimator", "best,adaptive,lmeds-e"]].concat(),
    );
    let sequence = Sequence::open(&wall).expect("a dataset");
    for estimator in ["best", "adaptive", "lmeds-e"] {
        let (exported, counted) = exported_and_counted(folder, &sequence, estimator);
        assert_eq!(exported, counted, "{estimator}");
    }
}

#[test]
fn inliers_of_a_homography_are_those_that_the_estimator_counted() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let folder = folder.path();
    let wall = dataset(folder, "wall", 3);
    homographies(&wall, &[(0, 1), (0, 2), (1, 2)]);
    let run = ["run", "wall", "--matchers", "sift", "--out", "run"];
    let estimators = ["--estimator", "best-h,ransac-h"];
    succeeds(folder, &[&run[..], &estimators].concat());
    let sequence = Sequence::open(&wall).expect("a dataset");
    for estimator in ["best-h", "ransac-h"] {
        let (exported, counted) = exported_and_counted(folder, &sequence, estimator);
        assert!(counted > 0);
        assert_eq!(exported, counted, "{estimator}");
    }
}

#[test]
fn homographies_are_not_exported_as_poses_that_failed() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let folder = folder.path();
    let wall = dataset(folder, "wall", 3);
    homographies(&wall, &[(0, 1), (0, 2), (1, 2)]);
    let run = ["run", "wall", "--matchers", "sift", "--estimator"];
    for (estimators, out) in [("best,best-h", "both"), ("best-h", "planes")] {
        succeeds(
            folder,
            &[&run[..], &[estimators, "--repeat", "2", "--out", out]].concat(),
        );
    }
    let done = go(folder, &["export", "both", "poses"]);
    let said = String::from_utf8_lossy(&done.stderr);
    assert!(
        done.status.success()
            && said.contains("written for 1 of 2 methods, the others estimate homographies")
            && said.contains("only the first repetition of each pair"),
        "{said}"
    );
    let names: Vec<_> = fs::read_dir(folder.join("poses/wall"))
        .expect("it was written")
        .map(|file| file.expect("it can be listed").file_name())
        .collect();
    assert_eq!(names, ["sift.txt"]);
    // A pose and a homography are not compared.
    let both = ["compare", "both", "--matchers", "sift+best,sift+best-h"];
    let done = go(folder, &both);
    let said = String::from_utf8_lossy(&done.stderr);
    assert!(
        done.status.code() == Some(1)
            && said.contains("one estimates poses and the other homographies"),
        "{said}"
    );
    // Homographies alone are listed too.
    fs::remove_file(wall.join("pairs.txt")).expect("it is there");
    let table = succeeds(
        folder,
        &["eval", "planes", "--datasets", ".", "--format", "csv"],
    );
    assert!(
        table
            .lines()
            .nth(1)
            .is_some_and(|row| row.starts_with("wall,sift,best-h,6,")),
        "{table}"
    );
    let done = go(folder, &["export", "planes", "none"]);
    let said = String::from_utf8_lossy(&done.stderr);
    assert!(
        done.status.code() == Some(1) && said.contains("the authors' format holds only poses"),
        "{said}"
    );
    assert!(!folder.join("none").exists());
}

#[test]
fn a_dataset_that_is_another_now_is_not_exported() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let folder = folder.path();
    let wall = dataset(folder, "wall", 3);
    succeeds(
        folder,
        &["run", "wall", "--matchers", "sift", "--out", "run"],
    );
    let export = ["export", "run", "out", "--format", "packed"];
    let refused = |named: &str| {
        let done = go(folder, &export);
        let said = String::from_utf8_lossy(&done.stderr);
        assert!(
            done.status.code() == Some(1) && said.contains(named),
            "{said}"
        );
    };
    let changed = |file: &str, change: &dyn Fn(&mut Vec<u8>), named: &str| {
        let sound = fs::read(wall.join(file)).expect("it is there");
        let mut other = sound.clone();
        change(&mut other);
        fs::write(wall.join(file), other).expect("writable");
        refused(named);
        fs::write(wall.join(file), sound).expect("writable");
    };
    let another = |camera: &mut Vec<u8>| *camera = b"500 0 80 0 500 60 0 0 1".to_vec();
    changed("camera.txt", &another, "wall is another dataset now");
    // Whatever it is called now.
    let manifest = wall.join("dataset.toml");
    fs::write(&manifest, "version = 1\nname = \"other\"\n").expect("writable");
    changed("camera.txt", &another, "wall is another dataset now");
    fs::remove_file(&manifest).expect("it is ours");
    let brighter = |image: &mut Vec<u8>| *image.last_mut().expect("pixels") ^= 1;
    changed(
        "Images/0001.pgm",
        &brighter,
        "0001.pgm is not the file that the run",
    );
    succeeds(folder, &export);
}

#[test]
fn frames_that_are_not_written_are_not_counted() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let folder = folder.path();
    let wall = dataset(folder, "wall", 4);
    let pairs = fs::read_to_string(wall.join("pairs.txt")).expect("it is there");
    let of_three: String = (pairs.split_inclusive('\n'))
        .filter(|line| line.split_whitespace().nth(1) != Some("3"))
        .collect();
    fs::write(wall.join("pairs.txt"), of_three).expect("writable");
    let said = succeeds(
        folder,
        &["convert", "wall", "list", "--format", "superglue"],
    );
    let left_out = "Left out, since the layout has no place for it: 1 frame in no pair\n";
    assert!(
        said.starts_with("list: 3 frames, 3 pairs; ") && said.ends_with(left_out),
        "{said}"
    );
}

/// How many inliers of SIFT and an estimator are exported, and how many its records count.
fn exported_and_counted(folder: &Path, sequence: &Sequence, estimator: &str) -> (u64, u64) {
    let format = ["--format", "packed", "--inliers", estimator];
    succeeds(folder, &[&["export", "run", "out"][..], &format].concat());
    let out = folder.join("out").join(format!("sift+{estimator}"));
    let read = MatchFiles::open(&[out], sequence, &ReadOptions::default());
    let exported = read.expect("it was written").survey().matches;
    let records = folder.join(format!("run/records/wall/sift+{estimator}.jsonl"));
    let records = fs::read_to_string(records).expect("there are records");
    let counted = records.lines().map(|line| {
        let record: serde_json::Value = serde_json::from_str(line).expect("a record");
        let is_first = record["task"]["repetition"] == 0;
        record["outcome"]["inliers"].as_u64().filter(|_| is_first)
    });
    (exported, counted.flatten().sum())
}
