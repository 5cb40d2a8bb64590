//! Data sets written anew in other formats: from their files, without an engine.

use std::path::Path;
use std::sync::atomic::{AtomicBool, Ordering};

use papsynth::Plane;

use super::generate::{Outcome, Progress};
use super::images::{images, pages};
use super::record::ShardRecord;
use super::set::Dataset;
use crate::bytes::sha256;
use crate::error::{Error, Problem};
use crate::files::Check;
use crate::formats::{Format, LIMITS, Layout, levels, names};
use crate::read::{self, LevelImage};
use crate::truth::{Document, FrameSummary};

/// Largest recipe, model or map.
const GIVEN_BYTES: u64 = 1 << 30;

/// Writes a data set in other formats into another folder, and goes on where an earlier conversion was left. Images are copied level by
/// level, truth mask by mask; recipe, model and seed stay.
///
/// # Errors
/// If `from` is no whole data set, its formats lack what those of `layout` want (noise-free images, planes of stacks), or the system
/// refuses.
pub fn convert(
    from: &Path,
    to: &Path,
    layout: &Layout,
    stop: &AtomicBool,
    report: &(dyn Fn(Progress) + Sync),
) -> Result<Outcome, Error> {
    let source = Dataset::open(from)?;
    if layout.has(Format::Folder) && !source.layout.has(Format::Folder) {
        return refuse(
            &source,
            format!(
                "the format `folder` wants noise-free images, which {} does not keep; `papsynth generate` with the recipe \
             of the data set makes them",
                source.layout
            ),
        );
    }
    let target = begin(&source, to, layout)?;
    let (mut kept, mut made, mut open) = (0, 0, None);
    let frames = frames_in(&source)?;
    for (shard, frames) in by_shard(&frames, layout.frames_per_shard) {
        if stop.load(Ordering::Relaxed) {
            return Ok(Outcome { kept, made, stopped: true });
        }
        let has_all = |record: ShardRecord| frames.iter().all(|&(index, _)| record.covers(&(index..index + 1)));
        if target.whole(shard, Check::Sizes)?.is_some_and(has_all) {
            frames.iter().for_each(|&(index, _)| report(Progress::Kept(index)));
            kept += frames.len() as u64;
            continue;
        }
        let mut writer = target.shard_writer(shard)?;
        for &(index, there) in frames {
            if open.as_ref().is_none_or(|open: &Open| open.record.shard != there) {
                open = Some(Open::of(&source, there)?);
            }
            let Some(open) = &open else { continue };
            let frame = open.record.frames.iter().find(|frame| frame.index == index);
            let Some(frame) = frame else { continue };
            writer.begin_with(frame.clone())?;
            open.planes(frame, |plane| writer.write_plane(&plane))?;
            let truth = source.truth_in(&open.document, there, index)?;
            report(Progress::Made(writer.end_with(&truth, open.sharp(frame)?)?));
        }
        writer.commit()?;
        made += frames.len() as u64;
    }
    target.finish()?;
    Ok(Outcome { kept, made, stopped: false })
}

/// Frames of each shard of a layout, with the shard that they come from.
fn by_shard(frames: &[(u64, u64)], each: u64) -> impl Iterator<Item = (u64, &[(u64, u64)])> {
    frames.chunk_by(move |(a, _), (b, _)| a / each == b / each).map(move |chunk| (chunk[0].0 / each, chunk))
}

fn refuse<T>(source: &Dataset, message: String) -> Result<T, Error> {
    Err(Error::folder(source.path(), message))
}

fn begin(source: &Dataset, to: &Path, layout: &Layout) -> Result<Dataset, Error> {
    let Dataset { folder, identity, categories, map, .. } = source;
    let given = |name: &str| Ok::<_, Error>((name.to_owned(), read::bytes(&folder.inside(name)?, GIVEN_BYTES)?));
    let mut kept = vec![given(names::RECIPE)?, given(names::MODEL)?];
    for ((name, bytes), sha) in kept.iter().zip([&identity.recipe_sha256, &identity.model_sha256]) {
        if sha256(bytes) != *sha {
            return refuse(source, format!("{name} is not the one that the data set was made from"));
        }
    }
    kept.extend(map.as_deref().map(given).transpose()?);
    Dataset::begin(to, identity.clone(), layout.clone(), categories.clone(), map.clone(), &kept)
}

fn frames_in(source: &Dataset) -> Result<Vec<(u64, u64)>, Error> {
    let mut frames = Vec::new();
    for shard in source.shards()? {
        frames.extend(record(source, shard)?.frames.iter().map(|frame| (frame.index, shard)));
    }
    if frames.is_empty() {
        return refuse(source, "the data set has no whole frame".to_owned());
    }
    Ok(frames)
}

fn record(source: &Dataset, shard: u64) -> Result<ShardRecord, Error> {
    match source.whole_or_flaw(shard, Check::Sizes)? {
        Ok(record) => Ok(record),
        Err(flaw) => refuse(source, format!("{flaw}; `papsynth verify` says what is wrong")),
    }
}

/// A shard whose truth is in memory.
struct Open<'a> {
    source: &'a Dataset,
    record: ShardRecord,
    document: Document,
}

impl<'a> Open<'a> {
    fn of(source: &'a Dataset, shard: u64) -> Result<Self, Error> {
        let record = record(source, shard)?;
        if let Some((path, message)) = source.folder.first_flaw(&record.files, Check::Hashes)? {
            return refuse(source, format!("{path} {message}; `papsynth verify` says what is wrong"));
        }
        Ok(Self { source, record, document: source.document(shard)? })
    }

    fn planes(&self, frame: &FrameSummary, mut take: impl FnMut(Plane) -> Result<(), Error>) -> Result<(), Error> {
        let Self { source, record, document } = self;
        let Dataset { folder, layout, .. } = source;
        let format = layout.formats.iter().find(|format| !frame.is_stack() || format.has_planes());
        let Some(format) = format else {
            return refuse(source, format!("{layout} keeps no planes of stacks"));
        };
        let name = format.image(source.identity.seed, record.shard, frame);
        let mut noise_free = match layout.has(Format::Folder) {
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
        let mut hand_over = |page| {
            let grey = levels(page, frame.channels);
            let noise_free = match &mut noise_free {
                Some((path, pages)) => {
                    pages.next().ok_or_else(|| Error::input(path)(Problem::unfit("it has too few planes")))?
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
                clipped_px: frame.floored.get(index).copied().unwrap_or_default(),
            })?;
            index += 1;
            Ok(())
        };
        let read = pages(source, &name, frame, record.shard, &mut |page| {
            hand_over(page).map_err(|error| {
                failure = Some(error);
                Problem::unfit("")
            })
        });
        failure.map_or(read, Err)
    }

    /// The levels of a stack's picture with everything in focus; of a single plane none.
    fn sharp(&self, frame: &FrameSummary) -> Result<Vec<u16>, Error> {
        if !frame.is_stack() {
            return Ok(Vec::new());
        }
        let Self { source, record, .. } = self;
        let (_, Some(name)) = source.images_of(frame, record.shard) else {
            let layout = &source.layout;
            return refuse(source, format!("{layout} keeps no picture of a stack with everything in focus"));
        };
        let files = images(source, &name, record.shard)?;
        let file = files.first().map(Vec::as_slice).unwrap_or_default();
        let image = LevelImage::decode(file, &LIMITS).map_err(Error::input(&source.folder.path(&name)))?;
        Ok(levels(image, frame.channels))
    }
}
