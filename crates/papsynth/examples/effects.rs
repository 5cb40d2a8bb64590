//! Shows the effect of every parameter of a section of the recipe: `effects SECTION OUT.png`.
//!
//! Each row is one parameter: the same small field with a low, the default and a high value, or with each value of an
//! enumeration. Rows are enumerated from the recipe itself, for all its kinds, so they are complete except for layouts
//! that need a file.

#![expect(clippy::cast_possible_truncation, reason = "a small program with small numbers")]

mod support;

use image::{Rgb, RgbImage};
use papsynth::key::Key;
use papsynth::model::Model;
use papsynth::recipe::{CellMix, Clusters, Debris, Layout, Number, Preset, Recipe, is_toml_table};
use papsynth::{Engine, Inputs};
use serde_json::{Map, Value, json};
use support::{LINE, Outcome, enlarged, save, to_image, write};

/// Camera pixels of a tile.
const TILE: [u32; 2] = [210, 160];
/// Magnification of a tile.
const ZOOM: u32 = 1;

/// Columns of rows.
const COLUMNS: u32 = 2;
/// Pixels between tiles.
const GAP: u32 = 4;

/// Ratio of the high to the default and of the default to the low value.
const FACTOR: f64 = 4.0;

/// High values of parameters that are 0 by default, by the last part of the path.
const HIGH_OF_ZERO: [(&str, f64); 20] = [
    ("centre_um", 3.0),
    ("cover_error_um", 60.0),
    ("spherical", 0.15),
    ("coma", 0.15),
    ("astigmatism", 0.15),
    ("stray_light", 0.3),
    ("stray_light_um", 20.0),
    ("absorption_variation", 1.0),
    ("chromatic_um", 2.0),
    ("blooming", 1.0),
    ("jpeg_quality", 8.0),
    ("offset_dn", 40.0),
    ("read_noise_rms_e", 3000.0),
    ("magnification", 40.0),
    ("neutral", 2.0),
    ("haematein", 2.0),
    ("eosin_y", 3.0),
    ("light_green", 3.0),
    ("orange_g", 5.0),
    ("orangeophilic", 3.0),
];

/// Upper limits of high values: a patch must fit into its donors.
const UPPER_LIMITS: [(&str, f64); 1] = [("nucleus.patch_um", 3.5)];

/// Values of enumerations, by path.
const CHOICES: [(&str, &[&str]); 21] = [
    ("cytoplasm.shape", &["correlated", "independent"]),
    ("cytoplasm.sheet", &["flat", "verlet", "xpbd"]),
    ("nucleus.shape", &["correlated", "independent"]),
    ("nucleus.chromatin", &["quilt", "field"]),
    ("nucleus.acceptance", &["near", "threshold"]),
    ("nucleus.seam", &["min-cut", "feather"]),
    ("nucleus.restore", &["before-detection", "after-detection", "off"]),
    ("cells.intermediate.group.form", &["single", "aggregate", "honeycomb", "palisade"]),
    ("focus.output", &["planes", "edf"]),
    ("debris.leukocytes.form", &["round", "lobed", "kidney"]),
    ("debris.speckles.form", &["round", "dilated"]),
    ("camera.photon_noise", &["exact", "normal", "off"]),
    ("camera.binning", &["charge", "digital"]),
    ("camera.jpeg_subsampling", &["4:4:4", "4:2:2", "4:2:0"]),
    ("layout.kind", &["clusters", "band", "uniform"]),
    ("background.illumination.kind", &["quadratic", "border"]),
    ("optics.imaging", &["product", "abbe"]),
    ("optics.kind", &["bright-field", "gaussian"]),
    ("light.kind", &["monochrome", "colour"]),
    ("light.mixing", &["spectral", "per-wavelength", "three-vectors"]),
    ("light.rendition", &["display", "srgb", "raw"]),
];

/// Probabilities, by the last part of the path: shown at 0 and at 1.
const PROBABILITIES: [&str; 9] =
    ["flap", "roll", "folded_over", "granular", "pyknotic", "wrinkled", "degenerated", "on_cells", "ghosts"];

/// A row: a parameter and its recipes.
struct Row {
    path: String,
    /// Label and recipe of each tile.
    tiles: Vec<(String, Recipe)>,
}

