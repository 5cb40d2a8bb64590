//! Generation of shards of a slide: the pixels of every array, and the objects.

use std::sync::atomic::{AtomicBool, Ordering};

use papsynth::truth::{Group, ObjectTruth};
use papsynth::{Slide, Threads};
use papsynth_zarr::{Array, Pyramid, Sample, ShardEncoder, halved, halved_labels};
use serde_json::json;

use super::record::{LAYERS, folder};
use super::set::{SlideSet, name_of, place, record_name};
use crate::bytes;
use crate::dataset::Task;
use crate::error::Error;
use crate::files::{Check, FileRecord, Output};
use crate::formats::parquet::Table;
use crate::truth::{Collection, Row, collection, slide_columns, slide_table};

/// Options of [`SlideSet::generate`].
#[derive(Debug, Clone, Copy)]
pub struct SlideRun<'a> {
    /// The part of the shards to generate.
    pub task: Task,
    /// Number of threads for one shard. It does not change the output.
    pub threads: Threads,
    /// The check of shards that are already present.
    pub check: Check,
    /// Set it to stop early, after the shard in work.
    pub stop: &'a AtomicBool,
}

/// Progress of a run: one shard is done.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct SlideProgress {
    /// Column and row of the shard.
    pub shard: [u32; 2],
    /// Number of shards that are done.
    pub done: u64,
    /// Number of shards of the task.
    pub total: u64,
    /// Whether the shard was already present.
    pub present: bool,
    /// Number of objects and parts of cells in it.
    pub objects: u64,
}

impl SlideSet {
    /// Generates the incomplete shards and calls `report` after each shard. Returns whether the run was stopped early.
    ///
    /// # Errors
    /// If the engine fails, or a file cannot be read or written.
    pub fn generate(&self, slide: &Slide, run: &SlideRun, report: &dyn Fn(SlideProgress)) -> Result<bool, Error> {
        let total = run.task.total.max(1);
        let shards: Vec<[u32; 2]> = (0_u64..)
            .zip(self.all_shards())
            .filter(|(number, _)| number % total == run.task.index)
            .map(|(_, at)| at)
            .collect();
        for (number, &at) in (1_u64..).zip(&shards) {
            if run.stop.load(Ordering::Relaxed) {
                return Ok(true);
            }
            let record = self.complete_record(at, run.check)?;
            let present = record.is_some();
            let objects = match record {
                Some(record) => record.objects,
                None => self.write_shard(slide, at, run.threads)?,
            };
            report(SlideProgress { shard: at, done: number, total: shards.len() as u64, present, objects });
        }
        Ok(false)
    }

    fn write_shard(&self, slide: &Slide, at: [u32; 2], threads: Threads) -> Result<u64, Error> {
        let side = self.head.shard_px;
        let origin = at.map(|at| at * side);
        let whole = [self.head.width_px, self.head.height_px];
        let size = [0, 1].map(|axis| side.min(whole[axis] - origin[axis]));
        let part = slide.picture(origin, size, threads)?;
        let width = size[0] as usize;
        let mut files = Vec::new();
        let channels = self.head.channels;
        for (plane, picture) in part.planes.iter().enumerate() {
            let (pyramid, grey) = (&self.pyramids.image, &picture.grey);
            if self.head.bits <= 8 {
                #[expect(clippy::cast_possible_truncation, reason = "grey levels of 8 bits")]
                let layers = separated(grey, channels, |grey| grey as u8);
                files.extend(self.write_levels(pyramid, None, at, plane, layers, width, halved)?);
            } else {
                let layers = separated(grey, channels, |grey| grey);
                files.extend(self.write_levels(pyramid, None, at, plane, layers, width, halved)?);
            }
        }
        for (group, labels) in Group::ALL.into_iter().zip(part.labels) {
            let (pyramid, name) = (&self.pyramids.labels, Some(group.name()));
            files.extend(self.write_levels(pyramid, name, at, 0, vec![labels.ids], width, halved_labels)?);
        }
        let (pyramid, name) = (&self.pyramids.layers, Some(LAYERS));
        files.extend(self.write_levels(pyramid, name, at, 0, vec![part.layers], width, halved_labels)?);
        let name = name_of(at);
        let objects = &part.objects;
        files.push(self.folder.write(&format!("objects/{name}.csv"), &slide_table(objects))?);
        if self.head.objects_parquet {
            let pending = self.folder.pending(&format!("objects/{name}.parquet"))?;
            let mut table = Table::begin(pending.handle()?, pending.path(), slide_columns())?;
            Row::of_slide(objects).try_for_each(|row| table.row(&row))?;
            table.end()?;
            files.push(pending.commit()?);
        }
        let outlines = bytes::json(&self.outlines(objects));
        files.push(self.folder.write(&format!("objects/{name}.geojson"), &outlines)?);
        let count = objects.len() as u64;
        self.write_record(&record_name(at), files, count)?;
        Ok(count)
    }

