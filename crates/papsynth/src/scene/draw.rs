//! From recipe and key to a scene. No pixel is touched here.

use crate::error::{Cause, Error};
use crate::key::Key;
use crate::model::Model;
use crate::random;
use crate::recipe::section::named;
use crate::recipe::{Illumination, Light, Optics, Picture, Recipe};

use super::cells::draw_cells;
use super::field::Scene;
use super::imaging::{Fusion, Restoration, SceneBackground, SceneIllumination, SceneLight, SceneOptics};
use super::numbers::FieldNumbers;
use super::stain::FieldStain;
use super::strew::strew;
use super::view::View;
use super::weight::WeightMap;

/// Draws what lies on the slide and how it is imaged.
///
/// `weight_map` is what the layout's `path` names, if it names a file.
///
/// # Errors
/// If the layout has no room for the number of cells asked for.
pub fn draw(recipe: &Recipe, model: &Model, weight_map: Option<&WeightMap>, key: Key) -> Result<Scene, Error> {
    let field = FieldNumbers { key };
    let view = View {
        width: field.count(named!(recipe.field.width_px)),
        height: field.count(named!(recipe.field.height_px)),
        pixel_um: pixel_um(recipe, &field),
    };
    let fail = |cause| Error::Image { index: key.index, cause };
    let stain = FieldStain::draw(&recipe.stain, &field, slide_of(recipe, key));
    let mut objects = draw_cells(recipe, model, weight_map, view, &field, &stain).map_err(fail)?;
    strew(&recipe.debris, view, &field, &stain, None, &mut objects);
    if u32::try_from(objects.len()).is_err() {
        return Err(fail(Cause::TooManyObjects(objects.len())));
    }
    for (id, object) in (1_u32..).zip(&mut objects) {
        object.id = id;
    }
    Ok(Scene { objects, slide: slide_of(recipe, key), ..empty(recipe, view, &field, &stain) })
}

/// The number of the slide that an image shows.
fn slide_of(recipe: &Recipe, key: Key) -> u64 {
    key.index / recipe.slide.fields.max(1) as u64
}

/// The view without anything on it: how it is imaged.
pub(super) fn empty(recipe: &Recipe, view: View, field: &FieldNumbers, stain: &FieldStain<'_>) -> Scene {
    Scene {
        key: field.key,
        slide: 0,
        view,
        planes_um: planes(recipe, field),
        fusion: fusion(recipe, field),
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
        objects: Vec::new(),
    }
}

/// Size of a pixel in the object.
pub(super) fn pixel_um(recipe: &Recipe, field: &FieldNumbers) -> f64 {
    let magnification = field.draw(named!(recipe.field.magnification));
    if magnification <= 0.0 {
        return field.draw(named!(recipe.field.pixel_um));
    }
    let binning = field.count(named!(recipe.camera.binning_px)).max(1);
    field.draw(named!(recipe.camera.pixel_um)) * binning as f64 / magnification
}

/// Number of planes, travel to the middle one, travel between them.
fn stack(recipe: &Recipe, field: &FieldNumbers) -> (usize, f64, f64) {
    let count = field.count(named!(recipe.focus.planes)).max(1);
    let step = field.draw(named!(recipe.focus.step_um));
    (count, field.draw(named!(recipe.focus.centre_um)), step)
}

fn planes(recipe: &Recipe, field: &FieldNumbers) -> Vec<f64> {
    let (count, centre, step) = stack(recipe, field);
    if recipe.focus.picture == Picture::Extended {
        return vec![centre];
    }
    let middle = (count - 1) as f64 / 2.0;
    (0..count).map(|plane| centre + (plane as f64 - middle) * step).collect()
}

fn fusion(recipe: &Recipe, field: &FieldNumbers) -> Option<Fusion> {
    let (planes, centre, step_um) = stack(recipe, field);
    (recipe.focus.picture == Picture::Extended).then(|| Fusion {
        first_um: centre - (planes - 1) as f64 / 2.0 * step_um,
        step_um,
        planes,
        noise_correlation: [
            field.draw(named!(recipe.focus.fused_noise_across)),
            field.draw(named!(recipe.focus.fused_noise_down)),
        ],
        noise_skew: field.draw(named!(recipe.focus.fused_noise_skew)),
    })
}

fn light(recipe: &Recipe, field: &FieldNumbers) -> SceneLight {
    match &recipe.light {
        Light::Monochrome(light) => SceneLight::Monochrome {
            wavelength_um: field.draw(named!("light", light.wavelength_um)),
            bandwidth_um: field.draw(named!("light", light.bandwidth_um)),
        },
        Light::Colour(light) => SceneLight::Colour {
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
        Illumination::Bowl(bowl) => {
            let distance = field.draw(named!("background.illumination", bowl.off_centre));
            let angle = random::direction(&mut field.stream("background.illumination.direction"));
            SceneIllumination::Bowl {
                x2: field.draw(named!("background.illumination", bowl.x2)),
                y2: field.draw(named!("background.illumination", bowl.y2)),
                top: [distance * libm::cos(angle), distance * libm::sin(angle)],
            }
        }
    };
    SceneBackground {
        level: field.draw(named!(recipe.background.level)),
        illumination,
        scatter: field.draw(named!(recipe.background.scatter)),
        scatter_um: field.draw(named!(recipe.background.scatter_um)),
    }
}
