//! Arbitrary bytes as a model.

use papsynth::model::Model;

/// A parsed model is valid and has a lossless round trip.
pub(crate) fn check(bytes: &[u8]) {
    let Ok(text) = std::str::from_utf8(bytes) else {
        return;
    };
    let Ok(model) = Model::from_json(text) else {
        return;
    };
    assert!(model.check().is_ok());
    let again = Model::from_json(&model.to_json()).expect("a model reads back");
    assert_eq!(again, model);
}
