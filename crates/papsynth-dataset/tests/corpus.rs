//! Inputs that fuzzing has kept, each through its parser. The targets of `fuzz/` share the checks.

use std::fs;
use std::path::{Path, PathBuf};

#[path = "parsers/image.rs"]
mod image;
#[path = "parsers/labels.rs"]
mod labels;
#[path = "parsers/model.rs"]
mod model;
#[path = "parsers/outlines.rs"]
mod outlines;
#[path = "parsers/recipe.rs"]
mod recipe;
#[path = "parsers/record.rs"]
mod record;
#[path = "parsers/rle.rs"]
mod rle;

/// Gives every input of a target to its check, and each cut off at three places.
fn replay(target: &str, check: fn(&[u8])) {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../fuzz/corpus").join(target);
    let Ok(entries) = fs::read_dir(&folder) else {
        eprintln!("left out: there is no {}, the corpora are part of the repository alone", folder.display());
        return;
    };
    let mut paths: Vec<PathBuf> = entries.map(|entry| entry.unwrap().path()).collect();
    paths.sort();
    assert!(!paths.is_empty(), "{} is empty", folder.display());
    for path in paths {
        // Shown if the check fails.
        eprintln!("{}", path.display());
        let bytes = fs::read(&path).unwrap();
        for length in [bytes.len(), bytes.len() * 3 / 4, bytes.len() / 2, bytes.len().min(9)] {
            check(&bytes[..length]);
        }
    }
}

#[test]
fn recipes() {
    replay("recipe", recipe::check);
}

#[test]
fn models() {
    replay("model", model::check);
}

#[test]
fn images() {
    replay("image", image::check);
}

#[test]
fn label_maps() {
    replay("labels", labels::check);
}

#[test]
fn tables_of_outlines() {
    replay("outlines", outlines::check);
}

#[test]
fn records_and_manifests() {
    replay("record", record::check);
}

#[test]
fn counts_of_masks() {
    replay("rle", rle::check);
}
