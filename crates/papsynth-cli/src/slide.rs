//! `papsynth slide`: slides, and regions of slides.

use crate::args::{SlideTile, SlideVerb};
use crate::exit::{self, ExitError};
use crate::output_file::{Kind, OutputFile};
use crate::report::Spinner;
use crate::setup::Setup;

#[cfg(feature = "zarr")]
mod set;
#[cfg(feature = "zarr")]
pub(crate) use set::{progress_of, verify};

/// Pixels of a tile at most.
const MAX_TILE_PIXELS: u64 = 1 << 28;

pub(crate) fn run(verb: SlideVerb) -> Result<(), ExitError> {
    match verb {
        SlideVerb::Tile(args) => tile(&args),
        #[cfg(feature = "zarr")]
        SlideVerb::Make(args) => set::make(args),
        #[cfg(feature = "zarr")]
        SlideVerb::Finalize(args) => set::finalize(&args),
        #[cfg(not(feature = "zarr"))]
        SlideVerb::Make(_) | SlideVerb::Finalize(_) => Err(ExitError::with_help(
            "this build cannot write slides: they are OME-Zarr images".to_owned(),
            "build with `--features zarr`; `papsynth slide tile` writes a region of a slide as a PNG",
        )),
    }
}

fn tile(args: &SlideTile) -> Result<(), ExitError> {
    let pixels = u64::from(args.size[0]) * u64::from(args.size[1]);
    if pixels > MAX_TILE_PIXELS {
        let message = format!("--size {},{}: more than {MAX_TILE_PIXELS} pixels", args.size[0], args.size[1]);
        return Err(ExitError::with_help(message, "`papsynth slide make` writes images of any size"));
    }
    let out = OutputFile::check(&args.out, Kind::Image, args.force)?;
    let setup = Setup::load(&args.engine, None)?;
    let slide = setup.slide(args.engine.seed, args.slide)?;
    let spinner = Spinner::start("rendering");
    let part = slide.picture(args.at, args.size, setup.threads_of_a_frame()).map_err(|e| setup.recipe.error(&e))?;
    drop(spinner);
    let middle = part.planes.len() / 2;
    if part.planes.len() > 1 {
        let (planes, um) = (part.planes.len(), part.planes[middle].stage_um);
        exit::note(format!(
            "the tile shows the centre plane of {planes}, at {um} µm; `papsynth slide make` writes all planes"
        ));
    }
    out.write_levels(
        &part.planes[middle].grey,
        args.size[0] as usize,
        slide.channels(),
        slide.bits(),
        slide.pixel_um(),
    )?;
    exit::print(&format!("Look at: {}\n", args.out.display()))
}
