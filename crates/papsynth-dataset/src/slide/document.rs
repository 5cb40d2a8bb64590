//! How a slide is an OME-Zarr image.

use papsynth::truth::Group;
use papsynth_zarr::{Channel, Form, Image, Kind, Labels, Pyramid, Space, Tiling, levels_until};
use serde_json::{Map, json};

use super::record::SlideHead;

/// Side of a chunk.
pub(super) const CHUNK: usize = 512;

/// Folder of the image.
pub(super) const IMAGE: &str = "slide.ome.zarr";

/// Name of the label image that counts cytoplasms.
pub(super) const LAYERS: &str = "layers";

/// The arrays of a slide.
#[derive(Debug)]
pub(super) struct Forms {
    pub(super) image: Pyramid,
    /// Of the labels of each group.
    pub(super) labels: Pyramid,
    pub(super) layers: Pyramid,
}

impl Forms {
    pub(super) fn new(head: &SlideHead) -> Result<Self, papsynth_zarr::Error> {
        let (width, height) = (head.width_px as usize, head.height_px as usize);
        let form = |kind, channels, planes| {
            let form = Form {
                kind,
                channels,
                planes,
                height,
                width,
                tiling: Tiling { chunk: CHUNK, shard: head.shard_px as usize, planes: 1 },
                levels: levels_until(CHUNK, width, height),
            };
            Pyramid::new(&form)
        };
        let kind = if head.bits <= 8 { Kind::U8 } else { Kind::U16 };
        let planes = (head.planes_um.len() > 1).then_some(head.planes_um.len());
        let channels = (head.channels > 1).then_some(head.channels);
        Ok(Self {
            image: form(kind, channels, planes)?,
            labels: form(Kind::U32, None, None)?,
            layers: form(Kind::U16, None, None)?,
        })
    }

    /// The documents of the image, by their paths in the slide's folder.
    pub(super) fn documents(&self, head: &SlideHead) -> Result<Vec<(String, Vec<u8>)>, papsynth_zarr::Error> {
        let most = f64::from((1_u32 << head.bits) - 1);
        let channel =
            |label: &str, color| Channel { label: label.to_owned(), color, range: [0.0, most], window: [0.0, most] };
        let channels = match head.channels {
            1 => vec![channel("grey", [255; 3])],
            _ => vec![channel("red", [255, 0, 0]), channel("green", [0, 255, 0]), channel("blue", [0, 0, 255])],
        };
        let labels = |name: &str, pyramid: &Pyramid| Labels {
            name: name.to_owned(),
            pyramid: pyramid.clone(),
            colors: Vec::new(),
            properties: Vec::new(),
        };
        let planes = &head.planes_um;
        let image = Image {
            name: format!("papsynth slide {} of seed {}", head.slide, head.identity.seed),
            pyramid: self.image.clone(),
            space: Space {
                pixel_um: head.pixel_um,
                step_um: planes.get(1).map_or(1.0, |second| second - planes[0]),
                first_um: planes[0],
            },
            channels,
            plane: planes.len() / 2,
            labels: Group::ALL
                .iter()
                .map(|group| labels(group.name(), &self.labels))
                .chain([labels(LAYERS, &self.layers)])
                .collect(),
            attributes: Map::from_iter([(
                "papsynth".to_owned(),
                json!({ "seed": head.identity.seed, "slide": head.slide, "recipe_sha256": head.identity.recipe_sha256 }),
            )]),
        };
        let documents = image.documents()?.into_iter();
        Ok(documents.map(|(path, bytes)| (format!("{IMAGE}/{path}"), bytes)).collect())
    }
}

/// The folder of a level of the image, or of the labels of a name.
pub(super) fn folder(labels: Option<&str>, level: usize) -> String {
    match labels {
        None => format!("{IMAGE}/{level}"),
        Some(name) => format!("{IMAGE}/labels/{name}/{level}"),
    }
}
