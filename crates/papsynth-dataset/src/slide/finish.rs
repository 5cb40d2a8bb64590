//! The last step of a slide: the upper levels of its pyramids, a thumbnail, a card.

use std::ops::Range;

use papsynth::truth::Group;
use papsynth_zarr::{Array, Pyramid, Sample, halved, halved_labels};
use sha2::{Digest, Sha256};

use super::read::parts;
use super::record::{LAYERS, folder};
use super::set::{CARD, SlideSet, THUMBNAIL, UPPER, name_of, place};
use crate::bytes::hex;
use crate::error::Error;
use crate::files::{Check, FileRecord};
use crate::formats::HAS_PARQUET;
use crate::write;

/// Largest width and height of the thumbnail, px.
const THUMBNAIL_PX: usize = 1024;

/// Counts of a finished slide.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct SlideSummary {
    /// Number of shards.
    pub shards: u64,
    /// Number of objects and parts of cells.
    pub objects: u64,
    /// Size of all files, bytes.
    pub bytes: u64,
    /// SHA-256 of names, sizes and hashes of all files: slides with equal roots are equal.
    pub root_sha256: String,
}

impl SlideSet {
    /// Writes the files that are computed from all shards: the upper levels, `thumbnail.png` and `README.md`. `check`
    /// is the check of the shards before. Files with the same content are not rewritten.
    ///
    /// # Errors
    /// If a shard is missing or damaged, or a file cannot be read or written.
    pub fn finish(&self, check: Check) -> Result<SlideSummary, Error> {
        let missing = self.missing(check)?;
        if let Some(&first) = missing.first() {
            return Err(Error::folder(
                self.path(),
                format!(
                    "missing or damaged shards: {} of {}, first {}; generate them with `papsynth slide make --verify`",
                    missing.len(),
                    self.all_shards().count(),
                    name_of(first)
                ),
            ));
        }
        let mut files = Vec::new();
        for plane in 0..self.head.planes_um.len() {
            if self.head.bits <= 8 {
                self.upper::<u8>(&self.pyramids.image, None, plane, halved, &mut files)?;
            } else {
                self.upper::<u16>(&self.pyramids.image, None, plane, halved, &mut files)?;
            }
        }
        for group in Group::ALL {
            self.upper::<u32>(&self.pyramids.labels, Some(group.name()), 0, halved_labels, &mut files)?;
        }
        self.upper::<u16>(&self.pyramids.layers, Some(LAYERS), 0, halved_labels, &mut files)?;
        files.push(self.folder.keep(THUMBNAIL, &self.thumbnail()?)?);
        let mut objects = 0;
        let mut all: Vec<FileRecord> = Vec::new();
        for at in self.all_shards() {
            let Some(record) = self.complete_record(at, Check::Sizes)? else { continue };
            objects += record.objects;
            all.extend(record.files);
        }
        files.push(self.folder.keep(CARD, self.card(objects).as_bytes())?);
        self.write_record(UPPER, files.clone(), objects)?;
        all.extend(files);
        all.sort_by(|a, b| a.path.cmp(&b.path));
        let mut hash = Sha256::new();
        hash.update(self.head.sha256().as_bytes());
        for file in &all {
            hash.update(format!("{}\0{}\0{}\n", file.path, file.bytes, file.sha256).as_bytes());
        }
        Ok(SlideSummary {
            shards: self.all_shards().count() as u64,
            objects,
            bytes: all.iter().map(|file| file.bytes).sum(),
            root_sha256: hex(&hash.finalize()),
        })
    }

    /// Writes the upper levels, each from the level below.
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

    /// Computes a shard from the shards of the level below.
    fn halves<T: Sample>(
        &self,
        array: &Array,
        below: &Array,
        folder: &str,
        at: [u32; 2],
        [channel, plane]: [usize; 2],
        halve: fn(&[T], usize) -> Vec<T>,
    ) -> Result<Vec<T>, Error> {
        let bad = |e: papsynth_zarr::Error| Error::folder(self.path(), e.to_string());
        let block = array.block(place(at, plane)).map_err(bad)?;
        let width = block.columns.len();
        let mut values = vec![T::default(); block.pixels()];
        let [_, _, rows, columns] = below.shape();
        let under = |range: &Range<usize>, end: usize| 2 * range.start..(2 * range.end).min(end);
        let (rows, columns) = (under(&block.rows, rows), under(&block.columns, columns));
        for (from, rows, columns) in parts(below.shard(), &rows, &columns) {
            let part = self.region::<T>(below, folder, from, [channel, plane], rows.clone(), columns.clone())?;
            let half = halve(&part, columns.len());
            let half_width = columns.len().div_ceil(2);
            let corner = [rows.start / 2 - block.rows.start, columns.start / 2 - block.columns.start];
            for (y, line) in half.chunks_exact(half_width).enumerate() {
                values[(corner[0] + y) * width + corner[1]..][..half_width].copy_from_slice(line);
            }
        }
        Ok(values)
    }

