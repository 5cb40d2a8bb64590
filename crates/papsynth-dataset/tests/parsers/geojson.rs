//! Arbitrary bytes as the GeoJSON of a frame.

use std::sync::LazyLock;

use papsynth_dataset::Format;
use serde_json::Value;

use super::shard::{Shard, begin};

/// Accepted features of a frame equal the written ones, except for order and white space.
pub(crate) fn check(bytes: &[u8]) {
    static SHARD: LazyLock<(Shard, usize)> = LazyLock::new(|| {
        let shard = begin("fuzz-geojson", [Format::Qupath], &[1]);
        let first = shard.files.iter().position(|(path, _)| path.ends_with(".geojson")).expect("a file of outlines");
        (shard, first)
    });
    let (shard, number) = &*SHARD;
    if shard.is_whole_with(*number, bytes) {
        let read = |bytes: &[u8]| serde_json::from_slice::<Value>(bytes).expect("what is found whole is read");
        assert_eq!(read(bytes), read(&shard.files[*number].1));
    }
}
