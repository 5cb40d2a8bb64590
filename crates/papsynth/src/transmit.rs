//! Signal transmission: from phantoms to the light on the sensor (Eqs. 8–14).

use optics_psf::{Border, Gaussian, Scratch};
use perlin_bg::{Background, BackgroundParams, FractalParams, Illumination, Scatter};
use rand_core::Rng;

use crate::exp10::exp10;
use crate::phantom::Phantom;
use crate::phantom::tile::{Tile, add_tile};
use crate::recipe::Restore;
use crate::scene::{Scene, SceneIllumination};
use crate::threads::{self, Threads};
use crate::truth::{COVERED, Mask};

/// Spread below which a Gaussian changes nothing that 16 bits could show, px.
const SHARP_PX: f64 = 0.03;

/// Objects whose blurred tiles are in memory at one time.
const CHUNK: usize = 64;

/// What all planes of one scene share.
pub(crate) struct LightPath {
    /// I_b of Eq. 10: the logarithm of the empty slide's light, as a fraction of full scale.
    empty_log10: Vec<f32>,
    in_plane: Gaussian,
    /// The feathered mask C′ of the nuclei whose texture was taken from images, if any are to be restored.
    pub(crate) feathered: Option<Vec<f32>>,
    threads: Threads,
}

/// The light of one plane, as fractions of full scale.
pub(crate) struct Light {
    /// 10^(I_b − I_p): before the spread in the image plane.
    pub(crate) sharp: Vec<f32>,
    /// The same after it.
    pub(crate) spread: Vec<f32>,
    /// Mean absorbance of every piece over its mask, as blurred in this plane; in the order of the masks.
    pub(crate) absorbances: Vec<f64>,
}

/// Which plane is in focus.
#[derive(Debug, Clone, Copy)]
pub(crate) enum FocusAt {
    /// One depth for all.
    Depth(f64),
    /// Every object its own: the all-in-focus image.
    Everywhere,
}

impl LightPath {
    pub(crate) fn new(scene: &Scene, phantoms: &[Phantom], threads: Threads) -> Result<Self, String> {
        let (width, height) = (scene.view.width, scene.view.height);
        let mut empty_log10 = vec![0.0; width * height];
        background(scene)?.log10_into(&mut empty_log10, width, [0, 0]);
        let in_plane = Gaussian::new(scene.optics.sigma_xy_um / scene.view.pixel_um).map_err(|e| e.to_string())?;
        let feathered = match scene.optics.restore {
            Restore::Off => None,
            Restore::BeforeDetection | Restore::AfterDetection => feathered(scene, phantoms)?,
        };
        Ok(Self { empty_log10, in_plane, feathered, threads })
    }

    /// Images the phantoms of a scene. `masks` are those of their pieces, in their order.
    pub(crate) fn image(
        &self,
        scene: &Scene,
        phantoms: &[Phantom],
        masks: &[Vec<Mask>],
        focus: FocusAt,
    ) -> Result<Light, String> {
        let (width, height) = (scene.view.width, scene.view.height);
        let mut exponent = self.empty_log10.clone();
        let mut absorbances = Vec::new();
        let indices: Vec<usize> = (0..phantoms.len()).collect();
        for chunk in indices.chunks(CHUNK) {
            let work =
                |&index: &usize| blur(scene, scene.objects[index].depth_um, &phantoms[index], &masks[index], focus);
            let blurred = threads::map(self.threads, chunk, work);
            // Eq. 14: I_p = Σ pᵢ ∗ G_σz, added in the order of the objects whatever thread made them.
            for pieces in blurred {
                for (tile, mean) in pieces? {
                    add_tile(&mut exponent, width, height, [0, 0], &tile);
                    absorbances.push(mean);
                }
            }
        }
        exp10(&mut exponent);
        let mut spread = vec![0.0; exponent.len()];
        self.in_plane.blur_into(&exponent, width, Border::Reflect, &mut spread, &mut Scratch::new());
        Ok(Light { sharp: exponent, spread, absorbances })
    }
}

