//! Any bytes as a recipe to make an engine of.

use std::sync::LazyLock;

use papsynth::model::Model;
use papsynth::{Engine, Inputs};

use super::sound;

/// A sound recipe makes an engine or says why not. It takes milliseconds, a hundred times as long as to read it.
pub(crate) fn check(bytes: &[u8]) {
    static MODEL: LazyLock<Model> = LazyLock::new(Model::builtin);
    let Some(recipe) = sound::recipe(bytes) else { return };
    if let Err(error) = Engine::new(&recipe, &MODEL, &Inputs::default()) {
        assert!(!error.to_string().is_empty());
    }
}
