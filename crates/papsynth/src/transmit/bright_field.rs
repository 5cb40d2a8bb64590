//! Partially coherent bright field: the transmittance of each object, filtered by the transfer functions of the
//! microscope, and the product over all objects.

use core::ops::Range;
use std::collections::BTreeMap;
use std::sync::{Mutex, MutexGuard, PoisonError};

use multiversion::multiversion;
use optics_psf::{
    Abbe, AbbeParams, Border, Factor, Focus, Gaussian, Layer, Method, Microscope, Patch, PatchLayer, PatchScratch,
    Source, fast_length,
};
use portable_numerics::elementary::exp10_from;
use portable_numerics::rounding::round_to_count;

use super::broad_band::BroadBand;
use super::channel_lights::{ChannelLight, LightGroup, MicroscopeCache, light_groups};
use super::light::{FocusAt, LightBuffers, Specimen, TransmissionStats};
use super::object_transmission::{DyeMixer, ObjectTransmission, TransmissionLayer, Window, add, clear};
use super::overlap::Overlaps;
use super::stray_light::{Absorbed, Spread};
use crate::detect::sum_over;
use crate::error::ErrorKind;
use crate::phantom::tile::Tile;
use crate::phantom::{Phantom, Piece};
use crate::recipe::{Imaging, Mixing, Restore};
use crate::scene::{SceneLight, SceneMicroscope, View};
use crate::threads;
use crate::truth::{COVERED, Mask};

/// Fraction of the extra blur in its truncated tails.
const LOST_TAIL: f64 = 1e-5;

/// The bright-field optics of a scene.
pub(crate) struct BrightFieldPath {
    optics: SceneMicroscope,
    /// Blur of the combined light, if any.
    pub(super) extra_blur: Option<Gaussian>,
    /// Spread of the stray light, unless it is evenly distributed.
    spread: Option<Spread>,
    broad_band: Option<BroadBand>,
    restoration: Option<Gaussian>,
    groups: Vec<LightGroup>,
    /// Correction of overlapping colours, if the light is coloured.
    overlaps: Option<Overlaps>,
    /// Patches of each object, cropped or not, if several planes use them.
    cached_patches: Option<Vec<Mutex<Vec<ObjectPatches>>>>,
}

/// The transmittance of an object, transformed for imaging at any focus.
#[derive(Debug, Default)]
struct ObjectPatches {
    window: Window,
    /// One patch per light.
    patches: Vec<Patch>,
    /// Restoration weight of each pixel, if the object has an imaged texture.
    restored: Vec<f32>,
}

/// Buffers that are reused from object to object.
#[derive(Debug, Default)]
pub(super) struct SpareBuffers {
    /// One for each thread.
    patches: Mutex<Vec<PatchBuffers>>,
    /// Images, which wait until they are combined in the order of the objects.
    factors: Mutex<Vec<Vec<Factor>>>,
}

/// Buffers to image an object.
#[derive(Debug, Default)]
struct PatchBuffers {
    transmission: ObjectTransmission,
    object_patches: ObjectPatches,
    scratch: PatchScratch,
    refocused: Factor,
}

/// The images of an object in the lights of a group, in one plane.
struct ObjectFactors {
    factors: Vec<Factor>,
    window: Window,
    /// For each light, the mean absorbance over the mask of each piece.
    absorbances: Vec<Vec<f64>>,
}

