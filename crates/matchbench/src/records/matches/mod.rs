//! Selected matches on disk: `matches/<dataset>/<matcher>.bin` in the folder of the run, one entry
//! for each pair and repetition, only ever appended to.
//!
//! Estimators start from these matches, so another estimator that is added later costs only itself (and
//! features from the cache, where depth or a homography judges keypoints). A report draws them. An entry is
//! appended before the records that are computed from it.
//!
//! With [`KeepMatches::Inliers`] only inliers are kept, in `inliers/<dataset>/<matcher>+<estimator>.bin`,
//! for the pairs with a pose. No other estimator starts from them, since it must not start from what one
//! estimator has chosen.
//!
//! All numbers are little-endian. The file begins with `mbmatch1`; an entry is
//!
//! | bytes | what |
//! | --- | --- |
//! | 4 × 3 | frames a and b, repetition |
//! | 4 × 3 | features of a and of b, matches after the search |
//! | 4 | number of matches, plus 2^31 where they have turns, plus 2^30 where they have growths; or 2^32 - 1: those of the repetition before |
//! | 20 each | x and y in a, x and y in b (pixels), ambiguity |
//! | 4 each | where there are turns: by how much the keypoint of b is turned against that of a (radians) |
//! | 4 each | where there are growths: logarithm of how many times as large the keypoint of b is as that of a |
//! | 8 | the beginning of the BLAKE3 hash of all this |
//!
//! A process that is killed leaves at most one entry without its end, which is cut off by whoever
//! appends next.

#[cfg(test)]
mod tests;

use std::collections::BTreeMap;
use std::io::{self, BufReader, Read, Seek, SeekFrom};
use std::path::{Path, PathBuf};

use matchbench_vision::geometry::MatchedPoints;
use nalgebra::Point2;
use serde::{Deserialize, Serialize};

use super::{Counts, StoreError};
use crate::files::{Appender, open_file};
use crate::matchers::MAX_MATCHES;

/// First bytes of every file.
pub(super) const MAGIC: [u8; 8] = *b"mbmatch1";
/// Number of matches of an entry that repeats the one before.
const AS_BEFORE: u32 = u32::MAX;
pub(super) const HEADER: usize = 4 * 7;
const MATCH: usize = 4 * 5;
/// Set in the number of matches of an entry whose matches have turns, and of one whose matches have growths.
const WITH_TURNS: u32 = 1 << 31;
const WITH_GROWTHS: u32 = 1 << 30;
/// Bytes of a turn, and of a growth.
const COLUMN: usize = 4;
pub(super) const CHECKSUM: usize = 8;

/// Which matches of a run stay on disk.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum KeepMatches {
    /// All that were selected: other estimators start from them, reports draw them.
    #[default]
    All,
    /// Those that agree with the pose of each estimator; reports draw them.
    Inliers,
    /// None.
    None,
}

/// The matches of a pair that are left after the selection, as the estimators see them.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct SelectedMatches {
    /// Numbers of features and matches at each stage.
    pub counts: Counts,
    /// The matches, their positions rounded to the single precision of the file.
    pub points: MatchedPoints,
}

impl SelectedMatches {
    /// These matches, with positions as the file keeps them: a run that is resumed from the file must
    /// start from the same numbers.
    pub fn new(counts: Counts, points: &MatchedPoints) -> Self {
        let round = |points: &[Point2<f64>]| {
            (points.iter())
                .map(|point| point.cast::<f32>().cast())
                .collect()
        };
        Self {
            counts,
            points: MatchedPoints::new(
                round(&points.a),
                round(&points.b),
                points.ambiguity.clone(),
            )
            .with_turns(points.turns.clone())
            .with_growths(points.growths.clone()),
        }
    }

    /// Those with these indices; what is none is left out.
    pub(crate) fn of_indices(&self, indices: &[u32]) -> Self {
        let count = self.points.len();
        let is_one = |index: &u32| (*index as usize) < count;
        let indices: Vec<u32> = indices.iter().copied().filter(is_one).collect();
        Self {
            counts: Counts {
                selected: u32::try_from(indices.len()).unwrap_or(u32::MAX),
                ..self.counts
            },
            points: self.points.chosen(&indices),
        }
    }
}

/// Whose matches: frames a and b, and the repetition.
pub type MatchesKey = (u32, u32, u32);

