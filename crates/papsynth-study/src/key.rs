//! Random numbers, and what they hang on.

use rand_core::SeedableRng;
use rand_xoshiro::Xoshiro256PlusPlus;
use sha2::{Digest, Sha256};

/// What random numbers of a study hang on, besides what each is for.
#[derive(Debug, Clone)]
pub(crate) struct Key {
    seed: u64,
    /// SHA-256 of the hashes of all fields: who knows the program and the seed still knows no order without the fields.
    fields: [u8; 32],
    /// Empty for what all subjects share.
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

    /// The stream of one purpose, of one thing of many.
    pub(crate) fn stream(&self, purpose: &str, index: usize) -> Xoshiro256PlusPlus {
        Xoshiro256PlusPlus::from_seed(self.hash(purpose, index))
    }

    /// 32 hexadecimal digits that name one thing of a purpose and tell nothing else of it.
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
    fn every_part_of_a_key_matters_and_the_same_gives_the_same() {
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
