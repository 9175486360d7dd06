//! The matches of one shard, read entry by entry as they are asked for.
//!
//! Entries stand in the order of the pairs, except those of pairs that failed at first and were done again
//! later. So the next entry is mostly the one that is asked for. At the first one that is not, the whole
//! file is indexed. It is not for those that are mostly not there at all, of tasks that failed. A shard that was killed
//! while it tried these again may have some behind all others.

use std::collections::{BTreeMap, BTreeSet};
use std::fs::File;
use std::io::{self, BufReader, Read, Seek, SeekFrom};
use std::path::PathBuf;

use super::super::StoreError;
use super::super::matches::{
    CHECKSUM, HEADER, MAGIC, MatchesKey, is_sound, key_and_length, too_many,
};
use super::record_file::open_at;

/// One file of matches and how far it was read. It can be closed in between.
pub(super) struct EntryFile {
    path: PathBuf,
    reader: Option<BufReader<File>>,
    /// Where the reader stands.
    at: u64,
    length: Option<u64>,
    /// Where the next entry begins.
    next: u64,
    peeked: Option<(MatchesKey, Vec<u8>)>,
    index: Option<BTreeMap<MatchesKey, u64>>,
    /// Entries that were asked for, were not the next ones, and may stand at the end.
    unlikely: BTreeSet<MatchesKey>,
}

impl EntryFile {
    /// The beginning of a file.
    pub(super) fn new(path: PathBuf) -> Self {
        Self {
            path,
            reader: None,
            at: 0,
            length: None,
            next: MAGIC.len() as u64,
            peeked: None,
            index: None,
            unlikely: BTreeSet::new(),
        }
    }

    /// The bytes of the entry of `key`, if there is one. Keys are asked for in the order of the pairs, each
    /// once; `is_likely` says whether it would be odd if there were none.
    ///
    /// # Errors
    /// If the file cannot be read, or is damaged.
    pub(super) fn take(
        &mut self,
        key: MatchesKey,
        is_likely: bool,
    ) -> Result<Option<Vec<u8>>, StoreError> {
        if self.index.is_none() {
            if self.peeked.is_none() {
                self.peeked = self.entry(self.next)?;
            }
            if let Some((_, entry)) = self.peeked.take_if(|(peeked, _)| *peeked == key) {
                self.next += entry.len() as u64;
                return Ok(Some(entry));
            }
            if !is_likely {
                self.unlikely.insert(key);
                return Ok(None);
            }
            self.index = Some(self.keys()?);
        }
        let start = (self.index.as_ref()).and_then(|index| index.get(&key).copied());
        match start {
            None => Ok(None),
            Some(start) => Ok(self.entry(start)?.map(|(_, entry)| entry)),
        }
    }

    /// Whether there is an entry behind those that were taken that was not asked for.
    ///
    /// # Errors
    /// As [`EntryFile::take`].
    pub(super) fn has_more(&mut self) -> Result<bool, StoreError> {
        if self.index.is_some() {
            return Ok(false);
        }
        self.peeked = None;
        while let Some((key, entry)) = self.entry(self.next)? {
            if !self.unlikely.remove(&key) {
                return Ok(true);
            }
            self.next += entry.len() as u64;
        }
        Ok(false)
    }

    /// Closes the file; it is opened again where it was left.
    pub(super) fn close(&mut self) {
        self.reader = None;
    }

    /// Where each entry begins.
    fn keys(&mut self) -> Result<BTreeMap<MatchesKey, u64>, StoreError> {
        let (mut keys, mut start) = (BTreeMap::new(), MAGIC.len() as u64);
        while let Some((key, header)) = self.header(start)? {
            let (_, length) = key_and_length(&header);
            keys.entry(key).or_insert(start);
            start += length as u64;
        }
        Ok(keys)
    }

    /// The whole entry that begins at `start`, if there is one.
    fn entry(&mut self, start: u64) -> Result<Option<(MatchesKey, Vec<u8>)>, StoreError> {
        let Some((key, header)) = self.header(start)? else {
            return Ok(None);
        };
        let (_, length) = key_and_length(&header);
        let mut entry = header.to_vec();
        entry.resize(length, 0);
        self.read(&mut entry[HEADER..])?;
        if !is_sound(&entry) {
            return Err(StoreError::Matches {
                path: self.path.clone(),
                reason: format!(
                    "the checksum of the matches of {} {} is wrong",
                    key.0, key.1
                ),
            });
        }
        Ok(Some((key, entry)))
    }

    /// The header of the entry that begins at `start`, if the whole entry is there.
    fn header(&mut self, start: u64) -> Result<Option<(MatchesKey, [u8; HEADER])>, StoreError> {
        let length = self.length()?;
        if start.saturating_add((HEADER + CHECKSUM) as u64) > length {
            return Ok(None);
        }
        self.stand_at(start)?;
        let mut header = [0; HEADER];
        self.read(&mut header)?;
        if let Some(matches) = too_many(&header) {
            return Err(StoreError::Matches {
                path: self.path.clone(),
                reason: format!("an entry says that it has {matches} matches"),
            });
        }
        let (key, bytes) = key_and_length(&header);
        Ok((start + bytes as u64 <= length).then_some((key, header)))
    }

    /// The length of the file; 0 if there is none.
    fn length(&mut self) -> Result<u64, StoreError> {
        if let Some(length) = self.length {
            return Ok(length);
        }
        let io = StoreError::io("read", &self.path);
        let length = match open_at(&self.path, 0) {
            Err(error) if error.kind() == io::ErrorKind::NotFound => 0,
            reader => {
                let mut reader = reader.map_err(io)?;
                let length = reader.get_ref().metadata().map_err(io)?.len();
                let mut magic = [0; MAGIC.len()];
                if length >= MAGIC.len() as u64 {
                    reader.read_exact(&mut magic).map_err(io)?;
                    if magic != MAGIC {
                        return Err(StoreError::Matches {
                            path: self.path.clone(),
                            reason: "it is no file of matches of this version".into(),
                        });
                    }
                }
                length
            }
        };
        self.length = Some(length);
        Ok(length)
    }

    fn stand_at(&mut self, start: u64) -> Result<(), StoreError> {
        let io = StoreError::io("read", &self.path);
        match &mut self.reader {
            None => self.reader = Some(open_at(&self.path, start).map_err(io)?),
            Some(_) if self.at == start => {}
            Some(reader) => {
                reader.seek(SeekFrom::Start(start)).map_err(io)?;
            }
        }
        self.at = start;
        Ok(())
    }

    fn read(&mut self, bytes: &mut [u8]) -> Result<(), StoreError> {
        let reader = self.reader.as_mut().expect("it stands somewhere");
        (reader.read_exact(bytes)).map_err(StoreError::io("read", &self.path))?;
        self.at += bytes.len() as u64;
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_entry_that_claims_too_many_matches_is_refused_before_memory_is_taken() {
        let folder = tempfile::tempdir().expect("a temporary folder");
        let path = folder.path().join("orb.bin");
        let mut bytes = MAGIC.to_vec();
        bytes.extend([0; HEADER - 4]);
        bytes.extend(1_000_000_000_u32.to_le_bytes());
        std::fs::write(&path, bytes).expect("writable");
        let file = File::options()
            .write(true)
            .open(&path)
            .expect("it is there");
        // Nothing but a hole.
        file.set_len(1 << 40).expect("a sparse file");
        let error = EntryFile::new(path).take((0, 1, 0), true);
        let said = error.expect_err("nobody writes so many").to_string();
        assert!(said.contains("1000000000 matches"), "{said}");
    }
}
