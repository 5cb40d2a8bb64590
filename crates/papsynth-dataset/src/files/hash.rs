//! SHA-256 of bytes and files.

use std::fs::File;
use std::io::{self, Read};

use sha2::{Digest, Sha256};

/// How much is read at a time to be hashed.
const HASH_BLOCK: usize = 1 << 16;

/// Size and SHA-256 of the rest of a file.
pub(super) fn measure(file: &mut File) -> io::Result<(u64, String)> {
    let mut hash = Sha256::new();
    let mut block = vec![0; HASH_BLOCK];
    let mut bytes = 0;
    loop {
        match file.read(&mut block)? {
            0 => return Ok((bytes, hex(&hash.finalize()))),
            read => {
                hash.update(&block[..read]);
                bytes += read as u64;
            }
        }
    }
}

/// SHA-256 as hexadecimal digits.
pub(crate) fn sha256(bytes: &[u8]) -> String {
    hex(&Sha256::digest(bytes))
}

pub(crate) fn hex(bytes: &[u8]) -> String {
    bytes.iter().map(|b| format!("{b:02x}")).collect()
}
