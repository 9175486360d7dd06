//! What a file is stored in, with a limit of the bytes that are read of it.

use std::sync::atomic::{AtomicU64, Ordering};

use hdf5_reader::error::{Error, Result};
use hdf5_reader::storage::{DynStorage, Storage, StorageBuffer};

/// A storage of which so many bytes may still be read.
pub(super) struct Metered {
    inner: DynStorage,
    left: AtomicU64,
}

/// No limit.
const ALL: u64 = u64::MAX;

impl Metered {
    /// The storage without a limit.
    pub(super) fn new(inner: DynStorage) -> Self {
        Self {
            inner,
            left: AtomicU64::new(ALL),
        }
    }

    /// From now on, so many bytes may be read; any number, if it is the largest.
    pub(super) fn allow(&self, bytes: u64) {
        self.left.store(bytes, Ordering::Relaxed);
    }

    /// Whether more was to be read than is allowed. Nothing is read then.
    pub(super) fn is_spent(&self) -> bool {
        self.left.load(Ordering::Relaxed) == 0
    }
}

impl Storage for Metered {
    fn len(&self) -> u64 {
        self.inner.len()
    }

    fn read_range(&self, offset: u64, len: usize) -> Result<StorageBuffer> {
        let left = self.left.load(Ordering::Relaxed);
        if left != ALL {
            let left = left.saturating_sub(len as u64);
            self.left.store(left, Ordering::Relaxed);
            if left == 0 {
                return Err(Error::Other("too much of the file is read".to_owned()));
            }
        }
        self.inner.read_range(offset, len)
    }
}
