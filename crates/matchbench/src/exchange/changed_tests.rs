//! Files of matches that change after they were opened: what was hashed is what is used, or nothing.

use std::fs::{self, File};
use std::path::Path;
use std::time::{Duration, SystemTime};

use super::tests::dataset;
use super::*;
use crate::datasets::Sequence;

fn open(path: &Path, sequence: &Sequence) -> MatchFiles {
    let options = ReadOptions {
        pixel_center: Some(0.0),
        ..ReadOptions::default()
    };
    MatchFiles::open(&[path.to_owned()], sequence, &options).unwrap()
}

#[test]
fn a_file_that_has_changed_since_it_was_opened_is_refused_by_its_name() {
    let (folder, sequence) = dataset();
    let lines = folder.path().join("lines");
    fs::create_dir(&lines).unwrap();
    for pair in ["0_1", "0_2", "1_2"] {
        fs::write(lines.join(format!("{pair}.txt")), "0 0 399 299\n").unwrap();
    }
    let file = lines.join("0_2.txt");
    let found = open(&lines, &sequence);
    assert_eq!(found.matches(0, 2).unwrap().unwrap().points.len(), 1);
    let refused = |found: &MatchFiles| {
        let error = found.matches(0, 2).unwrap_err();
        assert_eq!(error.file, file);
        assert!(error.what.contains("has changed since"), "{error}");
        assert!(found.matches(0, 1).is_ok(), "it is in another file");
    };
    // Another length, and the same length with another time.
    fs::write(&file, "0 0 399 299\n5 5 6 6\n").unwrap();
    refused(&found);
    let found = open(&lines, &sequence);
    fs::write(&file, "0 0 399 299\n5 5 7 7\n").unwrap();
    let later = SystemTime::now() + Duration::from_secs(5);
    let opened = File::options().write(true).open(&file).unwrap();
    opened.set_modified(later).unwrap();
    refused(&found);
    assert_eq!(
        open(&lines, &sequence)
            .matches(0, 2)
            .unwrap()
            .unwrap()
            .points
            .len(),
        2
    );
}

#[test]
fn a_file_of_keypoints_that_has_changed_is_the_one_that_is_named() {
    let (folder, sequence) = dataset();
    let found = open(&folder.path().join("hloc"), &sequence);
    let features = folder.path().join("hloc/features.h5");
    let mut longer = fs::read(&features).unwrap();
    longer.extend([0; 8]);
    fs::write(&features, longer).unwrap();
    let error = found.matches(0, 1).unwrap_err();
    assert_eq!(error.file, features);
    assert!(error.what.contains("has changed since"), "{error}");
}
