//! HDF5 files of arrays, read and written without the C library.
//!
//! Files are read with `hdf5-reader`, which reads only the parts that are asked for and checks what the file
//! claims. They are written with `hdf5-writer` by the same authors. Links to other files are not followed. Only
//! the parts of HDF5 that exchange formats use are read: arrays of numbers in nested groups. Attributes are
//! ignored.

#[cfg(test)]
mod tests;

use std::collections::{HashMap, HashSet};
use std::hash::{DefaultHasher, Hash, Hasher};
use std::io::{self, Read};
use std::path::{Path, PathBuf};
use std::rc::Rc;
use std::sync::{Arc, Mutex, PoisonError};

use hdf5_reader::group::Group;
use hdf5_reader::storage::{BytesStorage, DynStorage, FileStorage};
use hdf5_reader::{
    ByteOrder, DEFAULT_MAX_CHUNK_BYTES, Dataset, Datatype, Hdf5File as Reader, OpenOptions,
};
use hdf5_writer::{DatasetBuilder, Hdf5Builder, WriteOptions};

use super::ArrayError;
use super::array::{Array, Element, Kind, MAX_BYTES};
use super::metered::Metered;
use crate::counted::counted;
use crate::files::{open_file, write_new};
use crate::panics::caught;

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
/// The bytes to which the arrays of any file may be decoded beside that: chunks may be larger than what is in them.
const SMALL_CHUNKS: u64 = 16 << 20;

/// The most bytes that are read of a file to list its groups, for each of its bytes and beside these: parts of a hostile
/// file can belong to many groups.
const LISTED_OF_BYTE: u64 = 16;
const LISTED: u64 = 16 << 20;

/// An opened file.
pub(crate) struct Hdf5 {
    path: PathBuf,
    file: Reader,
    storage: Arc<Metered>,
    /// Its size.
    bytes: u64,
    decoded: Mutex<Decoded>,
}

/// What was decoded of a file.
#[derive(Default)]
struct Decoded {
    /// Hashes of the paths of the arrays. One may be read often, as is that of an image with many pairs, and counts once.
    arrays: HashSet<u64>,
    /// The bytes of them all, with all of each chunk.
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

