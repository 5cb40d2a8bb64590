//! Arbitrary bytes as a recipe.

use papsynth::recipe::Recipe;

use super::sound;

/// A valid recipe has a lossless round trip.
pub(crate) fn check(bytes: &[u8]) {
    let Some(recipe) = sound::recipe(bytes) else { return };
    for text in [recipe.to_toml(), recipe.to_commented_toml()] {
        let again: Recipe = toml::from_str(&text).expect("a recipe reads back");
        assert_eq!(again, recipe);
    }
}
