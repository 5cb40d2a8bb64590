//! From recipe and key to a scene. No pixel is touched here.

use crate::error::{Cause, Error};
use crate::key::Key;
use crate::model::Model;
use crate::random;
use crate::recipe::{Illumination, Light, Number, Optics, Picture, Recipe};

use super::cells::draw_cells;
use super::field::Scene;
use super::imaging::{
    Fusion, Restoration, SceneBackground, SceneCamera, SceneIllumination, SceneLight, SceneMicroscope, SceneOptics,
};
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
        width: field.count("field.width_px", &recipe.field.width_px),
        height: field.count("field.height_px", &recipe.field.height_px),
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
            feather_um: field.draw("nucleus.restore_feather_um", &recipe.nucleus.restore_feather_um),
        },
        dyes: stain.debris(),
        camera: camera(recipe, field),
        frame: None,
        objects: Vec::new(),
    }
}

/// Size of a pixel in the object.
pub(super) fn pixel_um(recipe: &Recipe, field: &FieldNumbers) -> f64 {
    let magnification = field.draw("field.magnification", &recipe.field.magnification);
    if magnification <= 0.0 {
        return field.draw("field.pixel_um", &recipe.field.pixel_um);
    }
    let camera = &recipe.camera;
    let binning = field.count("camera.binning_px", &camera.binning_px).max(1);
    field.draw("camera.pixel_um", &camera.pixel_um) * binning as f64 / magnification
}

/// Number of planes, travel to the middle one, travel between them.
fn stack(recipe: &Recipe, field: &FieldNumbers) -> (usize, f64, f64) {
    let count = field.count("focus.planes", &recipe.focus.planes).max(1);
    let step = field.draw("focus.step_um", &recipe.focus.step_um);
    (count, field.draw("focus.centre_um", &recipe.focus.centre_um), step)
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
    let focus = &recipe.focus;
    let (planes, centre, step_um) = stack(recipe, field);
    (focus.picture == Picture::Extended).then(|| Fusion {
        first_um: centre - (planes - 1) as f64 / 2.0 * step_um,
        step_um,
        planes,
        noise_correlation: [
            field.draw("focus.fused_noise_across", &focus.fused_noise_across),
            field.draw("focus.fused_noise_down", &focus.fused_noise_down),
        ],
        noise_skew: field.draw("focus.fused_noise_skew", &focus.fused_noise_skew),
    })
}

fn light(recipe: &Recipe, field: &FieldNumbers) -> SceneLight {
    let draw = |name: &str, number: &Number| field.draw(&format!("light.{name}"), number);
    match &recipe.light {
        Light::Monochrome { wavelength_um, bandwidth_um } => SceneLight::Monochrome {
            wavelength_um: draw("wavelength_um", wavelength_um),
            bandwidth_um: draw("bandwidth_um", bandwidth_um),
        },
        Light::Colour { lamp_k, mixing, chromatic_um, rendition } => SceneLight::Colour {
            lamp_k: draw("lamp_k", lamp_k),
            mixing: *mixing,
            chromatic_um: draw("chromatic_um", chromatic_um),
            rendition: *rendition,
        },
    }
}

fn optics(recipe: &Recipe, field: &FieldNumbers) -> SceneOptics {
    let draw = |name: &str, number: &Number| field.draw(&format!("optics.{name}"), number);
    match &recipe.optics {
        Optics::Gaussian { sigma_xy_um, sigma_z_um_per_um } => SceneOptics::Gaussian {
            sigma_xy_um: draw("sigma_xy_um", sigma_xy_um),
            sigma_z_um_per_um: draw("sigma_z_um_per_um", sigma_z_um_per_um),
        },
        Optics::BrightField {
            na,
            condenser_na,
            mount_index,
            immersion_index,
            cover_error_um,
            spherical,
            coma,
            astigmatism,
            extra_blur_um,
            stray_light,
            oversampling,
            slab_um,
            imaging,
            directions,
        } => SceneOptics::BrightField(SceneMicroscope {
            na: draw("na", na),
            condenser_na: draw("condenser_na", condenser_na),
            mount_index: draw("mount_index", mount_index),
            immersion_index: draw("immersion_index", immersion_index),
            cover_error_um: draw("cover_error_um", cover_error_um),
            spherical: draw("spherical", spherical),
            coma: draw("coma", coma),
            astigmatism: draw("astigmatism", astigmatism),
            extra_blur_um: draw("extra_blur_um", extra_blur_um),
            stray_light: draw("stray_light", stray_light),
            oversampling: field.count("optics.oversampling", oversampling).max(1),
            slab_um: draw("slab_um", slab_um),
            imaging: *imaging,
            directions: field.count("optics.directions", directions).max(1),
        }),
    }
}

fn camera(recipe: &Recipe, field: &FieldNumbers) -> SceneCamera {
    let camera = &recipe.camera;
    let draw = |name: &str, number: &Number| field.draw(&format!("camera.{name}"), number);
    let count = |name: &str, number: &Number| field.count(&format!("camera.{name}"), number);
    SceneCamera {
        bits: u32::try_from(count("bits", &camera.bits)).unwrap_or(8),
        full_well_e: draw("full_well_e", &camera.full_well_e),
        read_noise_e: draw("read_noise_e", &camera.read_noise_e),
        read_noise_rms_e: draw("read_noise_rms_e", &camera.read_noise_rms_e),
        offset_dn: draw("offset_dn", &camera.offset_dn),
        glare_removed: draw("glare_removed", &camera.glare_removed),
        photon_noise: camera.photon_noise,
        prnu: draw("prnu", &camera.prnu),
        dsnu_e: draw("dsnu_e", &camera.dsnu_e),
        serial: camera.serial,
        exposure_s: draw("exposure_s", &camera.exposure_s),
        dark_current_e_per_s: draw("dark_current_e_per_s", &camera.dark_current_e_per_s),
        dark_reference_c: draw("dark_reference_c", &camera.dark_reference_c),
        temperature_c: draw("temperature_c", &camera.temperature_c),
        dark_doubling_c: draw("dark_doubling_c", &camera.dark_doubling_c),
        blooming: draw("blooming", &camera.blooming),
        blooming_vertical: draw("blooming_vertical", &camera.blooming_vertical),
        binning_px: count("binning_px", &camera.binning_px).max(1),
        binning: camera.binning,
        jpeg_quality: u32::try_from(count("jpeg_quality", &camera.jpeg_quality)).unwrap_or(0),
        jpeg_subsampling: camera.jpeg_subsampling,
    }
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