    /// Whether the file at `path` starts as one.
    pub(crate) fn is_file(path: &Path) -> bool {
        let mut start = [0; 8];
        open_file(path)
            .and_then(|mut file| file.read_exact(&mut start))
            .is_ok_and(|()| Self::is_it(&start))
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
        let storage = Arc::new(Metered::new(storage));
        let file = decoded(|| {
            Reader::from_storage_with_options(Arc::clone(&storage) as DynStorage, options)
                .map_err(|error| format!("no HDF5 file ({error})"))
        })
        .map_err(|what| ArrayError::damaged(path, what))?;
        Ok(Self {
            path: path.into(),
            file,
            storage,
            bytes: length,
            decoded: Mutex::default(),
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
        let most = self.bytes.saturating_mul(LISTED_OF_BYTE);
        self.arrays_within(MAX_MEMBERS, MAX_NAME_BYTES, most.saturating_add(LISTED))
    }

    /// The same, with so many members, bytes of their paths, and bytes that are read to list them.
    fn arrays_within(
        &self,
        members: usize,
        bytes: usize,
        read: u64,
    ) -> Result<Vec<String>, ArrayError> {
        let mut found = Found {
            arrays: Vec::new(),
            members,
            bytes,
            listings: HashMap::new(),
        };
        self.storage.allow(read);
        let collected = caught(|| {
            let root = (self.file.root_group()).map_err(|error| self.damaged(error))?;
            self.collect(&root, "", 0, &mut found)
        })
        .unwrap_or_else(|panic| Err(self.damaged(panic)));
        let is_spent = self.storage.is_spent();
        self.storage.allow(u64::MAX);
        // Links whose targets were not read any more have no error of their own.
        if is_spent {
            return Err(self.damaged("its groups have more parts than it has bytes for"));
        }
        collected?;
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
        let listing = self.listing(group, found)?;
        for name in &listing.arrays {
            found
                .count(prefix, name)
                .map_err(|what| self.damaged(what))?;
            found.arrays.push(format!("{prefix}{name}"));
        }
        for inner in &listing.groups {
            found
                .count(prefix, inner.name())
                .map_err(|what| self.damaged(what))?;
        }
        for inner in &listing.groups {
            let prefix = format!("{prefix}{}/", inner.name());
            self.collect(inner, &prefix, depth + 1, found)?;
        }
        Ok(())
    }

    /// The members of a group. They are looked up twice at most, however many paths lead to it: links that resolve to
    /// nothing take time and are no members, so they are not counted.
    fn listing(&self, group: &Group, found: &mut Found) -> Result<Rc<Listing>, ArrayError> {
        let known = found.listings.get(&group.address());
        if let Some(Some(listing)) = known {
            return Ok(Rc::clone(listing));
        }
        let is_known = known.is_some();
        let (groups, arrays) = group.member_names().map_err(|error| self.unlisted(error))?;
        let groups = if groups.is_empty() {
            Vec::new()
        } else {
            // All at once: each by its name would look through all names again.
            group.groups().map_err(|error| self.unlisted(error))?
        };
        let listing = Rc::new(Listing { groups, arrays });
        // In most files each group has one path, so that nothing needs to be kept.
        let kept = is_known.then(|| Rc::clone(&listing));
        found.listings.insert(group.address(), kept);
        Ok(listing)
    }

    /// The shape that the array at `path` says it has; `None` if it cannot be read.
    pub(crate) fn stated_shape(&self, path: &str) -> Option<Vec<usize>> {
        let array = caught(|| self.file.dataset(path)).ok()?.ok()?;
        (array.shape().iter())
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
            self.count(path, decoded_bytes(&dataset, claimed as u64)?)?;
            let bytes = dataset
                .read_raw_bytes()
                .map_err(|error| error.to_string())?;
            Array::new(shape, element, bytes)
        };
        decoded(array).map_err(|what| self.undecoded(what).of(path))
    }

    /// Counts the `bytes` to which the array at `path` is to be decoded, unless it was before.
    fn count(&self, path: &str, bytes: u64) -> Result<(), String> {
        let mut hasher = DefaultHasher::new();
        path.hash(&mut hasher);
        let array = hasher.finish();
        // A number and a set are never left half changed.
        let mut decoded = self.decoded.lock().unwrap_or_else(PoisonError::into_inner);
        if decoded.arrays.contains(&array) {
            return Ok(());
        }
        let before = decoded.bytes;
        let most = (self.bytes.saturating_mul(MAX_GROWTH)).saturating_add(SMALL_CHUNKS);
        if before.saturating_add(bytes) > most {
            return Err(format!(
                "its chunks are {}, beside {before} of the arrays that were read before; that is more than a file of {} \
                 can hold",
                counted(bytes, "byte"),
                self.bytes
            ));
        }
        decoded.bytes += bytes;
        decoded.arrays.insert(array);
        Ok(())
    }

    fn damaged(&self, what: impl std::fmt::Display) -> ArrayError {
        ArrayError::damaged(&self.path, what)
    }

    /// The error for an array that cannot be decoded. With a filter that is not known here (h5py's LZF, those of plugins)
    /// the tool that made it would write the same again.
    fn undecoded(&self, what: String) -> ArrayError {
        let remedy = "write it with another compression, such as gzip, or with none";
        self.damaged_unless(what, "unsupported filter", remedy)
    }

    /// The error for a group whose members cannot be listed. The decoder takes a large group of the latest format for
    /// one that is cut, so the tool that made it would write the same again.
    fn unlisted(&self, error: hdf5_reader::error::Error) -> ArrayError {
        let remedy = "if other programs read it, a group has more members than are read in files of \
                      libver=\"latest\" (some 10,000): copy it into a file with libver=\"earliest\"; else write it \
                      again with the tool that made it";
        self.damaged_unless(error, "unexpected end of data", remedy)
    }

    /// The error for what the decoder refuses: it is damaged, or needs another `remedy` where `told` is among the words of the
    /// decoder. Of a group in the one that is listed it has words alone, and no kind of error.
    fn damaged_unless(
        &self,
        what: impl std::fmt::Display,
        told: &str,
        remedy: &'static str,
    ) -> ArrayError {
        let damaged = self.damaged(what);
        if damaged.what.contains(told) {
            ArrayError { remedy, ..damaged }
        } else {
            damaged
        }
    }
}

/// What the decoder makes of a file. It checks what files claim, but it is others' code: if it panics, that is an error too.
fn decoded<T>(decode: impl FnOnce() -> Result<T, String>) -> Result<T, String> {
    caught(decode).unwrap_or_else(Err)
}

/// Paths of the arrays that were found, and how many members and bytes of their paths may still be.
struct Found {
    arrays: Vec<String>,
    members: usize,
    bytes: usize,
    /// The groups that were met, by their places, with the members of those that were met again.
    listings: HashMap<u64, Option<Rc<Listing>>>,
}

/// The members of a group.
struct Listing {
    groups: Vec<Group>,
    /// Names of its arrays.
    arrays: Vec<String>,
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

/// The bytes to which an array that has so many is decoded: where it is stored in chunks, each is decoded whole, however
/// little of it belongs to the array.
fn decoded_bytes(array: &Dataset, claimed: u64) -> Result<u64, String> {
    let Some(sides) = array.chunks() else {
        return Ok(claimed);
    };
    let element = array.raw_element_size();
    let element = element.map_err(|error| error.to_string())? as u64;
    let of_each = (array.shape().iter().zip(sides)).map(|(&side, chunk)| {
        let chunk = u64::from(chunk.max(1));
        side.div_ceil(chunk).saturating_mul(chunk)
    });
    Ok(of_each.fold(element, u64::saturating_mul))
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
