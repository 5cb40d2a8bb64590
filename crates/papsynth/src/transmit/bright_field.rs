//! Partially coherent bright field: what each object lets through, filtered by the microscope's transfer functions, and
//! the product over all objects.

use core::ops::Range;
use std::collections::BTreeMap;
use std::sync::{Mutex, MutexGuard, PoisonError};

use multiversion::multiversion;
use optics_psf::{
    Abbe, AbbeParams, Border, Factor, Focus, Gaussian, Lattice, Layer, Method, Microscope, Patch, PatchScratch, Source,
    fast_length,
};
use portable_numerics::elementary::exp10_from;

use super::canvas::{Canvas, Mixer, Window, add, clear};
use super::light::{FocusAt, Light, Passage, Slide};
use super::lights::{ColouredLight, Group, Lenses, groups};
use super::overlap::Overlaps;
use crate::detect::sum_over;
use crate::error::Cause;
use crate::phantom::tile::Tile;
use crate::phantom::{Phantom, Piece};
use crate::recipe::{Imaging, Mixing, Restore};
use crate::scene::{SceneLight, SceneMicroscope, View};
use crate::threads;
use crate::truth::{COVERED, Mask, Run};

/// Share of the further spread that lies beyond its ends and is left out.
const LOST_TAIL: f64 = 1e-5;

/// What all planes of one scene share.
pub(crate) struct BrightFieldPath {
    optics: SceneMicroscope,
    /// The further spread of finished light, if there is any.
    pub(super) further: Option<Gaussian>,
    restoration: Option<Gaussian>,
    groups: Vec<Group>,
    /// Where colours mix, if the light has any.
    overlaps: Option<Overlaps>,
    /// What each object lets through, where several planes share it.
    kept: Option<Vec<Mutex<Option<Loaded>>>>,
    spare: Mutex<Vec<Bench>>,
}

/// What an object lets through, ready to be imaged at any focus.
#[derive(Debug, Default)]
struct Loaded {
    /// Light by light.
    patches: Vec<Patch>,
    /// The share of each grid point that is restored, if the object was taken from an image.
    restored: Vec<f32>,
}

/// Memory that one object leaves to the next.
#[derive(Debug, Default)]
struct Bench {
    canvas: Canvas,
    loaded: Loaded,
    scratch: PatchScratch,
    factors: Vec<Factor>,
    again: Factor,
}

/// What an object lets through of a group's lights, in a plane.
struct Passed {
    bench: Bench,
    window: Window,
    /// Mean absorbance over the masks of its pieces, light by light.
    absorbances: Vec<Vec<f64>>,
}

impl BrightFieldPath {
    pub(super) fn new(slide: Slide<'_>, optics: &SceneMicroscope, lenses: &Lenses) -> Result<Self, Cause> {
        let scene = slide.scene;
        let groups = groups(slide, optics, lenses)?;
        let further = || Gaussian::truncated(optics.extra_blur_um / scene.view.pixel_um, Method::Direct, LOST_TAIL);
        let further = (optics.extra_blur_um > 0.0).then(further).transpose();
        let further = further.map_err(|error| Cause::Optics("optics.extra_blur_um", error))?;
        let imaged = slide.phantoms.iter().flat_map(|phantom| &phantom.pieces).any(|piece| piece.imaged);
        let restores = scene.restoration.restore != Restore::Off && imaged;
        let feather = || Gaussian::new(scene.restoration.feather_um / scene.grid().pixel_um);
        let restoration = restores.then(feather).transpose()?;
        Ok(Self {
            optics: *optics,
            further,
            restoration,
            // Light of many single wavelengths would need too much memory.
            kept: (scene.planes_um.len() > 1 && groups.len() == 1)
                .then(|| slide.phantoms.iter().map(|_| Mutex::default()).collect()),
            overlaps: matches!(scene.light, SceneLight::Colour { mixing: Mixing::Spectral, .. })
                .then(|| Overlaps::new(slide)),
            groups,
            spare: Mutex::default(),
        })
    }

