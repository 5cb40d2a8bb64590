//! Arbitrary bytes as a class file, added to the built-in classes.

use std::sync::LazyLock;

use papsynth::model::Model;

/// A model with added classes is valid, contains the built-in classes, and has a lossless round trip.
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
