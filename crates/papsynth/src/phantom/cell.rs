//! Epithelial cells: outline, sheet, folds, and the three levels of detail ("Squamous Intermediate Cell Phantoms").

use cloth_verlet::{Crease, Sheet, Turn, View, crease_outline};
use multiversion::multiversion;
use voronoi_cytoskeleton::{LineParams, draw_into};

use super::chromatin::interpolate;
use super::nucleus;
use super::pools::{Look, Pools, SIDE, Texels};
use super::studio::{ClassStudio, Studio};
use super::tile::{Point, Tile, area};
use super::{Phantom, Piece};
use crate::key::Stream;
use crate::random;
use crate::scene::{CellBody, Fold, FoldForm, Object, Scene};
use crate::truth::Part;

/// Points of a cell's outline before its rim is roughened.
const POINTS: usize = 180;

/// Radius of a granule, µm (the standard deviation of its absorbance).
const GRANULE_UM: f64 = 0.28;

/// Absorbance of a granule relative to the cytoplasm's.
const GRANULE: f64 = 0.75;

/// Largest angle between the two creases of a cell that is folded from both sides, radians.
const SKEW: f64 = 0.45;

/// Distance between the points of a roughened rim, µm.
const RIM_STEP_UM: f64 = 0.375;

/// Makes cells, sixteen sheets at a time.
pub(super) fn make(
    studio: &Studio,
    scene: &Scene,
    pools: &Pools<'_>,
    cells: &[(&Object, &CellBody)],
) -> Result<Vec<Phantom>, String> {
    let plans =
        cells.iter().map(|(object, body)| Plan::new(studio, scene, object, body)).collect::<Result<Vec<_>, _>>()?;
    let sheets = crumple(studio, scene, cells, &plans)?;
    cells
        .iter()
        .zip(plans)
        .zip(sheets)
        .map(|(((object, body), plan), sheet)| finish(studio, scene, pools, object, body, plan, sheet))
        .collect()
}

/// A cell before it has a sheet.
struct Plan<'a> {
    class: &'a ClassStudio,
    centre: Point,
    outline: Vec<Point>,
    nucleus: Piece,
    creases: Vec<Crease>,
}

impl<'a> Plan<'a> {
    fn new(studio: &'a Studio, scene: &Scene, object: &Object, body: &CellBody) -> Result<Self, String> {
        let class = studio
            .classes
            .get(&body.class)
            .ok_or_else(|| format!("the scene holds a cell of class `{}`, which its recipe does not", body.class))?;
        let mut rng = scene.key.stream("cell", object.number, "outline");
        let radius_px = body.radius_um / scene.grid().pixel_um;
        let drawn = class.cytoplasm.draw(radius_px, &mut rng).map_err(|e| e.to_string())?;
        let centre = scene.grid().to_px(object.centre_um);
        let outline = drawn.descriptors.outline(POINTS);
        let middle = fsd_shape::centroid(&outline);
        let outline: Vec<Point> =
            outline.iter().map(|p| [p[0] - middle[0] + centre[0], p[1] - middle[1] + centre[1]]).collect();
        let nucleus = nucleus::make(studio, class, scene, object, body, centre)?;
        let creases = body.fold.map_or(Vec::new(), |fold| creases(fold, &outline, centre, body, scene));
        Ok(Self { class, centre, outline, nucleus, creases })
    }
}

