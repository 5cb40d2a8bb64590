//! Epithelial cells: outline, sheet, folds, and the three levels of detail (paper, section "Squamous Intermediate Cell
//! Phantoms").

use cloth_verlet::{Crease, FoldKind, PixelGrid, Sheet, SheetSpec, Wave, crease_outline};

mod autoregression;
mod coarse_tile;
mod degeneration;
mod detail;
mod endoplasm;
mod fine_texture;
mod halo;
mod outline;
mod ridges;
mod rim;
mod specks;
mod wrinkles;

use wrinkles::Wrinkles;

use crate::error::ErrorKind;
use crate::key::Stream;
use crate::phantom::assets::{ClassAssets, PhantomAssets};
use crate::phantom::cell_context::CellContext;
use crate::phantom::chromatin::interpolate;
use crate::phantom::nucleus;
use crate::phantom::piece::{MIN_ABSORBANCE, Phantom, Piece};
use crate::phantom::tile::{Point, Tile, area, radius_of};
use crate::profile::Stage;
use crate::random;
use crate::scene::cell::{CellBody, Fold, FoldForm, NucleusBody, stretched};
use crate::truth::part::Part;
use crate::truth::traits::Trait;

/// Points of a cell outline before its rim is roughened.
const POINTS: usize = 180;

/// Largest angle between the two creases of a cell folded from both sides, radians.
const SKEW: f64 = 0.45;

/// Periods of this angle over a full turn of the direction of the first crease. The direction is random, so the angle
/// needs no random number of its own.
const SKEW_PERIODS: f64 = 7.0;

/// Smallest distance of a crease, with its waves, from the centre of the nucleus, in radii of the nucleus.
const NUCLEUS_CLEARANCE: f64 = 1.3;

/// Waves of a crease: amplitude relative to that of the recipe; shortest and longest wavelength in radii of the cell.
const WAVES: [[f64; 3]; 2] = [[1.0, 0.8, 1.8], [0.3, 0.3, 0.6]];

/// Distance between the points of a roughened rim, µm.
const RIM_STEP_UM: f64 = 0.375;

/// Largest width of the zone in which a folded cell becomes thinner towards its edge, µm. In EDF images of Cervix93,
/// the steepest edges are those of nuclei, and folded edges of cells are softer.
const FOLD_EDGE_UM: f64 = 2.0;

