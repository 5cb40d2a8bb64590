//! One scene on its way to an image: phantoms, masks, planes, truth.

use rand_core::Rng;

use crate::detect::{Detector, Developing, sum_over};
use crate::error::Cause;
use crate::frame::{Finished, Plane};
use crate::fuse;
use crate::phantom::{self, Phantom, Studio};
use crate::profile::{Stage, Watch};
use crate::recipe::Restore;
use crate::restore::{Feathered, restore};
use crate::scene::{Body, Object, Scene};
use crate::threads::{self, Threads};
use crate::transmit::{Band, FocusAt, Lenses, Light, LightPath, Passage, Slide};
use crate::truth::{COVERED, Group, Mask, ObjectTruth, Part, Run, Truth, fronts, with_layers};

/// Memory that one image leaves to the next: fresh memory costs more time than much of what is written there.
#[derive(Debug, Default)]
pub(crate) struct Desk {
    light: Light,
    plane: Plane,
    developing: Developing,
    /// All zero between images.
    ids: Vec<u32>,
}

/// A scene with its phantoms made.
pub(crate) struct Rendering {
    scene: Scene,
    phantoms: Vec<Phantom>,
    /// Complete masks of every piece of every phantom.
    masks: Vec<Vec<Mask>>,
    /// The number of pixels that each would have without the image's border.
    covered: Vec<Vec<u64>>,
    path: LightPath,
    /// The feathered mask C′ of the nuclei whose texture was taken from images, if any are to be restored.
    feathered: Option<Feathered>,
    desk: Desk,
    detector: Detector,
    /// How detectable each piece is, plane by plane.
    detectability: Vec<Vec<f64>>,
    watch: Watch,
}

impl Rendering {
    pub(crate) fn new(
        studio: &Studio,
        lenses: &Lenses,
        scene: Scene,
        threads: Threads,
        mut desk: Desk,
    ) -> Result<Self, Cause> {
        let watch = studio.watch.clone();
        let pools = studio.pools.make(scene.key);
        let objects: Vec<&Object> = scene.objects.iter().collect();
        let batches: Vec<&[&Object]> = objects.chunks(phantom::BATCH).collect();
        let made = threads::map(threads, &batches, |batch| phantom::make(studio, &scene, &pools, batch));
        let mut phantoms: Vec<Phantom> = Vec::with_capacity(objects.len());
        for batch in made {
            phantoms.extend(batch?);
        }
        if scene.frame.is_some() {
            let (view, n) = (scene.view, scene.oversampling());
            let moved = scene.objects.iter().zip(phantoms).map(|(object, phantom)| phantom.on_slide(object, view, n));
            phantoms = moved.collect();
        }
        let (masks, covered) = watch.time(Stage::Masks, || masks(&scene, &phantoms, threads));
        let slide = Slide { scene: &scene, phantoms: &phantoms, masks: &masks };
        let path = watch.time(Stage::Light, || LightPath::new(slide, lenses, threads, &mut desk.light))?;
        let feathered = Feathered::new(&scene, &phantoms)?;
        let detector = Detector::new(&scene)?;
        Ok(Self { scene, phantoms, masks, covered, path, feathered, desk, detector, detectability: Vec::new(), watch })
    }

    pub(crate) fn planes(&self) -> usize {
        self.scene.planes_um.len()
    }

    /// Images one plane. Planes are asked for in order, each once.
    pub(crate) fn plane(&mut self, index: usize) -> Result<&Plane, Cause> {
        let stage_um = self.scene.planes_um[index];
        let Desk { mut light, mut plane, mut developing, ids } = core::mem::take(&mut self.desk);
        let watch = self.watch.clone();
        let passage = watch.time(Stage::Light, || self.pass(FocusAt::Stage(stage_um), &mut light))?;
        plane.start(index, stage_um, self.scene.channels(), self.scene.view.width * self.scene.view.height);
        plane.floored = passage.floored;
        let electrons: Vec<Vec<f64>> = watch.time(Stage::Camera, || {
            let mut exposure = Exposure::new(self, &mut plane, &mut developing);
            self.path.spread(&mut light, |band| exposure.add(band));
            exposure.finish();
            exposure.electrons.iter().map(MaskSums::sums).collect()
        });
        let detectability = self.detectabilities(&passage.absorbances, &electrons);
        self.detectability.push(detectability);
        self.desk = Desk { light, plane, developing, ids };
        Ok(&self.desk.plane)
    }

