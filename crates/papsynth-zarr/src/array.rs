//! Arrays: their shape, and the files of their shards.

use std::ops::Range;

use serde_json::{Value, json};

use crate::error::{Error, argument};
use crate::sample::DataType;

/// Compression level of zstd. Higher levels are slower and hardly improve the compression of noise.
pub(crate) const ZSTD_LEVEL: i32 = 1;

/// Grid index of a shard in its array.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Default)]
pub struct Shard {
    /// Index along z.
    pub z: usize,
    /// Index along y.
    pub y: usize,
    /// Index along x.
    pub x: usize,
}

/// The part of an array in a shard. It is smaller than the shard at the border of the array.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Block {
    /// Range of planes in the array.
    pub planes: Range<usize>,
    /// Range of rows in the array.
    pub rows: Range<usize>,
    /// Range of columns in the array.
    pub columns: Range<usize>,
}

impl Block {
    /// Returns the number of pixels of one channel of one plane.
    #[must_use]
    pub fn pixels(&self) -> usize {
        self.rows.len() * self.columns.len()
    }
}

/// One level of a [`Pyramid`](crate::Pyramid): a Zarr 3 array in shards. Each shard is a file.
///
/// A chunk, the unit of compression, is a square of one channel and plane. A shard has the chunks of a square of all
/// channels and of some planes. Its file ends with an index and the checksum of the index.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Array {
    pub(crate) kind: DataType,
    /// Whether there are axes c and z.
    pub(crate) has: [bool; 2],
    /// Channels, planes, rows, columns.
    pub(crate) shape: [usize; 4],
    /// Width and height of a chunk.
    pub(crate) chunk: usize,
    /// Width and height of a shard.
    pub(crate) shard: usize,
    /// Number of planes of a shard.
    pub(crate) shard_planes: usize,
}

impl Array {
    /// Returns the data type.
    #[must_use]
    pub fn kind(&self) -> DataType {
        self.kind
    }

    /// Returns the number of channels, planes, rows and columns; 1 for a missing axis.
    #[must_use]
    pub fn shape(&self) -> [usize; 4] {
        self.shape
    }

    /// Returns the width and height of a chunk, px.
    #[must_use]
    pub fn chunk(&self) -> usize {
        self.chunk
    }

    /// Returns the width and height of a shard, px.
    #[must_use]
    pub fn shard(&self) -> usize {
        self.shard
    }

    /// Returns all shards, plane by plane in row-major order. All of their files must exist, because readers treat a
    /// missing file as zeros.
    pub fn shards(&self) -> impl Iterator<Item = Shard> + use<> {
        let [_, planes, rows, columns] = self.shape;
        let [z, y, x] = [planes.div_ceil(self.shard_planes), rows.div_ceil(self.shard), columns.div_ceil(self.shard)];
        (0..z).flat_map(move |z| (0..y).flat_map(move |y| (0..x).map(move |x| Shard { z, y, x })))
    }

    /// Returns the shard of a pixel. The pixel must be in the array.
    #[must_use]
    pub fn shard_of(&self, plane: usize, row: usize, column: usize) -> Shard {
        Shard { z: plane / self.shard_planes, y: row / self.shard, x: column / self.shard }
    }

    /// Returns the part of the array in a shard.
    ///
    /// # Errors
    /// If the shard is outside the array.
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
            _ => argument(format!(
                "the shard (z, y, x) = ({}, {}, {}) is outside the array of {planes} x {rows} x {columns} pixels",
                shard.z, shard.y, shard.x
            )),
        }
    }

    /// Returns the path of the file of a shard in the folder of the array, for example `c/0/3/5`.
    #[must_use]
    pub fn file(&self, shard: Shard) -> String {
        // All channels are in the same shard.
        let numbers = self.of_axes([0, shard.z, shard.y, shard.x]);
        numbers.iter().fold("c".to_owned(), |path, number| format!("{path}/{number}"))
    }

    /// Returns the content of `zarr.json`.
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
            "fill_value": if self.kind == DataType::F32 { json!(0.0) } else { json!(0) },
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

    /// Selects from values for c, z, y and x those of the axes of the array.
    pub(crate) fn of_axes<T>(&self, values: [T; 4]) -> Vec<T> {
        let has = [self.has[0], self.has[1], true, true];
        values.into_iter().zip(has).filter_map(|(value, has)| has.then_some(value)).collect()
    }

    /// Number of chunks in a row of a shard.
    pub(crate) fn chunks(&self) -> usize {
        self.shard / self.chunk
    }

    /// Number of entries in the index of a shard.
    pub(crate) fn entries(&self) -> usize {
        self.shape[0] * self.shard_planes * self.chunks() * self.chunks()
    }

    /// Returns the index entry of a chunk, from its channel, and its plane, row and column within the shard.
    pub(crate) fn entry(&self, channel: usize, plane: usize, row: usize, column: usize) -> usize {
        ((channel * self.shard_planes + plane) * self.chunks() + row) * self.chunks() + column
    }

    /// Size of an uncompressed chunk, bytes.
    pub(crate) fn chunk_bytes(&self) -> usize {
        self.chunk * self.chunk * self.kind.bytes()
    }
}
