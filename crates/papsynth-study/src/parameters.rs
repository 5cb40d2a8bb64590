//! Properties of synthetic patches, for the breakdown of answers.

use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;

use serde::{Deserialize, Serialize};

use crate::error::Error;
use crate::fields::{Field, Frame, Root};

/// The value of a parameter: a number, or the text of another recipe value.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(untagged)]
pub(crate) enum Value {
    Number(f64),
    Text(String),
}

/// Names and values of parameters. Names end in their unit.
pub(crate) type Parameters = BTreeMap<String, Value>;

/// The columns that are read for an object or part of a cell.
#[derive(Debug, Clone, Deserialize)]
struct Row {
    part: String,
    kind: String,
    mean_absorbance: f64,
    bbox_x_px: f64,
    bbox_y_px: f64,
    bbox_width_px: f64,
    bbox_height_px: f64,
    /// One value for each plane, separated by semicolons.
    defocus_um: String,
}

#[derive(Debug)]
pub(crate) struct Objects(Vec<Row>);

impl Objects {
    /// Reads the table of a frame.
    pub(crate) fn read(root: &Root, frame: &Frame) -> Result<Self, Error> {
        let path = frame.root.join(format!("objects/{:06}.csv", frame.summary.index));
        Self::parse(&root.text(&path)?, &path)
    }

    fn parse(text: &str, path: &Path) -> Result<Self, Error> {
        let mut reader = csv::Reader::from_reader(text.as_bytes());
        let rows = reader.deserialize().collect::<Result<_, _>>();
        rows.map(Self).map_err(|error| Error::folder(path, format!("not a valid table of objects: {error}")))
    }

    /// Returns the parameters of a square patch in pixels of the file.
    pub(crate) fn of_patch(&self, frame: &Frame, corner: [f64; 2], side: f64) -> Parameters {
        let touches = |row: &&Row| {
            row.bbox_x_px < corner[0] + side
                && corner[0] < row.bbox_x_px + row.bbox_width_px
                && row.bbox_y_px < corner[1] + side
                && corner[1] < row.bbox_y_px + row.bbox_height_px
        };
        let touching: Vec<&Row> = self.0.iter().filter(touches).collect();
        let plane = frame.summary.planes_um.len() / 2;
        let part = |part: &'static str| touching.iter().filter(move |row| row.kind == "cell" && row.part == part);
        let cells = |rows: &[Row]| rows.iter().filter(|row| row.part == "cytoplasm").count() as f64;
        let defocus = |row: &&&Row| row.defocus_um.split(';').nth(plane).and_then(|um| um.parse::<f64>().ok());
        let area_mm2 = {
            let um = frame.summary.pixel_um / 1000.0;
            frame.summary.width as f64 * frame.summary.height as f64 * um * um
        };
        let numbers = [
            ("field_cells_per_mm2", Some(cells(&self.0) / area_mm2)),
            ("field_max_overlap", Some(f64::from(frame.summary.max_overlap))),
            ("patch_cells", Some(part("cytoplasm").count() as f64)),
            ("patch_nuclei", Some(part("nucleus").count() as f64)),
            ("patch_debris", Some(touching.iter().filter(|row| row.kind != "cell").count() as f64)),
            ("patch_defocus_um", mean(part("cytoplasm").filter_map(|row| defocus(&row).map(f64::abs)))),
            ("patch_cytoplasm_absorbance", mean(part("cytoplasm").map(|row| row.mean_absorbance))),
            ("patch_nucleus_absorbance", mean(part("nucleus").map(|row| row.mean_absorbance))),
        ];
        let known = numbers.into_iter().filter_map(|(name, value)| Some((name, value.filter(|v| v.is_finite())?)));
        known.map(|(name, value)| (name.to_owned(), Value::Number(value))).collect()
    }
}

fn mean(values: impl Iterator<Item = f64>) -> Option<f64> {
    let (sum, count) = values.fold((0.0, 0.0), |(sum, count), value| (sum + value, count + 1.0));
    (count > 0.0).then(|| sum / count)
}