/// The negative absorbance of an object's pieces in a plane, and its mean over their masks.
fn blur(
    scene: &Scene,
    depth_um: f64,
    phantom: &Phantom,
    masks: &[Mask],
    focus: FocusAt,
) -> Result<Vec<(Tile, f64)>, String> {
    let sigma_px = match focus {
        FocusAt::Everywhere => 0.0,
        // σ grows with the distance from focus: the object's own depth, exactly, in every plane.
        FocusAt::Depth(plane) => scene.optics.sigma_z_um_per_um * (plane - depth_um).abs() / scene.view.pixel_um,
    };
    let gaussian = (sigma_px > SHARP_PX).then(|| Gaussian::new(sigma_px)).transpose().map_err(|e| e.to_string())?;
    let pieces = phantom.pieces.iter().zip(masks).map(|(piece, mask)| {
        let mut tile = match &gaussian {
            None => piece.absorbance.clone(),
            Some(gaussian) => {
                let (values, margin) = gaussian.spread(&piece.absorbance.values, piece.absorbance.width);
                let [x, y] = piece.absorbance.origin;
                let width = piece.absorbance.width + 2 * margin;
                Tile { origin: [x - margin as i64, y - margin as i64], width, values }
            }
        };
        let mean = mean_over(&tile, mask);
        tile.values.iter_mut().for_each(|v| *v = -*v);
        (tile, mean)
    });
    Ok(pieces.collect())
}

/// C′ = C ∗ G_σ, C being 1 on nuclei whose texture was taken from images and 0 elsewhere (Eq. 16), if there are any.
fn feathered(scene: &Scene, phantoms: &[Phantom]) -> Result<Option<Vec<f32>>, String> {
    let view = scene.view;
    let imaged = || phantoms.iter().flat_map(|p| &p.pieces).filter(|piece| piece.imaged);
    if imaged().next().is_none() {
        return Ok(None);
    }
    let mut mask = vec![0.0_f32; view.width * view.height];
    for piece in imaged() {
        let mut tile = piece.coverage.clone();
        tile.values.iter_mut().for_each(|v| *v = if *v >= COVERED { 1.0 } else { 0.0 });
        add_tile(&mut mask, view.width, view.height, [0, 0], &tile);
    }
    mask.iter_mut().for_each(|v| *v = v.min(1.0));
    let feather = Gaussian::new(scene.optics.restore_feather_um / view.pixel_um).map_err(|e| e.to_string())?;
    Ok(Some(feather.blur(&mask, view.width, Border::Reflect)))
}

/// Eq. 15 on transmitted light: I′ = I_sharp · C′ + I_spread · (1 − C′).
///
/// # Differences from the paper
/// Eq. 15 as printed mixes the phantom image I_p, an absorbance, with the intensity I_f. What is restored here is the
/// light 10^(I_b − I_p) before the spread in the image plane, in the same unit as what it replaces.
pub(crate) fn restore(spread: &mut [f32], sharp: &[f32], feathered: &[f32]) {
    for ((spread, sharp), share) in spread.iter_mut().zip(sharp).zip(feathered) {
        *spread += share * (sharp - *spread);
    }
}

fn mean_over(tile: &Tile, mask: &Mask) -> f64 {
    let height = tile.height();
    let (mut sum, mut count) = (0.0, 0_u64);
    for run in mask.runs() {
        let Ok(y) = usize::try_from(i64::from(run.y) - tile.origin[1]) else { continue };
        if y >= height {
            continue;
        }
        let clip = |x: u32| usize::try_from(i64::from(x) - tile.origin[0]).unwrap_or(0).min(tile.width);
        for value in &tile.values[y * tile.width + clip(run.x0)..y * tile.width + clip(run.x1)] {
            sum += f64::from(*value);
        }
        count += u64::from(run.x1 - run.x0);
    }
    if count == 0 { 0.0 } else { sum / count as f64 }
}

/// The background of a scene (Eqs. 8–10), in fractions of full scale.
fn background(scene: &Scene) -> Result<Background, String> {
    let view = scene.view;
    let illumination = match scene.background.illumination {
        SceneIllumination::Border { exponent } => Illumination::BorderDistance { exponent },
        // A bowl whose top is off the centre, 1 − x2 (x − tx)² − …, has a tilt; the constant left over is in the level.
        SceneIllumination::Bowl { x2, y2, top } => {
            Illumination::Bowl { x2, y2, tilt: [2.0 * x2 * top[0], 2.0 * y2 * top[1]] }
        }
    };
    let params = BackgroundParams {
        level: scene.background.level,
        illumination,
        scatter: Scatter {
            strength: scene.background.scatter,
            cell_px: (scene.background.scatter_um / view.pixel_um).max(1.0),
            noise: FractalParams::default(),
            ..Scatter::default()
        },
    };
    let key = scene.key.stream("field", 0, "background").next_u64();
    Background::new(&params, view.width, view.height, key).map_err(|e| format!("background: {e}"))
}
