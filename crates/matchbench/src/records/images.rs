//! Which images the records of a run are of: `images/<dataset>.txt` in its folder, a line `frame hash`
//! for each image as it is first used, the hash being BLAKE3 of its bytes.
//!
//! The content of the images belongs to the plan of a run as much as its parameters do. It is noted when an
//! image is first read, since reading all images at the start would delay it. A run that is resumed
//! compares the images that it has noted, and refuses those that have changed. Otherwise some pairs would
//! be of an old and a new image, and an estimator that is added later would judge matches of other images.
//!
//! `depth/<dataset>.txt` is the same of the depth of the images, which matches and keypoints are judged by.

use std::collections::BTreeMap;
use std::io;
use std::path::{Path, PathBuf};

use blake3::Hash;
use rayon::prelude::*;

use super::FolderError;
use crate::files::{Appender, read_file, read_text};

/// The folder of these files within the folder of a run.
pub(super) const FOLDER: &str = "images";

/// The first format of run folders that has them.
pub(super) const FIRST_WITH_NOTES: u32 = 2;

/// That of the files of depth.
pub(super) const DEPTH: &str = "depth";

/// The images of one dataset that a run has used, or the depth of these.
#[derive(Debug)]
pub(crate) struct ImageNotes {
    run: PathBuf,
    dataset: String,
    path: PathBuf,
    known: BTreeMap<u32, Hash>,
    /// Length of the whole lines of the file.
    end: u64,
    writer: Option<Appender>,
    is_there: bool,
}

impl ImageNotes {
    /// What is noted in the folder of a `run`; nothing where there is no file. A torn last line does
    /// not count.
    ///
    /// # Errors
    /// If the file cannot be read, or has a line that is none of these.
    pub(crate) fn open(run: &Path, dataset: &str) -> Result<Self, FolderError> {
        Self::open_in(run, FOLDER, dataset)
    }

    /// What is noted of the depth of the images, likewise.
    ///
    /// # Errors
    /// As [`ImageNotes::open`].
    pub(crate) fn open_depth(run: &Path, dataset: &str) -> Result<Self, FolderError> {
        Self::open_in(run, DEPTH, dataset)
    }

    fn open_in(run: &Path, folder: &str, dataset: &str) -> Result<Self, FolderError> {
        let path = run.join(folder).join(format!("{dataset}.txt"));
        let (text, is_there) = match read_text(&path) {
            Err(error) if error.kind() == io::ErrorKind::NotFound => (String::new(), false),
            text => (text.map_err(FolderError::io("read", &path))?, true),
        };
        let whole = text.rfind('\n').map_or(0, |end| end + 1);
        let mut known = BTreeMap::new();
        for (index, line) in text[..whole].lines().enumerate() {
            let (frame, hash) = parse(line).ok_or_else(|| FolderError::Damaged {
                path: path.clone(),
                reason: format!("line {} is not `frame hash`", index + 1),
            })?;
            known.insert(frame, hash);
        }
        Ok(Self {
            run: run.into(),
            dataset: dataset.into(),
            path,
            known,
            end: whole as u64,
            writer: None,
            is_there,
        })
    }

    /// The name of the dataset.
    pub(super) fn dataset(&self) -> &str {
        &self.dataset
    }

    /// Whether there is a file of notes, be it empty: there is one where the run has results of the dataset, unless it is
    /// of the first format.
    pub(crate) fn is_there(&self) -> bool {
        self.is_there
    }

    /// Makes the file where it is not there: without a note, for a run that has results of images which were not noted.
    ///
    /// # Errors
    /// If it cannot be written.
    pub(crate) fn begin(&mut self) -> Result<(), FolderError> {
        let begun = self.writer().map(drop);
        begun.map_err(FolderError::io("write", &self.path))
    }

    /// The error that the file is gone.
    pub(crate) fn lost(&self) -> FolderError {
        FolderError::LostNotes {
            path: self.path.clone(),
            dataset: self.dataset.clone(),
        }
    }

