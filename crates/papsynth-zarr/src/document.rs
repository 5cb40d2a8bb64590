//! Metadata of OME-NGFF: the `zarr.json` documents of images and labels.

use std::collections::BTreeSet;

use serde_json::{Map, Value, json};

use crate::error::{Error, argument};
use crate::pyramid::Pyramid;

/// The version of OME-NGFF.
pub const VERSION: &str = "0.5";

/// Physical coordinates of the pixels, µm.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Coordinates {
    /// Size of a pixel of the full image.
    pub pixel_um: f64,
    /// Distance from a plane to the next, negative for descending planes. Ignored without a z axis.
    pub step_um: f64,
    /// Position of the first plane.
    pub first_um: f64,
}

/// Display settings of a channel.
#[derive(Debug, Clone, PartialEq)]
pub struct Channel {
    /// Name.
    pub label: String,
    /// Red, green and blue.
    pub color: [u8; 3],
    /// Smallest and largest possible value.
    pub range: [f64; 2],
    /// Values shown as black and as white.
    pub window: [f64; 2],
}

/// An image with labels: a Zarr group.
#[derive(Debug, Clone, PartialEq)]
pub struct Image {
    /// Name.
    pub name: String,
    /// Arrays, in the folders `0`, `1`, …
    pub pyramid: Pyramid,
    /// Physical coordinates of the pixels.
    pub coordinates: Coordinates,
    /// Channels in order; one for an image without a c axis.
    pub channels: Vec<Channel>,
    /// Index of the plane that a viewer shows first.
    pub plane: usize,
    /// Label images, in the folders `labels/NAME`.
    pub labels: Vec<Labels>,
    /// Further attributes, besides those of OME.
    pub attributes: Map<String, Value>,
}

/// A label image: the object of each pixel; 0 is background. Pixels and levels have the coordinates of those of the
/// image.
#[derive(Debug, Clone, PartialEq)]
pub struct Labels {
    /// Name of letters, digits, `-`, `_` and dots. The first character is not a dot.
    pub name: String,
    /// Arrays, in the folders `0`, `1`, … of the label image; as many as in the image.
    pub pyramid: Pyramid,
    /// Colours of labels: red, green, blue and opacity. A viewer chooses the colours of other labels.
    pub colors: Vec<(u32, [u8; 4])>,
    /// Properties of objects. A label may have several entries.
    pub properties: Vec<(u32, Map<String, Value>)>,
}

impl Labels {
    /// Returns the folder of the label image in that of the image.
    #[must_use]
    pub fn folder(&self) -> String {
        format!("labels/{}", self.name)
    }

    fn document(&self, coordinates: &Coordinates) -> Value {
        let colors: Vec<Value> =
            self.colors.iter().map(|(label, rgba)| json!({ "label-value": label, "rgba": rgba })).collect();
        let properties = self.properties.iter().map(|(label, known)| {
            let mut entry = Map::from_iter([("label-value".to_owned(), json!(label))]);
            entry.extend(known.clone());
            Value::Object(entry)
        });
        let mut label = Map::new();
        if !colors.is_empty() {
            label.insert("colors".to_owned(), json!(colors));
        }
        if !self.properties.is_empty() {
            label.insert("properties".to_owned(), properties.collect());
        }
        label.insert("source".to_owned(), json!({ "image": "../../" }));
        group(&json!({
            "version": VERSION,
            "multiscales": [multiscales(&self.name, &self.pyramid, coordinates, "nearest")],
            "image-label": label,
        }))
    }
}

impl Image {
    /// Returns all `zarr.json` of the group: the path in the folder of the group, and the content. With the shards of
    /// all arrays they are the complete image.
    ///
    /// # Errors
    /// If the number of channels is wrong, a label image differs from the image in size or number of levels or is not
    /// of integers, a name is invalid or used twice, the pixel size is not above 0 µm, or the step is 0.
    pub fn documents(&self) -> Result<Vec<(String, Vec<u8>)>, Error> {
        self.check()?;
        let mut attributes = self.attributes.clone();
        let ome = json!({
            "version": VERSION,
            "multiscales": [multiscales(&self.name, &self.pyramid, &self.coordinates, "mean")],
            "omero": self.omero(),
        });
        attributes.insert("ome".to_owned(), ome);
        let mut documents =
            vec![("zarr.json".to_owned(), json!({ "zarr_format": 3, "node_type": "group", "attributes": attributes }))];
        documents.extend(arrays("", &self.pyramid));
        if !self.labels.is_empty() {
            let names: Vec<&str> = self.labels.iter().map(|labels| labels.name.as_str()).collect();
            documents.push(("labels/zarr.json".to_owned(), group(&json!({ "version": VERSION, "labels": names }))));
        }
        for labels in &self.labels {
            let folder = labels.folder();
            documents.push((format!("{folder}/zarr.json"), labels.document(&self.coordinates)));
            documents.extend(arrays(&format!("{folder}/"), &labels.pyramid));
        }
        Ok(documents.into_iter().map(|(path, document)| (path, format!("{document:#}\n").into_bytes())).collect())
    }