/// The matches of one matcher on one dataset.
#[derive(Debug)]
pub struct MatchesFile {
    path: PathBuf,
    entries: BTreeMap<MatchesKey, Entry>,
    /// Where the last whole entry ends.
    end: u64,
    writer: Option<Appender>,
    /// The pair whose entries were appended last, and where they are: what is appended is not looked for
    /// later, so that a long run needs no more memory than a short one.
    last: ((u32, u32), BTreeMap<u32, u64>),
}

/// An entry that was there when the file was opened.
#[derive(Clone, Copy, Debug)]
struct Entry {
    /// Where it begins; if it repeats another, where that does.
    start: u64,
    counts: Counts,
}

/// The folder of matches within the folder of a run.
pub(super) const FOLDER: &str = "matches";
/// The folder of inliers within it.
pub(super) const INLIERS: &str = "inliers";

/// Where the matches of one dataset and matcher stand in the folder of a `run`.
pub fn path(run: &Path, dataset: &str, matcher: &str) -> PathBuf {
    run.join(FOLDER)
        .join(dataset)
        .join(format!("{matcher}.bin"))
}

/// Where the inliers of one dataset, matcher and estimator stand in the folder of a `run`.
pub fn inliers_path(run: &Path, dataset: &str, matcher: &str, estimator: &str) -> PathBuf {
    run.join(INLIERS)
        .join(dataset)
        .join(format!("{matcher}+{estimator}.bin"))
}

impl MatchesFile {
    /// What is in a file; one that does not exist has nothing. Safe while another process appends.
    ///
    /// # Errors
    /// If the file cannot be read, or is none of these.
    pub fn open(path: &Path) -> Result<Self, StoreError> {
        let mut this = Self {
            path: path.into(),
            entries: BTreeMap::new(),
            end: 0,
            writer: None,
            last: Default::default(),
        };
        let file = match open_file(path) {
            Err(error) if error.kind() == io::ErrorKind::NotFound => return Ok(this),
            file => file.map_err(StoreError::io("open", path))?,
        };
        let length = (file.metadata())
            .map_err(StoreError::io("read", path))?
            .len();
        if length >= MAGIC.len() as u64 {
            this.index(&mut BufReader::new(file), length)?;
        }
        Ok(this)
    }

    fn index(&mut self, file: &mut (impl Read + Seek), length: u64) -> Result<(), StoreError> {
        let mut magic = [0; MAGIC.len()];
        (file.read_exact(&mut magic)).map_err(StoreError::io("read", &self.path))?;
        if magic != MAGIC {
            return Err(self.damaged("it is no file of matches of this version"));
        }
        self.end = MAGIC.len() as u64;
        let mut header = [0; HEADER];
        while length - self.end >= (HEADER + CHECKSUM) as u64 {
            (file.seek(SeekFrom::Start(self.end)))
                .and_then(|_| file.read_exact(&mut header))
                .map_err(StoreError::io("read", &self.path))?;
            let [a, b, repetition, .., count] = numbers(&header);
            if let Some(matches) = too_many(&header) {
                return Err(self.damaged(&format!("an entry says that it has {matches} matches")));
            }
            let bytes = entry_length(count) as u64;
            if length - self.end < bytes {
                break;
            }
            let entry = if count == AS_BEFORE {
                let before = (repetition.checked_sub(1))
                    .and_then(|before| self.entries.get(&(a, b, before)).copied());
                before.ok_or_else(|| self.damaged("an entry repeats one that is not there"))?
            } else {
                Entry {
                    start: self.end,
                    counts: counts(&header),
                }
            };
            self.entries.insert((a, b, repetition), entry);
            self.end += bytes;
        }
        Ok(())
    }

    /// Whether these matches were there when the file was opened, or are of the pair that was appended to
    /// it last.
    pub fn contains(&self, key: MatchesKey) -> bool {
        self.place(key).is_some()
    }

    fn place(&self, (a, b, repetition): MatchesKey) -> Option<u64> {
        let (pair, last) = &self.last;
        let appended = last.get(&repetition).filter(|_| *pair == (a, b));
        let entry = || Some(self.entries.get(&(a, b, repetition))?.start);
        appended.copied().or_else(entry)
    }

    /// The numbers of features and matches of an entry that was there when the file was opened.
    pub(crate) fn counts(&self, key: MatchesKey) -> Option<Counts> {
        Some(self.entries.get(&key)?.counts)
    }

    /// Takes an entry with these `counts` for one that is not there: its matches are not those that records are of. What
    /// is appended takes its place.
    pub(crate) fn forget(&mut self, key: MatchesKey, counts: Counts) {
        if self.counts(key) == Some(counts) {
            self.entries.remove(&key);
        }
    }

