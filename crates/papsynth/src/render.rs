//! Rendering of one scene: phantoms, masks, planes, ground truth.

use optics_psf::{Border, Gaussian, Scratch};
use rand_core::Rng;

use crate::detect::{Detector, ExposureBuffers, highest, sum_over};
use crate::error::ErrorKind;
use crate::frame::{Finished, Plane};
use crate::fuse;
use crate::live::Cancellation;
use crate::phantom::tile::overlay;
use crate::phantom::{self, NoiseFields, Phantom, PhantomAssets, Piece};
use crate::profile::{Stage, StageTimer};
use crate::recipe::Restore;
use crate::scene::{Body, Object, Scene, View};
use crate::threads::{self, Threads};
use crate::transmit::{FocusAt, LightBuffers, LightPath, MicroscopeCache, RowBand, Specimen, TransmissionStats};
use crate::truth::{COVERED, Group, Mask, ObjectTruth, Part, Run, Truth, merge_layers, visible_masks_in};

/// Buffers that are reused from image to image, because allocation is slow relative to rendering.
#[derive(Debug, Default)]
pub(crate) struct FrameBuffers {
    pub(crate) light: LightBuffers,
    plane: Plane,
    exposure: ExposureBuffers,
    /// All zeros between images.
    ids: Vec<u32>,
}

/// The threads that render an image, and the flag that cancels it.
#[derive(Debug, Clone)]
pub(crate) struct Work {
    pub(crate) threads: Threads,
    pub(crate) cancellation: Cancellation,
}

impl Work {
    /// Returns work that is not cancelled.
    pub(crate) fn on(threads: Threads) -> Self {
        Self { threads, cancellation: Cancellation::default() }
    }
}

/// The parts of a rendering that do not depend on camera, background and plane.
pub(crate) struct Parts {
    pub(crate) scene: Scene,
    /// The phantoms of the objects, with their masks.
    pub(crate) phantoms: Vec<Phantom>,
    pub(crate) path: LightPath,
    /// The feathered mask C′ of nuclei with imaged texture, if these are restored.
    pub(crate) feathered: Option<Vec<f32>>,
}

impl Parts {
    /// Prepares the optics of a scene whose objects have these phantoms.
    pub(crate) fn new(
        scene: Scene,
        phantoms: Vec<Phantom>,
        microscopes: &MicroscopeCache,
        work: &Work,
    ) -> Result<Self, ErrorKind> {
        let path = LightPath::new(Specimen { scene: &scene, phantoms: &phantoms, work }, microscopes)?;
        let feathered = feathered(&scene, &phantoms)?;
        Ok(Self { scene, phantoms, path, feathered })
    }
}

/// Computes the masks of phantoms in the image.
pub(crate) fn add_masks(phantoms: &mut [Phantom], scene: &Scene, threads: Threads) {
    let (view, n) = (scene.view, scene.oversampling());
    let mask = |piece: &Piece| mask_of(piece, n, [0; 2], [view.width, view.height]);
    let masks = threads::map(threads, phantoms, |phantom| phantom.pieces.iter().map(mask).collect::<Vec<_>>());
    let pieces = phantoms.iter_mut().flat_map(|phantom| &mut phantom.pieces);
    for (piece, mask) in pieces.zip(masks.into_iter().flatten()) {
        (piece.mask, piece.covered) = mask;
    }
}

/// A scene with its phantoms.
pub(crate) struct Rendering {
    parts: Parts,
    work: Work,
    detector: Detector,
    /// Detectability of each piece, one entry per plane.
    detectability: Vec<Vec<f64>>,
    timer: StageTimer,
}

