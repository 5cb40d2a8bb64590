//! What makes arrays an image: the documents of OME-NGFF.

use std::collections::BTreeSet;

use serde_json::{Map, Value, json};

use crate::error::{Error, argument};
use crate::pyramid::Pyramid;

/// The version of OME-NGFF that is written.
pub const VERSION: &str = "0.5";

/// Where pixels lie, in µm.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Space {
    /// Side of a pixel of the full image.
    pub pixel_um: f64,
    /// From a plane to the next, below 0 if that lies lower; of no meaning without an axis z.
    pub step_um: f64,
    /// Where the first plane lies.
    pub first_um: f64,
}

/// How a viewer first shows a channel.
#[derive(Debug, Clone, PartialEq)]
pub struct Channel {
    /// What it is called.
    pub label: String,
    /// Red, green and blue.
    pub color: [u8; 3],
    /// The least and the largest value that there can be.
    pub range: [f64; 2],
    /// The values shown as black and as white.
    pub window: [f64; 2],
}

/// An image with its labels: a group of Zarr.
#[derive(Debug, Clone, PartialEq)]
pub struct Image {
    /// What it is called.
    pub name: String,
    /// Its arrays, in the folders `0`, `1`, …
    pub pyramid: Pyramid,
    /// Where its pixels lie.
    pub space: Space,
    /// Its channels, in their order; one of an image without an axis c.
    pub channels: Vec<Channel>,
    /// The plane that a viewer first shows.
    pub plane: usize,
    /// Label images, in the folders `labels/NAME`.
    pub labels: Vec<Labels>,
    /// Attributes beside those of OME.
    pub attributes: Map<String, Value>,
}

/// A label image: which object each pixel shows; 0 is none. Its pixels lie where those of its image do, as do their levels.
#[derive(Debug, Clone, PartialEq)]
pub struct Labels {
    /// What it is called: letters, digits, `-`, `_` and dots within.
    pub name: String,
    /// Its arrays, as many as its image has, in the folders `0`, `1`, … of its own.
    pub pyramid: Pyramid,
    /// Colours of labels, as red, green, blue and opacity; of those that are not named a viewer chooses.
    pub colors: Vec<(u32, [u8; 4])>,
    /// What is known of objects; a label may have several.
    pub properties: Vec<(u32, Map<String, Value>)>,
}

impl Labels {
    /// The folder of the group, from that of the image.
    #[must_use]
    pub fn folder(&self) -> String {
        format!("labels/{}", self.name)
    }

    fn document(&self, space: &Space) -> Value {
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
            "multiscales": [multiscales(&self.name, &self.pyramid, space, "nearest")],
            "image-label": label,
        }))
    }
}

