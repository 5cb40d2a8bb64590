//! Scenes that were edited or written by another program.

use std::collections::BTreeSet;

use papsynth::key::Key;
use papsynth::model::Model;
use papsynth::recipe::{Layout, Preset, Recipe};
use papsynth::scene::Scene;
use papsynth::{Engine, Error, Frame, Inputs, Threads};
use serde_json::Value;

/// Returns a recipe for a small field with large pixels.
fn small(preset: Preset) -> Recipe {
    let mut recipe = preset.recipe();
    (recipe.field.width_px, recipe.field.height_px) = (48.into(), 40.into());
    (recipe.field.pixel_um, recipe.field.magnification) = (2.into(), 0.into());
    recipe.layout = Layout::Uniform {};
    recipe.slide.spacing_um = 1.into();
    for mix in recipe.cells.values_mut() {
        mix.count = 1.into();
    }
    recipe
}

fn engine(preset: Preset) -> Engine {
    Engine::new(&small(preset), &Model::builtin(), &Inputs::default()).unwrap()
}

fn image(engine: &Engine, scene: Scene) -> Result<Frame, Error> {
    let mut planes = Vec::new();
    let finished = engine.image::<Error>(scene, Threads::One, |plane| {
        planes.push(plane.clone());
        Ok(())
    })?;
    Ok(Frame { planes, finished })
}

#[test]
fn a_scene_read_from_json_gives_the_same_image() {
    for preset in [Preset::Lbc, Preset::Paper2015, Preset::HighGrade] {
        let engine = engine(preset);
        let scene = engine.scene(Key { seed: 3, index: 2 }).unwrap();
        let again = image(&engine, Scene::from_json(&scene.to_json()).unwrap()).unwrap();
        let first = image(&engine, scene).unwrap();
        assert_eq!(first.planes, again.planes, "{}", preset.name());
        assert_eq!(first.finished.truth, again.finished.truth, "{}", preset.name());
    }
}

#[test]
fn no_number_in_a_scene_makes_the_engine_panic() {
    let engine = engine(Preset::Inflamed);
    let read = |index| serde_json::from_str(&engine.scene(Key { seed: 3, index }).unwrap().to_json()).unwrap();
    // One object of each kind.
    let (mut kinds, mut scenes) = (BTreeSet::new(), Vec::new());
    for index in 0..8 {
        let drawn: Value = read(index);
        let new = drawn["objects"].as_array().unwrap().iter().filter(|o| kinds.insert(o["body"]["kind"].to_string()));
        scenes.extend(new.map(|object| Value::Array(vec![object.clone()])));
    }
    assert!(scenes.len() >= 9, "{kinds:?}");
    let mut value: Value = read(0);
    let mut imaged = 0;
    for objects in &mut scenes {
        value["objects"] = objects.take();
        for pointer in numbers(&value["objects"], "/objects") {
            imaged += try_all(&engine, &mut value, &pointer);
        }
    }
    for pointer in numbers(&value, "").into_iter().filter(|pointer| !pointer.starts_with("/objects")) {
        // Large fields are slow.
        if !pointer.starts_with("/view") {
            imaged += try_all(&engine, &mut value, &pointer);
        }
    }
    assert!(imaged > 300, "{imaged}");
}

/// Returns JSON pointers to all numbers in a value.
fn numbers(value: &Value, path: &str) -> Vec<String> {
    match value {
        Value::Object(fields) => fields.iter().flat_map(|(name, v)| numbers(v, &format!("{path}/{name}"))).collect(),
        Value::Array(values) => {
            (0..).zip(values).flat_map(|(i, v)| numbers(v, &format!("{path}/{i}"))).collect::<Vec<_>>()
        }
        Value::Number(_) => vec![path.to_owned()],
        _ => Vec::new(),
    }
}

/// Images a scene with several values of one number; each is rejected or imaged. Returns how many scenes were valid
/// JSON.
fn try_all(engine: &Engine, value: &mut Value, pointer: &str) -> usize {
    let before = value.pointer(pointer).unwrap().clone();
    let mut read = 0;
    for number in [Value::from(-1), Value::from(0), Value::from(0.02), Value::from(100), Value::from(700.5)] {
        *value.pointer_mut(pointer).unwrap() = number;
        if let Ok(scene) = Scene::from_json(&value.to_string()) {
            read += 1;
            if let Err(error) = image(engine, scene) {
                assert!(!error.to_string().is_empty(), "{pointer}");
            }
        }
    }
    *value.pointer_mut(pointer).unwrap() = before;
    read
}

#[test]
fn a_scene_without_the_reduction_of_edf_images_is_read_with_none() {
    let scene = engine(Preset::ExtendedFocus).scene(Key { seed: 1, index: 0 }).unwrap();
    let mut value = serde_json::to_value(&scene).unwrap();
    let fusion = value["fusion"].as_object_mut().unwrap();
    assert!(fusion.remove("reduction").is_some() && fusion.remove("column_pattern").is_some());
    let read: Scene = serde_json::from_value(value).unwrap();
    let found = read.fusion.unwrap();
    assert_eq!((found.reduction, found.column_pattern), (1.0, 0.0));
}
