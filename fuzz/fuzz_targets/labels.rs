#![no_main]

#[path = "../../crates/papsynth-dataset/tests/parsers/labels.rs"]
mod labels;

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| labels::check(bytes));
