//! Reading of regions of a slide.

use std::fs::File;
use std::ops::Range;

use papsynth::truth::Group;
use papsynth_zarr::{Array, Pyramid, Sample, ShardReader};

use super::record::folder;
use super::set::{SlideSet, UPPER, place};
use crate::error::Error;

impl SlideSet {
    /// Reads rows and columns of an array inside one shard.
    pub(super) fn region<T: Sample>(
        &self,
        array: &Array,
        folder: &str,
        at: [u32; 2],
        [channel, plane]: [usize; 2],
        rows: Range<usize>,
        columns: Range<usize>,
    ) -> Result<Vec<T>, Error> {
        let shard = place(at, plane);
        let path = self.folder.path(&format!("{folder}/{}", array.file(shard)));
        let file = File::open(&path).map_err(Error::io("read", &path))?;
        let bad = |e: papsynth_zarr::Error| Error::folder(&path, e.to_string());
        let mut reader = ShardReader::open(array, shard, file).map_err(bad)?;
        reader.region(channel, plane, rows, columns).map_err(bad)
    }

    /// Reads `rows` and `columns` of a plane of a level of the image, channels interleaved.
    ///
    /// # Errors
    /// If they are outside the level, or its files are missing or damaged.
    pub fn image(
        &self,
        level: usize,
        plane: usize,
        rows: Range<usize>,
        columns: Range<usize>,
    ) -> Result<Vec<u16>, Error> {
        let channels = self.head.channels;
        let array = self.level(&self.pyramids.image, level)?;
        let mut values = vec![0; rows.len() * columns.len() * channels];
        for channel in 0..channels {
            let layer: Vec<u16> = if self.head.bits <= 8 {
                let part = self.gather::<u8>(array, &folder(None, level), [channel, plane], &rows, &columns)?;
                part.into_iter().map(u16::from).collect()
            } else {
                self.gather(array, &folder(None, level), [channel, plane], &rows, &columns)?
            };
            values[channel..].iter_mut().step_by(channels).zip(layer).for_each(|(value, grey)| *value = grey);
        }
        Ok(values)
    }

    /// Reads the ids of the visible objects of a group in a region of a level.
    ///
    /// # Errors
    /// As [`image`](Self::image).
    pub fn labels(
        &self,
        group: Group,
        level: usize,
        rows: Range<usize>,
        columns: Range<usize>,
    ) -> Result<Vec<u32>, Error> {
        let array = self.level(&self.pyramids.labels, level)?;
        self.gather(array, &folder(Some(group.name()), level), [0, 0], &rows, &columns)
    }

    /// Number of levels of the image, including the full resolution.
    #[must_use]
    pub fn levels(&self) -> usize {
        self.pyramids.image.levels().len()
    }

    /// Number of levels on the disk: all levels of a finished slide, otherwise those written with the shards.
    #[must_use]
    pub fn written_levels(&self) -> usize {
        let image = &self.pyramids.image;
        if self.folder.path(UPPER).is_file() { image.levels().len() } else { image.with_shard() }
    }

    /// Columns and rows of a level, or `None` if it does not exist.
    #[must_use]
    pub fn level_px(&self, level: usize) -> Option<[usize; 2]> {
        let array = self.pyramids.image.levels().get(level)?;
        let [_, _, rows, columns] = array.shape();
        Some([columns, rows])
    }

    fn level<'a>(&self, pyramid: &'a Pyramid, level: usize) -> Result<&'a Array, Error> {
        let levels = pyramid.levels();
        levels
            .get(level)
            .ok_or_else(|| Error::folder(self.path(), format!("level {level}: expected 0 to {}", levels.len() - 1)))
    }

    fn gather<T: Sample>(
        &self,
        array: &Array,
        folder: &str,
        of: [usize; 2],
        rows: &Range<usize>,
        columns: &Range<usize>,
    ) -> Result<Vec<T>, Error> {
        let [_, _, height, width] = array.shape();
        if rows.is_empty() || columns.is_empty() || rows.end > height || columns.end > width {
            return Err(Error::folder(
                self.path(),
                format!(
                    "rows {}, columns {}: expected a part of the level of {width} x {height} px",
                    span(rows),
                    span(columns)
                ),
            ));
        }
        let mut values = vec![T::default(); rows.len() * columns.len()];
        for (at, part_rows, part_columns) in parts(array.shard(), rows, columns) {
            let part = self.region::<T>(array, folder, at, of, part_rows.clone(), part_columns.clone())?;
            for (y, line) in part_rows.zip(part.chunks_exact(part_columns.len())) {
                let start = (y - rows.start) * columns.len() + part_columns.start - columns.start;
                values[start..start + line.len()].copy_from_slice(line);
            }
        }
        Ok(values)
    }
}

/// Returns the first and last index of a range, for messages.
fn span(range: &Range<usize>) -> String {
    if range.is_empty() { "none".to_owned() } else { format!("{} to {}", range.start, range.end - 1) }
}

/// Splits rows and columns by shards of `side` pixels. Returns column and row of each shard with its rows and columns.
pub(super) fn parts(
    side: usize,
    rows: &Range<usize>,
    columns: &Range<usize>,
) -> impl Iterator<Item = ([u32; 2], Range<usize>, Range<usize>)> {
    let cut = move |range: Range<usize>| {
        let numbers = range.start / side..range.end.div_ceil(side);
        numbers.map(move |number| (number, range.start.max(number * side)..range.end.min((number + 1) * side)))
    };
    let columns = columns.clone();
    cut(rows.clone()).flat_map(move |(row, rows)| {
        #[expect(clippy::cast_possible_truncation, reason = "a slide has fewer shards than 2³²")]
        cut(columns.clone()).map(move |(column, columns)| ([column as u32, row as u32], rows.clone(), columns))
    })
}
