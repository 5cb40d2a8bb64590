//! COCO: a document for each frame, and one for all.

use papsynth::scene::{ObjectKind, Tint};
use papsynth::truth::{Group, Mask, ObjectTruth, Part, Traits, Truth};
use serde::{Deserialize, Serialize};

use super::frame::{Category, FrameSummary, category_name, group};
use super::rle;
use crate::error::Problem;

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

    fn mask(&self) -> Result<Mask, Problem> {
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
    /// The pixels of each plane that are saturated, if some are.
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

/// One object or part of a cell: COCO's fields, and everything else that is known of it.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub(crate) struct Annotation {
    /// From 1; within the shard in its own document, over all frames in the joint one.
    pub(crate) id: u64,
    pub(crate) image_id: u64,
    pub(crate) category_id: u32,
    bbox: [u32; 4],
    area: u64,
    iscrowd: u8,
    /// The complete (amodal) mask.
    segmentation: Rle,
    /// The pixels where the object is the front-most of its group.
    front: Rle,
    front_area: u64,
    /// The id of the object in label images and tables; nucleus and cytoplasm of a cell share it.
    object_id: u32,
    /// Of a nucleus: the annotation of its cytoplasm, if that is in the image.
    pub(crate) parent_id: Option<u64>,
    part: Part,
    kind: String,
    class: String,
    bethesda: String,
    traits: Traits,
    cluster: u32,
    centre_um: [f64; 2],
    depth_um: f64,
    stain: f64,
    tint: String,
    rotation_deg: f64,
    area_um2: f64,
    centroid: Option<[f64; 2]>,
    truncated: bool,
    defocus_um: Vec<f64>,
    detectability: Vec<f64>,
}

impl Annotation {
    fn new(id: u64, parent_id: Option<u64>, object: &ObjectTruth, frame: &FrameSummary, category_id: u32) -> Self {
        let (width, height) = (frame.width, frame.height);
        Self {
            id,
            image_id: frame.index,
            category_id,
            bbox: box_of(&object.amodal),
            area: object.amodal.area(),
            iscrowd: 0,
            segmentation: Rle::new(&object.amodal, width, height),
            front: Rle::new(&object.visible, width, height),
            front_area: object.visible.area(),
            object_id: object.id,
            parent_id,
            part: object.part,
            kind: object.kind.name().to_owned(),
            class: object.class.clone(),
            bethesda: object.bethesda.clone(),
            traits: object.traits.clone(),
            cluster: object.cluster,
            centre_um: object.centre_um,
            depth_um: object.depth_um,
            stain: object.mean_absorbance,
            tint: object.tint_name().to_owned(),
            rotation_deg: object.rotation_deg,
            area_um2: object.area_um2,
            centroid: object.amodal.centroid(),
            truncated: object.truncated,
            defocus_um: object.defocus_um.clone(),
            detectability: object.detectability.clone(),
        }
    }

    /// With `ids` more before it.
    pub(crate) fn renumbered(self, ids: u64) -> Self {
        let parent_id = self.parent_id.map(|parent| parent.saturating_add(ids));
        Self { id: self.id.saturating_add(ids), parent_id, ..self }
    }

    /// The complete mask and the group it belongs to.
    pub(crate) fn amodal(&self) -> Result<(Group, Mask), Problem> {
        Ok((group(self.part), self.segmentation.mask()?))
    }

