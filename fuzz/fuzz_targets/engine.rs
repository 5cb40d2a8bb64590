#![no_main]

#[path = "../../crates/papsynth-dataset/tests/parsers/engine.rs"]
mod engine;

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| engine::check(bytes));
