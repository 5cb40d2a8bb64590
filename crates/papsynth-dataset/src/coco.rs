//! COCO: a document for each frame, and one for all.

use papsynth::recipe::Recipe;
use papsynth::scene::Kind;
use papsynth::truth::{Group, Mask, ObjectTruth, Part, Truth};
use serde::{Deserialize, Serialize};

use crate::layout::{self, Form};
use crate::record::FrameSummary;
use crate::rle;

/// A kind of annotation: of cells one for each class and part, of everything else one for each kind.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub(crate) struct Category {
    pub(crate) id: u32,
    pub(crate) name: String,
    pub(crate) supercategory: String,
}

/// The categories of a recipe, the same whatever frames are made of it.
pub(crate) fn categories(recipe: &Recipe) -> Vec<Category> {
    let cells = recipe.cells.keys().flat_map(|class| [(class.as_str(), Part::Cytoplasm), (class, Part::Nucleus)]);
    let others = Kind::ALL.into_iter().filter(|&kind| kind != Kind::Cell).map(|kind| (kind.name(), Part::Whole));
    (1..)
        .zip(cells.chain(others))
        .map(|(id, (class, part))| Category {
            id,
            name: category_name(class, part),
            supercategory: group(part).name().to_owned(),
        })
        .collect()
}

/// The name of the category of a part of a class.
pub(crate) fn category_name(class: &str, part: Part) -> String {
    match part {
        Part::Whole => class.to_owned(),
        Part::Cytoplasm | Part::Nucleus => format!("{class} {}", group(part).name()),
    }
}

fn group(part: Part) -> Group {
    match part {
        Part::Cytoplasm => Group::Cytoplasm,
        Part::Nucleus => Group::Nucleus,
        Part::Whole => Group::Debris,
    }
}

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
}

#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub(crate) struct Image {
    id: u64,
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
    pub(crate) fn new(frame: &FrameSummary, saturated: &[Mask]) -> Self {
        let form = Form::of(frame.planes_um.len());
        Self {
            id: frame.index,
            width: frame.width,
            height: frame.height,
            file_name: layout::image(frame.index, form),
            all_in_focus: (form == Form::Stack).then(|| layout::all_in_focus(frame.index)),
            pixel_um: frame.pixel_um,
            saturated: if saturated.iter().all(Mask::is_empty) {
                Vec::new()
            } else {
                saturated.iter().map(|mask| Rle::new(mask, frame.width, frame.height)).collect()
            },
        }
    }
}

/// One object or part of a cell.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub(crate) struct Annotation {
    /// From 1; within the frame in its own document, over all frames in the joint one.
    id: u64,
    image_id: u64,
    category_id: u32,
    /// The id of the object in label images and tables; nucleus and cytoplasm of a cell share it.
    cell_id: u32,
    part: Part,
    bbox: [u32; 4],
    area: u64,
    iscrowd: u8,
    /// The complete (amodal) mask.
    segmentation: Rle,
    /// The pixels where the object is the front-most of its group.
    front: Rle,
    front_area: u64,
}

impl Annotation {
    fn new(id: u64, object: &ObjectTruth, frame: &FrameSummary, category_id: u32) -> Self {
        let (width, height) = (frame.width, frame.height);
        Self {
            id,
            image_id: frame.index,
            category_id,
            cell_id: object.id,
            part: object.part,
            bbox: object.amodal.bounds().map_or([0; 4], |b| [b.x, b.y, b.width, b.height]),
            area: object.amodal.area(),
            iscrowd: 0,
            segmentation: Rle::new(&object.amodal, width, height),
            front: Rle::new(&object.front, width, height),
            front_area: object.front.area(),
        }
    }

    pub(crate) fn renumbered(self, id: u64) -> Self {
        Self { id, ..self }
    }

    /// The complete mask and the group it belongs to.
    pub(crate) fn amodal(&self) -> Result<(Group, Mask), crate::Problem> {
        let [height, width] = self.segmentation.size;
        Ok((group(self.part), rle::decode(&self.segmentation.counts, width, height)?))
    }
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

/// A whole document.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub(crate) struct Document {
    pub(crate) info: Info,
    pub(crate) licenses: Vec<String>,
    pub(crate) categories: Vec<Category>,
    pub(crate) images: Vec<Image>,
    pub(crate) annotations: Vec<Annotation>,
}

impl Document {
    /// The document of one frame.
    ///
    /// # Errors
    /// The category of an object that the recipe does not know.
    pub(crate) fn of_frame(
        truth: &Truth,
        frame: &FrameSummary,
        saturated: &[Mask],
        categories: &[Category],
    ) -> Result<Self, String> {
        let annotation = |(id, object): (u64, &ObjectTruth)| {
            let name = category_name(&object.class, object.part);
            let category = categories.iter().find(|c| c.name == name).ok_or(name)?;
            Ok(Annotation::new(id, object, frame, category.id))
        };
        Ok(Self {
            info: Info::default(),
            licenses: Vec::new(),
            categories: categories.to_vec(),
            images: vec![Image::new(frame, saturated)],
            annotations: (1..).zip(&truth.objects).map(annotation).collect::<Result<_, String>>()?,
        })
    }
}
