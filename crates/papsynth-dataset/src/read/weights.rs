//! Files that a recipe names: density maps and label images.

use std::path::Path;

use papsynth::Inputs;
use papsynth::recipe::{Labels, Layout, Recipe};
use papsynth::scene::WeightMap;
use papsynth::truth::LabelMap;

use super::file::{Limits, bytes};
use super::image::{GreyImage, PNG_SIGNATURE, label_map};
use super::jpeg;
use crate::bytes::sha256;
use crate::error::{Error, InputError};

/// A file that a recipe names.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct InputFile {
    /// Name in the recipe and in the data set; contains the start of its SHA-256.
    pub name: String,
    /// Content.
    pub bytes: Vec<u8>,
}

/// Reads the file that a recipe names, if it names one, relative to `folder` (that of the recipe). The path in the
/// recipe is then replaced by a name with the hash of the content, so that recipes with different maps differ.
///
/// # Errors
/// If the file cannot be read, or all of its pixels are 0.
pub fn read_inputs(recipe: &mut Recipe, folder: &Path, limits: &Limits) -> Result<(Inputs, Option<InputFile>), Error> {
    let is_grey = matches!(recipe.layout, Layout::DensityMap { .. });
    let (Layout::DensityMap { path } | Layout::Labels(Labels { path, .. })) = &mut recipe.layout else {
        return Ok((Inputs::default(), None));
    };
    let found = folder.join(&path);
    let bytes = bytes(&found, limits.max_file_bytes)?;
    let map = weights(&bytes, is_grey, limits).map_err(Error::input(&found))?;
    *path = content_name(&bytes);
    let file = InputFile { name: path.clone(), bytes };
    Ok((Inputs { weight_map: Some(map), ..Inputs::default() }, Some(file)))
}

/// Returns the weights: of an image, levels divided by the largest level of its type; of labels, 1 inside objects.
fn weights(bytes: &[u8], is_grey: bool, limits: &Limits) -> Result<WeightMap, InputError> {
    let map = if is_grey {
        let image = GreyImage::decode(bytes, limits)?;
        WeightMap { width: image.width, weights: image.fractions() }
    } else {
        let LabelMap { width, ids } = label_map(bytes, limits)?;
        WeightMap { width, weights: ids.iter().map(|&id| if id > 0 { 1.0 } else { 0.0 }).collect() }
    };
    let has_place = map.weights.iter().any(|&w| w > 0.0);
    InputError::unless(has_place, "all pixels are 0; expected at least one pixel above 0").map(|()| map)
}

/// Returns the name of a map in a data set, from the start of its SHA-256.
fn content_name(bytes: &[u8]) -> String {
    let ending = match bytes {
        _ if bytes.starts_with(PNG_SIGNATURE) => "png",
        _ if bytes.starts_with(jpeg::SIGNATURE) => "jpg",
        _ => "tif",
    };
    format!("layout-{:.16}.{ending}", sha256(bytes))
}
