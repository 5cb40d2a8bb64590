//! `papsynth preview`: one field beside its truth.

use papsynth::key::Key;
use papsynth::{Error, Finished, Plane};
use papsynth_dataset::{Picture, write_file};

use crate::args::Preview;
use crate::exit::{self, Failure};
use crate::setup::Setup;
use crate::text_file;

/// Pixels between the two halves.
const GAP: usize = 8;

/// Grey of the gap.
const GAP_GREY: u8 = 255;

pub(crate) fn run(args: &Preview) -> Result<(), Failure> {
    text_file::is_png(&args.out)?;
    let setup = Setup::load(&args.engine, None)?;
    let key = Key { seed: args.engine.seed, index: args.index };
    let refuse = |error: Error| setup.recipe.refuse(&error);
    let scene = setup.engine.scene(key).map_err(refuse)?;
    let (view, middle) = (scene.view, scene.planes_um.len() / 2);
    let mut shown = None;
    let finished = setup
        .engine
        .image::<Error>(scene, setup.threads_of_a_frame(), |plane| {
            if plane.index == middle {
                shown = Some(plane.clone());
            }
            Ok(())
        })
        .map_err(refuse)?;
    let Some(plane) = shown else { return Ok(()) };
    let picture = beside(&plane, &finished);
    let png = picture.to_png().map_err(|error| Failure::file("write", &args.out, &error))?;
    write_file(&args.out, &png)?;
    exit::print(&format!(
        "{}: {} x {} px, {} objects\n",
        args.out.display(),
        view.width,
        view.height,
        finished.scene.objects.len()
    ))
}

/// A plane on the left, the same with its truth drawn over it on the right.
fn beside(plane: &Plane, finished: &Finished) -> Picture {
    let (plain, truth) = (Picture::plain(plane, finished), Picture::overlay(plane, finished));
    let width = finished.scene.view.width;
    let mut rgb = Vec::with_capacity(truth.rgb.len() * 2);
    for (plain, drawn) in plain.rgb.chunks(3 * width).zip(truth.rgb.chunks(3 * width)) {
        rgb.extend_from_slice(plain);
        rgb.extend([GAP_GREY; 3 * GAP]);
        rgb.extend_from_slice(drawn);
    }
    Picture { width: 2 * width + GAP, rgb }
}