    /// Returns the outlines of the objects of a shard as GeoJSON, in pixels of the slide.
    fn outlines(&self, objects: &[ObjectTruth]) -> Collection {
        let (seed, slide) = (self.head.identity.seed, self.head.slide);
        let name = |o: &ObjectTruth| format!("papsynth slide {seed} {slide} {} {:?}", o.id, o.part);
        let measure = |o: &ObjectTruth, _: Option<&ObjectTruth>| json!({ "Area µm^2": o.area_um2, "Depth µm": o.depth_um, "Mean absorbance": o.mean_absorbance });
        collection(&objects.iter().collect::<Vec<_>>(), name, measure)
    }

    /// Writes a shard in all levels that are computed from it alone, each half the size of the previous level.
    #[expect(clippy::too_many_arguments, reason = "position, array and halving function")]
    fn write_levels<T: Sample>(
        &self,
        pyramid: &Pyramid,
        labels: Option<&str>,
        at: [u32; 2],
        plane: usize,
        mut channels: Vec<Vec<T>>,
        mut width: usize,
        halve: fn(&[T], usize) -> Vec<T>,
    ) -> Result<Vec<FileRecord>, Error> {
        let mut files = Vec::new();
        for (level, array) in pyramid.levels().iter().take(pyramid.with_shard()).enumerate() {
            if level > 0 {
                for values in &mut channels {
                    *values = halve(values, width);
                }
                width = width.div_ceil(2);
            }
            files.push(self.write_array(array, &folder(labels, level), at, plane, &channels)?);
        }
        Ok(files)
    }

    pub(super) fn write_array<T: Sample>(
        &self,
        array: &Array,
        folder: &str,
        at: [u32; 2],
        plane: usize,
        channels: &[Vec<T>],
    ) -> Result<FileRecord, Error> {
        let shard = place(at, plane);
        let name = format!("{folder}/{}", array.file(shard));
        let bad = |e: papsynth_zarr::Error| Error::folder(&self.folder.path(&name), e.to_string());
        let mut encoder = ShardEncoder::new(array, shard).map_err(bad)?;
        let mut output = Output::new(self.folder.pending(&name)?)?;
        for (channel, values) in channels.iter().enumerate() {
            output.bytes(&encoder.plane(channel, plane, values).map_err(bad)?)?;
        }
        output.bytes(&encoder.end().map_err(bad)?)?;
        output.commit()
    }
}

/// Converts interleaved channels to one image per channel.
fn separated<T>(grey: &[u16], channels: usize, convert: impl Fn(u16) -> T) -> Vec<Vec<T>> {
    let of_channel = |channel| grey.iter().skip(channel).step_by(channels).map(|grey| convert(*grey)).collect();
    match channels {
        // This is faster than a step of 1.
        1 => vec![grey.iter().map(|grey| convert(*grey)).collect()],
        _ => (0..channels).map(of_channel).collect(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn channels_are_separated() {
        let grey = [1, 2, 3, 4, 5, 6];
        assert_eq!(separated(&grey, 1, |grey| grey), [grey]);
        assert_eq!(separated(&grey, 3, |grey| 2 * grey), [[2, 8], [4, 10], [6, 12]]);
    }
}
