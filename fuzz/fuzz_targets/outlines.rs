#![no_main]

#[path = "../../crates/papsynth-dataset/tests/parsers/outlines.rs"]
mod outlines;

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| outlines::check(bytes));