    /// The matches of a pair, if they are there. May be called from many threads.
    ///
    /// # Errors
    /// If the file cannot be read, or the entry is damaged.
    pub fn read(&self, key: MatchesKey) -> Result<Option<SelectedMatches>, StoreError> {
        let Some(start) = self.place(key) else {
            return Ok(None);
        };
        let io = StoreError::io("read", &self.path);
        let mut file = open_file(&self.path).map_err(io)?;
        file.seek(SeekFrom::Start(start)).map_err(io)?;
        let mut entry = vec![0; HEADER];
        file.read_exact(&mut entry).map_err(io)?;
        let [.., count] = numbers(entry.as_slice().try_into().expect("as long as a header"));
        let length = entry_length(count);
        (file.take((length - HEADER) as u64).read_to_end(&mut entry)).map_err(io)?;
        let whole = entry.len() == length;
        if !whole || !is_sound(&entry) {
            return Err(self.damaged("its checksum is not that of its content"));
        }
        let (a, b, repetition) = key;
        from_bytes(&entry).map(Some).map_err(|what| {
            self.damaged(&format!(
                "the matches of {a} {b} in repetition {repetition}: {what}"
            ))
        })
    }

    /// Appends the matches of a pair; when this returns, killing the process cannot lose them.
    /// Those that are there already are not written again.
    ///
    /// # Errors
    /// If they cannot be written (a full disk).
    pub fn append(&mut self, key: MatchesKey, matches: &SelectedMatches) -> Result<(), StoreError> {
        if self.contains(key) {
            return Ok(());
        }
        let (a, b, repetition) = key;
        let before = repetition.checked_sub(1).map(|before| (a, b, before));
        let same = match before {
            Some(before) if self.read(before)?.as_ref() == Some(matches) => self.place(before),
            _ => None,
        };
        let entry = to_bytes(key, matches, same.is_some());
        let start = self.write(&entry)?;
        let (pair, last) = &mut self.last;
        if *pair != (a, b) {
            *pair = (a, b);
            last.clear();
        }
        last.insert(repetition, same.unwrap_or(start));
        Ok(())
    }

    /// Makes what was appended safe from the power supply: to be done before the records are that follow
    /// from it.
    ///
    /// # Errors
    /// If the system cannot.
    pub fn sync(&mut self) -> Result<(), StoreError> {
        let synced = self.writer.as_mut().map_or(Ok(()), Appender::sync);
        synced.map_err(StoreError::io("write", &self.path))
    }

    /// Writes at the end, and says where that was.
    fn write(&mut self, entry: &[u8]) -> Result<u64, StoreError> {
        let io = StoreError::io("append to", &self.path);
        if self.writer.is_none() {
            self.writer = Some(Appender::open(&self.path, Some(self.end)).map_err(io)?);
        }
        let file = self.writer.as_mut().expect("it was just made");
        if self.end == 0 {
            file.append(&MAGIC).map_err(io)?;
            self.end = MAGIC.len() as u64;
        }
        let start = file.append(entry).map_err(io)?;
        self.end += entry.len() as u64;
        Ok(start)
    }

    fn damaged(&self, reason: &str) -> StoreError {
        StoreError::Matches {
            path: self.path.clone(),
            reason: reason.into(),
        }
    }
}

/// How many matches follow a header with this `count`, and whether they have turns and growths.
fn matches_of(count: u32) -> (usize, [bool; 2]) {
    match count {
        AS_BEFORE => (0, [false; 2]),
        _ => (
            (count & !(WITH_TURNS | WITH_GROWTHS)) as usize,
            [WITH_TURNS, WITH_GROWTHS].map(|bit| count & bit != 0),
        ),
    }
}

fn entry_length(count: u32) -> usize {
    let (matches, columns) = matches_of(count);
    let columns = columns.into_iter().filter(|&is_there| is_there).count();
    HEADER + matches * (MATCH + columns * COLUMN) + CHECKSUM
}

/// The number of matches that an entry with this header has, if they are too many. It is no entry that was torn, for
/// nobody writes so many.
pub(super) fn too_many(header: &[u8; HEADER]) -> Option<usize> {
    let [.., count] = numbers(header);
    Some(matches_of(count).0).filter(|&matches| matches > MAX_MATCHES)
}

/// Whose matches an entry with this header has, and the length of the entry in bytes.
pub(super) fn key_and_length(header: &[u8; HEADER]) -> (MatchesKey, usize) {
    let [a, b, repetition, .., count] = numbers(header);
    ((a, b, repetition), entry_length(count))
}

