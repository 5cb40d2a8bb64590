//! Any bytes as a recipe.

use papsynth::recipe::Recipe;

/// A recipe that is read and found sound reads back as written.
pub(crate) fn check(bytes: &[u8]) {
    let Ok(text) = std::str::from_utf8(bytes) else {
        return;
    };
    let Ok(recipe) = toml::from_str::<Recipe>(text) else {
        return;
    };
    if !recipe.problems().is_empty() {
        return;
    }
    for text in [recipe.to_toml(), recipe.to_commented_toml()] {
        let again: Recipe = toml::from_str(&text).expect("a recipe reads back");
        assert_eq!(again, recipe);
    }
}
