//! A database as COLMAP writes it: verified matches, and orientations of keypoints.

use std::collections::HashSet;
use std::fs;
use std::path::PathBuf;
use std::slice;
use std::sync::Arc;

use matchbench_vision::geometry::{MatchedPoints, transfer};
use nalgebra::{Matrix3, Point2, Vector2};
use rusqlite::{Connection, Row};
use tempfile::TempDir;

use super::super::names::PairName;
use super::super::probe::Probe;
use super::super::tests::dataset;
use super::super::{Export, FORMATS, MatchFiles, Model, PairExport, ReadOptions, TwoView};

/// The database among the fixtures.
fn database(folder: &TempDir) -> (PathBuf, Connection) {
    let file = fs::read_dir(folder.path().join("colmap")).unwrap().next();
    let path = file.unwrap().unwrap().path();
    let connection = Connection::open(&path).unwrap();
    (path, connection)
}

#[test]
fn verified_matches_are_those_of_the_two_view_geometries() {
    let (folder, sequence) = dataset();
    let verified = ReadOptions {
        verified: true,
        ..ReadOptions::default()
    };
    let files = MatchFiles::open(&[folder.path().join("colmap")], &sequence, &verified).unwrap();
    assert_eq!(files.survey().matches, 6);
    assert!(files.understood().to_string().contains("verified matches"));
    let error = MatchFiles::open(&[folder.path().join("hloc")], &sequence, &verified).err();
    assert!(error.unwrap().to_string().contains("leave --verified out"));

    let (database, connection) = database(&folder);
    (connection.execute("DELETE FROM two_view_geometries", [])).unwrap();
    drop(connection);
    let error = MatchFiles::open(&[database], &sequence, &verified).err();
    let message = error.unwrap().to_string();
    assert!(
        message.contains("`two_view_geometries` is empty; leave --verified out"),
        "{message}"
    );
}

#[test]
fn a_homography_is_written_in_the_pixels_of_colmap_from_the_smaller_number_of_an_image_to_the_larger()
 {
    let (folder, sequence) = dataset();
    let moved = Matrix3::new(1.0, 0.1, 5.0, 0.0, 0.9, -3.0, 1e-4, 0.0, 1.0);
    let points: Vec<Point2<f64>> = [(10.0, 20.0), (300.0, 40.0), (200.0, 150.0)]
        .map(|(x, y)| Point2::new(x, y))
        .into();
    let seen: Vec<Point2<f64>> = points.iter().map(|&p| transfer(&moved, p)).collect();
    for frames in [(0, 1), (1, 0)] {
        let pair = PairExport {
            frames,
            points: MatchedPoints::new(points.clone(), seen.clone(), vec![0.0; 3]),
            two_view: Some(TwoView {
                b_from_a: Model::Homography(moved),
                inliers: vec![true, false, true],
            }),
        };
        let export = Export::new(&sequence, vec![pair]).unwrap();
        let out = folder.path().join(format!("from-{}", frames.0));
        let format = FORMATS.iter().find(|format| format.id == "colmap").unwrap();
        let file = format.write(&out, &export).unwrap().remove(0);
        let row = "SELECT config, rows, H FROM two_view_geometries";
        let read = |row: &Row<'_>| Ok((row.get(0)?, row.get(1)?, row.get(2)?));
        let (config, rows, h): (i64, i64, Vec<u8>) = Connection::open(file)
            .and_then(|connection| connection.query_row(row, [], read))
            .unwrap();
        assert_eq!((config, rows), (6, 2));
        let h: Vec<f64> = (h.as_chunks().0.iter())
            .map(|&b| f64::from_le_bytes(b))
            .collect();
        let h = Matrix3::from_row_slice(&h);
        let half = Vector2::new(0.5, 0.5);
        let (from, to) = if frames.0 == 0 {
            (&points, &seen)
        } else {
            (&seen, &points)
        };
        for (from, to) in from.iter().zip(to) {
            assert!((transfer(&h, from + half) - (to + half)).norm() < 1e-9);
        }
    }
}

#[test]
fn a_pair_in_both_orders_is_refused_before_anything_is_written() {
    let (folder, sequence) = dataset();
    let pair = |frames| PairExport {
        frames,
        points: MatchedPoints::default(),
        two_view: None,
    };
    let export = Export::new(&sequence, [(0, 1), (0, 2), (1, 0)].map(pair).into()).unwrap();
    let out = folder.path().join("both");
    let format = FORMATS.iter().find(|format| format.id == "colmap").unwrap();
    let error = format.write(&out, &export).unwrap_err().to_string();
    let expected = "the pairs 0 1 and 1 0 are one pair of a COLMAP database; leave one";
    assert!(error.contains(expected), "{error}");
    assert!(!out.join("database.db").exists());
}