/// Returns for each field the recipe values in which the fields differ.
pub(crate) fn varied(fields: &[&Field]) -> Vec<Parameters> {
    let none = BTreeMap::new();
    let recipes: Vec<&BTreeMap<String, toml::Value>> =
        fields.iter().map(|field| field.frame.as_ref().map_or(&none, |frame| &*frame.recipe)).collect();
    let mut names: BTreeSet<&String> = recipes.iter().flat_map(|recipe| recipe.keys()).collect();
    names.retain(|name| recipes.windows(2).any(|pair| pair[0].get(*name) != pair[1].get(*name)));
    let value = |value: &toml::Value| match value {
        toml::Value::Integer(number) => Value::Number(*number as f64),
        toml::Value::Float(number) if number.is_finite() => Value::Number(*number),
        toml::Value::String(text) => Value::Text(text.clone()),
        other => Value::Text(other.to_string()),
    };
    let of = |recipe: &&BTreeMap<String, toml::Value>| {
        names.iter().filter_map(|name| Some(((*name).clone(), value(recipe.get(*name)?)))).collect()
    };
    recipes.iter().map(of).collect()
}

#[cfg(test)]
mod tests {
    use std::path::PathBuf;
    use std::sync::Arc;

    use papsynth_dataset::FrameSummary;

    use super::*;

    fn frame(recipe: &str) -> Frame {
        let recipe: toml::Table = toml::from_str(recipe).unwrap();
        Frame {
            root: PathBuf::new(),
            summary: FrameSummary {
                index: 0,
                width: 1000,
                height: 1000,
                pixel_um: 0.25,
                bits: 8,
                training_bits: 8,
                channels: 1,
                slide: 0,
                planes_um: vec![-1.0, 0.0, 1.0],
                saturated_px: Vec::new(),
                clipped_px: Vec::new(),
                attempts: 1,
                cells: std::collections::BTreeMap::new(),
                objects: BTreeMap::new(),
                truncated: 0,
                max_overlap: 3,
                occluded_px: BTreeMap::new(),
            },
            recipe: Arc::new(recipe.into_iter().collect()),
        }
    }

    #[test]
    fn parameters_are_those_of_the_objects_on_a_patch() {
        let table = "image,part,kind,mean_absorbance,bbox_x_px,bbox_y_px,bbox_width_px,bbox_height_px,defocus_um,other\n\
            0,cytoplasm,cell,0.2,100,100,50,50,1;-2;3,a\n\
            0,nucleus,cell,0.6,120,120,10,10,1;-2;3,a\n\
            0,cytoplasm,cell,0.4,190,0,50,300,1;4;3,a\n\
            0,cytoplasm,cell,0.9,300,0,50,50,9;9;9,a\n\
            0,whole,speckle,0.1,150,150,2,2,0;0;0,a\n";
        let objects = Objects::parse(table, Path::new("t.csv")).unwrap();
        let found = objects.of_patch(&frame(""), [0.0, 0.0], 200.0);
        let number = |name: &str| match found.get(name) {
            Some(Value::Number(number)) => *number,
            other => panic!("{name}: {other:?}"),
        };
        assert_eq!(number("field_cells_per_mm2"), 3.0 / 0.0625);
        assert_eq!([number("patch_cells"), number("patch_nuclei"), number("patch_debris")], [2.0, 1.0, 1.0]);
        assert_eq!(number("patch_defocus_um"), 3.0);
        assert!((number("patch_cytoplasm_absorbance") - 0.3).abs() < 1e-12);
        // Without a nucleus there is no absorbance.
        assert!(!objects.of_patch(&frame(""), [500.0, 500.0], 200.0).contains_key("patch_nucleus_absorbance"));
        assert!(Objects::parse("a,b\n1,2\n", Path::new("t.csv")).is_err());
    }

    #[test]
    fn differing_recipe_values_are_found() {
        let field =
            |recipe: Option<&str>| Field { name: String::new(), path: PathBuf::new(), frame: recipe.map(frame) };
        let fields = [field(Some("a = 1\nb = 2.5\nc = [1, 2]")), field(Some("a = 1\nb = 3\nc = [1, 3]"))];
        let [first, second] = varied(&fields.iter().collect::<Vec<_>>()).try_into().unwrap();
        assert_eq!(first.keys().collect::<Vec<_>>(), ["b", "c"]);
        assert_eq!(second["b"], Value::Number(3.0));
        assert_eq!(second["c"], Value::Text("[1, 3]".to_owned()));
        let same = [field(Some("a = 1")), field(Some("a = 1"))];
        assert!(varied(&same.iter().collect::<Vec<_>>()).iter().all(Parameters::is_empty));
        assert!(varied(&[]).is_empty());
    }
}
