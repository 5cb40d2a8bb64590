//! Conversion of data sets into other formats, from their files, without an engine.

use std::path::Path;
use std::sync::atomic::{AtomicBool, Ordering};

use papsynth::Plane;

use super::generate::{Outcome, Progress};
use super::images::{images, pages};
use super::record::ShardRecord;
use super::set::{Dataset, INPUT_BYTES};
use crate::error::{Error, InputError};
use crate::files::Check;
use crate::formats::{Depth, Extra, Format, LIMITS, Layout, TRAINING_BITS, levels, names, to_camera};
use crate::read::{self, LevelImage};
use crate::truth::{Document, FrameSummary};

/// Writes a data set in other formats into another folder, or resumes an earlier conversion. Grey levels, masks,
/// recipe, model and seed are copied unchanged. Calls `report` after each frame, in order.
///
/// # Errors
/// If `from` is not a finished data set, its recipe or model was changed, its formats lack images that `layout` needs
/// (noise-free images, planes of stacks), or a file cannot be read or written.
pub fn convert(
    from: &Path,
    to: &Path,
    layout: &Layout,
    stop: &AtomicBool,
    report: &(dyn Fn(Progress) + Sync),
) -> Result<Outcome, Error> {
    let source = Dataset::open(from)?;
    if layout.has_extra(Extra::NoiseFree) && !source.layout.has_extra(Extra::NoiseFree) {
        return refuse(
            &source,
            format!(
                "the format `folder` needs noise-free images, which {} does not contain; leave them out with \
                 `--without noise-free`, or generate the data set again with `papsynth generate` and its recipe",
                source.layout
            ),
        );
    }
    let target = begin(&source, to, layout)?;
    let (mut present, mut written, mut open) = (0, 0, None);
    let frames = frames_in(&source)?;
    for (shard, frames) in by_shard(&frames, layout.frames_per_shard) {
        if stop.load(Ordering::Relaxed) {
            return Ok(Outcome { present, written, stopped: true });
        }
        let has_all = |record: ShardRecord| frames.iter().all(|&(index, _)| record.covers(&(index..index + 1)));
        if target.complete_record(shard, Check::Sizes)?.is_some_and(has_all) {
            frames.iter().for_each(|&(index, _)| report(Progress::Present(index)));
            present += frames.len() as u64;
            continue;
        }
        let mut writer = target.shard_writer(shard)?;
        for &(index, source_shard) in frames {
            // The frames of a source shard follow each other, so each shard is opened once.
            if open.as_ref().is_none_or(|open: &OpenShard| open.record.shard != source_shard) {
                open = Some(OpenShard::open(&source, layout, source_shard)?);
            }
            let Some(open) = &open else { continue };
            let frame = open.record.frames.iter().find(|frame| frame.index == index);
            let Some(frame) = frame else { continue };
            writer.begin_with(frame.clone())?;
            open.planes(frame, |plane| writer.write_plane(&plane))?;
            let truth = source.truth_in(&open.document, source_shard, index)?;
            report(Progress::Written(writer.end_with(&truth, open.edf(frame)?)?));
        }
        writer.commit()?;
        written += frames.len() as u64;
    }
    target.finish()?;
    Ok(Outcome { present, written, stopped: false })
}

/// Groups pairs of frame and source shard by the target shard.
fn by_shard(frames: &[(u64, u64)], each: u64) -> impl Iterator<Item = (u64, &[(u64, u64)])> {
    frames.chunk_by(move |(a, _), (b, _)| a / each == b / each).map(move |chunk| (chunk[0].0 / each, chunk))
}

fn refuse<T>(source: &Dataset, message: String) -> Result<T, Error> {
    Err(Error::folder(source.path(), message))
}

fn begin(source: &Dataset, to: &Path, layout: &Layout) -> Result<Dataset, Error> {
    let Dataset { folder, identity, categories, map, .. } = source;
    let input = |name: &str| Ok::<_, Error>((name.to_owned(), read::bytes(&folder.inside(name)?, INPUT_BYTES)?));
    source.check_inputs()?;
    source.check_finished()?;
    let mut inputs = vec![input(names::RECIPE)?, input(names::MODEL)?];
    inputs.extend(map.as_deref().map(input).transpose()?);
    Dataset::begin(to, identity.clone(), layout.clone(), categories.clone(), map.clone(), &inputs)
}

fn frames_in(source: &Dataset) -> Result<Vec<(u64, u64)>, Error> {
    let mut frames = Vec::new();
    for shard in source.shards()? {
        frames.extend(record(source, shard)?.frames.iter().map(|frame| (frame.index, shard)));
    }
    Ok(frames)
}

fn record(source: &Dataset, shard: u64) -> Result<ShardRecord, Error> {
    match source.record_or_finding(shard, Check::Sizes)? {
        Ok(record) => Ok(record),
        Err(finding) => refuse(source, format!("{finding}; `papsynth verify` lists all findings")),
    }
}

