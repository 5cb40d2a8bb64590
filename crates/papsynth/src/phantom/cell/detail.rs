//! Detail of cytoplasm: clouds, flecks, grain, cytoskeleton, granules, endoplasm, halo.

use multiversion::multiversion;
use voronoi_cytoskeleton::{LineParams, draw_into};

use crate::error::ErrorKind;
use crate::key::Stream;
use crate::phantom::cell_context::CellContext;
use crate::phantom::noise_fields::{FieldSampler, SIDE, Texels};
use crate::phantom::parametric_shape::perturbed_circle;
use crate::phantom::tile::{Point, Tile, scaled_about};
use crate::random;

/// Standard deviation of the absorbance profile of a granule, µm.
const GRANULE_UM: f64 = 0.28;

/// Absorbance of a granule relative to the cytoplasm.
const GRANULE: f64 = 0.75;

/// Multiplies the thickness by clouds, flecks and grain.
pub(super) fn add_detail(absorbance: &mut Tile, coverage: &Tile, cell: &CellContext<'_>, rng: &mut Stream) {
    let (detail, noise_fields, pixel_um) = (&cell.body.detail, cell.noise_fields, cell.pixel_um());
    let clouds = FieldSampler::clouds(detail.clouds_um / pixel_um, rng);
    let flecks = FieldSampler::fine(pixel_um, rng);
    let grain = FieldSampler::fine(pixel_um, rng);
    let (cloud, fleck, grainy) = (detail.clouds as f32, detail.flecks as f32, detail.grain as f32);
    let threshold = if fleck > 0.0 { noise_fields.flecks().quantile(detail.flecks_threshold) } else { 0.0 };
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
            noise_fields.clouds().row_into(field, &clouds, at, &mut texels);
            add_above(factor, field, cloud, None);
        }
        if fleck > 0.0 {
            noise_fields.flecks().row_into(field, &flecks, at, &mut texels);
            add_above(factor, field, fleck, Some(threshold));
        }
        if grainy > 0.0 {
            noise_fields.grain().row_into(field, &grain, at, &mut texels);
            add_above(factor, field, grainy, None);
        }
        multiply(row, factor);
    }
}

/// Adds `strength` times a field, or times its excess above a threshold.
#[multiversion(targets = "simd")]
fn add_above(factor: &mut [f32], field: &[f32], strength: f32, threshold: Option<f32>) {
    let zero = threshold.unwrap_or(0.0);
    let least = threshold.unwrap_or(f32::NEG_INFINITY);
    for (factor, &value) in factor.iter_mut().zip(field) {
        let above = if value > least { value } else { least };
        *factor += strength * (above - zero);
    }
}

/// Multiplies by factors; negative factors count as 0.
#[multiversion(targets = "simd")]
fn multiply(row: &mut [f32], factors: &[f32]) {
    for (value, &factor) in row.iter_mut().zip(factors) {
        *value *= if factor > 0.0 { factor } else { 0.0 };
    }
}

/// Returns the first covered pixel of a row and the end of the last one.
fn covered(row: &[f32]) -> Option<(usize, usize)> {
    let inside = |coverage: &f32| *coverage > 0.0;
    Some((row.iter().position(inside)?, row.iter().rposition(inside)? + 1))
}

/// Adds the fibres of the cytoskeleton.
pub(super) fn add_cytoskeleton(
    absorbance: &mut Tile,
    outline: &[Point],
    cell: &CellContext<'_>,
    rng: &mut Stream,
) -> Result<(), ErrorKind> {
    /// Width of a fibre, µm.
    const FIBRE_UM: f64 = 0.3;
    let strength = cell.body.detail.cytoskeleton;
    if strength <= 0.0 {
        return Ok(());
    }
    let origin = absorbance.origin.map(|o| o as f64);
    let local: Vec<Point> = outline.iter().map(|p| [p[0] - origin[0], p[1] - origin[1]]).collect();
    let fibres = cell.assets.cytoskeletons.grow(&local, rng)?;
    let mut lines = vec![0.0; absorbance.values.len()];
    let line = LineParams { width_px: (FIBRE_UM / cell.pixel_um()).max(1.0), ..LineParams::default() };
    draw_into(&mut lines, absorbance.width, &fibres, &line)?;
    for (value, line) in absorbance.values.iter_mut().zip(&lines) {
        *value += strength as f32 * line;
    }
    Ok(())
}