/// Draws the phantoms of objects of a scene, in their order.
pub(crate) fn phantoms(
    assets: &PhantomAssets,
    noise_fields: &NoiseFields,
    scene: &Scene,
    objects: &[&Object],
    work: &Work,
) -> Result<Vec<Phantom>, ErrorKind> {
    // Cells come first, so that their batches are full.
    let mut order: Vec<usize> = (0..objects.len()).collect();
    order.sort_by_key(|&number| !matches!(objects[number].body, Body::Cell(_)));
    let ordered: Vec<&Object> = order.iter().map(|&number| objects[number]).collect();
    let batches: Vec<&[&Object]> = ordered.chunks(phantom::BATCH).collect();
    let mut drawn: Vec<Phantom> = Vec::with_capacity(objects.len());
    let of_phantoms = scene.of_phantoms();
    let make = |batch: &&[&Object]| {
        work.cancellation.check()?;
        phantom::make(assets, &of_phantoms, noise_fields, batch)
    };
    for batch in threads::map(work.threads, &batches, make) {
        drawn.extend(batch?);
    }
    if scene.frame.is_some() {
        let (view, n) = (scene.view, scene.oversampling());
        drawn = drawn.into_iter().zip(ordered).map(|(phantom, object)| phantom.on_slide(object, view, n)).collect();
    }
    let mut numbered: Vec<(usize, Phantom)> = order.into_iter().zip(drawn).collect();
    numbered.sort_unstable_by_key(|(number, _)| *number);
    Ok(numbered.into_iter().map(|(_, phantom)| phantom).collect())
}

impl Rendering {
    /// Prepares a scene whose objects have these phantoms.
    pub(crate) fn new(
        assets: &PhantomAssets,
        microscopes: &MicroscopeCache,
        scene: Scene,
        mut phantoms: Vec<Phantom>,
        work: Work,
        buffers: &mut FrameBuffers,
    ) -> Result<Self, ErrorKind> {
        let timer = &assets.timer;
        timer.time(Stage::Masks, || add_masks(&mut phantoms, &scene, work.threads));
        let parts = timer.time(Stage::Light, || {
            buffers.light.prepare(&scene)?;
            Parts::new(scene, phantoms, microscopes, &work)
        })?;
        Self::of(parts, work, timer.clone())
    }

    /// Prepares the camera of a scene.
    pub(crate) fn of(parts: Parts, work: Work, timer: StageTimer) -> Result<Self, ErrorKind> {
        let detector = Detector::new(&parts.scene)?;
        Ok(Self { parts, work, detector, detectability: Vec::new(), timer })
    }

    /// Returns the parts that another camera and background can use.
    pub(crate) fn into_parts(self) -> Parts {
        self.parts
    }

    pub(crate) fn planes(&self) -> usize {
        self.parts.scene.planes_um.len()
    }

