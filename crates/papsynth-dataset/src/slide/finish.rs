//! Closing a slide: the upper levels of its pyramids, a thumbnail, a card.

use std::fs::File;

use papsynth::truth::Group;
use papsynth_zarr::{Array, Pyramid, Sample, ShardReader, halved, halved_labels};
use sha2::{Digest, Sha256};

use super::document::{LAYERS, folder};
use super::{SlideSet, UPPER, name_of, place, wrong};
use crate::error::Error;
use crate::files::hex;
use crate::record::{Check, FileRecord};
use crate::write;

/// Longer side of the thumbnail at most, px.
const THUMBNAIL: usize = 1024;

/// A closed slide.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Finished {
    /// Shards.
    pub shards: u64,
    /// Objects and parts of cells.
    pub objects: u64,
    /// Bytes of all files.
    pub bytes: u64,
    /// SHA-256 over names, sizes and hashes of all files: two slides of one hash are the same.
    pub root_sha256: String,
}

impl SlideSet {
    /// Makes what follows from the shards, which must all be whole: the upper levels, `thumbnail.png` and `README.md`. What is there
    /// already and the same is made again and not touched. `check` says how carefully the files of shards are looked at before.
    ///
    /// # Errors
    /// If a shard is missing or not whole, which is said, or the system refuses.
    pub fn finish(&self, check: Check) -> Result<Finished, Error> {
        let missing = self.missing(check)?;
        if let Some(&first) = missing.first() {
            return Err(wrong(
                self.path(),
                format!(
                    "{} of {} shards are missing, the first is {}; `papsynth slide make` with the same recipe makes them",
                    missing.len(),
                    self.all().count(),
                    name_of(first)
                ),
            ));
        }
        let mut files = Vec::new();
        for plane in 0..self.head.planes_um.len() {
            if self.head.bits <= 8 {
                self.upper::<u8>(&self.forms.image, None, plane, halved, &mut files)?;
            } else {
                self.upper::<u16>(&self.forms.image, None, plane, halved, &mut files)?;
            }
        }
        for group in Group::ALL {
            self.upper::<u32>(&self.forms.labels, Some(group.name()), 0, halved_labels, &mut files)?;
        }
        self.upper::<u16>(&self.forms.layers, Some(LAYERS), 0, halved_labels, &mut files)?;
        files.push(self.folder.keep("thumbnail.png", &self.thumbnail()?)?);
        let mut objects = 0;
        let mut all: Vec<FileRecord> = Vec::new();
        for at in self.all() {
            let Some(record) = self.whole(at, Check::Sizes)? else { continue };
            objects += record.objects;
            all.extend(record.files);
        }
        files.push(self.folder.keep("README.md", self.card(objects).as_bytes())?);
        self.write_record(UPPER, files.clone(), objects)?;
        all.extend(files);
        all.sort_by(|a, b| a.path.cmp(&b.path));
        let mut hash = Sha256::new();
        hash.update(self.head.sha256().as_bytes());
        for file in &all {
            hash.update(format!("{}\0{}\0{}\n", file.path, file.bytes, file.sha256).as_bytes());
        }
        Ok(Finished {
            shards: self.all().count() as u64,
            objects,
            bytes: all.iter().map(|file| file.bytes).sum(),
            root_sha256: hex(&hash.finalize()),
        })
    }

    /// The levels that no shard makes, each of the one below.
    fn upper<T: Sample>(
        &self,
        pyramid: &Pyramid,
        labels: Option<&str>,
        plane: usize,
        halve: fn(&[T], usize) -> Vec<T>,
        files: &mut Vec<FileRecord>,
    ) -> Result<(), Error> {
        for level in pyramid.with_shard()..pyramid.levels().len() {
            let (array, below) = (&pyramid.levels()[level], &pyramid.levels()[level - 1]);
            for shard in array.shards().filter(|shard| shard.z == 0) {
                #[expect(clippy::cast_possible_truncation, reason = "a slide has fewer shards than 2³²")]
                let at = [shard.x as u32, shard.y as u32];
                let channels = (0..self.head.channels.min(array.shape()[0]))
                    .map(|channel| self.halves(array, below, &folder(labels, level - 1), at, [channel, plane], halve))
                    .collect::<Result<Vec<Vec<T>>, Error>>()?;
                files.push(self.write_array(array, &folder(labels, level), at, plane, &channels)?);
            }
        }
        Ok(())
    }

    /// What a shard holds, from the shards of the level below that lie under it.
    fn halves<T: Sample>(
        &self,
        array: &Array,
        below: &Array,
        folder: &str,
        at: [u32; 2],
        [channel, plane]: [usize; 2],
        halve: fn(&[T], usize) -> Vec<T>,
    ) -> Result<Vec<T>, Error> {
        let bad = |e: papsynth_zarr::Error| wrong(self.path(), e.to_string());
        let block = array.block(place(at, plane)).map_err(bad)?;
        let width = block.columns.len();
        let mut values = vec![T::default(); block.pixels()];
        let [_, _, rows, columns] = below.shape();
        let under = |range: &std::ops::Range<usize>, end: usize| 2 * range.start..(2 * range.end).min(end);
        let (rows, columns) = (under(&block.rows, rows), under(&block.columns, columns));
        let side = below.shard();
        for row in rows.start / side..rows.end.div_ceil(side) {
            for column in columns.start / side..columns.end.div_ceil(side) {
                #[expect(clippy::cast_possible_truncation, reason = "a slide has fewer shards than 2³²")]
                let from = [column as u32, row as u32];
                let shared = |range: &std::ops::Range<usize>, number: usize| {
                    range.start.max(number * side)..range.end.min((number + 1) * side)
                };
                let (rows, columns) = (shared(&rows, row), shared(&columns, column));
                let part = self.region::<T>(below, folder, from, [channel, plane], rows.clone(), columns.clone())?;
                let half = halve(&part, columns.len());
                let half_width = columns.len().div_ceil(2);
                let corner = [rows.start / 2 - block.rows.start, columns.start / 2 - block.columns.start];
                for (y, line) in half.chunks_exact(half_width).enumerate() {
                    values[(corner[0] + y) * width + corner[1]..][..half_width].copy_from_slice(line);
                }
            }
        }
        Ok(values)
    }

