//! `colmap`: a COLMAP database, SQLite.
//!
//! | table | what is read and written |
//! | --- | --- |
//! | `images` | `image_id`, `name`, `camera_id` |
//! | `keypoints` | by `image_id`: `rows`, `cols` and a blob of float32, whose first columns are x, y; then scale and orientation (4 columns) or the affine shape (6), of which the orientation is read |
//! | `matches` | by `pair_id`: a blob of uint32, `rows` x 2 indices of keypoints |
//! | `two_view_geometries` | the same of the matches that COLMAP verified, with F, E, H, and the pose |
//!
//! `pair_id = 2147483647 * id_1 + id_2` with `id_1 < id_2`. There are no scores. The first pixel's centre
//! is at 0.5. (COLMAP, "Database Format"; the documentation of its `Database` class.)

#[cfg(test)]
mod tests;
mod write;

use std::collections::BTreeMap;
use std::f64::consts::TAU;
use std::fs;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, Mutex};

use rusqlite::limits::Limit;
use rusqlite::{Connection, ErrorCode, OpenFlags, OptionalExtension};

use super::names::PairName;
use super::probe::{Content, Probe};
use super::sparse::columns;
use super::{Contents, ExchangeError, Format, Rating, RawMatches, ReadOptions, Source, bounded};
use crate::arrays::{Array, Element, Kind};
use crate::files::open_file;
use crate::front_door::VERIFIED;
use crate::matchers::MAX_MATCHES;

pub(super) const COLMAP: Format = Format {
    id: "colmap",
    layout: "database.db with images, keypoints and matches, or verified ones in two_view_geometries",
    pixel_center: Some(CENTER),
    resized: false,
    recognises: |probe| matches!(probe.content, Content::Sqlite),
    open,
    write: Some(write::write),
};

const CENTER: f64 = 0.5;
/// The most bytes of a blob: so many keypoints of six columns as there may be matches.
const MAX_BLOB: i32 = (6 * 4 * MAX_MATCHES) as i32;
/// The most bytes of the name of an image. No system opens a longer path, and each pair has the names of both images.
const MAX_NAME: usize = 4096;
/// COLMAP's factor between the two image ids of a pair.
const MAX_IMAGES: i64 = 2_147_483_647;

fn open(probe: Probe, options: &ReadOptions) -> Result<Contents, ExchangeError> {
    let [path] = &probe.files[..] else {
        let what = format!("{} databases where there is to be one", probe.files.len());
        return Err(ExchangeError::new(&probe.files[0], what, "name one"));
    };
    let file = open_file(path).and_then(|file| file.metadata());
    let bytes = (file.map_err(|error| ExchangeError::unreadable(path, error))?).len();
    let steps = Arc::new(Steps::default());
    let database = Database {
        path: path.clone(),
        connection: Mutex::new(connect(path, bytes, &steps)?),
        bytes,
        steps,
        table: if options.verified {
            "two_view_geometries"
        } else {
            "matches"
        },
        images: BTreeMap::new(),
        pairs: Vec::new(),
    };
    let images = database.images()?;
    let pairs = database.pair_ids()?;
    if pairs.is_empty() {
        let what = format!("its table `{}` is empty", database.table);
        let remedy = if options.verified {
            format!("leave {VERIFIED} out, or let COLMAP verify the matches first")
        } else {
            "match the images first".to_owned()
        };
        return Err(ExchangeError::new(path, what, remedy));
    }
    let names = (pairs.iter())
        .map(|&[first, second]| {
            let name = |id| {
                images.get(&id).cloned().ok_or_else(|| {
                    database.damaged(format!("a pair names image {id}, which is not there"))
                })
            };
            Ok(PairName::Two(name(first)?, name(second)?))
        })
        .collect::<Result<_, ExchangeError>>()?;
    Ok(Contents {
        pairs: names,
        source: Box::new(Database {
            images,
            pairs,
            ..database
        }),
    })
}

struct Database {
    path: PathBuf,
    connection: Mutex<Connection>,
    /// Its size.
    bytes: u64,
    steps: Arc<Steps>,
    /// Where matches are read from.
    table: &'static str,
    /// Names of the images by id.
    images: BTreeMap<i64, Arc<str>>,
    /// Ids of both images.
    pairs: Vec<[i64; 2]>,
}

/// Steps of SQLite between two looks at how many a statement took.
const STEPS_AT_ONCE: i32 = 10_000;
/// Steps of a statement on an empty file.
const FEWEST_STEPS: u64 = 1_000_000;

/// How many steps the statement in progress has taken. A row is some 4 steps and at least 16 bytes. But pages of a
/// hostile file can name each other in a circle, so that its rows have no end.
#[derive(Debug, Default)]
struct Steps(AtomicU64);