impl Image {
    /// Every `zarr.json` of the group, as its path from the group's folder and its content. With the shards of all arrays they are the whole image.
    ///
    /// # Errors
    /// If there are other channels than the image has, a label image has another size or another number of levels than the image or is not made of
    /// integers, its name is none or another's, a pixel is not above 0 µm, or a step is 0.
    pub fn documents(&self) -> Result<Vec<(String, Vec<u8>)>, Error> {
        self.check()?;
        let mut attributes = self.attributes.clone();
        let ome = json!({
            "version": VERSION,
            "multiscales": [multiscales(&self.name, &self.pyramid, &self.space, "mean")],
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
            documents.push((format!("{folder}/zarr.json"), labels.document(&self.space)));
            documents.extend(arrays(&format!("{folder}/"), &labels.pyramid));
        }
        Ok(documents.into_iter().map(|(path, document)| (path, format!("{document:#}\n").into_bytes())).collect())
    }

    fn check(&self) -> Result<(), Error> {
        let full = &self.pyramid.levels()[0];
        let [channels, planes, ..] = full.shape();
        if self.channels.len() != channels {
            return argument(format!("channels: {} are described, the image has {channels}", self.channels.len()));
        }
        if self.plane >= planes {
            return argument(format!("plane: {} is not below {planes}", self.plane));
        }
        let Space { pixel_um, step_um, first_um } = self.space;
        if !(pixel_um > 0.0 && pixel_um.is_finite()) {
            return argument(format!("pixel_um: {pixel_um} is not above 0"));
        }
        if full.has[1] && !(step_um != 0.0 && step_um.is_finite() && first_um.is_finite()) {
            return argument(format!("step_um: {step_um} from {first_um} on does not lead to other planes"));
        }
        let mut names = BTreeSet::new();
        for Labels { name, pyramid, .. } in &self.labels {
            let is_fine = |c: char| c.is_ascii_alphanumeric() || matches!(c, '-' | '_' | '.');
            if name.is_empty() || name.starts_with('.') || name == "zarr.json" || !name.chars().all(is_fine) {
                let name = name.escape_default();
                return argument(format!("labels: `{name}` is no name of letters, digits, `-`, `_` and dots within"));
            }
            // Some systems do not tell small letters from large ones.
            if !names.insert(name.to_lowercase()) {
                return argument(format!("labels: `{name}` is there twice"));
            }
            if pyramid.levels().len() != self.pyramid.levels().len() {
                let [found, due] = [pyramid, &self.pyramid].map(|pyramid| pyramid.levels().len());
                return argument(format!("labels: `{name}` has {found} levels, its image {due}"));
            }
            let [labels, image] = [&pyramid.levels()[0], full];
            if labels.shape()[2..] != image.shape()[2..] {
                let message = "has another width or height than its image";
                return argument(format!("labels: `{name}` {message}"));
            }
            if labels.kind() == crate::Kind::F32 {
                return argument(format!("labels: `{name}` is of float32; accepted are integers"));
            }
        }
        Ok(())
    }

    /// What viewers take contrast and names of channels from.
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

/// The documents of the arrays of a pyramid.
fn arrays<'a>(folder: &'a str, pyramid: &'a Pyramid) -> impl Iterator<Item = (String, Value)> + 'a {
    let numbered = pyramid.levels().iter().enumerate();
    numbered.map(move |(number, array)| (format!("{folder}{number}/zarr.json"), array.document()))
}

/// Axes, and where the pixels of each level lie: the middle of a pixel is that of those it stands for.
fn multiscales(name: &str, pyramid: &Pyramid, space: &Space, how: &str) -> Value {
    let full = &pyramid.levels()[0];
    let micrometre = |name: &str| json!({ "name": name, "type": "space", "unit": "micrometer" });
    let axes = [json!({ "name": "c", "type": "channel" }), micrometre("z"), micrometre("y"), micrometre("x")];
    let datasets = (0_u32..).zip(pyramid.levels()).map(|(number, array)| {
        let factor = f64::from(1_u32 << number);
        let (side, middle) = (space.pixel_um * factor, space.pixel_um * (factor - 1.0) / 2.0);
        json!({
            "path": number.to_string(),
            "coordinateTransformations": [
                { "type": "scale", "scale": array.of_axes([1.0, space.step_um, side, side]) },
                { "type": "translation", "translation": array.of_axes([0.0, space.first_um, middle, middle]) },
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
    use crate::pyramid::{Form, Tiling};
    use crate::sample::Kind;

    fn form(kind: Kind) -> Form {
        let tiling = Tiling { chunk: 16, shard: 32, planes: 1 };
        Form { kind, channels: None, planes: None, height: 50, width: 70, tiling, levels: 3 }
    }

    fn labels(name: &str) -> Labels {
        let known = Map::from_iter([("class".to_owned(), json!("superficial"))]);
        Labels {
            name: name.to_owned(),
            pyramid: Pyramid::new(&form(Kind::U32)).unwrap(),
            colors: vec![(7, [1, 2, 3, 255])],
            properties: vec![(7, known)],
        }
    }

    fn image() -> Image {
        let form = Form { channels: Some(1), planes: Some(4), ..form(Kind::U16) };
        let channel =
            Channel { label: "grey".to_owned(), color: [255; 3], range: [0.0, 4095.0], window: [10.0, 4000.0] };
        Image {
            name: "000007".to_owned(),
            pyramid: Pyramid::new(&form).unwrap(),
            space: Space { pixel_um: 0.25, step_um: 0.5, first_um: -1.0 },
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
    fn there_is_a_document_for_every_group_and_array() {
        let paths: Vec<String> = image().documents().unwrap().into_iter().map(|(path, _)| path).collect();
        let of = |folder: &str| ["", "0/", "1/", "2/"].map(|level| format!("{folder}{level}zarr.json")).to_vec();
        let labels = "labels/zarr.json".to_owned();
        assert_eq!(paths, [of(""), vec![labels], of("labels/nucleus-0/"), of("labels/nucleus-1/")].concat());
        assert_eq!(document(&image(), "labels/zarr.json")["attributes"]["ome"]["labels"][1], "nucleus-1");
        let alone = Image { labels: Vec::new(), ..image() };
        assert_eq!(alone.documents().unwrap().len(), 4);
    }

    #[test]
    fn pixels_of_every_level_lie_over_those_they_stand_for() {
        let ome = document(&image(), "zarr.json")["attributes"]["ome"].clone();
        let scales = &ome["multiscales"][0];
        let names: Vec<&str> = scales["axes"].as_array().unwrap().iter().map(|a| a["name"].as_str().unwrap()).collect();
        assert_eq!(names, ["c", "z", "y", "x"]);
        let transforms = &scales["datasets"][2]["coordinateTransformations"];
        assert_eq!(transforms[0]["scale"], json!([1.0, 0.5, 1.0, 1.0]));
        // The first of four pixels of 0.25 µm has its middle at 0, the last at 0.75.
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
    fn what_no_reader_would_take_is_refused() {
        let with = |change: fn(&mut Image)| {
            let mut image = image();
            change(&mut image);
            image.documents().unwrap_err().to_string()
        };
        assert!(with(|image| image.channels.clear()).starts_with("channels: 0 are described"));
        assert!(with(|image| image.plane = 4).starts_with("plane: 4"));
        assert!(with(|image| image.space.pixel_um = f64::NAN).starts_with("pixel_um"));
        assert!(with(|image| image.space.step_um = 0.0).starts_with("step_um"));
        assert!(with(|image| image.labels[1].name = "../up".to_owned()).contains("`../up` is no name"));
        assert!(with(|image| image.labels[1].name = "NUCLEUS-0".to_owned()).contains("twice"));
        let pyramid = |change: fn(&mut Form)| {
            let mut form = form(Kind::U32);
            change(&mut form);
            let labels = Labels { pyramid: Pyramid::new(&form).unwrap(), ..labels("nucleus-0") };
            Image { labels: vec![labels], ..image() }.documents().unwrap_err().to_string()
        };
        assert!(pyramid(|form| form.levels = 2).contains("has 2 levels, its image 3"));
        assert!(pyramid(|form| form.width = 71).contains("another width"));
        assert!(pyramid(|form| form.kind = Kind::F32).contains("float32"));
    }
}
