//! The accurate way: Abbe's integration over the source, light carried from slab to slab.

use std::collections::BTreeMap;

use optics_psf::{Abbe, AbbeParams, Factor, Lattice, Layer, Microscope, Source, fast_length};

use super::Slide;
use super::canvas::{Canvas, Mixer, Window};
use crate::error::Cause;
use crate::scene::{SceneMicroscope, View};

/// How widely light spreads beyond the condenser's cone, µm.
const DIFFRACTION_UM: f64 = 3.0;

/// The slide in one of a mixer's lights, where the stage stands: a factor that covers the picture.
pub(super) fn image(
    slide: Slide<'_>,
    optics: &SceneMicroscope,
    microscope: &Microscope,
    light: (&Mixer, usize),
    stage_um: f64,
) -> Result<Factor, Cause> {
    let View { width, height, pixel_um } = slide.scene.grid();
    // Light that leaves on one side comes back on the other: so far apart that it does not reach the picture.
    let margin = crate::random::count(((reach_um(slide, microscope, stage_um) + DIFFRACTION_UM) / pixel_um).ceil());
    let size = [width, height].map(|side| fast_length(side + 2 * margin));
    let frame = Window { origin: [-(margin as i64); 2], width: size[0], height: size[1] };
    let params =
        AbbeParams { width: size[0], height: size[1], source: Source::Vogel { points: optics.directions as usize } };
    let abbe = Abbe::new(microscope, &params).map_err(|error| Cause::Optics("optics.directions", error))?;
    let layers = layers(slide, optics.slab_um, light, frame)?;
    let whole = abbe.image(&layers, stage_um)?;
    let rows = whole.chunks_exact(size[0]).skip(margin).take(height);
    let values = rows.flat_map(|row| row[margin..margin + width].iter().map(|light| *light as f32)).collect();
    Ok(Factor { lattice: Lattice::Object, width, values, margin_px: 0, floored: 0 })
}

/// The widest cone of light of all objects, µm.
fn reach_um(slide: Slide<'_>, microscope: &Microscope, stage_um: f64) -> f64 {
    let depths = slide.scene.objects.iter().map(|object| object.depth_um);
    depths.map(|depth_um| microscope.cone_radius_um(depth_um, stage_um)).fold(0.0, f64::max)
}

/// Every slab that is not empty, as amplitudes.
fn layers(slide: Slide<'_>, slab_um: f64, (mixer, light): (&Mixer, usize), frame: Window) -> Result<Vec<Layer>, Cause> {
    let mut slabs: BTreeMap<i64, Vec<[f64; 2]>> = BTreeMap::new();
    let mut canvas = Canvas::default();
    for (object, phantom) in slide.scene.objects.iter().zip(slide.phantoms) {
        let tiles = phantom.pieces.iter().map(|piece| &piece.absorbance);
        let Some(window) = Window::around(tiles, 1) else { continue };
        mixer.compose(&phantom.pieces, window, &mut canvas);
        let slab = libm::round(object.depth_um / slab_um) as i64;
        let amplitudes = slabs.entry(slab).or_insert_with(|| vec![[1.0, 0.0]; frame.width * frame.height]);
        let transmittance = canvas.transmittance[light].chunks_exact(window.width);
        for (y, row) in transmittance.enumerate() {
            let place = |axis: usize, at: usize| usize::try_from(window.origin[axis] + at as i64 - frame.origin[axis]);
            let Ok(to_y) = place(1, y) else { continue };
            for (x, light) in row.iter().enumerate() {
                let Ok(to_x) = place(0, x) else { continue };
                if to_x >= frame.width || to_y >= frame.height {
                    continue;
                }
                let phase = canvas.phase_rad.get(y * window.width + x).map_or(0.0, |phase| f64::from(*phase));
                let amplitude = f64::from(*light).max(0.0).sqrt();
                let [re, im] = [amplitude * libm::cos(phase), amplitude * libm::sin(phase)];
                let at = &mut amplitudes[to_y * frame.width + to_x];
                *at = [at[0] * re - at[1] * im, at[0] * im + at[1] * re];
            }
        }
    }
    let layer = |(slab, amplitudes): (i64, Vec<[f64; 2]>)| Ok(Layer::new(slab as f64 * slab_um, amplitudes)?);
    slabs.into_iter().map(layer).collect()
}
