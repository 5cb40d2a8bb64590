//! Detail of cytoplasm: clouds, spots (the field `cytoplasm.flecks` of a recipe), fine texture, cytoskeleton.

use core::ops::Range;

use multiversion::multiversion;
use voronoi_cytoskeleton::{LineParams, draw_into};

use super::coarse_tile::{CoarseTile, SMOOTH_PX};
use super::fine_texture::FineTexture;
use crate::error::ErrorKind;
use crate::key::Stream;
use crate::phantom::box_sums::add_row;
use crate::phantom::cell_context::CellContext;
use crate::phantom::noise_fields::{FieldSampler, NoiseField, SIDE, Texels};
use crate::phantom::tile::{Point, Tile};
use crate::random;

/// Multiplies the thickness by clouds, spots and the fine texture. `inner` is 1 in the endoplasm and 0 outside.
pub(super) fn add_clouds_and_texture(
    thickness: &mut Tile,
    coverage: &Tile,
    inner: Option<CoarseTile>,
    cell: &CellContext<'_>,
    rng: &mut Stream,
) -> Result<(), ErrorKind> {
    let (detail, noise_fields, pixel_um) = (&cell.body.detail, cell.noise_fields, cell.pixel_um());
    let mut clouds = Clouds::new(thickness, cell, rng);
    let spots = FieldSampler::fine(pixel_um, rng);
    let mut texture = FineTexture::new(thickness, cell, inner)?;
    let strengths = [detail.clouds, detail.flecks].map(|strength| strength as f32);
    let has_spots = strengths[1] > 0.0;
    let threshold = if has_spots { noise_fields.spots().quantile(detail.flecks_threshold) } else { 0.0 };
    let width = thickness.width;
    let mut fields = [(); 3].map(|()| vec![0.0_f32; width]);
    let mut texels: Texels = [0.0; SIDE + 1];
    let rows = thickness.values.chunks_exact_mut(width).zip(coverage.values.chunks_exact(width));
    for (y, (row, cover)) in rows.enumerate() {
        let Some((first, end)) = covered(cover) else { continue };
        let at = [first as f64, y as f64];
        let [of_clouds, of_spots, of_texture] = &mut fields;
        if let Some(clouds) = &mut clouds {
            clouds.row_into(of_clouds, first..end, y, &mut texels);
        }
        if has_spots {
            noise_fields.spots().row_into(&mut of_spots[first..end], &spots, at, &mut texels);
        }
        if let Some(texture) = &mut texture {
            texture.row_into(of_texture, first..end, y);
        }
        let fields = [&*of_clouds, of_spots, of_texture].map(|field| &field[first..end]);
        modulate(&mut row[first..end], fields, strengths, threshold);
    }
    Ok(())
}

/// Thickness for which the strength of the texture was measured, relative to the flat sheet.
const TEXTURE_THICKNESS: f32 = 1.3;

/// Thickness, relative to the flat sheet, below which the relative deviation of the texture does not increase further.
const THIN: f32 = 0.6;

/// Smallest relative deviation by the texture, so that strong texture makes no holes at thin rims. Set by eye.
const PALEST: f32 = -0.6;

/// Sizes of the noise fields of clouds, relative to `clouds_um`, and their variances, which add up to 1.
const CLOUDS_SIZES: [f64; 3] = [2.4, 1.2, 0.6];
const CLOUDS_VARIANCES: [f32; 3] = [0.4, 0.4, 0.2];

/// Standard deviation of the direction of clouds from that of the streaks of the cell, radians.
///
/// In single normal cells of Cervix93, gradients of details of 2 to 4 µm have a coherence of 0.19 (median). With 0.3
/// radians it is 0.26 in simulated ones, with this number 0.19.
const CLOUDS_DEVIATION: f64 = 0.7;

/// The clouds of a cell: the sum of noise fields, each stretched about along the streaks, with variance 1.
/// Cytoplasm of real cells has strands and folds rather than round clouds.
struct Clouds<'a> {
    noise_field: &'a NoiseField,
    samplers: [FieldSampler; CLOUDS_SIZES.len()],
    /// Wide clouds, drawn with coarse pixels.
    wide: [Option<CoarseTile>; CLOUDS_SIZES.len()],
    /// A row of one noise field.
    field: Vec<f32>,
}

