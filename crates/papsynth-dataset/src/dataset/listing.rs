//! The manifest as it is written: piece by piece, since it may be longer than memory.

use sha2::{Digest, Sha256};

use super::manifest::{Entry, ManifestFile};
use super::record::{FORMAT, FORMAT_VERSION, WRITER};
use super::set::{Dataset, read_record, recorded_shards};
use crate::bytes::{hex, json};
use crate::error::Error;
use crate::files::FileRecord;
use crate::formats::names;

/// Takes the content of a file piece by piece.
pub(crate) type Sink<'a> = dyn FnMut(&[u8]) -> Result<(), Error> + Send + 'a;

/// The head, then every file: those of no shard, then shard by shard, each record after the files it vouches for.
pub(super) fn write_manifest(
    dataset: &Dataset,
    merged: &[FileRecord],
    shards: &[u64],
    frames: u64,
) -> Result<FileRecord, Error> {
    dataset
        .folder
        .write_if_new(names::MANIFEST, |out| manifest(dataset, WRITER, merged, shards, frames, &mut |b| out.bytes(b)))
}

/// The manifest of a data set without a frame, unless there is any manifest by now. Says whether it was written.
pub(super) fn begin_manifest(dataset: &Dataset) -> Result<bool, Error> {
    dataset
        .folder
        .write_unless_there(names::MANIFEST, |out| manifest(dataset, WRITER, &[], &[], 0, &mut |b| out.bytes(b)))
}

/// The SHA-256 of the manifest of all shards that are recorded.
pub(super) fn manifest_sha256(dataset: &Dataset, writer: &str, merged: &[FileRecord]) -> Result<String, Error> {
    let shards = recorded_shards(&dataset.folder)?;
    let frames = shards.iter().map(|&shard| Ok(read_record(&dataset.folder, shard)?.frames.len() as u64));
    let frames = frames.sum::<Result<u64, Error>>()?;
    let mut hash = Sha256::new();
    manifest(dataset, writer, merged, &shards, frames, &mut |bytes| {
        hash.update(bytes);
        Ok(())
    })?;
    Ok(hex(&hash.finalize()))
}

fn manifest(
    dataset: &Dataset,
    writer: &str,
    merged: &[FileRecord],
    shards: &[u64],
    frames: u64,
    out: &mut Sink,
) -> Result<(), Error> {
    let folder = &dataset.folder;
    let head = ManifestFile {
        format: FORMAT.to_owned(),
        version: FORMAT_VERSION,
        writer: writer.to_owned(),
        identity: dataset.identity.clone(),
        layout: dataset.layout.clone(),
        frames,
        shards: shards.len() as u64,
        categories: dataset.categories.clone(),
        head_sha256: String::new(),
        files: Vec::new(),
    };
    let (head, _) = head.sealed();
    // The list is put into the head's braces by hand: it may be longer than memory.
    out(head.strip_suffix(b"}").unwrap_or(&head))?;
    out(b",\"files\":[")?;
    let mut first = true;
    let mut list = |file: &FileRecord, shard: Option<u64>| {
        out(if std::mem::take(&mut first) { b"\n" } else { b",\n" })?;
        let FileRecord { path, bytes, sha256 } = file.clone();
        out(&json(&Entry { path, bytes, sha256, shard }))
    };
    merged.iter().try_for_each(|file| list(file, None))?;
    for &shard in shards {
        read_record(folder, shard)?.files.iter().try_for_each(|file| list(file, Some(shard)))?;
        list(&folder.record(&names::record(shard))?, Some(shard))?;
    }
    out(b"]}\n")
}
