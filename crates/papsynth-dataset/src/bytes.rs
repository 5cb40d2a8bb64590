//! JSON serialisation and SHA-256.

use std::fs::File;
use std::io::{self, BufReader};

use serde::Serialize;
use sha2::{Digest, Sha256};

/// Bytes that are read at a time for hashing.
const HASH_BLOCK: usize = 1 << 16;

const HAS_JSON: &str = "structs with string keys serialize to JSON";

/// Returns a value as compact JSON.
pub(crate) fn json(value: &impl Serialize) -> Vec<u8> {
    serde_json::to_vec(value).expect(HAS_JSON)
}

/// Appends a value as compact JSON.
pub(crate) fn json_into(value: &impl Serialize, bytes: &mut Vec<u8>) {
    serde_json::to_writer(bytes, value).expect(HAS_JSON);
}

/// Returns a value as JSON with one field per line.
pub(crate) fn json_lines(value: &impl Serialize) -> Vec<u8> {
    serde_json::to_vec_pretty(value).expect(HAS_JSON)
}

/// Returns size and SHA-256 of the rest of a file.
pub(crate) fn measure(file: &mut File) -> io::Result<(u64, String)> {
    let mut hash = Sha256::new();
    let bytes = io::copy(&mut BufReader::with_capacity(HASH_BLOCK, file), &mut hash)?;
    Ok((bytes, hex(&hash.finalize())))
}

pub(crate) fn sha256(bytes: &[u8]) -> String {
    hex(&Sha256::digest(bytes))
}

pub(crate) fn hex(bytes: &[u8]) -> String {
    bytes.iter().map(|b| format!("{b:02x}")).collect()
}
