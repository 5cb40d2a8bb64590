//! Signal transmission: from phantoms to the light on the sensor (Eqs. 8–14).

use std::borrow::Cow;
use std::sync::{Mutex, MutexGuard, PoisonError};

use multiversion::multiversion;
use optics_psf::{Border, Gaussian, Method, Scratch};
use perlin_bg::{Background, BackgroundParams, FractalParams, Illumination, Scatter};
use rand_core::Rng;

use crate::detect::sum_over;
use crate::exp10::exp10_from;
use crate::phantom::tile::{TileRef, lay};
use crate::phantom::{Phantom, Piece};
use crate::recipe::Restore;
use crate::restore::Feathered;
use crate::scene::{Scene, SceneIllumination};
use crate::threads::{self, Threads};
use crate::truth::Mask;

/// Spread below which a Gaussian changes nothing that 16 bits could show, px.
const SHARP_PX: f64 = 0.03;

/// Share of an object's absorbance that lies beyond the ends of its blur and is left out. It errs by ten times
/// that at the worst, which is what the decimated blur may err by.
const LOST_TAIL: f64 = 1e-4;

/// The same for the spread in the image plane, which everything passes.
const LOST_TAIL_IN_PLANE: f64 = 1e-5;

/// Objects whose blurred tiles are in memory at one time, when several threads make them.
const CHUNK: usize = 64;

/// Rows that go from light to grey levels together: few enough to stay in the cache of one core.
pub(crate) const BAND: usize = 32;

/// What all planes of one scene share.
pub(crate) struct LightPath {
    width: usize,
    height: usize,
    in_plane: Gaussian,
    /// The feathered mask C′ of the nuclei whose texture was taken from images, if any are to be restored.
    pub(crate) feathered: Option<Feathered>,
    threads: Threads,
    spare: Mutex<Spare>,
}

/// Memory for blurred tiles, which one object leaves to the next.
#[derive(Debug, Default)]
struct Spare {
    tiles: Vec<Vec<f32>>,
    scratches: Vec<Scratch>,
}

/// Rows of the light of one plane, as fractions of full scale.
pub(crate) struct Band<'a> {
    /// The first row.
    pub(crate) first: usize,
    /// 10^(I_b − I_p): before the spread in the image plane.
    pub(crate) sharp: &'a [f32],
    /// The same after it.
    pub(crate) spread: &'a mut [f32],
}

/// Memory for the light of a plane.
#[derive(Debug, Default)]
pub(crate) struct Light {
    /// I_b of Eq. 10: the logarithm of the empty slide's light, as a fraction of full scale.
    empty_log10: Vec<f32>,
    /// The absorbance until it is spread, then the light.
    whole: Vec<f32>,
    band: Vec<f32>,
    scratch: Scratch,
}

/// Which plane is in focus.
#[derive(Debug, Clone, Copy)]
pub(crate) enum FocusAt {
    /// One depth for all.
    Depth(f64),
    /// Every object its own: the all-in-focus image.
    Everywhere,
}

/// The absorbance of a piece as it is in a plane.
struct Blurred<'a> {
    origin: [i64; 2],
    width: usize,
    /// Nothing if the tile lies outside the image.
    values: Cow<'a, [f32]>,
    /// Mean over the mask of the piece.
    mean: f64,
}

impl LightPath {
    /// Prepares the path, and the empty slide's light in `light`.
    pub(crate) fn new(
        scene: &Scene,
        phantoms: &[Phantom],
        threads: Threads,
        light: &mut Light,
    ) -> Result<Self, String> {
        let (width, height) = (scene.view.width, scene.view.height);
        light.empty_log10.resize(width * height, 0.0);
        background(scene)?.log10_into(&mut light.empty_log10, width, [0, 0]);
        let sigma_px = scene.optics.sigma_xy_um / scene.view.pixel_um;
        let in_plane = Gaussian::truncated(sigma_px, Method::Direct, LOST_TAIL_IN_PLANE).map_err(|e| e.to_string())?;
        let feathered = match scene.optics.restore {
            Restore::Off => None,
            Restore::BeforeDetection | Restore::AfterDetection => Feathered::new(scene, phantoms)?,
        };
        Ok(Self { width, height, in_plane, feathered, threads, spare: Mutex::default() })
    }

