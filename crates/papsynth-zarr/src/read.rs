//! Reading shards.

use std::io::{Read, Seek, SeekFrom};
use std::ops::Range;

use zstd::bulk::Decompressor;

use crate::array::{Array, Block, Shard};
use crate::error::{Error, argument, damaged};
use crate::sample::Sample;
use crate::shard::ABSENT;

/// Size of an index entry, bytes.
const ENTRY: usize = 16;

/// Size of the checksum, bytes.
const CHECKSUM: usize = 4;

/// Returns the first and last index of a range, for messages.
pub(crate) fn span(range: &Range<usize>) -> String {
    if range.is_empty() { "none".to_owned() } else { format!("{} to {}", range.start, range.end - 1) }
}

/// Reads regions of a shard that [`ShardEncoder`](crate::ShardEncoder) wrote.
///
/// Memory is limited by the sizes of the array, for any file: the index, one chunk, and the region. Any change of the
/// file is an [`Error::Damaged`]: the index and each chunk have a checksum, and all chunks must exist.
#[derive(Debug)]
pub struct ShardReader<R> {
    array: Array,
    block: Block,
    index: Vec<[u64; 2]>,
    file: R,
}

impl<R: Read + Seek> ShardReader<R> {
    /// Opens the file of a shard and reads its index.
    ///
    /// # Errors
    /// If the shard is outside the array, or the file is damaged or cannot be read.
    pub fn open(array: &Array, shard: Shard, mut file: R) -> Result<Self, Error> {
        let block = array.block(shard)?;
        let size = array.entries() * ENTRY + CHECKSUM;
        let length = file.seek(SeekFrom::End(0))?;
        let Some(data) = length.checked_sub(size as u64) else {
            return damaged(format!("the file has {length} bytes; expected at least {size} for the index"));
        };
        file.seek(SeekFrom::Start(data))?;
        let mut bytes = vec![0; size];
        file.read_exact(&mut bytes)?;
        let (entries, checksum) = bytes.split_at(size - CHECKSUM);
        if crc32c::crc32c(entries).to_le_bytes() != checksum {
            return damaged("the checksum of the index is wrong".to_owned());
        }
        let number = |bytes: &[u8]| bytes.first_chunk().map_or(0, |bytes| u64::from_le_bytes(*bytes));
        let index: Vec<[u64; 2]> =
            entries.chunks_exact(ENTRY).map(|entry| [number(entry), number(&entry[ENTRY / 2..])]).collect();
        let reader = Self { array: array.clone(), block, index, file };
        reader.check(data)?;
        Ok(reader)
    }

    /// Checks that the file has exactly the chunks of the array, and no other bytes.
    fn check(&self, data: u64) -> Result<(), Error> {
        let (array, block) = (&self.array, &self.block);
        let [rows, columns] = [block.rows.len(), block.columns.len()].map(|side| side.div_ceil(array.chunk));
        let most = zstd::zstd_safe::compress_bound(array.chunk_bytes()) as u64;
        let mut left = data;
        for (number, &[start, bytes]) in self.index.iter().enumerate() {
            let (column, rest) = (number % array.chunks(), number / array.chunks());
            let (row, plane) = (rest % array.chunks(), rest / array.chunks() % array.shard_planes);
            let is_due = column < columns && row < rows && plane < block.planes.len();
            if is_due == ([start, bytes] == ABSENT) {
                let what = if is_due { "is missing" } else { "is outside the array" };
                return damaged(format!("chunk {number} {what}"));
            }
            if !is_due {
                continue;
            }
            let end = start.saturating_add(bytes);
            if end > data {
                return damaged(format!(
                    "chunk {number}: the index gives bytes {start} to {end}, but the chunk data end at byte {data}"
                ));
            }
            if bytes > most {
                return damaged(format!("chunk {number} has {bytes} bytes; expected at most {most}"));
            }
            match left.checked_sub(bytes) {
                Some(rest) => left = rest,
                None => return damaged("the chunks have more bytes than the file".to_owned()),
            }
        }
        if left == 0 { Ok(()) } else { damaged(format!("{left} bytes do not belong to a chunk")) }
    }