fn main() -> Outcome<()> {
    let mut arguments = std::env::args().skip(1);
    let section = arguments.next().unwrap_or_default();
    let whole = serde_json::to_value(base(&section))?;
    let Some(of) = whole.get(&section) else {
        let known: Vec<&String> = whole.as_object().into_iter().flat_map(Map::keys).collect();
        return Err(format!("usage: effects SECTION OUT.png, SECTION one of {known:?}").into());
    };
    let out = arguments.next().unwrap_or_else(|| format!("target/effects-{section}.png"));
    let mut rows = Vec::new();
    collect(&whole, &section, of, &mut rows)?;
    // Fields of other kinds than the default one.
    for (path, kinds) in CHOICES.iter().filter(|(path, _)| path.starts_with(&format!("{section}."))) {
        let Some(table) = path.strip_suffix(".kind") else { continue };
        for kind in *kinds {
            let other =
                with(&base(&section), path, json!(kind)).ok_or_else(|| format!("{path}: {kind} is not accepted"))?;
            let whole = serde_json::to_value(other)?;
            let of = table.split('.').fold(&whole, |at, step| &at[step]);
            collect(&whole, table, of, &mut rows)?;
        }
    }
    let tiles = rows.iter().map(|row| row.tiles.len() as u32).max().unwrap_or(0);
    let model = Model::builtin();
    let size = [tiles * (TILE[0] * ZOOM + GAP) + GAP, TILE[1] * ZOOM + 2 * LINE + GAP];
    let lines = (rows.len() as u32).div_ceil(COLUMNS);
    let mut page = RgbImage::from_pixel(COLUMNS * size[0], lines * size[1] + GAP, Rgb([255; 3]));
    for (index, row) in (0_u32..).zip(&rows) {
        let corner = [index % COLUMNS * size[0] + GAP, index / COLUMNS * size[1] + GAP];
        write(&mut page, &row.path, [corner[0], corner[1] + 2], 1);
        for (place, (label, recipe)) in (0_u32..).zip(&row.tiles) {
            let x = corner[0] + place * (TILE[0] * ZOOM + GAP);
            let engine = Engine::new(recipe, &model, &Inputs::default()).map_err(|e| format!("{}: {e}", row.path))?;
            let shown = to_image(&engine.frame(Key { seed: 2015, index: 3 })?);
            let width = TILE[0].min(shown.width());
            let height = TILE[1].min(shown.height());
            let cut = image::imageops::crop_imm(&shown, 0, 0, width, height).to_image();
            image::imageops::replace(&mut page, &enlarged(&cut, ZOOM), i64::from(x), i64::from(corner[1] + LINE));
            write(&mut page, label, [x, corner[1] + LINE + TILE[1] * ZOOM + 2], 1);
        }
    }
    save(page, &out)
}

/// Returns the small field that shows a section.
fn base(section: &str) -> Recipe {
    let mut recipe = Preset::Lbc.recipe();
    recipe.field.width_px = f64::from(TILE[0]).into();
    recipe.field.height_px = f64::from(TILE[1]).into();
    recipe.field.pixel_um = 0.33.into();
    recipe.slide.spacing_um = 8.0.into();
    recipe.layout = Layout::Uniform {};
    if section != "debris" {
        recipe.debris = Debris::none();
    }
    recipe.cells.retain(|class, _| class == "intermediate");
    recipe.cells.insert("intermediate".to_owned(), CellMix { count: 2.0.into(), ..CellMix::default() });
    match section {
        "stain" => recipe = with(&recipe, "light", json!({ "kind": "colour" })).unwrap_or(recipe),
        // At default densities, a small field contains hardly any debris.
        "debris" => recipe = abundant(&recipe),
        "layout" => {
            recipe.layout =
                Layout::Clusters(Clusters { count: Number::uniform(5.0, 11.0).into(), ..Clusters::default() });
            recipe.field.pixel_um = 1.3.into();
            recipe.cells.insert("intermediate".to_owned(), CellMix { count: 20.0.into(), ..CellMix::default() });
        }
        _ => {}
    }
    recipe
}

/// Returns the recipe with enough debris that a small field contains some of each kind.
fn abundant(recipe: &Recipe) -> Recipe {
    const COUNTS: [&str; 6] = ["count", "clusters", "colonies", "groups", "strands", "fraction"];
    let mut whole = serde_json::to_value(recipe).unwrap_or_default();
    if let Some(kinds) = whole.get_mut("debris").and_then(Value::as_object_mut) {
        for kind in kinds.values_mut().filter_map(Value::as_object_mut) {
            for (name, value) in kind.iter_mut().filter(|(name, _)| COUNTS.contains(&name.as_str())) {
                *value = json!(if name == "fraction" { 0.5 } else { 2.0 });
            }
        }
    }
    serde_json::from_value(whole).unwrap_or_else(|_| recipe.clone())
}