#[test]
fn a_database_tells_how_far_keypoints_turned_and_grew() {
    // Both forms of COLMAP's keypoints: scale and orientation, and an affine shape of these.
    let four = |angle: f32| vec![2.0 * angle, angle];
    let six = |angle: f32| {
        let (s, c) = angle.sin_cos();
        [c, -s, s, c].map(|value| 2.0 * angle * value).to_vec()
    };
    let changes = |frames: [u32; 2], more: &dyn Fn(f32) -> Vec<f32>| {
        let (folder, mut sequence) = dataset();
        if frames[0] > frames[1] {
            for pair in &mut sequence.pairs {
                (pair.a, pair.b) = (pair.b, pair.a);
            }
        }
        let (database, connection) = database(&folder);
        let images: Vec<(i64, Vec<u8>, i64)> = (connection
            .prepare("SELECT image_id, data, cols FROM keypoints")
            .unwrap())
        .query_map([], |row| Ok((row.get(0)?, row.get(1)?, row.get(2)?)))
        .unwrap()
        .map(Result::unwrap)
        .collect();
        for (id, data, columns) in images {
            // Image 1 has the orientation 0.5 and the scale 1, image 2 has 1 and 2, and so on.
            let more: Vec<u8> = (more(0.5 * id as f32).iter())
                .flat_map(|value| value.to_le_bytes())
                .collect();
            let rows = data.chunks_exact(4 * columns as usize);
            let data: Vec<u8> = rows.flat_map(|row| [&row[..8], &more].concat()).collect();
            let change = "UPDATE keypoints SET data = ?1, cols = ?2 WHERE image_id = ?3";
            let columns = (2 + more.len() / 4) as i64;
            (connection.execute(change, (data, columns, id))).unwrap();
        }
        let ids = frames.map(|frame| {
            let name = ["db/one.png", "db/two.png", "query/one.png"][frame as usize];
            let sql = "SELECT image_id FROM images WHERE name = ?1";
            let id: i64 = connection.query_row(sql, [name], |row| row.get(0)).unwrap();
            0.5 * id as f32
        });
        drop(connection);
        let files = MatchFiles::open(&[database], &sequence, &ReadOptions::default()).unwrap();
        let found = files.matches(frames[0], frames[1]).unwrap().unwrap();
        let points = found.points;
        let expected = (ids[1] - ids[0], (ids[1] / ids[0]).ln());
        (points.turns, points.growths, expected)
    };
    for frames in [[0, 1], [0, 2], [1, 2], [1, 0], [2, 0], [2, 1]] {
        for more in [&four as &dyn Fn(f32) -> Vec<f32>, &six] {
            let (turns, growths, expected) = changes(frames, more);
            let turns = turns.expect("orientations are there");
            assert!(turns.len() >= 2);
            for turn in turns {
                let off = (turn - expected.0).rem_euclid(std::f32::consts::TAU);
                assert!(
                    off.min(std::f32::consts::TAU - off) < 1e-5,
                    "{frames:?}: {turn} {expected:?}"
                );
            }
            for growth in growths.expect("scales are there") {
                assert!((growth - expected.1).abs() < 1e-5, "{growth} {expected:?}");
            }
        }
        let (turns, growths, _) = changes(frames, &|_| vec![2.0, f32::NAN]);
        assert!(turns.is_none() && growths.is_some());
        let (turns, growths, _) = changes(frames, &|angle| vec![0.0, angle]);
        assert!(turns.is_some() && growths.is_none());
        let (turns, growths, _) = changes(frames, &|_| Vec::new());
        assert!(turns.is_none() && growths.is_none());
    }
}

#[test]
fn blobs_that_would_fill_the_memory_are_refused_before_they_are_read() {
    let refused = |change: &str| {
        let (folder, sequence) = dataset();
        let (database, connection) = database(&folder);
        connection.execute(change, []).unwrap();
        drop(connection);
        let error = MatchFiles::open(&[database], &sequence, &ReadOptions::default()).err();
        error.unwrap().to_string()
    };
    let message = refused("UPDATE matches SET rows = 25000000, data = zeroblob(200000000)");
    assert!(message.contains("too big"), "{message}");
    let message = refused("UPDATE keypoints SET rows = 25000000, data = zeroblob(200000000)");
    assert!(message.contains("too big"), "{message}");
    let message = refused("UPDATE matches SET rows = 5000001, data = zeroblob(40000008)");
    assert!(message.contains("5000001 matches"), "{message}");
}

#[test]
fn an_image_with_matches_and_no_keypoints_is_named() {
    let (folder, sequence) = dataset();
    let (database, _) = database(&folder);
    let two = "(SELECT image_id FROM images WHERE name = 'db/two.png')";
    let open = |change: String| {
        let connection = Connection::open(&database).unwrap();
        connection.execute_batch(&change).unwrap();
        drop(connection);
        MatchFiles::open(
            slice::from_ref(&database),
            &sequence,
            &ReadOptions::default(),
        )
    };
    for change in [
        format!("UPDATE keypoints SET rows = 0, data = zeroblob(0) WHERE image_id = {two}"),
        format!("DELETE FROM keypoints WHERE image_id = {two}"),
    ] {
        let message = open(change).err().unwrap().to_string();
        let parts = [
            "db/two.png: the image has matches, and no keypoints",
            "let COLMAP extract its features",
        ];
        assert!(parts.iter().all(|part| message.contains(part)), "{message}");
    }
    // Without matches it needs none.
    let files = open("UPDATE matches SET rows = 0, data = NULL".into());
    assert_eq!(files.unwrap().survey().matches, 0);
}