    /// The channels of `light` become what the objects let through.
    pub(super) fn pass(&self, slide: Slide<'_>, focus: FocusAt, light: &mut Light) -> Result<Passage, Cause> {
        let View { width, height, .. } = slide.scene.view;
        let Light { channels, lights, pictures, .. } = light;
        let mut passage = Passage { absorbances: vec![Vec::new(); channels.len()], floored: 0 };
        for group in &self.groups {
            lights.resize_with(group.lights.len(), optics_psf::TransmittedLight::default);
            pictures.resize(group.lights.len(), Vec::new());
            for (light, of) in lights.iter_mut().zip(&group.lights) {
                light.reset(of.imager.microscope(), width, height);
            }
            let absorbances = self.pass_group(slide, focus, group, lights, &mut passage.floored)?;
            let exact = self.optics.imaging == Imaging::Abbe;
            if let (true, FocusAt::Stage(stage_um)) = (exact, focus) {
                // Light that was carried from slab to slab takes the place of products.
                passage.floored = 0;
                let indices: Vec<usize> = (0..lights.len()).collect();
                let images = threads::map(slide.threads, &indices, |&light| {
                    let ColouredLight { imager, shift_um, .. } = &group.lights[light];
                    abbe_image(slide, &self.optics, imager.microscope(), (&group.mixer, light), stage_um - shift_um)
                });
                for (light, image) in lights.iter_mut().zip(images) {
                    light.clear();
                    light.multiply(&image?, [0, 0]);
                }
            }
            for (light, picture) in lights.iter().zip(pictures.iter_mut()) {
                picture.resize(width * height, 0.0);
                light.image_into(picture);
            }
            if let (false, Some(overlaps), Mixer::Colour(colour)) = (exact, &self.overlaps, &group.mixer) {
                let blur_px = |index: usize| self.blur_px(slide, index, focus, group);
                overlaps.correct(colour, slide, blur_px, pictures)?;
            }
            for ((of, picture), absorbances) in group.lights.iter().zip(&*pictures).zip(&absorbances) {
                for (channel, &weight) in of.weights.iter().enumerate().filter(|(_, weight)| **weight > 0.0) {
                    add_light(&mut channels[channel], picture, weight as f32);
                    let sums = &mut passage.absorbances[channel];
                    sums.resize(absorbances.len(), 0.0);
                    sums.iter_mut().zip(absorbances).for_each(|(sum, value)| *sum += weight * value);
                }
            }
        }
        Ok(passage)
    }

    /// How widely an object is blurred in a plane, as the standard deviation of its cone of light, px.
    fn blur_px(&self, slide: Slide<'_>, index: usize, focus: FocusAt, group: &Group) -> f64 {
        let (FocusAt::Stage(plane_um), [.., light]) = (focus, &group.lights[..]) else { return 0.0 };
        let stage_um = slide.scene.seen_at_um(plane_um, slide.scene.objects[index].depth_um);
        let microscope = light.imager.microscope();
        // An even disc of radius r has a standard deviation of r/2 along each axis.
        microscope.cone_radius_um(slide.scene.objects[index].depth_um, stage_um) / (2.0 * slide.scene.view.pixel_um)
    }

    /// Multiplies the lights of a group by what the objects let through, on either grid. Gives the mean absorbances over the
    /// masks of all pieces, light by light.
    fn pass_group(
        &self,
        slide: Slide<'_>,
        focus: FocusAt,
        group: &Group,
        lights: &mut [optics_psf::TransmittedLight],
        floored: &mut usize,
    ) -> Result<Vec<Vec<f64>>, Cause> {
        let mut absorbances = vec![Vec::new(); lights.len()];
        let image = |index: usize| self.image(slide, index, focus, group);
        threads::each(slide.threads, slide.phantoms.len(), image, |index, passed: Result<_, Cause>| {
            let Some(passed) = passed? else {
                for absorbances in &mut absorbances {
                    absorbances.extend(slide.phantoms[index].pieces.iter().map(|_| 0.0));
                }
                return Ok(());
            };
            let at_px = passed.window.origin.map(|at| at / i64::from(self.optics.oversampling));
            let factors = passed.bench.factors.iter().zip(&passed.absorbances);
            for ((light, absorbances), (factor, own)) in lights.iter_mut().zip(&mut absorbances).zip(factors) {
                light.multiply(factor, at_px);
                *floored += factor.clipped;
                absorbances.extend(own);
            }
            self.spare().push(passed.bench);
            Ok::<_, Cause>(())
        })?;
        Ok(absorbances)
    }

