#![no_main]

#[path = "../../crates/papsynth-dataset/tests/parsers/image.rs"]
mod image;

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| image::check(bytes));
