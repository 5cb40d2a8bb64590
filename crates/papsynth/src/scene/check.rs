//! Scenes as JSON: written, read back and checked.

use std::collections::BTreeSet;

use serde_json::Value;

use super::field::{Object, Scene};
use crate::debris::{Body, NucleusForm};
use crate::error::{Error, ErrorKind, within};

/// Largest number of objects, planes and pixels of a scene.
const MOST_OBJECTS: usize = 1 << 20;
const MOST_PLANES: usize = 1024;
const MOST_PIXELS: usize = 1 << 30;

/// Largest radius of an object, in points of the grid on which it is rendered.
const FARTHEST_POINTS: f64 = 8192.0;

/// Largest distance of the centre of an object from the corner of the image, in largest radii.
const MOST_REACHES: f64 = 512.0;

/// Range of each number, by the name of its field or by the end of its path. For lists it applies to each number.
///
/// The ranges are wider than those of recipes. They limit memory and time.
#[rustfmt::skip]
const RANGES: &[(&str, f64, f64)] = &[
    ("view.width", 1.0, 32_768.0), ("view.height", 1.0, 32_768.0), ("pixel_um", 0.04, 5.0),
    ("planes_um", -1e5, 1e5), ("first_um", -1e5, 1e5), ("step_um", 0.0, 1e4), ("planes", 1.0, 1e5),
    ("noise_correlation", 0.0, 0.5), ("noise_skew", -0.1, 0.1), ("reduction", 1.0, 1.3), ("column_pattern", 0.0, 0.05),
    ("level", 1e-3, 2.0), ("exponent", 0.0, 10.0), ("falloff_x", 0.0, 1.0), ("falloff_y", 0.0, 1.0), ("illumination.centre", -10.0, 10.0),
    ("background.texture", 0.0, 1.0), ("texture_um", 0.1, 1e5),
    ("wavelength_um", 0.4, 0.7), ("bandwidth_um", 0.0, 0.1), ("absorption_variation", 0.0, 1.0), ("lamp_k", 2000.0, 10_000.0), ("chromatic_um", -10.0, 10.0),
    ("na", 0.05, 1.6), ("condenser_na", 0.05, 1.6), ("mount_index", 1.0, 2.0), ("immersion_index", 1.0, 2.0),
    ("cover_error_um", -50.0, 50.0), ("spherical", -1.0, 1.0), ("coma", -1.0, 1.0), ("astigmatism", -1.0, 1.0),
    ("extra_blur_um", 0.0, 10.0), ("stray_light", 0.0, 0.5), ("stray_light_um", 0.0, 50.0), ("oversampling", 1.0, 4.0), ("slab_um", 0.1, 10.0),
    ("directions", 1.0, 65_536.0), ("sigma_xy_um", 0.0, 20.0), ("sigma_z_um_per_um", 0.0, 10.0), ("feather_um", 0.0, 5.0),
    ("bits", 8.0, 16.0), ("full_well_e", 10.0, 1e7), ("read_noise_e", 0.0, 1e5), ("read_noise_rms_e", 0.0, 1e5),
    ("offset_dn", 0.0, 32_768.0), ("glare_subtracted", 0.0, 0.8), ("prnu", 0.0, 0.5), ("dsnu_e", 0.0, 1e5), ("sensor_dust", 0.0, 1e4),
    ("exposure_s", 0.0, 1e6), ("dark_current_e_per_s", 0.0, 1e6), ("dark_reference_c", -200.0, 150.0),
    ("temperature_c", -200.0, 150.0), ("dark_doubling_c", 0.1, 100.0), ("blooming", 0.0, 1.0),
    ("blooming_vertical", 0.0, 1.0), ("binning_px", 1.0, 8.0), ("jpeg_quality", 0.0, 100.0),
    ("attempts", 1.0, 1e3), ("requested", 0.0, 1e15), ("placed", 0.0, 1e15), ("in_field", 0.0, 1e15),
    ("id", 1.0, 4_294_967_295.0), ("centre_um", -1e6, 1e6), ("depth_um", -1e4, 1e4), ("rotation_deg", -1e6, 1e6),
    ("direction_deg", -1e6, 1e6), ("bend_deg", -1e6, 1e6), ("dyes", 0.0, 1e6), ("dyes.nucleus", 0.0, 1e6),
    ("bacillus", 0.0, 1e6), ("speckle", 0.0, 1e6), ("absorbance", 0.0, 1e4), ("cytoplasm_absorbance", 0.0, 1e4),
    ("texture", 0.0, 1e4), ("shreds", 0.0, 1e4), ("nucleus_absorbance", 0.0, 1e4), ("phase_rad", -1e3, 1e3),
    ("fold.radius_um", 0.01, 10.0), ("radius_um", 0.01, 5e3), ("diameter_um", 0.05, 5e3), ("length_um", 0.05, 5e3), ("width_um", 0.01, 5e3),
    ("segment_length_um", 0.05, 50.0), ("yeast_diameter_um", 0.05, 20.0), ("cytoplasm_diameter_um", 0.0, 100.0), ("colony_radius_um", 0.0, 500.0),
    ("fibre_width_um", 0.01, 5.0), ("grain_um", 0.05, 5.0), ("overhang_um", 0.0, 20.0), ("wrinkle_um", 0.01, 5.0),
    ("clouds_um", 0.05, 100.0), ("clouds_stretch", 1.0, 100.0), ("texture_size", 0.05, 100.0), ("fray_um", 0.0, 5.0), ("rim_um", 0.0, 10.0), ("edge_um", 0.0, 3.0),
    ("rods", 1.0, 100.0), ("segments", 1.0, 100.0), ("cocci", 1.0, 1e5), ("lobes", 0.0, 16.0), ("fibres", 1.0, 1e3),
    ("dilations", 0.0, 200.0), ("notches", 0.0, 100.0), ("protrusions", 0.0, 100.0), ("wrinkles", 0.0, 1e3),
    ("nucleoli", 0.0, 100.0), ("body.rim", 1e-3, 10.0), ("rim", 0.0, 100.0), ("body.width", 0.05, 10.0),
    ("elongation", 0.1, 100.0), ("alpha", 0.0, 1.0), ("beta", 0.0, 2.0), ("waves", 0.0, 10.0), ("pallor", 0.0, 1.0),
    ("granularity", 0.0, 20.0), ("ragged", 0.0, 10.0), ("branches", 0.0, 1.0), ("buds", 0.0, 1.0),
    ("density", 0.0, 100.0), ("coverage", 0.0, 1.0), ("excess_area", 1.0, 4.0), ("angularity", 0.0, 1.0), ("degeneration", 0.0, 100.0), ("wrinkle", 0.0, 100.0), ("wrinkle_thickness", 0.0, 100.0),
    ("endoplasm", 0.0, 100.0), ("ridges", 0.0, 100.0), ("clouds", 0.0, 100.0), ("flecks", 0.0, 100.0), ("flecks_threshold", 0.0, 1.0),
    ("cytoskeleton", 0.0, 100.0), ("granules", 0.0, 1e4), ("specks", 0.0, 1e4), ("thickness_gradient", -100.0, 100.0),
    ("clearing", 0.0, 1.0), ("depth", 0.0, 2.0), ("curvature", -4.0, 4.0), ("waviness", 0.0, 1.0), ("displacement", 0.0, 1.0), ("dome", 0.0, 1.0), ("clumping", 0.0, 1.0), ("off_centre", -10.0, 10.0),
];

