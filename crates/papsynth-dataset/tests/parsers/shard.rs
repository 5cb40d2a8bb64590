//! Any bytes as one of the files of a shard: of tables, COCO, GeoJSON, outlines, images, label images, tar files. The first byte says which. From
//! 128 on the rest is the file; below, the rest is a list of changes to the file as it was written, of four bytes each.

use std::fs;
use std::sync::LazyLock;

use papsynth::model::Model;
use papsynth_dataset::{Check, Dataset, DatasetInfo, Format, Layout, ShardRecord, truths};
use sha2::{Digest, Sha256};

use crate::support::{SEED, Scratch, frame, recipe};

const RECORD: &str = "shards/000000.json";
const COCO: &str = "shards/000000.coco.json";

/// A shard whose files are put in others' places.
pub(super) struct Shard {
    scratch: Scratch,
    dataset: Dataset,
    record: ShardRecord,
    /// Its files, by path.
    pub(super) files: Vec<(String, Vec<u8>)>,
}

/// A shard of frames that have so many planes.
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

/// Where (of 65536 parts of the file), what is done there, with which value.
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
    /// Whether the shard is found whole with another content in the place of one of its files, whose hash is right.
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

/// A file that is not what was written is found to contradict the others although its hash is right, unless it says the same.
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
        assert_eq!(
            truths(content).expect("what is found whole is read"),
            truths(good).expect("and so is what was written")
        );
    }
    // What readers take for text or a table says exactly what it said.
    if [".csv", ".txt"].iter().any(|ending| path.ends_with(ending)) {
        assert_eq!(content, good.as_slice());
    }
}
