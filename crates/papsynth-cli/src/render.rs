//! `papsynth render`: the image of one scene.

use std::path::Path;

use papsynth::scene::Scene;
use papsynth::{Error, Frame};
use papsynth_dataset::write_png;

use crate::args::{EngineArgs, Render};
use crate::exit::{self, Complaint, Failure};
use crate::setup::Setup;
use crate::text_file;

/// Largest scene that is read.
const LARGEST_SCENE: u64 = 1 << 30;

pub(crate) fn run(args: Render) -> Result<(), Failure> {
    text_file::is_png(&args.out)?;
    let scene = read(&args.scene)?;
    let engine = EngineArgs { recipe: args.recipe, model: args.model, seed: scene.key.seed, threads: args.threads };
    let setup = Setup::load(&engine, None)?;
    let mut planes = Vec::new();
    let keep = |plane: &papsynth::Plane| {
        planes.push(plane.clone());
        Ok(())
    };
    let finished = setup.engine.image::<Error>(scene, setup.threads_of_a_frame(), keep);
    let finished = finished.map_err(|error| setup.recipe.refuse(&error))?;
    let frame = Frame { planes, finished };
    let scene = &frame.finished.scene;
    let view = scene.view;
    write_png(&args.out, &frame.picture(), view.width, scene.channels(), scene.camera.bits, view.pixel_um)?;
    exit::print(&format!(
        "{}: {} x {} px, {} objects\n",
        args.out.display(),
        view.width,
        view.height,
        scene.objects.len()
    ))
}

fn read(path: &Path) -> Result<Scene, Failure> {
    let (name, text) = text_file::read(path, LARGEST_SCENE, "a scene")?;
    Scene::from_json(&text).map_err(|error| Failure::input(Complaint::new(format!("{name}: {error}"))))
}
