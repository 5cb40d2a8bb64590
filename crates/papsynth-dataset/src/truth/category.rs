//! Categories of objects.

use papsynth::recipe::Recipe;
use papsynth::scene::Kind;
use papsynth::truth::{Group, Part};
use serde::{Deserialize, Serialize};

/// A kind of annotation: of cells one for each class and part, of everything else one for each kind.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct Category {
    /// From 1.
    pub id: u32,
    /// Such as "superficial nucleus" or "bacillus".
    pub name: String,
    /// "cytoplasm", "nucleus" or "debris".
    pub supercategory: String,
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

pub(super) fn group(part: Part) -> Group {
    match part {
        Part::Cytoplasm => Group::Cytoplasm,
        Part::Nucleus => Group::Nucleus,
        Part::Whole => Group::Debris,
    }
}
