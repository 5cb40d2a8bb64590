//! Densities, and fields in which not all cells fit.

use papsynth::key::Key;
use papsynth::model::Model;
use papsynth::recipe::{Abundance, Debris, Folds, Layout, Number, Optics, Preset, Recipe, Sheet};
use papsynth::scene::{MAX_ATTEMPTS, Scene};
use papsynth::truth::Group;
use papsynth::{Engine, Error, Inputs, Threads};

/// A preset with a field of this size, µm, on pixels of 1 µm, and cells without folds.
fn coarse(preset: Preset, [width_um, height_um]: [i32; 2]) -> Recipe {
    let mut recipe = preset.recipe();
    (recipe.field.width_px, recipe.field.height_px) = (width_um.into(), height_um.into());
    recipe.field.pixel_um = 1.into();
    recipe.optics = Optics::gaussian();
    recipe.cytoplasm.sheet = Sheet::Flat;
    recipe.cytoplasm.folds = Folds { flap: 0.into(), roll: 0.into(), folded_over: 0.into(), ..Folds::default() };
    recipe.debris = Debris::none();
    recipe
}

fn engine(recipe: &Recipe) -> Engine {
    Engine::new(recipe, &Model::builtin(), &Inputs::default()).unwrap()
}

fn scene(recipe: &Recipe, index: u64) -> Scene {
    engine(recipe).scene(Key { seed: 5, index }).unwrap()
}

/// The mean fraction of pixels that cytoplasm covers.
fn coverage(recipe: &Recipe, fields: u64) -> f64 {
    let engine = engine(recipe);
    let covered = |index| {
        let finished = engine.stream::<Error>(Key { seed: 5, index }, Threads::All, |_| Ok(())).unwrap();
        let ids = finished.truth.labels(Group::Cytoplasm).ids;
        ids.iter().filter(|id| **id > 0).count() as f64 / ids.len() as f64
    };
    (0..fields).map(covered).sum::<f64>() / fields as f64
}

#[test]
fn fields_of_any_size_are_covered_alike() {
    let mut recipe = coarse(Preset::Lbc, [160, 120]);
    // A fixed density, so that few fields give a precise mean.
    for mix in recipe.cells.values_mut() {
        mix.count = Abundance::per_mm2(mix.count.number().mean());
    }
    let small = coverage(&recipe, 80);
    (recipe.field.width_px, recipe.field.height_px) = (344.into(), 260.into());
    let middle = coverage(&recipe, 20);
    (recipe.field.width_px, recipe.field.height_px) = (750.into(), 750.into());
    let large = coverage(&recipe, 4);
    assert!(small > 0.1 && (small / middle - 1.0).abs() < 0.1, "{small} {middle} {large}");
    assert!((large / middle - 1.0).abs() < 0.1, "{small} {middle} {large}");
}

#[test]
fn a_small_field_of_the_dense_preset_is_drawn() {
    let mut recipe = Preset::Dense.recipe();
    (recipe.field.width_px, recipe.field.height_px) = (400.into(), 300.into());
    for index in 0..20 {
        let scene = scene(&recipe, index);
        assert_eq!((scene.attempts, scene.unplaced()), (1, 0), "field {index}");
    }
}

#[test]
fn a_density_gives_its_mean_number_and_a_count_gives_itself() {
    for layout in [Layout::default(), Layout::Uniform {}, Layout::Band(Default::default())] {
        let mut recipe = coarse(Preset::Sparse, [200, 150]);
        recipe.layout = layout;
        recipe.cells.get_mut("intermediate").unwrap().count = Abundance::per_mm2(400);
        recipe.cells.get_mut("superficial").unwrap().count = 3.into();
        let (mut found, fields) = (0, 120);
        for index in 0..fields {
            let cells = scene(&recipe, index).cells;
            found += cells["intermediate"].in_field;
            let counts = cells["superficial"];
            assert_eq!([counts.requested, counts.placed, counts.in_field], [3; 3], "{:?}", recipe.layout);
        }
        // Twelve in each field on average.
        let mean = found as f64 / fields as f64;
        assert!((mean - 12.0).abs() < 1.5, "{mean} {:?}", recipe.layout);
    }
    let recipe = coarse(Preset::Sparse, [200, 150]);
    let expected = recipe.expected_counts();
    let of = |path: &str| expected.iter().find(|(name, _)| name == path).map(|(_, mean)| *mean);
    let density = recipe.cells["intermediate"].count.number().mean();
    assert!((of("cells.intermediate.count").unwrap() - 0.03 * density).abs() < 1e-9);
    assert_eq!(of("debris.leukocytes.clusters"), Some(0.0));
}

#[test]
fn fields_in_which_cells_do_not_fit_are_drawn_again() {
    let mut recipe = coarse(Preset::Sparse, [120, 90]);
    recipe.slide.spacing_um = 30.into();
    recipe.cells.get_mut("superficial").unwrap().count = 0.into();
    recipe.cells.get_mut("intermediate").unwrap().count = Number::choice([2.0, 500.0]).into();
    let mut attempts = Vec::new();
    for index in 0..12 {
        let scene = scene(&recipe, index);
        assert_eq!((scene.unplaced(), scene.cells["intermediate"].placed), (0, 2), "field {index}");
        assert_eq!(scene, self::scene(&recipe, index));
        attempts.push(scene.attempts);
    }
    assert!(attempts.contains(&1) && attempts.iter().any(|n| *n > 1), "{attempts:?}");
}

#[test]
fn as_many_cells_are_placed_as_fit() {
    let mut recipe = coarse(Preset::Sparse, [120, 90]);
    recipe.slide.spacing_um = 30.into();
    recipe.cells.get_mut("superficial").unwrap().count = 1000.into();
    recipe.cells.get_mut("intermediate").unwrap().count = Abundance::per_mm2(50_000);
    let engine = engine(&recipe);
    let key = Key { seed: 5, index: 0 };
    let scene = engine.scene(key).unwrap();
    assert_eq!(scene.attempts, MAX_ATTEMPTS);
    for (class, counts) in &scene.cells {
        assert!(0 < counts.placed && counts.placed < counts.requested, "{class}: {counts:?}");
    }
    assert_eq!(Scene::from_json(&scene.to_json()).unwrap(), scene);
    let image = |threads| {
        let mut grey = Vec::new();
        let finished = engine
            .stream::<Error>(key, threads, |plane| {
                grey = plane.grey.clone();
                Ok(())
            })
            .unwrap();
        (finished.scene, finished.truth, grey)
    };
    assert_eq!(image(Threads::One), image(Threads::All));
}
