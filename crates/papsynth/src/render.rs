//! One scene on its way to an image: phantoms, masks, planes, truth.

use rand_core::Rng;

use crate::detect::{Detector, sum_over};
use crate::frame::{Finished, Plane};
use crate::phantom::{self, Phantom, Studio};
use crate::recipe::Restore;
use crate::restore::{Feathered, restore};
use crate::scene::{Body, Object, Scene};
use crate::threads::{self, Threads};
use crate::transmit::{Band, FocusAt, Light, LightPath};
use crate::truth::{COVERED, Group, Mask, ObjectTruth, Part, Run, Truth, fronts};

/// Memory that one image leaves to the next: fresh memory costs more time than much of what is written there.
#[derive(Debug, Default)]
pub(crate) struct Desk {
    light: Light,
    plane: Plane,
    /// All zero between images.
    ids: Vec<u32>,
}

/// A scene with its phantoms made.
pub(crate) struct Rendering {
    scene: Scene,
    phantoms: Vec<Phantom>,
    /// Complete masks of every piece of every phantom.
    masks: Vec<Vec<Mask>>,
    path: LightPath,
    desk: Desk,
    detector: Detector,
    /// How detectable each piece is, plane by plane.
    detectability: Vec<Vec<f64>>,
}

impl Rendering {
    pub(crate) fn new(studio: &Studio, scene: Scene, threads: Threads, mut desk: Desk) -> Result<Self, String> {
        let pools = studio.pools.make(scene.key);
        let objects: Vec<&Object> = scene.objects.iter().collect();
        let batches: Vec<&[&Object]> = objects.chunks(phantom::BATCH).collect();
        let made = threads::map(threads, &batches, |batch| phantom::make(studio, &scene, &pools, batch));
        let mut phantoms = Vec::with_capacity(objects.len());
        for batch in made {
            phantoms.extend(batch?);
        }
        let (width, height) = (scene.view.width, scene.view.height);
        let masks = threads::map(threads, &phantoms, |phantom| {
            let mask = |piece: &phantom::Piece| {
                let cover = &piece.coverage;
                Mask::from_tile(&cover.values, cover.width, cover.origin, width, height, |share| share >= COVERED)
            };
            phantom.pieces.iter().map(mask).collect()
        });
        let path = LightPath::new(&scene, &phantoms, threads, &mut desk.light)?;
        let detector = Detector::new(&scene)?;
        Ok(Self { scene, phantoms, masks, path, desk, detector, detectability: Vec::new() })
    }

    pub(crate) fn planes(&self) -> usize {
        self.scene.planes_um.len()
    }

    /// Images one plane. Planes are asked for in order, each once.
    pub(crate) fn plane(&mut self, index: usize) -> Result<&Plane, String> {
        let depth_um = self.scene.planes_um[index];
        let Desk { mut light, mut plane, ids } = core::mem::take(&mut self.desk);
        let focus = FocusAt::Depth(depth_um);
        let absorbances = self.path.absorb(&self.scene, &self.phantoms, &self.masks, focus, &mut light)?;
        plane.start(index, depth_um, self.scene.view.width * self.scene.view.height);
        let mut exposure = Exposure::new(self, &mut plane);
        self.path.spread(&mut light, |band| exposure.add(band));
        let electrons = exposure.electrons.sums();
        let detectability = self.detectabilities(&absorbances, &electrons);
        self.detectability.push(detectability);
        self.desk = Desk { light, plane, ids };
        Ok(&self.desk.plane)
    }

    /// Contrast over noise of every piece: (Ī·10^Ā − Ī) / noise, with Ī the mean grey level over its mask and Ā its mean
    /// absorbance there, both as they are in this plane. `electrons` are summed over the masks.
    fn detectabilities(&self, absorbances: &[f64], electrons: &[f64]) -> Vec<f64> {
        let pieces = self.masks.iter().flatten().zip(absorbances).zip(electrons);
        pieces
            .map(|((mask, absorbance), sum)| {
                let area = mask.area();
                if area == 0 {
                    return 0.0;
                }
                let mean = sum / area as f64;
                let without = mean * libm::exp10(*absorbance);
                let contrast = self.detector.expected_dn(without) - self.detector.expected_dn(mean);
                contrast / self.detector.noise_dn(mean).max(f64::MIN_POSITIVE)
            })
            .collect()
    }

    /// The all-in-focus image and the truth, and the memory for the next image.
    pub(crate) fn finish(mut self) -> Result<(Finished, Desk), String> {
        let all_in_focus = if self.planes() > 1 { self.all_in_focus()? } else { Vec::new() };
        let mut ids = core::mem::take(&mut self.desk.ids);
        let truth = self.truth(&mut ids);
        Ok((Finished { scene: self.scene, truth, all_in_focus }, Desk { ids, ..self.desk }))
    }

    fn all_in_focus(&mut self) -> Result<Vec<f32>, String> {
        let light = &mut self.desk.light;
        self.path.absorb(&self.scene, &self.phantoms, &self.masks, FocusAt::Everywhere, light)?;
        let (width, feathered) = (self.scene.view.width, self.path.feathered.as_ref());
        let mut all_in_focus = Vec::with_capacity(width * self.scene.view.height);
        self.path.spread(light, |Band { first, sharp, spread }| {
            restore_light(feathered, first * width, sharp, spread);
            self.detector.electrons(spread);
            all_in_focus.resize(first * width + spread.len(), 0.0);
            self.detector.camera.mean_dn_into(spread, &mut all_in_focus[first * width..]);
        });
        Ok(all_in_focus)
    }

