//! Nuclei: images of single nuclei with masks; and the image files of a folder.

use std::collections::BTreeMap;
use std::fs;
use std::io;
use std::path::{Path, PathBuf};

use papsynth::truth::{Bounds, LabelMap};

use super::components::components;
use super::file::Limits;
use super::image::{GreyImage, read_label_map};
use crate::error::{Error, InputError};

/// File name extensions of the images that are read, in lower case.
const EXTENSIONS: [&str; 5] = ["png", "jpg", "jpeg", "tif", "tiff"];

/// Extensions of images in other formats. They are an error, because to skip them would change results without notice.
const OTHER_FORMATS: [&str; 30] = [
    "avif", "bif", "bmp", "czi", "dcm", "dng", "exr", "fits", "gif", "heic", "heif", "ims", "j2k", "jfif", "jp2",
    "jpe", "jxl", "lif", "mrxs", "nd2", "ndpi", "oib", "oif", "pgm", "pnm", "ppm", "scn", "svs", "vsi", "webp",
];

/// Largest number of file names in an error.
const NAMED: usize = 3;

/// An image of one nucleus with its mask.
#[derive(Debug, Clone, PartialEq)]
pub struct NucleusSample {
    /// Name of the files without extension.
    pub name: String,
    /// The image.
    pub image: GreyImage,
    /// 1 at each pixel of the nucleus, else 0; same size as the image.
    pub mask: Vec<f32>,
}

impl NucleusSample {
    /// Combines an image and its mask. Pixels above 0 belong to the nucleus.
    ///
    /// # Errors
    /// If the mask differs in size, is empty, has only one pixel, or has several connected components.
    pub fn new(name: &str, image: GreyImage, mask: &LabelMap) -> Result<Self, InputError> {
        same_size(mask, [image.width, image.grey.len()])?;
        let inside = LabelMap { width: mask.width, ids: mask.ids.iter().map(|&id| id.min(1)).collect() };
        let limits = Limits { max_regions: usize::MAX, ..Limits::default() };
        let parts = components(&inside, &limits)?;
        match parts.as_slice() {
            [] => Err(InputError::unfit("the mask is empty; expected pixels above 0")),
            [one] => match (one.mask.area(), one.mask.bounds()) {
                (1, Some(Bounds { x, y, .. })) => {
                    Err(InputError::unfit(format!("the mask has only one pixel, at ({x}, {y}); expected more")))
                }
                _ => {
                    let mask = inside.ids.iter().map(|&id| if id > 0 { 1.0 } else { 0.0 }).collect();
                    Ok(Self { name: name.to_owned(), image, mask })
                }
            },
            many => {
                let count = many.len();
                Err(InputError::unfit(format!("the mask has {count} connected components; expected 1")))
            }
        }
    }
}

/// Checks that a mask has the size of its image, given by width and number of pixels.
pub(super) fn same_size(mask: &LabelMap, [width, pixels]: [usize; 2]) -> Result<(), InputError> {
    let (rows, due) = (mask.ids.len() / mask.width.max(1), pixels / width.max(1));
    let sizes =
        format!("the mask is {} x {rows} pixels, the image {width} x {due}; expected the same size", mask.width);
    InputError::unless([mask.width, rows] == [width, due], sizes)
}

/// Reads all nuclei of a folder with the subfolders `images` and `masks`.
///
/// # Errors
/// See [`read_pairs`].
pub fn read_nuclei(folder: &Path, limits: &Limits) -> Result<Vec<NucleusSample>, Error> {
    read_pairs(&folder.join("images"), &folder.join("masks"), limits)
}

/// Reads nuclei from a folder of images and one of masks. Files are matched by name without extension, and sorted by
/// name.
///
/// # Errors
/// If a file cannot be read, an image has no mask or a mask no image, or their sizes differ. The error names the file.
pub fn read_pairs(images_folder: &Path, masks_folder: &Path, limits: &Limits) -> Result<Vec<NucleusSample>, Error> {
    let (images, masks) = (image_files(images_folder)?, image_files(masks_folder)?);
    for (files, others, counterpart, elsewhere) in
        [(&images, &masks, "mask", masks_folder), (&masks, &images, "image", images_folder)]
    {
        if let Some((_, path)) = files.iter().find(|(name, _)| !others.contains_key(*name)) {
            let problem = format!("there is no {counterpart} of the same name in {}", elsewhere.display());
            return Err(Error::input(path)(InputError::unfit(problem)));
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

/// Returns the PNG, JPEG and TIFF files of a folder by name without extension. Hidden files and files that are not
/// images (by their extension) are skipped.
///
/// # Errors
/// If the folder has no such file, has images in other formats, or has two images that differ only in their extensions.
pub fn image_files(folder: &Path) -> Result<BTreeMap<String, PathBuf>, Error> {
    let failed = |e: io::Error| match e.kind() {
        io::ErrorKind::NotFound => Error::input(folder)(InputError::Missing("folder")),
        io::ErrorKind::NotADirectory => Error::input(folder)(InputError::NotAFolder),
        _ => Error::io("read", folder)(e),
    };
    let (mut found, mut others) = (BTreeMap::new(), Vec::new());
    for entry in fs::read_dir(folder).map_err(failed)? {
        let path = entry.map_err(failed)?.path();
        let extension = path.extension().and_then(|e| e.to_str()).map(str::to_lowercase).unwrap_or_default();
        let file_name = path.file_name().map(|n| n.to_string_lossy().into_owned()).unwrap_or_default();
        let Some(name) = path.file_stem().map(|n| n.to_string_lossy().into_owned()) else { continue };
        if file_name.starts_with('.') {
            continue;
        }
        if OTHER_FORMATS.contains(&extension.as_str()) {
            others.push(file_name);
            continue;
        }
        if !EXTENSIONS.contains(&extension.as_str()) {
            continue;
        }
        if let Some(other) = found.insert(name, path.clone()) {
            let problem = format!("differs from {} only in its extension; keep one of them", other.display());
            return Err(Error::input(&path)(InputError::unfit(problem)));
        }
    }
    if !others.is_empty() {
        return Err(Error::input(folder)(InputError::unfit(unread(others))));
    }
    if found.is_empty() {
        return Err(Error::input(folder)(InputError::NoImages));
    }
    Ok(found)
}

/// Describes the images of a folder that are in other formats.
fn unread(mut names: Vec<String>) -> String {
    names.sort();
    let count = names.len();
    let more = if count > NAMED { format!(" and {} more", count - NAMED) } else { String::new() };
    names.truncate(NAMED);
    let images = if count == 1 { "1 image is" } else { &format!("{count} images are") };
    format!(
        "{images} in other formats: {}{more}; expected PNG, JPEG or TIFF: convert them, or move them away",
        names.join(", ")
    )
}
