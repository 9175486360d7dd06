//! Tests of the file of matches.

use std::fs;

use super::*;

fn matches(count: u32) -> SelectedMatches {
    let points = |by: f64| {
        (0..count)
            .map(|i| Point2::new(f64::from(i) * by, -0.5))
            .collect()
    };
    let counts = Counts {
        features_a: 90,
        features_b: 80,
        putative: 70,
        selected: count,
    };
    let ambiguity = (0..count).map(|i| 1.0 / (i + 1) as f32).collect();
    let points = MatchedPoints::new(points(1.5), points(0.1), ambiguity);
    SelectedMatches::new(counts, &points)
}

/// The same, with turns.
fn turned(count: u32) -> SelectedMatches {
    let SelectedMatches { counts, points } = matches(count);
    let turns = (0..count).map(|i| i as f32 - 0.1).collect();
    SelectedMatches {
        counts,
        points: points.with_turns(Some(turns)),
    }
}

/// The same, with growths.
fn grown(matches: SelectedMatches) -> SelectedMatches {
    let SelectedMatches { counts, points } = matches;
    let growths = (0..counts.selected).map(|i| 0.3 - i as f32).collect();
    SelectedMatches {
        counts,
        points: points.with_growths(Some(growths)),
    }
}

/// A file with the matches of five tasks, the second the same as the first.
fn several() -> (
    tempfile::TempDir,
    PathBuf,
    [(MatchesKey, SelectedMatches); 5],
) {
    let folder = tempfile::tempdir().unwrap();
    let file = path(folder.path(), "office", "sift");
    let entries = [
        ((0, 1, 0), matches(5)),
        ((0, 1, 1), matches(5)),
        ((0, 2, 0), turned(3)),
        ((0, 3, 0), grown(matches(4))),
        ((0, 4, 0), grown(turned(2))),
    ];
    let mut writer = MatchesFile::open(&file).unwrap();
    for (key, matches) in &entries {
        writer.append(*key, matches).unwrap();
        writer.append(*key, matches).unwrap();
    }
    (folder, file, entries)
}

#[test]
fn matches_come_back_bit_for_bit() {
    let (_folder, file, entries) = several();
    let read = MatchesFile::open(&file).unwrap();
    for (key, matches) in entries {
        assert_eq!(read.read(key).unwrap(), Some(matches));
    }
    assert_eq!(read.read((0, 2, 1)).unwrap(), None);
}

#[test]
fn matches_of_a_repetition_that_are_the_same_take_no_room() {
    let (_folder, file, _) = several();
    let counts = [
        5,
        AS_BEFORE,
        3 | WITH_TURNS,
        4 | WITH_GROWTHS,
        2 | WITH_TURNS | WITH_GROWTHS,
    ];
    let expected = MAGIC.len() + counts.map(entry_length).iter().sum::<usize>();
    assert_eq!(entry_length(3 | WITH_TURNS), entry_length(3) + 12);
    assert_eq!(entry_length(counts[4]), entry_length(2) + 16);
    assert_eq!(fs::metadata(file).unwrap().len(), expected as u64);
}

#[test]
fn those_of_chosen_indices_keep_all_that_is_known_of_them() {
    let chosen = grown(turned(5)).of_indices(&[4, 9, 0]);
    assert_eq!(chosen.counts.selected, 2);
    assert_eq!(chosen.points.turns, Some(vec![3.9, -0.1]));
    assert_eq!(chosen.points.growths, Some(vec![-3.7, 0.3]));
    assert_eq!(chosen.points.a[0], turned(5).points.a[4]);
    assert_eq!(matches(5).of_indices(&[1]).points.turns, None);
}

