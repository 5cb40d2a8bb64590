#![no_main]

#[path = "../../crates/papsynth-dataset/tests/parsers/rle.rs"]
mod rle;

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| rle::check(bytes));