impl Scene {
    /// Returns the scene as JSON, one object per line.
    ///
    /// # Panics
    /// Never: strings, numbers and lists can be written as JSON.
    #[must_use]
    pub fn to_json(&self) -> String {
        let json = |object: &Object| serde_json::to_string(object).expect("every object can be written as JSON");
        let objects: Vec<String> = self.objects.iter().map(json).collect();
        let empty = Self { objects: Vec::new(), ..self.clone() };
        let mut text = serde_json::to_string(&empty).expect("every scene can be written as JSON");
        // The list of objects is the last field.
        text.truncate(text.len() - "]}".len());
        text + "\n" + &objects.join(",\n") + "\n]}\n"
    }

    /// Reads and checks a scene written by [`to_json`](Self::to_json) or by another program.
    ///
    /// # Errors
    /// If a field is missing, unknown, of a wrong type or out of range: the object, the field, and what is accepted.
    pub fn from_json(text: &str) -> Result<Self, Error> {
        read(text).map_err(Error::Scene)
    }
}

fn read(text: &str) -> Result<Scene, ErrorKind> {
    let mut value: Value = serde_json::from_str(text).map_err(ErrorKind::NotAScene)?;
    let Some(Value::Array(objects)) = value.get_mut("objects").map(Value::take) else {
        return Err(ErrorKind::NoObjects);
    };
    value["objects"] = Value::Array(Vec::new());
    numbers(&value, "", "")?;
    let mut scene: Scene = serde_json::from_value(value)?;
    within("objects", objects.len().max(1) as f64, [1.0, MOST_OBJECTS as f64])?;
    within("planes_um", scene.planes_um.len() as f64, [1.0, MOST_PLANES as f64])?;
    within("view", (scene.view.width * scene.view.height) as f64, [1.0, MOST_PIXELS as f64])?;
    if scene.frame.is_some() {
        return Err(ErrorKind::SlideScene);
    }
    let farthest_um = FARTHEST_POINTS * scene.grid().pixel_um;
    let mut ids = BTreeSet::new();
    for (index, value) in objects.into_iter().enumerate() {
        let id = value.get("id").cloned().unwrap_or_default();
        let object = object(value, scene.view.pixel_um, farthest_um, &mut ids);
        scene.objects.push(object.map_err(|cause| ErrorKind::Object { index, id, cause: Box::new(cause) })?);
    }
    Ok(scene)
}

