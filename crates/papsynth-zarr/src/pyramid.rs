//! An image at its own size, at half of it, and so on.

use crate::array::Array;
use crate::error::{Error, argument};
use crate::sample::Kind;

/// Largest width and height.
const MAX_SIDE: usize = 1 << 31;

/// Largest side of a chunk.
const MAX_CHUNK: usize = 1 << 12;

/// Most levels.
const MAX_LEVELS: usize = 32;

/// Most chunks of a shard: an index of 64 MiB.
const MAX_ENTRIES: usize = 1 << 22;

/// How an image is cut into chunks and files.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Tiling {
    /// Side of a chunk, what a viewer reads at least, px: 1 to 4096.
    pub chunk: usize,
    /// Side of a shard of the full image, px: the chunk, or twice, four times, … as much.
    pub shard: usize,
    /// Planes of a shard, at least 1; of no meaning without an axis of them.
    pub planes: usize,
}

impl Default for Tiling {
    /// Chunks of 512 pixels, shards of 4096, each plane by itself.
    fn default() -> Self {
        Self { chunk: 512, shard: 4096, planes: 1 }
    }
}

impl Tiling {
    /// One file for a whole image: shards of this chunk and as many planes, large enough for width and height.
    #[must_use]
    pub fn whole(chunk: usize, planes: usize, width: usize, height: usize) -> Self {
        let mut shard = chunk.max(1);
        while shard < width.max(height) && shard < MAX_SIDE {
            shard *= 2;
        }
        Self { chunk, shard, planes }
    }
}

/// What an image is like.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Form {
    /// Type of its numbers.
    pub kind: Kind,
    /// Channels, if there is an axis of them.
    pub channels: Option<usize>,
    /// Planes, if there is an axis of them.
    pub planes: Option<usize>,
    /// Rows.
    pub height: usize,
    /// Columns.
    pub width: usize,
    /// How it is cut.
    pub tiling: Tiling,
    /// Levels, the full image being one: 1 to 32.
    pub levels: usize,
}

/// Levels until the longer side is at most `side` pixels.
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

/// An image at several sizes, each half of that before, rounded up.
///
/// The shards of the first [`with_shard`](Self::with_shard) levels cover the same places: as the shard of the image is halved, so is the side of
/// those of the next levels, down to one chunk. So whoever makes a shard of the image makes the files of these levels with it, from nothing but
/// that shard, and no two write one file. Of the levels above, each shard is as large as one of the image, and is made later, of
/// the four below it.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Pyramid {
    levels: Vec<Array>,
    with_shard: usize,
}

impl Pyramid {
    /// The levels of an image.
    ///
    /// # Errors
    /// If there is no pixel, or a size is out of its range.
    pub fn new(form: &Form) -> Result<Self, Error> {
        let Form { kind, channels, planes, height, width, tiling, levels } = *form;
        let Tiling { chunk, shard, planes: shard_planes } = tiling;
        // Where there is no axis of planes, none can be cut.
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
                return argument(format!("{name}: {size} is not within 1 to {most}"));
            }
        }
        if shard % chunk != 0 || !(shard / chunk).is_power_of_two() {
            return argument(format!("shard: {shard} is not {chunk} (the chunk) times a power of two"));
        }
        let along = shard / chunk;
        let entries = [shape[0], shard_planes, along, along].into_iter().try_fold(1_usize, usize::checked_mul);
        if entries.is_none_or(|entries| entries > MAX_ENTRIES) {
            return argument(format!(
                "shard: it would have more than {MAX_ENTRIES} chunks; take larger chunks or smaller shards"
            ));
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

    /// Its levels, the full image first.
    #[must_use]
    pub fn levels(&self) -> &[Array] {
        &self.levels
    }

    /// The number of levels whose shard is made with that of the image.
    #[must_use]
    pub fn with_shard(&self) -> usize {
        self.with_shard
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::array::Shard;

    fn slide() -> Form {
        Form {
            kind: Kind::U8,
            channels: None,
            planes: None,
            height: 100_000,
            width: 90_001,
            tiling: Tiling::default(),
            levels: 9,
        }
    }

    #[test]
    fn shards_of_lower_levels_cover_the_same_places() {
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
        // Above, four shards make one.
        let sides: Vec<usize> = pyramid.levels().iter().map(Array::shard).collect();
        assert_eq!(sides, [4096, 2048, 1024, 512, 4096, 4096, 4096, 4096, 4096]);
        assert_eq!(pyramid.levels()[8].shape(), [1, 1, 391, 352]);
    }

    #[test]
    fn every_pixel_lies_in_the_one_shard_that_says_so() {
        let form = Form { planes: Some(5), channels: Some(3), height: 70, width: 33, levels: 3, ..slide() };
        let pyramid = Pyramid::new(&Form { tiling: Tiling { chunk: 8, shard: 16, planes: 2 }, ..form }).unwrap();
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
    fn sizes_out_of_range_are_refused_by_name() {
        let with = |change: fn(&mut Form)| {
            let mut form = slide();
            change(&mut form);
            Pyramid::new(&form).unwrap_err().to_string()
        };
        assert_eq!(with(|f| f.width = 0), "width: 0 is not within 1 to 2147483648");
        assert_eq!(with(|f| f.levels = 33), "levels: 33 is not within 1 to 32");
        assert_eq!(with(|f| f.tiling.shard = 1536), "shard: 1536 is not 512 (the chunk) times a power of two");
        assert_eq!(with(|f| f.channels = Some(0)), "channels: 0 is not within 1 to 4194304");
        assert!(with(|f| f.tiling = Tiling { chunk: 1, shard: 1 << 20, planes: 1 }).contains("4194304 chunks"));
        assert!(with(|f| (f.planes, f.tiling.planes) = (Some(1), usize::MAX)).contains("planes of a shard"));
    }

    #[test]
    fn one_shard_is_enough_for_a_whole_image() {
        assert_eq!(Tiling::whole(512, 3, 1376, 1038), Tiling { chunk: 512, shard: 2048, planes: 3 });
        assert_eq!(Tiling::whole(512, 1, 100, 3), Tiling { chunk: 512, shard: 512, planes: 1 });
        assert_eq!([levels_until(512, 1376, 1038), levels_until(512, 512, 1), levels_until(512, 513, 1)], [3, 1, 2]);
    }
}
