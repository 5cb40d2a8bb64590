//! An image of `Live` has the same bytes as that of a new engine. It does not depend on the images before it.

use papsynth::key::Key;
use papsynth::live::{Cancellation, Live, Made};
use papsynth::model::Model;
use papsynth::recipe::{LightSection, Optics, Preset, Recipe};
use papsynth::{Engine, Error, ErrorKind, Inputs, Threads};
use proptest::prelude::*;
use serde_json::Value;

const KEY: Key = Key { seed: 3, index: 0 };

/// Objects of a field at most, so that debug builds are fast.
const MAX_OBJECTS: f64 = 60.0;

fn small(preset: Preset) -> Recipe {
    let mut recipe = preset.recipe();
    (recipe.field.width_px, recipe.field.height_px) = (120.0.into(), 90.0.into());
    recipe.slide.spacing_um = 2.0.into();
    recipe.cells.values_mut().for_each(|mix| mix.count = 1.0.into());
    recipe
}

fn live() -> Live {
    Live::new(&Model::builtin(), &Inputs::default()).unwrap()
}

/// Images a recipe, and compares the result with that of a new engine.
fn check(live: &mut Live, recipe: &Recipe, key: Key) -> Made {
    let engine = Engine::new(recipe, &Model::builtin(), &Inputs::default()).unwrap();
    let flag = Cancellation::default();
    let image = live.scene(recipe, key).and_then(|scene| live.image(recipe, scene, Threads::All, &flag));
    let (expected, found) = match (engine.frame(key), image) {
        (Ok(expected), Ok(found)) => (expected, found),
        // Some valid recipes have no image, as with patches of chromatin that are larger than a donor.
        (Err(expected), Err(found)) => {
            assert_eq!(found.to_string(), expected.to_string(), "{}", recipe.to_toml());
            return Made::default();
        }
        (expected, found) => panic!("{:?} instead of {:?}\n{}", found.err(), expected.err(), recipe.to_toml()),
    };
    flag.cancel();
    assert!(found.planes == expected.planes, "the planes differ\n{}", recipe.to_toml());
    let finished = live.finish().unwrap().unwrap();
    assert_eq!(finished.scene, expected.finished.scene);
    assert!(finished.truth == expected.finished.truth, "the truth differs\n{}", recipe.to_toml());
    assert!(finished.all_in_focus == expected.finished.all_in_focus, "the fused image differs\n{}", recipe.to_toml());
    found.made
}

/// Appends the paths of all plain numbers.
fn numbers(value: &Value, path: &str, found: &mut Vec<String>) {
    match value {
        Value::Number(_) => found.push(path.to_owned()),
        Value::Object(map) => map.iter().for_each(|(name, inner)| numbers(inner, &format!("{path}/{name}"), found)),
        Value::Array(items) => (0..).zip(items).for_each(|(i, inner)| numbers(inner, &format!("{path}/{i}"), found)),
        _ => {}
    }
}

/// Multiplies one number of a recipe. Returns `None` if the result is invalid or has too many objects.
#[expect(clippy::cast_possible_truncation, reason = "numbers of recipes are small")]
fn scaled(recipe: &Recipe, choice: prop::sample::Index, factor: f64) -> Option<Recipe> {
    let mut value = serde_json::to_value(recipe).unwrap();
    let mut paths = Vec::new();
    numbers(&value, "", &mut paths);
    let at = value.pointer_mut(&paths[choice.index(paths.len())]).unwrap();
    let number = at.as_f64().unwrap();
    let new = if number == 0.0 { factor } else { number * factor };
    *at = if at.is_f64() { new.into() } else { (new.round() as i64).into() };
    let changed: Recipe = serde_json::from_value(value).ok()?;
    let objects: f64 = changed.expected_counts().iter().map(|(_, count)| count).sum();
    let is_small = objects < MAX_OBJECTS && changed.field == recipe.field && changed.focus.planes.mean() < 4.0;
    (is_small && changed.problems().is_empty()).then_some(changed)
}

#[derive(Debug, Clone)]
enum Change {
    Number(prop::sample::Index, f64),
    Preset(prop::sample::Index, prop::sample::Index),
    Planes(u32),
    Index(u64),
    /// An image of the previous recipe with other settings that is cancelled before it starts.
    Cancelled(prop::sample::Index, f64),
    Reduced,
}