    /// Encodes the central plane as a small PNG file.
    fn thumbnail(&self) -> Result<Vec<u8>, Error> {
        let plane = self.head.planes_um.len() / 2;
        let sizes = self.pyramids.image.levels().iter().map(|array| array.shape());
        let level = sizes
            .enumerate()
            .find(|(_, [_, _, rows, columns])| rows.max(columns) <= &THUMBNAIL_PX)
            .map_or(self.levels() - 1, |(level, _)| level);
        let [width, height] = self.level_px(level).unwrap_or([1; 2]);
        let grey = self.image(level, plane, 0..height, 0..width)?;
        let shift = self.head.bits.saturating_sub(8);
        let bytes: Vec<u16> = grey.iter().map(|grey| grey >> shift).collect();
        let pixel_um = self.head.pixel_um * f64::from(1_u32 << level);
        write::png(&bytes, width, self.head.channels, 8, pixel_um)
            .map_err(|e| Error::folder(self.path(), format!("{THUMBNAIL}: {e}")))
    }

    fn card(&self, objects: u64) -> String {
        let head = &self.head;
        let um = [head.width_px, head.height_px].map(|px| f64::from(px) * head.pixel_um / 1000.0);
        format!(
            "# A synthetic slide\n\n\
             Generated by papsynth; it does not show a patient.\n\n\
             | | |\n|---|---|\n\
             | size | {} x {} px, {:.2} x {:.2} mm, {} µm a pixel |\n\
             | focal planes, µm | {:?} |\n\
             | channels | {}, {} bits |\n\
             | objects and parts of cells | {objects} |\n\
             | seed, slide | {}, {} |\n\
             | recipe | `recipe.toml`, SHA-256 {} |\n\n\
             `slide.ome.zarr` is OME-Zarr 0.5: the image, and as labels the visible cytoplasm, nucleus and debris of each pixel \
             and its number of cytoplasms (`layers`). `objects/` has a table and a GeoJSON file for every square of {} px, with \
             the complete mask of every object whose centre is in it; ids are those of the labels.\n\n\
             To generate the same files again, run `papsynth slide make recipe.toml --model model.json --out DIR --seed {} --slide {} --shard-px {}{}`.\n",
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
            // Builds with Parquet write the table by default.
            if HAS_PARQUET && !head.objects_parquet { " --no-parquet" } else { "" },
        )
    }
}

#[cfg(test)]
mod tests {
    use std::path::Path;
    use std::sync::atomic::AtomicBool;

    use papsynth::model::Model;
    use papsynth::recipe::Preset;
    use papsynth::{Engine, Inputs, Threads};

    use super::super::{SlideInfo, SlideRun};
    use super::*;
    use crate::dataset::Task;
    use crate::files::fault;

    #[test]
    fn after_any_disk_failure_no_file_is_partial_and_the_next_run_completes_the_slide() {
        let mut recipe = Preset::Sparse.recipe();
        (recipe.scan.width_px, recipe.scan.height_px, recipe.scan.frame_px) = (600, 64, 256);
        recipe.cells.clear();
        let model = Model::builtin();
        let engine = Engine::new(&recipe, &model, &Inputs::default()).unwrap();
        let slide = engine.slide(1, 0).unwrap();
        let info = SlideInfo {
            recipe: &recipe,
            model: &model,
            seed: 1,
            shard_px: 512,
            objects_parquet: crate::formats::HAS_PARQUET,
        };
        let make = |path: &Path| {
            let set = SlideSet::create_or_resume(path, &slide, &info)?;
            let stop = AtomicBool::new(false);
            let run = SlideRun { task: Task::ALL, threads: Threads::One, check: Check::Sizes, stop: &stop };
            set.generate(&slide, &run, &|_| ())?;
            set.finish(Check::Sizes)
        };
        let failures = fault::everywhere("slide-faults", 60, "", make);
        assert!(failures > 60, "{failures}");
    }
}
