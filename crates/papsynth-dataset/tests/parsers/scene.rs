//! Arbitrary bytes as a scene.

use papsynth::scene::Scene;

/// A parsed scene has a lossless round trip.
pub(crate) fn check(bytes: &[u8]) {
    let Ok(text) = std::str::from_utf8(bytes) else { return };
    let Ok(scene) = Scene::from_json(text) else { return };
    let again = Scene::from_json(&scene.to_json()).expect("a scene reads back");
    assert_eq!(again, scene);
}
