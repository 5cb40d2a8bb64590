#![no_main]

#[path = "../../crates/papsynth-dataset/tests/parsers/geojson.rs"]
mod geojson;
#[path = "../../crates/papsynth-dataset/tests/parsers/shard.rs"]
#[allow(dead_code, reason = "the check of its own target")]
mod shard;
#[path = "../../crates/papsynth-dataset/tests/support/mod.rs"]
mod support;

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| geojson::check(bytes));