/// Opens the database for reading and nothing else: nothing is created beside it. A statement ends with an error if it
/// takes more steps than a file of so many bytes explains.
fn connect(path: &Path, bytes: u64, steps: &Arc<Steps>) -> Result<Connection, ExchangeError> {
    for log in ["-wal", "-journal"] {
        let mut beside = path.as_os_str().to_owned();
        beside.push(log);
        if fs::metadata(&beside).is_ok_and(|beside| beside.len() > 0) {
            return Err(ExchangeError::new(
                path,
                format!("changes are not finished: they stand in the file `{log}` beside it"),
                "close the program that writes it, or open it once with COLMAP",
            ));
        }
    }
    let path_in_uri: String = (path.as_os_str().as_encoded_bytes().iter())
        .map(|&byte| match byte {
            b'/' | b'.' | b'-' | b'_' => char::from(byte).to_string(),
            _ if byte.is_ascii_alphanumeric() => char::from(byte).to_string(),
            _ => format!("%{byte:02x}"),
        })
        .collect();
    let flags = OpenFlags::SQLITE_OPEN_READ_ONLY | OpenFlags::SQLITE_OPEN_URI;
    let mut connection =
        Connection::open_with_flags(format!("file:{path_in_uri}?immutable=1"), flags)
            .map_err(|error| ExchangeError::unreadable(path, error))?;
    // The whole of a blob is in memory, and more than once.
    connection
        .set_limit(Limit::SQLITE_LIMIT_LENGTH, MAX_BLOB)
        .map_err(|error| ExchangeError::unreadable(path, error))?;
    let (steps, most) = (Arc::clone(steps), FEWEST_STEPS + bytes);
    let is_enough = move || {
        let before = steps.0.fetch_add(STEPS_AT_ONCE as u64, Ordering::Relaxed);
        before > most
    };
    connection
        .progress_handler(STEPS_AT_ONCE, Some(is_enough))
        .map_err(|error| ExchangeError::unreadable(path, error))?;
    // A view, a virtual table and a column that is generated could compute without end: only what is stored is read.
    for table in ["images", "keypoints", "matches", "two_view_geometries"] {
        let is_stored: bool = connection
            .query_row(
                "SELECT EXISTS (SELECT 1 FROM pragma_table_list WHERE name = ?1 AND schema = 'main' AND type = 'table')
                    AND NOT EXISTS (SELECT 1 FROM pragma_table_xinfo(?1) WHERE hidden <> 0)",
                [table],
                |row| row.get(0),
            )
            .map_err(|error| ExchangeError::damaged(path, error))?;
        if !is_stored {
            let what = format!("it has no table `{table}`");
            return Err(ExchangeError::new(path, what, "name a database of COLMAP"));
        }
    }
    Ok(connection)
}

impl Database {
    /// Names of the images by id.
    fn images(&self) -> Result<BTreeMap<i64, Arc<str>>, ExchangeError> {
        let mut left = self.bytes;
        let images = self.query("SELECT image_id, name FROM images", |row| {
            let (id, name): (i64, Arc<str>) = (row.get(0)?, row.get(1)?);
            let bytes = name.len() as u64;
            // Names can share bytes of a hostile file.
            let fits = left >= bytes;
            left = left.saturating_sub(bytes);
            Ok(fits.then_some((id, name)))
        });
        let images: Option<BTreeMap<i64, Arc<str>>> = images?;
        let images =
            images.ok_or_else(|| self.damaged("its images have longer names than it has bytes"))?;
        match images.iter().find(|(_, name)| name.len() > MAX_NAME) {
            Some((id, name)) => Err(ExchangeError::new(
                &self.path,
                format!(
                    "the name of image {id} has {} bytes, where {MAX_NAME} are the most",
                    name.len()
                ),
                "name images by their paths",
            )),
            None => Ok(images),
        }
    }

    fn pair_ids(&self) -> Result<Vec<[i64; 2]>, ExchangeError> {
        let sql = format!("SELECT pair_id FROM {} ORDER BY pair_id", self.table);
        self.query(&sql, |row| {
            let id: i64 = row.get(0)?;
            Ok([id.div_euclid(MAX_IMAGES), id.rem_euclid(MAX_IMAGES)])
        })
    }

    fn query<T, C: FromIterator<T>>(
        &self,
        sql: &str,
        read: impl FnMut(&rusqlite::Row<'_>) -> rusqlite::Result<T>,
    ) -> Result<C, ExchangeError> {
        let connection = self.connection.lock().expect("no thread panics with it");
        self.steps.0.store(0, Ordering::Relaxed);
        let all =
            || -> rusqlite::Result<C> { connection.prepare(sql)?.query_map([], read)?.collect() };
        all().map_err(|error| self.damaged(reason(&error)))
    }

    /// The blob in the row `id` of a `table`, as an array of 4-byte elements; empty where there is
    /// no row, since COLMAP leaves out what is empty.
    fn blob(&self, table: &str, key: &str, id: i64, kind: Kind) -> Result<Array, ExchangeError> {
        let place = || format!("{table} of {key} {id}");
        let connection = self.connection.lock().expect("no thread panics with it");
        self.steps.0.store(0, Ordering::Relaxed);
        let sql = format!("SELECT rows, cols, data FROM {table} WHERE {key} = ?1");
        let row = (connection.prepare(&sql))
            .and_then(|mut statement| {
                let read = |row: &rusqlite::Row<'_>| {
                    let data: Option<Vec<u8>> = row.get(2)?;
                    let [rows, columns]: [u32; 2] = [row.get(0)?, row.get(1)?];
                    Ok((rows as usize, columns as usize, data.unwrap_or_default()))
                };
                statement.query_row([id], read).optional()
            })
            .map_err(|error| self.damaged(reason(&error)).at(place()))?;
        let (rows, columns, data): (usize, usize, Vec<u8>) = row.unwrap_or_default();
        let element = Element::new(kind, 4, false).expect("4 bytes exist for all kinds");
        Array::new(vec![rows, columns], element, data)
            .map_err(|what| self.damaged(what).at(place()))
    }

