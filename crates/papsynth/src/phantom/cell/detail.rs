//! Levels of detail on a flat sheet: clouds, flecks, grain, cytoskeleton, granules, endoplasm.

use multiversion::multiversion;
use voronoi_cytoskeleton::{LineParams, draw_into};

use crate::key::Stream;
use crate::phantom::pools::{Look, Pools, SIDE, Texels};
use crate::phantom::studio::Studio;
use crate::phantom::tile::{Point, Tile};
use crate::phantom::wobble::wobbled_circle;
use crate::random;
use crate::scene::CellBody;

/// Radius of a granule, µm (the standard deviation of its absorbance).
const GRANULE_UM: f64 = 0.28;

/// Absorbance of a granule relative to the cytoplasm's.
const GRANULE: f64 = 0.75;

/// The first two levels of detail, and the grain: factors on the thickness.
pub(super) fn add_detail(
    absorbance: &mut Tile,
    coverage: &Tile,
    body: &CellBody,
    pools: &Pools<'_>,
    pixel_um: f64,
    rng: &mut Stream,
) {
    let detail = &body.detail;
    let clouds = Look::clouds(detail.clouds_um / pixel_um, rng);
    let flecks = Look::fine(pixel_um, rng);
    let grain = Look::fine(pixel_um, rng);
    let (cloud, fleck, grainy) = (detail.clouds as f32, detail.flecks as f32, detail.grain as f32);
    let threshold = if fleck > 0.0 { pools.flecks().quantile(detail.flecks_threshold) } else { 0.0 };
    let width = absorbance.width;
    let mut buffers = vec![0.0_f32; 2 * width];
    let mut texels: Texels = [0.0; SIDE + 1];
    let rows = absorbance.values.chunks_exact_mut(width).zip(coverage.values.chunks_exact(width));
    for (y, (row, cover)) in rows.enumerate() {
        let Some((first, end)) = covered(cover) else { continue };
        let (at, row) = ([first as f64, y as f64], &mut row[first..end]);
        let (factor, field) = buffers.split_at_mut(width);
        let (factor, field) = (&mut factor[..row.len()], &mut field[..row.len()]);
        factor.fill(1.0);
        if cloud > 0.0 {
            pools.clouds().row_into(field, &clouds, at, &mut texels);
            add_above(factor, field, cloud, None);
        }
        if fleck > 0.0 {
            pools.flecks().row_into(field, &flecks, at, &mut texels);
            add_above(factor, field, fleck, Some(threshold));
        }
        if grainy > 0.0 {
            pools.grain().row_into(field, &grain, at, &mut texels);
            add_above(factor, field, grainy, None);
        }
        multiply(row, factor);
    }
}

/// Adds a field, or what of it lies above a threshold.
#[multiversion(targets = "simd")]
fn add_above(factor: &mut [f32], field: &[f32], strength: f32, threshold: Option<f32>) {
    let zero = threshold.unwrap_or(0.0);
    let least = threshold.unwrap_or(f32::NEG_INFINITY);
    for (factor, &value) in factor.iter_mut().zip(field) {
        let above = if value > least { value } else { least };
        *factor += strength * (above - zero);
    }
}

/// Multiplies by factors, of which those below 0 count as 0.
#[multiversion(targets = "simd")]
fn multiply(row: &mut [f32], factors: &[f32]) {
    for (value, &factor) in row.iter_mut().zip(factors) {
        *value *= if factor > 0.0 { factor } else { 0.0 };
    }
}

/// From the first pixel of a row with a share to behind the last.
fn covered(row: &[f32]) -> Option<(usize, usize)> {
    let inside = |share: &f32| *share > 0.0;
    Some((row.iter().position(inside)?, row.iter().rposition(inside)? + 1))
}

/// The third level of detail.
pub(super) fn add_cytoskeleton(
    studio: &Studio,
    absorbance: &mut Tile,
    outline: &[Point],
    strength: f64,
    pixel_um: f64,
    rng: &mut Stream,
) -> Result<(), String> {
    /// Width of a fibre, µm.
    const FIBRE_UM: f64 = 0.3;
    let origin = absorbance.origin.map(|o| o as f64);
    let local: Vec<Point> = outline.iter().map(|p| [p[0] - origin[0], p[1] - origin[1]]).collect();
    let rivers = studio.skeleton.grow(&local, rng).map_err(|e| e.to_string())?;
    let mut lines = vec![0.0; absorbance.values.len()];
    let line = LineParams { width_px: (FIBRE_UM / pixel_um).max(1.0), ..LineParams::default() };
    draw_into(&mut lines, absorbance.width, &rivers, &line).map_err(|e| e.to_string())?;
    for (value, line) in absorbance.values.iter_mut().zip(&lines) {
        *value += strength as f32 * line;
    }
    Ok(())
}