    fn pass(&self, focus: FocusAt, light: &mut Light) -> Result<Passage, Cause> {
        let slide = Slide { scene: &self.scene, phantoms: &self.phantoms, masks: &self.masks };
        self.path.pass(slide, focus, light)
    }

    /// Contrast over noise of every piece, in the channel that shows it best: (Ī·10^Ā − Ī) / noise, with Ī the mean grey
    /// level over its mask and Ā its mean absorbance there, both as they are in this plane. `electrons` are summed over
    /// the masks; both come channel by channel.
    fn detectabilities(&self, absorbances: &[Vec<f64>], electrons: &[Vec<f64>]) -> Vec<f64> {
        let mut best = vec![f64::NEG_INFINITY; self.masks.iter().map(Vec::len).sum()];
        for (channel, (absorbances, electrons)) in absorbances.iter().zip(electrons).enumerate() {
            let pieces = self.masks.iter().flatten().zip(absorbances).zip(electrons);
            for (best, ((mask, absorbance), sum)) in best.iter_mut().zip(pieces) {
                *best = best.max(self.detectability(channel, mask, *absorbance, *sum));
            }
        }
        best
    }

    fn detectability(&self, channel: usize, mask: &Mask, absorbance: f64, electrons: f64) -> f64 {
        let area = mask.area();
        if area == 0 {
            return 0.0;
        }
        let mean = electrons / area as f64;
        let without = mean * libm::exp10(absorbance);
        let dn = |electrons| self.detector.expected_dn(channel, electrons);
        (dn(without) - dn(mean)) / self.detector.noise_dn(channel, mean).max(f64::MIN_POSITIVE)
    }

    /// The all-in-focus image and the truth, and the memory for the next image.
    pub(crate) fn finish(mut self) -> Result<(Finished, Desk), Cause> {
        let watch = self.watch.clone();
        let several = self.planes() > 1;
        let all_in_focus = if several { watch.time(Stage::Light, || self.all_in_focus())? } else { Vec::new() };
        let mut ids = core::mem::take(&mut self.desk.ids);
        let truth = watch.time(Stage::Truth, || self.truth(&mut ids));
        Ok((Finished { scene: self.scene, truth, all_in_focus }, Desk { ids, ..self.desk }))
    }

    /// The truth of a frame of a slide, and that of the objects whose middle is `within` it, whole: their masks are those on the
    /// slide of that many columns and rows.
    pub(crate) fn on_slide(
        &mut self,
        size_px: [u32; 2],
        within: impl Fn([f64; 2]) -> bool,
    ) -> (Truth, Vec<ObjectTruth>) {
        let watch = self.watch.clone();
        watch.time(Stage::Truth, || {
            let mut ids = core::mem::take(&mut self.desk.ids);
            let truth = self.truth(&mut ids);
            self.desk.ids = ids;
            let origin_px = self.scene.frame.map_or([0; 2], |frame| frame.origin_px);
            let n = self.scene.oversampling();
            let mut rows = Vec::new();
            let mut number = 0;
            for (object, phantom) in self.scene.objects.iter().zip(&self.phantoms) {
                let own = within(self.scene.place_um(object)) && !object.body.kind().is_layer();
                for piece in &phantom.pieces {
                    if own {
                        let (mask, covered) = mask_of(piece, n, origin_px, size_px.map(|side| side as usize));
                        if !mask.is_empty() {
                            let mut row = self.row(object, phantom, piece, &mask, number);
                            row.truncated = mask.area() < covered;
                            let corner = origin_px.map(|at| at as f64 * self.scene.view.pixel_um);
                            row.centre_um = [0, 1].map(|axis| row.centre_um[axis] + corner[axis]);
                            rows.push(row);
                        }
                    }
                    number += 1;
                }
            }
            (truth, rows)
        })
    }