impl BrightFieldPath {
    pub(super) fn new(
        specimen: Specimen<'_>,
        optics: &SceneMicroscope,
        microscopes: &MicroscopeCache,
    ) -> Result<Self, ErrorKind> {
        let scene = specimen.scene;
        let groups = light_groups(specimen, optics, microscopes)?;
        let extra_blur = || Gaussian::truncated(optics.extra_blur_um / scene.view.pixel_um, Method::Direct, LOST_TAIL);
        let extra_blur = (optics.extra_blur_um > 0.0).then(extra_blur).transpose();
        let extra_blur = extra_blur.map_err(|error| ErrorKind::Optics("optics.extra_blur_um", error))?;
        // Frames of a slide have the same pixels where they overlap.
        let is_local = optics.stray_light_um > 0.0 && optics.stray_light > 0.0 && scene.frame.is_none();
        let spread = is_local.then(|| Spread::new(optics.stray_light_um / scene.view.pixel_um)).transpose()?;
        let imaged = specimen.phantoms.iter().flat_map(|phantom| &phantom.pieces).any(|piece| piece.imaged);
        let restores = scene.restoration.restore != Restore::Off && imaged;
        let feather = || Gaussian::new(scene.restoration.feather_um / scene.view.pixel_um);
        let restoration = restores.then(feather).transpose()?;
        Ok(Self {
            optics: *optics,
            extra_blur,
            spread,
            broad_band: match scene.light {
                SceneLight::Monochrome { absorption_variation, .. } => BroadBand::new(absorption_variation),
                SceneLight::Colour { .. } => None,
            },
            restoration,
            // Patches of many single wavelengths would need too much memory.
            cached_patches: (scene.planes_um.len() > 1 && groups.len() == 1)
                .then(|| specimen.phantoms.iter().map(|_| Mutex::default()).collect()),
            overlaps: matches!(scene.light, SceneLight::Colour { mixing: Mixing::Spectral, .. })
                .then(|| Overlaps::new(specimen)),
            groups,
        })
    }

    /// Computes the transmitted fraction in the channels of `light`.
    pub(super) fn transmit(
        &self,
        specimen: Specimen<'_>,
        focus: FocusAt,
        light: &mut LightBuffers,
    ) -> Result<TransmissionStats, ErrorKind> {
        let View { width, height, .. } = specimen.scene.view;
        let LightBuffers { channels, lights, images: light_images, spare, .. } = light;
        let is_sum = self.groups.len() > 1;
        if is_sum {
            channels.iter_mut().for_each(|channel| clear(channel, width * height));
        }
        let mut stats = TransmissionStats { absorbances: vec![Vec::new(); channels.len()], clipped_px: 0 };
        for group in &self.groups {
            lights.resize_with(group.lights.len(), optics_psf::TransmittedLight::default);
            light_images.resize(if is_sum { group.lights.len() } else { 0 }, Vec::new());
            for (light, of) in lights.iter_mut().zip(&group.lights) {
                light.reset(of.imager.microscope(), width, height);
            }
            let absorbances = self.transmit_group(specimen, focus, group, spare, lights, &mut stats.clipped_px)?;
            let exact = self.optics.imaging == Imaging::Abbe;
            if let (true, FocusAt::Stage(stage_um)) = (exact, focus) {
                // The multislice image replaces the product.
                stats.clipped_px = 0;
                let indices: Vec<usize> = (0..lights.len()).collect();
                let images = threads::map(specimen.work.threads, &indices, |&light| {
                    let ChannelLight { imager, shift_um, .. } = &group.lights[light];
                    abbe_image(specimen, &self.optics, imager.microscope(), (&group.mixer, light), stage_um - shift_um)
                });
                for (light, image) in lights.iter_mut().zip(images) {
                    light.clear();
                    light.multiply(&image?, [0, 0]);
                }
            }
            // A light that is the only one of its channel is written to it.
            let images = if is_sum { &mut *light_images } else { &mut *channels };
            for (light, image) in lights.iter_mut().zip(images.iter_mut()) {
                light.swap_image(image);
            }
            if let (false, Some(overlaps), DyeMixer::Colour(colour)) = (exact, &self.overlaps, &group.mixer) {
                let blur_px = |index: usize| self.blur_px(specimen, index, focus, group);
                overlaps.correct(colour, specimen, blur_px, images)?;
            }
            for (light, (of, absorbances)) in group.lights.iter().zip(&absorbances).enumerate() {
                for (channel, &weight) in of.weights.iter().enumerate().filter(|(_, weight)| **weight > 0.0) {
                    if is_sum {
                        add_light(&mut channels[channel], &light_images[light], weight as f32);
                    }
                    let sums = &mut stats.absorbances[channel];
                    sums.resize(absorbances.len(), 0.0);
                    sums.iter_mut().zip(absorbances).for_each(|(sum, value)| *sum += weight * value);
                }
            }
        }
        if let Some(band) = self.broad_band {
            for (channel, absorbances) in channels.iter_mut().zip(&mut stats.absorbances) {
                let pieces = specimen.phantoms.iter().flat_map(|phantom| &phantom.pieces);
                for (absorbance, piece) in absorbances.iter_mut().zip(pieces) {
                    let area = piece.mask.area() as f64;
                    let sum = sum_over(piece.mask.runs(), channel, width, [0; 2]);
                    *absorbance = if area > 0.0 { band.absorbance(*absorbance, sum / area) } else { 0.0 };
                }
                band.convert(channel);
            }
        }
        Ok(stats)
    }

