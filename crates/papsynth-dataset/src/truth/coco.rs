//! COCO documents of frames and data sets.

use papsynth::scene::{ObjectKind, Tint};
use papsynth::truth::{Group, Mask, ObjectTruth, Part, Traits, Truth};
use serde::{Deserialize, Serialize};

use super::frame::{Category, FrameSummary, category_name, group};
use super::rle;
use crate::error::InputError;

#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub(crate) struct Rle {
    /// Rows and columns.
    size: [usize; 2],
    counts: String,
}

impl Rle {
    fn new(mask: &Mask, width: usize, height: usize) -> Self {
        Self { size: [height, width], counts: rle::encode(mask, width, height) }
    }

    fn mask(&self) -> Result<Mask, InputError> {
        let [height, width] = self.size;
        rle::decode(&self.counts, width, height)
    }
}

#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub(crate) struct Image {
    pub(crate) id: u64,
    width: usize,
    height: usize,
    file_name: String,
    #[serde(skip_serializing_if = "Option::is_none", default)]
    all_in_focus: Option<String>,
    pixel_um: f64,
    /// Saturated pixels of each plane, if there are any.
    #[serde(skip_serializing_if = "Vec::is_empty", default)]
    saturated: Vec<Rle>,
}

impl Image {
    fn new(frame: &FrameSummary, saturated: &[Mask], (file_name, all_in_focus): (String, Option<String>)) -> Self {
        Self {
            id: frame.index,
            width: frame.width,
            height: frame.height,
            file_name,
            all_in_focus,
            pixel_um: frame.pixel_um,
            saturated: if saturated.iter().all(Mask::is_empty) {
                Vec::new()
            } else {
                saturated.iter().map(|mask| Rle::new(mask, frame.width, frame.height)).collect()
            },
        }
    }
}

/// An object or part of a cell: the fields of COCO, and the other ground truth.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub(crate) struct Annotation {
    /// Number in the document, from 1. The document is that of a shard, or the merged one of all frames.
    pub(crate) id: u64,
    pub(crate) image_id: u64,
    pub(crate) category_id: u32,
    bbox: [u32; 4],
    area: u64,
    /// 1 for an ignored object: a nucleus or a mimic of a nucleus that cannot be seen, else 0.
    pub(crate) iscrowd: u8,
    /// The complete (amodal) mask.
    segmentation: Rle,
    /// The visible mask: pixels in which the object is the nearest of its group to the objective.
    visible: Rle,
    visible_area: u64,
    /// Id of the object in label images and tables. Nucleus and cytoplasm of a cell have the same id.
    object_id: u32,
    /// For a nucleus: the annotation of its cytoplasm, if the image shows it.
    pub(crate) parent_id: Option<u64>,
    part: Part,
    kind: String,
    class: String,
    bethesda: String,
    traits: Traits,
    /// Class in semantic segmentation.
    #[serde(default)]
    semantic_class: String,
    cluster: u32,
    centre_um: [f64; 2],
    depth_um: f64,
    mean_absorbance: f64,
    tint: String,
    rotation_deg: f64,
    area_um2: f64,
    centroid: Option<[f64; 2]>,
    truncated: bool,
    defocus_um: Vec<f64>,
    detectability: Vec<f64>,
}

impl Annotation {
    fn new(
        id: u64,
        parent_id: Option<u64>,
        object: &ObjectTruth,
        frame: &FrameSummary,
        category_id: u32,
        is_ignored: bool,
    ) -> Self {
        let segmentation = Rle::new(&object.amodal, frame.width, frame.height);
        let visible = match object.visible == object.amodal {
            true => segmentation.clone(),
            false => Rle::new(&object.visible, frame.width, frame.height),
        };
        Self {
            id,
            image_id: frame.index,
            category_id,
            bbox: box_of(&object.amodal),
            area: object.amodal.area(),
            iscrowd: is_ignored.into(),
            segmentation,
            visible,
            visible_area: object.visible.area(),
            object_id: object.id,
            parent_id,
            part: object.part,
            kind: object.kind.name().to_owned(),
            class: object.class.clone(),
            bethesda: object.bethesda.clone(),
            traits: object.traits.clone(),
            semantic_class: object.semantic_class().name().to_owned(),
            cluster: object.cluster,
            centre_um: object.centre_um,
            depth_um: object.depth_um,
            mean_absorbance: object.mean_absorbance,
            tint: object.tint_name().to_owned(),
            rotation_deg: object.rotation_deg,
            area_um2: object.area_um2,
            centroid: object.amodal.centroid(),
            truncated: object.truncated,
            defocus_um: object.defocus_um.clone(),
            detectability: object.detectability.clone(),
        }
    }

