//! One array: how many numbers there are, and which file each lies in.

use std::ops::Range;

use serde_json::{Value, json};

use crate::error::{Error, argument};
use crate::sample::Kind;

/// Level of zstd: noise hardly shrinks at any, and this one is fast.
pub(crate) const ZSTD_LEVEL: i32 = 3;

/// The place of a shard among those of its array, counted along z, y and x.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Default)]
pub struct Shard {
    /// Along z.
    pub z: usize,
    /// Downwards.
    pub y: usize,
    /// To the right.
    pub x: usize,
}

/// The part of an array that a shard holds; at the border less than a shard could.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Block {
    /// Planes of the array.
    pub planes: Range<usize>,
    /// Rows of the array.
    pub rows: Range<usize>,
    /// Columns of the array.
    pub columns: Range<usize>,
}

impl Block {
    /// Pixels of one channel of one plane.
    #[must_use]
    pub fn pixels(&self) -> usize {
        self.rows.len() * self.columns.len()
    }
}

/// One level of a [`Pyramid`](crate::Pyramid): an array of Zarr 3 in shards, each a file.
///
/// Chunks, which readers decompress one by one, are squares of one channel and plane. A shard holds the chunks of a square of all channels and of
/// some planes; its file ends with an index and the checksum of that.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Array {
    pub(crate) kind: Kind,
    /// Whether there are axes c and z.
    pub(crate) has: [bool; 2],
    /// Channels, planes, rows, columns.
    pub(crate) shape: [usize; 4],
    /// Side of a chunk.
    pub(crate) chunk: usize,
    /// Side of a shard.
    pub(crate) shard: usize,
    /// Planes of a shard.
    pub(crate) shard_planes: usize,
}

impl Array {
    /// The type of its numbers.
    #[must_use]
    pub fn kind(&self) -> Kind {
        self.kind
    }

    /// Channels, planes, rows and columns; 1 along an axis that it does not have.
    #[must_use]
    pub fn shape(&self) -> [usize; 4] {
        self.shape
    }

    /// Side of a chunk, px.
    #[must_use]
    pub fn chunk(&self) -> usize {
        self.chunk
    }

    /// Side of a shard, px.
    #[must_use]
    pub fn shard(&self) -> usize {
        self.shard
    }

    /// Every shard, row by row and plane by plane: the files that must be there. Readers take a file that is missing for zeros.
    pub fn shards(&self) -> impl Iterator<Item = Shard> + use<> {
        let [_, planes, rows, columns] = self.shape;
        let [z, y, x] = [planes.div_ceil(self.shard_planes), rows.div_ceil(self.shard), columns.div_ceil(self.shard)];
        (0..z).flat_map(move |z| (0..y).flat_map(move |y| (0..x).map(move |x| Shard { z, y, x })))
    }

    /// The shard that a pixel lies in, which must be in the array.
    #[must_use]
    pub fn shard_of(&self, plane: usize, row: usize, column: usize) -> Shard {
        Shard { z: plane / self.shard_planes, y: row / self.shard, x: column / self.shard }
    }

    /// What a shard holds.
    ///
    /// # Errors
    /// If the array has no such shard.
    pub fn block(&self, shard: Shard) -> Result<Block, Error> {
        let [_, planes, rows, columns] = self.shape;
        let part = |number: usize, side: usize, end: usize| {
            let start = number.checked_mul(side).filter(|&start| start < end)?;
            Some(start..start.saturating_add(side).min(end))
        };
        match (
            part(shard.z, self.shard_planes, planes),
            part(shard.y, self.shard, rows),
            part(shard.x, self.shard, columns),
        ) {
            (Some(planes), Some(rows), Some(columns)) => Ok(Block { planes, rows, columns }),
            _ => argument(format!("{shard:?} lies outside an array of {planes} x {rows} x {columns} pixels (z, y, x)")),
        }
    }

    /// The path of a shard's file from the folder of the array, such as `c/0/3/5`.
    #[must_use]
    pub fn file(&self, shard: Shard) -> String {
        // All channels lie in one.
        let numbers = self.of_axes([0, shard.z, shard.y, shard.x]);
        numbers.iter().fold("c".to_owned(), |path, number| format!("{path}/{number}"))
    }

    /// The content of its `zarr.json`.
    #[must_use]
    pub fn document(&self) -> Value {
        let [channels, ..] = self.shape;
        let little = json!({ "name": "bytes", "configuration": { "endian": "little" } });
        json!({
            "zarr_format": 3,
            "node_type": "array",
            "shape": self.of_axes(self.shape),
            "data_type": self.kind.name(),
            "chunk_grid": {
                "name": "regular",
                "configuration": { "chunk_shape": self.of_axes([channels, self.shard_planes, self.shard, self.shard]) },
            },
            "chunk_key_encoding": { "name": "default", "configuration": { "separator": "/" } },
            "fill_value": if self.kind == Kind::F32 { json!(0.0) } else { json!(0) },
            "codecs": [{
                "name": "sharding_indexed",
                "configuration": {
                    "chunk_shape": self.of_axes([1, 1, self.chunk, self.chunk]),
                    "codecs": [
                        little,
                        { "name": "zstd", "configuration": { "level": ZSTD_LEVEL, "checksum": true } },
                    ],
                    "index_codecs": [little, { "name": "crc32c" }],
                    "index_location": "end",
                },
            }],
            "attributes": {},
            "dimension_names": self.of_axes(["c", "z", "y", "x"]),
        })
    }

    /// Of values for c, z, y and x those of the axes that there are.
    pub(crate) fn of_axes<T>(&self, values: [T; 4]) -> Vec<T> {
        let has = [self.has[0], self.has[1], true, true];
        values.into_iter().zip(has).filter_map(|(value, has)| has.then_some(value)).collect()
    }

    /// Chunks along a side of a shard.
    pub(crate) fn chunks(&self) -> usize {
        self.shard / self.chunk
    }

    /// Entries of a shard's index.
    pub(crate) fn entries(&self) -> usize {
        self.shape[0] * self.shard_planes * self.chunks() * self.chunks()
    }

    /// The entry of a chunk: its channel, and plane, row and column of chunks within the shard.
    pub(crate) fn entry(&self, channel: usize, plane: usize, row: usize, column: usize) -> usize {
        ((channel * self.shard_planes + plane) * self.chunks() + row) * self.chunks() + column
    }

    /// Bytes of a chunk before it is compressed.
    pub(crate) fn chunk_bytes(&self) -> usize {
        self.chunk * self.chunk * self.kind.bytes()
    }
}
