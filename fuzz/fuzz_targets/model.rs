#![no_main]

#[path = "../../crates/papsynth-dataset/tests/parsers/model.rs"]
mod model;

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| model::check(bytes));