/// The lines along which a cell is folded, each with its side turned in.
fn creases(fold: Fold, outline: &[Point], centre: Point, body: &CellBody, scene: &Scene) -> Vec<Crease> {
    let radius = (area(outline) / core::f64::consts::PI).sqrt();
    let off_centre = body.nucleus.off_centre.map(|share| share * body.radius_um / scene.grid().pixel_um);
    let nucleus_radius = body.nucleus.radius_um / scene.grid().pixel_um;
    let crease = |direction: f64| {
        let normal = [libm::cos(direction), libm::sin(direction)];
        let reach =
            outline.iter().map(|p| (p[0] - centre[0]) * normal[0] + (p[1] - centre[1]) * normal[1]).fold(0.0, f64::max);
        // The crease passes clear of the nucleus, which is too stiff to fold.
        let nucleus_at = off_centre[0] * normal[0] + off_centre[1] * normal[1];
        let at = (reach - fold.depth * radius).max(nucleus_at + 1.3 * nucleus_radius);
        let turn = match fold.form {
            FoldForm::Flap | FoldForm::Cigar => Turn::Flap,
            FoldForm::Roll => Turn::Roll { turns: 1 },
        };
        Crease {
            point: [centre[0] + at * normal[0], centre[1] + at * normal[1]],
            // The line runs a quarter turn before the direction that leads beyond it.
            direction_rad: direction - core::f64::consts::FRAC_PI_2,
            radius: fold.radius_um / scene.grid().pixel_um,
            turn,
        }
    };
    // Away from the nucleus there is more to fold.
    let mut direction = fold.direction_deg.to_radians();
    if off_centre[0] * libm::cos(direction) + off_centre[1] * libm::sin(direction) > 0.0 {
        direction += core::f64::consts::PI;
    }
    match fold.form {
        // The second side is never turned in quite parallel to the first.
        FoldForm::Cigar => {
            vec![crease(direction), crease(direction + core::f64::consts::PI + SKEW * libm::sin(7.0 * direction))]
        }
        FoldForm::Flap | FoldForm::Roll => vec![crease(direction)],
    }
}

/// Presses the sheets of all cells, those with meshes of the same excess together.
fn crumple(
    studio: &Studio,
    scene: &Scene,
    cells: &[(&Object, &CellBody)],
    plans: &[Plan],
) -> Result<Vec<Option<Sheet>>, String> {
    let mut sheets: Vec<Option<Sheet>> = plans.iter().map(|_| None).collect();
    let choice: Vec<usize> = cells.iter().map(|(_, body)| studio.cloth(body.detail.excess)).collect();
    for (index, (_, cloth)) in studio.cloths.iter().enumerate() {
        let chosen: Vec<usize> = (0..cells.len()).filter(|&i| choice[i] == index).collect();
        let outlines: Vec<&[Point]> = chosen.iter().map(|&i| plans[i].outline.as_slice()).collect();
        let mut streams: Vec<Stream> =
            chosen.iter().map(|&i| scene.key.stream("cell", cells[i].0.number, "sheet")).collect();
        for (&i, sheet) in chosen.iter().zip(cloth.crumple_many(&outlines, &mut streams)) {
            sheets[i] = Some(sheet.map_err(|e| e.to_string())?);
        }
    }
    Ok(sheets)
}

/// Presses, folds and stains a cell. Its absorbance is that of a dye along the light's path (Eq. 12): A = κ·c·l, where
/// l is the sheet's thickness and κ·c the cell's stain.
fn finish(
    studio: &Studio,
    scene: &Scene,
    pools: &Pools<'_>,
    object: &Object,
    body: &CellBody,
    plan: Plan,
    sheet: Option<Sheet>,
) -> Result<Phantom, String> {
    let mut rng = scene.key.stream("cell", object.number, "detail");
    let pixel_um = scene.grid().pixel_um;
    let mut pieces = vec![plan.outline.clone()];
    for crease in &plan.creases {
        let folded = pieces.iter().map(|piece| crease_outline(piece, crease)).collect::<Result<Vec<_>, _>>();
        pieces = folded.map_err(|e| e.to_string())?.concat();
    }
    let rough: Vec<Vec<Point>> =
        pieces.iter().map(|p| roughened(p, body.detail.fray_um / pixel_um, RIM_STEP_UM / pixel_um, &mut rng)).collect();
    let mut coverage = Tile::around(rough.iter().flatten(), 3.0);
    for piece in &rough {
        coverage.cover(piece);
    }

    let profile = &plan.class.class.cytoplasm.rim_to_centre;
    let mut absorbance = coverage.blank();
    match sheet {
        Some(mut sheet) => {
            for crease in &plan.creases {
                sheet.fold(crease).map_err(|e| e.to_string())?;
            }
            let view = View { origin: [absorbance.origin[0] as f64, absorbance.origin[1] as f64], pixel: 1.0 };
            sheet.thickness_into(&mut absorbance.values, coverage.width, &view, |radius| {
                interpolate(profile, 1.0 - radius)
            });
        }
        None => flat(&mut absorbance, &coverage, profile, plan.centre, body.radius_um / pixel_um),
    }
    add_detail(&mut absorbance, &coverage, body, pools, pixel_um, &mut rng);
    if body.detail.cytoskeleton > 0.0 {
        add_cytoskeleton(studio, &mut absorbance, &plan.outline, body.detail.cytoskeleton, pixel_um, &mut rng)?;
    }
    add_granules(&mut absorbance, &coverage, body.detail.granules, pixel_um, &mut rng);
    for (value, cover) in absorbance.values.iter_mut().zip(&coverage.values) {
        // Eq. 12: A = κ·c·l.
        *value *= cover * body.cytoplasm_absorbance.max(super::LEAST_ABSORBANCE) as f32;
    }
    let area_px = coverage.values.iter().map(|v| f64::from(*v)).sum();
    let phase_rad = body.phase_rad / body.cytoplasm_absorbance.max(super::LEAST_ABSORBANCE);
    let dyes = body.dyes;
    let cytoplasm = Piece { part: Part::Cytoplasm, absorbance, coverage, area_px, imaged: false, dyes, phase_rad };
    Ok(Phantom { pieces: vec![cytoplasm, plan.nucleus], traits: traits(body) })
}

