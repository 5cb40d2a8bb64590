//! A shard of a slide: its square of every array that lies over it, and its objects.

use std::sync::atomic::{AtomicBool, Ordering};

use papsynth::truth::{Group, ObjectTruth};
use papsynth::{Slide, Threads};
use papsynth_zarr::{Array, Pyramid, Sample, ShardEncoder, halved, halved_labels};
use serde_json::{Value, json};

use super::record::{LAYERS, folder};
use super::set::{SlideSet, name_of, place, record_name};
use crate::bytes;
use crate::dataset::Share;
use crate::error::Error;
use crate::files::{Check, FileRecord, Output};
use crate::formats::parquet::Table;
use crate::truth::{Row, collection, slide_columns, slide_table};

/// Which shards to make, and how.
#[derive(Debug, Clone, Copy)]
pub struct SlideRun<'a> {
    /// Which of the shards: all, or every so many.
    pub share: Share,
    /// How many threads work on a shard. The bytes are the same.
    pub threads: Threads,
    /// How carefully shards that are there are looked at, before they are kept.
    pub check: Check,
    /// Set to end early: the shard that is being made is given up.
    pub stop: &'a AtomicBool,
}

/// A shard is done.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct SlideProgress {
    /// Its column and row.
    pub at: [u32; 2],
    /// How many are done, and how many there are to do.
    pub done: [u64; 2],
    /// Whether it was whole before.
    pub kept: bool,
    /// Objects and parts of cells told in it.
    pub objects: u64,
}

impl SlideSet {
    /// Makes the shards that are not whole, and reports each. Gives whether it was stopped before its end.
    ///
    /// # Errors
    /// The first failure of the engine or the system.
    pub fn make(&self, slide: &Slide, run: &SlideRun, report: &dyn Fn(SlideProgress)) -> Result<bool, Error> {
        let of = run.share.of.max(1);
        let shards: Vec<[u32; 2]> =
            (0_u64..).zip(self.all()).filter(|(number, _)| number % of == run.share.index).map(|(_, at)| at).collect();
        for (number, &at) in (1_u64..).zip(&shards) {
            if run.stop.load(Ordering::Relaxed) {
                return Ok(true);
            }
            let before = self.whole(at, run.check)?;
            let kept = before.is_some();
            let objects = match before {
                Some(record) => record.objects,
                None => self.write_shard(slide, at, run.threads)?,
            };
            report(SlideProgress { at, done: [number, shards.len() as u64], kept, objects });
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
            let layers: Vec<Vec<u16>> = (0..channels)
                .map(|channel| picture.grey.iter().skip(channel).step_by(channels).copied().collect())
                .collect();
            if self.head.bits <= 8 {
                #[expect(clippy::cast_possible_truncation, reason = "grey levels of 8 bits")]
                let layers = layers.iter().map(|layer| layer.iter().map(|grey| *grey as u8).collect()).collect();
                files.extend(self.write_levels::<u8>(&self.forms.image, None, at, plane, layers, width, halved)?);
            } else {
                files.extend(self.write_levels(&self.forms.image, None, at, plane, layers, width, halved)?);
            }
        }
        for (group, labels) in Group::ALL.into_iter().zip(part.labels) {
            let (pyramid, name) = (&self.forms.labels, Some(group.name()));
            files.extend(self.write_levels(pyramid, name, at, 0, vec![labels.ids], width, halved_labels)?);
        }
        let (pyramid, name) = (&self.forms.layers, Some(LAYERS));
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

    /// The outlines of a shard, in pixels of the slide.
    fn outlines(&self, objects: &[ObjectTruth]) -> Value {
        let (seed, slide) = (self.head.identity.seed, self.head.slide);
        let name = |o: &ObjectTruth| format!("papsynth slide {seed} {slide} {} {:?}", o.id, o.part);
        let measure = |o: &ObjectTruth, _: Option<&ObjectTruth>| json!({ "Area µm^2": o.area_um2, "Depth µm": o.depth_um, "Mean absorbance": o.stain });
        collection(&objects.iter().collect::<Vec<_>>(), name, measure)
    }

    /// Writes the shards of all levels that follow from this one alone, each level half of that before.
    #[expect(clippy::too_many_arguments, reason = "one place, one array, one way to halve")]
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
        output.into_pending()?.commit()
    }
}
