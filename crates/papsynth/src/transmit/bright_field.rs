//! Partially coherent bright field: what each object lets through, filtered by the microscope's transfer functions, and
//! the product over all objects.

use std::collections::BTreeMap;
use std::sync::{Mutex, MutexGuard, PoisonError};

use multiversion::multiversion;
use optics_psf::{Border, Factor, Focus, Gaussian, Lattice, Method, Patch, PatchScratch};

use super::abbe::Exact;
use super::canvas::{Canvas, Mixer, Window, add};
use super::lenses::Lenses;
use super::lights::{ColouredLight, Group, groups};
use super::overlap::Overlaps;
use super::{BAND, Band, FocusAt, Light, Passage, Slide};
use crate::detect::sum_over;
use crate::exp10::exp10_from;
use crate::phantom::Phantom;
use crate::phantom::tile::{Tile, TileRef, lay};
use crate::recipe::{Imaging, Mixing, Restore};
use crate::scene::{SceneLight, SceneMicroscope, View};
use crate::threads::{self, Threads};
use crate::truth::{COVERED, Mask, Run};

/// Objects whose factors are in memory at one time, when several threads make them.
const CHUNK: usize = 64;

/// Share of the further spread that lies beyond its ends and is left out.
const LOST_TAIL: f64 = 1e-5;

/// What all planes of one scene share.
pub(crate) struct BrightFieldPath {
    view: View,
    /// Grid points along the side of a pixel.
    oversampling: usize,
    slab_um: f64,
    /// Directions of light, if it is to be carried from slab to slab.
    directions: Option<usize>,
    grid: View,
    stray_light: f32,
    further: Option<Gaussian>,
    restoration: Option<Gaussian>,
    groups: Vec<Group>,
    /// Where colours mix, if the light has any.
    overlaps: Option<Overlaps>,
    threads: Threads,
    /// Spectra of each object by margin, where several planes share them.
    spectra: Vec<Mutex<BTreeMap<usize, Spectra>>>,
    keeps: bool,
    spare: Mutex<Vec<Bench>>,
}

/// What is on the slide of one object.
#[derive(Debug, Default)]
struct Spectra {
    window: Option<Window>,
    /// Light by light.
    patches: Vec<Patch>,
    /// The share of each grid point that is restored, if the object was taken from an image.
    restored: Vec<f32>,
}

/// Memory that one object leaves to the next.
#[derive(Debug, Default)]
struct Bench {
    canvas: Canvas,
    spectra: Spectra,
    scratch: PatchScratch,
    factors: Vec<Factor>,
    again: Factor,
}

/// What an object lets through of a group's lights, in a plane.
struct Passed {
    bench: Bench,
    /// Upper left grid point of the patch without its margin.
    origin: [i64; 2],
    /// Mean absorbance over the masks of its pieces, light by light.
    absorbances: Vec<Vec<f64>>,
}

impl BrightFieldPath {
    pub(super) fn new(
        slide: Slide<'_>,
        optics: &SceneMicroscope,
        lenses: &Lenses,
        threads: Threads,
    ) -> Result<Self, String> {
        let scene = slide.scene;
        let groups = groups(slide, optics, lenses, threads)?;
        let gaussian = |um: f64, tail: f64| {
            let gaussian = Gaussian::truncated(um / scene.view.pixel_um, Method::Direct, tail);
            gaussian.map_err(|e| format!("optics.extra_blur_um: {e}"))
        };
        let further = (optics.extra_blur_um > 0.0).then(|| gaussian(optics.extra_blur_um, LOST_TAIL)).transpose()?;
        let restores = scene.restoration.restore != Restore::Off && any_imaged(slide.phantoms);
        let feather = || Gaussian::new(scene.restoration.feather_um / scene.grid().pixel_um);
        let restoration = restores.then(feather).transpose().map_err(|e| e.to_string())?;
        Ok(Self {
            view: scene.view,
            oversampling: scene.oversampling(),
            slab_um: optics.slab_um,
            directions: (optics.imaging == Imaging::Abbe).then_some(optics.directions),
            grid: scene.grid(),
            stray_light: optics.stray_light as f32,
            further,
            restoration,
            threads,
            spectra: slide.phantoms.iter().map(|_| Mutex::default()).collect(),
            // Light of many single wavelengths would need too much memory.
            keeps: scene.planes_um.len() > 1 && groups.len() == 1,
            overlaps: matches!(scene.light, SceneLight::Colour { mixing: Mixing::Spectral, .. }).then(|| {
                let view = scene.view;
                Overlaps::new(slide.phantoms, view.width, view.height, scene.oversampling(), threads)
            }),
            groups,
            spare: Mutex::default(),
        })
    }