    /// Returns the annotation with `offset` added to its id and to that of its parent.
    pub(crate) fn renumbered(self, offset: u64) -> Self {
        let parent_id = self.parent_id.map(|parent| parent.saturating_add(offset));
        Self { id: self.id.saturating_add(offset), parent_id, ..self }
    }

    /// Returns the ground truth of the object.
    ///
    /// # Errors
    /// If a mask is invalid, or differs from its box or areas.
    pub(crate) fn object(&self) -> Result<ObjectTruth, InputError> {
        let (amodal, visible) = (self.segmentation.mask()?, self.visible.mask()?);
        let wrong = |what: String| Err(InputError::broken("COCO", format!("annotation {}: {what}", self.id)));
        if self.area != amodal.area() {
            return wrong(format!("area is {}, but the mask has {} pixels", self.area, amodal.area()));
        }
        if self.bbox != box_of(&amodal) {
            return wrong(format!("bbox is {:?}, but that of the mask is {:?}", self.bbox, box_of(&amodal)));
        }
        if self.visible_area != visible.area() {
            let (stated, found) = (self.visible_area, visible.area());
            return wrong(format!("visible_area is {stated}, but the visible mask has {found} pixels"));
        }
        if self.centroid != amodal.centroid() {
            return wrong("centroid differs from that of the mask".to_owned());
        }
        let unknown = |what: &str, found: &str, accepted: &[&str]| {
            let (found, accepted) = (found.escape_default(), accepted.join(", "));
            InputError::broken("COCO", format!("annotation {}: unknown {what} `{found}`; expected {accepted}", self.id))
        };
        let kind = ObjectKind::ALL.into_iter().find(|kind| kind.name() == self.kind);
        let tint = (!self.tint.is_empty())
            .then(|| Tint::by_name(&self.tint).ok_or_else(|| unknown("tint", &self.tint, &Tint::ALL.map(Tint::name))));
        Ok(ObjectTruth {
            id: self.object_id,
            part: self.part,
            kind: kind.ok_or_else(|| unknown("kind", &self.kind, &ObjectKind::ALL.map(ObjectKind::name)))?,
            class: self.class.clone(),
            bethesda: self.bethesda.clone(),
            traits: self.traits.clone(),
            cluster: self.cluster,
            centre_um: self.centre_um,
            depth_um: self.depth_um,
            mean_absorbance: self.mean_absorbance,
            tint: tint.transpose()?,
            rotation_deg: self.rotation_deg,
            area_um2: self.area_um2,
            truncated: self.truncated,
            amodal,
            visible,
            defocus_um: self.defocus_um.clone(),
            detectability: self.detectability.clone(),
        })
    }
}

/// The complete (amodal) mask of an annotation.
#[derive(Deserialize)]
pub(crate) struct AmodalMask {
    pub(crate) image_id: u64,
    part: Part,
    segmentation: Rle,
}

impl AmodalMask {
    /// Returns the group and the mask.
    pub(crate) fn decode(&self) -> Result<(Group, Mask), InputError> {
        Ok((group(self.part), self.segmentation.mask()?))
    }
}

/// Whether a mask of an object extends beyond an image of this size.
pub(crate) fn extends_beyond(object: &ObjectTruth, width: usize, height: usize) -> bool {
    let bounds = [&object.amodal, &object.visible].into_iter().filter_map(Mask::bounds);
    bounds.into_iter().any(|b| (b.x + b.width) as usize > width || (b.y + b.height) as usize > height)
}