#[test]
fn a_number_that_is_none_is_damage_whatever_the_checksum_and_called_so() {
    type Forge = fn(&mut MatchedPoints);
    let forgeries: [(Forge, &str); 6] = [
        (
            |points| points.turns = Some(vec![0.0, f32::NAN, 0.0]),
            "1 has a turn",
        ),
        (
            |points| points.growths = Some(vec![0.0, 0.0, f32::NAN]),
            "2 has a growth",
        ),
        (|points| points.a[0].x = f64::NAN, "0 has a position"),
        (|points| points.b[2].y = f64::INFINITY, "2 has a position"),
        (
            |points| points.ambiguity[1] = f32::NAN,
            "1 has the ambiguity NaN",
        ),
        (
            |points| points.ambiguity[1] = -0.5,
            "1 has the ambiguity -0.5",
        ),
    ];
    let folder = tempfile::tempdir().unwrap();
    for (index, (forge, expected)) in forgeries.into_iter().enumerate() {
        let mut forged = grown(turned(3));
        forge(&mut forged.points);
        let file = folder.path().join(format!("{index}.bin"));
        (MatchesFile::open(&file).unwrap())
            .append((4, 7, 0), &forged)
            .unwrap();
        let error = MatchesFile::open(&file).unwrap().read((4, 7, 0));
        let message = error.unwrap_err().to_string();
        let expected = format!("the matches of 4 7 in repetition 0: match {expected}");
        assert!(message.contains(&expected), "{message}");
    }
    let sound = to_bytes((0, 1, 0), &grown(turned(3)), false);
    assert_eq!(from_bytes(&sound), Ok(grown(turned(3))));
}

#[test]
fn an_entry_that_is_forgotten_is_written_again_and_the_later_one_is_read() {
    let (_folder, file, entries) = several();
    let mut again = MatchesFile::open(&file).unwrap();
    let five = matches(5).counts;
    assert_eq!(again.counts((0, 1, 1)), Some(five), "it repeats another");
    again.forget((0, 1, 0), matches(4).counts);
    assert!(again.contains((0, 1, 0)), "that is another one");
    again.forget((0, 1, 0), five);
    assert!(!again.contains((0, 1, 0)));
    again.append((0, 1, 0), &matches(2)).unwrap();
    drop(again);
    let read = MatchesFile::open(&file).unwrap();
    assert_eq!(read.read((0, 1, 0)).unwrap(), Some(matches(2)));
    for (key, matches) in entries.into_iter().skip(1) {
        assert_eq!(read.read(key).unwrap(), Some(matches));
    }
}

#[test]
fn a_torn_file_is_completed_wherever_it_was_torn() {
    let (_folder, file, entries) = several();
    let whole = fs::read(&file).unwrap();
    for length in 0..whole.len() {
        fs::write(&file, &whole[..length]).unwrap();
        let mut torn = MatchesFile::open(&file).unwrap();
        assert!(!torn.contains((0, 4, 0)));
        for (key, matches) in &entries {
            torn.append(*key, matches).unwrap();
        }
        drop(torn);
        assert_eq!(fs::read(&file).unwrap(), whole, "torn at byte {length}");
    }
}

#[test]
fn damage_is_refused_with_the_file() {
    let (_folder, file, _) = several();
    let whole = fs::read(&file).unwrap();
    let mut damaged = whole.clone();
    damaged[MAGIC.len() + HEADER + 3] ^= 1;
    fs::write(&file, &damaged).unwrap();
    let error = MatchesFile::open(&file).unwrap().read((0, 1, 0));
    let message = error.unwrap_err().to_string();
    assert!(
        message.contains("sift.bin") && message.contains("delete"),
        "{message}"
    );
    // The number of matches of the first entry: it is not taken for one that was torn.
    let mut damaged = whole;
    damaged[MAGIC.len() + HEADER - 2] ^= 0x80;
    fs::write(&file, &damaged).unwrap();
    let message = MatchesFile::open(&file).unwrap_err().to_string();
    assert!(
        message.contains("sift.bin: damaged (an entry says that it has 8388613 matches)"),
        "{message}"
    );
    fs::write(&file, b"something else").unwrap();
    assert!(MatchesFile::open(&file).is_err());
}