    /// The channels of `light` become what the objects let through.
    pub(super) fn pass(&self, slide: Slide<'_>, focus: FocusAt, light: &mut Light) -> Result<Passage, String> {
        let (pixels, n) = (self.view.width * self.view.height, self.oversampling);
        let Light { channels, lights, fine, .. } = light;
        for channel in channels.iter_mut() {
            channel.clear();
            channel.resize(pixels, 0.0);
        }
        let mut passage = Passage { absorbances: vec![Vec::new(); channels.len()], floored: 0 };
        for group in &self.groups {
            lights.resize(lights.len().max(group.lights.len()), Vec::new());
            let lights = &mut lights[..group.lights.len()];
            for coarse in lights.iter_mut() {
                coarse.clear();
                coarse.resize(pixels, 1.0);
            }
            // The finer grids of all lights, one behind the other.
            fine.clear();
            fine.resize(lights.len() * pixels * n * n, 1.0);
            let absorbances = self.pass_group(slide, focus, group, lights, fine, &mut passage.floored)?;
            if let (Some(directions), FocusAt::Stage(stage_um)) = (self.directions, focus) {
                passage.floored = 0;
                self.replace(slide, stage_um, group, directions, lights, fine)?;
            } else if let (Some(overlaps), Mixer::Colour(colour)) = (&self.overlaps, &group.mixer) {
                let blur_px = |index: usize| self.blur_px(slide, index, focus, group);
                overlaps.correct(colour, slide.phantoms, blur_px, lights, self.threads)?;
            }
            for (index, (of, coarse)) in group.lights.iter().zip(lights).enumerate() {
                mean_of_pixels(&fine[index * pixels * n * n..][..pixels * n * n], self.view.width, n, coarse);
                for (channel, &weight) in of.weights.iter().enumerate().filter(|(_, weight)| **weight > 0.0) {
                    add_light(&mut channels[channel], coarse, weight as f32);
                    let sums = &mut passage.absorbances[channel];
                    sums.resize(absorbances[index].len(), 0.0);
                    sums.iter_mut().zip(&absorbances[index]).for_each(|(sum, value)| *sum += weight * value);
                }
            }
        }
        Ok(passage)
    }

    /// Puts light that was carried from slab to slab in the place of products.
    fn replace(
        &self,
        slide: Slide<'_>,
        stage_um: f64,
        group: &Group,
        directions: usize,
        lights: &mut [Vec<f32>],
        fine: &mut [f32],
    ) -> Result<(), String> {
        let samples = self.grid.width * self.grid.height;
        let indices: Vec<usize> = (0..lights.len()).collect();
        let images = threads::map(self.threads, &indices, |&light| {
            let ColouredLight { lens, shift_um, .. } = &group.lights[light];
            let exact = Exact {
                microscope: lens.imager.microscope(),
                mixer: &group.mixer,
                light,
                directions,
                slab_um: self.slab_um,
                grid: self.grid,
                oversampling: self.oversampling,
                fft: lens.fft,
            };
            exact.image(slide, stage_um - shift_um)
        });
        for ((image, coarse), fine) in images.into_iter().zip(lights).zip(fine.chunks_exact_mut(samples)) {
            coarse.fill(1.0);
            fine.copy_from_slice(&image?);
        }
        Ok(())
    }

    /// How widely an object is blurred in a plane, as the standard deviation of its cone of light, px.
    fn blur_px(&self, slide: Slide<'_>, index: usize, focus: FocusAt, group: &Group) -> f64 {
        let (FocusAt::Stage(stage_um), [.., light]) = (focus, &group.lights[..]) else { return 0.0 };
        let microscope = light.lens.imager.microscope();
        // An even disc of radius r has a standard deviation of r/2 along each axis.
        microscope.cone_radius_um(-slide.scene.objects[index].depth_um, stage_um) / (2.0 * self.view.pixel_um)
    }