/// A shard with its COCO document in memory.
struct OpenShard<'a> {
    source: &'a Dataset,
    target: &'a Layout,
    record: ShardRecord,
    document: Document,
}

impl<'a> OpenShard<'a> {
    fn open(source: &'a Dataset, target: &'a Layout, shard: u64) -> Result<Self, Error> {
        let record = record(source, shard)?;
        if let Some((path, message)) = source.folder.first_defect(&record.files, Check::Hashes)? {
            return refuse(source, format!("{path}: {message}; `papsynth verify` lists all findings"));
        }
        Ok(Self { source, target, record, document: source.document(shard)? })
    }

    fn planes(&self, frame: &FrameSummary, mut take: impl FnMut(Plane) -> Result<(), Error>) -> Result<(), Error> {
        let Self { source, record, document, .. } = self;
        let Dataset { folder, layout, .. } = source;
        let Some(format) = layout.best_format(frame.is_stack()) else {
            return refuse(source, format!("{layout} does not contain the planes of stacks"));
        };
        self.check_depth(format, frame, |_| true)?;
        let name = format.image(source.identity.seed, record.shard, frame);
        let mut noise_free = match layout.has_extra(Extra::NoiseFree) {
            true => {
                let path = folder.inside(&names::noise_free(frame.index))?;
                let bytes = read::bytes(&path, LIMITS.max_file_bytes)?;
                let pages = read::float_pages(&bytes, &LIMITS, frame.planes_um.len()).map_err(Error::input(&path))?;
                Some((path, pages.into_iter()))
            }
            false => None,
        };
        let coco = folder.path(&names::coco(record.shard));
        let saturated = document.saturated(frame.index).map_err(Error::input(&coco))?;
        let mut index = 0;
        let mut failure = None;
        let mut convert_page = |page| {
            let grey = levels(page, frame.channels);
            let noise_free = match &mut noise_free {
                Some((path, pages)) => {
                    let expected = frame.planes_um.len();
                    let missing = || InputError::unfit(format!("planes: {index}; expected {expected}"));
                    pages.next().ok_or_else(|| Error::input(path)(missing()))?
                }
                None => vec![0.0; frame.values()],
            };
            take(Plane {
                index,
                stage_um: frame.planes_um.get(index).copied().unwrap_or_default(),
                channels: frame.channels,
                grey,
                noise_free,
                saturated: saturated.get(index).cloned().unwrap_or_default(),
                clipped_px: frame.clipped_px.get(index).copied().unwrap_or_default(),
            })?;
            index += 1;
            Ok(())
        };
        let read = pages(source, &name, frame, record.shard, &mut |page| {
            convert_page(page).map_err(|error| {
                // Stops the reader; `failure` is returned instead.
                failure = Some(error);
                InputError::unfit("")
            })
        });
        failure.map_or(read, Err)
    }

    /// Returns the grey levels of the extended-depth-of-field image of a stack; none for a single plane.
    fn edf(&self, frame: &FrameSummary) -> Result<Vec<u16>, Error> {
        if !frame.is_stack() {
            return Ok(Vec::new());
        }
        let Self { source, record, .. } = self;
        let Some((name, format)) = source.layout.edf_image(source.identity.seed, record.shard, frame) else {
            let layout = &source.layout;
            return refuse(source, format!("{layout} does not contain the extended-depth-of-field image of a stack"));
        };
        self.check_depth(format, frame, |target| matches!(target, Format::Folder | Format::Qupath))?;
        let files = images(source, &name, record.shard)?;
        let file = files.first().map(Vec::as_slice).unwrap_or_default();
        let image = LevelImage::decode(file, &LIMITS).map_err(Error::input(&source.folder.path(&name)))?;
        Ok(levels(to_camera(image, frame.bits), frame.channels))
    }

    /// Checks that a source of 8-bit images is not converted to a format with the bit depth of the camera. `uses`
    /// returns whether a target format has these images.
    fn check_depth(&self, from: Format, frame: &FrameSummary, uses: impl Fn(Format) -> bool) -> Result<(), Error> {
        let deep = self.target.formats.iter().find(|format| format.depth() == Depth::Camera && uses(**format));
        match deep {
            Some(deep) if frame.bits > TRAINING_BITS && from.depth() == Depth::Training => refuse(
                self.source,
                format!(
                    "the format `{}` needs {} bits, but `{}` has {TRAINING_BITS}; start from a data set that contains \
                     `folder`, `ome-tiff`, `ome-zarr` or `qupath`, or run `papsynth generate` with the recipe",
                    deep.name(),
                    frame.bits,
                    from.name(),
                ),
            ),
            _ => Ok(()),
        }
    }
}
