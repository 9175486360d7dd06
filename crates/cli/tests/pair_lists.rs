//! Lists of pairs that choose what is scored.

mod common;
mod steps;

use std::fs;

use common::dataset;
use steps::{go, succeeds};

#[test]
fn a_list_of_names_chooses_pairs_of_a_run_as_one_of_numbers_does() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let folder = folder.path();
    dataset(folder, "wall", 4);
    let run = ["run", "wall", "--matchers", "sift,orb", "--out", "run"];
    succeeds(folder, &run);
    let write = |name: &str, text: &str| fs::write(folder.join(name), text).expect("writable");
    write("numbers.txt", "0 1\n1 3\n");
    write("names.txt", "0000.pgm 0001.pgm\n0001.pgm 0003.pgm\n");
    let eval = |list: &str, more: &[&str]| {
        let rule = format!("list:{list}");
        let words = ["eval", "run", "--format", "csv", "--pairs", &*rule];
        go(folder, &[&words[..], more].concat())
    };
    let by_numbers = eval("numbers.txt", &[]);
    for more in [&[][..], &["--datasets", "."]] {
        let by_names = eval("names.txt", more);
        let said = String::from_utf8_lossy(&by_names.stderr);
        assert!(by_names.status.success() && said.is_empty(), "{said}");
        assert_eq!(by_names.stdout, by_numbers.stdout);
    }
    // Where pairs have no results, they are counted by their lines.
    write("strangers.txt", "0000.pgm 0001.pgm\n0003.pgm 0001.pgm\n");
    let said = eval("strangers.txt", &[]);
    let said = String::from_utf8_lossy(&said.stderr);
    assert!(
        said.contains("no results of 1 pair of it, the first 3 1"),
        "{said}"
    );
    fs::rename(folder.join("wall"), folder.join("moved")).expect("it is ours");
    let refused = eval("names.txt", &[]);
    let said = String::from_utf8_lossy(&refused.stderr);
    assert!(!refused.status.success(), "{said}");
    assert!(
        said.contains("names.txt: ") && said.contains("--datasets"),
        "{said}"
    );
}
