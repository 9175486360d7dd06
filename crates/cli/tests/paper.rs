//! The paper in one command, on a castle of three small images.

mod common;

use std::fs;
use std::path::Path;
use std::process::Output;

use common::{dataset, matchbench};

/// Size of an image of the wall, and of the part that is taken of it.
const WALL: (usize, usize) = (160, 120);
const SIZE: (usize, usize) = (64, 48);

fn paper(folder: &Path, arguments: &[&str]) -> Output {
    let mut command = matchbench();
    command.arg("paper").args(arguments).current_dir(folder);
    command.output().expect("the program starts")
}

/// `castle-P30` as it is published, but for what it shows.
fn castle(data: &Path) {
    let (images, cameras) = (
        data.join("castle-P30/images"),
        data.join("castle-P30/gt_dense_cameras"),
    );
    fs::create_dir_all(&images).expect("writable");
    fs::create_dir_all(&cameras).expect("writable");
    let wall = dataset(data, "wall", 3).join("Images");
    for frame in 0..3 {
        let name = format!("{frame:04}.pgm");
        let whole = fs::read(wall.join(&name)).expect("just written");
        let rows = whole[whole.len() - WALL.0 * WALL.1..].chunks(WALL.0);
        let mut file = format!("P5 {} {} 255\n", SIZE.0, SIZE.1).into_bytes();
        for row in rows.take(SIZE.1) {
            file.extend_from_slice(&row[..SIZE.0]);
        }
        fs::write(images.join(name), file).expect("writable");
        let camera = format!(
            "100 0 31.5\n0 100 23.5\n0 0 1\n0 0 0\n1 0 0\n0 1 0\n0 0 1\n{} 0 0\n{} {}\n",
            0.05 * frame as f64,
            SIZE.0,
            SIZE.1
        );
        fs::write(cameras.join(format!("{frame:04}.pgm.camera")), camera).expect("writable");
    }
}

#[test]
fn what_is_there_is_run_and_stands_beside_what_was_published() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    castle(&folder.path().join("data"));
    let arguments = ["data", "--out", "out", "--quick", "--sequences", "04,05"];
    let output = paper(folder.path(), &arguments);
    let told = String::from_utf8_lossy(&output.stderr);
    assert_eq!(output.status.code(), Some(0), "{told}");
    assert!(
        told.contains("04-kitti is left out: there is no data/dataset/sequences/00"),
        "{told}"
    );
    let made = |name: &str| folder.path().join("out/quick").join(name);
    let auc = fs::read_to_string(made("tables/table2.csv")).expect("a table");
    let sift = auc.lines().find(|line| line.starts_with("SIFT,\"05\","));
    let sift: Vec<&str> = sift.expect("a cell").split(',').collect();
    assert!(
        sift[2].parse::<f64>().is_ok() && sift[3] == "0.396",
        "{sift:?}"
    );
    let times = fs::read_to_string(made("tables/table3.csv")).expect("a table");
    let gms = times.lines().find(|line| line.starts_with("GMS,Features,"));
    assert!(
        gms.is_some_and(|line| line.ends_with(",9463") && !line.contains(",,")),
        "{times}"
    );
    let page = fs::read_to_string(made("index.html")).expect("a page");
    let lacking = "A quick look: fewer pairs than published of 05 (3 of 435); nothing of 01, 02, 03, 04, 06, 07, 08.";
    assert!(page.contains(lacking), "{page}");
    assert!(auc.contains("\nPairs,\"05\",3,435\n"), "{auc}");
    for file in [
        "paper.tex",
        "figures/figure1.png",
        "figures/figure3.svg",
        "report/index.html",
    ] {
        assert!(made(file).is_file(), "{file}");
    }
    assert!(
        !made("figures/figure2.svg").exists(),
        "no short baselines were run"
    );

    let again = paper(folder.path(), &arguments);
    let told = String::from_utf8_lossy(&again.stderr);
    assert!(
        told.contains("earlier") && !told.contains("timing"),
        "{told}"
    );

    // Another run has other times, of the matchers that were changed.
    fs::remove_dir_all(made("run")).expect("it is there");
    let changed = paper(
        folder.path(),
        &[&arguments[..], &["--set", "sift.ratio=0.6"]].concat(),
    );
    let told = String::from_utf8_lossy(&changed.stderr);
    assert!(
        told.contains("timing sift") && !told.contains("timing surf"),
        "{told}"
    );
}

#[test]
fn data_of_which_nothing_can_be_used_are_told_as_such() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let data = folder.path().join("data");
    castle(&data);
    fs::remove_dir_all(data.join("castle-P30/gt_dense_cameras")).expect("it was just made");
    let output = paper(folder.path(), &["data", "--out", "out"]);
    let told = String::from_utf8_lossy(&output.stderr);
    assert_eq!(output.status.code(), Some(1), "{told}");
    assert!(told.contains("05-castle is left out: "), "{told}");
    let ends = "error: data: none of the paper's data can be used; `matchbench paper --where` says what belongs there\n";
    assert!(told.ends_with(ends), "{told}");
}

#[test]
fn what_belongs_where_is_said() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let list = String::from_utf8(paper(folder.path(), &["--where"]).stdout).expect("text");
    for named in [
        "castle-P30",
        "dataset/sequences/00",
        "rgbd_dataset_freiburg3_teddy",
        "GB",
    ] {
        assert!(list.contains(named), "{named}: {list}");
    }
    for name in ["empty", "mine"] {
        fs::create_dir(folder.path().join(name)).expect("writable");
    }
    fs::write(folder.path().join("mine/paper.tex"), "mine").expect("writable");
    for (arguments, named) in [
        // Before anything is run, not after hours.
        (
            &["data", "--out", "mine"][..],
            "mine/paper.tex is not of an earlier report",
        ),
        (&["empty", "--out", "out"], "--where"),
        (
            &["empty", "--out", "out", "--sequences", "5"],
            "did you mean `05`",
        ),
        (&["empty"], "--out"),
    ] {
        let output = paper(folder.path(), arguments);
        let told = String::from_utf8_lossy(&output.stderr);
        assert_eq!(output.status.code(), Some(1), "{told}");
        assert!(told.contains(named), "{named}: {told}");
    }
}
