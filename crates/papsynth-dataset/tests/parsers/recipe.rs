//! Any bytes as a recipe.

use papsynth::recipe::Recipe;

use super::sound;

/// A recipe that is read and found sound reads back as written.
pub(crate) fn check(bytes: &[u8]) {
    let Some(recipe) = sound::recipe(bytes) else { return };
    for text in [recipe.to_toml(), recipe.to_commented_toml()] {
        let again: Recipe = toml::from_str(&text).expect("a recipe reads back");
        assert_eq!(again, recipe);
    }
}
