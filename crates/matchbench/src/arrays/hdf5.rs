//! HDF5 files of arrays, read and written without the C library.
//!
//! Files are read with `hdf5-reader`, which reads only the parts that are asked for and checks what the file
//! claims. They are written with `hdf5-writer` by the same authors. Links to other files are not followed. Only
//! the parts of HDF5 that exchange formats use are read: arrays of numbers in nested groups. Attributes are
//! ignored.

use std::io;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use hdf5_reader::group::Group;
use hdf5_reader::storage::{BytesStorage, DynStorage, FileStorage};
use hdf5_reader::{ByteOrder, DEFAULT_MAX_CHUNK_BYTES, Datatype, Hdf5File as Reader, OpenOptions};
use hdf5_writer::{DatasetBuilder, Hdf5Builder, WriteOptions};

use super::ArrayError;
use super::array::{Array, Element, Kind, MAX_BYTES};
use crate::counted::counted;
use crate::files::{open_file, write_new};

/// The most groups and arrays of a file, since each needs memory for its name. A file with a hundred thousand
/// pairs has a million arrays. A group is counted each time it is met, since links can make a few groups look
/// like many.
const MAX_MEMBERS: usize = 4_000_000;
/// The most bytes of all their paths together.
const MAX_NAME_BYTES: usize = 1 << 30;
/// The deepest nesting of groups. It is limited because links may form cycles; names of images may contain
/// folders.
const DEEPEST: usize = 24;
/// The most bytes of an array for each byte of its file. Deflate, the strongest filter in use, makes up to 1032 of one.
/// Without this limit, an array of which nothing is stored could claim any shape, and all of it would be filled.
const MAX_GROWTH: u64 = 1100;

/// An opened file.
pub(crate) struct Hdf5 {
    path: PathBuf,
    file: Reader,
    /// Its size.
    bytes: u64,
}

impl Hdf5 {
    /// Opens the file.
    ///
    /// # Errors
    /// If it cannot be read or is not an HDF5 file.
    pub(crate) fn open(path: &Path) -> Result<Self, ArrayError> {
        Self::with_arrays_of(path, MAX_BYTES as usize)
    }

    /// Opens a file whose arrays have at most so many bytes, as has each chunk in which they are stored.
    ///
    /// # Errors
    /// As [`Self::open`].
    pub(crate) fn with_arrays_of(path: &Path, bytes: usize) -> Result<Self, ArrayError> {
        let file = open_file(path).map_err(|error| ArrayError::unreadable(path, error))?;
        let about = (file.metadata()).map_err(|error| ArrayError::unreadable(path, error))?;
        let storage =
            FileStorage::from_file(file).map_err(|error| ArrayError::unreadable(path, error))?;
        Self::in_storage(path, Arc::new(storage), about.len(), bytes)
    }

    /// Whether these are the first bytes of an HDF5 file.
    pub(crate) fn is_it(bytes: &[u8]) -> bool {
        bytes.starts_with(b"\x89HDF\r\n\x1a\n")
    }

    /// Opens the file at `path`, which has this content.
    ///
    /// # Errors
    /// If it is not an HDF5 file.
    pub(crate) fn of_bytes(path: &Path, content: Vec<u8>) -> Result<Self, ArrayError> {
        let length = content.len() as u64;
        let storage = BytesStorage::new(content);
        Self::in_storage(path, Arc::new(storage), length, MAX_BYTES as usize)
    }

    fn in_storage(
        path: &Path,
        storage: DynStorage,
        length: u64,
        bytes: usize,
    ) -> Result<Self, ArrayError> {
        let options = OpenOptions::default()
            .with_max_read_bytes(bytes)
            .with_max_chunk_bytes(bytes.min(DEFAULT_MAX_CHUNK_BYTES))
            .with_max_object_header_bytes(16 << 20);
        let file = Reader::from_storage_with_options(storage, options)
            .map_err(|error| ArrayError::damaged(path, format!("no HDF5 file ({error})")))?;
        Ok(Self {
            path: path.into(),
            file,
            bytes: length,
        })
    }

