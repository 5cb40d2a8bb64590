//! What the microscope of a recipe must fulfil.

use super::super::{Camera, Illumination, Imaging, Light, Number, Optics, Picture, Recipe};
use super::Check;
use crate::error::Problem;

/// Most pixels that one plane may have: 2³⁰, a gigapixel.
const MAX_PIXELS: f64 = 1_073_741_824.0;

pub(super) fn check(recipe: &Recipe, check: &mut Check) {
    let Recipe { field, focus, background, camera, .. } = recipe;
    check.numbers(
        "field",
        &[
            ("width_px", &field.width_px, 16.0, 32_768.0),
            ("height_px", &field.height_px, 16.0, 32_768.0),
            ("pixel_um", &field.pixel_um, 0.05, 4.0),
            ("magnification", &field.magnification, 0.0, 400.0),
        ],
    );
    magnified(recipe, check);
    check.whole("field", &[("width_px", &field.width_px), ("height_px", &field.height_px)]);
    check.whole("focus", &[("planes", &focus.planes)]);
    let [_, width] = field.width_px.bounds();
    let [_, height] = field.height_px.bounds();
    if width * height > MAX_PIXELS {
        check.problems.push(Problem {
            field: "field.width_px".to_owned(),
            message: format!("{width} x {height} pixels are more than the {MAX_PIXELS} that an image may have"),
        });
    }
    check.numbers(
        "focus",
        &[
            ("planes", &focus.planes, 1.0, 1024.0),
            ("step_um", &focus.step_um, 1e-3, 100.0),
            ("centre_um", &focus.centre_um, -100.0, 100.0),
            ("fused_noise_across", &focus.fused_noise_across, 0.0, 0.5),
            ("fused_noise_down", &focus.fused_noise_down, 0.0, 0.5),
            ("fused_noise_skew", &focus.fused_noise_skew, -0.1, 0.1),
        ],
    );
    let exact = matches!(recipe.optics, Optics::BrightField { imaging: Imaging::Abbe, .. });
    if focus.picture == Picture::Extended && exact {
        let message = "\"extended\" fuses planes object by object; expected `optics.imaging` = \"product\" with it, \
                       or \"planes\"";
        check.add("focus.picture", message.to_owned());
    }
    check.numbers(
        "background",
        &[
            ("level", &background.level, 0.01, 1.2),
            ("scatter", &background.scatter, 0.0, 0.5),
            ("scatter_um", &background.scatter_um, 1.0, 10_000.0),
        ],
    );
    match &background.illumination {
        Illumination::Border { exponent } => check.number("background.illumination.exponent", exponent, 0.0, 2.0),
        Illumination::Bowl { x2, y2, off_centre } => check.numbers(
            "background.illumination",
            &[("x2", x2, 0.0, 0.45), ("y2", y2, 0.0, 0.45), ("off_centre", off_centre, 0.0, 0.9)],
        ),
    }
    // Eq. 10 takes the logarithm of H − c·I_pe, which must stay above zero.
    let ([level, _], [_, scatter]) = (background.level.bounds(), background.scatter.bounds());
    if scatter >= level {
        check.problems.push(Problem {
            field: "background.scatter".to_owned(),
            message: format!(
                "{} takes more light than `background.level` = {} leaves; expected less than {level}",
                background.scatter, background.level
            ),
        });
    }
    light(recipe, check);
    optics(recipe, check);
    detector(camera, check);
}

fn detector(camera: &Camera, check: &mut Check) {
    check.whole("camera", &[("bits", &camera.bits)]);
    check.numbers(
        "camera",
        &[
            ("bits", &camera.bits, 8.0, 16.0),
            ("pixel_um", &camera.pixel_um, 1.0, 100.0),
            ("full_well_e", &camera.full_well_e, 10.0, 1e7),
            ("read_noise_e", &camera.read_noise_e, 0.0, 1e5),
            ("read_noise_rms_e", &camera.read_noise_rms_e, 0.0, 1e5),
            ("offset_dn", &camera.offset_dn, 0.0, 4096.0),
            ("glare_removed", &camera.glare_removed, 0.0, 0.8),
            ("prnu", &camera.prnu, 0.0, 0.5),
            ("dsnu_e", &camera.dsnu_e, 0.0, 1e5),
            ("exposure_s", &camera.exposure_s, 0.0, 1e6),
            ("dark_current_e_per_s", &camera.dark_current_e_per_s, 0.0, 1e6),
            ("dark_reference_c", &camera.dark_reference_c, -200.0, 150.0),
            ("temperature_c", &camera.temperature_c, -200.0, 150.0),
            ("dark_doubling_c", &camera.dark_doubling_c, 0.1, 100.0),
            ("blooming", &camera.blooming, 0.0, 1.0),
            ("blooming_vertical", &camera.blooming_vertical, 0.0, 1.0),
            ("binning_px", &camera.binning_px, 1.0, 8.0),
            ("jpeg_quality", &camera.jpeg_quality, 0.0, 100.0),
        ],
    );
    check.whole("camera", &[("binning_px", &camera.binning_px), ("jpeg_quality", &camera.jpeg_quality)]);
    /// Largest whole number that TOML readers of all languages keep.
    const LARGEST_SERIAL: u64 = 1 << 53;
    if camera.serial > LARGEST_SERIAL {
        check.add("camera.serial", format!("{} is outside 0 to {LARGEST_SERIAL}", camera.serial));
    }
    let ([median, most], [least, rms]) = (camera.read_noise_e.bounds(), camera.read_noise_rms_e.bounds());
    if rms > 0.0 && (median <= 0.0 || least < most || rms > 20.0 * median) {
        let message = format!(
            "{} does not fit to `camera.read_noise_e` = {}; expected 0, or from {most} to {}",
            camera.read_noise_rms_e,
            camera.read_noise_e,
            20.0 * median
        );
        check.add("camera.read_noise_rms_e", message);
    }
    if camera.jpeg_quality.bounds()[1] > 0.0 && camera.bits.bounds()[1] > 8.0 {
        let message =
            format!("{} is for 8 bits; `camera.bits` = {}; expected 0, or 8 bits", camera.jpeg_quality, camera.bits);
        check.add("camera.jpeg_quality", message);
    }
    let [bits, _] = camera.bits.bounds();
    let [_, offset] = camera.offset_dn.bounds();
    // A half of the range is not yet at 2^bits − 1, but leaves too little to see.
    if offset >= libm::exp2(bits) / 2.0 {
        check.problems.push(Problem {
            field: "camera.offset_dn".to_owned(),
            message: format!(
                "{} is half of the {bits}-bit range or more; expected less than {}",
                camera.offset_dn,
                libm::exp2(bits) / 2.0
            ),
        });
    }
}

