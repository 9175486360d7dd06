//! Tests of folders that importers read: lists of pairs, what is expected of a folder, and formats of numbers.

use std::fs;

use super::tests::source;
use super::*;
use crate::datasets::testing;

#[test]
fn a_list_names_images_or_numbers_the_frames_that_are_left() {
    let pose = "1 0 0 0\n0 1 0 0\n0 0 1 0\n0 0 0 1\n";
    let names: Vec<_> = (0..4).map(|i| format!("frame-00000{i}")).collect();
    let files: Vec<_> = (names.iter())
        .flat_map(|name| {
            [
                (format!("{name}.color.png"), ""),
                (format!("{name}.pose.txt"), pose),
            ]
        })
        .collect();
    let files: Vec<_> = files.iter().map(|(name, text)| (&**name, *text)).collect();
    let (folder, src) = source("mine", &files);
    fs::write(
        src.join("frame-000001.pose.txt"),
        pose.replace('1', "-1.#IND"),
    )
    .unwrap();
    let list = folder.path().join("list.txt");
    let import_as = |name: &str, text: &str| {
        fs::write(&list, text).unwrap();
        let options = ImportOptions {
            pairs: Some(format!("list:{}", list.display()).parse().unwrap()),
            ..ImportOptions::default()
        };
        import("7scenes", &src, &folder.path().join(name), &options)
    };
    let numbered = import_as("numbered", "0 2\n").unwrap();
    let note = numbered.notes.last().unwrap();
    assert!(
        note.contains("from 0: 2 is frame-000003.color.png"),
        "{note}"
    );
    let named = import_as("named", "frame-000000.color.png frame-000002.color.png\n").unwrap();
    assert_eq!(named.notes, numbered.notes[..numbered.notes.len() - 1]);
    let pairs = Sequence::open(&folder.path().join("named")).unwrap().pairs;
    assert_eq!((pairs[0].a, pairs[0].b), (0, 1));
    let gone = import_as("gone", "frame-000000.color.png frame-000001.color.png\n").unwrap_err();
    assert_eq!(gone.line, Some(1), "{gone}");
}

#[test]
fn the_numbers_of_a_part_of_a_sequence_are_those_of_its_frames() {
    let frames = |first: usize| {
        let mut frames = testing::frames(3);
        for (frame, number) in frames.iter_mut().zip(first..) {
            frame.image = format!("image_0/{number:06}.png").into();
        }
        frames
    };
    let note = |first| {
        let (frames, pairs) = PairRule::All.apply(frames(first)).unwrap();
        numbers_of_frames(&frames, &pairs, &[])
    };
    assert_eq!(note(0), None);
    let note = note(100).unwrap();
    assert!(note.contains("0 is 000100.png"), "{note}");
}
