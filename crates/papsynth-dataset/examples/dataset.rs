//! Writes a small data set and its contact sheet, which is the picture in the README.
//!
//! `cargo run --release --example dataset [FOLDER [PLANES]]`; without a folder it goes to `target/dataset-example`,
//! with a number of planes above 1 it is one of focus stacks.

use std::path::PathBuf;
use std::sync::atomic::AtomicBool;

use papsynth::model::Model;
use papsynth::recipe::Preset;
use papsynth::{Engine, Inputs, Threads};
use papsynth_dataset::{Check, Dataset, DatasetInfo, Error, Format, Layout, Run, Task};

fn main() -> Result<(), Error> {
    let mut arguments = std::env::args().skip(1);
    let folder = arguments.next().map_or_else(|| PathBuf::from("target/dataset-example"), PathBuf::from);
    let planes: f64 = arguments.next().and_then(|n| n.parse().ok()).unwrap_or(1.0);
    let mut recipe = Preset::Lbc.recipe();
    recipe.field.width_px = 688.0.into();
    recipe.field.height_px = 519.0.into();
    recipe.focus.planes = planes.into();
    for mix in recipe.cells.values_mut() {
        mix.count = 6.0.into();
    }
    let model = Model::builtin();
    let engine = Engine::new(&recipe, &model, &Inputs::default())?;
    let layout = Layout::new([Format::Folder]);
    let info = DatasetInfo { recipe: &recipe, model: &model, seed: 1, map: None, layout: &layout };
    let dataset = Dataset::create_or_resume(&folder, &info)?;
    let stop = AtomicBool::new(false);
    let (task, threads, check) = (Task::ALL, Threads::One, Check::Sizes);
    dataset.generate(
        &engine,
        &Run { frames: 0..1, task, workers: 1, threads, check, stop: &stop, profile: None },
        &|_| (),
    )?;
    dataset.finish()?;
    Ok(())
}