    /// Makes of what objects let through light, in some rows: B·(s + (1 − s)·∏), s the stray light.
    pub(super) fn illuminate(&self, light: &mut Light, rows: Range<usize>) {
        let Light { empty_log10, channels, empty, .. } = light;
        clear(empty, rows.len());
        exp10_from(&empty_log10[rows.clone()], empty);
        for channel in channels {
            illuminate(&mut channel[rows.clone()], empty, self.optics.stray_light as f32);
        }
    }

    /// Pixels by which an object of that depth is spread where the stage stands.
    pub(super) fn reach_px(&self, depth_um: f64, stage_um: f64) -> Result<usize, Cause> {
        let mut widest = 0;
        for light in self.groups.iter().flat_map(|group| &group.lights) {
            widest = widest.max(light.imager.margin_px(depth_um, stage_um - light.shift_um)?);
        }
        Ok(widest)
    }

    /// Images an object; nothing if none of its light reaches the picture.
    fn image(&self, slide: Slide<'_>, index: usize, at: FocusAt, group: &Group) -> Result<Option<Passed>, Cause> {
        let (object, phantom) = (&slide.scene.objects[index], &slide.phantoms[index]);
        // How deep it lies and how far the stage has travelled.
        let place = |light: &ColouredLight| match at {
            FocusAt::Everywhere => (0.0, 0.0),
            FocusAt::Stage(plane_um) => {
                let depth_um = object.depth_um;
                (depth_um, slide.scene.seen_at_um(plane_um, depth_um) - light.shift_um)
            }
        };
        let of_light = |light: &ColouredLight| {
            let (depth_um, stage_um) = place(light);
            light.imager.focus(depth_um, stage_um)
        };
        let focuses = group.lights.iter().map(of_light).collect::<Result<Vec<Focus>, _>>()?;
        let n = self.optics.oversampling as usize;
        let Some(window) = Window::around(phantom.pieces.iter().map(|piece| &piece.absorbance), n) else {
            return Ok(None);
        };
        let margin_px = focuses.iter().map(Focus::margin_px).max().unwrap_or(0);
        let grid = slide.scene.grid();
        if !window.meets(grid.width, grid.height, margin_px * n) {
            return Ok(None);
        }
        let mut bench = self.spare().pop().unwrap_or_default();
        let Bench { canvas, loaded, scratch, factors, again } = &mut bench;
        let mut kept = self.kept.as_ref().map(|kept| kept[index].lock().unwrap_or_else(PoisonError::into_inner));
        let loaded = match &mut kept {
            Some(kept) => kept.get_or_insert_with(|| {
                let mut fresh = Loaded::default();
                self.load(phantom, group, window, canvas, &mut fresh);
                fresh
            }),
            None => {
                self.load(phantom, group, window, canvas, loaded);
                loaded
            }
        };
        factors.resize_with(group.lights.len(), Factor::default);
        let lights = group.lights.iter().zip(&mut loaded.patches);
        for (factor, (focus, (light, patch))) in factors.iter_mut().zip(focuses.iter().zip(lights)) {
            let imager = &light.imager;
            imager.expose(patch, focus, scratch, factor);
            if !loaded.restored.is_empty() {
                let (depth_um, stage_um) = place(light);
                let focus = imager.refocus(depth_um, stage_um)?;
                imager.expose(patch, &focus, scratch, again);
                restore(factor, again, &loaded.restored, window, n);
            }
        }
        drop(kept);
        let absorbances = factors.iter().enumerate().map(|(light, factor)| {
            let of_piece = |(piece, share): (&Piece, &f64)| share * mean_absorbance(&piece.mask, factor, window, n);
            phantom.pieces.iter().zip(&group.shares[index][light]).map(of_piece).collect()
        });
        let absorbances = absorbances.collect();
        Ok(Some(Passed { bench, window, absorbances }))
    }