    /// Returns the blur of an object in a plane as the standard deviation of its cone of light, px.
    fn blur_px(&self, specimen: Specimen<'_>, index: usize, focus: FocusAt, group: &LightGroup) -> f64 {
        let (FocusAt::Stage(plane_um), [.., light]) = (focus, &group.lights[..]) else { return 0.0 };
        let stage_um = specimen.scene.seen_at_um(plane_um, specimen.scene.objects[index].depth_um);
        let microscope = light.imager.microscope();
        // A uniform disc of radius r has a standard deviation of r/2 along each axis.
        microscope.cone_radius_um(specimen.scene.objects[index].depth_um, stage_um)
            / (2.0 * specimen.scene.view.pixel_um)
    }

    /// Multiplies the lights of a group by the images of all objects.
    ///
    /// Returns, for each light, the mean absorbance over the mask of each piece.
    fn transmit_group(
        &self,
        specimen: Specimen<'_>,
        focus: FocusAt,
        group: &LightGroup,
        spare: &SpareBuffers,
        lights: &mut [optics_psf::TransmittedLight],
        clipped_px: &mut usize,
    ) -> Result<Vec<Vec<f64>>, ErrorKind> {
        let mut absorbances = vec![Vec::new(); lights.len()];
        let image = |index: usize| self.image_object(specimen, index, focus, group, spare);
        threads::each(
            specimen.work.threads,
            specimen.phantoms.len(),
            image,
            |index, object_factors: Result<_, ErrorKind>| {
                let Some(object_factors) = object_factors? else {
                    for absorbances in &mut absorbances {
                        absorbances.extend(specimen.phantoms[index].pieces.iter().map(|_| 0.0));
                    }
                    return Ok(());
                };
                let at_px = object_factors.window.origin;
                let factors = object_factors.factors.iter().zip(&object_factors.absorbances);
                for ((light, absorbances), (factor, own)) in lights.iter_mut().zip(&mut absorbances).zip(factors) {
                    light.multiply(factor, at_px);
                    *clipped_px += factor.clipped;
                    absorbances.extend(own);
                }
                locked(&spare.factors).push(object_factors.factors);
                Ok::<_, ErrorKind>(())
            },
        )?;
        Ok(absorbances)
    }

    /// Converts transmitted fractions to light in some rows: B·(s·(1 − K∗(1 − ∏)) + (1 − s)·∏), where s is the stray
    /// light and K the kernel by which it spreads, 0 if it is evenly distributed.
    pub(super) fn illuminate(&self, light: &mut LightBuffers, width: usize, rows: Range<usize>) {
        let LightBuffers { empty_log10, channels, empty, absorbed, scratch, .. } = light;
        if let Some(spread) = self.spread.as_ref().filter(|_| rows.start == 0) {
            absorbed.resize_with(channels.len(), Absorbed::default);
            for (channel, absorbed) in channels.iter().zip(&mut *absorbed) {
                spread.of(channel, width, absorbed, scratch);
            }
        }
        let pixels = rows.start * width..rows.end * width;
        clear(empty, pixels.len());
        exp10_from(&empty_log10[pixels.clone()], empty);
        let stray = self.optics.stray_light as f32;
        for (index, channel) in channels.iter_mut().enumerate() {
            let light = &mut channel[pixels.clone()];
            if self.spread.is_none() {
                illuminate(light, empty, stray);
                continue;
            }
            let lines = light.chunks_exact_mut(width).zip(empty.chunks_exact(width));
            for (y, (light, empty)) in rows.clone().zip(lines) {
                illuminate_locally(light, empty, absorbed[index].row(y, width), stray);
            }
        }
    }

