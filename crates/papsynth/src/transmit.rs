//! Signal transmission: from phantoms to the light on the sensor (Eqs. 8–14).

use core::ops::Range;
use std::borrow::Cow;
use std::sync::{Mutex, MutexGuard, PoisonError};

use multiversion::multiversion;
use optics_psf::{Border, Gaussian, Method, Scratch};
use perlin_bg::{Background, BackgroundParams, FractalParams, Illumination, Scatter};
use rand_core::Rng;

use crate::detect::sum_over;
use crate::exp10::exp10_from;
use crate::phantom::tile::{Tile, add_tile};
use crate::phantom::{Phantom, Piece};
use crate::recipe::Restore;
use crate::scene::{Scene, SceneIllumination};
use crate::threads::{self, Threads};
use crate::truth::{COVERED, Mask};

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
const BAND: usize = 32;

/// What all planes of one scene share.
pub(crate) struct LightPath {
    /// I_b of Eq. 10: the logarithm of the empty slide's light, as a fraction of full scale.
    empty_log10: Vec<f32>,
    width: usize,
    in_plane: Gaussian,
    /// The feathered mask C′ of the nuclei whose texture was taken from images, if any are to be restored.
    pub(crate) feathered: Option<Feathered>,
    threads: Threads,
    spare: Mutex<Spare>,
}

/// Memory that one plane leaves to the next.
#[derive(Default)]
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

/// Memory for the light of a plane: its absorbance until it is spread.
#[derive(Default)]
pub(crate) struct Light {
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
    pub(crate) fn new(scene: &Scene, phantoms: &[Phantom], threads: Threads) -> Result<Self, String> {
        let (width, height) = (scene.view.width, scene.view.height);
        let mut empty_log10 = vec![0.0; width * height];
        background(scene)?.log10_into(&mut empty_log10, width, [0, 0]);
        let sigma_px = scene.optics.sigma_xy_um / scene.view.pixel_um;
        let in_plane = Gaussian::truncated(sigma_px, Method::Direct, LOST_TAIL_IN_PLANE).map_err(|e| e.to_string())?;
        let feathered = match scene.optics.restore {
            Restore::Off => None,
            Restore::BeforeDetection | Restore::AfterDetection => Feathered::new(scene, phantoms)?,
        };
        Ok(Self { empty_log10, width, in_plane, feathered, threads, spare: Mutex::default() })
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
        absorbance.resize(self.empty_log10.len(), 0.0);
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
                    add(absorbance, self.width, &piece);
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
        let Light { whole, band, scratch } = light;
        let (width, height) = (self.width, whole.len() / self.width);
        let mut lit = 0;
        for first in (0..height).step_by(BAND) {
            let end = (first + BAND).min(height);
            let needed = (end + self.in_plane.radius()).min(height);
            let rows = lit * width..needed * width;
            exp10_from(&self.empty_log10[rows.clone()], &mut whole[rows]);
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
        let frame = [self.width, self.empty_log10.len() / self.width];
        let inside = |axis: usize, length: usize| origin[axis] < frame[axis] as i64 && origin[axis] + length as i64 > 0;
        inside(0, width) && inside(1, height)
    }

    fn spare(&self) -> MutexGuard<'_, Spare> {
        self.spare.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// Adds a tile to an image of rows of `width`, where they overlap.
#[multiversion(targets = "simd")]
fn add(image: &mut [f32], width: usize, tile: &Blurred<'_>) {
    let [left, top] = tile.origin;
    let column = |x: i64| usize::try_from(x).unwrap_or(0).min(tile.width);
    let (first, last) = (column(-left), column(width as i64 - left));
    if first >= last {
        return;
    }
    let x = usize::try_from(left).unwrap_or(0);
    let hidden = usize::try_from(-top).unwrap_or(0);
    let rows = image.chunks_exact_mut(width).skip(usize::try_from(top).unwrap_or(0));
    for (row, values) in rows.zip(tile.values.chunks_exact(tile.width).skip(hidden)) {
        for (pixel, value) in row[x..].iter_mut().zip(&values[first..last]) {
            *pixel += value;
        }
    }
}

/// C′ = C ∗ G_σ, C being 1 on nuclei whose texture was taken from images and 0 elsewhere (Eq. 16).
pub(crate) struct Feathered {
    shares: Vec<f32>,
    /// Where it is not 0: pixels of one row, in order.
    spans: Vec<Range<usize>>,
}

impl Feathered {
    /// Nothing if there are no such nuclei.
    fn new(scene: &Scene, phantoms: &[Phantom]) -> Result<Option<Self>, String> {
        let view = scene.view;
        let imaged = || phantoms.iter().flat_map(|p| &p.pieces).filter(|piece| piece.imaged);
        if imaged().next().is_none() {
            return Ok(None);
        }
        let mut mask = vec![0.0_f32; view.width * view.height];
        for piece in imaged() {
            let cover = &piece.coverage;
            let values = cover.values.iter().map(|v| if *v >= COVERED { 1.0 } else { 0.0 }).collect();
            add_tile(&mut mask, view.width, view.height, [0, 0], &Tile { values, ..*cover });
        }
        mask.iter_mut().for_each(|v| *v = v.min(1.0));
        let feather = Gaussian::new(scene.optics.restore_feather_um / view.pixel_um).map_err(|e| e.to_string())?;
        let shares = feather.blur(&mask, view.width, Border::Reflect);
        let row_spans = |(y, row): (usize, &[f32])| {
            let spans = row.chunk_by(|a, b| (*a == 0.0) == (*b == 0.0)).scan(y * view.width, |at, pixels| {
                let first = *at;
                *at += pixels.len();
                Some((first..*at, pixels[0] != 0.0))
            });
            spans.filter(|(_, restored)| *restored).map(|(span, _)| span).collect::<Vec<_>>()
        };
        let spans = shares.chunks_exact(view.width).enumerate().flat_map(row_spans).collect();
        Ok(Some(Self { shares, spans }))
    }

    /// Where rows of the image that start at pixel `first` are to be restored, counted from there, and how much.
    pub(crate) fn within(&self, first: usize, pixels: usize) -> impl Iterator<Item = (Range<usize>, &[f32])> {
        let from = self.spans.partition_point(|span| span.start < first);
        let here = self.spans[from..].iter().take_while(move |span| span.start < first + pixels);
        here.map(move |span| (span.start - first..span.end - first, &self.shares[span.clone()]))
    }
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn adding_clips_at_every_side_as_for_whole_tiles() {
        for (x, y, width, height) in
            [(-2, -3, 9, 8), (3, 2, 2, 2), (5, 4, 9, 9), (-4, 1, 4, 2), (0, 6, 3, 3), (8, 0, 2, 2)]
        {
            let values: Vec<f32> = (1..=width * height).map(|i| i as f32).collect();
            let tile = Tile { origin: [x, y], width, values };
            let blurred = Blurred { origin: tile.origin, width, values: Cow::Borrowed(&tile.values), mean: 0.0 };
            let (mut fast, mut slow) = (vec![0.5; 48], vec![0.5; 48]);
            add(&mut fast, 8, &blurred);
            add_tile(&mut slow, 8, 6, [0, 0], &tile);
            assert_eq!(fast, slow, "{x} {y}");
        }
    }
}