impl<'a> Clouds<'a> {
    /// Returns none for a cell without clouds.
    fn new(like: &Tile, cell: &CellContext<'a>, rng: &mut Stream) -> Option<Self> {
        let detail = &cell.body.detail;
        let sizes = CLOUDS_SIZES.map(|size| size * detail.clouds_um / cell.pixel_um());
        let samplers = sizes.map(|sigma_px| {
            let along = cell.across_streaks_rad + CLOUDS_DEVIATION * random::normal(rng) + core::f64::consts::FRAC_PI_2;
            FieldSampler::clouds(sigma_px, rng).stretched(detail.clouds_stretch, along)
        });
        if detail.clouds <= 0.0 {
            return None;
        }
        let noise_field = cell.noise_fields.clouds();
        let mut wide = CLOUDS_SIZES.map(|_| None);
        for ((wide, sampler), sigma_px) in wide.iter_mut().zip(&samplers).zip(sizes) {
            let is_wide = sigma_px / detail.clouds_stretch.sqrt() >= SMOOTH_PX;
            *wide = is_wide.then(|| CoarseTile::noise(like, noise_field, sampler));
        }
        Some(Self { noise_field, samplers, wide, field: vec![0.0; like.width] })
    }

    /// Writes columns of row `y` of the tile.
    fn row_into(&mut self, row: &mut [f32], columns: Range<usize>, y: usize, texels: &mut Texels) {
        let Self { noise_field, samplers, wide, field } = self;
        let at = [columns.start as f64, y as f64];
        row[columns.clone()].fill(0.0);
        for ((sampler, wide), variance) in samplers.iter().zip(wide).zip(CLOUDS_VARIANCES) {
            match wide {
                Some(wide) => wide.row_into(field, y),
                None => noise_field.row_into(&mut field[columns.clone()], sampler, at, texels),
            }
            add_row(&mut row[columns.clone()], &field[columns.clone()], variance.sqrt());
        }
    }
}

/// Weight of the square of the clouds: dark places are smaller and stronger than pale ones. Set by the skewness of
/// band-pass responses at 4 px in windows between folds: 0.4 to 0.5 in cells of Cervix93, 0.3 to 0.4 in matched fields.
const CLOUD_SQUARE: f32 = 0.35;

/// Limits of clouds before their square is added, standard deviations. Set by eye: without them, strong clouds make
/// large dark smudges, which cells of Cervix93 do not have. The sum with the square increases between them; its
/// standard deviation is 0.98 and its skewness 1.0.
const CLOUD_LIMITS: [f32; 2] = [-1.4, 1.7];

/// Mean of limited clouds with their square.
const CLOUD_MEAN: f32 = 0.2957;

/// Multiplies a row by 1 plus the clouds and the spots above a threshold, times their strengths, and by 1 plus the
/// texture. Clouds are limited, and skewed by their square; their standard deviation becomes 0.98. Negative factors
/// count as 0.
///
/// The relative deviation of the texture is inversely proportional to the fourth root of the thickness, down to
/// [`THIN`]. Within single cells of Cervix93, the amplitude of details of 1 to 3 px is proportional to the power 0.6 to
/// 0.9 of the absorbance around them: dark places are granular, too.
#[multiversion(targets = "simd")]
fn modulate(row: &mut [f32], [clouds, spots, texture]: [&[f32]; 3], strengths: [f32; 2], threshold: f32) {
    for (((value, cloud), &spot), texture) in row.iter_mut().zip(clouds).zip(spots).zip(texture) {
        let above = if spot > threshold { spot - threshold } else { 0.0 };
        let thickness = if *value > 0.0 { *value } else { 0.0 };
        let thinness = TEXTURE_THICKNESS / if thickness > THIN { thickness } else { THIN };
        let deviation = texture * thinness.sqrt().sqrt();
        let cloud = cloud.clamp(CLOUD_LIMITS[0], CLOUD_LIMITS[1]);
        let cloud = cloud + CLOUD_SQUARE * cloud * cloud - CLOUD_MEAN;
        let deviation = if deviation > PALEST { deviation } else { PALEST };
        let changed = thickness * (1.0 + strengths[0] * cloud + strengths[1] * above) * (1.0 + deviation);
        *value = if changed > 0.0 { changed } else { 0.0 };
    }
}