    /// Returns the blur radius of an object at this depth and stage position, in pixels.
    pub(super) fn reach_px(&self, depth_um: f64, stage_um: f64) -> Result<usize, ErrorKind> {
        let mut widest = 0;
        for light in self.groups.iter().flat_map(|group| &group.lights) {
            widest = widest.max(light.imager.margin_px(depth_um, stage_um - light.shift_um)?);
        }
        Ok(widest)
    }

    /// Images an object. Returns `None` if it does not affect the image.
    fn image_object(
        &self,
        specimen: Specimen<'_>,
        index: usize,
        at: FocusAt,
        group: &LightGroup,
        spare: &SpareBuffers,
    ) -> Result<Option<ObjectFactors>, ErrorKind> {
        specimen.work.cancellation.check()?;
        let (object, phantom) = (&specimen.scene.objects[index], &specimen.phantoms[index]);
        // Depth and stage position.
        let position = |light: &ChannelLight| match at {
            FocusAt::Everywhere => (0.0, 0.0),
            FocusAt::Stage(plane_um) => {
                let depth_um = object.depth_um;
                (depth_um, specimen.scene.seen_at_um(plane_um, depth_um) - light.shift_um)
            }
        };
        let of_light = |light: &ChannelLight| {
            let (depth_um, stage_um) = position(light);
            light.imager.focus(depth_um, stage_um)
        };
        let focuses = group.lights.iter().map(of_light).collect::<Result<Vec<Focus>, _>>()?;
        let n = self.optics.oversampling as usize;
        let Some(window) = Window::around(phantom.pieces.iter(), n) else {
            return Ok(None);
        };
        let margin_px = focuses.iter().map(Focus::margin_px).max().unwrap_or(0);
        let View { width, height, .. } = specimen.scene.view;
        if !window.meets(width, height, margin_px) {
            return Ok(None);
        }
        // Frames of a slide have the same pixels where they overlap.
        let is_cropped = specimen.scene.frame.is_none() && margin_px <= CROPPED_PX;
        let window = if is_cropped { visible_part(&phantom.pieces, window, n, specimen.scene.view) } else { window };
        let mut buffers = locked(&spare.patches).pop().unwrap_or_default();
        let PatchBuffers { transmission, object_patches, scratch, refocused } = &mut buffers;
        let mut factors = locked(&spare.factors).pop().unwrap_or_default();
        let mut cached_patches = self.cached_patches.as_ref().map(|cached_patches| locked(&cached_patches[index]));
        let object_patches = match cached_patches.as_deref_mut() {
            Some(cached_patches) => {
                let same = cached_patches.iter().position(|patches| patches.window == window);
                let index = same.unwrap_or(cached_patches.len());
                if same.is_none() {
                    let mut fresh = ObjectPatches::default();
                    self.fill_patches(phantom, group, (window, n), transmission, &mut fresh);
                    cached_patches.push(fresh);
                }
                &mut cached_patches[index]
            }
            None => {
                self.fill_patches(phantom, group, (window, n), transmission, object_patches);
                object_patches
            }
        };
        factors.resize_with(group.lights.len(), Factor::default);
        let lights = group.lights.iter().zip(&mut object_patches.patches);
        for (factor, (focus, (light, patch))) in factors.iter_mut().zip(focuses.iter().zip(lights)) {
            let imager = &light.imager;
            imager.expose(patch, focus, scratch, factor);
            if !object_patches.restored.is_empty() {
                let refocus = imager.refocus(focus);
                // Imaged textures are in the finest layer.
                let finest = patch.layers() - 1;
                let focus_of = |layer: usize| if layer == finest { &refocus } else { focus };
                imager.expose_with(patch, focus_of, scratch, refocused);
                restore(factor, refocused, &object_patches.restored, window);
            }
        }
        drop(cached_patches);
        locked(&spare.patches).push(buffers);
        let absorbances = factors.iter().enumerate().map(|(light, factor)| {
            let of_piece = |(piece, fraction): (&Piece, &f64)| fraction * mean_absorbance(&piece.mask, factor, window);
            phantom.pieces.iter().zip(&group.fractions[index][light]).map(of_piece).collect()
        });
        let absorbances = absorbances.collect();
        Ok(Some(ObjectFactors { factors, window, absorbances }))
    }