    /// Images one plane. Call once for each plane, in order.
    ///
    /// Eq. 13: I_f = g_po(10^(I_b − I_p) ∗ G_σxy) + g_g, and Eq. 15 before or after it.
    pub(crate) fn plane<'d>(&mut self, index: usize, buffers: &'d mut FrameBuffers) -> Result<&'d Plane, ErrorKind> {
        let stats = self.transmit(index, buffers)?;
        Ok(self.detect(index, &stats, buffers))
    }

    /// Computes the light that the phantoms transmit in a plane, into `buffers`.
    pub(crate) fn transmit(&self, index: usize, buffers: &mut FrameBuffers) -> Result<TransmissionStats, ErrorKind> {
        let focus = FocusAt::Stage(self.parts.scene.planes_um[index]);
        self.timer.time(Stage::Light, || self.parts.path.transmit(self.specimen(), focus, &mut buffers.light))
    }

    /// Converts the transmitted light in `buffers` to grey levels.
    pub(crate) fn detect<'d>(
        &mut self,
        index: usize,
        stats: &TransmissionStats,
        buffers: &'d mut FrameBuffers,
    ) -> &'d Plane {
        let FrameBuffers { light, plane, exposure, .. } = buffers;
        let stage_um = self.parts.scene.planes_um[index];
        let (scene, view, channels) = (&self.parts.scene, self.parts.scene.view, self.parts.scene.channels());
        let samples = view.width * view.height * channels;
        (plane.index, plane.stage_um, plane.channels, plane.clipped_px) = (index, stage_um, channels, stats.clipped_px);
        plane.grey.resize(samples, 0);
        plane.noise_free.resize(samples, 0.0);
        // The remaining runs of every mask, and the sum of electrons so far for each channel.
        let mut runs: Vec<&[Run]> = self.pieces().map(|piece| piece.mask.runs()).collect();
        let mut electrons = vec![vec![0.0; runs.len()]; channels];
        let after_detection = scene.restoration.restore == Restore::AfterDetection;
        self.timer.time(Stage::Camera, || {
            exposure.start(view.width, self.camera_keys(stage_um));
            self.parts.path.for_each_band(view, light, |RowBand { first_row, unblurred, blurred }| {
                let at = first_row * view.width;
                if !after_detection {
                    self.restore_light(at, unblurred, blurred);
                }
                self.to_electrons(blurred);
                let here = at * channels..(at + blurred[0].len()) * channels;
                let (grey, noise_free) = (&mut plane.grey[here.clone()], &mut plane.noise_free[here]);
                self.detector.expose(blurred, first_row, grey, exposure);
                self.detector.mean_dn_into(blurred, noise_free, exposure);
                let end = first_row + blurred[0].len() / view.width;
                for (number, runs) in runs.iter_mut().enumerate() {
                    let (within, below) = runs.split_at(runs.partition_point(|run| (run.y as usize) < end));
                    *runs = below;
                    if !within.is_empty() {
                        for (sums, band) in electrons.iter_mut().zip(&*blurred) {
                            sums[number] += sum_over(within, band, view.width, [0, first_row as i64]);
                        }
                    }
                }
                if let (true, Some(feathered)) = (after_detection, &self.parts.feathered) {
                    self.restore_grey_levels(&feathered[at..], unblurred, grey, noise_free, exposure);
                }
            });
            self.detector.finish(&mut plane.grey, exposure);
            if let Some(fusion) = &scene.fusion {
                let tops = [self.detector.full_scale, highest(scene.camera.bits) as f32];
                fuse::correlate(&mut plane.grey, &mut plane.noise_free, view.width, channels, fusion, tops);
            }
            plane.saturated = match scene.fusion {
                Some(_) => {
                    fuse::saturated(&plane.grey, view.width * channels, channels, highest(scene.camera.bits) as u16)
                }
                None => exposure.saturated(),
            };
            self.detector.compress(view.width, &mut plane.grey);
        });
        self.detectability.push(self.detectabilities(&stats.absorbances, &electrons));
        plane
    }

    fn specimen(&self) -> Specimen<'_> {
        Specimen { scene: &self.parts.scene, phantoms: &self.parts.phantoms, work: &self.work }
    }

    fn pieces(&self) -> impl Iterator<Item = &Piece> {
        self.parts.phantoms.iter().flat_map(|phantom| &phantom.pieces)
    }

    /// Returns all pieces, numbered, with their object and phantom.
    fn parts(&self) -> impl Iterator<Item = (usize, (&Object, &Phantom, &Piece))> {
        let objects = self.parts.scene.objects.iter().zip(&self.parts.phantoms);
        objects
            .flat_map(|(object, phantom)| phantom.pieces.iter().map(move |piece| (object, phantom, piece)))
            .enumerate()
    }

    /// Returns the noise keys of a plane, one for each channel.
    ///
    /// They depend on the stage position (to 10⁻⁶ µm) and not on the plane index, so other planes do not change the
    /// noise.
    fn camera_keys(&self, stage_um: f64) -> Vec<u64> {
        let position = libm::round(stage_um * 1e6) as i64;
        let key =
            |purpose: &str| self.parts.scene.own_key().stream("plane", position.cast_unsigned(), purpose).next_u64();
        match self.parts.scene.channels() {
            1 => vec![key("camera")],
            _ => ["camera.red", "camera.green", "camera.blue"].map(key).to_vec(),
        }
    }

    /// Returns contrast over noise of every piece, in the channel with the largest value: (Ī·10^Ā − Ī) / noise.
    ///
    /// Ī is the mean grey level over the mask and Ā the mean absorbance there, in this plane. `electrons` are sums over
    /// the masks. Both arguments have one entry per channel.
    fn detectabilities(&self, absorbances: &[Vec<f64>], electrons: &[Vec<f64>]) -> Vec<f64> {
        let mut best = vec![f64::NEG_INFINITY; self.pieces().count()];
        for (channel, (absorbances, electrons)) in absorbances.iter().zip(electrons).enumerate() {
            for (((best, piece), absorbance), sum) in best.iter_mut().zip(self.pieces()).zip(absorbances).zip(electrons)
            {
                let area = piece.mask.area();
                let mean = sum / area as f64;
                let contrast = || self.detector.contrast(channel, mean, mean * libm::exp10(*absorbance));
                *best = best.max(if area == 0 { 0.0 } else { contrast() });
            }
        }
        best
    }

    /// Returns the all-in-focus image and the ground truth. Call after all planes.
    pub(crate) fn finish(self, buffers: &mut FrameBuffers) -> Result<Finished, ErrorKind> {
        let (all_in_focus, truth) = self.results(buffers)?;
        Ok(Finished { scene: self.parts.scene, truth, all_in_focus })
    }

    /// As [`finish`](Self::finish), without the scene.
    pub(crate) fn results(&self, buffers: &mut FrameBuffers) -> Result<(Vec<f32>, Truth), ErrorKind> {
        let several = self.planes() > 1;
        let all_in_focus =
            if several { self.timer.time(Stage::Light, || self.all_in_focus(buffers))? } else { Vec::new() };
        let truth = self.timer.time(Stage::Truth, || self.truth(buffers));
        Ok((all_in_focus, truth))
    }

    /// Returns the threads and the flag that cancels the image.
    pub(crate) fn work(&self) -> &Work {
        &self.work
    }

    pub(crate) fn work_mut(&mut self) -> &mut Work {
        &mut self.work
    }

    /// Returns the scene.
    pub(crate) fn scene(&self) -> &Scene {
        &self.parts.scene
    }

    /// Returns the ground truth of a frame of a slide, and rows for the objects whose centre is `within` it.
    ///
    /// The masks of these rows are complete and in pixels of the slide, which has `size_px` columns and rows.
    pub(crate) fn slide_truth(
        &self,
        size_px: [u32; 2],
        within: impl Fn([f64; 2]) -> bool,
        buffers: &mut FrameBuffers,
    ) -> (Truth, Vec<ObjectTruth>) {
        self.timer.time(Stage::Truth, || {
            let origin_px = self.parts.scene.frame.map_or([0; 2], |frame| frame.origin_px);
            let n = self.parts.scene.oversampling();
            let corner = origin_px.map(|at| at as f64 * self.parts.scene.view.pixel_um);
            let mut rows = Vec::new();
            for (number, part @ (object, _, piece)) in self.parts() {
                if object.body.kind().is_layer() || !within(self.parts.scene.place_um(object)) {
                    continue;
                }
                let (mask, covered) = mask_of(piece, n, origin_px, size_px.map(|side| side as usize));
                if !mask.is_empty() {
                    let mut row = self.row(number, part, &mask, covered);
                    row.centre_um = [0, 1].map(|axis| row.centre_um[axis] + corner[axis]);
                    rows.push(row);
                }
            }
            (self.truth(buffers), rows)
        })
    }

    fn all_in_focus(&self, buffers: &mut FrameBuffers) -> Result<Vec<f32>, ErrorKind> {
        let FrameBuffers { light, exposure, .. } = buffers;
        self.parts.path.transmit(self.specimen(), FocusAt::Everywhere, light)?;
        let (view, channels) = (self.parts.scene.view, self.parts.scene.channels());
        let mut all_in_focus = vec![0.0; view.width * view.height * channels];
        self.parts.path.for_each_band(view, light, |RowBand { first_row, unblurred, blurred }| {
            self.restore_light(first_row * view.width, unblurred, blurred);
            self.to_electrons(blurred);
            let out = &mut all_in_focus[first_row * view.width * channels..][..blurred[0].len() * channels];
            self.detector.mean_dn_into(blurred, out, exposure);
        });
        Ok(all_in_focus)
    }

    /// Applies Eq. 15 to the light of rows that start at pixel `first`, if unblurred light is given:
    /// I′ = I_unblurred · C′ + I_blurred · (1 − C′).
    ///
    /// # Differences from the paper
    /// Eq. 15 as printed mixes the phantom image I_p, an absorbance, with the intensity I_f. Here the restored
    /// quantity is the light 10^(I_b − I_p) before the blur in the image plane, in the same unit.
    fn restore_light(&self, first: usize, unblurred: &[f32], blurred: &mut [&mut [f32]]) {
        let (Some(feathered), [blurred]) = (&self.parts.feathered, blurred) else { return };
        for ((blurred, unblurred), weight) in blurred.iter_mut().zip(unblurred).zip(&feathered[first..]) {
            *blurred += weight * (unblurred - *blurred);
        }
    }

    /// Applies Eq. 15 to the grey levels of rows: restored nuclei have no noise of this camera.
    fn restore_grey_levels(
        &self,
        weights: &[f32],
        unblurred: &[f32],
        grey: &mut [u16],
        noise_free: &mut [f32],
        exposure: &mut ExposureBuffers,
    ) {
        // Grey levels without noise. Without unblurred light, the light itself is already restored.
        let mut clean = noise_free.to_vec();
        if !unblurred.is_empty() {
            let mut electrons = unblurred.to_vec();
            self.detector.electrons(0, &mut electrons);
            self.detector.mean_dn_into(&[&mut electrons], &mut clean, exposure);
        }
        let channels = self.parts.scene.channels();
        let weights = weights.iter().flat_map(|weight| core::iter::repeat_n(*weight, channels));
        for (((grey, noise_free), clean), weight) in grey.iter_mut().zip(noise_free).zip(&clean).zip(weights) {
            let blend = |level: f32| level + weight * (clean - level);
            *noise_free = blend(*noise_free);
            *grey = (blend(f32::from(*grey)) + 0.5) as u16;
        }
    }

    /// Converts light to electrons, in place.
    fn to_electrons(&self, channels: &mut [&mut [f32]]) {
        for (channel, light) in channels.iter_mut().enumerate() {
            self.detector.electrons(channel, light);
        }
    }

    fn truth(&self, buffers: &mut FrameBuffers) -> Truth {
        let View { width, height, .. } = self.parts.scene.view;
        buffers.ids.resize(width * height, 0);
        let in_image = self.parts().filter(|(_, (.., piece))| !piece.mask.is_empty());
        let rows = in_image.map(|(number, part)| self.row(number, part, &part.2.mask, part.2.covered));
        let mut objects = merge_layers(rows.collect());
        if self.parts.scene.frame.is_some() {
            // On a slide, layers do not occlude objects.
            objects.retain(|object| !object.kind.is_layer());
        }
        for group in Group::ALL {
            let chosen: Vec<usize> = (0..objects.len()).filter(|&i| objects[i].group() == group).collect();
            let painted: Vec<(u32, f64, &Mask)> =
                chosen.iter().map(|&i| (objects[i].id, objects[i].depth_um, &objects[i].amodal)).collect();
            let visible = visible_masks_in(&painted, width, &mut buffers.ids);
            for (i, mask) in chosen.into_iter().zip(visible) {
                objects[i].visible = mask;
            }
        }
        Truth { width, height, objects }
    }

    /// Returns the row of a piece; `covered` is its number of pixels inside and outside the image.
    fn row(
        &self,
        number: usize,
        (object, phantom, piece): (&Object, &Phantom, &Piece),
        mask: &Mask,
        covered: u64,
    ) -> ObjectTruth {
        let grid_um = self.parts.scene.grid().pixel_um;
        let kind = object.body.kind();
        let tint = match &object.body {
            Body::Cell(body) if piece.part != Part::Nucleus => Some(body.tint),
            _ => None,
        };
        let (class, mean_absorbance) = match &object.body {
            Body::Cell(body) if piece.part == Part::Nucleus => (body.class.as_str(), body.nucleus.absorbance),
            Body::Cell(body) => (body.class.as_str(), body.cytoplasm_absorbance),
            other => (kind.name(), other.absorbance()),
        };
        ObjectTruth {
            id: object.id,
            part: piece.part,
            kind,
            class: class.to_owned(),
            bethesda: object.bethesda.clone(),
            traits: phantom.traits.iter().copied().collect(),
            cluster: object.cluster,
            centre_um: self.parts.scene.place_um(object),
            depth_um: object.depth_um,
            mean_absorbance,
            tint,
            rotation_deg: object.rotation_deg,
            area_um2: piece.area_px * grid_um * grid_um,
            truncated: mask.area() < covered,
            amodal: mask.clone(),
            visible: Mask::default(),
            defocus_um: self
                .parts
                .scene
                .planes_um
                .iter()
                .map(|plane| {
                    self.parts.scene.in_focus_um(self.parts.scene.seen_at_um(*plane, object.depth_um)) - object.depth_um
                })
                .collect(),
            detectability: self.detectability.iter().map(|plane| plane[number]).collect(),
        }
    }
}

