//! Arbitrary bytes as the record of a frame or the manifest of a data set.

use std::path::{Component, Path};

use papsynth_dataset::{Manifest, ShardRecord};

/// A parsed record lists only files inside the data set and has a lossless round trip; a parsed manifest serializes.
pub(crate) fn check(bytes: &[u8]) {
    if let Ok(record) = ShardRecord::from_json(bytes) {
        let inside = |path: &str| Path::new(path).components().all(|part| matches!(part, Component::Normal(_)));
        assert!(record.files.iter().all(|file| inside(&file.path)));
        let again = ShardRecord::from_json(&serde_json::to_vec(&record).expect("a record is JSON"));
        // A number such as 1e400 is parsed as infinity, which JSON cannot represent.
        assert!(again.as_ref().map_or(true, |again| *again == record));
    }
    if let Ok(manifest) = Manifest::from_json(bytes) {
        assert!(serde_json::to_vec(&manifest).is_ok());
    }
}
