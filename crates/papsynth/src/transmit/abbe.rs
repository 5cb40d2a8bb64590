//! The accurate way: Abbe's integration over the source, light carried from slab to slab.

use std::collections::BTreeMap;

use optics_psf::{Abbe, AbbeParams, Fft, Layer, Microscope, Source, fast_length};

use super::Slide;
use super::canvas::{Canvas, Mixer, Window};
use crate::scene::View;

/// How widely light spreads beyond the condenser's cone, µm.
const DIFFRACTION_UM: f64 = 3.0;

/// What a picture by Abbe's way needs to know.
pub(super) struct Exact<'a> {
    pub(super) microscope: &'a Microscope,
    pub(super) mixer: &'a Mixer,
    /// Which of the mixer's lights.
    pub(super) light: usize,
    pub(super) directions: usize,
    pub(super) slab_um: f64,
    /// The slide's grid: the picture's rows and columns.
    pub(super) grid: View,
    pub(super) oversampling: usize,
    pub(super) fft: Fft,
}

impl Exact<'_> {
    /// Light on the slide's grid, relative to that of an empty slide, where the stage stands.
    pub(super) fn image(&self, slide: Slide<'_>, stage_um: f64) -> Result<Vec<f32>, String> {
        let View { width, height, pixel_um } = self.grid;
        // Light that leaves on one side comes back on the other: so far apart that it does not reach the picture.
        let farthest = |reach: f64, depth_um: f64| reach.max(self.microscope.cone_radius_um(-depth_um, stage_um));
        let reach_um = slide.scene.objects.iter().map(|object| object.depth_um).fold(0.0, farthest) + DIFFRACTION_UM;
        let margin = crate::random::count((reach_um / pixel_um).ceil());
        let size = [width, height].map(|side| fast_length(side + 2 * margin));
        let frame = Window { origin: [-(margin as i64); 2], width: size[0], height: size[1] };
        let layers = self.layers(slide, frame)?;
        let params = AbbeParams {
            width: size[0],
            height: size[1],
            source: Source::Vogel { points: self.directions },
            fft: self.fft,
        };
        let abbe = Abbe::new(self.microscope, &params).map_err(|e| format!("optics.directions: {e}"))?;
        let whole = abbe.image(&layers, stage_um).map_err(|e| format!("optics: {e}"))?;
        let rows = whole.chunks_exact(size[0]).skip(margin).take(height);
        Ok(rows.flat_map(|row| row[margin..margin + width].iter().map(|light| *light as f32)).collect())
    }

    /// Every slab that is not empty, as amplitudes.
    fn layers(&self, slide: Slide<'_>, frame: Window) -> Result<Vec<Layer>, String> {
        let mut slabs: BTreeMap<i64, Vec<[f64; 2]>> = BTreeMap::new();
        let mut canvas = Canvas::default();
        for (object, phantom) in slide.scene.objects.iter().zip(slide.phantoms) {
            let tiles = phantom.pieces.iter().map(|piece| &piece.absorbance);
            let Some(window) = Window::around(tiles, frame, self.oversampling) else { continue };
            self.mixer.compose(&phantom.pieces, window, &mut canvas);
            #[expect(clippy::cast_possible_truncation, reason = "depths are at most a few thousand slabs")]
            let slab = libm::round(object.depth_um / self.slab_um) as i64;
            let amplitudes = slabs.entry(slab).or_insert_with(|| vec![[1.0, 0.0]; frame.width * frame.height]);
            let transmittance = canvas.transmittance[self.light].chunks_exact(window.width);
            for (y, row) in transmittance.enumerate() {
                let place =
                    |axis: usize, at: usize| usize::try_from(window.origin[axis] + at as i64 - frame.origin[axis]);
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
        let layer = |(slab, amplitudes): (i64, Vec<[f64; 2]>)| {
            Layer::new(-(slab as f64) * self.slab_um, amplitudes).map_err(|e| format!("optics: {e}"))
        };
        slabs.into_iter().map(layer).collect()
    }
}
