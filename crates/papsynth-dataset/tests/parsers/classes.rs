//! Parses bytes as a class file.

use std::sync::LazyLock;

use papsynth::model::Model;

/// Checks that a model with the classes is valid, has the built-in classes, and is read back after writing.
pub(crate) fn check(bytes: &[u8]) {
    static MODEL: LazyLock<Model> = LazyLock::new(Model::builtin);
    let Ok(text) = std::str::from_utf8(bytes) else {
        return;
    };
    let Ok(model) = MODEL.clone().with(text) else {
        return;
    };
    assert!(model.check().is_ok());
    assert!(MODEL.classes.keys().all(|class| model.classes.contains_key(class)));
    let again = Model::from_json(&model.to_json()).expect("a model reads back");
    assert_eq!(again, model);
}