/// Returns the first covered pixel of a row and the end of the last one.
pub(super) fn covered(row: &[f32]) -> Option<(usize, usize)> {
    let inside = |coverage: &f32| *coverage > 0.0;
    Some((row.iter().position(inside)?, row.iter().rposition(inside)? + 1))
}

/// Adds the fibres of the cytoskeleton. `lines` is an image of zeros, of the same size.
pub(super) fn add_cytoskeleton(
    thickness: &mut Tile,
    outline: &[Point],
    cell: &CellContext<'_>,
    lines: &mut [f32],
    rng: &mut Stream,
) -> Result<(), ErrorKind> {
    /// Width of a fibre, µm.
    const FIBRE_UM: f64 = 0.3;
    let strength = cell.body.detail.cytoskeleton;
    if strength <= 0.0 {
        return Ok(());
    }
    let origin = thickness.origin.map(|o| o as f64);
    let local: Vec<Point> = outline.iter().map(|p| [p[0] - origin[0], p[1] - origin[1]]).collect();
    let fibres = cell.assets.cytoskeletons.grow(&local, rng)?;
    let line = LineParams { width_px: (FIBRE_UM / cell.pixel_um()).max(1.0), ..LineParams::default() };
    draw_into(lines, thickness.width, &fibres, &line)?;
    add_row(&mut thickness.values, lines, strength as f32);
    Ok(())
}

/// Applies a linear thickness gradient: relative change per cell radius, in x and y.
pub(super) fn apply_gradient(thickness: &mut Tile, centre: Point, radius_px: f64, gradient: [f64; 2]) {
    if gradient == [0.0; 2] {
        return;
    }
    let [across, down] = gradient.map(|slope| slope / radius_px);
    let [left, top] = [0, 1].map(|axis| thickness.origin[axis] as f64 - centre[axis]);
    for (y, row) in thickness.values.chunks_exact_mut(thickness.width).enumerate() {
        scale_row(row, (1.0 + across * left + down * (top + y as f64)) as f32, across as f32);
    }
}