    /// Multiplies the lights of a group by what the objects let through, on either grid. Gives the mean absorbances over the
    /// masks of all pieces, light by light.
    fn pass_group(
        &self,
        slide: Slide<'_>,
        focus: FocusAt,
        group: &Group,
        lights: &mut [Vec<f32>],
        fine: &mut [f32],
        floored: &mut usize,
    ) -> Result<Vec<Vec<f64>>, String> {
        let n = self.oversampling;
        let mut absorbances = vec![Vec::new(); lights.len()];
        let indices: Vec<usize> = (0..slide.phantoms.len()).collect();
        // One thread multiplies a patch while it is still in the cache.
        let chunk = match self.threads {
            Threads::One => 1,
            Threads::All => CHUNK,
        };
        for chunk in indices.chunks(chunk) {
            let passed = threads::map(self.threads, chunk, |&index| self.image(slide, index, focus, group));
            for (&index, passed) in chunk.iter().zip(passed) {
                let Some(passed) = passed? else {
                    for absorbances in &mut absorbances {
                        absorbances.extend(slide.phantoms[index].pieces.iter().map(|_| 0.0));
                    }
                    continue;
                };
                let both = lights.iter_mut().zip(fine.chunks_exact_mut(self.view.width * self.view.height * n * n));
                for (light, (coarse, fine)) in both.enumerate() {
                    let tile = self.tile(&passed, light);
                    match passed.bench.factors[light].lattice {
                        Lattice::Object => multiply(fine, self.view.width * n, tile),
                        Lattice::Camera => multiply(coarse, self.view.width, tile),
                    }
                    *floored += passed.bench.factors[light].floored;
                    absorbances[light].extend(&passed.absorbances[light]);
                }
                self.spare().push(passed.bench);
            }
        }
        Ok(absorbances)
    }