    fn check(&self) -> Result<(), Error> {
        let full = &self.pyramid.levels()[0];
        let [channels, planes, ..] = full.shape();
        if self.channels.len() != channels {
            return argument(format!("channels: found {}; expected {channels}, as in the image", self.channels.len()));
        }
        if self.plane >= planes {
            return argument(format!("plane: {} is out of range; expected less than {planes}", self.plane));
        }
        let Coordinates { pixel_um, step_um, first_um } = self.coordinates;
        if !(pixel_um > 0.0 && pixel_um.is_finite()) {
            return argument(format!("pixel_um: {pixel_um} is out of range; expected a number above 0"));
        }
        if full.has[1] && !(step_um != 0.0 && step_um.is_finite() && first_um.is_finite()) {
            return argument(format!(
                "step_um, first_um: found {step_um} and {first_um}; expected finite numbers, and a step other than 0"
            ));
        }
        let mut names = BTreeSet::new();
        for Labels { name, pyramid, .. } in &self.labels {
            let is_fine = |c: char| c.is_ascii_alphanumeric() || matches!(c, '-' | '_' | '.');
            if name.is_empty() || name.starts_with('.') || name == "zarr.json" || !name.chars().all(is_fine) {
                let name = name.escape_default();
                return argument(format!(
                    "labels: invalid name `{name}`; expected letters, digits, `-`, `_` and dots (not first)"
                ));
            }
            // File names may be case-insensitive.
            if !names.insert(name.to_lowercase()) {
                return argument(format!("labels: the name `{name}` is used twice"));
            }
            if pyramid.levels().len() != self.pyramid.levels().len() {
                let [found, due] = [pyramid, &self.pyramid].map(|pyramid| pyramid.levels().len());
                return argument(format!("labels: `{name}` has {found} levels; expected {due}, as in the image"));
            }
            let [labels, image] = [&pyramid.levels()[0], full];
            if labels.shape()[2..] != image.shape()[2..] {
                let message = "differs in width or height from the image";
                return argument(format!("labels: `{name}` {message}"));
            }
            if labels.kind() == crate::DataType::F32 {
                return argument(format!("labels: `{name}` has the type float32; expected integers"));
            }
        }
        Ok(())
    }

    /// Returns the metadata with the names and display ranges of channels.
    fn omero(&self) -> Value {
        let hex = |color: [u8; 3]| color.iter().map(|part| format!("{part:02X}")).collect::<String>();
        let channels = self.channels.iter().map(|channel| {
            let ([min, max], [start, end]) = (channel.range, channel.window);
            json!({
                "active": true,
                "label": channel.label,
                "color": hex(channel.color),
                "coefficient": 1.0,
                "family": "linear",
                "inverted": false,
                "window": { "min": min, "max": max, "start": start, "end": end },
            })
        });
        let model = if self.channels.len() == 1 { "greyscale" } else { "color" };
        json!({
            "channels": channels.collect::<Vec<_>>(),
            "rdefs": { "defaultT": 0, "defaultZ": self.plane, "model": model },
        })
    }
}

fn group(ome: &Value) -> Value {
    json!({ "zarr_format": 3, "node_type": "group", "attributes": { "ome": ome } })
}

/// Returns the documents of the arrays of a pyramid.
fn arrays<'a>(folder: &'a str, pyramid: &'a Pyramid) -> impl Iterator<Item = (String, Value)> + 'a {
    let numbered = pyramid.levels().iter().enumerate();
    numbered.map(move |(number, array)| (format!("{folder}{number}/zarr.json"), array.document()))
}

