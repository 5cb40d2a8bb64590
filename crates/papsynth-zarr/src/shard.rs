//! Encoding shards.

use zstd::bulk::Compressor;
use zstd::zstd_safe::CParameter;

use crate::array::{Array, Block, Shard, ZSTD_LEVEL};
use crate::error::{Error, argument};
use crate::read::span;
use crate::sample::Sample;

/// Index entry of a missing chunk.
pub(crate) const ABSENT: [u64; 2] = [u64::MAX; 2];

/// Encodes a shard plane by plane. The caller appends the returned bytes to the file, the index last. Equal values give
/// equal bytes.
///
/// All chunks are written, also those of zeros, so a missing chunk or file is damage.
#[derive(Debug)]
pub struct ShardEncoder {
    array: Array,
    block: Block,
    index: Vec<[u64; 2]>,
    /// Number of bytes returned so far.
    bytes: u64,
}

impl ShardEncoder {
    /// Begins a shard of an array.
    ///
    /// # Errors
    /// If the shard is outside the array.
    pub fn new(array: &Array, shard: Shard) -> Result<Self, Error> {
        let block = array.block(shard)?;
        Ok(Self { array: array.clone(), block, index: vec![ABSENT; array.entries()], bytes: 0 })
    }

    /// Returns the part of the array in the shard.
    #[must_use]
    pub fn block(&self) -> &Block {
        &self.block
    }

    /// Encodes one channel of one plane (indices of the array). `values` are those of the [`Block`] in row-major order.
    /// Planes may come in any order, each once.
    ///
    /// # Errors
    /// If the plane is not in the shard or was encoded before, `T` differs from the data type of the array, the number
    /// of values differs from the number of pixels, or the compressor has no memory.
    pub fn plane<T: Sample>(&mut self, channel: usize, plane: usize, values: &[T]) -> Result<Vec<u8>, Error> {
        let (array, block) = (&self.array, &self.block);
        if T::KIND != array.kind {
            return argument(format!("cannot write {} to an array of {}", T::KIND.name(), array.kind.name()));
        }
        if values.len() != block.pixels() {
            let [rows, columns] = [block.rows.len(), block.columns.len()];
            return argument(format!("{} values for a block of {rows} x {columns} pixels", values.len()));
        }
        if channel >= array.shape[0] || !block.planes.contains(&plane) {
            return argument(format!(
                "channel {channel} of plane {plane} is not in the shard of the planes {}",
                span(&block.planes)
            ));
        }
        let within = plane - block.planes.start;
        if self.index[array.entry(channel, within, 0, 0)] != ABSENT {
            return argument(format!("channel {channel} of plane {plane} is already written"));
        }
        let mut zstd = Compressor::new(ZSTD_LEVEL)?;
        zstd.set_parameter(CParameter::ChecksumFlag(true))?;
        let (side, width) = (array.chunk, block.columns.len());
        let mut out = Vec::new();
        let mut chunk = Vec::with_capacity(array.chunk_bytes());
        for row in 0..block.rows.len().div_ceil(side) {
            for column in 0..width.div_ceil(side) {
                let columns = column * side..((column + 1) * side).min(width);
                chunk.clear();
                // Outside the array, values are 0.
                for line in values.chunks_exact(width).skip(row * side).take(side) {
                    T::put(&line[columns.clone()], &mut chunk);
                    chunk.resize(chunk.len() + (side - columns.len()) * T::KIND.bytes(), 0);
                }
                chunk.resize(array.chunk_bytes(), 0);
                let packed = zstd.compress(&chunk)?;
                let entry = array.entry(channel, within, row, column);
                self.index[entry] = [self.bytes, packed.len() as u64];
                self.bytes += packed.len() as u64;
                out.extend(packed);
            }
        }
        Ok(out)
    }

    /// Returns the last bytes of the file: the index and its checksum.
    ///
    /// # Errors
    /// If a channel of a plane is missing.
    pub fn end(self) -> Result<Vec<u8>, Error> {
        let (array, block) = (&self.array, &self.block);
        for plane in block.planes.clone() {
            for channel in 0..array.shape[0] {
                if self.index[array.entry(channel, plane - block.planes.start, 0, 0)] == ABSENT {
                    return argument(format!("channel {channel} of plane {plane} is missing"));
                }
            }
        }
        let mut bytes: Vec<u8> = self.index.iter().flatten().flat_map(|number| number.to_le_bytes()).collect();
        bytes.extend(crc32c::crc32c(&bytes).to_le_bytes());
        Ok(bytes)
    }
}

/// Encodes a complete shard. `values` are those of its [`Block`]: channel by channel, plane by plane, row by row.
///
/// # Errors
/// If the shard is outside the array, `T` differs from the data type of the array, the number of values is wrong, or
/// the compressor has no memory.
pub fn shard_bytes<T: Sample>(array: &Array, shard: Shard, values: &[T]) -> Result<Vec<u8>, Error> {
    let mut encoder = ShardEncoder::new(array, shard)?;
    let Block { planes, .. } = encoder.block.clone();
    let (pixels, channels) = (encoder.block.pixels(), array.shape[0]);
    if values.len() != pixels * planes.len() * channels {
        return argument(format!(
            "{} values for {channels} channels x {} planes x {pixels} pixels",
            values.len(),
            planes.len()
        ));
    }
    let of = (0..channels).flat_map(|channel| planes.clone().map(move |plane| (channel, plane)));
    let mut bytes = Vec::new();
    for ((channel, plane), values) in of.zip(values.chunks_exact(pixels)) {
        bytes.extend(encoder.plane(channel, plane, values)?);
    }
    bytes.extend(encoder.end()?);
    Ok(bytes)
}
