#![no_main]

#[path = "../../crates/papsynth-dataset/tests/parsers/recipe.rs"]
mod recipe;
#[path = "../../crates/papsynth-dataset/tests/parsers/sound.rs"]
mod sound;

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| recipe::check(bytes));
