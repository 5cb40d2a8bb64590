//! Draws a scene from a recipe and a key.

use std::collections::BTreeMap;

use crate::debris::placement::{CellPosition, Field, PlacedObject, PlotDensity};
use crate::debris::{Body, Debris};
use crate::error::{Error, ErrorKind};
use crate::key::Key;
use crate::model::Model;
use crate::random;
use crate::recipe::section::named;
use crate::recipe::{Abundance, FocusOutput, Illumination, LightSection, Optics, Recipe};

use super::cells::{Cells, Crowding, draw_cells};
use super::field::{Object, Scene};
use super::imaging::{Fusion, Restoration, SceneBackground, SceneIllumination, SceneLight, SceneOptics};
use super::stain::FieldStain;
use super::view::{FieldNumbers, Region, View};
use super::weight::WeightMap;

/// Maximum number of draws of the objects of a field. The last draw leaves out cells that do not fit.
pub const MAX_ATTEMPTS: u32 = 8;

/// Draws the objects of a field and how it is imaged.
///
/// `weight_map` is the image at the `path` of the layout, if it has one. If the cells do not fit, the objects are drawn
/// again, with at most [`MAX_ATTEMPTS`] draws in total. The last draw leaves out cells that do not fit.
///
/// # Errors
/// If no draw can succeed: the weight map is missing or too uneven, or there are more objects than labels can number.
pub fn draw(recipe: &Recipe, model: &Model, weight_map: Option<&WeightMap>, key: Key) -> Result<Scene, Error> {
    let condition = recipe.condition_of_slide(key.seed, slide_of(recipe, key));
    draw_under(condition, recipe, model, weight_map, key)
}

/// As [`draw`], under a given condition of the recipe.
pub(crate) fn draw_under(
    condition: Option<usize>,
    recipe: &Recipe,
    model: &Model,
    weight_map: Option<&WeightMap>,
    key: Key,
) -> Result<Scene, Error> {
    let slide = slide_of(recipe, key);
    let recipe = &*recipe.under(condition);
    let field = FieldNumbers { key };
    let view = View {
        width: field.count(named!(recipe.field.width_px)),
        height: field.count(named!(recipe.field.height_px)),
        pixel_um: pixel_um(recipe, &field),
    };
    let fail = |cause| Error::Image { index: key.index, cause };
    let stain = FieldStain::draw(&recipe.stain, &field, slide);
    let draw_cells = |attempt: u32, crowding: Crowding| {
        let numbers = FieldNumbers { key: key.attempt(attempt) };
        let cells = draw_cells(recipe, model, weight_map, view, &numbers, &stain, crowding)?;
        Ok((attempt, numbers, cells))
    };
    let is_crowded = |cause: &ErrorKind| {
        matches!(cause, ErrorKind::NoRoom { .. } | ErrorKind::Crowded { .. } | ErrorKind::TooUneven { .. })
    };
    let mut drawn = draw_cells(0, Crowding::Error);
    for attempt in 1..MAX_ATTEMPTS {
        if !drawn.as_ref().is_err_and(is_crowded) {
            break;
        }
        let crowding = if attempt + 1 < MAX_ATTEMPTS { Crowding::Error } else { Crowding::LeaveOut };
        drawn = draw_cells(attempt, crowding);
    }
    let (attempt, numbers, Cells { mut objects, field: area, region, counts }) = drawn.map_err(fail)?;
    add_debris(&recipe.debris, [area, region], &numbers, &stain, None, &mut objects);
    // Objects of a density are kept only if their blurred image touches the field.
    objects.retain(|object| {
        let abundance = match &object.body {
            Body::Cell(cell) => recipe.cells.get(&cell.class).map(|mix| &mix.count),
            other => recipe.debris.abundance(other.kind()),
        };
        // The blur of an object out of focus has about the radius of its depth.
        let reach_um = object.body.reach_um(view.pixel_um) + object.depth_um.abs();
        !abundance.is_some_and(Abundance::is_density) || area.touches(object.centre_um, reach_um)
    });
    if u32::try_from(objects.len()).is_err() {
        return Err(fail(ErrorKind::TooManyObjects(objects.len())));
    }
    for (id, object) in (1_u32..).zip(&mut objects) {
        object.id = id;
    }
    Ok(Scene { objects, slide, condition, attempts: attempt + 1, cells: counts, ..empty(recipe, view, &field, &stain) })
}

/// Adds debris to the objects in the field and its margin, and draws the bacteria on clue cells. On a slide,
/// `plot_density` selects the debris of one plot.
pub(super) fn add_debris(
    debris: &Debris,
    [field, region]: [Region; 2],
    numbers: &FieldNumbers,
    stain: &FieldStain<'_>,
    plot_density: Option<PlotDensity<'_>>,
    objects: &mut Vec<Object>,
) {
    debris.clue_cells.draw(numbers, objects.iter_mut().map(|cell| (cell.number, &mut cell.coat)));
    let place = |object: &Object| match &object.body {
        Body::Cell(body) => {
            let (centre_um, depth_um) = (object.centre_um, object.depth_um);
            Some(CellPosition { centre_um, depth_um, radius_um: body.radius_um })
        }
        _ => None,
    };
    let is_inside = |cell: &CellPosition| field.touches(cell.centre_um, 0.0);
    let (mut cells, outside): (Vec<_>, Vec<_>) = objects.iter().filter_map(place).partition(is_inside);
    let cells_in_field = cells.len();
    cells.extend(outside);
    let placed = debris.draw(&Field { field, region, numbers, stain, cells, cells_in_field, plot_density });
    objects.extend(placed.into_iter().map(|PlacedObject { number, cluster, placement, body }| Object {
        id: 0,
        number,
        cluster,
        plot: None,
        centre_um: placement.centre_um,
        depth_um: placement.depth_um,
        rotation_deg: placement.rotation_deg,
        bethesda: String::new(),
        coat: None,
        body,
    }));
}

