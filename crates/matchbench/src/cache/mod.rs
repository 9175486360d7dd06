//! A cache of features and keypoints on disk. They are found by a hash of what they were made from (see
//! [`Key`]), never by a name.

mod feature_file;
mod key;
mod keypoint_file;
mod reader;

use std::io;
use std::path::{Path, PathBuf};

use matchbench_vision::features::{Features, Keypoint};
use matchbench_vision::image::Size;

pub use key::Key;

use crate::files::{
    read_file, read_file_as_told, refuse_links, remove_leftovers_below, write_whole_file,
};
use crate::front_door::CACHE;
use crate::matchers::Extraction;

/// Why something is not in the cache.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum SaveError {
    /// A link is on the way to the file, and nothing is written through it; the error names it.
    #[error("{0}")]
    Link(io::Error),
    /// The file cannot be written: the disk is full, the folder belongs to somebody else ...; the error names it.
    #[error("{0}")]
    Unwritable(io::Error),
}

/// How far outside its image a feature may lie, in pixels: detectors interpolate.
const OUTSIDE: f32 = 1.0;

/// Whether features that were kept can be those of an image of this size. A cache can be another person's.
pub(crate) fn are_of(features: &Features, size: Size) -> bool {
    features.size == size && lie_in(&features.keypoints, size)
}

/// Whether keypoints that were kept can be those of an image of this size.
pub(crate) fn lie_in(keypoints: &[Keypoint], size: Size) -> bool {
    let within = |x: f32, length: usize| x >= -OUTSIDE && x <= length as f32 - 1.0 + OUTSIDE;
    let mut places = keypoints.iter().map(|keypoint| keypoint.at);
    places.all(|at| within(at.x, size.width) && within(at.y, size.height))
}

/// A folder of features. Any number of runs may use one folder at the same time. It can be deleted when no run
/// is active.
#[derive(Clone, Debug)]
pub struct FeatureCache {
    folder: PathBuf,
}

impl FeatureCache {
    /// The cache in `folder`, which is created when it is first needed.
    pub fn new(folder: impl Into<PathBuf>) -> Self {
        Self {
            folder: folder.into(),
        }
    }

    /// Removes incomplete files of processes that were killed.
    pub(crate) fn remove_leftovers(&self) {
        remove_leftovers_below(&self.folder, 1);
    }

    /// The features of an image file, turned by `quarters` quarters, if they are in the cache. This is for
    /// pictures, which can be drawn without features.
    pub fn find(&self, image: &Path, quarters: u8, extraction: &Extraction) -> Option<Features> {
        self.load(Key::new(&read_file(image).ok()?, quarters, extraction))
    }

    /// The features that were saved under `key`. A file that is incomplete, foreign or unreadable counts as
    /// missing: the features are then computed, and the file is replaced. One that is longer than its head says is not
    /// read further than that.
    pub fn load(&self, key: Key) -> Option<Features> {
        let told = |head: &_| feature_file::length(head, key);
        let file = read_file_as_told(&self.path(key), told).ok()??;
        feature_file::from_bytes(&file, key)
    }

    /// Saves features under `key`.
    ///
    /// # Errors
    /// If the file cannot be written.
    pub fn save(&self, key: Key, features: &Features) -> Result<(), SaveError> {
        self.write(&Self::name(key), &feature_file::to_bytes(features, key))
    }

    /// The keypoints that were saved under `key`, and the seconds that it took to find them.
    pub fn load_keypoints(&self, key: Key) -> Option<(Vec<Keypoint>, f64)> {
        let path = self.path(key).with_extension("keypoints");
        let told = |head: &_| keypoint_file::length(head, key);
        keypoint_file::from_bytes(&read_file_as_told(&path, told).ok()??, key)
    }

    /// Saves keypoints that took `seconds` to find.
    ///
    /// # Errors
    /// If the file cannot be written.
    pub fn save_keypoints(
        &self,
        key: Key,
        keypoints: &[Keypoint],
        seconds: f64,
    ) -> Result<(), SaveError> {
        let name = Self::name(key).with_extension("keypoints");
        self.write(&name, &keypoint_file::to_bytes(keypoints, seconds, key))
    }

    /// Writes a file. A cache can be another person's, so a file that a link in it leads to must not be overwritten.
    fn write(&self, name: &Path, contents: &[u8]) -> Result<(), SaveError> {
        refuse_links(&self.folder, name).map_err(SaveError::Link)?;
        write_whole_file(&self.folder.join(name), contents).map_err(|error| {
            let remedy = format!(
                "this is the cache of features; it may lie elsewhere ({}), and may be deleted",
                CACHE.with("DIR")
            );
            SaveError::Unwritable(io::Error::new(error.kind(), format!("{error}; {remedy}")))
        })
    }

    fn path(&self, key: Key) -> PathBuf {
        self.folder.join(Self::name(key))
    }

    /// The first two digits are a folder, so that no folder has more files than file systems handle well.
    fn name(key: Key) -> PathBuf {
        let name = key.to_string();
        Path::new(&name[..2]).join(format!("{name}.features"))
    }
}

#[cfg(test)]
mod tests {
    use std::fs;

    use matchbench_vision::features::{DescriptorKind, Descriptors};

    use super::*;

    #[test]
    fn what_is_torn_or_foreign_is_not_found_and_can_be_replaced() {
        let folder = tempfile::tempdir().unwrap();
        let cache = FeatureCache::new(folder.path());
        let (key, other) = (Key([1; 32]), Key([2; 32]));
        let none = Descriptors::empty(DescriptorKind::Binary { bits: 8 });
        let features = Features::new(Size::new(3, 2), Vec::new(), none);
        assert_eq!(cache.load(key), None);
        cache.save(key, &features).unwrap();
        assert_eq!(cache.load(key).as_ref(), Some(&features));

        fs::create_dir_all(cache.path(other).parent().unwrap()).unwrap();
        fs::copy(cache.path(key), cache.path(other)).unwrap();
        assert_eq!(cache.load(other), None, "a renamed file is foreign");

        // A pipe that nobody writes to must not block.
        let missing = Key([3; 32]);
        fs::create_dir_all(cache.path(missing)).unwrap();
        let refused = cache.save(missing, &features).unwrap_err().to_string();
        assert!(refused.contains("no file; delete it"), "{refused}");

        fs::write(cache.path(key), b"torn").unwrap();
        assert_eq!(cache.load(key), None);
        cache.save(key, &features).unwrap();
        assert_eq!(cache.load(key), Some(features));
    }

    #[cfg(unix)] // holes of files take no room
    #[test]
    fn of_what_is_longer_than_it_says_the_head_alone_is_read() {
        use crate::files::{Fault, break_calls};

        let folder = tempfile::tempdir().unwrap();
        let cache = FeatureCache::new(folder.path());
        let key = Key([1; 32]);
        let none = Descriptors::empty(DescriptorKind::Binary { bits: 8 });
        let features = Features::new(Size::new(3, 2), Vec::new(), none);
        cache.save(key, &features).unwrap();
        cache.save_keypoints(key, &[], 0.5).unwrap();
        let keypoints = cache.path(key).with_extension("keypoints");
        let lengthened = |path: &Path| {
            let file = fs::File::options().write(true).open(path).unwrap();
            file.set_len(3 << 30).unwrap();
            // It is opened, and its head is read.
            break_calls(path, Fault::Error, 2)
        };
        let files = [cache.path(key), keypoints].map(|path| lengthened(&path));
        assert_eq!((cache.load(key), cache.load_keypoints(key)), (None, None));
        for file in files {
            assert_eq!(file.happened(), None, "the rest is read too");
        }
    }
}
