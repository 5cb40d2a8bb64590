//! Any bytes as a class file, beside the classes that ship.

use std::sync::LazyLock;

use papsynth::model::Model;

/// A model with classes that were read is sound, has those that ship, and reads back as written.
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