/// Returns the number of the slide of an image.
fn slide_of(recipe: &Recipe, key: Key) -> u64 {
    key.index / recipe.slide.fields_per_slide.max(1) as u64
}

/// Returns the scene without objects.
pub(super) fn empty(recipe: &Recipe, view: View, field: &FieldNumbers, stain: &FieldStain<'_>) -> Scene {
    let (planes_um, fusion) = planes(recipe, field);
    Scene {
        key: field.key,
        slide: 0,
        condition: None,
        view,
        planes_um,
        fusion,
        background: background(recipe, field),
        light: light(recipe, field),
        optics: optics(recipe, field),
        restoration: Restoration {
            restore: recipe.nucleus.restore,
            feather_um: field.draw(named!(recipe.nucleus.restore_feather_um)),
        },
        dyes: stain.debris(),
        camera: recipe.camera.draw("camera", |path| field.stream(path)),
        frame: None,
        attempts: 1,
        cells: BTreeMap::new(),
        objects: Vec::new(),
    }
}

pub(super) fn pixel_um(recipe: &Recipe, field: &FieldNumbers) -> f64 {
    let magnification = field.draw(named!(recipe.field.magnification));
    if magnification <= 0.0 {
        return field.draw(named!(recipe.field.pixel_um));
    }
    let binning = field.count(named!(recipe.camera.binning_px)).max(1);
    field.draw(named!(recipe.camera.pixel_um)) * binning as f64 / magnification
}

/// Returns the positions of the planes; for an EDF image the central position, and the planes that are fused.
fn planes(recipe: &Recipe, field: &FieldNumbers) -> (Vec<f64>, Option<Fusion>) {
    let focus = recipe.focus.draw("focus", |path| field.stream(path));
    let middle = f64::from(focus.planes - 1) / 2.0;
    if focus.output == FocusOutput::Planes {
        let travel = |plane| focus.centre_um + (f64::from(plane) - middle) * focus.step_um;
        return ((0..focus.planes).map(travel).collect(), None);
    }
    let fusion = Fusion {
        first_um: focus.centre_um - middle * focus.step_um,
        step_um: focus.step_um,
        planes: focus.planes as usize,
        noise_correlation: [focus.noise_correlation_x, focus.noise_correlation_y],
        noise_skew: focus.noise_correlation_diagonal,
        reduction: focus.reduction,
        column_pattern: focus.column_pattern,
    };
    (vec![focus.centre_um], Some(fusion))
}

fn light(recipe: &Recipe, field: &FieldNumbers) -> SceneLight {
    match &recipe.light {
        LightSection::Monochrome(light) => SceneLight::Monochrome {
            wavelength_um: field.draw(named!("light", light.wavelength_um)),
            bandwidth_um: field.draw(named!("light", light.bandwidth_um)),
            absorption_variation: field.draw(named!("light", light.absorption_variation)),
        },
        LightSection::Colour(light) => SceneLight::Colour {
            lamp_k: field.draw(named!("light", light.lamp_k)),
            mixing: light.mixing,
            chromatic_um: field.draw(named!("light", light.chromatic_um)),
            rendition: light.rendition,
        },
    }
}

fn optics(recipe: &Recipe, field: &FieldNumbers) -> SceneOptics {
    match &recipe.optics {
        Optics::Gaussian(gaussians) => SceneOptics::Gaussian {
            sigma_xy_um: field.draw(named!("optics", gaussians.sigma_xy_um)),
            sigma_z_um_per_um: field.draw(named!("optics", gaussians.sigma_z_um_per_um)),
        },
        Optics::BrightField(microscope) => {
            SceneOptics::BrightField(microscope.draw("optics", |path| field.stream(path)))
        }
    }
}

fn background(recipe: &Recipe, field: &FieldNumbers) -> SceneBackground {
    let illumination = match &recipe.background.illumination {
        Illumination::Border(border) => {
            SceneIllumination::Border { exponent: field.draw(named!("background.illumination", border.exponent)) }
        }
        Illumination::Quadratic(quadratic) => {
            let distance = field.draw(named!("background.illumination", quadratic.centre_offset));
            let angle = random::direction(&mut field.stream("background.illumination.direction"));
            SceneIllumination::Quadratic {
                falloff_x: field.draw(named!("background.illumination", quadratic.falloff_x)),
                falloff_y: field.draw(named!("background.illumination", quadratic.falloff_y)),
                centre: [distance * libm::cos(angle), distance * libm::sin(angle)],
            }
        }
    };
    SceneBackground {
        level: field.draw(named!(recipe.background.level)),
        illumination,
        texture: field.draw(named!(recipe.background.texture)),
        texture_um: field.draw(named!(recipe.background.texture_um)),
    }
}
