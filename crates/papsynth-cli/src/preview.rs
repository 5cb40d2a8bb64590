//! `papsynth preview` and `papsynth render`: one field beside its truth, and the image of one scene.

use std::path::Path;

use papsynth::key::Key;
use papsynth::scene::Scene;
use papsynth::{Error, Finished, Frame, Plane};
use papsynth_dataset::{RgbImage, write_file, write_png};

use crate::args::{EngineArgs, Preview, Render};
use crate::exit::{self, Failure};
use crate::setup::Setup;
use crate::text_file;

/// Pixels between the two halves.
const GAP: usize = 8;

const GAP_GREY: u8 = 255;

pub(crate) fn run(args: &Preview) -> Result<(), Failure> {
    text_file::is_png(&args.out)?;
    let setup = Setup::load(&args.engine, None)?;
    let key = Key { seed: args.engine.seed, index: args.index };
    let scene = setup.engine.scene(key).map_err(|error| setup.recipe.refuse(&error))?;
    let middle = scene.planes_um.len() / 2;
    let mut shown = None;
    let finished = image(&setup, scene, |plane| {
        if plane.index == middle {
            shown = Some(plane.clone());
        }
    })?;
    let Some(plane) = shown else { return Ok(()) };
    let png = beside(&plane, &finished).to_png().map_err(|error| Failure::file("write", &args.out, &error))?;
    write_file(&args.out, &png)?;
    told(&args.out, &finished.scene)
}

/// A plane on the left, the same with its truth drawn over it on the right.
fn beside(plane: &Plane, finished: &Finished) -> RgbImage {
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

const LARGEST_SCENE: u64 = 1 << 30;

/// `papsynth render`: the image of one scene.
pub(crate) fn render(args: Render) -> Result<(), Failure> {
    text_file::is_png(&args.out)?;
    let scene = read(&args.scene)?;
    let engine = EngineArgs { recipe: args.recipe, model: args.model, seed: scene.key.seed, threads: args.threads };
    let setup = Setup::load(&engine, None)?;
    let mut planes = Vec::new();
    let finished = image(&setup, scene, |plane| planes.push(plane.clone()))?;
    let frame = Frame { planes, finished };
    let (picture, scene) = (frame.image(), &frame.finished.scene);
    write_png(&args.out, &picture, scene.view.width, scene.channels(), scene.camera.bits, scene.view.pixel_um)?;
    told(&args.out, scene)
}

fn image(setup: &Setup, scene: Scene, mut keep: impl FnMut(&Plane)) -> Result<Finished, Failure> {
    let keep = |plane: &Plane| {
        keep(plane);
        Ok(())
    };
    let finished = setup.engine.image::<Error>(scene, setup.threads_of_a_frame(), keep);
    finished.map_err(|error| setup.recipe.refuse(&error))
}

fn told(out: &Path, Scene { view, objects, .. }: &Scene) -> Result<(), Failure> {
    let (out, width, height) = (out.display(), view.width, view.height);
    exit::print(&format!("{out}: {width} x {height} px, {} objects\n", objects.len()))
}

fn read(path: &Path) -> Result<Scene, Failure> {
    let (name, text) = text_file::read(path, LARGEST_SCENE, "a scene")?;
    Scene::from_json(&text).map_err(|error| Failure::input(format!("{name}: {error}")))
}
