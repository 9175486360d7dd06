//! Pages of memory: large blocks ask for huge ones, and what was freed is kept, with the contents as always.
#![cfg(target_os = "linux")]

use std::fs;
use std::hint::black_box;
use std::path::Path;

use matchbench::memory::{HugePages, keep_freed, left};

#[global_allocator]
static ALLOCATOR: HugePages = HugePages;

const MIB: usize = 1 << 20;

/// Whether the system was asked for huge pages in the middle of these bytes; `None` if it has none.
fn asked_for_huge(block: &[u8]) -> Option<bool> {
    if !Path::new("/sys/kernel/mm/transparent_hugepage").exists() {
        return None;
    }
    let middle = block[block.len() / 2..].as_ptr() as usize;
    let maps = fs::read_to_string("/proc/self/smaps").ok()?;
    let mut inside = false;
    for line in maps.lines() {
        let first = line.split_whitespace().next()?;
        if let Some((start, end)) = first.split_once('-') {
            let address = |text| usize::from_str_radix(text, 16).ok();
            inside = (address(start)?..address(end)?).contains(&middle);
        } else if inside && first == "VmFlags:" {
            return Some(line.split_whitespace().any(|flag| flag == "hg"));
        }
    }
    None
}

#[test]
fn large_blocks_ask_for_huge_pages_and_small_ones_do_not() {
    let large = vec![1u8; 16 * MIB];
    let Some(asked) = asked_for_huge(&large) else {
        return; // a system without huge pages
    };
    assert!(asked);
    let mut grown = vec![1u8; MIB];
    grown.resize(16 * MIB, 2);
    assert_eq!(asked_for_huge(&grown), Some(true));
    assert_eq!(asked_for_huge(&vec![0u8; 16 * MIB]), Some(true), "zeroed");
}

#[test]
fn blocks_hold_what_was_written() {
    // Around the bound, and of an odd size.
    for bytes in [1, MIB, 4 * MIB - 1, 4 * MIB, 9 * MIB + 17] {
        let mut block = vec![0u8; bytes];
        assert!(block.iter().all(|&byte| byte == 0), "{bytes} bytes");
        for (index, byte) in block.iter_mut().enumerate() {
            *byte = (index % 251) as u8;
        }
        block.extend(vec![7; 5 * MIB]); // moves it
        block.truncate(bytes / 2);
        block.shrink_to_fit();
        let kept = block.iter().enumerate();
        assert!(
            kept.into_iter()
                .all(|(index, &byte)| byte == (index % 251) as u8)
        );
    }
}

/// Page faults of this thread so far that needed no disk.
#[cfg(target_env = "gnu")]
fn faults() -> u64 {
    let stat = fs::read_to_string("/proc/thread-self/stat").expect("a file of Linux");
    let (_, fields) = stat.rsplit_once(") ").expect("the name is in parentheses");
    let minor = fields.split(' ').nth(7).expect("it is there"); // the tenth of all
    minor.parse().expect("a number")
}

/// Works on an image: some levels at once, all of which are freed at the end.
#[cfg(target_env = "gnu")]
fn work() {
    // Each is too small for huge pages.
    let levels: Vec<Vec<u8>> = (0..16).map(|level| vec![level + 1; 3 * MIB]).collect();
    black_box(levels);
}

#[test]
#[cfg(target_env = "gnu")]
fn freed_memory_is_kept_for_the_next_image() {
    // Of an eighth of less, so many levels could not be kept.
    if left().is_some_and(|left| left.bytes < 1 << 30) {
        return;
    }
    let of_an_image = || {
        work();
        let before = faults();
        work();
        faults() - before
    };
    let returned = of_an_image();
    keep_freed(1);
    let kept = of_an_image();
    assert!(
        10 * kept < returned,
        "{returned} faults before, {kept} after"
    );
}