/// Returns C′ = C ∗ G_σ, where C is 1 on nuclei with imaged texture and 0 elsewhere (Eq. 16), so that these are not
/// blurred twice. Returns `None` if there are no such nuclei or restoration is off.
fn feathered(scene: &Scene, phantoms: &[Phantom]) -> Result<Option<Vec<f32>>, ErrorKind> {
    let (View { width, height, pixel_um }, n) = (scene.view, scene.oversampling());
    let imaged = || phantoms.iter().flat_map(|phantom| &phantom.pieces).filter(|piece| piece.imaged);
    if scene.restoration.restore == Restore::Off || imaged().next().is_none() {
        return Ok(None);
    }
    let mut mask = vec![0.0; width * height];
    for piece in imaged() {
        overlay(&mut mask, width, [0, 0], &piece.pixel_coverage(n), |row, coverage| {
            row.iter_mut().zip(coverage).filter(|(_, s)| **s >= COVERED).for_each(|(pixel, _)| *pixel = 1.0);
        });
    }
    let feather = Gaussian::new(scene.restoration.feather_um / pixel_um)?;
    let mut weights = vec![0.0; mask.len()];
    // Eq. 16: C ∗ G_σ.
    feather.blur_rows_into(&mask, width, Border::Reflect, 0, &mut weights, &mut Scratch::default());
    Ok(Some(weights))
}

/// Returns the mask of a piece in an image of this size, and its number of pixels inside and outside the image.
///
/// The first pixel of the scene is pixel `origin_px` of the image.
fn mask_of(piece: &Piece, n: usize, origin_px: [i64; 2], [width, height]: [usize; 2]) -> (Mask, u64) {
    let cover = piece.pixel_coverage(n);
    let at = [0, 1].map(|axis| cover.origin[axis] + origin_px[axis]);
    let inside = |coverage: f32| coverage >= COVERED;
    let mask = Mask::from_tile(&cover.values, cover.width, at, width, height, inside);
    (mask, cover.values.iter().filter(|coverage| inside(**coverage)).count() as u64)
}