/// Multiplies value i by `first + i·step`, within bounds.
#[multiversion(targets = "simd")]
fn scale_row(row: &mut [f32], first: f32, step: f32) {
    /// Bounds of the factor.
    const BOUNDS: [f32; 2] = [0.35, 1.8];
    for (x, value) in row.iter_mut().enumerate() {
        *value *= (first + step * x as f32).clamp(BOUNDS[0], BOUNDS[1]);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::key::Key;
    use crate::phantom::noise_fields::NoiseFieldGenerator;

    #[test]
    fn clouds_are_limited_and_have_the_deviation_and_skewness_that_are_documented() {
        let mut rng = Key { seed: 7, index: 0 }.stream("test", 0, "clouds");
        let clouds: Vec<f32> = (0..200_000).map(|_| random::normal(&mut rng) as f32).collect();
        let (zeros, strength) = (vec![0.0; clouds.len()], 0.2);
        let mut row = vec![1.0; clouds.len()];
        modulate(&mut row, [&clouds, &zeros, &zeros], [strength, 0.0], 0.0);
        let deviations: Vec<f64> = row.iter().map(|value| f64::from((value - 1.0) / strength)).collect();
        let mean = |power: fn(f64) -> f64| deviations.iter().map(|d| power(*d)).sum::<f64>() / deviations.len() as f64;
        let (middle, square, cube) = (mean(|d| d), mean(|d| d * d), mean(|d| d * d * d));
        let variance = square - middle * middle;
        let skewness = (cube - 3.0 * middle * square + 2.0 * middle * middle * middle) / (variance * variance.sqrt());
        assert!(middle.abs() < 0.01 && (variance.sqrt() - 0.98).abs() < 0.01, "{middle} {variance}");
        assert!((0.9..1.1).contains(&skewness), "{skewness}");
        // 1.7 + 0.35 · 1.7² − 0.296
        assert!(deviations.iter().all(|d| *d < 2.42));
    }

    #[test]
    fn texture_is_weaker_on_thick_cytoplasm_and_makes_no_holes() {
        let relative = |thickness: f32, texture: f32| {
            let mut row = [thickness];
            modulate(&mut row, [&[0.0], &[0.0], &[texture]], [0.0; 2], 0.0);
            row[0] / thickness - 1.0
        };
        let linear = |thickness| (relative(thickness, 0.01) - relative(thickness, -0.01)) / 0.02;
        for (thickness, expected) in [(20.8, 0.5), (1.3, 1.0), (0.6, 1.213), (0.2, 1.213)] {
            let found = linear(thickness);
            assert!((found - expected).abs() < 0.01, "{thickness}: {found}");
        }
        assert!((relative(1.3, 0.8) - 0.8).abs() < 1e-5 && (relative(0.3, -3.0) + 0.6).abs() < 1e-5);
        // The texture of a dark cloud is as strong as the cloud.
        let mut rows = [[1.3_f32]; 2];
        for (row, texture) in rows.iter_mut().zip([0.0, 0.1]) {
            modulate(row, [&[1.0], &[0.0], &[texture]], [0.4, 0.0], 0.0);
        }
        assert!((rows[1][0] / rows[0][0] - 1.1).abs() < 1e-5, "{rows:?}");
        for thickness in [0.0, -0.2] {
            let mut row = [thickness];
            modulate(&mut row, [&[0.0], &[0.0], &[0.5]], [0.0; 2], 0.0);
            assert_eq!(row, [0.0]);
        }
    }

    #[test]
    fn the_fields_of_clouds_have_variance_1_together() {
        let generator = NoiseFieldGenerator::new();
        let noise_fields = generator.fields(Key { seed: 6, index: 0 });
        let mut rng = Key { seed: 6, index: 0 }.stream("test", 0, "clouds");
        let [mut each, mut together] = [0.0, 0.0];
        for _ in 0..400 {
            let mut row = vec![0.0_f32; 300];
            for (size, variance) in CLOUDS_SIZES.into_iter().zip(CLOUDS_VARIANCES) {
                let sampler = FieldSampler::clouds(2.0 * size, &mut rng).stretched(2.5, random::direction(&mut rng));
                let mut field = row.clone();
                noise_fields.clouds().row_into(&mut field, &sampler, [0.0; 2], &mut [0.0; SIDE + 1]);
                each += f64::from(variance) * field.iter().map(|v| f64::from(v * v)).sum::<f64>();
                add_row(&mut row, &field, variance.sqrt());
            }
            together += row.iter().map(|v| f64::from(v * v)).sum::<f64>();
        }
        // One field of finite size has another variance than the mean of all fields.
        let count = 400.0 * 300.0;
        assert!((together / each - 1.0).abs() < 0.05 && (each / count - 1.0).abs() < 0.1, "{together} {each} {count}");
    }

    #[test]
    fn a_gradient_keeps_the_thickness_at_the_centre() {
        let mut tile = Tile { origin: [-30, 10], width: 61, values: vec![2.0; 61 * 41] };
        apply_gradient(&mut tile, [0.0, 30.0], 25.0, [0.5, -0.25]);
        let at = |x: usize, y: usize| f64::from(tile.values[y * 61 + x]);
        assert!((at(30, 20) - 2.0).abs() < 1e-6);
        assert!((at(40, 30) - 2.0 * (1.0 + (5.0 - 2.5) / 25.0)).abs() < 1e-5, "{}", at(40, 30));
        let mut steep = Tile { origin: [-30, 10], width: 61, values: vec![1.0; 61 * 41] };
        apply_gradient(&mut steep, [0.0, 30.0], 1.0, [0.5, 0.0]);
        assert!(steep.values.iter().all(|v| (0.35..=1.8).contains(v)));
    }
}
