//! What a search computes from its candidates alone, kept for later searches.

use std::fmt;

#[cfg(target_arch = "x86_64")]
use super::coarse::Kept;

/// Whatever searches among some rows want to know of these again.
///
/// It lives beside the rows. Its content follows from them, so a copy may begin with nothing, and it
/// is no part of what is equal; when rows change it must be made anew.
#[derive(Default)]
pub struct Prepared {
    #[cfg(target_arch = "x86_64")]
    pub(super) kept: Kept,
}

impl Prepared {
    /// About how many bytes it may come to have, for so many rows of `dim` values.
    pub fn most_bytes(rows: usize, dim: usize) -> usize {
        #[cfg(target_arch = "x86_64")]
        return super::coarse::most_bytes(rows, dim);
        #[cfg(not(target_arch = "x86_64"))]
        {
            let _ = (rows, dim);
            0
        }
    }
}

impl Clone for Prepared {
    fn clone(&self) -> Self {
        Self::default()
    }
}

impl fmt::Debug for Prepared {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        formatter.write_str("Prepared")
    }
}

impl PartialEq for Prepared {
    fn eq(&self, _: &Self) -> bool {
        true
    }
}