    fn load(&self, phantom: &Phantom, group: &Group, window: Window, canvas: &mut Canvas, loaded: &mut Loaded) {
        group.mixer.compose(&phantom.pieces, window, canvas);
        loaded.patches.resize_with(group.lights.len(), Patch::default);
        let lights = group.lights.iter().zip(&canvas.transmittance);
        for ((light, transmittance), patch) in lights.zip(&mut loaded.patches) {
            light.imager.load(transmittance, &canvas.phase_rad, window.width, patch);
        }
        loaded.restored.clear();
        let imaged = phantom.pieces.iter().filter(|piece| piece.imaged);
        if let (Some(feather), true) = (&self.restoration, imaged.clone().count() > 0) {
            let mut mask = vec![0.0; window.width * window.height];
            for piece in imaged {
                add(&mut mask, window, &binary(&piece.coverage).repeated(piece.cover_step), 1.0);
            }
            // Eq. 16: C′ = C ∗ G_σ.
            loaded.restored = feather.blur(&mask, window.width, Border::Zero);
        }
    }

    fn spare(&self) -> MutexGuard<'_, Vec<Bench>> {
        self.spare.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// How widely light spreads beyond the condenser's cone, µm.
const DIFFRACTION_UM: f64 = 3.0;

/// The accurate way: Abbe's integration over the source, light carried from slab to slab. The slide in one of a mixer's lights, where the stage stands: a factor that covers the picture.
fn abbe_image(
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
    Ok(Factor { lattice: Lattice::Object, width, values, margin_px: 0, clipped: 0 })
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

/// 1 where a tile is covered, 0 elsewhere.
fn binary(coverage: &Tile) -> Tile {
    let values = coverage.values.iter().map(|share| if *share >= COVERED { 1.0 } else { 0.0 }).collect();
    Tile { values, ..coverage.clone() }
}

/// Eq. 15 on one object: I′ = I_again · C′ + I · (1 − C′). Both factors are those of one patch at one focus.
fn restore(factor: &mut Factor, again: &Factor, shares: &[f32], window: Window, n: usize) {
    let (step, margin) = match factor.lattice {
        Lattice::Object => (1, factor.margin_px * n),
        Lattice::Camera => (n, factor.margin_px),
    };
    for (y, shares) in shares.chunks_exact(window.width * step).enumerate() {
        let at = (y + margin) * factor.width + margin;
        let values = factor.values[at..].iter_mut().zip(&again.values[at..]);
        for ((old, new), share) in values.zip(shares[..window.width].iter().step_by(step)) {
            *old += share * (new - *old);
        }
    }
}

#[multiversion(targets = "simd")]
fn add_light(channel: &mut [f32], light: &[f32], weight: f32) {
    channel.iter_mut().zip(light).for_each(|(channel, light)| *channel += weight * light);
}

#[multiversion(targets = "simd")]
fn illuminate(light: &mut [f32], empty: &[f32], stray: f32) {
    light.iter_mut().zip(empty).for_each(|(light, empty)| *light = empty * (stray + (1.0 - stray) * *light));
}

/// Absorbance of the mean light over a mask, of the factor of a patch that was made on a grid of `n` points a pixel's side.
fn mean_absorbance(mask: &Mask, factor: &Factor, window: Window, n: usize) -> f64 {
    let (n, origin) = match factor.lattice {
        Lattice::Object => (n, window.origin),
        Lattice::Camera => (1, window.origin.map(|at| at / n as i64)),
    };
    let origin = origin.map(|at| at - (factor.margin_px * n) as i64);
    let area = mask.area() * (n * n) as u64;
    if area == 0 {
        return 0.0;
    }
    let n = n as u32;
    let scaled = |run: &Run| {
        let Run { y, x0, x1 } = *run;
        (0..n).map(move |line| Run { y: y * n + line, x0: x0 * n, x1: x1 * n })
    };
    let runs: Vec<Run> = mask.runs().iter().flat_map(scaled).collect();
    let sum = sum_over(&runs, &factor.values, factor.width, origin);
    -libm::log10((sum / area as f64).max(f64::MIN_POSITIVE))
}