    /// `ids` is memory for an image.
    fn truth(&self, ids: &mut Vec<u32>) -> Truth {
        let (width, height) = (self.scene.view.width, self.scene.view.height);
        ids.resize(width * height, 0);
        let mut objects = Vec::new();
        let mut number = 0;
        for ((object, phantom), masks) in self.scene.objects.iter().zip(&self.phantoms).zip(&self.masks) {
            for (piece, mask) in phantom.pieces.iter().zip(masks) {
                if !mask.is_empty() {
                    objects.push(self.row(object, phantom, piece, mask, number));
                }
                number += 1;
            }
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
        let pixel_um = self.scene.view.pixel_um;
        let kind = object.body.kind();
        let covered = piece.coverage.values.iter().filter(|share| **share >= COVERED).count() as u64;
        let (class, stain) = match &object.body {
            Body::Cell(body) if piece.part == Part::Nucleus => (body.class.clone(), body.nucleus.absorbance),
            Body::Cell(body) => (body.class.clone(), body.cytoplasm_absorbance),
            Body::Leukocyte { absorbance, .. }
            | Body::Bacillus { absorbance, .. }
            | Body::Speckle { absorbance, .. }
            | Body::OutOfFocus { absorbance, .. } => (kind.name().to_owned(), *absorbance),
        };
        ObjectTruth {
            id: object.id,
            part: piece.part,
            kind,
            class,
            bethesda: object.bethesda.clone(),
            traits: phantom.traits.join(";"),
            cluster: object.cluster,
            centre_um: object.centre_um,
            depth_um: object.depth_um,
            stain,
            rotation_deg: object.rotation_deg,
            area_um2: piece.area_px * pixel_um * pixel_um,
            truncated: mask.area() < covered,
            amodal: mask.clone(),
            front: Mask::default(),
            defocus_um: self.scene.planes_um.iter().map(|plane| plane - object.depth_um).collect(),
            detectability: self.detectability.iter().map(|plane| plane[number]).collect(),
        }
    }
}

impl Plane {
    /// Makes this the plane of that index, its pixels to be written.
    fn start(&mut self, index: usize, depth_um: f64, pixels: usize) {
        (self.index, self.depth_um, self.saturated) = (index, depth_um, 0);
        self.grey.resize(pixels, 0);
        self.noise_free.resize(pixels, 0.0);
    }
}

/// One plane on its way through the camera.
struct Exposure<'a> {
    rendering: &'a Rendering,
    key: u64,
    plane: &'a mut Plane,
    electrons: MaskSums<'a>,
}

impl<'a> Exposure<'a> {
    fn new(rendering: &'a Rendering, plane: &'a mut Plane) -> Self {
        let key = rendering.scene.key.stream("plane", plane.index as u64, "camera").next_u64();
        Self { rendering, key, plane, electrons: MaskSums::new(&rendering.masks) }
    }

    /// Eq. 13: I_f = g_po(10^(I_b − I_p) ∗ G_σxy) + g_g, and Eq. 15 before or after it.
    fn add(&mut self, Band { first, sharp, spread }: Band<'_>) {
        let Rendering { scene, path, detector, .. } = self.rendering;
        let width = scene.view.width;
        let (early, late) = match scene.optics.restore {
            Restore::AfterDetection => (None, path.feathered.as_ref()),
            Restore::Off | Restore::BeforeDetection => (path.feathered.as_ref(), None),
        };
        restore_light(early, first * width, sharp, spread);
        detector.electrons(spread);
        let pixels = first * width..first * width + spread.len();
        let (grey, noise_free) = (&mut self.plane.grey[pixels.clone()], &mut self.plane.noise_free[pixels]);
        let origin = [0, u32::try_from(first).unwrap_or(u32::MAX)];
        self.plane.saturated += detector.camera.expose_window(spread, width, origin, self.key, grey);
        detector.camera.mean_dn_into(spread, noise_free);
        self.electrons.add(spread, width, first);
        if let Some(feathered) = late {
            restore_finished(detector, feathered, first * width, sharp, grey, noise_free);
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

/// Eq. 15 on light, for rows that start at pixel `first`.
fn restore_light(feathered: Option<&Feathered>, first: usize, sharp: &[f32], spread: &mut [f32]) {
    let Some(feathered) = feathered else { return };
    for (span, shares) in feathered.within(first, spread.len()) {
        restore(&mut spread[span.clone()], &sharp[span], shares);
    }
}

/// Eq. 15 on finished grey levels: restored nuclei carry no noise of this camera.
fn restore_finished(
    detector: &Detector,
    feathered: &Feathered,
    first: usize,
    sharp: &[f32],
    grey: &mut [u16],
    noise_free: &mut [f32],
) {
    let (mut electrons, mut clean) = (Vec::new(), Vec::new());
    for (span, shares) in feathered.within(first, sharp.len()) {
        electrons.clear();
        electrons.extend_from_slice(&sharp[span.clone()]);
        detector.electrons(&mut electrons);
        clean.resize(electrons.len(), 0.0);
        detector.camera.mean_dn_into(&electrons, &mut clean);
        restore(&mut noise_free[span.clone()], &clean, shares);
        for ((grey, clean), share) in grey[span].iter_mut().zip(&clean).zip(shares) {
            let seen = f32::from(*grey);
            #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "between two grey levels")]
            let restored = (seen + share * (clean - seen) + 0.5) as u16;
            *grey = restored;
        }
    }
}
