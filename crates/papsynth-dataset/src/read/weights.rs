//! Weight maps, and what else a recipe names.

use std::path::Path;

use papsynth::Inputs;
use papsynth::recipe::{Labels, Layout, Recipe};
use papsynth::scene::WeightMap;
use papsynth::truth::LabelMap;

use super::file::{Limits, bytes};
use super::image::{GreyImage, PNG_SIGNATURE, label_map};
use crate::bytes::sha256;
use crate::error::{Error, Problem};

/// A file that a recipe names.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct InputFile {
    /// Its name in the recipe and in the data set, which tells its content.
    pub name: String,
    /// What is in it.
    pub bytes: Vec<u8>,
}

/// Reads the file that a recipe names, if it names one, relative to `folder` (where the recipe lies). In the recipe it then has a
/// name that tells its content, so that recipes with different maps differ.
///
/// # Errors
/// If the file cannot be read, or allows no place.
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

/// Of an image brightness as weight, 0 where black and 1 at the file's largest grey level; of labels 1 where one lies.
fn weights(bytes: &[u8], is_grey: bool, limits: &Limits) -> Result<WeightMap, Problem> {
    let map = if is_grey {
        let image = GreyImage::decode(bytes, limits)?;
        WeightMap { width: image.width, weights: image.fractions() }
    } else {
        let LabelMap { width, ids } = label_map(bytes, limits)?;
        WeightMap { width, weights: ids.iter().map(|&id| if id > 0 { 1.0 } else { 0.0 }).collect() }
    };
    let has_place = map.weights.iter().any(|&w| w > 0.0);
    Problem::unless(has_place, "every pixel is 0, so that no place is allowed; some must be above 0").map(|()| map)
}

/// The name of a map in a data set: by the beginning of its SHA-256.
fn content_name(bytes: &[u8]) -> String {
    let ending = if bytes.starts_with(PNG_SIGNATURE) { "png" } else { "tif" };
    format!("layout-{:.16}.{ending}", sha256(bytes))
}