/// Adds keratohyalin granules: small dark dots throughout the cell.
pub(super) fn add_granules(absorbance: &mut Tile, coverage: &Tile, per_100_um2: f64, pixel_um: f64, rng: &mut Stream) {
    if per_100_um2 <= 0.0 {
        return;
    }
    let area_um2 = coverage.sum() * pixel_um * pixel_um;
    let wanted = random::count(per_100_um2 * area_um2 / 100.0);
    let (width, height) = (absorbance.width, absorbance.height());
    // Granules are drawn in the bounding box, so that the expected number inside the cell is right.
    let box_um2 = (width * height) as f64 * pixel_um * pixel_um;
    let mut across = Vec::new();
    for _ in 0..random::count(wanted as f64 * box_um2 / area_um2.max(1e-9)) {
        let (x, y) = (random::between(0.0, width as f64, rng), random::between(0.0, height as f64, rng));
        let sigma = GRANULE_UM / pixel_um * random::between(0.6, 1.3, rng);
        let strength = GRANULE * random::between(0.3, 1.5, rng);
        let reach = (3.0 * sigma).ceil();
        let span = |at: f64| ((at - reach) as i64).max(0)..(at + reach) as i64 + 1;
        let fall = |away: f64| libm::exp(-away * away / (2.0 * sigma * sigma));
        across.clear();
        across.extend(span(x).take_while(|px| *px < width as i64).map(|px| fall(px as f64 - x)));
        let left = usize::try_from(span(x).start).unwrap_or(0);
        for py in span(y).take_while(|py| *py < height as i64) {
            let peak = strength * fall(py as f64 - y);
            let at = usize::try_from(py).unwrap_or(0) * width + left;
            for (value, across) in absorbance.values[at..].iter_mut().zip(&across) {
                *value += (peak * across) as f32;
            }
        }
    }
}

