//! Nuclei: an image of each and its mask.

use std::collections::BTreeMap;
use std::fs;
use std::io;
use std::path::{Path, PathBuf};

use papsynth::truth::{Bounds, LabelMap};

use super::components::components;
use super::file::Limits;
use super::image::{GreyImage, read_label_map};
use crate::error::{Error, Problem};

/// Endings of the files that are looked at, in lower case.
const ENDINGS: [&str; 3] = ["png", "tif", "tiff"];

/// The image of one nucleus and where it lies in it.
#[derive(Debug, Clone, PartialEq)]
pub struct NucleusSample {
    /// Name of its files, without their ending.
    pub name: String,
    /// The image.
    pub image: GreyImage,
    /// 1 at each pixel of the nucleus, else 0; as large as the image.
    pub mask: Vec<f32>,
}

impl NucleusSample {
    /// Puts an image and its mask together; every pixel above 0 belongs to the nucleus.
    ///
    /// # Errors
    /// If the mask is of another size, is empty, is a single pixel, or falls into several components.
    pub fn new(name: &str, image: GreyImage, mask: &LabelMap) -> Result<Self, Problem> {
        same_size(mask, [image.width, image.grey.len()])?;
        let inside = LabelMap { width: mask.width, ids: mask.ids.iter().map(|&id| id.min(1)).collect() };
        let limits = Limits { max_regions: usize::MAX, ..Limits::default() };
        let parts = components(&inside, &limits)?;
        match parts.as_slice() {
            [] => Err(Problem::unfit("the mask is empty: no pixel of it is above 0")),
            [one] => match (one.mask.area(), one.mask.bounds()) {
                (1, Some(Bounds { x, y, .. })) => {
                    Err(Problem::unfit(format!("the mask is a single pixel, at ({x}, {y}); a nucleus must have more")))
                }
                _ => {
                    let mask = inside.ids.iter().map(|&id| if id > 0 { 1.0 } else { 0.0 }).collect();
                    Ok(Self { name: name.to_owned(), image, mask })
                }
            },
            many => {
                let count = many.len();
                Err(Problem::unfit(format!("the mask falls into {count} separate components; a nucleus must be one")))
            }
        }
    }
}

/// A mask is as large as its image, whose width and number of pixels these are.
pub(super) fn same_size(mask: &LabelMap, [width, pixels]: [usize; 2]) -> Result<(), Problem> {
    let (rows, due) = (mask.ids.len() / mask.width.max(1), pixels / width.max(1));
    let sizes = format!("the mask is {} x {rows}, its image {width} x {due}; both must be the same", mask.width);
    Problem::unless([mask.width, rows] == [width, due], sizes)
}

/// Reads every nucleus of a folder that has the folders `images` and `masks`; see [`read_pairs`].
///
/// # Errors
/// As [`read_pairs`].
pub fn read_nuclei(folder: &Path, limits: &Limits) -> Result<Vec<NucleusSample>, Error> {
    read_pairs(&folder.join("images"), &folder.join("masks"), limits)
}

/// Reads nuclei from a folder of images and one of masks: files of the same names, endings aside, in the order of
/// their names.
///
/// # Errors
/// If a file cannot be read, has no counterpart, or does not fit to it. The error names the file.
pub fn read_pairs(images_folder: &Path, masks_folder: &Path, limits: &Limits) -> Result<Vec<NucleusSample>, Error> {
    let (images, masks) = (image_files(images_folder)?, image_files(masks_folder)?);
    for (files, others, wanted, elsewhere) in
        [(&images, &masks, "mask", masks_folder), (&masks, &images, "image", images_folder)]
    {
        if let Some((_, path)) = files.iter().find(|(name, _)| !others.contains_key(*name)) {
            let problem = format!("has no {wanted} of the same name in {}", elsewhere.display());
            return Err(Error::input(path)(Problem::unfit(problem)));
        }
    }
    let pairs = images.iter().zip(masks.values());
    pairs
        .map(|((name, image), mask)| {
            let pixels = GreyImage::read(image, limits)?;
            let labels = read_label_map(mask, limits)?;
            NucleusSample::new(name, pixels, &labels).map_err(Error::input(mask))
        })
        .collect()
}

/// The PNG and TIFF files of a folder by their names without ending. Files with endings other than png, tif and tiff,
/// and hidden ones, are not looked at.
///
/// # Errors
/// If there is none, or two differ only in their endings.
pub fn image_files(folder: &Path) -> Result<BTreeMap<String, PathBuf>, Error> {
    let failed = |e: io::Error| match e.kind() {
        io::ErrorKind::NotFound | io::ErrorKind::NotADirectory => Error::input(folder)(Problem::Missing("folder")),
        _ => Error::io("read", folder)(e),
    };
    let mut found = BTreeMap::new();
    for entry in fs::read_dir(folder).map_err(failed)? {
        let path = entry.map_err(failed)?.path();
        let ending = path.extension().and_then(|e| e.to_str()).map(str::to_lowercase);
        let hidden = path.file_name().is_some_and(|n| n.to_string_lossy().starts_with('.'));
        let Some(name) = path.file_stem().map(|n| n.to_string_lossy().into_owned()) else { continue };
        if hidden || !ending.is_some_and(|e| ENDINGS.contains(&e.as_str())) {
            continue;
        }
        if let Some(other) = found.insert(name, path.clone()) {
            let problem = format!("has the same name as {}, apart from its ending", other.display());
            return Err(Error::input(&path)(Problem::unfit(problem)));
        }
    }
    if found.is_empty() {
        return Err(Error::input(folder)(Problem::NoImages));
    }
    Ok(found)
}