    /// The memory for the next image.
    pub(crate) fn into_desk(self) -> Desk {
        self.desk
    }

    fn all_in_focus(&mut self) -> Result<Vec<f32>, Cause> {
        let (mut light, mut developing) =
            (core::mem::take(&mut self.desk.light), core::mem::take(&mut self.desk.developing));
        self.pass(FocusAt::Everywhere, &mut light)?;
        let (width, channels) = (self.scene.view.width, self.scene.channels());
        let mut all_in_focus = vec![0.0; width * self.scene.view.height * channels];
        self.path.spread(&mut light, |Band { first, sharp, spread }| {
            self.restore_light(first * width, sharp, spread);
            self.count(spread);
            let pixels = spread.first().map_or(0, |channel| channel.len());
            let out = &mut all_in_focus[first * width * channels..][..pixels * channels];
            self.detector.mean_dn_into(spread, out, &mut developing);
        });
        (self.desk.light, self.desk.developing) = (light, developing);
        Ok(all_in_focus)
    }

    /// Eq. 15 on light, for rows that start at pixel `first`, where the light of restored nuclei comes apart.
    fn restore_light(&self, first: usize, sharp: &[f32], spread: &mut [&mut [f32]]) {
        let (Some(feathered), [spread]) = (&self.feathered, spread) else { return };
        if sharp.is_empty() {
            return;
        }
        for (span, shares) in feathered.within(first, spread.len()) {
            restore(&mut spread[span.clone()], &sharp[span], shares);
        }
    }

    /// Light becomes electrons.
    fn count(&self, channels: &mut [&mut [f32]]) {
        for (channel, light) in channels.iter_mut().enumerate() {
            self.detector.electrons(channel, light);
        }
    }

    /// `ids` is memory for an image.
    fn truth(&self, ids: &mut Vec<u32>) -> Truth {
        let (width, height) = (self.scene.view.width, self.scene.view.height);
        ids.resize(width * height, 0);
        let mut objects = Vec::new();
        let mut number = 0;
        let phantoms = self.scene.objects.iter().zip(&self.phantoms);
        for ((object, phantom), (masks, covered)) in phantoms.zip(self.masks.iter().zip(&self.covered)) {
            for ((piece, mask), covered) in phantom.pieces.iter().zip(masks).zip(covered) {
                if !mask.is_empty() {
                    let truncated = mask.area() < *covered;
                    objects.push(ObjectTruth { truncated, ..self.row(object, phantom, piece, mask, number) });
                }
                number += 1;
            }
        }
        let mut objects = with_layers(objects);
        if self.scene.frame.is_some() {
            // What nobody counts hides nothing on a slide.
            objects.retain(|object| !object.kind.is_layer());
        }
        for group in Group::ALL {
            let chosen: Vec<usize> = (0..objects.len()).filter(|&i| objects[i].group() == group).collect();
            let painted: Vec<(u32, f64, &Mask)> =
                chosen.iter().map(|&i| (objects[i].id, objects[i].depth_um, &objects[i].amodal)).collect();
            let fronts = fronts(&painted, width, ids);
            for (i, front) in chosen.into_iter().zip(fronts) {
                objects[i].front = front;
            }
        }
        Truth { width, height, objects }
    }

