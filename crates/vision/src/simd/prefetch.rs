//! Prefetching: memory is asked for before it is needed. This changes no result.

use std::arch::x86_64::{_MM_HINT_T0, _mm_prefetch};

/// Asks for values that are read soon.
#[inline]
pub(super) fn prefetch<T>(values: &[T]) {
    for line in values.chunks(64 / size_of::<T>()) {
        // SAFETY: nothing is read; the address is that of a value.
        unsafe { _mm_prefetch::<_MM_HINT_T0>(line.as_ptr().cast()) };
    }
}