    /// Gives the light of each band of rows: B·(s + (1 − s)·∏), s the stray light.
    pub(super) fn spread(&self, light: &mut Light, mut visit: impl FnMut(Band<'_>)) {
        let Light { empty_log10, channels, empty, bands, scratch, .. } = light;
        let (width, height) = (self.view.width, self.view.height);
        bands.resize(channels.len(), Vec::new());
        let reach = self.further.as_ref().map_or(0, Gaussian::radius);
        let mut lit = 0;
        for first in (0..height).step_by(BAND) {
            let end = (first + BAND).min(height);
            let needed = (end + reach).min(height);
            if lit < needed {
                let rows = lit * width..needed * width;
                empty.clear();
                empty.resize(rows.len(), 0.0);
                exp10_from(&empty_log10[rows.clone()], empty);
                for channel in channels.iter_mut() {
                    illuminate(&mut channel[rows.clone()], empty, self.stray_light);
                }
                lit = needed;
            }
            for (whole, band) in channels.iter().zip(bands.iter_mut()) {
                band.resize((end - first) * width, 0.0);
                match &self.further {
                    Some(gaussian) => {
                        gaussian.blur_rows_into(whole, width, Border::Reflect, first, band, scratch);
                    }
                    None => band.copy_from_slice(&whole[first * width..end * width]),
                }
            }
            let mut spread: Vec<&mut [f32]> = bands.iter_mut().map(Vec::as_mut_slice).collect();
            visit(Band { first, sharp: &[], spread: &mut spread });
        }
    }

    /// How deep an object lies and how far the stage has travelled, as the optics count them. Depth counts away from the
    /// objective there, and towards it here.
    fn place(depth_um: f64, focus: FocusAt, light: &ColouredLight) -> [f64; 2] {
        match focus {
            FocusAt::Everywhere => [0.0, 0.0],
            FocusAt::Stage(plane_um) => [-depth_um, plane_um - light.shift_um],
        }
    }

    /// Images an object; nothing if none of its light reaches the picture.
    fn image(&self, slide: Slide<'_>, index: usize, at: FocusAt, group: &Group) -> Result<Option<Passed>, String> {
        let (object, phantom) = (&slide.scene.objects[index], &slide.phantoms[index]);
        let of_light = |light: &ColouredLight| {
            let [depth_um, stage_um] = Self::place(object.depth_um, at, light);
            light.lens.imager.focus(depth_um, stage_um).map_err(|e| format!("optics: {e}"))
        };
        let focuses = group.lights.iter().map(of_light).collect::<Result<Vec<Focus>, _>>()?;
        // The widest margin of all lights decides what is too far outside to be seen.
        let margin_px = focuses.iter().map(Focus::margin_px).max().unwrap_or(0);
        let mut bench = self.spare().pop().unwrap_or_default();
        let mut kept = self.spectra[index].lock().unwrap_or_else(PoisonError::into_inner);
        let Bench { canvas, spectra, scratch, factors, again } = &mut bench;
        let spectra = if self.keeps {
            kept.entry(margin_px).or_insert_with(|| {
                let mut fresh = Spectra::default();
                self.load(phantom, group, margin_px, canvas, &mut fresh);
                fresh
            })
        } else {
            self.load(phantom, group, margin_px, canvas, spectra);
            spectra
        };
        let Some(window) = spectra.window else {
            drop(kept);
            self.spare().push(bench);
            return Ok(None);
        };
        factors.resize_with(group.lights.len(), Factor::default);
        let lights = group.lights.iter().zip(&mut spectra.patches);
        for (factor, (focus, (light, patch))) in factors.iter_mut().zip(focuses.iter().zip(lights)) {
            let imager = &light.lens.imager;
            imager.expose(patch, focus, scratch, factor);
            if !spectra.restored.is_empty() {
                let [depth_um, stage_um] = Self::place(object.depth_um, at, light);
                let focus = imager.refocus(depth_um, stage_um).map_err(|e| format!("optics: {e}"))?;
                imager.expose(patch, &focus, scratch, again);
                restore(factor, again, &spectra.restored, window, self.oversampling);
            }
        }
        drop(kept);
        let origin = window.origin;
        let mut passed = Passed { bench, origin, absorbances: Vec::new() };
        passed.absorbances = (0..group.lights.len())
            .map(|light| {
                let shares = &group.shares[index][light];
                let tile = self.tile(&passed, light);
                let fine = passed.bench.factors[light].lattice == Lattice::Object;
                let n = if fine { self.oversampling } else { 1 };
                slide.masks[index]
                    .iter()
                    .zip(shares)
                    .map(|(mask, share)| share * mean_absorbance(mask, tile, n))
                    .collect()
            })
            .collect();
        Ok(Some(passed))
    }

    /// Puts what an object lets through into spectra.
    fn load(&self, phantom: &Phantom, group: &Group, margin_px: usize, canvas: &mut Canvas, spectra: &mut Spectra) {
        let n = self.oversampling;
        // What lies farther outside than light spreads is not seen.
        let reach = (2 * margin_px * n) as i64;
        let limits = Window {
            origin: [-reach; 2],
            width: self.view.width * n + 4 * margin_px * n,
            height: self.view.height * n + 4 * margin_px * n,
        };
        spectra.window = Window::around(phantom.pieces.iter().map(|piece| &piece.absorbance), limits, n);
        let Some(window) = spectra.window else { return };
        group.mixer.compose(&phantom.pieces, window, canvas);
        spectra.patches.resize_with(group.lights.len(), Patch::default);
        for ((light, transmittance), patch) in group.lights.iter().zip(&canvas.transmittance).zip(&mut spectra.patches)
        {
            light.lens.imager.load(transmittance, &canvas.phase_rad, window.width, patch);
        }
        spectra.restored.clear();
        if let Some(feather) = &self.restoration {
            let imaged = phantom.pieces.iter().filter(|piece| piece.imaged);
            let mut mask = vec![0.0; window.width * window.height];
            for piece in imaged.clone() {
                add(&mut mask, window, &binary(&piece.coverage), 1.0);
            }
            if imaged.count() > 0 {
                // Eq. 16: C′ = C ∗ G_σ.
                spectra.restored = mask.clone();
                feather.blur_into(
                    &mask,
                    window.width,
                    Border::Zero,
                    &mut spectra.restored,
                    &mut optics_psf::Scratch::default(),
                );
            }
        }
    }

    /// Where a factor lies, on the grid that it is on.
    fn tile<'a>(&self, passed: &'a Passed, light: usize) -> TileRef<'a> {
        let factor = &passed.bench.factors[light];
        let (n, margin) = (self.oversampling as i64, factor.margin_px as i64);
        let origin = match factor.lattice {
            Lattice::Object => passed.origin.map(|at| at - margin * n),
            Lattice::Camera => passed.origin.map(|at| at / n - margin),
        };
        TileRef { origin, width: factor.width, values: &factor.values }
    }

    fn spare(&self) -> MutexGuard<'_, Vec<Bench>> {
        self.spare.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

