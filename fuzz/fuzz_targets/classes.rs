#![no_main]

#[path = "../../crates/papsynth-dataset/tests/parsers/classes.rs"]
mod classes;

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| classes::check(bytes));