    pub(crate) fn path(&self) -> &Path {
        &self.path
    }

    /// Paths of all arrays, `group/group/array`, in the order of the file.
    ///
    /// # Errors
    /// If a group cannot be read, or there are too many arrays.
    pub(crate) fn arrays(&self) -> Result<Vec<String>, ArrayError> {
        self.arrays_within(MAX_MEMBERS, MAX_NAME_BYTES)
    }

    fn arrays_within(&self, members: usize, bytes: usize) -> Result<Vec<String>, ArrayError> {
        let mut found = Found {
            arrays: Vec::new(),
            members,
            bytes,
        };
        let root = self
            .file
            .root_group()
            .map_err(|error| self.damaged(error))?;
        self.collect(&root, "", 0, &mut found)?;
        Ok(found.arrays)
    }

    fn collect(
        &self,
        group: &Group,
        prefix: &str,
        depth: usize,
        found: &mut Found,
    ) -> Result<(), ArrayError> {
        if depth > DEEPEST {
            return Err(self.damaged(format!("groups are nested deeper than {DEEPEST}")));
        }
        let (groups, arrays) = group.member_names().map_err(|error| self.unlisted(error))?;
        for name in &arrays {
            found
                .count(prefix, name)
                .map_err(|what| self.damaged(what))?;
            found.arrays.push(format!("{prefix}{name}"));
        }
        for name in &groups {
            found
                .count(prefix, name)
                .map_err(|what| self.damaged(what))?;
        }
        if groups.is_empty() {
            return Ok(());
        }
        // All at once: each by its name would look through all names again.
        for inner in group.groups().map_err(|error| self.unlisted(error))? {
            let prefix = format!("{prefix}{}/", inner.name());
            self.collect(&inner, &prefix, depth + 1, found)?;
        }
        Ok(())
    }

    /// The shape that the array at `path` says it has; `None` if it cannot be read.
    pub(crate) fn stated_shape(&self, path: &str) -> Option<Vec<usize>> {
        let sides = self.file.dataset(path).ok()?;
        (sides.shape().iter())
            .map(|&side| usize::try_from(side).ok())
            .collect()
    }

    /// The array at `path`.
    ///
    /// # Errors
    /// If it is missing, cannot be read, or is not an array of numbers.
    pub(crate) fn array(&self, path: &str) -> Result<Array, ArrayError> {
        let array = || {
            let dataset = self.file.dataset(path).map_err(|error| error.to_string())?;
            let shape: Vec<usize> = (dataset.shape().iter())
                .map(|&side| usize::try_from(side).map_err(|_| "its shape is absurd".to_owned()))
                .collect::<Result<_, _>>()?;
            let element = element(dataset.dtype()).ok_or_else(|| {
                format!("its elements are {}, not numbers", kind(dataset.dtype()))
            })?;
            let claimed = dataset.raw_byte_len().map_err(|error| error.to_string())?;
            if claimed as u64 / MAX_GROWTH > self.bytes {
                return Err(format!(
                    "its shape {shape:?} claims {}, more than a file of {} can hold",
                    counted(claimed, "byte"),
                    self.bytes
                ));
            }
            let bytes = dataset
                .read_raw_bytes()
                .map_err(|error| error.to_string())?;
            Array::new(shape, element, bytes)
        };
        array().map_err(|what| self.damaged(what).of(path))
    }

    fn damaged(&self, what: impl std::fmt::Display) -> ArrayError {
        ArrayError::damaged(&self.path, what)
    }

