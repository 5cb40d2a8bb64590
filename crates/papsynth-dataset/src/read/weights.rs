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

/// Brightness as weight: 0 where black, 1 at the file's largest grey level.
///
/// # Errors
/// If every pixel is black.
pub fn weights(image: &GreyImage) -> Result<WeightMap, Problem> {
    possible(WeightMap { width: image.width, weights: image.fractions() })
}

/// Weight 1 where a label lies, else 0.
///
/// # Errors
/// If there is no label.
pub fn label_weights(labels: &LabelMap) -> Result<WeightMap, Problem> {
    possible(WeightMap {
        width: labels.width,
        weights: labels.ids.iter().map(|&id| if id > 0 { 1.0 } else { 0.0 }).collect(),
    })
}

fn possible(map: WeightMap) -> Result<WeightMap, Problem> {
    if map.weights.iter().any(|&w| w > 0.0) { Ok(map) } else { Err(Problem::NoWeight) }
}

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
    let is_grey = matches!(recipe.layout, Layout::Map { .. });
    let (Layout::Map { path } | Layout::Labels(Labels { path, .. })) = &mut recipe.layout else {
        return Ok((Inputs::default(), None));
    };
    let found = folder.join(&path);
    let bytes = bytes(&found, limits.max_file_bytes)?;
    let map = match is_grey {
        true => GreyImage::decode(&bytes, limits).and_then(|image| weights(&image)),
        false => label_map(&bytes, limits).and_then(|labels| label_weights(&labels)),
    };
    let map = map.map_err(Error::input(&found))?;
    *path = content_name(&bytes);
    let file = InputFile { name: path.clone(), bytes };
    Ok((Inputs { weight_map: Some(map), ..Inputs::default() }, Some(file)))
}

/// The name of a map in a data set: by the beginning of its SHA-256.
fn content_name(bytes: &[u8]) -> String {
    let ending = if bytes.starts_with(PNG_SIGNATURE) { "png" } else { "tif" };
    format!("layout-{:.16}.{ending}", sha256(bytes))
}
