//! Any bytes as the record of a frame or the manifest of a data set.

use std::path::{Component, Path};

use papsynth_dataset::{Manifest, ShardRecord};

/// A record that is read names files of the data set alone and reads back as written; a manifest that is read writes its head.
pub(crate) fn check(bytes: &[u8]) {
    if let Ok(record) = ShardRecord::from_json(bytes) {
        let inside = |path: &str| Path::new(path).components().all(|part| matches!(part, Component::Normal(_)));
        assert!(record.files.iter().all(|file| inside(&file.path)));
        let again = ShardRecord::from_json(&serde_json::to_vec(&record).expect("a record is JSON"));
        // A number such as 1e400 reads as infinite and has no JSON.
        assert!(again.as_ref().map_or(true, |again| *again == record));
    }
    if let Ok(manifest) = Manifest::from_json(bytes) {
        assert!(serde_json::to_vec(&manifest).is_ok());
    }
}
