//! Weight maps, and what else a recipe names.

use std::path::Path;

use papsynth::Inputs;
use papsynth::recipe::{Layout, Recipe};
use papsynth::scene::WeightMap;
use papsynth::truth::LabelMap;

use super::{GreyImage, Limits, read_label_map};
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

/// Reads the files that a recipe names, relative to `folder` (where the recipe lies).
///
/// # Errors
/// If a file cannot be read, or allows no place.
pub fn read_inputs(recipe: &Recipe, folder: &Path, limits: &Limits) -> Result<Inputs, Error> {
    let weight_map = match &recipe.layout {
        Layout::Map { path } => {
            let path = folder.join(path);
            Some(weights(&GreyImage::read(&path, limits)?).map_err(Error::input(&path))?)
        }
        Layout::Labels { path, .. } => {
            let path = folder.join(path);
            Some(label_weights(&read_label_map(&path, limits)?).map_err(Error::input(&path))?)
        }
        _ => None,
    };
    Ok(Inputs { weight_map, ..Inputs::default() })
}