/// Whether the checksum of a whole entry is that of its content.
pub(super) fn is_sound(entry: &[u8]) -> bool {
    (entry.split_last_chunk::<CHECKSUM>())
        .is_some_and(|(content, stated)| blake3::hash(content).as_bytes()[..CHECKSUM] == *stated)
}

fn numbers(header: &[u8; HEADER]) -> [u32; 7] {
    let mut numbers = [0; 7];
    for (number, bytes) in numbers.iter_mut().zip(header.as_chunks().0) {
        *number = u32::from_le_bytes(*bytes);
    }
    numbers
}

fn to_bytes((a, b, repetition): MatchesKey, matches: &SelectedMatches, same: bool) -> Vec<u8> {
    let counts = matches.counts;
    let points = &matches.points;
    let bit = |column: &Option<Vec<f32>>, bit| if column.is_some() { bit } else { 0 };
    let columns = bit(&points.turns, WITH_TURNS) | bit(&points.growths, WITH_GROWTHS);
    let count = if same {
        AS_BEFORE
    } else {
        counts.selected | columns
    };
    let header = [
        a,
        b,
        repetition,
        counts.features_a,
        counts.features_b,
        counts.putative,
        count,
    ];
    let mut entry = Vec::with_capacity(entry_length(count));
    entry.extend(header.iter().flat_map(|number| number.to_le_bytes()));
    if !same {
        let MatchedPoints {
            a,
            b,
            ambiguity,
            turns,
            growths,
        } = points;
        for ((a, b), &ambiguity) in a.iter().zip(b).zip(ambiguity) {
            let (a, b) = (a.cast::<f32>(), b.cast::<f32>());
            let numbers = [a.x, a.y, b.x, b.y, ambiguity];
            entry.extend(numbers.iter().flat_map(|number| number.to_le_bytes()));
        }
        let columns = turns.iter().chain(growths).flatten();
        entry.extend(columns.flat_map(|value| value.to_le_bytes()));
    }
    let hash = blake3::hash(&entry);
    entry.extend(&hash.as_bytes()[..CHECKSUM]);
    entry
}

/// The counts in the header of an entry that repeats none.
fn counts(header: &[u8; HEADER]) -> Counts {
    let [_, _, _, features_a, features_b, putative, count] = numbers(header);
    Counts {
        features_a,
        features_b,
        putative,
        selected: u32::try_from(matches_of(count).0).unwrap_or(u32::MAX),
    }
}

/// The matches of a whole entry that is [sound](is_sound); or what is wrong with its numbers: whoever forges matches can
/// forge their checksum.
fn from_bytes(entry: &[u8]) -> Result<SelectedMatches, String> {
    let content = &entry[..entry.len() - CHECKSUM];
    let (header, rows) = (content.split_first_chunk()).expect("the caller read a header");
    let counts = counts(header);
    let selected = counts.selected as usize;
    let (_, columns) = matches_of(numbers(header)[6]);
    let (rows, mut rest) = rows.split_at(selected * MATCH);
    let mut points = MatchedPoints::default();
    for (number, row) in rows.as_chunks::<MATCH>().0.iter().enumerate() {
        let at = |index: usize| f32::from_le_bytes(row.as_chunks().0[index]);
        if !(0..4).all(|index| at(index).is_finite()) {
            return Err(format!("match {number} has a position that is not finite"));
        }
        // Of one that is not the nearest it is above 1, and infinite if its second nearest is at no distance.
        if at(4).is_nan() || at(4) < 0.0 {
            return Err(format!("match {number} has the ambiguity {}", at(4)));
        }
        let point = |x: f32, y: f32| Point2::new(x, y).cast();
        points.push(point(at(0), at(1)), point(at(2), at(3)), at(4));
    }
    let mut column = |is_there: bool, name: &str| -> Result<Option<Vec<f32>>, String> {
        if !is_there {
            return Ok(None);
        }
        let (values, after) = rest.split_at(selected * COLUMN);
        rest = after;
        let values = values.as_chunks().0.iter();
        let values: Vec<f32> = values.map(|&bytes| f32::from_le_bytes(bytes)).collect();
        match values.iter().position(|value| !value.is_finite()) {
            Some(number) => Err(format!("match {number} has a {name} that is not finite")),
            None => Ok(Some(values)),
        }
    };
    let (turns, growths) = (column(columns[0], "turn")?, column(columns[1], "growth")?);
    Ok(SelectedMatches {
        counts,
        points: points.with_turns(turns).with_growths(growths),
    })
}
