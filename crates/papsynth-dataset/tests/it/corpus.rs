//! Inputs found by fuzzing, each with its parser. The targets of `fuzz/` use the same checks.

use std::fs;
use std::path::{Path, PathBuf};

#[path = "../parsers/classes.rs"]
mod classes;
#[path = "../parsers/coco.rs"]
mod coco;
#[path = "../parsers/engine.rs"]
mod engine;
#[path = "../parsers/geojson.rs"]
mod geojson;
#[path = "../parsers/image.rs"]
mod image;
#[path = "../parsers/labels.rs"]
mod labels;
#[path = "../parsers/model.rs"]
mod model;
#[path = "../parsers/outlines.rs"]
mod outlines;
#[path = "../parsers/recipe.rs"]
mod recipe;
#[path = "../parsers/record.rs"]
mod record;
#[path = "../parsers/rle.rs"]
mod rle;
#[path = "../parsers/scene.rs"]
mod scene;
#[path = "../parsers/shard.rs"]
mod shard;
#[path = "../parsers/sound.rs"]
mod sound;
#[path = "../parsers/stack.rs"]
mod stack;

/// Checks every input of a target, three truncations of it, and `PAPSYNTH_FUZZ` random changes.
fn replay(target: &str, check: fn(&[u8])) {
    replay_part(target, 1, check);
}

/// As [`replay`] with one in `part` of the changed inputs, for slow checks.
fn replay_part(target: &str, part: u64, check: fn(&[u8])) {
    let rounds: u64 = std::env::var("PAPSYNTH_FUZZ").ok().and_then(|n| n.parse().ok()).unwrap_or(0) / part;
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../fuzz/corpus").join(target);
    let Ok(entries) = fs::read_dir(&folder) else {
        eprintln!("skipped: {} does not exist; the corpora are only in the repository", folder.display());
        return;
    };
    let mut paths: Vec<PathBuf> = entries.map(|entry| entry.unwrap().path()).collect();
    paths.sort();
    assert!(!paths.is_empty(), "{} is empty", folder.display());
    let inputs: Vec<Vec<u8>> = paths.iter().map(|path| fs::read(path).unwrap()).collect();
    for (path, bytes) in paths.iter().zip(&inputs) {
        // Printed if the check fails.
        eprintln!("{}", path.display());
        for length in [bytes.len(), bytes.len() * 3 / 4, bytes.len() / 2, bytes.len().min(9)] {
            check(&bytes[..length]);
        }
    }
    let mut numbers = Numbers(rounds ^ 20_261_122);
    for round in 0..rounds {
        let bytes = numbers.mutant(&inputs);
        if std::panic::catch_unwind(|| check(&bytes)).is_err() {
            let kept = std::env::temp_dir().join(format!("papsynth-fuzz-{target}-{round}"));
            fs::write(&kept, &bytes).unwrap();
            panic!("round {round}: the input is in {}", kept.display());
        }
    }
    if rounds > 0 {
        eprintln!("{target}: {rounds} changed inputs");
    }
}

/// A linear congruential generator: the changes are the same in every run.
struct Numbers(u64);

impl Numbers {
    fn below(&mut self, end: usize) -> usize {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        usize::try_from((self.0 >> 33) % u64::try_from(end.max(1)).unwrap()).unwrap()
    }

    /// Returns an input with a few changes: bytes, numbers, and pieces that are moved, repeated, removed or copied from
    /// another input.
    fn mutant(&mut self, inputs: &[Vec<u8>]) -> Vec<u8> {
        const WORDS: [&[u8]; 16] = [
            b"0",
            b"-1",
            b"1e999",
            b"nan",
            b"18446744073709551615",
            b"4294967296",
            b"null",
            b"[]",
            b"{}",
            b"\"\"",
            b"\0",
            b"..",
            b"\xff\xff\xff\xff",
            b"\x7f\xff\xff\xff",
            b"\x01\0\0\0",
            b"\x80",
        ];
        let mut bytes = inputs[self.below(inputs.len())].clone();
        for _ in 0..=self.below(6) {
            let at = self.below(bytes.len() + 1);
            let longest = [4, 16, 256][self.below(3)];
            let end = (at + self.below(1 + longest)).min(bytes.len());
            match self.below(7) {
                0 | 1 if at < bytes.len() => bytes[at] ^= 1 << self.below(8),
                2 if at < bytes.len() => bytes[at] = u8::try_from(self.below(256)).unwrap(),
                3 => drop(bytes.drain(at..end)),
                4 => {
                    let piece = bytes[at..end].to_vec();
                    let to = self.below(bytes.len() + 1);
                    bytes.splice(to..to, piece);
                }
                5 => {
                    let word = WORDS[self.below(WORDS.len())];
                    drop(bytes.splice(at..end, word.iter().copied()));
                }
                _ => {
                    let other = &inputs[self.below(inputs.len())];
                    let from = self.below(other.len() + 1);
                    let to = (from + self.below(256)).min(other.len());
                    drop(bytes.splice(at..end, other[from..to].iter().copied()));
                }
            }
        }
        bytes
    }
}

#[test]
fn scenes() {
    replay("scene", scene::check);
}

#[test]
fn recipes() {
    replay("recipe", recipe::check);
}

#[test]
fn engines() {
    replay_part("recipe", 100, engine::check);
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

#[test]
fn class_files() {
    replay("classes", classes::check);
}

#[test]
fn coco_documents() {
    replay("coco", coco::check);
}

#[test]
fn stacks() {
    replay("stack", stack::check);
}

#[test]
fn outlines_as_geojson() {
    replay("geojson", geojson::check);
}

#[test]
fn files_of_a_shard() {
    replay("shard", shard::check);
}