/// Applies a linear thickness gradient: relative change per cell radius, in x and y.
pub(super) fn apply_gradient(absorbance: &mut Tile, centre: Point, radius_px: f64, gradient: [f64; 2]) {
    if gradient == [0.0; 2] {
        return;
    }
    let [across, down] = gradient.map(|slope| slope / radius_px);
    let [left, top] = [0, 1].map(|axis| absorbance.origin[axis] as f64 - centre[axis]);
    for (y, row) in absorbance.values.chunks_exact_mut(absorbance.width).enumerate() {
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

/// Thins a sheet towards its rim: thickness decreases to 0 over about this distance, px.
pub(super) fn thin_rim(absorbance: &mut Tile, coverage: &Tile, distance_px: f64) {
    let radius = random::count(distance_px);
    if radius == 0 {
        return;
    }
    // At a straight rim, the mean coverage of a box is 0.5. One radius inside the rim, it is 1.
    let width = coverage.width;
    let mut across = vec![0.0; coverage.values.len()];
    sums_across(&coverage.values, width, radius, &mut across);
    let weight = 1.0 / ((2 * radius + 1) as f32 * (2 * radius + 1) as f32);
    let row = |y: usize| across.get(y * width..(y + 1) * width);
    let mut sums = vec![0.0; width];
    for y in 0..radius {
        row(y).into_iter().for_each(|row| add_row(&mut sums, row, 1.0));
    }
    for (y, values) in absorbance.values.chunks_exact_mut(width).enumerate() {
        row(y + radius).into_iter().for_each(|row| add_row(&mut sums, row, 1.0));
        thin(values, &sums, weight);
        y.checked_sub(radius).and_then(row).into_iter().for_each(|row| add_row(&mut sums, row, -1.0));
    }
}

#[multiversion(targets = "simd")]
fn add_row(sums: &mut [f32], row: &[f32], sign: f32) {
    for (sum, value) in sums.iter_mut().zip(row) {
        *sum += sign * value;
    }
}

/// Multiplies values by a factor that increases from 0 at the rim to 1 at one radius inside.
#[multiversion(targets = "simd")]
fn thin(values: &mut [f32], sums: &[f32], weight: f32) {
    for (value, sum) in values.iter_mut().zip(sums) {
        let inside = (2.0 * weight * sum - 1.0).clamp(0.0, 1.0);
        *value *= inside * (2.0 - inside);
    }
}

/// Computes running sums within rows, over `radius` values to either side; values beyond the ends are 0.
///
/// Processes several rows at a time, because each running sum is a chain of dependent additions.
fn sums_across(values: &[f32], width: usize, radius: usize, out: &mut [f32]) {
    const ROWS: usize = 8;
    let (blocks, out_blocks) = (values.chunks(ROWS * width), out.chunks_mut(ROWS * width));
    for (block, out) in blocks.zip(out_blocks) {
        let rows = block.len() / width;
        let mut sums = [0.0_f32; ROWS];
        let at = |k: usize, x: usize| if k < rows && x < width { block[k * width + x] } else { 0.0 };
        for x in 0..radius {
            sums.iter_mut().enumerate().for_each(|(k, sum)| *sum += at(k, x));
        }
        for x in 0..width {
            for (k, sum) in sums.iter_mut().enumerate().take(rows) {
                *sum += at(k, x + radius);
                out[k * width + x] = *sum;
                *sum -= x.checked_sub(radius).map_or(0.0, |x| at(k, x));
            }
        }
    }
}

/// Radius of the region where the nucleus lifts the sheet, relative to the nucleus radius.
const LIFTED: f64 = 2.4;

/// Increase of thickness there, relative to the density of the endoplasm: matched by eye to real cells.
const LIFT: f32 = 2.2;

/// Steps of a radial ramp.
const STEPS: usize = 6;

/// Returns a ramp: 1 inside a polygon scaled by `inner` about `centre`, 0 outside the polygon scaled by `outer`, with
/// equal steps between.
fn ramp(like: &Tile, polygon: &[Point], centre: Point, inner: f64, outer: f64) -> Tile {
    let scaled = |step: usize| {
        let factor = inner + (outer - inner) * (step as f64 + 0.5) / STEPS as f64;
        scaled_about(polygon, centre, factor)
    };
    let mut ramp = like.blank();
    ramp.add_covers((0..STEPS).map(scaled), 1.0 / STEPS as f32);
    ramp
}

/// Adds the endoplasm: the granular inner part of the cytoplasm, denser than the outer part.
pub(super) fn add_endoplasm(absorbance: &mut Tile, outline: &[Point], nucleus: Point, cell: &CellContext<'_>) {
    let CellContext { body, noise_fields, .. } = *cell;
    if body.detail.endoplasm <= 0.0 {
        return;
    }
    let (pixel_um, rng) = (cell.pixel_um(), &mut cell.stream("endoplasm"));
    let size = random::between(0.45, 0.75, rng);
    let softness = random::between(0.08, 0.3, rng);
    let zone = ramp(absorbance, outline, nucleus, size - softness, size + softness);
    // Densest where the nucleus lifts the sheet.
    let radius = body.nucleus.radius_um / pixel_um;
    let round = perturbed_circle(radius, 0.15, 0.15, rng);
    let round: Vec<Point> = round.iter().map(|p| [p[0] + nucleus[0], p[1] + nucleus[1]]).collect();
    let near = Tile::around(&scaled_about(&round, nucleus, LIFTED), 1.0);
    let lifted = ramp(&near, &round, nucleus, 1.0, LIFTED);
    let lift = LIFT * body.detail.endoplasm as f32;
    absorbance.blend(&lifted, |values, ramp| {
        values.iter_mut().zip(ramp).for_each(|(value, ramp)| *value *= 1.0 + lift * ramp);
    });
    let grain = FieldSampler::fine(pixel_um, rng);
    let density = body.detail.endoplasm as f32;
    let width = absorbance.width;
    let mut field = vec![0.0_f32; width];
    let mut texels: Texels = [0.0; SIDE + 1];
    let rows = absorbance.values.chunks_exact_mut(width).zip(zone.values.chunks_exact(width));
    for (y, (row, zone)) in rows.enumerate() {
        let Some((first, end)) = covered(zone) else { continue };
        let field = &mut field[..end - first];
        noise_fields.grain().row_into(field, &grain, [first as f64, y as f64], &mut texels);
        for ((value, inside), noise) in row[first..end].iter_mut().zip(&zone[first..end]).zip(field) {
            *value *= 1.0 + inside * (density + density * noise.max(0.0));
        }
    }
}

/// Applies the halo of a koilocyte: the cleared space around the nucleus and the condensed cytoplasm at its edge.
pub(super) fn add_halo(absorbance: &mut Tile, nucleus: Point, cell: &CellContext<'_>) {
    /// Outer radius of the condensed rim, relative to the cleared space.
    const RIM: f64 = 1.35;
    let Some(halo) = cell.body.halo else { return };
    let edge = perturbed_circle(halo.radius_um / cell.pixel_um(), 0.12, 0.10, &mut cell.stream("halo"));
    let edge: Vec<Point> = edge.iter().map(|p| [nucleus[0] + 1.15 * p[0], nucleus[1] + 0.87 * p[1]]).collect();
    let near = Tile::around(&scaled_about(&edge, nucleus, RIM), 1.0);
    let clear = ramp(&near, &edge, nucleus, 0.88, 1.0);
    let mut factor = ramp(&near, &edge, nucleus, 1.0, RIM);
    for (factor, clear) in factor.values.iter_mut().zip(&clear.values) {
        *factor = (1.0 + halo.rim as f32 * (*factor - clear)) * (1.0 - halo.clearing as f32 * clear);
    }
    absorbance.blend(&factor, |values, factors| {
        values.iter_mut().zip(factors).for_each(|(value, factor)| *value *= factor);
    });
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::phantom::tile::tests::{at, disc};

    #[test]
    fn thin_rim_matches_the_local_mean_of_the_coverage() {
        let mut cover = Tile { origin: [3, -7], width: 31, values: vec![0.0; 31 * 27] };
        cover.cover(&disc([17.0, 5.0], 11.0));
        let radius = 4_i64;
        let mut thin = Tile { values: vec![1.0; 31 * 27], ..cover.clone() };
        thin_rim(&mut thin, &cover, 4.0);
        thin.for_each(|p, found| {
            let [x, y] = p.map(|at| at as i64);
            let around = (y - radius..=y + radius).flat_map(|y| (x - radius..=x + radius).map(move |x| [x, y]));
            let sum: f64 = around.map(|p| f64::from(at(&cover, p))).sum();
            let inside = (2.0 * sum / 81.0 - 1.0).clamp(0.0, 1.0);
            assert!((f64::from(*found) - inside * (2.0 - inside)).abs() < 1e-5, "{x} {y}: {found}");
        });
    }

    #[test]
    fn a_ramp_is_the_mean_of_scaled_coverages() {
        let like = Tile { origin: [-20, -20], width: 41, values: vec![0.0; 41 * 41] };
        let (polygon, centre) = (disc([1.0, 0.5], 12.0), [0.0, 0.0]);
        let ramp = ramp(&like, &polygon, centre, 0.6, 1.4);
        let mut mean = like.blank();
        for step in 0..STEPS {
            let mut cover = like.blank();
            cover.cover(&scaled_about(&polygon, centre, 0.6 + 0.8 * (step as f64 + 0.5) / STEPS as f64));
            mean.values.iter_mut().zip(&cover.values).for_each(|(mean, share)| *mean += share / STEPS as f32);
        }
        for (a, b) in ramp.values.iter().zip(&mean.values) {
            assert!((a - b).abs() < 1e-5, "{a} {b}");
        }
        assert!((ramp.values[20 * 41 + 20] - 1.0).abs() < 1e-5);
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
