//! Prefetching: memory is asked for before it is needed. This changes no result.

/// Asks for values that are read soon.
#[cfg(target_arch = "x86_64")]
#[inline]
pub(super) fn prefetch<T>(values: &[T]) {
    for first in (0..values.len()).step_by(64 / size_of::<T>()) {
        prefetch_at(values, first);
    }
}

/// Asks for the line of the cache in which a value lies, if there is such a value.
#[inline(always)]
pub(super) fn prefetch_at<T>(values: &[T], index: usize) {
    #[cfg(target_arch = "x86_64")]
    {
        use std::arch::x86_64::{_MM_HINT_T0, _mm_prefetch};
        // SAFETY: nothing is read, and an address where nothing lies is passed over.
        unsafe { _mm_prefetch::<_MM_HINT_T0>(values.as_ptr().wrapping_add(index).cast()) };
    }
    #[cfg(not(target_arch = "x86_64"))]
    let _ = (values, index);
}