    fn fill_patches(
        &self,
        phantom: &Phantom,
        group: &LightGroup,
        (window, n): (Window, usize),
        transmission: &mut ObjectTransmission,
        object_patches: &mut ObjectPatches,
    ) {
        object_patches.window = window;
        group.mixer.compose(&phantom.pieces, window, n, transmission);
        object_patches.patches.resize_with(group.lights.len(), Patch::default);
        for (index, (light, patch)) in group.lights.iter().zip(&mut object_patches.patches).enumerate() {
            let layers: Vec<_> = transmission.layers.iter().map(|layer| patch_layer(layer, index, window)).collect();
            light.imager.load_layers([window.width, window.height], &layers, patch);
        }
        object_patches.restored.clear();
        let imaged = phantom.pieces.iter().filter(|piece| piece.imaged);
        if let (Some(feather), true) = (&self.restoration, imaged.clone().count() > 0) {
            let mut mask = vec![0.0; window.width * window.height];
            for piece in imaged {
                add(&mut mask, window, &binary(&piece.pixel_coverage(n)), 1.0);
            }
            // Eq. 16: C′ = C ∗ G_σ.
            object_patches.restored = feather.blur(&mask, window.width, Border::Zero);
        }
    }
}

fn locked<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Objects are cropped at this distance from the image if their blur radius is not larger. It is the same for all
/// planes, so that a plane does not depend on the others.
const CROPPED_PX: usize = 32;

/// Returns the part of an object's window that affects an image, with all pieces that are sampled more finely.
fn visible_part(pieces: &[Piece], window: Window, n: usize, view: View) -> Window {
    let coarsest = pieces.iter().map(|piece| piece.step).max().unwrap_or(1);
    let finer = Window::around(pieces.iter().filter(|piece| piece.step < coarsest), n);
    let part = window.cropped(view.width, view.height, CROPPED_PX);
    finer.map_or(part, |finer| part.with(finer))
}

/// Returns a layer of an object in a light, relative to the object's window.
fn patch_layer(layer: &TransmissionLayer, light: usize, window: Window) -> PatchLayer<'_> {
    PatchLayer {
        transmittance: &layer.transmittance[light],
        behind: layer.behind.get(light).map_or(&[], |behind| behind),
        phase_rad: &layer.phase_rad,
        width: layer.window.width * layer.samples_per_pixel,
        samples_per_pixel: layer.samples_per_pixel,
        at_px: [0, 1].map(|axis| usize::try_from(layer.window.origin[axis] - window.origin[axis]).unwrap_or(0)),
    }
}

/// Margin for diffraction beyond the cone of the condenser, µm.
const DIFFRACTION_UM: f64 = 3.0;

/// Images the complete specimen in one light by Abbe's integration over the source with multislice propagation.
///
/// Returns a factor that covers the image. This is the accurate and slow model.
fn abbe_image(
    specimen: Specimen<'_>,
    optics: &SceneMicroscope,
    microscope: &Microscope,
    light: (&DyeMixer, usize),
    stage_um: f64,
) -> Result<Factor, ErrorKind> {
    let View { width, height, pixel_um } = specimen.scene.grid();
    // The grid is periodic: with this margin, light that wraps around does not reach the image.
    let margin = round_to_count(((reach_um(specimen, microscope, stage_um) + DIFFRACTION_UM) / pixel_um).ceil());
    let size = [width, height].map(|side| fast_length(side + 2 * margin));
    let frame = Window { origin: [-(margin as i64); 2], width: size[0], height: size[1] };
    let params =
        AbbeParams { width: size[0], height: size[1], source: Source::Vogel { points: optics.directions as usize } };
    let abbe = Abbe::new(microscope, &params).map_err(|error| ErrorKind::Optics("optics.directions", error))?;
    let layers = layers(specimen, optics.slab_um, light, frame)?;
    let goes_on = || !specimen.work.cancellation.is_cancelled();
    let full = abbe.image_while(&layers, stage_um, &goes_on)?.ok_or(ErrorKind::Cancelled)?;
    let n = microscope.params().oversampling;
    let pixel = |x: usize, y: usize| {
        let rows = (margin + n * y..margin + n * (y + 1)).map(|row| &full[row * size[0] + margin + n * x..][..n]);
        (rows.flatten().sum::<f64>() / (n * n) as f64) as f32
    };
    let values = (0..height / n).flat_map(|y| (0..width / n).map(move |x| (x, y))).map(|(x, y)| pixel(x, y)).collect();
    Ok(Factor { width: width / n, values, margin_px: 0, clipped: 0 })
}