fn object(value: Value, pixel_um: f64, farthest_um: f64, ids: &mut BTreeSet<u32>) -> Result<Object, ErrorKind> {
    numbers(&value, "", "")?;
    let object: Object = serde_json::from_value(value)?;
    if object.plot.is_some() {
        return Err(ErrorKind::SlideScene);
    }
    if !ids.insert(object.id) {
        return Err(ErrorKind::SameId);
    }
    let reach_um = object.body.reach_um(pixel_um).max(match &object.body {
        Body::Cell(cell) => (2.0 * cell.nucleus.radius_um).max(2.5 * cell.halo.map_or(0.0, |halo| halo.radius_um)),
        _ => 0.0,
    });
    if reach_um > farthest_um {
        return Err(ErrorKind::Reach(reach_um, farthest_um));
    }
    // Round leukocytes have no lobes and no cytoplasm.
    if let Body::Leukocyte(cell) = &object.body
        && cell.form != NucleusForm::Round
    {
        within("body.cytoplasm_diameter_um", cell.cytoplasm_diameter_um, [0.1, 100.0])?;
        within("body.lobes", cell.lobes as f64, [1.0, 16.0])?;
    }
    let most_um = MOST_REACHES * farthest_um;
    object.centre_um.into_iter().try_for_each(|at| within("centre_um", at, [-most_um, most_um]))?;
    Ok(object)
}

/// The range of a number.
fn range(path: &str, name: &str) -> Option<&'static (&'static str, f64, f64)> {
    RANGES.iter().find(|(end, ..)| match end.split_once('.') {
        Some((_, last)) => last == name && path.ends_with(end),
        None => *end == name,
    })
}

