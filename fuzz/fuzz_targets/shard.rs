#![no_main]

#[path = "../../crates/papsynth-dataset/tests/parsers/shard.rs"]
mod shard;
#[path = "../../crates/papsynth-dataset/tests/support/mod.rs"]
mod support;

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| shard::check(bytes));
