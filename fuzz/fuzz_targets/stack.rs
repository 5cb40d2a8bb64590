#![no_main]

#[path = "../../crates/papsynth-dataset/tests/parsers/stack.rs"]
mod stack;

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| stack::check(bytes));