    /// Lets light through the phantoms of a scene: `light` becomes their absorbance I_p. `masks` are those
    /// of the phantoms' pieces, in their order, as are the mean absorbances over them that are returned.
    pub(crate) fn absorb(
        &self,
        scene: &Scene,
        phantoms: &[Phantom],
        masks: &[Vec<Mask>],
        focus: FocusAt,
        light: &mut Light,
    ) -> Result<Vec<f64>, String> {
        let absorbance = &mut light.whole;
        absorbance.clear();
        absorbance.resize(self.width * self.height, 0.0);
        let mut absorbances = Vec::new();
        let indices: Vec<usize> = (0..phantoms.len()).collect();
        // One thread adds a tile while it is still in the cache.
        let chunk = match self.threads {
            Threads::One => 1,
            Threads::All => CHUNK,
        };
        for chunk in indices.chunks(chunk) {
            let work = |&index: &usize| {
                self.blur(scene, scene.objects[index].depth_um, &phantoms[index], &masks[index], focus)
            };
            let blurred = threads::map(self.threads, chunk, work);
            // Eq. 14: I_p = Σ pᵢ ∗ G_σz, in the order of the objects whatever thread made them.
            for pieces in blurred {
                for piece in pieces? {
                    add(
                        absorbance,
                        self.width,
                        TileRef { origin: piece.origin, width: piece.width, values: &piece.values },
                    );
                    absorbances.push(piece.mean);
                    if let Cow::Owned(values) = piece.values {
                        self.spare().tiles.push(values);
                    }
                }
            }
        }
        Ok(absorbances)
    }

    /// Turns the absorbance into light, 10^(I_b − I_p), and spreads it in the image plane, band by band from the top.
    pub(crate) fn spread(&self, light: &mut Light, mut visit: impl FnMut(Band<'_>)) {
        let Light { empty_log10, whole, band, scratch } = light;
        let (width, height) = (self.width, self.height);
        let mut lit = 0;
        for first in (0..height).step_by(BAND) {
            let end = (first + BAND).min(height);
            let needed = (end + self.in_plane.radius()).min(height);
            let rows = lit * width..needed * width;
            exp10_from(&empty_log10[rows.clone()], &mut whole[rows]);
            lit = needed;
            band.resize((end - first) * width, 0.0);
            self.in_plane.blur_rows_into(whole, width, Border::Reflect, first, band, scratch);
            visit(Band { first, sharp: &whole[first * width..end * width], spread: band });
        }
    }

    /// The absorbance of an object's pieces in a plane.
    fn blur<'a>(
        &self,
        scene: &Scene,
        depth_um: f64,
        phantom: &'a Phantom,
        masks: &[Mask],
        focus: FocusAt,
    ) -> Result<Vec<Blurred<'a>>, String> {
        let sigma_px = match focus {
            FocusAt::Everywhere => 0.0,
            // σ grows with the distance from focus: the object's own depth, exactly, in every plane.
            FocusAt::Depth(plane) => scene.optics.sigma_z_um_per_um * (plane - depth_um).abs() / scene.view.pixel_um,
        };
        let gaussian = (sigma_px > SHARP_PX)
            .then(|| Gaussian::truncated(sigma_px, Method::Decimated, LOST_TAIL))
            .transpose()
            .map_err(|e| e.to_string())?;
        Ok(phantom
            .pieces
            .iter()
            .zip(masks)
            .map(|(piece, mask)| self.blur_piece(piece, mask, gaussian.as_ref()))
            .collect())
    }

    fn blur_piece<'a>(&self, piece: &'a Piece, mask: &Mask, gaussian: Option<&Gaussian>) -> Blurred<'a> {
        let tile = &piece.absorbance;
        let margin = gaussian.map_or(0, Gaussian::radius);
        let origin = tile.origin.map(|at| at - margin as i64);
        let (width, height) = (tile.width + 2 * margin, tile.height() + 2 * margin);
        if !self.meets(origin, width, height) {
            return Blurred { origin, width, values: Cow::Borrowed(&[]), mean: 0.0 };
        }
        let values = match gaussian {
            None => Cow::Borrowed(&tile.values[..]),
            Some(gaussian) => {
                let mut values = self.spare().tiles.pop().unwrap_or_default();
                let mut scratch = self.spare().scratches.pop().unwrap_or_default();
                values.resize(width * height, 0.0);
                gaussian.spread_into(&tile.values, tile.width, &mut values, &mut scratch);
                self.spare().scratches.push(scratch);
                Cow::Owned(values)
            }
        };
        let mean = sum_over(mask.runs(), &values, width, origin) / (mask.area() as f64).max(1.0);
        Blurred { origin, width, values, mean }
    }

    /// Whether a tile has a pixel in the image.
    fn meets(&self, origin: [i64; 2], width: usize, height: usize) -> bool {
        let frame = [self.width, self.height];
        let inside = |axis: usize, length: usize| origin[axis] < frame[axis] as i64 && origin[axis] + length as i64 > 0;
        inside(0, width) && inside(1, height)
    }

    fn spare(&self) -> MutexGuard<'_, Spare> {
        self.spare.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

#[multiversion(targets = "simd")]
fn add(image: &mut [f32], width: usize, tile: TileRef<'_>) {
    lay(image, width, 0, tile, |row, values| row.iter_mut().zip(values).for_each(|(pixel, value)| *pixel += value));
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