fn any_imaged(phantoms: &[Phantom]) -> bool {
    phantoms.iter().flat_map(|phantom| &phantom.pieces).any(|piece| piece.imaged)
}

/// 1 where a tile is covered, 0 elsewhere.
fn binary(coverage: &Tile) -> Tile {
    let values = coverage.values.iter().map(|share| if *share >= COVERED { 1.0 } else { 0.0 }).collect();
    Tile { values, ..coverage.clone() }
}

/// Eq. 15 on one object: I′ = I_again · C′ + I · (1 − C′).
fn restore(factor: &mut Factor, again: &Factor, shares: &[f32], window: Window, n: usize) {
    let fine = factor.lattice == Lattice::Object;
    if again.lattice != factor.lattice || again.values.len() != factor.values.len() {
        return;
    }
    let step = if fine { 1 } else { n };
    let margin = if fine { factor.margin_px * n } else { factor.margin_px };
    let width = window.width / step;
    for y in 0..window.height / step {
        let at = (y + margin) * factor.width + margin;
        for x in 0..width {
            let share = shares[y * step * window.width + x * step];
            let (old, new) = (factor.values[at + x], again.values[at + x]);
            factor.values[at + x] = old + share * (new - old);
        }
    }
}

#[multiversion(targets = "simd")]
fn multiply(image: &mut [f32], width: usize, tile: TileRef<'_>) {
    lay(image, width, 0, tile, |row, values| row.iter_mut().zip(values).for_each(|(pixel, value)| *pixel *= value));
}

/// Multiplies by the mean over each pixel of a grid of `n` points a pixel's side.
#[multiversion(targets = "simd")]
fn mean_of_pixels(fine: &[f32], width: usize, n: usize, coarse: &mut [f32]) {
    let weight = 1.0 / (n * n) as f32;
    let mut sums = vec![0.0_f32; width];
    for (coarse, fine) in coarse.chunks_exact_mut(width).zip(fine.chunks_exact(width * n * n)) {
        sums.fill(0.0);
        for line in fine.chunks_exact(width * n) {
            if n == 2 {
                for (sum, pair) in sums.iter_mut().zip(line.chunks_exact(2)) {
                    *sum += pair[0] + pair[1];
                }
            } else {
                for (sum, samples) in sums.iter_mut().zip(line.chunks_exact(n)) {
                    *sum += samples.iter().sum::<f32>();
                }
            }
        }
        coarse.iter_mut().zip(&sums).for_each(|(coarse, sum)| *coarse *= weight * sum);
    }
}

#[multiversion(targets = "simd")]
fn add_light(channel: &mut [f32], light: &[f32], weight: f32) {
    channel.iter_mut().zip(light).for_each(|(channel, light)| *channel += weight * light);
}

/// Makes of what objects let through light: B·(s + (1 − s)·T).
#[multiversion(targets = "simd")]
fn illuminate(light: &mut [f32], empty: &[f32], stray: f32) {
    light.iter_mut().zip(empty).for_each(|(light, empty)| *light = empty * (stray + (1.0 - stray) * *light));
}

/// Absorbance of the mean light over a mask, on a grid of `n` points a pixel's side.
fn mean_absorbance(mask: &Mask, tile: TileRef<'_>, n: usize) -> f64 {
    let area = mask.area() * (n * n) as u64;
    if area == 0 {
        return 0.0;
    }
    let sum = if n == 1 {
        sum_over(mask.runs(), tile.values, tile.width, tile.origin)
    } else {
        let n = n as u32;
        let scaled: Vec<Run> = mask
            .runs()
            .iter()
            .flat_map(|run| (0..n).map(move |line| Run { y: run.y * n + line, x0: run.x0 * n, x1: run.x1 * n }))
            .collect();
        sum_over(&scaled, tile.values, tile.width, tile.origin)
    };
    -libm::log10((sum / area as f64).max(f64::MIN_POSITIVE))
}
