//! Whole fields by the engine.

use std::fs;
use std::hint::black_box;
use std::path::{Path, PathBuf};
use std::sync::atomic::AtomicBool;

use papsynth::key::Key;
use papsynth::model::Model;
use papsynth::recipe::{Abundance, Clusters, Distribution, Layout, Number, Preset, Recipe};
use papsynth::truth::Group;
use papsynth::{Engine, Error, Inputs, Plane, Threads};
use papsynth_dataset::{Check, Dataset, DatasetInfo, Run, Share};

use crate::{Size, Work};

const SEED: u64 = 3;

/// The recipe that mirrors the peer's defaults.
#[must_use]
pub fn peer_recipe() -> Recipe {
    toml::from_str(include_str!("../peer.toml")).expect("peer.toml is a recipe")
}

/// The default recipe.
#[must_use]
pub fn default_recipe() -> Recipe {
    Preset::Lbc.recipe()
}

/// A recipe on a field of another size, with as much of everything per area. Nothing is left to chance: counts that are
/// drawn become the middle of what they are drawn from.
#[must_use]
pub fn at_density(mut recipe: Recipe, [width, height]: Size) -> Recipe {
    let (width, height) = (width as f64, height as f64);
    let share = width * height / (middle(&recipe.field.width_px) * middle(&recipe.field.height_px));
    let pixel_mm = middle(&recipe.field.pixel_um) * 1e-3;
    let area_mm2 = width * height * pixel_mm * pixel_mm;
    let number = |count: &Abundance| middle(count.number()) * if count.is_density() { area_mm2 } else { share };
    recipe.field.width_px = width.into();
    recipe.field.height_px = height.into();
    if let Layout::Clusters(Clusters { count, .. }) = &mut recipe.layout {
        *count = number(count).round().clamp(1.0, 1e4).into();
    }
    let debris = &mut recipe.debris;
    let counts = recipe.cells.values_mut().map(|mix| &mut mix.count).chain([
        &mut debris.bacilli.clusters,
        &mut debris.bare_nuclei.count,
        &mut debris.bubbles.count,
        &mut debris.candida.colonies,
        &mut debris.cocci.colonies,
        &mut debris.crystals.count,
        &mut debris.dirt.clusters,
        &mut debris.dust.count,
        &mut debris.fibres.count,
        &mut debris.leukocytes.clusters,
        &mut debris.mucus.strands,
        &mut debris.out_of_focus.count,
        &mut debris.red_cells.clusters,
        &mut debris.scratches.count,
        &mut debris.smudges.count,
        &mut debris.speckles.count,
        &mut debris.trichomonads.groups,
    ]);
    for count in counts {
        *count = number(count).round().into();
    }
    recipe
}

/// The middle of what a number is drawn from.
fn middle(number: &Number) -> f64 {
    match number {
        Number::Fixed(value) => *value,
        Number::Drawn { distribution, .. } => match distribution {
            Distribution::Uniform(low, high) => (low + high) / 2.0,
            Distribution::Normal(middle, _) | Distribution::LogNormal(middle, _) => *middle,
            Distribution::Choice(values) => values.iter().sum::<f64>() / values.len().max(1) as f64,
        },
    }
}

/// One field after the other with its truth, on the calling thread; no file is written.
#[must_use]
pub fn fields(recipe: &Recipe) -> Work {
    let engine = Engine::new(recipe, &Model::builtin(), &Inputs::default()).expect("the recipe is valid");
    let (mut ids, mut layers, mut index) = (Vec::new(), Vec::new(), 0);
    Box::new(move || {
        let work = |plane: &Plane| {
            black_box(&plane.grey);
            Ok::<(), Error>(())
        };
        let truth = engine.stream(Key { seed: SEED, index }, Threads::One, work).expect("the recipe is valid").truth;
        for group in Group::ALL {
            truth.labels_into(group, &mut ids);
            black_box(&ids);
        }
        truth.layers_into(&mut layers);
        black_box(&layers);
        index += 1;
    })
}

/// Removes its folder at the end.
struct Scratch(PathBuf);

impl Drop for Scratch {
    fn drop(&mut self) {
        // What cannot be removed lies below the target folder.
        let _ = fs::remove_dir_all(&self.0);
    }
}

/// One field of the default recipe after the other, every file of image and truth written below a folder, which is removed
/// with the work.
#[must_use]
pub fn default_files(folder: &Path) -> Work {
    let scratch = Scratch(folder.join(format!("fields-{}", std::process::id())));
    let (recipe, model) = (default_recipe(), Model::builtin());
    let engine = Engine::new(&recipe, &model, &Inputs::default()).expect("the recipe is valid");
    let info = DatasetInfo {
        recipe: &recipe,
        model: &model,
        seed: SEED,
        map: None,
        layout: &papsynth_dataset::Layout::default(),
    };
    let dataset = Dataset::create_or_resume(&scratch.0, &info).expect("a new data set");
    let stop = AtomicBool::new(false);
    let mut index = 0;
    Box::new(move || {
        // The folder lives as long as the work.
        let _ = &scratch;
        let frames = index..index + 1;
        let run = Run {
            frames,
            share: Share::ALL,
            at_once: 1,
            threads: Threads::One,
            check: Check::Sizes,
            stop: &stop,
            profile: None,
        };
        dataset.generate(&engine, &run, &|_| ()).expect("the files can be written");
        index += 1;
    })
}
