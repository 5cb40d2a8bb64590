//! Compression of runs of equal samples as a zlib stream (RFC 1950 and 1951). Its time is proportional to the number of
//! runs, not of samples.
//!
//! A run is the bytes of its first sample as literals, then matches at the distance of one sample. All streams use the
//! same Huffman codes, which are short for zeros and for long matches.

/// Largest length of a match.
const LONGEST: usize = 258;

/// Smallest length of a match.
const SHORTEST: usize = 3;

/// Code lengths of literals and matches, bits. They make a complete code: 2/4 + 12/32 + 16/256 + 256/4096 = 1.
const SYMBOL_BITS: [u32; 286] = {
    let mut bits = [12; 286];
    (bits[0], bits[285]) = (2, 2);
    let mut symbol = 257;
    while symbol < 285 {
        bits[symbol] = if symbol < 273 { 8 } else { 5 };
        symbol += 1;
    }
    bits
};

/// Code lengths of distances, bits: code 1 is the distance 2, code 3 the distance 4.
const DISTANCE_BITS: [u32; 4] = [0, 1, 0, 1];

/// Code lengths of the code lengths above, bits.
const LENGTH_BITS: [u32; 13] = [3, 4, 4, 0, 0, 3, 0, 0, 3, 0, 0, 0, 1];

/// Order in which a stream lists the code lengths of code lengths.
const LENGTH_ORDER: [usize; 18] = [16, 17, 18, 0, 8, 7, 9, 6, 10, 5, 11, 4, 12, 3, 13, 2, 14, 1];

const SYMBOLS: [u64; 286] = codes(&SYMBOL_BITS);
const DISTANCES: [u64; 4] = codes(&DISTANCE_BITS);
const LENGTHS: [u64; 13] = codes(&LENGTH_BITS);

/// Symbol of the end of a block.
const END: usize = 256;

/// Returns the Huffman codes of these lengths, in the bit order of a stream.
const fn codes<const N: usize>(bits: &[u32; N]) -> [u64; N] {
    let mut codes = [0; N];
    let (mut next, mut length) = (0_u64, 1);
    while length < 16 {
        let mut symbol = 0;
        while symbol < N {
            if bits[symbol] == length {
                codes[symbol] = next.reverse_bits() >> (64 - length);
                next += 1;
            }
            symbol += 1;
        }
        next <<= 1;
        length += 1;
    }
    codes
}

/// Compresses runs of equal samples of `N` bytes, 2 or 4. A run is the bytes of its sample, and the number of samples.
pub(super) fn compressed_runs<const N: usize>(runs: impl Iterator<Item = ([u8; N], usize)>) -> Vec<u8> {
    // Compression method 8, window of 32 KiB, fastest level.
    let mut out = BitWriter { bytes: vec![0x78, 0x01], bits: 0, count: 0 };
    let mut checksum = Adler { a: 1, b: 0 };
    out.begin_block();
    for (sample, count) in runs.filter(|(_, count)| *count > 0) {
        checksum.add(sample, count);
        out.literals(sample);
        let mut left = N * (count - 1);
        while left >= SHORTEST {
            // A rest that is too short for a match is avoided.
            let length = match left {
                ..=LONGEST => left,
                left if left < LONGEST + SHORTEST => LONGEST - SHORTEST,
                _ => LONGEST,
            };
            out.repeat::<N>(length);
            left -= length;
        }
        if left > 0 {
            out.literals(sample);
        }
    }
    out.symbol(END);
    out.ended(checksum)
}

/// Writes bits, the lowest first.
struct BitWriter {
    bytes: Vec<u8>,
    bits: u64,
    count: u32,
}

impl BitWriter {
    /// Writes the lowest `count` bits, at most 32.
    fn put(&mut self, bits: u64, count: u32) {
        self.bits |= bits << self.count;
        self.count += count;
        if self.count >= 32 {
            self.bytes.extend_from_slice(&self.bits.to_le_bytes()[..4]);
            self.bits >>= 32;
            self.count -= 32;
        }
    }

    fn symbol(&mut self, symbol: usize) {
        self.put(SYMBOLS[symbol], SYMBOL_BITS[symbol]);
    }

    fn literals<const N: usize>(&mut self, bytes: [u8; N]) {
        bytes.into_iter().for_each(|byte| self.symbol(byte.into()));
    }