/// A page of the tree of a table: five hundred pages below it, all of them `child`.
fn interior_page(child: u32) -> Vec<u8> {
    const CELLS: u16 = 500;
    const CELL: u16 = 5;
    let cells = PAGE as u16 - CELL * CELLS;
    let mut page = vec![5, 0, 0];
    page.extend(CELLS.to_be_bytes());
    page.extend(cells.to_be_bytes());
    page.push(0);
    page.extend(child.to_be_bytes());
    for cell in 0..CELLS {
        page.extend((cells + CELL * cell).to_be_bytes());
    }
    page.resize(cells.into(), 0);
    for _ in 0..CELLS {
        page.extend(child.to_be_bytes());
        page.push(1);
    }
    page
}

const PAGE: usize = 4096;

#[test]
fn tables_that_compute_are_refused() {
    for images in [
        "CREATE TABLE images (image_id INTEGER PRIMARY KEY, camera_id INTEGER,
            name TEXT AS (hex(zeroblob(image_id))))",
        "CREATE TABLE images (image_id INTEGER PRIMARY KEY, camera_id INTEGER,
            name TEXT AS (hex(zeroblob(image_id))) STORED)",
        "CREATE VIRTUAL TABLE images USING fts5 (image_id, camera_id, name)",
        "CREATE VIEW images AS SELECT 1 AS image_id, 1 AS camera_id, 'a' AS name",
    ] {
        let (folder, sequence) = dataset();
        let (path, connection) = database(&folder);
        (connection.execute_batch(&format!("DROP TABLE images; {images}"))).unwrap();
        drop(connection);
        let error = MatchFiles::open(&[path], &sequence, &ReadOptions::default()).err();
        let message = error.expect("no table of images").to_string();
        assert!(message.contains("it has no table `images`"), "{message}");
    }
}

#[test]
fn rows_without_an_end_are_refused() {
    let (folder, sequence) = dataset();
    let (path, connection) = database(&folder);
    connection
        .execute_batch("PRAGMA page_size = 4096; VACUUM")
        .unwrap();
    let query = "SELECT rootpage FROM sqlite_master WHERE name = 'matches'";
    let root: u32 = connection.query_row(query, [], |row| row.get(0)).unwrap();
    drop(connection);
    let mut file = fs::read(&path).unwrap();
    let root = (root as usize - 1) * PAGE..root as usize * PAGE;
    let leaf = file[root.clone()].to_vec();
    // Four levels, and the rows that were there below them.
    let first = (file.len() / PAGE) as u32 + 1;
    for level in 1..4 {
        file.extend(interior_page(first + level));
    }
    file.extend(leaf);
    file[root].copy_from_slice(&interior_page(first));
    let pages = (file.len() / PAGE) as u32;
    file[28..32].copy_from_slice(&pages.to_be_bytes());
    fs::write(&path, file).unwrap();
    let opened = MatchFiles::open(&[path], &sequence, &ReadOptions::default());
    let message = opened.err().unwrap().to_string();
    assert!(
        message.contains("more rows than the file has bytes for"),
        "{message}"
    );
}

#[test]
fn an_image_has_no_longer_name_than_a_path() {
    let (folder, sequence) = dataset();
    let (database, _) = database(&folder);
    let open = |bytes: usize| {
        let connection = Connection::open(&database).unwrap();
        let name =
            "UPDATE images SET name = ?1 WHERE image_id = (SELECT max(image_id) FROM images)";
        (connection.execute(name, ["n".repeat(bytes)])).unwrap();
        drop(connection);
        let files = [database.clone()];
        MatchFiles::open(&files, &sequence, &ReadOptions::default()).err()
    };
    let told = |bytes| open(bytes).map_or_else(String::new, |error| error.to_string());
    assert!(!told(4096).contains("are the most"));
    let error = told(4097);
    let file = database.file_name().unwrap().to_str().unwrap();
    let parts = [file, "has 4097 bytes", "name images by their paths"];
    assert!(parts.iter().all(|part| error.contains(part)), "{error}");
}

#[test]
fn pairs_share_the_names_of_their_images() {
    let (folder, sequence) = dataset();
    let (database, _) = database(&folder);
    let probe = Probe::new(&[database], &sequence.name).unwrap();
    let contents = super::open(probe, &ReadOptions::default()).unwrap();
    let names = contents.pairs.iter().flat_map(|pair| match pair {
        PairName::Two(a, b) => [a, b],
        other => panic!("{other} has no two names"),
    });
    let names: Vec<&Arc<str>> = names.collect();
    let copies: HashSet<_> = names.iter().map(|name| Arc::as_ptr(name)).collect();
    let images: HashSet<&str> = names.iter().map(|name| &***name).collect();
    assert!(names.len() > images.len());
    assert_eq!(copies.len(), images.len());
}