    /// Whether the images are still those that were noted; `image` is the file of a frame. One that
    /// cannot be read has not changed: nothing is done with it.
    ///
    /// # Errors
    /// [`FolderError::ImageChanged`] for the first that is another.
    pub(crate) fn verify<'a>(
        &self,
        image: impl Fn(u32) -> Option<&'a Path> + Sync,
    ) -> Result<(), FolderError> {
        let known: Vec<(&u32, &Hash)> = self.known.iter().collect();
        let changed = known.par_iter().find_map_first(|&(&frame, &noted)| {
            let path = image(frame)?;
            let now = blake3::hash(&read_file(path).ok()?);
            (now != noted).then(|| self.changed(frame, path))
        });
        changed.map_or(Ok(()), Err)
    }

    /// Whether the image of a frame is the one that was noted, as far as there is a note and it can be read.
    pub(crate) fn is_as_noted(&self, frame: u32, image: &Path) -> bool {
        let now = || Some(blake3::hash(&read_file(image).ok()?));
        let noted = self.known.get(&frame);
        noted.is_none_or(|noted| now().is_none_or(|now| now == *noted))
    }

    /// What is noted of each frame.
    pub(crate) fn known(&self) -> &BTreeMap<u32, Hash> {
        &self.known
    }

    /// Whether the content of an image is known.
    pub(crate) fn is_noted(&self, frame: u32) -> bool {
        self.known.contains_key(&frame)
    }

    /// Refuses an image that is another than the one that was noted.
    ///
    /// # Errors
    /// [`FolderError::ImageChanged`].
    pub(crate) fn check(&self, frame: u32, path: &Path, hash: Hash) -> Result<(), FolderError> {
        match self.known.get(&frame) {
            Some(known) if *known != hash => Err(self.changed(frame, path)),
            _ => Ok(()),
        }
    }

    /// Notes the content of an image that is used; one that is noted already must be the same.
    ///
    /// # Errors
    /// [`FolderError::ImageChanged`]; or if the file cannot be written.
    pub(crate) fn note(&mut self, frame: u32, path: &Path, hash: Hash) -> Result<(), FolderError> {
        self.check(frame, path, hash)?;
        if self.known.contains_key(&frame) {
            return Ok(());
        }
        let line = format!("{frame} {}\n", hash.to_hex());
        let written = self.writer().and_then(|file| file.append(line.as_bytes()));
        written.map_err(FolderError::io("append to", &self.path))?;
        self.known.insert(frame, hash);
        Ok(())
    }

    /// Makes what was noted safe from the power supply: to be done before there are records of it.
    ///
    /// # Errors
    /// If the system cannot.
    pub(crate) fn sync(&mut self) -> Result<(), FolderError> {
        let synced = self.writer.as_mut().map_or(Ok(()), Appender::sync);
        synced.map_err(FolderError::io("write", &self.path))
    }

    fn writer(&mut self) -> io::Result<&mut Appender> {
        if self.writer.is_none() {
            self.writer = Some(Appender::open(&self.path, Some(self.end))?);
            self.is_there = true;
        }
        Ok(self.writer.as_mut().expect("it was just made"))
    }

    fn changed(&self, frame: u32, path: &Path) -> FolderError {
        FolderError::ImageChanged {
            image: path.into(),
            folder: self.run.clone(),
            dataset: self.dataset.clone(),
            frame,
        }
    }
}

fn parse(line: &str) -> Option<(u32, Hash)> {
    let (frame, hash) = line.split_once(' ')?;
    Some((frame.parse().ok()?, Hash::from_hex(hash).ok()?))
}

#[cfg(test)]
mod tests {
    use std::fs;

    use super::*;

    #[test]
    fn a_changed_image_is_refused_by_name_also_by_the_next_process() {
        let folder = tempfile::tempdir().unwrap();
        let image = folder.path().join("0001.png");
        fs::write(&image, b"pixels").unwrap();
        let hash = blake3::hash(b"pixels");
        let mut notes = ImageNotes::open(folder.path(), "room").unwrap();
        notes.note(1, &image, hash).unwrap();
        notes.note(2, &image, hash).unwrap();
        let file = folder.path().join("images/room.txt");
        let whole = fs::read(&file).unwrap();
        for torn in [0, 1, 30] {
            fs::write(&file, &whole[..whole.len() - torn]).unwrap();
            let mut again = ImageNotes::open(folder.path(), "room").unwrap();
            again.verify(|_| Some(&*image)).unwrap();
            again.note(2, &image, hash).unwrap();
            assert_eq!(fs::read(&file).unwrap(), whole, "torn by {torn}");
        }
        fs::write(&image, b"others").unwrap();
        let again = ImageNotes::open(folder.path(), "room").unwrap();
        let error = again.verify(|_| Some(&*image)).unwrap_err().to_string();
        assert!(
            error.contains("0001.png") && error.contains("frame 1"),
            "{error}"
        );
        fs::remove_file(&image).unwrap();
        again.verify(|_| Some(&*image)).unwrap();
        let mut depth = ImageNotes::open_depth(folder.path(), "room").unwrap();
        assert!(!depth.is_noted(1), "depth is noted apart");
        depth.note(1, &image, hash).unwrap();
        assert!(folder.path().join("depth/room.txt").exists());
        fs::write(&file, "1 x\n").unwrap();
        let error = ImageNotes::open(folder.path(), "room").unwrap_err();
        assert!(error.to_string().contains("line 1"), "{error}");
    }
}