/// Adds the rows of all parameters below a path, except existing ones.
fn collect(whole: &Value, path: &str, value: &Value, rows: &mut Vec<Row>) -> Outcome<()> {
    match value {
        Value::Object(fields) if is_toml_table(value) => {
            fields.iter().try_for_each(|(name, value)| collect(whole, &format!("{path}.{name}"), value, rows))
        }
        _ if rows.iter().any(|row| row.path == path) => Ok(()),
        Value::String(_) => {
            rows.push(choice(whole, path).ok_or_else(|| format!("{path}: add its values to `CHOICES`"))?);
            Ok(())
        }
        _ => {
            rows.push(number(whole, path, value).ok_or_else(|| format!("{path}: no other value was accepted"))?);
            Ok(())
        }
    }
}

fn choice(whole: &Value, path: &str) -> Option<Row> {
    let (_, values) = CHOICES.iter().find(|(known, _)| *known == path)?;
    let recipe: Recipe = serde_json::from_value(whole.clone()).ok()?;
    let tile = |value: &&str| Some(((*value).to_owned(), with(&recipe, path, json!(value))?));
    Some(Row { path: path.to_owned(), tiles: values.iter().map(tile).collect::<Option<_>>()? })
}

fn number(whole: &Value, path: &str, value: &Value) -> Option<Row> {
    let recipe: Recipe = alone(&serde_json::from_value(whole.clone()).ok()?, path);
    let [low, high] = match value {
        Value::Number(number) => [number.as_f64()?; 2],
        Value::Object(law) => {
            let numbers: Vec<f64> = law.values().next()?.as_array()?.iter().filter_map(Value::as_f64).collect();
            match law.keys().next()?.as_str() {
                "uniform" => [*numbers.first()?, *numbers.get(1)?],
                _ => [*numbers.first()?; 2],
            }
        }
        _ => return None,
    };
    let middle = 0.5 * (low + high);
    let name = path.rsplit('.').next().unwrap_or(path);
    let (low, high) = if PROBABILITIES.contains(&name) {
        (0.0, 1.0)
    } else if middle == 0.0 {
        let high = HIGH_OF_ZERO.iter().find(|(known, _)| *known == name).map_or(1.0, |(_, high)| *high);
        (0.0, high)
    } else {
        let high = UPPER_LIMITS.iter().find(|(known, _)| *known == path).map_or(f64::INFINITY, |(_, high)| *high);
        (middle / FACTOR, (middle * FACTOR).min(high))
    };
    let tile = |value: f64| nearest(&recipe, path, value, middle).map(|(value, recipe)| (shown(value), recipe));
    let tiles = vec![tile(low)?, tile(middle)?, tile(high)?];
    Some(Row { path: path.to_owned(), tiles })
}

/// Removes all debris except the kind of a path.
fn alone(recipe: &Recipe, path: &str) -> Recipe {
    let Some(kind) = path.strip_prefix("debris.").and_then(|rest| rest.split('.').next()) else {
        return recipe.clone();
    };
    let mut whole = serde_json::to_value(recipe).unwrap_or_default();
    let mine = whole["debris"][kind].clone();
    whole["debris"] = serde_json::to_value(Debris::none()).unwrap_or_default();
    whole["debris"][kind] = mine;
    serde_json::from_value(whole).unwrap_or_else(|_| recipe.clone())
}

/// Returns the recipe with the accepted value nearest to `wanted`, between `wanted` and the default.
fn nearest(recipe: &Recipe, path: &str, wanted: f64, middle: f64) -> Option<(f64, Recipe)> {
    const STEPS: i32 = 40;
    (0..=STEPS).find_map(|step| {
        let value = wanted + (middle - wanted) * f64::from(step) / f64::from(STEPS);
        // Counts accept only integers.
        [value, libm::round(value)].into_iter().find_map(|value| {
            with(recipe, path, json!(value)).or_else(|| with(recipe, path, json!(value as i64))).map(|r| (value, r))
        })
    })
}

/// Returns the recipe with another value at a path, or `None` if the recipe is invalid.
fn with(recipe: &Recipe, path: &str, value: Value) -> Option<Recipe> {
    let mut whole = serde_json::to_value(recipe).ok()?;
    let (section, name) = path.rsplit_once('.').unwrap_or(("", path));
    let mut at = &mut whole;
    for step in section.split('.').filter(|step| !step.is_empty()) {
        at = at.get_mut(step)?;
    }
    if name == "kind" {
        // Another kind has other fields.
        *at = json!({ "kind": value });
    } else {
        at.as_object_mut()?.insert(name.to_owned(), value);
    }
    let recipe: Recipe = serde_json::from_value(whole).ok()?;
    recipe.problems().is_empty().then_some(recipe)
}

fn shown(value: f64) -> String {
    if value != 0.0 && value.abs() < 0.01 {
        format!("{value:.1e}")
    } else {
        format!("{:.4}", value).trim_end_matches('0').trim_end_matches('.').to_owned()
    }
}