/// Draws cells; sheets are simulated in batches.
pub(super) fn make(assets: &PhantomAssets, cells: &[CellContext<'_>]) -> Result<Vec<Phantom>, ErrorKind> {
    let plans = cells.iter().map(CellPlan::new).collect::<Result<Vec<_>, _>>()?;
    let sheets = assets.timer.time(Stage::Sheets, || crumple(assets, cells, &plans))?;
    let finished = |((cell, plan), sheet): ((&CellContext<'_>, CellPlan), Option<Sheet>)| finish(cell, plan, sheet);
    assets.timer.time(Stage::Cytoplasm, || cells.iter().zip(plans).zip(sheets).map(finished).collect())
}

/// A cell before the simulation of its sheet.
struct CellPlan<'a> {
    class: &'a ClassAssets,
    centre: Point,
    outline: Vec<Point>,
    nucleus: Piece,
    creases: Vec<Crease>,
}

impl<'a> CellPlan<'a> {
    fn new(cell: &CellContext<'a>) -> Result<Self, ErrorKind> {
        let CellContext { assets, scene, object, body, .. } = *cell;
        let class = assets.classes.get(&body.class).ok_or_else(|| ErrorKind::ForeignClass(body.class.clone()))?;
        let centre = scene.sheet_grid().to_px(object.centre_um);
        let outline = assets.timer.time(Stage::Outlines, || outline(cell, class, centre))?;
        let nucleus = assets.timer.time(Stage::Nuclei, || nucleus::make(cell, class))?;
        let creases = body.fold.map_or(Vec::new(), |fold| creases(cell, fold, &outline, centre));
        Ok(Self { class, centre, outline, nucleus, creases })
    }
}

/// Draws the outline of a cell before its rim is roughened.
fn outline(cell: &CellContext<'_>, class: &ClassAssets, centre: Point) -> Result<Vec<Point>, ErrorKind> {
    let mut rng = cell.stream("outline");
    let radius_px = cell.body.radius_um / cell.pixel_um();
    let formed = class.cytoplasm(radius_px, &mut rng)?;
    let rotation = cell.object.rotation_deg.to_radians();
    let outline = formed.rotated(rotation).outline(POINTS);
    let middle = fsd_shape::centroid(&outline);
    let about = |p: &Point| stretched([p[0] - middle[0], p[1] - middle[1]], cell.body.detail.elongation, rotation);
    let outline: Vec<Point> = outline.iter().map(about).map(|[x, y]| [x + centre[0], y + centre[1]]).collect();
    let detail = &cell.body.detail;
    let shaped = outline::shaped(outline, detail, &mut cell.stream("outline.corners"));
    Ok(outline::wavy(shaped, outline::fray_um(detail), cell.pixel_um(), &mut cell.stream("outline.waves")))
}

/// Returns the creases along which a cell is folded.
fn creases(cell: &CellContext<'_>, fold: Fold, outline: &[Point], centre: Point) -> Vec<Crease> {
    let radius = radius_of(area(outline));
    let (body, pixel_um) = (cell.body, cell.pixel_um());
    let off_centre = body.nucleus.off_centre.map(|fraction| fraction * body.radius_um / pixel_um);
    let nucleus_radius = body.nucleus.radius_um / pixel_um;
    let mut rng = cell.stream("creases");
    let mut crease = |direction: f64| {
        let normal = [libm::cos(direction), libm::sin(direction)];
        let reach =
            outline.iter().map(|p| (p[0] - centre[0]) * normal[0] + (p[1] - centre[1]) * normal[1]).fold(0.0, f64::max);
        // The nucleus is too stiff to fold, so the crease with its waves keeps a distance from it.
        let nucleus_at = off_centre[0] * normal[0] + off_centre[1] * normal[1];
        let waves = fold.waviness * radius * WAVES.iter().map(|wave| wave[0]).sum::<f64>();
        let at = (reach - fold.depth * radius).max(nucleus_at + NUCLEUS_CLEARANCE * nucleus_radius + waves);
        let kind = match fold.form {
            FoldForm::Flap | FoldForm::FoldedOver => FoldKind::Flap,
            FoldForm::Roll => FoldKind::Roll { turns: 1 },
        };
        Crease {
            point: [centre[0] + at * normal[0], centre[1] + at * normal[1]],
            // The crease is perpendicular to the direction of the fold.
            direction_rad: direction - core::f64::consts::FRAC_PI_2,
            curvature: fold.curvature / radius,
            waves: WAVES.map(|[amplitude, shortest, longest]| Wave {
                amplitude: amplitude * fold.waviness * radius,
                wave_number: core::f64::consts::TAU / (random::between(shortest, longest, &mut rng) * radius),
                phase_rad: random::between(0.0, core::f64::consts::TAU, &mut rng),
            }),
            radius: fold.radius_um / pixel_um,
            kind,
        }
    };
    // Folds on the side away from the nucleus, which has more room.
    let mut direction = fold.direction_deg.to_radians();
    if off_centre[0] * libm::cos(direction) + off_centre[1] * libm::sin(direction) > 0.0 {
        direction += core::f64::consts::PI;
    }
    match fold.form {
        // The two creases are not exactly parallel.
        FoldForm::FoldedOver => {
            let skew = SKEW * libm::sin(SKEW_PERIODS * direction);
            vec![crease(direction), crease(direction + core::f64::consts::PI + skew)]
        }
        FoldForm::Flap | FoldForm::Roll => vec![crease(direction)],
    }
}

/// Returns the longest part of the outline of a folded cell that lies on the crease of a flap.
fn edge_of_flap(pieces: &[Vec<Point>], crease: &Crease) -> Option<Vec<Point>> {
    /// Smallest distance of the edge beyond the crease, in bending radii.
    const ON_EDGE: f64 = 0.9;
    if crease.kind != FoldKind::Flap {
        return None;
    }
    let inside = |p: &Point| crease.distance_beyond(*p) < ON_EDGE * crease.radius;
    let parts = |piece: &Vec<Point>| {
        // An edge does not begin in the middle of a part.
        let first = piece.iter().position(inside).unwrap_or(0);
        let around: Vec<Point> = piece.iter().cycle().skip(first).take(piece.len() + 1).copied().collect();
        around.split(inside).filter(|part| part.len() > 1).map(<[Point]>::to_vec).collect::<Vec<_>>()
    };
    pieces.iter().flat_map(parts).max_by(|a, b| length(a).total_cmp(&length(b)))
}

/// Returns the length of a path.
fn length(path: &[Point]) -> f64 {
    path.windows(2).map(|ends| libm::hypot(ends[1][0] - ends[0][0], ends[1][1] - ends[0][1])).sum()
}

fn crumple(
    assets: &PhantomAssets,
    cells: &[CellContext<'_>],
    plans: &[CellPlan],
) -> Result<Vec<Option<Sheet>>, ErrorKind> {
    let Some(cloth) = &assets.cloth else { return Ok(plans.iter().map(|_| None).collect()) };
    let jobs = cells.iter().zip(plans);
    let jobs = jobs.map(|(cell, plan)| SheetSpec { outline: &plan.outline, area_ratio: cell.body.detail.excess_area });
    let mut streams: Vec<Stream> = cells.iter().map(|cell| cell.stream("sheet")).collect();
    let sheets = cloth.crumple_each(&jobs.collect::<Vec<_>>(), &mut streams);
    sheets.into_iter().map(|sheet| Ok(Some(sheet?))).collect()
}

/// Folds the sheet of a cell and computes its absorbance along the light path (Eq. 12): A = κ·c·l.
///
/// l is the thickness of the sheet and κ·c the absorbance of the cytoplasm.
fn finish(cell: &CellContext<'_>, plan: CellPlan, sheet: Option<Sheet>) -> Result<Phantom, ErrorKind> {
    let CellContext { scene, body, .. } = *cell;
    let mut rng = cell.stream("detail");
    let outlines = folded_outlines(&plan)?;
    let edges: Vec<Vec<Point>> = plan.creases.iter().filter_map(|crease| edge_of_flap(&outlines, crease)).collect();
    let wrinkles = Wrinkles::new(&plan.outline, &edges, cell);
    let coverage = covered_area(&outlines, &plan.creases, &wrinkles, cell, &mut rng);
    let mut thickness = sheet_thickness(&plan, sheet, &coverage, cell)?;
    add_details(&mut thickness, &coverage, &plan, &wrinkles, cell, &mut rng)?;
    // Eq. 12: A = κ·c·l.
    let mut absorbance = thickness;
    let strength = body.cytoplasm_absorbance.max(MIN_ABSORBANCE) as f32;
    absorbance.values.iter_mut().zip(&coverage.values).for_each(|(value, cover)| *value *= cover * strength);
    let step = scene.grid().width / scene.sheet_grid().width;
    let NucleusBody { absorbance: level, displacement, .. } = body.nucleus;
    displace(&mut absorbance, &plan.nucleus.absorbance.coarsened(step), level, displacement);
    let area_px = coverage.sum() * (step * step) as f64;
    let phase_rad = body.phase_rad / body.cytoplasm_absorbance.max(MIN_ABSORBANCE);
    let whole = Piece::whole(absorbance, coverage, area_px, body.dyes);
    let cytoplasm = Piece { part: Part::Cytoplasm, step, phase_rad, ..whole };
    Ok(Phantom { pieces: vec![cytoplasm, plan.nucleus], traits: traits(body) })
}

/// Returns the outlines of the parts of a cell after folding: the part that stays, and the flaps on it.
fn folded_outlines(plan: &CellPlan) -> Result<Vec<Vec<Point>>, ErrorKind> {
    let mut outlines = vec![plan.outline.clone()];
    for crease in &plan.creases {
        let folded = outlines.iter().map(|outline| crease_outline(outline, crease)).collect::<Result<Vec<_>, _>>();
        outlines = folded?.concat();
    }
    Ok(outlines)
}

/// Returns the coverage of pixels by a cell whose parts have these outlines, with a rough rim. Creases are smooth.
fn covered_area(
    outlines: &[Vec<Point>],
    creases: &[Crease],
    wrinkles: &Wrinkles,
    cell: &CellContext<'_>,
    rng: &mut Stream,
) -> Tile {
    let pixel_um = cell.pixel_um();
    let roughness = |p: Point| {
        let on_crease = creases.iter().any(|crease| crease.distance_beyond(p) > 0.0);
        if on_crease { 0.0 } else { wrinkles.roughness(p, pixel_um) }
    };
    let (depth_px, step_px) = (outline::fray_um(&cell.body.detail) / pixel_um, RIM_STEP_UM / pixel_um);
    let roughened = |piece: &Vec<Point>| outline::roughened(piece, depth_px, step_px, roughness, rng);
    let rough: Vec<Vec<Point>> = outlines.iter().map(roughened).collect();
    let mut coverage = Tile::around(rough.iter().flatten(), 3.0);
    for piece in &rough {
        coverage.cover(piece);
    }
    coverage
}

/// Returns the thickness of the folded sheet of a cell, which decreases towards the rim. It is relative to the flat
/// sheet.
fn sheet_thickness(
    plan: &CellPlan,
    sheet: Option<Sheet>,
    coverage: &Tile,
    cell: &CellContext<'_>,
) -> Result<Tile, ErrorKind> {
    let (body, pixel_um) = (cell.body, cell.pixel_um());
    let (detail, radius_px) = (&body.detail, body.radius_um / pixel_um);
    let profile = &plan.class.class.cytoplasm.rim_to_centre;
    // Width of the marginal zone in radii of the cell, the unit of `depth`.
    let zone_width = detail.rim_um / body.radius_um;
    let thinned = |depth: f64, thinning: fn(f64) -> f64| {
        interpolate(profile, depth) * if zone_width > 0.0 { thinning(depth / zone_width) } else { 1.0 }
    };
    let mut thickness = coverage.blank();
    // A folded cell is thin at the rim of the sheet, part of which lies on the cell. Its edge, with the creases, is
    // soft in a narrower zone.
    let folded = sheet.is_some() && !plan.creases.is_empty();
    match sheet {
        Some(mut sheet) => {
            for crease in &plan.creases {
                sheet.fold(crease)?;
            }
            let view = PixelGrid { origin: [thickness.origin[0] as f64, thickness.origin[1] as f64], pixel_size: 1.0 };
            let thinning = if folded { rim::thinning } else { rim::beyond_zone };
            let at_radius = |radius| thinned(1.0 - radius, thinning);
            sheet.thickness_into(&mut thickness.values, coverage.width, &view, at_radius);
            ridges::limit_ridges(&mut thickness, detail.ridges, pixel_um);
        }
        None => {
            let at_depth = |depth| thinned(depth, rim::beyond_zone);
            flat(&mut thickness, coverage, plan.centre, radius_px, at_depth);
        }
    }
    detail::apply_gradient(&mut thickness, plan.centre, radius_px, detail.thickness_gradient);
    let zone_um = if folded { detail.rim_um.min(FOLD_EDGE_UM) } else { detail.rim_um };
    rim::thin_rim(&mut thickness, coverage, zone_um / pixel_um);
    rim::slope_rim(&mut thickness, &plan.outline, cell);
    Ok(thickness)
}

/// Adds wrinkles, endoplasm, halo, clouds, texture, fibres, material of degeneration, specks and granules to the
/// thickness of a sheet. Dark material counts as the thickness of cytoplasm that absorbs as much.
fn add_details(
    thickness: &mut Tile,
    coverage: &Tile,
    plan: &CellPlan,
    wrinkles: &Wrinkles,
    cell: &CellContext<'_>,
    rng: &mut Stream,
) -> Result<(), ErrorKind> {
    let (body, pixel_um) = (cell.body, cell.pixel_um());
    let nucleus = [0, 1].map(|axis| plan.centre[axis] + body.nucleus.off_centre[axis] * body.radius_um / pixel_um);
    // An image of zeros for wrinkles, which leave it as it was, then for fibres.
    let mut canvas = vec![0.0; thickness.values.len() + wrinkles::LANES];
    wrinkles.add(thickness, coverage, &mut canvas);
    let inner = endoplasm::add_endoplasm(thickness, &plan.outline, nucleus, cell);
    halo::add_halo(thickness, nucleus, cell);
    detail::add_clouds_and_texture(thickness, coverage, inner, cell, rng)?;
    let lines = &mut canvas[..coverage.values.len()];
    detail::add_cytoskeleton(thickness, &plan.outline, cell, lines, rng)?;
    degeneration::add(thickness, coverage, cell);
    specks::add_specks(thickness, cell);
    specks::add_granules(thickness, body.detail.granules, pixel_um, rng);
    Ok(())
}

/// Removes the cytoplasm that a nucleus displaces, in proportion to the thickness of the nucleus: its absorbance
/// relative to `level`, at most 1.
fn displace(cytoplasm: &mut Tile, nucleus: &Tile, level: f64, displacement: f64) {
    let (per_level, displacement) = (1.0 / level.max(MIN_ABSORBANCE) as f32, displacement as f32);
    cytoplasm.blend(nucleus, |values, nucleus| {
        for (value, nucleus) in values.iter_mut().zip(nucleus) {
            *value *= 1.0 - displacement * (nucleus * per_level).clamp(0.0, 1.0);
        }
    });
}

fn traits(body: &CellBody) -> Vec<Trait> {
    let fold = body.fold.map(|fold| match fold.form {
        FoldForm::Flap => Trait::Flap,
        FoldForm::Roll => Trait::Rolled,
        FoldForm::FoldedOver => Trait::Folded,
    });
    let koilocytic = body.halo.map(|_| Trait::Koilocytic);
    let granular = (body.detail.granules > 0.0).then_some(Trait::Granular);
    let pyknotic = body.nucleus.pyknotic.then_some(Trait::Pyknotic);
    let wrinkled = (body.nucleus.wrinkle > 0.0).then_some(Trait::Wrinkled);
    [fold, koilocytic, granular, pyknotic, wrinkled].into_iter().flatten().collect()
}

/// Writes the thickness of a sheet without folds, a function of the distance from the rim in radii, into a tile.
fn flat(tile: &mut Tile, coverage: &Tile, centre: Point, radius: f64, thickness: impl Fn(f64) -> f64) {
    let cover = &coverage.values;
    let mut index = 0;
    tile.for_each(|p, value| {
        if cover[index] > 0.0 {
            let (dx, dy) = (p[0] - centre[0], p[1] - centre[1]);
            *value = thickness(1.0 - ((dx * dx + dy * dy).sqrt() / radius).min(1.0)) as f32;
        }
        index += 1;
    });
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_edge_of_a_flap_is_on_its_crease() {
        let outline: Vec<Point> = (0..90)
            .map(|k| f64::from(k) / 90.0 * core::f64::consts::TAU)
            .map(|a| [30.0 * libm::cos(a), 20.0 * libm::sin(a)])
            .collect();
        let straight = Crease::straight([12.0, 0.0], -core::f64::consts::FRAC_PI_2, 0.5, FoldKind::Flap);
        let flap = Crease { curvature: 0.01, ..straight };
        let pieces = crease_outline(&outline, &flap).unwrap();
        for crease in [flap, straight] {
            let edge = edge_of_flap(&crease_outline(&outline, &crease).unwrap(), &crease).unwrap();
            assert!(edge.iter().all(|p| (0.45..=0.51).contains(&crease.distance_beyond(*p))), "{edge:?}");
            // Chord of the ellipse.
            assert!((35.0..36.7).contains(&length(&edge)), "{edge:?}");
        }
        assert_eq!(edge_of_flap(&pieces, &Crease { kind: FoldKind::Roll { turns: 1 }, ..flap }), None);
        assert_eq!(edge_of_flap(&[outline], &Crease { point: [100.0, 0.0], ..flap }), None);
    }

    #[test]
    fn a_nucleus_displaces_cytoplasm_in_proportion_to_its_thickness() {
        let mut cytoplasm = Tile { origin: [0, 0], width: 5, values: vec![0.2; 5] };
        let nucleus = Tile { origin: [1, 0], width: 3, values: vec![0.15, 0.3, 0.6] };
        displace(&mut cytoplasm, &nucleus, 0.3, 0.5);
        for (found, expected) in cytoplasm.values.iter().zip([0.2, 0.15, 0.1, 0.1, 0.2]) {
            assert!((found - expected).abs() < 1e-6, "{:?}", cytoplasm.values);
        }
    }
}
