//! Hashing of keys and lattice points: a field is a pure function of position, so its randomness is a hash.

/// Weyl increment of SplitMix64: 2^64 / golden ratio, odd.
const GOLDEN: u64 = 0x9E37_79B9_7F4A_7C15;

/// The finaliser of SplitMix64 (Stafford's variant 13): a bijection in which every input bit moves every output bit.
fn mix(mut z: u64) -> u64 {
    z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
    z ^ (z >> 31)
}

/// The `index`-th key derived from `key`.
pub(crate) fn derive(key: u64, index: u64) -> u64 {
    mix(key.wrapping_add(GOLDEN.wrapping_mul(index.wrapping_add(1))))
}

/// Hash of one lattice point.
pub(crate) fn lattice(key: u64, cell: [i64; 2]) -> u64 {
    derive(derive(key, cell[0].cast_unsigned()), cell[1].cast_unsigned())
}

/// A number in [0, 1) with 53 random bits.
pub(crate) fn unit(hash: u64) -> f64 {
    const SCALE: f64 = 1.0 / (1u64 << 53) as f64;
    (hash >> 11) as f64 * SCALE
}
