#![no_main]

#[path = "../../crates/papsynth-dataset/tests/parsers/record.rs"]
mod record;

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| record::check(bytes));