    /// The error for a group whose members cannot be listed. The decoder takes a large group of the latest format for
    /// one that is cut, so the tool that made it would write the same again.
    fn unlisted(&self, error: hdf5_reader::error::Error) -> ArrayError {
        let damaged = self.damaged(error);
        // Where it is a group in the listed one, the decoder tells its error in words alone.
        if !damaged.what.contains("unexpected end of data") {
            return damaged;
        }
        ArrayError {
            remedy: "if other programs read it, a group has more members than are read in files of \
                     libver=\"latest\" (some 10,000): copy it into a file with libver=\"earliest\"; else write it \
                     again with the tool that made it",
            ..damaged
        }
    }
}

/// Paths of the arrays that were found, and how many members and bytes of their paths may still be.
struct Found {
    arrays: Vec<String>,
    members: usize,
    bytes: usize,
}

impl Found {
    /// Counts a member of the group whose path is `prefix`.
    fn count(&mut self, prefix: &str, name: &str) -> Result<(), String> {
        self.members = (self.members.checked_sub(1))
            .ok_or_else(|| "it has too many groups and arrays".to_owned())?;
        self.bytes = (self.bytes.checked_sub(prefix.len() + name.len()))
            .ok_or_else(|| "the paths of its groups and arrays are too long".to_owned())?;
        Ok(())
    }
}

fn element(datatype: &Datatype) -> Option<Element> {
    let (kind, size, order) = match *datatype {
        Datatype::FloatingPoint { size, byte_order } => (Kind::Float, size, byte_order),
        Datatype::FixedPoint {
            size,
            signed,
            byte_order,
        } => {
            let kind = if signed { Kind::Signed } else { Kind::Unsigned };
            (kind, size, byte_order)
        }
        _ => return None,
    };
    Element::new(kind, usize::from(size), order == ByteOrder::BigEndian)
}

/// The kind of elements that cannot be read, in words.
fn kind(datatype: &Datatype) -> &'static str {
    match datatype {
        Datatype::FloatingPoint { .. } | Datatype::FixedPoint { .. } => {
            "numbers of an unusual size"
        }
        Datatype::String { .. } => "text",
        Datatype::VarLen { .. } => "lists of any length",
        Datatype::Reference { .. } => "references",
        Datatype::Compound { .. } => "records of several fields",
        _ => "of another kind",
    }
}

/// A file that is being built.
#[derive(Default)]
pub(crate) struct Hdf5Out(Hdf5Builder);

impl Hdf5Out {
    /// Adds an array of 32-bit floats at `path`, and its groups.
    pub(crate) fn floats(&mut self, path: String, shape: &[usize], values: &[f32]) {
        let array = DatasetBuilder::typed_data(path, sides(shape), values);
        self.add(array.expect("as many values as the shape says"));
    }

    /// Adds an array of 64-bit floats.
    pub(crate) fn doubles(&mut self, path: String, shape: &[usize], values: &[f64]) {
        let array = DatasetBuilder::typed_data(path, sides(shape), values);
        self.add(array.expect("as many values as the shape says"));
    }

    /// Adds an array of 32-bit integers.
    pub(crate) fn integers(&mut self, path: String, shape: &[usize], values: &[i32]) {
        let array = DatasetBuilder::typed_data(path, sides(shape), values);
        self.add(array.expect("as many values as the shape says"));
    }

    fn add(&mut self, array: DatasetBuilder) {
        self.0 = std::mem::take(&mut self.0).dataset(array);
    }

    /// Writes the file, completely or not at all.
    ///
    /// # Errors
    /// If it cannot be written, or two arrays have the same name.
    pub(crate) fn write(self, path: &Path) -> io::Result<()> {
        let bytes = (self.0.into_plan())
            .and_then(|plan| plan.encode(WriteOptions::default()))
            .map_err(io::Error::other)?;
        write_new(path, &bytes)
    }
}