/// Returns the axes and the coordinates of each level. The centre of a pixel is that of the full-size pixels that it
/// covers.
fn multiscales(name: &str, pyramid: &Pyramid, coordinates: &Coordinates, how: &str) -> Value {
    let full = &pyramid.levels()[0];
    let micrometre = |name: &str| json!({ "name": name, "type": "space", "unit": "micrometer" });
    let axes = [json!({ "name": "c", "type": "channel" }), micrometre("z"), micrometre("y"), micrometre("x")];
    let datasets = (0_u32..).zip(pyramid.levels()).map(|(number, array)| {
        let factor = f64::from(1_u32 << number);
        let (size, centre) = (coordinates.pixel_um * factor, coordinates.pixel_um * (factor - 1.0) / 2.0);
        json!({
            "path": number.to_string(),
            "coordinateTransformations": [
                { "type": "scale", "scale": array.of_axes([1.0, coordinates.step_um, size, size]) },
                { "type": "translation", "translation": array.of_axes([0.0, coordinates.first_um, centre, centre]) },
            ],
        })
    });
    json!({
        "name": name,
        "axes": full.of_axes(axes),
        "datasets": datasets.collect::<Vec<_>>(),
        "type": how,
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::pyramid::{PyramidShape, Tiling};
    use crate::sample::DataType;

    fn shape(kind: DataType) -> PyramidShape {
        let tiling = Tiling { chunk: 16, shard: 32, planes: 1 };
        PyramidShape { kind, channels: None, planes: None, height: 50, width: 70, tiling, levels: 3 }
    }

    fn labels(name: &str) -> Labels {
        let known = Map::from_iter([("class".to_owned(), json!("superficial"))]);
        Labels {
            name: name.to_owned(),
            pyramid: Pyramid::new(&shape(DataType::U32)).unwrap(),
            colors: vec![(7, [1, 2, 3, 255])],
            properties: vec![(7, known)],
        }
    }

    fn image() -> Image {
        let shape = PyramidShape { channels: Some(1), planes: Some(4), ..shape(DataType::U16) };
        let channel =
            Channel { label: "grey".to_owned(), color: [255; 3], range: [0.0, 4095.0], window: [10.0, 4000.0] };
        Image {
            name: "000007".to_owned(),
            pyramid: Pyramid::new(&shape).unwrap(),
            coordinates: Coordinates { pixel_um: 0.25, step_um: 0.5, first_um: -1.0 },
            channels: vec![channel],
            plane: 2,
            labels: vec![labels("nucleus-0"), labels("nucleus-1")],
            attributes: Map::from_iter([("mine".to_owned(), json!(1))]),
        }
    }

    fn document(image: &Image, path: &str) -> Value {
        let documents = image.documents().unwrap();
        let (_, bytes) = documents.iter().find(|(name, _)| name == path).unwrap();
        serde_json::from_slice(bytes).unwrap()
    }

    #[test]
    fn every_group_and_array_has_a_document() {
        let paths: Vec<String> = image().documents().unwrap().into_iter().map(|(path, _)| path).collect();
        let of = |folder: &str| ["", "0/", "1/", "2/"].map(|level| format!("{folder}{level}zarr.json")).to_vec();
        let labels = "labels/zarr.json".to_owned();
        assert_eq!(paths, [of(""), vec![labels], of("labels/nucleus-0/"), of("labels/nucleus-1/")].concat());
        assert_eq!(document(&image(), "labels/zarr.json")["attributes"]["ome"]["labels"][1], "nucleus-1");
        let alone = Image { labels: Vec::new(), ..image() };
        assert_eq!(alone.documents().unwrap().len(), 4);
    }

    #[test]
    fn pixels_of_all_levels_are_aligned() {
        let ome = document(&image(), "zarr.json")["attributes"]["ome"].clone();
        let scales = &ome["multiscales"][0];
        let names: Vec<&str> = scales["axes"].as_array().unwrap().iter().map(|a| a["name"].as_str().unwrap()).collect();
        assert_eq!(names, ["c", "z", "y", "x"]);
        let transforms = &scales["datasets"][2]["coordinateTransformations"];
        assert_eq!(transforms[0]["scale"], json!([1.0, 0.5, 1.0, 1.0]));
        // The centres of four pixels of 0.25 µm are at 0 to 0.75 µm.
        assert_eq!(transforms[1]["translation"], json!([0.0, -1.0, 0.375, 0.375]));
        assert_eq!(ome["omero"]["channels"][0]["window"]["end"], 4000.0);
        let label = document(&image(), "labels/nucleus-1/zarr.json")["attributes"]["ome"].clone();
        assert_eq!(label["image-label"]["properties"], json!([{ "label-value": 7, "class": "superficial" }]));
        assert_eq!(label["image-label"]["colors"], json!([{ "label-value": 7, "rgba": [1, 2, 3, 255] }]));
        assert_eq!(label["multiscales"][0]["datasets"].as_array().unwrap().len(), 3);
        let array = document(&image(), "1/zarr.json");
        assert_eq!(array["shape"], json!([1, 4, 25, 35]));
        assert_eq!(array["dimension_names"], json!(["c", "z", "y", "x"]));
    }

    #[test]
    fn invalid_images_are_refused() {
        let with = |change: fn(&mut Image)| {
            let mut image = image();
            change(&mut image);
            image.documents().unwrap_err().to_string()
        };
        assert!(with(|image| image.channels.clear()).starts_with("channels: found 0"));
        assert!(with(|image| image.plane = 4).starts_with("plane: 4"));
        assert!(with(|image| image.coordinates.pixel_um = f64::NAN).starts_with("pixel_um"));
        assert!(with(|image| image.coordinates.step_um = 0.0).starts_with("step_um"));
        assert!(with(|image| image.labels[1].name = "../up".to_owned()).contains("invalid name `../up`"));
        assert!(with(|image| image.labels[1].name = "NUCLEUS-0".to_owned()).contains("twice"));
        let pyramid = |change: fn(&mut PyramidShape)| {
            let mut shape = shape(DataType::U32);
            change(&mut shape);
            let labels = Labels { pyramid: Pyramid::new(&shape).unwrap(), ..labels("nucleus-0") };
            Image { labels: vec![labels], ..image() }.documents().unwrap_err().to_string()
        };
        assert!(pyramid(|shape| shape.levels = 2).contains("has 2 levels; expected 3"));
        assert!(pyramid(|shape| shape.width = 71).contains("differs in width"));
        assert!(pyramid(|shape| shape.kind = DataType::F32).contains("float32"));
    }
}