/// Checks the range of every number, and that no string or boolean is in place of a number.
fn numbers(value: &Value, path: &str, name: &str) -> Result<(), ErrorKind> {
    match value {
        Value::Object(fields) => fields.iter().try_for_each(|(name, value)| {
            let path = if path.is_empty() { name.clone() } else { format!("{path}.{name}") };
            numbers(value, &path, name)
        }),
        Value::Array(values) => values.iter().try_for_each(|value| numbers(value, path, name)),
        Value::Number(number) => match (range(path, name), number.as_f64()) {
            (Some((_, low, high)), Some(value)) => within(path, value, [*low, *high]),
            _ => Ok(()),
        },
        Value::String(_) | Value::Bool(_) if range(path, name).is_some() => {
            Err(ErrorKind::NotANumber(path.to_owned(), value.to_string()))
        }
        _ => Ok(()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::key::Key;
    use crate::model::Model;
    use crate::recipe::Preset;

    fn scene(preset: Preset) -> Scene {
        crate::scene::draw(&preset.recipe(), &Model::builtin(), None, Key { seed: u64::MAX, index: 1 }).unwrap()
    }

    #[test]
    fn scenes_of_all_presets_are_read_back_and_every_number_has_a_range() {
        for preset in Preset::ALL {
            let scene = scene(preset);
            assert_eq!(Scene::from_json(&scene.to_json()).unwrap(), scene, "{}", preset.name());
        }
        let mut scene = serde_json::to_value(scene(Preset::Inflamed)).unwrap();
        for object in scene["objects"].take().as_array().unwrap().iter().chain([&scene]) {
            all_have_a_range(object, "", "");
        }
    }

    fn all_have_a_range(value: &Value, path: &str, name: &str) {
        /// Any integer of 32 or 64 bits.
        const ANY: [&str; 6] = ["seed", "index", "slide", "serial", "number", "cluster"];
        match value {
            Value::Object(fields) => {
                fields.iter().for_each(|(name, value)| all_have_a_range(value, &format!("{path}.{name}"), name));
            }
            Value::Array(values) => values.iter().for_each(|value| all_have_a_range(value, path, name)),
            Value::Number(_) => assert!(range(path, name).is_some() || ANY.contains(&name), "{path}"),
            _ => {}
        }
    }

    #[test]
    fn invalid_scenes_are_refused_by_object_and_field() {
        let text = scene(Preset::Lbc).to_json();
        let mut value: Value = serde_json::from_str(&text).unwrap();
        let cell = value["objects"].as_array().unwrap().iter().position(|o| o["body"]["kind"] == "cell").unwrap();
        let mut refused = |pointer: &str, to: Value| {
            let before = value.pointer(pointer).unwrap().clone();
            *value.pointer_mut(pointer).unwrap() = to;
            let message = Scene::from_json(&value.to_string()).unwrap_err().to_string();
            *value.pointer_mut(pointer).unwrap() = before;
            message
        };
        let at = |field: &str| format!("/objects/{cell}/{field}");
        for (pointer, to, said) in [
            ("/view/width".to_owned(), 1e9.into(), "view.width: 1000000000 is out of range: expected 1 to 32768"),
            ("/camera/bits".to_owned(), 60.into(), "camera.bits: 60 is out of range: expected 8 to 16"),
            ("/planes_um".to_owned(), Value::Array(Vec::new()), "planes_um: 0 is out of range: expected 1 to 1024"),
            ("/objects".to_owned(), 3.into(), "objects"),
            (at("body/radius_um"), Value::from(-1.0), "body.radius_um: -1 is out of range"),
            (at("body/radius_um"), Value::from(4e3), "the radius of the object is"),
            (at("body/radius_um"), "wide".into(), "body.radius_um: expected a number, found \"wide\""),
            (at("body/tint"), "green".into(), "unknown value `green`"),
            (at("body/kind"), "dragon".into(), "unknown value `dragon`"),
            (at("body/dyes"), Value::from(vec![1.0]), "expected a list of 5, found a list of 1"),
            (
                at("body/detail/notches"),
                1e9.into(),
                "body.detail.notches: 1000000000 is out of range: expected 0 to 100",
            ),
            (at("id"), 0.into(), "id: 0 is out of range: expected 1"),
        ] {
            let message = refused(&pointer, to);
            assert!(message.contains(said), "{pointer}: {message}");
            assert!(!pointer.starts_with("/objects/") || message.contains(&format!("objects[{cell}]")), "{message}");
        }
        for text in ["", "[]", "{}", "nonsense", "{\"objects\": []}"] {
            assert!(Scene::from_json(text).is_err(), "{text}");
        }
    }
}