    fn row(
        &self,
        object: &Object,
        phantom: &Phantom,
        piece: &phantom::Piece,
        mask: &Mask,
        number: usize,
    ) -> ObjectTruth {
        let grid_um = self.scene.grid().pixel_um;
        let kind = object.body.kind();
        let tint = match &object.body {
            Body::Cell(body) if piece.part != Part::Nucleus => Some(body.tint),
            _ => None,
        };
        let (class, stain) = match &object.body {
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
            centre_um: self.scene.place_um(object),
            depth_um: object.depth_um,
            stain,
            tint,
            rotation_deg: object.rotation_deg,
            area_um2: piece.area_px * grid_um * grid_um,
            truncated: false,
            amodal: mask.clone(),
            front: Mask::default(),
            defocus_um: self
                .scene
                .planes_um
                .iter()
                .map(|plane| self.scene.in_focus_um(self.scene.seen_at_um(*plane, object.depth_um)) - object.depth_um)
                .collect(),
            detectability: self.detectability.iter().map(|plane| plane[number]).collect(),
        }
    }
}

impl Plane {
    /// Makes this the plane of that index, its pixels to be written.
    fn start(&mut self, index: usize, stage_um: f64, channels: usize, pixels: usize) {
        (self.index, self.stage_um, self.channels) = (index, stage_um, channels);
        (self.saturated, self.floored) = (Mask::default(), 0);
        self.grey.resize(pixels * channels, 0);
        self.noise_free.resize(pixels * channels, 0.0);
    }
}

/// The complete masks of all pieces, and how many pixels each covers when those outside the image count too.
fn masks(scene: &Scene, phantoms: &[Phantom], threads: Threads) -> (Vec<Vec<Mask>>, Vec<Vec<u64>>) {
    let (view, n) = (scene.view, scene.oversampling());
    let mask = |piece: &phantom::Piece| mask_of(piece, n, [0; 2], [view.width, view.height]);
    let both = threads::map(threads, phantoms, |phantom| phantom.pieces.iter().map(mask).unzip());
    both.into_iter().unzip()
}

/// The mask of a piece in an image of that size, which begins `origin_px` before the scene's; and its pixels inside and outside.
fn mask_of(piece: &phantom::Piece, n: usize, origin_px: [i64; 2], [width, height]: [usize; 2]) -> (Mask, u64) {
    let cover = piece.cover_of_pixels(n);
    let at = [0, 1].map(|axis| cover.origin[axis] + origin_px[axis]);
    let inside = |share: f32| share >= COVERED;
    let mask = Mask::from_tile(&cover.values, cover.width, at, width, height, inside);
    (mask, cover.values.iter().filter(|share| inside(**share)).count() as u64)
}

/// One plane on its way through the camera.
struct Exposure<'a> {
    rendering: &'a Rendering,
    /// One for each channel.
    keys: Vec<u64>,
    plane: &'a mut Plane,
    developing: &'a mut Developing,
    electrons: Vec<MaskSums<'a>>,
}

impl<'a> Exposure<'a> {
    fn new(rendering: &'a Rendering, plane: &'a mut Plane, developing: &'a mut Developing) -> Self {
        // By where the stage stands, so that other planes before it make no difference: to a millionth of a micrometre.
        #[expect(clippy::cast_possible_truncation, reason = "a few metres at most")]
        let place = libm::round(plane.stage_um * 1e6) as i64;
        let key = |purpose: &str| rendering.scene.own_key().stream("plane", place.cast_unsigned(), purpose).next_u64();
        let keys = match rendering.scene.channels() {
            1 => vec![key("camera")],
            _ => ["camera.red", "camera.green", "camera.blue"].map(key).to_vec(),
        };
        let electrons = keys.iter().map(|_| MaskSums::new(&rendering.masks)).collect();
        developing.start();
        Self { rendering, keys, plane, developing, electrons }
    }