/// Keratohyalin granules: small dark dots over all of the cell.
pub(super) fn add_granules(absorbance: &mut Tile, coverage: &Tile, per_100_um2: f64, pixel_um: f64, rng: &mut Stream) {
    if per_100_um2 <= 0.0 {
        return;
    }
    let area_um2 = coverage.values.iter().map(|v| f64::from(*v)).sum::<f64>() * pixel_um * pixel_um;
    let wanted = random::count(per_100_um2 * area_um2 / 100.0);
    let (width, height) = (absorbance.width, absorbance.height());
    // As many tries as would put the wanted number inside a box that the cell fills.
    let box_um2 = (width * height) as f64 * pixel_um * pixel_um;
    for _ in 0..random::count(wanted as f64 * box_um2 / area_um2.max(1e-9)) {
        let (x, y) = (random::between(0.0, width as f64, rng), random::between(0.0, height as f64, rng));
        let sigma = GRANULE_UM / pixel_um * random::between(0.6, 1.3, rng);
        let strength = GRANULE * random::between(0.3, 1.5, rng);
        let reach = (3.0 * sigma).ceil();
        #[expect(clippy::cast_possible_truncation, reason = "a few pixels round a place in a tile")]
        let span = |at: f64| ((at - reach) as i64).max(0)..(at + reach) as i64 + 1;
        for py in span(y).take_while(|py| *py < height as i64) {
            for px in span(x).take_while(|px| *px < width as i64) {
                let (dx, dy) = (px as f64 - x, py as f64 - y);
                let value = strength * libm::exp(-(dx * dx + dy * dy) / (2.0 * sigma * sigma));
                let at = usize::try_from(py).unwrap_or(0) * width + usize::try_from(px).unwrap_or(0);
                absorbance.values[at] += value as f32;
            }
        }
    }
}

/// Makes a sheet thicker towards one side, so much of its thickness a radius from its middle.
pub(super) fn slant(absorbance: &mut Tile, centre: Point, radius_px: f64, wedge: [f64; 2]) {
    /// Thinnest that a slant makes the far side, relative to the middle, and thickest the near one.
    const BOUNDS: [f64; 2] = [0.35, 1.8];
    if wedge == [0.0; 2] {
        return;
    }
    absorbance.for_each(|p, value| {
        let slope = (wedge[0] * (p[0] - centre[0]) + wedge[1] * (p[1] - centre[1])) / radius_px;
        *value *= (1.0 + slope).clamp(BOUNDS[0], BOUNDS[1]) as f32;
    });
}

/// A sheet thins out towards its rim: thickness falls to nothing over about this distance, px.
pub(super) fn thin_rim(absorbance: &mut Tile, coverage: &Tile, reach_px: f64) {
    let radius = random::count(reach_px);
    if radius == 0 {
        return;
    }
    // Along a straight rim the mean of the cover over a box is a half at the rim and 1 a radius inside it.
    let mut cover = coverage.clone();
    let (width, height) = (cover.width, cover.height());
    let mut line = Vec::new();
    for row in cover.values.chunks_exact_mut(width) {
        box_mean(row, radius, &mut line);
    }
    let mut column = vec![0.0; height];
    for x in 0..width {
        column.iter_mut().zip(cover.values[x..].iter().step_by(width)).for_each(|(to, from)| *to = *from);
        box_mean(&mut column, radius, &mut line);
        cover.values[x..].iter_mut().step_by(width).zip(&column).for_each(|(to, from)| *to = *from);
    }
    for (value, share) in absorbance.values.iter_mut().zip(&cover.values) {
        let inside = (2.0 * share - 1.0).clamp(0.0, 1.0);
        *value *= inside * (2.0 - inside);
    }
}

/// The mean over so many values to either side, those beyond the ends 0.
fn box_mean(values: &mut [f32], radius: usize, before: &mut Vec<f32>) {
    before.clear();
    before.extend_from_slice(values);
    let weight = 1.0 / (2 * radius + 1) as f32;
    let mut sum: f32 = before.iter().take(radius).sum();
    for (i, value) in values.iter_mut().enumerate() {
        sum += before.get(i + radius).copied().unwrap_or(0.0);
        *value = sum * weight;
        sum -= i.checked_sub(radius).map_or(0.0, |out| before[out]);
    }
}

