//! Fewer page faults: huge pages for large blocks, and freed memory that is kept.
//!
//! The system gives a program its memory page by page. The first access to a page is a *page fault*: the system
//! finds a page and fills it with zeros. A feature extractor allocates the levels of its scale space for each
//! image, so with pages of 4 KiB a run has thousands of faults an image, which take up to a fifth of its time.
//! Two means, each of which works without the other:
//!
//! - [`HugePages`] is an allocator for `#[global_allocator]`. It asks for pages of 2 MiB for large blocks, as
//!   NumPy does for its arrays. Linux gives them where `/sys/kernel/mm/transparent_hugepage/enabled` is `madvise`,
//!   as on most distributions (with `always` it does so without being asked, with `never` not at all).
//! - [`keep_freed`] tells the C library of GNU to keep freed memory for the next image. By default it returns
//!   blocks that are larger than a bound, and what is free at the end of its memory, to the system.
//!
//! Both are hints; no result depends on them. On systems other than Linux they do nothing.
#![allow(unsafe_code)]

use std::alloc::{GlobalAlloc, Layout, System};

use super::Left;

/// Blocks from this size on are worth huge pages. In bytes; the bound of NumPy.
const LARGE: usize = 4 << 20;

/// Size of a huge page of x86-64, and of aarch64 with base pages of 4 KiB. In bytes.
#[cfg(target_os = "linux")]
const HUGE_PAGE: usize = 2 << 20;

/// The system's allocator, which asks for huge pages for blocks of 4 MiB or more.
///
/// Blocks are not aligned to huge pages, since that took up to 2.4 times the memory and no less time. The pages at
/// both ends of a block stay small.
///
/// ```
/// use matchbench::memory::HugePages;
///
/// #[global_allocator]
/// static ALLOCATOR: HugePages = HugePages;
/// ```
#[derive(Clone, Copy, Debug, Default)]
pub struct HugePages;

// SAFETY: all blocks are the system allocator's, and are given back to it with the layout they came with. What
// is done to them in between is a hint, which changes no contents.
unsafe impl GlobalAlloc for HugePages {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        // SAFETY: the caller keeps the rules of this trait.
        let block = unsafe { System.alloc(layout) };
        advise_huge(block, layout.size());
        block
    }

    unsafe fn alloc_zeroed(&self, layout: Layout) -> *mut u8 {
        // SAFETY: as above.
        let block = unsafe { System.alloc_zeroed(layout) };
        advise_huge(block, layout.size());
        block
    }

    unsafe fn dealloc(&self, block: *mut u8, layout: Layout) {
        // SAFETY: as above.
        unsafe { System.dealloc(block, layout) }
    }

    unsafe fn realloc(&self, block: *mut u8, layout: Layout, size: usize) -> *mut u8 {
        // SAFETY: as above.
        let block = unsafe { System.realloc(block, layout, size) };
        advise_huge(block, size);
        block
    }
}

/// Asks for huge pages where they lie wholly in a block of so many bytes, if it is large. The block may be null.
#[inline]
fn advise_huge(block: *mut u8, bytes: usize) {
    if bytes >= LARGE && !block.is_null() {
        #[cfg(target_os = "linux")]
        advise(block, bytes);
    }
}

#[cfg(target_os = "linux")]
#[cold]
fn advise(block: *mut u8, bytes: usize) {
    let before = block.align_offset(HUGE_PAGE);
    let huge = bytes.saturating_sub(before) / HUGE_PAGE * HUGE_PAGE;
    if huge > 0 {
        // SAFETY: the range lies in a block of this process, and the advice changes no contents. A system that
        // has no huge pages says so, which is no reason to stop.
        unsafe { libc::madvise(block.add(before).cast(), huge, libc::MADV_HUGEPAGE) };
    }
}

/// Most that is kept for a thread, in bytes.
const MAX_KEPT: u64 = 256 << 20;

/// Less than this is not worth keeping, in bytes for a thread.
const MIN_KEPT: u64 = 16 << 20;

/// Keeps freed memory for the next image: up to 256 MiB for each of `threads`, but in all at most an eighth of
/// what is [left](super::left). Nothing is kept if that is less than 16 MiB for a thread.
///
/// A program calls it once, before its work begins. It applies to the whole process, also to what other
/// libraries allocate with `malloc`. Without this call, the variables `MALLOC_TRIM_THRESHOLD_` and
/// `MALLOC_MMAP_THRESHOLD_` of the environment ask the C library for the same.
pub fn keep_freed(threads: usize) {
    if let Some(bytes) = kept(super::left(), threads) {
        keep(bytes);
    }
}

/// How many bytes a thread may keep.
fn kept(left: Option<Left>, threads: usize) -> Option<u64> {
    let all = left.map_or(u64::MAX, |left| left.bytes / 8);
    let kept = MAX_KEPT.min(all / threads.max(1) as u64);
    (kept >= MIN_KEPT).then_some(kept)
}

/// Sets both bounds of the C library: from which size on a block is returned as soon as it is freed, and how
/// much may be free at the end of its memory.
#[cfg(all(target_os = "linux", target_env = "gnu"))]
fn keep(bytes: u64) {
    /// The most that the C library takes, in bytes.
    const MAX_BLOCK: libc::c_int = 32 << 20;
    let bytes = libc::c_int::try_from(bytes).unwrap_or(libc::c_int::MAX);
    // SAFETY: the C library sets its bounds under a lock. It refuses values that it cannot use, and then nothing
    // has changed.
    unsafe {
        libc::mallopt(libc::M_MMAP_THRESHOLD, MAX_BLOCK);
        libc::mallopt(libc::M_TRIM_THRESHOLD, bytes);
    }
}

#[cfg(not(all(target_os = "linux", target_env = "gnu")))]
fn keep(_bytes: u64) {}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_thread_keeps_what_an_eighth_of_the_memory_allows_or_nothing() {
        let left = |mebibytes: u64| {
            Some(Left {
                bytes: mebibytes << 20,
                of: "a test",
            })
        };
        assert_eq!(kept(None, 4), Some(MAX_KEPT), "nobody knows what is left");
        assert_eq!(kept(left(1 << 16), 2), Some(MAX_KEPT));
        assert_eq!(kept(left(2048), 2), Some(128 << 20));
        assert_eq!(kept(left(2048), 0), Some(256 << 20));
        assert_eq!(kept(left(256), 2), Some(MIN_KEPT));
        assert_eq!(kept(left(255), 2), None);
    }
}
