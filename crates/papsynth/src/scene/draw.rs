//! From recipe and key to a scene. No pixel is touched here.

use crate::error::Error;
use crate::key::{Key, Stream};
use crate::model::Model;
use crate::random;
use crate::recipe::{Illumination, Number, Recipe};

use super::cells::draw_cells;
use super::debris::draw_debris;
use super::{Scene, SceneBackground, SceneCamera, SceneIllumination, SceneOptics, View, WeightMap};

/// Draws numbers that belong to a whole field, each from a stream named after its place in the recipe: giving one of
/// them a distribution changes none of the others.
pub(super) struct FieldNumbers {
    pub(super) key: Key,
}

impl FieldNumbers {
    fn stream(&self, path: &str) -> Stream {
        self.key.stream("field", 0, path)
    }

    pub(super) fn draw(&self, path: &str, number: &Number) -> f64 {
        number.draw(&mut self.stream(path))
    }

    pub(super) fn count(&self, path: &str, number: &Number) -> usize {
        number.draw_count(&mut self.stream(path))
    }
}

/// Draws what lies on the slide and how it is imaged.
///
/// `weight_map` is what the layout's `path` names, if it names a file.
///
/// # Errors
/// If the layout has no room for the number of cells asked for.
pub fn draw(recipe: &Recipe, model: &Model, weight_map: Option<&WeightMap>, key: Key) -> Result<Scene, Error> {
    let field = FieldNumbers { key };
    let view = View {
        width: field.count("field.width_px", &recipe.field.width_px),
        height: field.count("field.height_px", &recipe.field.height_px),
        pixel_um: field.draw("field.pixel_um", &recipe.field.pixel_um),
    };
    let fail = |message: String| Error::Image { index: key.index, message };
    let mut objects = draw_cells(recipe, model, weight_map, view, &field).map_err(fail)?;
    draw_debris(recipe, view, &field, &mut objects).map_err(fail)?;
    for (id, object) in (1_u32..).zip(&mut objects) {
        object.id = id;
    }
    Ok(Scene {
        key,
        view,
        planes_um: planes(recipe, &field),
        background: background(recipe, &field),
        optics: SceneOptics {
            sigma_xy_um: field.draw("optics.sigma_xy_um", &recipe.optics.sigma_xy_um),
            sigma_z_um_per_um: field.draw("optics.sigma_z_um_per_um", &recipe.optics.sigma_z_um_per_um),
            restore: recipe.nucleus.restore,
            restore_feather_um: field.draw("nucleus.restore_feather_um", &recipe.nucleus.restore_feather_um),
        },
        camera: SceneCamera {
            bits: u32::try_from(field.count("camera.bits", &recipe.camera.bits)).unwrap_or(8),
            full_well_e: field.draw("camera.full_well_e", &recipe.camera.full_well_e),
            read_noise_e: field.draw("camera.read_noise_e", &recipe.camera.read_noise_e),
            offset_dn: field.draw("camera.offset_dn", &recipe.camera.offset_dn),
            photon_noise: recipe.camera.photon_noise,
        },
        objects,
    })
}

fn planes(recipe: &Recipe, field: &FieldNumbers) -> Vec<f64> {
    let count = field.count("focus.planes", &recipe.focus.planes).max(1);
    let step = field.draw("focus.step_um", &recipe.focus.step_um);
    let centre = field.draw("focus.centre_um", &recipe.focus.centre_um);
    let middle = (count - 1) as f64 / 2.0;
    (0..count).map(|plane| centre + (plane as f64 - middle) * step).collect()
}

fn background(recipe: &Recipe, field: &FieldNumbers) -> SceneBackground {
    let background = &recipe.background;
    let illumination = match &background.illumination {
        Illumination::Border { exponent } => {
            SceneIllumination::Border { exponent: field.draw("background.illumination.exponent", exponent) }
        }
        Illumination::Bowl { x2, y2, off_centre } => {
            let distance = field.draw("background.illumination.off_centre", off_centre);
            let angle = random::direction(&mut field.stream("background.illumination.direction"));
            SceneIllumination::Bowl {
                x2: field.draw("background.illumination.x2", x2),
                y2: field.draw("background.illumination.y2", y2),
                top: [distance * libm::cos(angle), distance * libm::sin(angle)],
            }
        }
    };
    SceneBackground {
        level: field.draw("background.level", &background.level),
        illumination,
        scatter: field.draw("background.scatter", &background.scatter),
        scatter_um: field.draw("background.scatter_um", &background.scatter_um),
    }
}