/// Where the magnification makes the pixels, it must make usable ones.
fn magnified(recipe: &Recipe, check: &mut Check) {
    let [least, most] = recipe.field.magnification.bounds();
    if most <= 0.0 {
        return;
    }
    let [smallest, largest] = recipe.camera.pixel_um.bounds();
    let [few, many] = recipe.camera.binning_px.bounds();
    if least <= 0.0 || smallest * few / most < 0.05 || largest * many / least > 4.0 {
        let message = format!(
            "{} does not make pixels of 0.05 to 4 µm of `camera.pixel_um` = {}; expected 0, or from {} to {}",
            recipe.field.magnification,
            recipe.camera.pixel_um,
            largest * many / 4.0,
            (smallest * few / 0.05).min(400.0)
        );
        check.add("field.magnification", message);
    }
}

fn light(recipe: &Recipe, check: &mut Check) {
    match &recipe.light {
        Light::Monochrome { wavelength_um, bandwidth_um } => check
            .numbers("light", &[("wavelength_um", wavelength_um, 0.4, 0.7), ("bandwidth_um", bandwidth_um, 0.0, 0.1)]),
        Light::Colour { lamp_k, chromatic_um, .. } => {
            check
                .numbers("light", &[("lamp_k", lamp_k, 2000.0, 10_000.0), ("chromatic_um", chromatic_um, -10.0, 10.0)]);
            if matches!(recipe.optics, Optics::Gaussian { .. }) {
                let message = "colour is not known to the paper's Gaussians; expected `kind = \"monochrome\"`, or \
                               `kind = \"bright-field\"` under [optics]";
                check.add("light.kind", message.to_owned());
            }
        }
    }
}

fn optics(recipe: &Recipe, check: &mut Check) {
    match &recipe.optics {
        Optics::Gaussian { sigma_xy_um, sigma_z_um_per_um } => check.numbers(
            "optics",
            &[("sigma_xy_um", sigma_xy_um, 0.0, 20.0), ("sigma_z_um_per_um", sigma_z_um_per_um, 0.0, 10.0)],
        ),
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
            imaging: _,
            directions,
        } => {
            check.numbers(
                "optics",
                &[
                    ("na", na, 0.05, 1.6),
                    ("condenser_na", condenser_na, 0.05, 1.6),
                    ("mount_index", mount_index, 1.0, 2.0),
                    ("immersion_index", immersion_index, 1.0, 2.0),
                    ("cover_error_um", cover_error_um, -50.0, 50.0),
                    ("spherical", spherical, -1.0, 1.0),
                    ("coma", coma, -1.0, 1.0),
                    ("astigmatism", astigmatism, -1.0, 1.0),
                    ("extra_blur_um", extra_blur_um, 0.0, 10.0),
                    ("stray_light", stray_light, 0.0, 0.5),
                    ("oversampling", oversampling, 1.0, 4.0),
                    ("slab_um", slab_um, 0.1, 10.0),
                    ("directions", directions, 1.0, 65_536.0),
                ],
            );
            check.whole("optics", &[("oversampling", oversampling), ("directions", directions)]);
            no_more_than(check, ("optics.na", na), ("optics.immersion_index", immersion_index), false);
            no_more_than(check, ("optics.na", na), ("optics.mount_index", mount_index), true);
            no_more_than(check, ("optics.condenser_na", condenser_na), ("optics.mount_index", mount_index), true);
        }
    }
}

/// What is legitimate and may surprise.
pub(super) fn notes(recipe: &Recipe) -> Vec<Problem> {
    let Optics::BrightField { na, condenser_na, .. } = &recipe.optics else { return Vec::new() };
    let ([least, _], [_, widest]) = (na.bounds(), condenser_na.bounds());
    if widest <= least {
        return Vec::new();
    }
    let lost = 100.0 * (1.0 - (least / widest) * (least / widest));
    let message = format!(
        "{condenser_na} is above `optics.na` = {na}: up to {lost:.0} % of the light passes outside the objective and is lost"
    );
    vec![Problem { field: "optics.condenser_na".to_owned(), message }]
}

/// Light cannot come at a larger aperture than a medium lets through.
fn no_more_than(check: &mut Check, (field, na): (&str, &Number), (medium, index): (&str, &Number), strictly: bool) {
    let ([_, largest], [least, _]) = (na.bounds(), index.bounds());
    if largest > least || (strictly && largest == least) {
        let (than, up_to) = if strictly { ("at or above", "less than") } else { ("above", "at most") };
        check.add(field, format!("{na} is {than} `{medium}` = {index}; expected {up_to} {least}"));
    }
}
