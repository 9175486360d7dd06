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
    /// Where the entries begin; those that repeat others, where the others do.
    entries: BTreeMap<MatchesKey, u64>,
    /// Where the last whole entry ends.
    end: u64,
    writer: Option<Appender>,
    /// The pair whose entries were appended last, and where they are: what is appended is not looked for
    /// later, so that a long run needs no more memory than a short one.
    last: ((u32, u32), BTreeMap<u32, u64>),
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
            // No entry that was torn, for nobody writes so many.
            let matches = matches_of(count).0;
            if matches > MAX_MATCHES {
                return Err(self.damaged(&format!("an entry says that it has {matches} matches")));
            }
            let bytes = entry_length(count) as u64;
            if length - self.end < bytes {
                break;
            }
            let origin = if count == AS_BEFORE {
                let before = (repetition.checked_sub(1))
                    .and_then(|before| self.entries.get(&(a, b, before)).copied());
                before.ok_or_else(|| self.damaged("an entry repeats one that is not there"))?
            } else {
                self.end
            };
            self.entries.insert((a, b, repetition), origin);
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
        appended
            .or_else(|| self.entries.get(&(a, b, repetition)))
            .copied()
    }

    /// The matches of a pair, if they are there. May be called from many threads.
    ///
    /// # Errors
    /// If the file cannot be read, or the entry is damaged.
    pub fn read(&self, key: MatchesKey) -> Result<Option<SelectedMatches>, StoreError> {
        let Some(start) = self.place(key) else {
            return Ok(None);
        };
        let io = |error| StoreError::io("read", &self.path)(error);
        let mut file = open_file(&self.path).map_err(io)?;
        file.seek(SeekFrom::Start(start)).map_err(io)?;
        let mut entry = vec![0; HEADER];
        file.read_exact(&mut entry).map_err(io)?;
        let [.., count] = numbers(entry.as_slice().try_into().expect("as long as a header"));
        let length = entry_length(count);
        (file.take((length - HEADER) as u64).read_to_end(&mut entry)).map_err(io)?;
        let whole = entry.len() == length;
        (whole.then(|| from_bytes(&entry)).flatten().map(Some))
            .ok_or_else(|| self.damaged("its checksum is not that of its content"))
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
        let io = |error| StoreError::io("append to", &self.path)(error);
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

fn from_bytes(entry: &[u8]) -> Option<SelectedMatches> {
    if !is_sound(entry) {
        return None;
    }
    let content = &entry[..entry.len() - CHECKSUM];
    let (header, rows) = content.split_first_chunk()?;
    let [_, _, _, features_a, features_b, putative, count] = numbers(header);
    let (selected, columns) = matches_of(count);
    let (rows, mut rest) = rows.split_at_checked(selected * MATCH)?;
    let mut points = MatchedPoints::default();
    for row in rows.as_chunks::<MATCH>().0 {
        let at = |index: usize| f32::from_le_bytes(row.as_chunks().0[index]);
        // Whoever forges matches can forge their checksum.
        if !(0..4).all(|index| at(index).is_finite()) {
            return None;
        }
        let point = |x: f32, y: f32| Point2::new(x, y).cast();
        points.push(point(at(0), at(1)), point(at(2), at(3)), at(4));
    }
    let mut column = |is_there: bool| -> Option<Option<Vec<f32>>> {
        if !is_there {
            return Some(None);
        }
        let values = rest.split_off(..selected * COLUMN)?.as_chunks().0.iter();
        Some(Some(
            values.map(|&bytes| f32::from_le_bytes(bytes)).collect(),
        ))
    };
    let (turns, growths) = (column(columns[0])?, column(columns[1])?);
    if !(turns.iter().chain(&growths).flatten()).all(|value| value.is_finite()) {
        return None;
    }
    Some(SelectedMatches {
        counts: Counts {
            features_a,
            features_b,
            putative,
            selected: u32::try_from(selected).ok()?,
        },
        points: points.with_turns(turns).with_growths(growths),
    })
}

#[cfg(test)]
mod tests {
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
    fn a_turn_or_growth_that_is_not_finite_is_damage_whatever_the_checksum() {
        for of in 0..2 {
            let mut forged = grown(turned(3));
            let SelectedMatches { points, .. } = &mut forged;
            let column = [&mut points.turns, &mut points.growths];
            *column[of] = Some(vec![0.0, f32::NAN, 0.0]);
            let entry = to_bytes((0, 1, 0), &forged, false);
            assert!(is_sound(&entry) && from_bytes(&entry).is_none());
        }
        assert!(from_bytes(&to_bytes((0, 1, 0), &grown(turned(3)), false)).is_some());
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
}
