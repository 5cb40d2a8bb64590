//! The image of a frame, read back from whatever format it was written in.

use std::fs::File;
use std::io::{BufReader, Read};

use crate::dataset::Dataset;
use crate::error::{Error, Problem};
#[cfg(not(feature = "zarr"))]
use crate::formats::Format;
use crate::formats::ZARR_GROUP;
#[cfg(feature = "zarr")]
use crate::formats::read_planes;
use crate::parquet;
use crate::read::{self, LevelImage, Limits};
use crate::record::FrameSummary;
#[cfg(feature = "zarr")]
use crate::record::Geometry;

/// What was written for one frame is read whole.
pub(crate) const LIMITS: Limits =
    Limits { max_side_px: 1 << 15, max_pixels: 1 << 30, max_file_bytes: 1 << 32, max_regions: 1 << 20 };

/// The image that shows a frame in one plane: of a stack the one with everything in focus or, where that was not written, the middle
/// plane.
pub(crate) fn picture(dataset: &Dataset, frame: &FrameSummary, shard: u64) -> Result<LevelImage, Error> {
    let [image, all_in_focus] = dataset.images_of(frame, shard);
    let name = all_in_focus.or(image).unwrap_or_default();
    let path = dataset.folder.path(&name);
    let (mut number, mut middle) = (0, None);
    pages(dataset, &name, frame, |page| {
        if number <= frame.planes_um.len() / 2 {
            middle = Some(page);
        }
        number += 1;
        Ok(())
    })?;
    middle.ok_or_else(|| Error::input(&path)(Problem::NoImages))
}

/// Hands over the pages of an image of a frame, one after the other.
pub(crate) fn pages(
    dataset: &Dataset,
    name: &str,
    frame: &FrameSummary,
    mut take: impl FnMut(LevelImage) -> Result<(), Problem>,
) -> Result<(), Error> {
    if !name.ends_with(ZARR_GROUP) {
        let read = images(dataset, name)?.iter().try_for_each(|file| LevelImage::pages(file, &LIMITS, &mut take));
        return read.map_err(Error::input(&dataset.folder.path(name)));
    }
    #[cfg(feature = "zarr")]
    return read_planes(&dataset.folder, &Geometry::of_summary(frame, dataset.identity.seed), &mut take);
    #[cfg(not(feature = "zarr"))]
    {
        let _ = (frame, &mut take);
        Err(Format::OmeZarr.missing(dataset.path()))
    }
}

/// The levels of a page with as many channels as the frame has: a picture in colour whose pixels are all grey is read as grey.
pub(crate) fn levels(page: LevelImage, channels: usize) -> Vec<u16> {
    match channels / page.channels.max(1) {
        3 => page.levels.iter().flat_map(|&level| [level; 3]).collect(),
        _ => page.levels,
    }
}

/// The files that make up an image of the data set: one, or one for each plane.
pub(crate) fn images(dataset: &Dataset, name: &str) -> Result<Vec<Vec<u8>>, Error> {
    match name.split_once(".parquet/") {
        Some((file, image)) => parquet::images(&dataset.folder.inside(&format!("{file}.parquet"))?, image),
        None => Ok(vec![bytes(dataset, name)?]),
    }
}

/// The bytes of a file, or of one in a tar file of the data set.
fn bytes(dataset: &Dataset, name: &str) -> Result<Vec<u8>, Error> {
    let Some((tar, entry)) = name.split_once(".tar/") else {
        return read::bytes(&dataset.folder.inside(name)?, LIMITS.max_file_bytes);
    };
    let path = dataset.folder.inside(&format!("{tar}.tar"))?;
    let failed = |e| Error::io("read", &path)(e);
    let mut archive = tar::Archive::new(BufReader::new(File::open(&path).map_err(failed)?));
    for file in archive.entries().map_err(failed)? {
        let file = file.map_err(failed)?;
        if *file.path_bytes() == *entry.as_bytes() {
            let mut bytes = Vec::new();
            file.take(LIMITS.max_file_bytes).read_to_end(&mut bytes).map_err(failed)?;
            return Ok(bytes);
        }
    }
    Err(Error::input(&path)(Problem::Broken { format: "tar", message: format!("it has no file `{entry}`") }))
}
