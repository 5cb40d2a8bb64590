//! `papsynth preview` and `papsynth render`: one field next to its ground truth, and the image of one scene.

use std::path::Path;

use papsynth::key::Key;
use papsynth::scene::Scene;
use papsynth::{Error, Finished, Frame, Plane};
use papsynth_dataset::{Layout, RgbImage};

use crate::args::{EngineArgs, Preview, Render};
use crate::exit::{self, ExitError};
use crate::input_file;
use crate::memory;
use crate::output_file::{Kind, OutputFile};
use crate::report::Spinner;
use crate::setup::Setup;
use crate::words::counted;

/// Pixels between the two images.
const GAP: usize = 8;

const GAP_GREY: u8 = 255;

pub(crate) fn run(args: &Preview) -> Result<(), ExitError> {
    let out = OutputFile::check(&args.out, Kind::Image, args.force)?;
    let setup = Setup::load(&args.engine, None)?;
    memory::frames_at_once(&setup, &Layout::default(), 1)?;
    let key = Key { seed: args.engine.seed, index: args.index };
    let scene = setup.engine.scene(key).map_err(|error| setup.recipe.error(&error))?;
    let middle = scene.planes_um.len() / 2;
    let mut shown = None;
    let finished = image(&setup, scene, |plane| {
        if plane.index == middle {
            shown = Some(plane.clone());
        }
    })?;
    let Some(plane) = shown else { return Ok(()) };
    out.write_rgb(&side_by_side(&plane, &finished))?;
    print_size(&args.out, &finished.scene)?;
    exit::print(&format!("SHA-256 of the grey levels: {}\n", plane.sha256(finished.scene.camera.bits)))
}

/// A plane on the left, and the plane with outlines of its ground truth on the right.
fn side_by_side(plane: &Plane, finished: &Finished) -> RgbImage {
    let (plain, truth) = (RgbImage::plain(plane, finished), RgbImage::overlay(plane, finished));
    let width = finished.scene.view.width;
    let mut rgb = Vec::with_capacity(truth.rgb.len() * 2);
    for (plain, drawn) in plain.rgb.chunks(3 * width).zip(truth.rgb.chunks(3 * width)) {
        rgb.extend_from_slice(plain);
        rgb.extend([GAP_GREY; 3 * GAP]);
        rgb.extend_from_slice(drawn);
    }
    RgbImage { width: 2 * width + GAP, rgb }
}

/// Size limit of scenes, bytes.
const MAX_SCENE_BYTES: u64 = 1 << 30;

/// `papsynth render`: the image of one scene.
pub(crate) fn render(args: Render) -> Result<(), ExitError> {
    let out = OutputFile::check(&args.out, Kind::Image, args.force)?;
    let scene = read(&args.scene)?;
    let engine = EngineArgs { recipe: args.recipe, model: args.model, seed: scene.key.seed, threads: args.threads };
    let setup = Setup::load(&engine, None)?;
    memory::check_scene(&setup, &scene)?;
    let mut planes = Vec::new();
    let finished = image(&setup, scene, |plane| planes.push(plane.clone()))?;
    let frame = Frame { planes, finished };
    let (levels, scene) = (frame.image(), &frame.finished.scene);
    out.write_levels(&levels, scene.view.width, scene.channels(), scene.camera.bits, scene.view.pixel_um)?;
    print_size(&args.out, scene)
}

fn image(setup: &Setup, scene: Scene, mut keep: impl FnMut(&Plane)) -> Result<Finished, ExitError> {
    let keep = |plane: &Plane| {
        keep(plane);
        Ok(())
    };
    let _spinner = Spinner::start("rendering");
    let finished = setup.engine.image::<Error>(scene, setup.threads_of_a_frame(), keep);
    finished.map_err(|error| setup.recipe.error(&error))
}

fn print_size(out: &Path, Scene { view, objects, .. }: &Scene) -> Result<(), ExitError> {
    let (out, width, height) = (out.display(), view.width, view.height);
    exit::print(&format!("{out}: {width} x {height} px, {}\n", counted(objects.len() as u64, "object", "objects")))
}

fn read(path: &Path) -> Result<Scene, ExitError> {
    let (name, text) = input_file::read(path, MAX_SCENE_BYTES, "a scene")?;
    Scene::from_json(&text).map_err(|error| ExitError::input(format!("{name}: {error}")))
}