/// Returns the radius of the widest cone of light of all objects, µm.
fn reach_um(specimen: Specimen<'_>, microscope: &Microscope, stage_um: f64) -> f64 {
    let depths = specimen.scene.objects.iter().map(|object| object.depth_um);
    depths.map(|depth_um| microscope.cone_radius_um(depth_um, stage_um)).fold(0.0, f64::max)
}

/// Returns the complex amplitude transmittance of every slab that contains objects.
fn layers(
    specimen: Specimen<'_>,
    slab_um: f64,
    (mixer, light): (&DyeMixer, usize),
    frame: Window,
) -> Result<Vec<Layer>, ErrorKind> {
    let n = specimen.scene.oversampling();
    let mut slabs: BTreeMap<i64, Vec<[f64; 2]>> = BTreeMap::new();
    for (object, phantom) in specimen.scene.objects.iter().zip(specimen.phantoms) {
        specimen.work.cancellation.check()?;
        let Some(window) = Window::around(phantom.pieces.iter(), n) else { continue };
        let window = window.sampled(n);
        let transmission = mixer.compose_on_grid(&phantom.pieces, window);
        let slab = libm::round(object.depth_um / slab_um) as i64;
        let amplitudes = slabs.entry(slab).or_insert_with(|| vec![[1.0, 0.0]; frame.width * frame.height]);
        let transmittance = transmission.transmittance[light].chunks_exact(window.width);
        for (y, row) in transmittance.enumerate() {
            let position =
                |axis: usize, at: usize| usize::try_from(window.origin[axis] + at as i64 - frame.origin[axis]);
            let Ok(to_y) = position(1, y) else { continue };
            for (x, light) in row.iter().enumerate() {
                let Ok(to_x) = position(0, x) else { continue };
                if to_x >= frame.width || to_y >= frame.height {
                    continue;
                }
                let phase = transmission.phase_rad.get(y * window.width + x).map_or(0.0, |phase| f64::from(*phase));
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

/// Returns 1 where coverage reaches the mask threshold and 0 elsewhere.
fn binary(coverage: &Tile) -> Tile {
    let values = coverage.values.iter().map(|coverage| if *coverage >= COVERED { 1.0 } else { 0.0 }).collect();
    Tile { values, ..coverage.clone() }
}

/// Applies Eq. 15 to one object: I′ = I_refocused · C′ + I · (1 − C′). Both factors are of one patch at one focus.
fn restore(factor: &mut Factor, refocused: &Factor, weights: &[f32], window: Window) {
    let margin = factor.margin_px;
    for (y, weights) in weights.chunks_exact(window.width).enumerate() {
        let at = (y + margin) * factor.width + margin;
        let values = factor.values[at..].iter_mut().zip(&refocused.values[at..]);
        for ((old, new), weight) in values.zip(weights) {
            // Eq. 15.
            *old += weight * (new - *old);
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

#[multiversion(targets = "simd")]
fn illuminate_locally(light: &mut [f32], empty: &[f32], absorbed: &[f32], stray: f32) {
    for ((light, empty), absorbed) in light.iter_mut().zip(empty).zip(absorbed) {
        *light = empty * (stray * (1.0 - absorbed) + (1.0 - stray) * *light);
    }
}

/// Returns the absorbance that corresponds to the mean of a factor over a mask.
fn mean_absorbance(mask: &Mask, factor: &Factor, window: Window) -> f64 {
    if mask.area() == 0 {
        return 0.0;
    }
    let origin = window.origin.map(|at| at - factor.margin_px as i64);
    let sum = sum_over(mask.runs(), &factor.values, factor.width, origin);
    -libm::log10((sum / mask.area() as f64).max(f64::MIN_POSITIVE))
}