fn change() -> impl Strategy<Value = Change> {
    let index = any::<prop::sample::Index>;
    let factor = || prop::sample::select(vec![0.5, 0.9, 1.1, 2.0]);
    prop_oneof![
        12 => (index(), factor()).prop_map(|(choice, factor)| Change::Number(choice, factor)),
        2 => (index(), index()).prop_map(|(preset, section)| Change::Preset(preset, section)),
        1 => (1..4_u32).prop_map(Change::Planes),
        1 => (0..2_u64).prop_map(Change::Index),
        2 => (index(), factor()).prop_map(|(choice, factor)| Change::Cancelled(choice, factor)),
        1 => Just(Change::Reduced),
    ]
}

const SECTIONS: [&str; 9] =
    ["focus", "slide", "cytoplasm", "nucleus", "stain", "background", "light", "optics", "camera"];

proptest! {
    #![proptest_config(ProptestConfig::with_cases(12))]

    #[test]
    fn images_do_not_depend_on_earlier_images(
        preset in prop::sample::select(&Preset::ALL[..]),
        changes in prop::collection::vec(change(), 4..9),
    ) {
        let (mut live, mut recipe, mut key) = (live(), small(preset), KEY);
        check(&mut live, &recipe, key);
        for change in changes {
            match change {
                Change::Number(choice, factor) => recipe = scaled(&recipe, choice, factor).unwrap_or(recipe),
                Change::Preset(preset, section) => {
                    let mut changed = recipe.clone();
                    let section = section.get(&SECTIONS);
                    changed.replace(&small(*preset.get(&Preset::ALL)), |name| name == *section);
                    if changed.problems().is_empty() {
                        recipe = changed;
                    }
                }
                Change::Planes(planes) => recipe.focus.planes = f64::from(planes).into(),
                Change::Index(index) => key.index = index,
                Change::Cancelled(choice, factor) => {
                    let other = scaled(&recipe, choice, factor).unwrap_or_else(|| recipe.clone());
                    let flag = Cancellation::default();
                    flag.cancel();
                    if let Ok(scene) = live.scene(&other, key) {
                        let result = live.image(&other, scene, Threads::All, &flag);
                        let is_cancelled = matches!(result, Err(Error::Image { cause: ErrorKind::Cancelled, .. }));
                        prop_assert!(is_cancelled);
                    }
                }
                Change::Reduced => {
                    if let Ok(scene) = live.scene(&recipe, key) {
                        // If it fails, the image of full size does, too.
                        let _ = live.image(&recipe, scene.reduced(2), Threads::All, &Cancellation::default());
                    }
                }
            }
            check(&mut live, &recipe, key);
        }
    }
}

#[test]
fn a_change_computes_only_what_depends_on_it() {
    let mut live = live();
    let mut recipe = small(Preset::Lbc);
    recipe.cells.values_mut().for_each(|mix| mix.count = 2.0.into());
    let all = check(&mut live, &recipe, KEY);
    assert!(all.phantoms > 0 && all.planes == 1 && all.background);
    let none = Made::default();
    assert_eq!(check(&mut live, &recipe, KEY), none);
    recipe.camera.read_noise_e = 30.0.into();
    recipe.camera.sensor_dust = 300.0.into();
    assert_eq!(check(&mut live, &recipe, KEY), none);
    recipe.background.level = 0.7.into();
    assert_eq!(check(&mut live, &recipe, KEY), Made { background: true, ..none });
    recipe.focus.centre_um = 2.0.into();
    assert_eq!(check(&mut live, &recipe, KEY), Made { planes: 1, ..none });
    // The light of the first plane is kept.
    recipe.focus.centre_um = 0.0.into();
    assert_eq!(check(&mut live, &recipe, KEY), none);
    if let Optics::BrightField(microscope) = &mut recipe.optics {
        microscope.condenser_na = 0.3.into();
    }
    assert_eq!(check(&mut live, &recipe, KEY), Made { planes: 1, ..none });
    recipe.light = LightSection::Colour(papsynth::recipe::Colour::default());
    assert_eq!(check(&mut live, &recipe, KEY), Made { planes: 1, ..none });
    recipe.slide.depth_um = 6.0.into();
    assert_eq!(check(&mut live, &recipe, KEY).phantoms, 0);
    // Additional objects do not change the others.
    let count = all.phantoms;
    recipe.debris.dust.count = 3.0.into();
    let made = check(&mut live, &recipe, KEY);
    assert!(made.phantoms <= 3 && count > 3, "{made:?}");
}

#[test]
fn light_beyond_the_limit_is_not_kept() {
    let mut live = live();
    live.set_max_light_bytes(0);
    let mut recipe = small(Preset::Sparse);
    recipe.focus.planes = 3.0.into();
    assert_eq!(check(&mut live, &recipe, KEY).planes, 3);
    recipe.camera.read_noise_e = 30.0.into();
    assert_eq!(check(&mut live, &recipe, KEY).planes, 3);
}