fn box_of(mask: &Mask) -> [u32; 4] {
    mask.bounds().map_or([0; 4], |b| [b.x, b.y, b.width, b.height])
}

#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub(crate) struct Info {
    description: String,
    version: String,
}

impl Default for Info {
    fn default() -> Self {
        Self { description: "papsynth data set: synthetic bright-field cytology".to_owned(), version: "1".to_owned() }
    }
}

#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub(crate) struct Document {
    pub(crate) info: Info,
    pub(crate) licenses: Vec<String>,
    pub(crate) categories: Vec<Category>,
    /// Annotations are before the images, because images are written at the end of a shard.
    pub(crate) annotations: Vec<Annotation>,
    pub(crate) images: Vec<Image>,
}

impl Document {
    /// Returns the document of one frame. Nuclei and mimics below `min_detectability` have `iscrowd` 1.
    ///
    /// # Errors
    /// If the category of an object is not in `categories`; the error is its name.
    pub(crate) fn of_frame(
        truth: &Truth,
        frame: &FrameSummary,
        saturated: &[Mask],
        categories: &[Category],
        files: (String, Option<String>),
        min_detectability: f64,
    ) -> Result<Self, String> {
        let parent = |object: &ObjectTruth| {
            let is_cell = |other: &ObjectTruth| other.part == Part::Cytoplasm && other.id == object.id;
            (object.part == Part::Nucleus).then(|| (1..).zip(&truth.objects).find(|(_, o)| is_cell(o))).flatten()
        };
        let annotation = |(id, object): (u64, &ObjectTruth)| {
            let name = category_name(&object.class, object.part);
            let category = categories.iter().find(|c| c.name == name).ok_or(name)?;
            let is_ignored = object.is_ignored(min_detectability);
            Ok(Annotation::new(id, parent(object).map(|(id, _)| id), object, frame, category.id, is_ignored))
        };
        Ok(Self {
            info: Info::default(),
            licenses: Vec::new(),
            categories: categories.to_vec(),
            annotations: (1..).zip(&truth.objects).map(annotation).collect::<Result<_, String>>()?,
            images: vec![Image::new(frame, saturated, files)],
        })
    }

    pub(crate) fn image(&self, index: u64) -> Option<&Image> {
        self.images.iter().find(|image| image.id == index)
    }

    /// Returns the saturated pixels of each plane of an image; empty if there are none.
    pub(crate) fn saturated(&self, index: u64) -> Result<Vec<Mask>, InputError> {
        self.image(index).map_or(&[][..], |image| &image.saturated).iter().map(Rle::mask).collect()
    }

    /// Returns the ground truth of a frame.
    ///
    /// # Errors
    /// If the document does not have the frame, or is inconsistent.
    pub(crate) fn truth(&self, index: u64) -> Result<Truth, InputError> {
        let image = self
            .image(index)
            .ok_or_else(|| InputError::broken("COCO", format!("the document has no image {index}")))?;
        let of_frame = self.annotations.iter().filter(|annotation| annotation.image_id == index);
        let objects: Vec<ObjectTruth> = of_frame.map(Annotation::object).collect::<Result<_, _>>()?;
        match objects.iter().find(|object| extends_beyond(object, image.width, image.height)) {
            Some(object) => {
                let message = format!("image {index}: the mask of object {} extends beyond the image", object.id);
                Err(InputError::broken("COCO", message))
            }
            None => Ok(Truth { width: image.width, height: image.height, objects }),
        }
    }
}

/// Reads the ground truth of every frame of a COCO document of a data set (`shards/*.coco.json`, `coco.json`), with the
/// index of the frame, in the order of the images.
///
/// # Errors
/// If the document is invalid, or boxes or areas differ from the masks.
pub fn truths(bytes: &[u8]) -> Result<Vec<(u64, Truth)>, InputError> {
    let document: Document = serde_json::from_slice(bytes)?;
    document.images.iter().map(|image| Ok((image.id, document.truth(image.id)?))).collect()
}
