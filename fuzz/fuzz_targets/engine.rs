#![no_main]

#[path = "../../crates/papsynth-dataset/tests/parsers/engine.rs"]
mod engine;
#[path = "../../crates/papsynth-dataset/tests/parsers/sound.rs"]
mod sound;

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| engine::check(bytes));
