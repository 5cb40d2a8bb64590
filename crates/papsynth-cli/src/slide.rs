//! `papsynth slide`: whole slides, and any part of one.

use papsynth_dataset::write_png;

use crate::args::{SlideTile, SlideVerb};
use crate::exit::{self, Failure};
use crate::setup::Setup;
use crate::text_file;

#[cfg(feature = "zarr")]
mod set;
#[cfg(feature = "zarr")]
pub(crate) use set::{there, verify};

/// Most pixels of a part that is made as one picture.
const MOST_PIXELS: u64 = 1 << 28;

pub(crate) fn run(verb: SlideVerb) -> Result<(), Failure> {
    match verb {
        SlideVerb::Tile(args) => tile(&args),
        #[cfg(feature = "zarr")]
        SlideVerb::Make(args) => set::make(args),
        #[cfg(feature = "zarr")]
        SlideVerb::Finalize(args) => set::finalize(&args),
        #[cfg(not(feature = "zarr"))]
        SlideVerb::Make(_) | SlideVerb::Finalize(_) => Err(Failure::wrong(
            "this build cannot write slides, which are OME-Zarr".to_owned(),
            "build with `--features zarr`; `papsynth slide tile` makes any part of a slide as a PNG",
        )),
    }
}

fn tile(args: &SlideTile) -> Result<(), Failure> {
    let pixels = u64::from(args.size[0]) * u64::from(args.size[1]);
    if pixels > MOST_PIXELS {
        let message = format!("--size {},{}: more than {MOST_PIXELS} pixels at once", args.size[0], args.size[1]);
        return Err(Failure::wrong(message, "`papsynth slide make` makes pictures of any size"));
    }
    text_file::is_png(&args.out)?;
    let setup = Setup::load(&args.engine, None)?;
    let slide = setup.slide(args.engine.seed, args.slide)?;
    let part = slide.picture(args.at, args.size, setup.threads_of_a_frame()).map_err(|e| setup.recipe.refuse(&e))?;
    let middle = part.planes.len() / 2;
    if part.planes.len() > 1 {
        let (planes, um) = (part.planes.len(), part.planes[middle].stage_um);
        exit::note(format!(
            "of {planes} planes the middle one, at {um} µm, is written; `papsynth slide make` writes all"
        ));
    }
    write_png(
        &args.out,
        &part.planes[middle].grey,
        args.size[0] as usize,
        slide.channels(),
        slide.bits(),
        slide.pixel_um(),
    )?;
    exit::print(&format!("Look at: {}\n", args.out.display()))
}
