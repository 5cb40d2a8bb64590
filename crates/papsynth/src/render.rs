//! One scene on its way to an image: phantoms, masks, planes, truth.

use optics_psf::{Border, Gaussian, Scratch};
use rand_core::Rng;

use crate::detect::{Detector, Developing, sum_over};
use crate::error::Cause;
use crate::frame::{Finished, Plane};
use crate::fuse;
use crate::phantom::tile::lay;
use crate::phantom::{self, Phantom, Piece, Studio};
use crate::profile::{Stage, Watch};
use crate::recipe::Restore;
use crate::scene::{Body, Object, Scene, View};
use crate::threads::{self, Threads};
use crate::transmit::{Band, FocusAt, Lenses, Light, LightPath, Slide};
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
    threads: Threads,
    path: LightPath,
    /// The feathered mask C′ of the nuclei whose texture was taken from images, if any are to be restored.
    feathered: Option<Vec<f32>>,
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
        desk: &mut Desk,
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
        watch.time(Stage::Masks, || {
            let (view, n) = (scene.view, scene.oversampling());
            let mask = |piece: &Piece| mask_of(piece, n, [0; 2], [view.width, view.height]);
            let masks = threads::map(threads, &phantoms, |phantom| phantom.pieces.iter().map(mask).collect::<Vec<_>>());
            let pieces = phantoms.iter_mut().flat_map(|phantom| &mut phantom.pieces);
            for (piece, mask) in pieces.zip(masks.into_iter().flatten()) {
                (piece.mask, piece.covered) = mask;
            }
        });
        let path = watch.time(Stage::Light, || {
            desk.light.prepare(&scene)?;
            LightPath::new(Slide { scene: &scene, phantoms: &phantoms, threads }, lenses)
        })?;
        let feathered = feathered(&scene, &phantoms)?;
        let detector = Detector::new(&scene)?;
        Ok(Self { scene, phantoms, threads, path, feathered, detector, detectability: Vec::new(), watch })
    }

    pub(crate) fn planes(&self) -> usize {
        self.scene.planes_um.len()
    }

    /// Images one plane. Planes are asked for in order, each once.
    ///
    /// Eq. 13: I_f = g_po(10^(I_b − I_p) ∗ G_σxy) + g_g, and Eq. 15 before or after it.
    pub(crate) fn plane<'d>(&mut self, index: usize, desk: &'d mut Desk) -> Result<&'d Plane, Cause> {
        let Desk { light, plane, developing, .. } = desk;
        let stage_um = self.scene.planes_um[index];
        let focus = FocusAt::Stage(stage_um);
        let passage = self.watch.time(Stage::Light, || self.path.pass(self.slide(), focus, light))?;
        let (scene, view, channels) = (&self.scene, self.scene.view, self.scene.channels());
        let samples = view.width * view.height * channels;
        (plane.index, plane.stage_um, plane.channels, plane.floored) = (index, stage_um, channels, passage.floored);
        plane.grey.resize(samples, 0);
        plane.noise_free.resize(samples, 0.0);
        // Of every mask the runs that are still to come, and the electrons so far, channel by channel.
        let mut runs: Vec<&[Run]> = self.pieces().map(|piece| piece.mask.runs()).collect();
        let mut electrons = vec![vec![0.0; runs.len()]; channels];
        let late = scene.restoration.restore == Restore::AfterDetection;
        self.watch.time(Stage::Camera, || {
            developing.start(view.width, self.camera_keys(stage_um));
            self.path.spread(view, light, |Band { first, sharp, spread }| {
                let at = first * view.width;
                if !late {
                    self.restore_light(at, sharp, spread);
                }
                self.count(spread);
                let here = at * channels..(at + spread[0].len()) * channels;
                let (grey, noise_free) = (&mut plane.grey[here.clone()], &mut plane.noise_free[here]);
                self.detector.expose(spread, first, grey, developing);
                self.detector.mean_dn_into(spread, noise_free, developing);
                let end = first + spread[0].len() / view.width;
                for (number, runs) in runs.iter_mut().enumerate() {
                    let (within, below) = runs.split_at(runs.partition_point(|run| (run.y as usize) < end));
                    *runs = below;
                    if !within.is_empty() {
                        for (sums, band) in electrons.iter_mut().zip(&*spread) {
                            sums[number] += sum_over(within, band, view.width, [0, first as i64]);
                        }
                    }
                }
                if let (true, Some(feathered)) = (late, &self.feathered) {
                    self.restore_finished(&feathered[at..], sharp, grey, noise_free, developing);
                }
            });
            self.detector.finish(&mut plane.grey, developing);
            if let Some(fusion) = &scene.fusion {
                let bits = [self.detector.bits, scene.camera.bits];
                fuse::correlate(&mut plane.grey, &mut plane.noise_free, view.width, channels, fusion, bits);
            }
            self.detector.compress(view.width, &mut plane.grey);
            plane.saturated = developing.saturated();
        });
        self.detectability.push(self.detectabilities(&passage.absorbances, &electrons));
        Ok(plane)
    }

    fn slide(&self) -> Slide<'_> {
        Slide { scene: &self.scene, phantoms: &self.phantoms, threads: self.threads }
    }

    fn pieces(&self) -> impl Iterator<Item = &Piece> {
        self.phantoms.iter().flat_map(|phantom| &phantom.pieces)
    }

    /// All pieces, numbered, with what they belong to.
    fn parts(&self) -> impl Iterator<Item = (usize, (&Object, &Phantom, &Piece))> {
        let objects = self.scene.objects.iter().zip(&self.phantoms);
        objects
            .flat_map(|(object, phantom)| phantom.pieces.iter().map(move |piece| (object, phantom, piece)))
            .enumerate()
    }

    /// The keys of a plane's noise, one for each channel. They go by where the stage stands, to a millionth of a micrometre, so that
    /// other planes before it make no difference.
    fn camera_keys(&self, stage_um: f64) -> Vec<u64> {
        let place = libm::round(stage_um * 1e6) as i64;
        let key = |purpose: &str| self.scene.own_key().stream("plane", place.cast_unsigned(), purpose).next_u64();
        match self.scene.channels() {
            1 => vec![key("camera")],
            _ => ["camera.red", "camera.green", "camera.blue"].map(key).to_vec(),
        }
    }

    /// Contrast over noise of every piece, in the channel that shows it best: (Ī·10^Ā − Ī) / noise, with Ī the mean grey
    /// level over its mask and Ā its mean absorbance there, both as they are in this plane. `electrons` are summed over
    /// the masks; both come channel by channel.
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

    /// The all-in-focus image and the truth.
    pub(crate) fn finish(self, desk: &mut Desk) -> Result<Finished, Cause> {
        let several = self.planes() > 1;
        let all_in_focus =
            if several { self.watch.time(Stage::Light, || self.all_in_focus(desk))? } else { Vec::new() };
        let truth = self.watch.time(Stage::Truth, || self.truth(desk));
        Ok(Finished { scene: self.scene, truth, all_in_focus })
    }

    /// The truth of a frame of a slide, and that of the objects whose middle is `within` it, whole: their masks are those on the
    /// slide of that many columns and rows.
    pub(crate) fn on_slide(
        &self,
        size_px: [u32; 2],
        within: impl Fn([f64; 2]) -> bool,
        desk: &mut Desk,
    ) -> (Truth, Vec<ObjectTruth>) {
        self.watch.time(Stage::Truth, || {
            let origin_px = self.scene.frame.map_or([0; 2], |frame| frame.origin_px);
            let n = self.scene.oversampling();
            let corner = origin_px.map(|at| at as f64 * self.scene.view.pixel_um);
            let mut rows = Vec::new();
            for (number, part @ (object, _, piece)) in self.parts() {
                if object.body.kind().is_layer() || !within(self.scene.place_um(object)) {
                    continue;
                }
                let (mask, covered) = mask_of(piece, n, origin_px, size_px.map(|side| side as usize));
                if !mask.is_empty() {
                    let mut row = self.row(number, part, &mask, covered);
                    row.centre_um = [0, 1].map(|axis| row.centre_um[axis] + corner[axis]);
                    rows.push(row);
                }
            }
            (self.truth(desk), rows)
        })
    }

    fn all_in_focus(&self, desk: &mut Desk) -> Result<Vec<f32>, Cause> {
        let Desk { light, developing, .. } = desk;
        self.path.pass(self.slide(), FocusAt::Everywhere, light)?;
        let (view, channels) = (self.scene.view, self.scene.channels());
        let mut all_in_focus = vec![0.0; view.width * view.height * channels];
        self.path.spread(view, light, |Band { first, sharp, spread }| {
            self.restore_light(first * view.width, sharp, spread);
            self.count(spread);
            let out = &mut all_in_focus[first * view.width * channels..][..spread[0].len() * channels];
            self.detector.mean_dn_into(spread, out, developing);
        });
        Ok(all_in_focus)
    }

    /// Eq. 15 on light, for rows that start at pixel `first`, where the light of restored nuclei comes apart:
    /// I′ = I_sharp · C′ + I_spread · (1 − C′).
    ///
    /// # Differences from the paper
    /// Eq. 15 as printed mixes the phantom image I_p, an absorbance, with the intensity I_f. What is restored here is the
    /// light 10^(I_b − I_p) before the spread in the image plane, in the same unit as what it replaces.
    fn restore_light(&self, first: usize, sharp: &[f32], spread: &mut [&mut [f32]]) {
        let (Some(feathered), [spread]) = (&self.feathered, spread) else { return };
        for ((spread, sharp), share) in spread.iter_mut().zip(sharp).zip(&feathered[first..]) {
            *spread += share * (sharp - *spread);
        }
    }

    /// Eq. 15 on finished grey levels of rows: restored nuclei carry no noise of this camera.
    fn restore_finished(
        &self,
        shares: &[f32],
        sharp: &[f32],
        grey: &mut [u16],
        noise_free: &mut [f32],
        developing: &mut Developing,
    ) {
        // As a camera without noise shows them. Without sharp light they were restored on their way here.
        let mut clean = noise_free.to_vec();
        if !sharp.is_empty() {
            let mut electrons = sharp.to_vec();
            self.detector.electrons(0, &mut electrons);
            self.detector.mean_dn_into(&[&mut electrons], &mut clean, developing);
        }
        let channels = self.scene.channels();
        let shares = shares.iter().flat_map(|share| core::iter::repeat_n(*share, channels));
        for (((grey, noise_free), clean), share) in grey.iter_mut().zip(noise_free).zip(&clean).zip(shares) {
            let blend = |seen: f32| seen + share * (clean - seen);
            *noise_free = blend(*noise_free);
            *grey = (blend(f32::from(*grey)) + 0.5) as u16;
        }
    }

    /// Light becomes electrons.
    fn count(&self, channels: &mut [&mut [f32]]) {
        for (channel, light) in channels.iter_mut().enumerate() {
            self.detector.electrons(channel, light);
        }
    }

    fn truth(&self, desk: &mut Desk) -> Truth {
        let View { width, height, .. } = self.scene.view;
        desk.ids.resize(width * height, 0);
        let seen = self.parts().filter(|(_, (.., piece))| !piece.mask.is_empty());
        let rows = seen.map(|(number, part)| self.row(number, part, &part.2.mask, part.2.covered));
        let mut objects = with_layers(rows.collect());
        if self.scene.frame.is_some() {
            // What nobody counts hides nothing on a slide.
            objects.retain(|object| !object.kind.is_layer());
        }
        for group in Group::ALL {
            let chosen: Vec<usize> = (0..objects.len()).filter(|&i| objects[i].group() == group).collect();
            let painted: Vec<(u32, f64, &Mask)> =
                chosen.iter().map(|&i| (objects[i].id, objects[i].depth_um, &objects[i].amodal)).collect();
            let fronts = fronts(&painted, width, &mut desk.ids);
            for (i, front) in chosen.into_iter().zip(fronts) {
                objects[i].front = front;
            }
        }
        Truth { width, height, objects }
    }

    /// What is known of a piece that covers so many pixels inside and outside the image.
    fn row(
        &self,
        number: usize,
        (object, phantom, piece): (&Object, &Phantom, &Piece),
        mask: &Mask,
        covered: u64,
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
            truncated: mask.area() < covered,
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

/// C′ = C ∗ G_σ, C being 1 on nuclei whose texture was taken from images and 0 elsewhere (Eq. 16). What was imaged once is not
/// blurred again. Nothing if there are no such nuclei, or none is to be restored.
fn feathered(scene: &Scene, phantoms: &[Phantom]) -> Result<Option<Vec<f32>>, Cause> {
    let (View { width, height, pixel_um }, n) = (scene.view, scene.oversampling());
    let imaged = || phantoms.iter().flat_map(|phantom| &phantom.pieces).filter(|piece| piece.imaged);
    if scene.restoration.restore == Restore::Off || imaged().next().is_none() {
        return Ok(None);
    }
    let mut mask = vec![0.0; width * height];
    for piece in imaged() {
        lay(&mut mask, width, [0, 0], &piece.cover_of_pixels(n), |row, shares| {
            row.iter_mut().zip(shares).filter(|(_, s)| **s >= COVERED).for_each(|(pixel, _)| *pixel = 1.0);
        });
    }
    let feather = Gaussian::new(scene.restoration.feather_um / pixel_um)?;
    let mut shares = vec![0.0; mask.len()];
    // Eq. 16: C ∗ G_σ.
    feather.blur_rows_into(&mask, width, Border::Reflect, 0, &mut shares, &mut Scratch::default());
    Ok(Some(shares))
}

/// The mask of a piece in an image of that size, which begins `origin_px` before the scene's; and its pixels inside and outside.
fn mask_of(piece: &Piece, n: usize, origin_px: [i64; 2], [width, height]: [usize; 2]) -> (Mask, u64) {
    let cover = piece.cover_of_pixels(n);
    let at = [0, 1].map(|axis| cover.origin[axis] + origin_px[axis]);
    let inside = |share: f32| share >= COVERED;
    let mask = Mask::from_tile(&cover.values, cover.width, at, width, height, inside);
    (mask, cover.values.iter().filter(|share| inside(**share)).count() as u64)
}