    /// The truth it was written from.
    ///
    /// # Errors
    /// If a mask is none, or is not as box and areas say.
    pub(crate) fn object(&self) -> Result<ObjectTruth, Problem> {
        let (amodal, front) = (self.segmentation.mask()?, self.front.mask()?);
        let wrong =
            |what: &str| Problem::broken("COCO", format!("annotation {}: {what} is not that of its mask", self.id));
        let claims: [(&str, bool); 4] = [
            ("area", self.area == amodal.area()),
            ("bbox", self.bbox == box_of(&amodal)),
            ("front_area", self.front_area == front.area()),
            ("centroid", self.centroid == amodal.centroid()),
        ];
        if let Some((what, _)) = claims.into_iter().find(|(_, holds)| !holds) {
            return Err(wrong(what));
        }
        let unknown = |what: &str, found: &str| {
            Problem::broken("COCO", format!("annotation {}: there is no {what} `{}`", self.id, found.escape_default()))
        };
        let kind = ObjectKind::ALL.into_iter().find(|kind| kind.name() == self.kind);
        let tint =
            (!self.tint.is_empty()).then(|| Tint::by_name(&self.tint).ok_or_else(|| unknown("tint", &self.tint)));
        Ok(ObjectTruth {
            id: self.object_id,
            part: self.part,
            kind: kind.ok_or_else(|| unknown("kind", &self.kind))?,
            class: self.class.clone(),
            bethesda: self.bethesda.clone(),
            traits: self.traits.clone(),
            cluster: self.cluster,
            centre_um: self.centre_um,
            depth_um: self.depth_um,
            mean_absorbance: self.stain,
            tint: tint.transpose()?,
            rotation_deg: self.rotation_deg,
            area_um2: self.area_um2,
            truncated: self.truncated,
            amodal,
            visible: front,
            defocus_um: self.defocus_um.clone(),
            detectability: self.detectability.clone(),
        })
    }
}

/// Whether a mask of an object leaves an image of this size.
pub(crate) fn leaves(object: &ObjectTruth, width: usize, height: usize) -> bool {
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
    /// Before the images, which are written when all are known.
    pub(crate) annotations: Vec<Annotation>,
    pub(crate) images: Vec<Image>,
}

impl Document {
    /// The document of one frame.
    ///
    /// # Errors
    /// The name of the category of an object, if it is not among these.
    pub(crate) fn of_frame(
        truth: &Truth,
        frame: &FrameSummary,
        saturated: &[Mask],
        categories: &[Category],
        files: (String, Option<String>),
    ) -> Result<Self, String> {
        let parent = |object: &ObjectTruth| {
            let is_cell = |other: &ObjectTruth| other.part == Part::Cytoplasm && other.id == object.id;
            (object.part == Part::Nucleus).then(|| (1..).zip(&truth.objects).find(|(_, o)| is_cell(o))).flatten()
        };
        let annotation = |(id, object): (u64, &ObjectTruth)| {
            let name = category_name(&object.class, object.part);
            let category = categories.iter().find(|c| c.name == name).ok_or(name)?;
            Ok(Annotation::new(id, parent(object).map(|(id, _)| id), object, frame, category.id))
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

    /// The pixels of each plane of an image that are saturated; none if none is in any.
    pub(crate) fn saturated(&self, index: u64) -> Result<Vec<Mask>, Problem> {
        self.image(index).map_or(&[][..], |image| &image.saturated).iter().map(Rle::mask).collect()
    }

    /// The truth of a frame among those of the document.
    ///
    /// # Errors
    /// If it has no such frame, or what it says of it does not fit together.
    pub(crate) fn truth(&self, index: u64) -> Result<Truth, Problem> {
        let image = self.image(index).ok_or_else(|| Problem::broken("COCO", format!("it has no image {index}")))?;
        let of_frame = self.annotations.iter().filter(|annotation| annotation.image_id == index);
        let objects: Vec<ObjectTruth> = of_frame.map(Annotation::object).collect::<Result<_, _>>()?;
        match objects.iter().find(|object| leaves(object, image.width, image.height)) {
            Some(object) => {
                let message = format!("the mask of object {} of image {index} leaves the image", object.id);
                Err(Problem::broken("COCO", message))
            }
            None => Ok(Truth { width: image.width, height: image.height, objects }),
        }
    }
}

/// The truth of every frame of a COCO document of a data set (`shards/*.coco.json`, `coco.json`), with the index of the frame, in the order of
/// its images.
///
/// # Errors
/// If the bytes are no such document, or boxes and areas are not those of the masks.
pub fn truths(bytes: &[u8]) -> Result<Vec<(u64, Truth)>, Problem> {
    let document: Document = serde_json::from_slice(bytes)?;
    document.images.iter().map(|image| Ok((image.id, document.truth(image.id)?))).collect()
}
