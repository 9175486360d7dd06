#![no_main]

#[path = "../../crates/matchbench/tests/doors/mod.rs"]
mod doors;

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| {
    doors::offer("cached keypoints", bytes);
});
