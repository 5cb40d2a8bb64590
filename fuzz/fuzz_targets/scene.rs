#![no_main]

#[path = "../../crates/papsynth-dataset/tests/parsers/scene.rs"]
mod scene;

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| scene::check(bytes));