    /// Repeats the last `N` bytes until `length` bytes are written.
    fn repeat<const N: usize>(&mut self, length: usize) {
        let beyond = length - SHORTEST;
        let (code, extra) = match length {
            LONGEST => (28, 0),
            _ if beyond < 8 => (beyond, 0),
            _ => {
                let extra = beyond.ilog2() - 2;
                (4 * extra as usize + (beyond >> extra), extra)
            }
        };
        let (symbol, bits) = (SYMBOLS[257 + code], SYMBOL_BITS[257 + code]);
        let rest = (beyond & ((1 << extra) - 1)) as u64 | DISTANCES[N - 1] << extra;
        self.put(symbol | rest << bits, bits + extra + DISTANCE_BITS[N - 1]);
    }

    /// Begins the last block of the stream, with the code lengths of its symbols.
    fn begin_block(&mut self) {
        self.put(1, 1);
        self.put(2, 2);
        self.put(SYMBOL_BITS.len() as u64 - 257, 5);
        self.put(DISTANCE_BITS.len() as u64 - 1, 5);
        self.put(LENGTH_ORDER.len() as u64 - 4, 4);
        for length in LENGTH_ORDER {
            self.put(LENGTH_BITS.get(length).copied().unwrap_or(0).into(), 3);
        }
        for length in SYMBOL_BITS.into_iter().chain(DISTANCE_BITS) {
            self.put(LENGTHS[length as usize], LENGTH_BITS[length as usize]);
        }
    }

    /// Returns the stream with its checksum.
    fn ended(mut self, checksum: Adler) -> Vec<u8> {
        let whole = self.count.div_ceil(8) as usize;
        self.bytes.extend_from_slice(&self.bits.to_le_bytes()[..whole]);
        self.bytes.extend(checksum.bytes());
        self.bytes
    }
}

/// The checksum Adler-32 of bytes that are given as runs.
struct Adler {
    a: u64,
    b: u64,
}

impl Adler {
    const MODULUS: u64 = 65_521;

    /// Adds `count` times the bytes of a sample.
    fn add<const N: usize>(&mut self, sample: [u8; N], count: usize) {
        let (size, count) = (N as u64, count as u64 % Self::MODULUS);
        let sum: u64 = sample.iter().map(|&byte| u64::from(byte)).sum();
        let weighted: u64 = sample.iter().zip((1..=size).rev()).map(|(&byte, weight)| weight * u64::from(byte)).sum();
        // Sums of the arithmetic series that byte by byte additions make.
        let pairs = count * count.saturating_sub(1) / 2 % Self::MODULUS;
        self.b = (self.b + count * (size * self.a + weighted) + size * sum * pairs) % Self::MODULUS;
        self.a = (self.a + count * sum) % Self::MODULUS;
    }

    fn bytes(&self) -> [u8; 4] {
        let [.., b1, b0] = self.b.to_be_bytes();
        let [.., a1, a0] = self.a.to_be_bytes();
        [b1, b0, a1, a0]
    }
}

#[cfg(test)]
mod tests {
    use miniz_oxide::inflate::decompress_to_vec_zlib;
    use proptest::prelude::*;

    use super::*;

    /// Compresses runs, decompresses them with another implementation, which checks the checksum, and compares.
    fn check<const N: usize>(runs: &[([u8; N], usize)]) -> usize {
        let bytes: Vec<u8> = runs.iter().flat_map(|(sample, count)| sample.repeat(*count)).collect();
        let compressed = compressed_runs(runs.iter().copied());
        assert_eq!(decompress_to_vec_zlib(&compressed).unwrap(), bytes);
        compressed.len()
    }

    #[test]
    fn codes_are_complete() {
        for bits in [&SYMBOL_BITS[..], &DISTANCE_BITS, &LENGTH_BITS] {
            let sum: u32 = bits.iter().filter(|bits| **bits > 0).map(|&bits| (1 << 16) >> bits).sum();
            assert_eq!(sum, 1 << 16);
        }
    }

    #[test]
    fn runs_of_every_length_and_byte_are_decompressed() {
        check::<2>(&[]);
        let lengths = (0..700).chain([65_520, 65_521, 65_522, 131_072, 200_000]);
        let runs: Vec<_> = lengths.map(|length| (u16::try_from(length % 509).unwrap().to_le_bytes(), length)).collect();
        check(&runs);
        check(&runs.iter().map(|&([a, b], length)| ([a, b, b, a], length)).collect::<Vec<_>>());
        let bytes: Vec<_> = (0..=255).map(|byte| ([byte, 255 - byte], 1)).collect();
        check(&bytes);
        // A megabyte of one sample.
        assert!(check(&[([0; 2], 1 << 19)]) < 1600);
    }

    proptest! {
        #[test]
        fn any_runs_are_decompressed(runs in prop::collection::vec((any::<[u8; 4]>(), 0_usize..3000), 0..60)) {
            check(&runs);
            check(&runs.iter().map(|&([a, b, ..], length)| ([a, b], length)).collect::<Vec<_>>());
        }
    }
}