    /// Returns the part of the array in the shard.
    #[must_use]
    pub fn block(&self) -> &Block {
        &self.block
    }

    /// Reads rows and columns of one channel of one plane, in row-major order. All indices are those of the array and
    /// must be in the [`Block`]. All chunks of the region are decompressed, so regions along chunk borders are the
    /// fastest.
    ///
    /// # Errors
    /// If the region is not in the shard, `T` differs from the data type of the array, or the file is damaged or cannot
    /// be read.
    pub fn region<T: Sample>(
        &mut self,
        channel: usize,
        plane: usize,
        rows: Range<usize>,
        columns: Range<usize>,
    ) -> Result<Vec<T>, Error> {
        let (array, block) = (&self.array, &self.block);
        if T::KIND != array.kind {
            return argument(format!("cannot read {} from an array of {}", T::KIND.name(), array.kind.name()));
        }
        let inside = |part: &Range<usize>, whole: &Range<usize>| {
            part.start < part.end && whole.start <= part.start && part.end <= whole.end
        };
        let fits = inside(&rows, &block.rows) && inside(&columns, &block.columns);
        if !fits || !block.planes.contains(&plane) || channel >= array.shape[0] {
            return argument(format!(
                "rows {} and columns {} of channel {channel}, plane {plane} are not in the shard: planes {}, rows {}, \
                 columns {}",
                span(&rows),
                span(&columns),
                span(&block.planes),
                span(&block.rows),
                span(&block.columns)
            ));
        }
        let (side, size) = (array.chunk, array.kind.bytes());
        // From here on, indices within the shard.
        let within = plane - block.planes.start;
        let [rows, columns] = [(&rows, &block.rows), (&columns, &block.columns)]
            .map(|(part, whole)| part.start - whole.start..part.end - whole.start);
        let mut values = vec![T::default(); rows.len() * columns.len()];
        for down in rows.start / side..rows.end.div_ceil(side) {
            for right in columns.start / side..columns.end.div_ceil(side) {
                let entry = self.array.entry(channel, within, down, right);
                let chunk = self.chunk(entry)?;
                let shared = |part: &Range<usize>, number: usize| {
                    part.start.max(number * side)..part.end.min((number + 1) * side)
                };
                let across = shared(&columns, right);
                for y in shared(&rows, down) {
                    let from = &chunk[((y - down * side) * side + across.start - right * side) * size..];
                    let to = &mut values[(y - rows.start) * columns.len() + across.start - columns.start..];
                    for (value, bytes) in to[..across.len()].iter_mut().zip(from.chunks_exact(size)) {
                        *value = T::get(bytes);
                    }
                }
            }
        }
        Ok(values)
    }

    /// Reads one channel of one plane.
    ///
    /// # Errors
    /// See [`region`](Self::region).
    pub fn plane<T: Sample>(&mut self, channel: usize, plane: usize) -> Result<Vec<T>, Error> {
        let Block { rows, columns, .. } = self.block.clone();
        self.region(channel, plane, rows, columns)
    }

    /// Reads and decompresses a chunk.
    fn chunk(&mut self, entry: usize) -> Result<Vec<u8>, Error> {
        let [start, bytes] = self.index[entry];
        self.file.seek(SeekFrom::Start(start))?;
        let mut packed = Vec::new();
        // `check` has limited this size.
        self.file.by_ref().take(bytes).read_to_end(&mut packed)?;
        let size = self.array.chunk_bytes();
        let mut chunk = vec![0; size];
        match Decompressor::new()?.decompress_to_buffer(&packed, chunk.as_mut_slice()) {
            Ok(found) if found == size => Ok(chunk),
            Ok(found) => damaged(format!("chunk {entry} has {found} bytes after decompression; expected {size}")),
            Err(error) => damaged(format!("chunk {entry} cannot be decompressed: {error}")),
        }
    }
}