    /// Rows and columns of an array that lie in one shard.
    fn region<T: Sample>(
        &self,
        array: &Array,
        folder: &str,
        at: [u32; 2],
        [channel, plane]: [usize; 2],
        rows: std::ops::Range<usize>,
        columns: std::ops::Range<usize>,
    ) -> Result<Vec<T>, Error> {
        let shard = place(at, plane);
        let path = self.folder.path(&format!("{folder}/{}", array.file(shard)));
        let file = File::open(&path).map_err(Error::io("read", &path))?;
        let bad = |e: papsynth_zarr::Error| wrong(&path, e.to_string());
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
        rows: std::ops::Range<usize>,
        columns: std::ops::Range<usize>,
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
        rows: std::ops::Range<usize>,
        columns: std::ops::Range<usize>,
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
        levels
            .get(level)
            .ok_or_else(|| wrong(self.path(), format!("has {} levels, and none of number {level}", levels.len())))
    }

    fn gather<T: Sample>(
        &self,
        array: &Array,
        folder: &str,
        of: [usize; 2],
        rows: &std::ops::Range<usize>,
        columns: &std::ops::Range<usize>,
    ) -> Result<Vec<T>, Error> {
        let [_, _, height, width] = array.shape();
        if rows.is_empty() || columns.is_empty() || rows.end > height || columns.end > width {
            return Err(wrong(
                self.path(),
                format!("rows {rows:?} and columns {columns:?} leave a level of {width} x {height} pixels"),
            ));
        }
        let side = array.shard();
        let mut values = vec![T::default(); rows.len() * columns.len()];
        for row in rows.start / side..rows.end.div_ceil(side) {
            for column in columns.start / side..columns.end.div_ceil(side) {
                #[expect(clippy::cast_possible_truncation, reason = "a slide has fewer shards than 2³²")]
                let at = [column as u32, row as u32];
                let shared = |range: &std::ops::Range<usize>, number: usize| {
                    range.start.max(number * side)..range.end.min((number + 1) * side)
                };
                let (part_rows, part_columns) = (shared(rows, row), shared(columns, column));
                let part = self.region::<T>(array, folder, at, of, part_rows.clone(), part_columns.clone())?;
                for (y, line) in part_rows.zip(part.chunks_exact(part_columns.len())) {
                    let start = (y - rows.start) * columns.len() + part_columns.start - columns.start;
                    values[start..start + line.len()].copy_from_slice(line);
                }
            }
        }
        Ok(values)
    }

    /// The slide as a small PNG: the middle plane.
    fn thumbnail(&self) -> Result<Vec<u8>, Error> {
        let plane = self.head.planes_um.len() / 2;
        let sizes = self.forms.image.levels().iter().map(|array| array.shape());
        let level = sizes
            .enumerate()
            .find(|(_, [_, _, rows, columns])| rows.max(columns) <= &THUMBNAIL)
            .map_or(self.levels() - 1, |(level, _)| level);
        let [width, height] = self.level_px(level).unwrap_or([1; 2]);
        let grey = self.picture(level, plane, 0..height, 0..width)?;
        let shift = self.head.bits.saturating_sub(8);
        let bytes: Vec<u16> = grey.iter().map(|grey| grey >> shift).collect();
        let pixel_um = self.head.pixel_um * f64::from(1_u32 << level);
        write::png(&bytes, width, self.head.channels, 8, pixel_um)
            .map_err(|e| wrong(self.path(), format!("thumbnail.png: {e}")))
    }

    fn card(&self, objects: u64) -> String {
        let head = &self.head;
        let um = [head.width_px, head.height_px].map(|px| f64::from(px) * head.pixel_um / 1000.0);
        format!(
            "# A synthetic slide\n\n\
             Made by papsynth; no part of it is of any patient.\n\n\
             | | |\n|---|---|\n\
             | size | {} x {} px, {:.2} x {:.2} mm, {} µm a pixel |\n\
             | focal planes, µm | {:?} |\n\
             | channels | {}, {} bits |\n\
             | objects and parts of cells | {objects} |\n\
             | seed, slide | {}, {} |\n\
             | recipe | `recipe.toml`, SHA-256 {} |\n\n\
             `slide.ome.zarr` is OME-Zarr 0.5: the picture, and as labels the front-most cytoplasm, nucleus and debris at each pixel \
             and the number of cytoplasms there (`layers`). `objects/` has a table and a GeoJSON file for every square of {} pixels, with \
             the complete mask of every object whose middle lies there; ids are those of the labels.\n\n\
             The same files come again from `papsynth slide make recipe.toml --model model.json --out DIR --seed {} --slide {} --shard-px {}{}`.\n",
            head.width_px,
            head.height_px,
            um[0],
            um[1],
            head.pixel_um,
            head.planes_um,
            head.channels,
            head.bits,
            head.identity.seed,
            head.slide,
            head.identity.recipe_sha256,
            head.shard_px,
            head.identity.seed,
            head.slide,
            head.shard_px,
            // Only builds with Parquet know the word, and write it unless told otherwise.
            if crate::parquet::IS_HERE && !head.objects_parquet { " --no-parquet" } else { "" },
        )
    }
}
