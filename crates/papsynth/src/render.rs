//! One scene on its way to an image: phantoms, masks, planes, truth.

use crate::detect::Detector;
use crate::frame::{Finished, Plane};
use crate::phantom::{self, Phantom, Studio};
use crate::recipe::Restore;
use crate::scene::{Body, Object, Scene};
use crate::threads::{self, Threads};
use crate::transmit::{self, FocusAt, LightPath};
use crate::truth::{COVERED, Group, LabelMap, Mask, ObjectTruth, Part, Truth, front_masks, layers};

/// A scene with its phantoms made.
pub(crate) struct Rendering {
    scene: Scene,
    phantoms: Vec<Phantom>,
    /// Complete masks of every piece of every phantom.
    masks: Vec<Vec<Mask>>,
    path: LightPath,
    detector: Detector,
    /// How detectable each piece is, plane by plane.
    detectability: Vec<Vec<f64>>,
}

impl Rendering {
    pub(crate) fn new(studio: &Studio, scene: Scene, threads: Threads) -> Result<Self, String> {
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
        let path = LightPath::new(&scene, &phantoms, threads)?;
        let detector = Detector::new(&scene)?;
        Ok(Self { scene, phantoms, masks, path, detector, detectability: Vec::new() })
    }

    pub(crate) fn planes(&self) -> usize {
        self.scene.planes_um.len()
    }

    /// Images one plane. Planes are asked for in order, each once.
    pub(crate) fn plane(&mut self, index: usize) -> Result<Plane, String> {
        let depth_um = self.scene.planes_um[index];
        let mut light = self.path.image(&self.scene, &self.phantoms, &self.masks, FocusAt::Depth(depth_um))?;
        let feathered = self.path.feathered.as_deref();
        let late = self.scene.optics.restore == Restore::AfterDetection;
        let width = self.scene.view.width;
        let mut rng = self.scene.key.stream("plane", index as u64, "camera");
        let mut electrons = core::mem::take(&mut light.spread);
        if let (Some(feathered), false) = (feathered, late) {
            transmit::restore(&mut electrons, &light.sharp, feathered);
        }
        self.detector.electrons(&mut electrons);
        let mut grey = vec![0; electrons.len()];
        // Eq. 13: I_f = g_po(10^(I_b − I_p) ∗ G_σxy) + g_g.
        let saturated = self.detector.camera.expose_into(&electrons, width, &mut grey, &mut rng);
        let mut noise_free = vec![0.0; electrons.len()];
        self.detector.camera.mean_dn_into(&electrons, &mut noise_free);
        if let (Some(feathered), true) = (feathered, late) {
            self.restore_finished(&mut grey, &mut noise_free, &mut light.sharp, feathered);
        }
        let detectability = self.detectabilities(&light.absorbances, &electrons);
        self.detectability.push(detectability);
        Ok(Plane { index, depth_um, grey, noise_free, saturated })
    }

    /// Eq. 15 on finished grey levels: restored nuclei carry no noise of this camera.
    fn restore_finished(&self, grey: &mut [u16], noise_free: &mut [f32], sharp: &mut [f32], feathered: &[f32]) {
        self.detector.electrons(sharp);
        let mut clean = vec![0.0; sharp.len()];
        self.detector.camera.mean_dn_into(sharp, &mut clean);
        transmit::restore(noise_free, &clean, feathered);
        for ((grey, clean), share) in grey.iter_mut().zip(&clean).zip(feathered) {
            let seen = f32::from(*grey);
            #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "between two grey levels")]
            let restored = (seen + share * (clean - seen) + 0.5) as u16;
            *grey = restored;
        }
    }

    /// Contrast over noise of every piece: (Ī·10^Ā − Ī) / noise, with Ī the mean grey level over its mask and Ā its mean
    /// absorbance there, both as they are in this plane.
    fn detectabilities(&self, absorbances: &[f64], electrons: &[f32]) -> Vec<f64> {
        let width = self.scene.view.width;
        let masks = self.masks.iter().flatten();
        masks
            .zip(absorbances)
            .map(|(mask, absorbance)| {
                let area = mask.area();
                if area == 0 {
                    return 0.0;
                }
                let mean = mask.pixels(width).map(|p| f64::from(electrons[p])).sum::<f64>() / area as f64;
                let without = mean * libm::exp10(*absorbance);
                let contrast = self.detector.expected_dn(without) - self.detector.expected_dn(mean);
                contrast / self.detector.noise_dn(mean).max(f64::MIN_POSITIVE)
            })
            .collect()
    }

    /// The all-in-focus image and the truth.
    pub(crate) fn finish(self) -> Result<Finished, String> {
        let all_in_focus = if self.planes() > 1 { self.all_in_focus()? } else { Vec::new() };
        let truth = self.truth();
        Ok(Finished { scene: self.scene, truth, all_in_focus })
    }

    fn all_in_focus(&self) -> Result<Vec<f32>, String> {
        let mut light = self.path.image(&self.scene, &self.phantoms, &self.masks, FocusAt::Everywhere)?;
        if let Some(feathered) = &self.path.feathered {
            transmit::restore(&mut light.spread, &light.sharp, feathered);
        }
        self.detector.electrons(&mut light.spread);
        let mut all_in_focus = vec![0.0; light.spread.len()];
        self.detector.camera.mean_dn_into(&light.spread, &mut all_in_focus);
        Ok(all_in_focus)
    }

    fn truth(&self) -> Truth {
        let (width, height) = (self.scene.view.width, self.scene.view.height);
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
        let labels = Group::ALL.map(|group| {
            let chosen: Vec<usize> = (0..objects.len()).filter(|&i| objects[i].group() == group).collect();
            let painted: Vec<(u32, f64, &Mask)> =
                chosen.iter().map(|&i| (objects[i].id, objects[i].depth_um, &objects[i].amodal)).collect();
            let (labels, fronts): (LabelMap, Vec<Mask>) = front_masks(&painted, width, height);
            for (i, front) in chosen.into_iter().zip(fronts) {
                objects[i].front = front;
            }
            labels
        });
        let cytoplasms = objects.iter().filter(|o| o.part == Part::Cytoplasm).map(|o| &o.amodal);
        let layers = layers(cytoplasms, width, height);
        Truth { objects, labels, layers }
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
