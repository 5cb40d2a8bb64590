//! Arbitrary bytes as the recipe of an engine.

use std::sync::LazyLock;

use papsynth::model::Model;
use papsynth::{Engine, Inputs};

use super::sound;

/// A valid recipe gives an engine or an error. This takes milliseconds, 100 times as long as parsing.
pub(crate) fn check(bytes: &[u8]) {
    static MODEL: LazyLock<Model> = LazyLock::new(Model::builtin);
    let Some(recipe) = sound::recipe(bytes) else { return };
    if let Err(error) = Engine::new(&recipe, &MODEL, &Inputs::default()) {
        assert!(!error.to_string().is_empty());
    }
}