fn traits(body: &CellBody) -> Vec<&'static str> {
    let fold = body.fold.map(|fold| match fold.form {
        FoldForm::Flap => "flap",
        FoldForm::Roll => "rolled",
        FoldForm::Cigar => "folded",
    });
    let granular = (body.detail.granules > 0.0).then_some("granular");
    let pyknotic = body.nucleus.pyknotic.then_some("pyknotic");
    let wrinkled = (body.nucleus.wrinkle > 0.0).then_some("wrinkled");
    [fold, granular, pyknotic, wrinkled].into_iter().flatten().collect()
}

/// A sheet without folds: thick in the middle, thin at the rim.
fn flat(absorbance: &mut Tile, coverage: &Tile, profile: &[f64], centre: Point, radius: f64) {
    let cover = &coverage.values;
    let mut index = 0;
    absorbance.for_each(|p, value| {
        if cover[index] > 0.0 {
            let (dx, dy) = (p[0] - centre[0], p[1] - centre[1]);
            *value = interpolate(profile, 1.0 - ((dx * dx + dy * dy).sqrt() / radius).min(1.0)) as f32;
        }
        index += 1;
    });
}

/// An outline whose points are pushed in and out a little, finely and unevenly: the frayed rim of a real cell.
fn roughened(outline: &[Point], depth_px: f64, step_px: f64, rng: &mut Stream) -> Vec<Point> {
    if depth_px < 0.05 || outline.len() < 3 {
        return outline.to_vec();
    }
    let count = random::count(fsd_shape::perimeter(outline) / step_px).max(outline.len());
    let fine = fsd_shape::resample(outline, count);
    // Slow waves say where the rim is frayed, quick ones how: a first-order autoregression of either.
    let (mut slow, mut quick) = (random::normal(rng), random::normal(rng));
    let step = |state: f64, memory: f64, rng: &mut Stream| {
        memory * state + (1.0 - memory * memory).sqrt() * random::normal(rng)
    };
    (0..count)
        .map(|i| {
            slow = step(slow, 0.985, rng);
            quick = step(quick, 0.6, rng);
            let [before, here, after] = [fine[(i + count - 1) % count], fine[i], fine[(i + 1) % count]];
            let (tx, ty) = (after[0] - before[0], after[1] - before[1]);
            let length = (tx * tx + ty * ty).sqrt().max(1e-9);
            let push = (0.5 * depth_px * quick * (0.35 + slow.max(0.0))).clamp(-2.0 * depth_px, 2.0 * depth_px);
            [here[0] + push * ty / length, here[1] - push * tx / length]
        })
        .collect()
}

/// The first two levels of detail, and the grain: factors on the thickness.
fn add_detail(
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
fn add_cytoskeleton(
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
fn add_granules(absorbance: &mut Tile, coverage: &Tile, per_100_um2: f64, pixel_um: f64, rng: &mut Stream) {
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
