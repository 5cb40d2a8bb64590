//! Keys of random streams.

use rand_core::SeedableRng;
use rand_xoshiro::Xoshiro256PlusPlus;
use sha2::{Digest, Sha256};

/// The key of all random streams of a study.
#[derive(Debug, Clone)]
pub(crate) struct Key {
    seed: u64,
    /// SHA-256 of the hashes of all fields: without the fields, the order of trials cannot be predicted.
    fields: [u8; 32],
    /// Empty for streams that are equal for all subjects.
    subject: String,
}

impl Key {
    pub(crate) fn new(seed: u64, subject: &str, hashes: impl Iterator<Item = impl AsRef<[u8]>>) -> Self {
        let mut fields = Sha256::new();
        for hash in hashes {
            fields.update(hash.as_ref());
        }
        Self { seed, fields: fields.finalize().into(), subject: subject.to_owned() }
    }

    /// Returns the random stream of a purpose and an index.
    pub(crate) fn stream(&self, purpose: &str, index: usize) -> Xoshiro256PlusPlus {
        Xoshiro256PlusPlus::from_seed(self.hash(purpose, index))
    }

    /// Returns an unpredictable name of 32 hexadecimal digits for a purpose and an index.
    pub(crate) fn name(&self, purpose: &str, index: usize) -> String {
        hex(&self.hash(purpose, index)[..16])
    }

    fn hash(&self, purpose: &str, index: usize) -> [u8; 32] {
        let mut hash = Sha256::new();
        hash.update(b"papsynth-study 1");
        hash.update(self.seed.to_le_bytes());
        hash.update(self.fields);
        for text in [&self.subject, purpose] {
            hash.update((text.len() as u64).to_le_bytes());
            hash.update(text.as_bytes());
        }
        hash.update((index as u64).to_le_bytes());
        hash.finalize().into()
    }
}

pub(crate) fn hex(bytes: &[u8]) -> String {
    bytes.iter().map(|byte| format!("{byte:02x}")).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_part_of_a_key_changes_the_stream() {
        let key = |seed, subject: &str, field: &str| Key::new(seed, subject, [field].iter());
        let first = key(1, "a", "f").name("trial", 3);
        assert_eq!(first, key(1, "a", "f").name("trial", 3));
        assert_eq!(first.len(), 32);
        for other in [
            key(2, "a", "f").name("trial", 3),
            key(1, "b", "f").name("trial", 3),
            key(1, "a", "g").name("trial", 3),
            key(1, "a", "f").name("trials", 3),
            key(1, "at", "f").name("rial", 3),
            key(1, "a", "f").name("trial", 4),
        ] {
            assert_ne!(first, other);
        }
    }
}
