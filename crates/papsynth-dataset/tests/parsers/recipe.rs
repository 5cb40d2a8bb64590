//! Any bytes as a recipe.

use std::sync::LazyLock;

use papsynth::model::Model;
use papsynth::recipe::Recipe;
use papsynth::{Engine, Inputs};

/// A recipe that is read reads back as written, and one that is sound makes an engine or says why not.
pub(crate) fn check(bytes: &[u8]) {
    static MODEL: LazyLock<Model> = LazyLock::new(Model::builtin);
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
    if let Err(error) = Engine::new(&recipe, &MODEL, &Inputs::default()) {
        assert!(!error.to_string().is_empty());
    }
}