fn sides(shape: &[usize]) -> Vec<u64> {
    shape.iter().map(|&side| side as u64).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn nested_arrays_come_back() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("m.h5");
        let mut out = Hdf5Out::default();
        out.floats("a/x.png/keypoints".into(), &[2, 2], &[1.5, 2.0, -0.25, 3e7]);
        out.integers("a/x.png/n".into(), &[3], &[1, -1, 70_000]);
        out.doubles("empty".into(), &[0], &[]);
        out.write(&path).unwrap();
        let file = Hdf5::open(&path).unwrap();
        let mut paths = file.arrays().unwrap();
        paths.sort();
        assert_eq!(paths, ["a/x.png/keypoints", "a/x.png/n", "empty"]);
        let keypoints = file.array("a/x.png/keypoints").unwrap();
        assert_eq!(keypoints.rows(2), Ok(2));
        assert_eq!(keypoints.to_vec(), [1.5, 2.0, -0.25, 3e7]);
        assert_eq!(
            file.array("a/x.png/n").unwrap().to_vec(),
            [1.0, -1.0, 70_000.0]
        );
        assert_eq!(file.array("empty").unwrap().length(), Ok(0));
        let limited = Hdf5::with_arrays_of(&path, 12).unwrap();
        assert!(limited.array("a/x.png/n").is_ok());
        let error = limited.array("a/x.png/keypoints").unwrap_err();
        assert!(
            (error.what()).ends_with("(16 bytes) exceeds the 12 byte read limit"),
            "{error:?}"
        );
        let error = file.array("a/y").err().unwrap();
        assert!(
            error.file == path && error.what().starts_with("array `a/y`: "),
            "{error:?}"
        );
    }

    /// Where the first object of a file of the first format begins.
    const HEAD: u64 = 96;

    /// A message of an object.
    fn message(kind: u16, data: &[u8]) -> Vec<u8> {
        let length = data.len().next_multiple_of(8);
        let mut bytes = [kind.to_le_bytes(), (length as u16).to_le_bytes()].concat();
        bytes.extend([0; 4]);
        bytes.extend(data);
        bytes.resize(8 + length, 0);
        bytes
    }

    /// An object of these messages.
    fn object(messages: &[Vec<u8>]) -> Vec<u8> {
        let count = messages.len() as u16;
        let messages = messages.concat();
        let mut bytes = vec![1, 0];
        bytes.extend(count.to_le_bytes());
        bytes.extend(1_u32.to_le_bytes());
        bytes.extend((messages.len() as u32).to_le_bytes());
        bytes.extend([0; 4]);
        bytes.extend(messages);
        bytes
    }

    /// A group with links of one letter, `a` and so on, to objects at these places.
    fn group(links: &[u64]) -> Vec<u8> {
        // Links are in the group itself: no heap, no tree.
        let mut messages = vec![
            message(2, &[[0; 2].as_slice(), &[0xff; 16], &[0; 6]].concat()),
            message(10, &[0; 8]),
        ];
        messages.extend((b'a'..).zip(links).map(|(letter, to)| {
            let link = [&[1, 0, 1, letter][..], &to.to_le_bytes()].concat();
            message(6, &link)
        }));
        object(&messages)
    }

    /// A file of the first format with these objects one after the other; the first is the root.
    fn file_of(objects: &[Vec<u8>]) -> Vec<u8> {
        let objects = objects.concat();
        let mut file = b"\x89HDF\r\n\x1a\n\0\0\0\0\0\x08\x08\0\x04\0\x10\0\0\0\0\0".to_vec();
        let end = HEAD + objects.len() as u64;
        for address in [0, u64::MAX, end, u64::MAX, 0, HEAD, 0] {
            file.extend(address.to_le_bytes());
        }
        file.resize(HEAD as usize, 0);
        file.extend(objects);
        file
    }

    /// `groups` groups in a chain, each with `links` links to the next.
    fn chain(groups: u64, links: usize) -> Vec<u8> {
        let size = group(&vec![0; links]).len() as u64;
        let of = |number: u64| {
            let next = if number < groups { links } else { 0 };
            group(&vec![HEAD + number * size; next])
        };
        file_of(&(1..=groups).map(of).collect::<Vec<_>>())
    }

    /// One array `a` of bytes in this shape, of which none was written.
    fn promise(shape: &[u64]) -> Vec<u8> {
        let to = HEAD + group(&[0]).len() as u64;
        let sides = shape.iter().flat_map(|side| side.to_le_bytes());
        let space = [1, shape.len() as u8, 0, 0, 0, 0, 0, 0].into_iter();
        let array = object(&[
            message(1, &space.chain(sides).collect::<Vec<u8>>()),
            message(3, &[0x10, 0, 0, 0, 1, 0, 0, 0, 0, 0, 8, 0]),
            message(8, &[&[3, 1][..], &[0xff; 8], &[0; 8]].concat()),
        ]);
        file_of(&[group(&[to]), array])
    }

    #[test]
    fn an_array_that_claims_more_than_its_file_can_hold_is_refused() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("m.h5");
        let read = |shape: &[u64]| {
            std::fs::write(&path, promise(shape)).unwrap();
            let file = Hdf5::open(&path)?;
            assert_eq!(file.arrays()?, ["a"]);
            file.array("a").map(|array| array.len())
        };
        assert_eq!(read(&[5, 2]).unwrap(), 10);
        for shape in [&[1 << 29, 2][..], &[1 << 20]] {
            let error = read(shape).unwrap_err().what();
            assert!(error.contains("more than a file of"), "{error}");
        }
        assert!(read(&[1 << 40, 1 << 40]).is_err());
    }

    #[test]
    fn groups_that_links_multiply_are_refused_in_time() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("m.h5");
        let arrays = |groups, links| {
            std::fs::write(&path, chain(groups, links)).unwrap();
            Hdf5::open(&path)?.arrays()
        };
        assert_eq!(arrays(8, 3).unwrap(), [""; 0]);
        let error = arrays(30, 1).unwrap_err();
        assert!(error.what().contains("deeper than"), "{error:?}");
        // 20 groups have 10^19 paths.
        let wide = chain(20, 10);
        std::fs::write(&path, wide).unwrap();
        let file = Hdf5::open(&path).unwrap();
        for (limits, what) in [
            ((10_000, usize::MAX), "too many groups and arrays"),
            ((usize::MAX, 100_000), "too long"),
        ] {
            let error = file.arrays_within(limits.0, limits.1).unwrap_err();
            assert!(error.what().contains(what), "{error:?}");
        }
    }

    #[test]
    fn a_group_that_seems_cut_may_be_a_large_one() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("m.h5");
        let whole = chain(3, 2);
        std::fs::write(&path, &whole[..whole.len() - 8]).unwrap();
        let error = Hdf5::open(&path).unwrap().arrays().unwrap_err();
        assert!(error.what().contains("unexpected end of data"), "{error:?}");
        assert!(error.remedy.contains("libver=\"earliest\""), "{error:?}");
    }

    #[test]
    fn a_file_that_is_cut_or_changed_never_panics() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("m.h5");
        let mut out = Hdf5Out::default();
        out.floats("a/keypoints".into(), &[2, 2], &[1.5, 2.0, -0.25, 3e7]);
        out.integers("a/b/matches0".into(), &[2], &[1, -1]);
        out.write(&path).unwrap();
        let whole = std::fs::read(&path).unwrap();
        let read_all = |bytes: &[u8]| {
            std::fs::write(&path, bytes).unwrap();
            let file = Hdf5::open(&path)?;
            for array in file.arrays()? {
                file.array(&array)?;
            }
            Ok::<_, ArrayError>(())
        };
        assert!(read_all(&whole).is_ok());
        for length in (0..whole.len()).step_by(3) {
            assert!(read_all(&whole[..length]).is_err(), "cut to {length}");
        }
        for place in 0..whole.len() {
            let mut changed = whole.clone();
            changed[place] ^= (place as u8) | 1;
            // The file is refused or read; a changed number inside an array cannot be detected.
            let _ = read_all(&changed);
        }
    }
}