/// How far from the nucleus the sheet is lifted by it, relative to its radius.
const LIFTED: f64 = 2.4;

/// How much thicker it is there, relative to the density of the endoplasm: fitted by eye to how the cytoplasm round real nuclei falls off.
const LIFT: f32 = 2.2;

/// Steps from none to all of what changes towards the middle of a cell.
const STEPS: usize = 6;

/// How far inside a polygon a place lies: 1 within `inner` times its size about `centre`, 0 outside `outer` times, and even
/// steps between.
fn ramp(like: &Tile, polygon: &[Point], centre: Point, inner: f64, outer: f64) -> Tile {
    let mut sum = like.blank();
    for step in 0..STEPS {
        let share = inner + (outer - inner) * (step as f64 + 0.5) / STEPS as f64;
        let scaled: Vec<Point> = polygon
            .iter()
            .map(|p| [centre[0] + share * (p[0] - centre[0]), centre[1] + share * (p[1] - centre[1])])
            .collect();
        let mut cover = like.blank();
        cover.cover(&scaled);
        sum.values.iter_mut().zip(&cover.values).for_each(|(sum, cover)| *sum += cover / STEPS as f32);
    }
    sum
}

/// The granular inner part of the cytoplasm round the nucleus, denser than the clear outer part.
pub(super) fn add_endoplasm(
    absorbance: &mut Tile,
    outline: &[Point],
    nucleus: Point,
    body: &CellBody,
    pools: &Pools<'_>,
    pixel_um: f64,
    rng: &mut Stream,
) {
    if body.detail.endoplasm <= 0.0 {
        return;
    }
    let share = random::between(0.45, 0.75, rng);
    let softness = random::between(0.08, 0.3, rng);
    let zone = ramp(absorbance, outline, nucleus, share - softness, share + softness);
    // Densest where the nucleus lifts the sheet.
    let radius = body.nucleus.radius_um / pixel_um;
    let round = wobbled_circle(radius, 0.15, 0.15, rng);
    let round: Vec<Point> = round.iter().map(|p| [p[0] + nucleus[0], p[1] + nucleus[1]]).collect();
    let lifted = ramp(absorbance, &round, nucleus, 1.0, LIFTED);
    absorbance
        .values
        .iter_mut()
        .zip(&lifted.values)
        .for_each(|(value, share)| *value *= 1.0 + LIFT * share * body.detail.endoplasm as f32);
    let grain = Look::fine(pixel_um, rng);
    let (density, grainy) = (body.detail.endoplasm as f32, body.detail.endoplasm as f32);
    let width = absorbance.width;
    let mut field = vec![0.0_f32; width];
    let mut texels: Texels = [0.0; SIDE + 1];
    let rows = absorbance.values.chunks_exact_mut(width).zip(zone.values.chunks_exact(width));
    for (y, (row, zone)) in rows.enumerate() {
        let Some((first, end)) = covered(zone) else { continue };
        let field = &mut field[..end - first];
        pools.grain().row_into(field, &grain, [first as f64, y as f64], &mut texels);
        for ((value, share), noise) in row[first..end].iter_mut().zip(&zone[first..end]).zip(field) {
            *value *= 1.0 + share * (density + grainy * noise.max(0.0));
        }
    }
}

/// The cleared space round the nucleus of a koilocyte, and the condensed cytoplasm at its edge.
pub(super) fn add_halo(absorbance: &mut Tile, nucleus: Point, body: &CellBody, pixel_um: f64, rng: &mut Stream) {
    let Some(halo) = body.halo else { return };
    let radius = halo.radius_um / pixel_um;
    let edge = wobbled_circle(radius, 0.12, 0.10, rng);
    let edge: Vec<Point> = edge.iter().map(|p| [nucleus[0] + 1.15 * p[0], nucleus[1] + 0.87 * p[1]]).collect();
    let clear = ramp(absorbance, &edge, nucleus, 0.88, 1.0);
    let rim = ramp(absorbance, &edge, nucleus, 1.0, 1.35);
    for ((value, clear), rim) in absorbance.values.iter_mut().zip(&clear.values).zip(&rim.values) {
        *value *= (1.0 + halo.rim as f32 * (rim - clear)) * (1.0 - halo.clearing as f32 * clear);
    }
}