    /// The error for an image that has matches and no keypoints.
    fn without_keypoints(&self, id: i64) -> ExchangeError {
        ExchangeError::new(
            &self.path,
            "the image has matches, and no keypoints that they could be of",
            "let COLMAP extract its features and match it again",
        )
        .at(format!("image {id}, {}", self.images[&id]))
    }

    fn damaged(&self, what: impl std::fmt::Display) -> ExchangeError {
        ExchangeError::damaged(&self.path, what)
    }
}

/// Why a statement failed.
fn reason(error: &rusqlite::Error) -> String {
    match error.sqlite_error_code() {
        Some(ErrorCode::OperationInterrupted) => {
            "a table has more rows than the file has bytes for".to_owned()
        }
        _ => error.to_string(),
    }
}

impl Source for Database {
    fn file(&self, _: usize) -> &Path {
        &self.path
    }

    fn read(&self, index: usize) -> Result<RawMatches, ExchangeError> {
        let ids = self.pairs[index];
        let [a, b] = ids.map(|id| self.blob("keypoints", "image_id", id, Kind::Float));
        let (a, b) = (a?, b?);
        let pair_id = MAX_IMAGES * ids[0] + ids[1];
        let indices = self.blob(self.table, "pair_id", pair_id, Kind::Unsigned)?;
        let mut images = ids.into_iter().zip([&a, &b]);
        if indices.len() > 0
            && let Some((id, _)) = images.find(|(_, keypoints)| keypoints.len() == 0)
        {
            return Err(self.without_keypoints(id));
        }
        joined(&a, &b, &indices).map_err(|what| self.damaged(what))
    }
}

fn joined(a: &Array, b: &Array, indices: &Array) -> Result<RawMatches, String> {
    let (columns_a, columns_b) = (columns(a)?, columns(b)?);
    let counts = [a.len() / columns_a, b.len() / columns_b];
    let mut raw = RawMatches {
        a: Vec::new(),
        b: Vec::new(),
        turns: None,
        growths: None,
        rating: Rating::None,
        element: Element::new(Kind::Float, 4, false).expect("float32 exists"),
        keypoints: Some(counts),
    };
    let index = |place: usize, end: usize| {
        indices
            .index(place, end)?
            .ok_or_else(|| format!("entry {place} is -1"))
    };
    let rows = bounded(indices.rows(2)?)?;
    let (mut turns, mut growths) = (Vec::new(), Vec::new());
    for row in 0..rows {
        let (i, j) = (index(2 * row, counts[0])?, index(2 * row + 1, counts[1])?);
        raw.a.push(a.point(i, columns_a));
        raw.b.push(b.point(j, columns_b));
        let (frame_a, frame_b) = (frame(a, i, columns_a), frame(b, j, columns_b));
        turns.push(turn(frame_a, frame_b));
        growths.push(growth(frame_a, frame_b));
    }
    raw.turns = turns.into_iter().collect();
    raw.growths = growths.into_iter().collect();
    Ok(raw)
}

/// Orientation of a keypoint, in radians, and scale, in pixels.
#[derive(Clone, Copy)]
struct Frame {
    orientation: f64,
    scale: f64,
}

/// The frame of a keypoint: the last two of x, y, scale, orientation, or that of the affine shape (x, y, a11, a12,
/// a21, a22): its orientation is that of COLMAP's `FeatureKeypoint::ComputeOrientation`, its scale the root of how much
/// it scales areas. `None` with other columns.
fn frame(keypoints: &Array, row: usize, columns: usize) -> Option<Frame> {
    let at = |column: usize| keypoints.get(row * columns + column);
    let (orientation, scale) = match columns {
        4 => (at(3), at(2)),
        6 => {
            let determinant = at(2) * at(5) - at(3) * at(4);
            (libm::atan2(at(4), at(2)), determinant.abs().sqrt())
        }
        _ => return None,
    };
    Some(Frame { orientation, scale })
}

/// From one orientation to the other, in radians from 0 to 2 pi; `None` where one is unknown or not finite.
fn turn(a: Option<Frame>, b: Option<Frame>) -> Option<f32> {
    let turn = (b?.orientation - a?.orientation).rem_euclid(TAU);
    turn.is_finite().then_some(turn as f32)
}

/// The logarithm of the ratio of the scales; `None` where one is unknown, or it is not finite.
fn growth(a: Option<Frame>, b: Option<Frame>) -> Option<f32> {
    let growth = libm::log(b?.scale / a?.scale) as f32;
    growth.is_finite().then_some(growth)
}
