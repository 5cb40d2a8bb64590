//! Parsing of recipes.

use papsynth::recipe::Recipe;

/// Returns the recipe if it is valid.
pub(super) fn recipe(bytes: &[u8]) -> Option<Recipe> {
    let recipe: Recipe = toml::from_str(std::str::from_utf8(bytes).ok()?).ok()?;
    recipe.problems().is_empty().then_some(recipe)
}
