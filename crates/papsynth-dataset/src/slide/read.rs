//! Any part of any level of a slide, read back.

use std::fs::File;
use std::ops::Range;

use papsynth::truth::Group;
use papsynth_zarr::{Array, Pyramid, Sample, ShardReader};

use super::record::folder;
use super::set::{SlideSet, UPPER, place};
use crate::error::Error;

impl SlideSet {
    /// Rows and columns of an array that lie in one shard.
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

    /// Pixels of a part of a level of the image, channels side by side: `rows` and `columns` of a plane.
    ///
    /// # Errors
    /// If they leave the level, or its files are missing or damaged.
    pub fn picture(
        &self,
        level: usize,
        plane: usize,
        rows: Range<usize>,
        columns: Range<usize>,
    ) -> Result<Vec<u16>, Error> {
        let channels = self.head.channels;
        let array = self.level(&self.forms.image, level)?;
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

    /// Ids of the front-most objects of a group in a part of a level.
    ///
    /// # Errors
    /// As [`picture`](Self::picture).
    pub fn labels(
        &self,
        group: Group,
        level: usize,
        rows: Range<usize>,
        columns: Range<usize>,
    ) -> Result<Vec<u32>, Error> {
        let array = self.level(&self.forms.labels, level)?;
        self.gather(array, &folder(Some(group.name()), level), [0, 0], &rows, &columns)
    }

    /// Levels of the image, the full one included.
    #[must_use]
    pub fn levels(&self) -> usize {
        self.forms.image.levels().len()
    }

    /// Levels that have been made: all of a slide that was closed, else those that are made with the shards.
    #[must_use]
    pub fn levels_there(&self) -> usize {
        let image = &self.forms.image;
        if self.folder.path(UPPER).is_file() { image.levels().len() } else { image.with_shard() }
    }

    /// Columns and rows of a level; nothing if there is none.
    #[must_use]
    pub fn level_px(&self, level: usize) -> Option<[usize; 2]> {
        let array = self.forms.image.levels().get(level)?;
        let [_, _, rows, columns] = array.shape();
        Some([columns, rows])
    }

    fn level<'a>(&self, pyramid: &'a Pyramid, level: usize) -> Result<&'a Array, Error> {
        let levels = pyramid.levels();
        levels.get(level).ok_or_else(|| {
            Error::folder(self.path(), format!("has {} levels, and none of number {level}", levels.len()))
        })
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
                format!("rows {rows:?} and columns {columns:?} leave a level of {width} x {height} pixels"),
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

/// The shards of so many pixels a side in which these rows and columns lie, as column and row, and which of them lie in each.
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
