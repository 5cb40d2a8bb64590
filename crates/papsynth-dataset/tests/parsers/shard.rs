//! Arbitrary bytes as a file of a shard: table, COCO, GeoJSON, outlines, image, label image, tar file. The first byte
//! selects the file. From 128 on, the rest is its content; below, the rest is a list of changes of four bytes each.

use std::fs;
use std::sync::LazyLock;

use papsynth::model::Model;
use papsynth_dataset::{Check, Dataset, DatasetInfo, Format, Layout, ShardRecord, truths};
use sha2::{Digest, Sha256};

use crate::support::{SEED, Scratch, frame, recipe};

const RECORD: &str = "shards/000000.json";
const COCO: &str = "shards/000000.coco.json";

/// A shard whose files are replaced.
pub(super) struct Shard {
    scratch: Scratch,
    dataset: Dataset,
    record: ShardRecord,
    /// Its files, sorted by path.
    pub(super) files: Vec<(String, Vec<u8>)>,
}

/// A shard of frames with this number of planes.
pub(super) fn begin(name: &str, formats: impl IntoIterator<Item = Format>, planes: &[usize]) -> Shard {
    let scratch = Scratch::new(name);
    let layout = Layout { frames_per_shard: planes.len() as u64, ..Layout::new(formats) };
    let info = DatasetInfo { recipe: &recipe(), model: &Model::builtin(), seed: SEED, map: None, layout: &layout };
    let dataset = Dataset::create_or_resume(scratch.path(), &info).expect("a folder for it");
    let mut writer = dataset.shard_writer(0).expect("a shard");
    for (index, planes) in (0..).zip(planes) {
        let frame = frame(index, *planes, 8, 1);
        writer.begin(&frame.finished.scene).expect("a frame");
        frame.planes.iter().for_each(|plane| writer.write_plane(plane).expect("a plane"));
        writer.end(&frame.finished).expect("its truth");
    }
    writer.commit().expect("a record");
    let record = ShardRecord::from_json(&fs::read(scratch.join(RECORD)).expect("it")).expect("a record");
    let read = |path: &String| (path.clone(), fs::read(scratch.join(path)).expect("a file of the record"));
    let files = record.files.iter().map(|file| read(&file.path)).collect();
    Shard { scratch, dataset, record, files }
}

fn sha256(bytes: &[u8]) -> String {
    Sha256::digest(bytes).iter().map(|byte| format!("{byte:02x}")).collect()
}

/// Position (in 1/65536 of the file), operation, and value of a change.
fn changes(mut bytes: Vec<u8>, list: &[u8]) -> Vec<u8> {
    for change in list.chunks_exact(4) {
        let at = usize::from(u16::from_le_bytes([change[0], change[1]])) * bytes.len() / 65536;
        let (what, value) = (change[2] % 5, change[3]);
        match what {
            _ if bytes.is_empty() => break,
            0 => bytes[at] = value,
            1 => bytes[at] ^= 1 << (value % 8),
            2 => drop(bytes.drain(at..(at + usize::from(value)).min(bytes.len()))),
            3 => bytes.insert(at, value),
            _ => bytes.truncate(at),
        }
    }
    bytes
}

impl Shard {
    /// Whether the shard counts as complete after a file is replaced and its hash updated.
    pub(super) fn is_whole_with(&self, number: usize, content: &[u8]) -> bool {
        let Self { scratch, dataset, record, files } = self;
        let (path, good) = &files[number];
        let mut record = record.clone();
        (record.files[number].bytes, record.files[number].sha256) = (content.len() as u64, sha256(content));
        record.sha256 = String::new();
        record.sha256 = sha256(&serde_json::to_vec(&record).expect("a record is JSON"));
        fs::write(scratch.join(path), content).expect("a file");
        fs::write(scratch.join(RECORD), serde_json::to_vec(&record).expect("a record is JSON")).expect("a record");
        let found = dataset.complete_record(0, Check::Hashes).expect("no failure of the system");
        fs::write(scratch.join(path), good).expect("a file");
        found.is_some()
    }
}

/// A changed file with a correct hash is found as inconsistent, unless its content is equivalent.
pub(crate) fn check(bytes: &[u8]) {
    static SHARD: LazyLock<Shard> = LazyLock::new(|| begin("fuzz-shard", Format::built(), &[2, 1]));
    let [which, rest @ ..] = bytes else { return };
    let number = usize::from(*which) % SHARD.files.len();
    let (path, good) = &SHARD.files[number];
    let changed;
    let content = match which {
        128.. => rest,
        _ => {
            changed = changes(good.clone(), rest);
            &changed
        }
    };
    if !SHARD.is_whole_with(number, content) {
        return;
    }
    if path == COCO {
        assert_eq!(truths(content).expect("a complete document"), truths(good).expect("the original document"));
    }
    // Accepted text files and tables are unchanged.
    if [".csv", ".txt"].iter().any(|ending| path.ends_with(ending)) {
        assert_eq!(content, good.as_slice());
    }
}