    /// Eq. 13: I_f = g_po(10^(I_b − I_p) ∗ G_σxy) + g_g, and Eq. 15 before or after it.
    fn add(&mut self, Band { first, sharp, spread }: Band<'_>) {
        let rendering = self.rendering;
        let (scene, detector) = (&rendering.scene, &rendering.detector);
        let (width, channels) = (scene.view.width, scene.channels());
        let pixels = spread.first().map_or(0, |channel| channel.len());
        let late = scene.restoration.restore == Restore::AfterDetection;
        if !late {
            rendering.restore_light(first * width, sharp, spread);
        }
        rendering.count(spread);
        let here = first * width * channels..(first * width + pixels) * channels;
        let (grey, noise_free) = (&mut self.plane.grey[here.clone()], &mut self.plane.noise_free[here]);
        detector.expose(spread, width, first, &self.keys, grey, self.developing);
        detector.mean_dn_into(spread, noise_free, self.developing);
        for (sums, electrons) in self.electrons.iter_mut().zip(spread.iter()) {
            sums.add(electrons, width, first);
        }
        if let (true, Some(feathered)) = (late, &rendering.feathered) {
            rendering.restore_finished(feathered, first * width, sharp, grey, noise_free, self.developing);
        }
    }

    /// What is done to a whole frame.
    fn finish(&mut self) {
        let Plane { grey, noise_free, saturated, .. } = &mut *self.plane;
        let width = self.rendering.scene.view.width;
        self.rendering.detector.finish(width, &self.keys, grey, self.developing);
        let scene = &self.rendering.scene;
        if let Some(fusion) = &scene.fusion {
            let bits = [self.rendering.detector.bits(), scene.camera.bits];
            fuse::correlate(grey, noise_free, width, scene.channels(), fusion, bits);
        }
        self.rendering.detector.compress(width, grey);
        *saturated = self.developing.saturated();
    }
}

impl Rendering {
    /// Eq. 15 on finished grey levels of rows that start at pixel `first`: restored nuclei carry no noise of this camera.
    fn restore_finished(
        &self,
        feathered: &Feathered,
        first: usize,
        sharp: &[f32],
        grey: &mut [u16],
        noise_free: &mut [f32],
        developing: &mut Developing,
    ) {
        let channels = self.scene.channels();
        let (mut electrons, mut clean) = (Vec::new(), Vec::new());
        for (span, shares) in feathered.within(first, grey.len() / channels) {
            let levels = span.start * channels..span.end * channels;
            // As a camera without noise shows them.
            clean.resize(levels.len(), 0.0);
            if sharp.is_empty() {
                // They were restored on their way here.
                clean.copy_from_slice(&noise_free[levels.clone()]);
            } else {
                electrons.clear();
                electrons.extend_from_slice(&sharp[span]);
                self.detector.electrons(0, &mut electrons);
                self.detector.mean_dn_into(&[&mut electrons], &mut clean, developing);
            }
            let shares = shares.iter().flat_map(|share| core::iter::repeat_n(*share, channels));
            let seen = grey[levels.clone()].iter_mut().zip(&mut noise_free[levels]);
            for (((grey, noise_free), clean), share) in seen.zip(&clean).zip(shares) {
                let blend = |seen: f32| seen + share * (clean - seen);
                *noise_free = blend(*noise_free);
                #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "between two grey levels")]
                let restored = (blend(f32::from(*grey)) + 0.5) as u16;
                *grey = restored;
            }
        }
    }
}

/// Sums over masks of an image that comes in bands of rows.
struct MaskSums<'a> {
    /// The runs that are still to come, and the sum so far.
    masks: Vec<(&'a [Run], f64)>,
}

impl<'a> MaskSums<'a> {
    fn new(masks: &'a [Vec<Mask>]) -> Self {
        Self { masks: masks.iter().flatten().map(|mask| (mask.runs(), 0.0)).collect() }
    }

    fn add(&mut self, band: &[f32], width: usize, first: usize) {
        let end = first + band.len() / width;
        for (runs, sum) in &mut self.masks {
            let (here, below) = runs.split_at(runs.partition_point(|run| (run.y as usize) < end));
            if !here.is_empty() {
                *sum += sum_over(here, band, width, [0, first as i64]);
            }
            *runs = below;
        }
    }

    fn sums(&self) -> Vec<f64> {
        self.masks.iter().map(|(_, sum)| *sum).collect()
    }
}
