#![no_main]

#[path = "../../crates/papsynth-dataset/tests/parsers/coco.rs"]
mod coco;

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| coco::check(bytes));
