//! Pyramids: an image at full size, half size, and so on.

use crate::array::Array;
use crate::error::{Error, argument};
use crate::sample::DataType;

/// Largest width and height.
const MAX_SIDE: usize = 1 << 31;

/// Largest width and height of a chunk.
const MAX_CHUNK: usize = 1 << 12;

/// Largest number of levels.
const MAX_LEVELS: usize = 32;

/// Largest number of chunks of a shard, with an index of 64 MiB.
const MAX_ENTRIES: usize = 1 << 22;

/// Sizes of chunks and shards.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Tiling {
    /// Width and height of a chunk, the smallest unit that a viewer reads, px: 1 to 4096.
    pub chunk: usize,
    /// Width and height of a shard of the full image, px: the chunk times a power of two.
    pub shard: usize,
    /// Number of planes of a shard, at least 1. Ignored without a z axis.
    pub planes: usize,
}

impl Default for Tiling {
    /// Chunks of 512 pixels, shards of 4096 pixels and one plane.
    fn default() -> Self {
        Self { chunk: 512, shard: 4096, planes: 1 }
    }
}

impl Tiling {
    /// Returns a tiling with one shard for the complete image.
    #[must_use]
    pub fn whole(chunk: usize, planes: usize, width: usize, height: usize) -> Self {
        let mut shard = chunk.max(1);
        while shard < width.max(height) && shard < MAX_SIDE {
            shard *= 2;
        }
        Self { chunk, shard, planes }
    }
}

/// Shape, data type and tiling of an image and its levels.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct PyramidShape {
    /// Data type.
    pub kind: DataType,
    /// Number of channels, or `None` for no c axis.
    pub channels: Option<usize>,
    /// Number of planes, or `None` for no z axis.
    pub planes: Option<usize>,
    /// Rows.
    pub height: usize,
    /// Columns.
    pub width: usize,
    /// Sizes of chunks and shards.
    pub tiling: Tiling,
    /// Number of levels with that of the full image: 1 to 32.
    pub levels: usize,
}

/// Returns the number of levels until width and height are at most `side` pixels.
#[must_use]
pub fn levels_until(side: usize, width: usize, height: usize) -> usize {
    let mut longer = width.max(height);
    let mut levels = 1;
    while longer > side.max(1) {
        longer = longer.div_ceil(2);
        levels += 1;
    }
    levels
}

/// An image at several sizes. Each is half of the previous one, rounded up.
///
/// The shards of the first [`with_shard`](Self::with_shard) levels cover the same regions: their width is halved from
/// level to level, down to one chunk. The process that writes a shard of the image also writes the files of these
/// levels, from this shard alone, and no two processes write the same file. In the levels above, shards have the full
/// width. They are written later, each from four shards below.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Pyramid {
    levels: Vec<Array>,
    with_shard: usize,
}

impl Pyramid {
    /// Creates the levels of an image.
    ///
    /// # Errors
    /// If a size is 0 or out of range.
    pub fn new(pyramid_shape: &PyramidShape) -> Result<Self, Error> {
        let PyramidShape { kind, channels, planes, height, width, tiling, levels } = *pyramid_shape;
        let Tiling { chunk, shard, planes: shard_planes } = tiling;
        // Ignored without a z axis.
        let shard_planes = if planes.is_some() { shard_planes } else { 1 };
        let shape = [channels.unwrap_or(1), planes.unwrap_or(1), height, width];
        for (name, size, most) in [
            ("channels", shape[0], MAX_ENTRIES),
            ("planes", shape[1], MAX_ENTRIES),
            ("height", height, MAX_SIDE),
            ("width", width, MAX_SIDE),
            ("chunk", chunk, MAX_CHUNK),
            ("shard", shard, MAX_SIDE),
            ("planes of a shard", shard_planes, MAX_ENTRIES),
            ("levels", levels, MAX_LEVELS),
        ] {
            if !(1..=most).contains(&size) {
                return argument(format!("{name}: {size} is out of range: expected 1 to {most}"));
            }
        }
        if shard % chunk != 0 || !(shard / chunk).is_power_of_two() {
            return argument(format!("shard: found {shard}; expected the chunk ({chunk}) times a power of two"));
        }
        let along = shard / chunk;
        let entries = [shape[0], shard_planes, along, along].into_iter().try_fold(1_usize, usize::checked_mul);
        if entries.is_none_or(|entries| entries > MAX_ENTRIES) {
            return argument(format!("shard: more than {MAX_ENTRIES} chunks; use larger chunks or smaller shards"));
        }
        let local = along.ilog2() as usize + 1;
        let level = |level: usize| {
            let side = |full: usize| full.div_ceil(1 << level);
            Array {
                kind,
                has: [channels.is_some(), planes.is_some()],
                shape: [shape[0], shape[1], side(height), side(width)],
                chunk,
                shard: if level < local { shard >> level } else { shard },
                shard_planes,
            }
        };
        Ok(Self { levels: (0..levels).map(level).collect(), with_shard: local.min(levels) })
    }

    /// Returns the levels, the full image first.
    #[must_use]
    pub fn levels(&self) -> &[Array] {
        &self.levels
    }

    /// Returns the number of levels whose shards cover the same regions as those of the image.
    #[must_use]
    pub fn with_shard(&self) -> usize {
        self.with_shard
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::array::Shard;

    fn slide() -> PyramidShape {
        PyramidShape {
            kind: DataType::U8,
            channels: None,
            planes: None,
            height: 100_000,
            width: 90_001,
            tiling: Tiling::default(),
            levels: 9,
        }
    }

    #[test]
    fn shards_of_lower_levels_cover_the_same_regions() {
        let pyramid = Pyramid::new(&slide()).unwrap();
        assert_eq!(pyramid.with_shard(), 4);
        let full: Vec<Shard> = pyramid.levels()[0].shards().collect();
        assert_eq!(full.len(), 25 * 22);
        for (number, level) in pyramid.levels().iter().enumerate().take(pyramid.with_shard()) {
            assert!(level.shards().eq(full.iter().copied()), "level {number}");
            for &shard in &full {
                let (whole, half) = (pyramid.levels()[0].block(shard).unwrap(), level.block(shard).unwrap());
                let scaled = |range: std::ops::Range<usize>| (range.start >> number)..range.end.div_ceil(1 << number);
                assert_eq!((half.rows, half.columns), (scaled(whole.rows), scaled(whole.columns)));
            }
        }
        // Above, a shard covers four below.
        let sides: Vec<usize> = pyramid.levels().iter().map(Array::shard).collect();
        assert_eq!(sides, [4096, 2048, 1024, 512, 4096, 4096, 4096, 4096, 4096]);
        assert_eq!(pyramid.levels()[8].shape(), [1, 1, 391, 352]);
    }

    #[test]
    fn every_pixel_is_in_exactly_one_shard() {
        let pyramid_shape =
            PyramidShape { planes: Some(5), channels: Some(3), height: 70, width: 33, levels: 3, ..slide() };
        let pyramid =
            Pyramid::new(&PyramidShape { tiling: Tiling { chunk: 8, shard: 16, planes: 2 }, ..pyramid_shape }).unwrap();
        for level in pyramid.levels() {
            let [_, planes, rows, columns] = level.shape();
            let mut seen = vec![0; planes * rows * columns];
            for shard in level.shards() {
                let block = level.block(shard).unwrap();
                for (z, y, x) in block.planes.clone().flat_map(|z| {
                    let columns = block.columns.clone();
                    block.rows.clone().flat_map(move |y| columns.clone().map(move |x| (z, y, x)))
                }) {
                    assert_eq!(level.shard_of(z, y, x), shard);
                    seen[(z * rows + y) * columns + x] += 1;
                }
            }
            assert!(seen.iter().all(|&n| n == 1));
            assert!(level.block(Shard { z: 3, y: 0, x: 0 }).is_err());
        }
        assert_eq!(pyramid.levels()[0].file(Shard { z: 1, y: 2, x: 0 }), "c/0/1/2/0");
        assert_eq!(Pyramid::new(&slide()).unwrap().levels()[0].file(Shard { z: 0, y: 3, x: 5 }), "c/3/5");
    }

    #[test]
    fn sizes_out_of_range_are_named_in_errors() {
        let with = |change: fn(&mut PyramidShape)| {
            let mut pyramid_shape = slide();
            change(&mut pyramid_shape);
            Pyramid::new(&pyramid_shape).unwrap_err().to_string()
        };
        assert_eq!(with(|f| f.width = 0), "width: 0 is out of range: expected 1 to 2147483648");
        assert_eq!(with(|f| f.levels = 33), "levels: 33 is out of range: expected 1 to 32");
        assert_eq!(with(|f| f.tiling.shard = 1536), "shard: found 1536; expected the chunk (512) times a power of two");
        assert_eq!(with(|f| f.channels = Some(0)), "channels: 0 is out of range: expected 1 to 4194304");
        assert!(with(|f| f.tiling = Tiling { chunk: 1, shard: 1 << 20, planes: 1 }).contains("4194304 chunks"));
        assert!(with(|f| (f.planes, f.tiling.planes) = (Some(1), usize::MAX)).contains("planes of a shard"));
    }

    #[test]
    fn a_tiling_can_have_one_shard_for_the_complete_image() {
        assert_eq!(Tiling::whole(512, 3, 1376, 1038), Tiling { chunk: 512, shard: 2048, planes: 3 });
        assert_eq!(Tiling::whole(512, 1, 100, 3), Tiling { chunk: 512, shard: 512, planes: 1 });
        assert_eq!([levels_until(512, 1376, 1038), levels_until(512, 512, 1), levels_until(512, 513, 1)], [3, 1, 2]);
    }
}
