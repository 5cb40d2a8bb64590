//! Colours of outlines.

use std::collections::{BTreeMap, BTreeSet};

use papsynth::truth::{Group, MIN_DETECTABILITY, ObjectTruth, Truth};

use crate::view::labels::numbered_colour;

/// What the colour of an outline shows.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Colouring {
    /// The object.
    Object,
    /// The class of the cell, or the kind of debris.
    Class,
    /// Whether the object can be seen: its contrast relative to the noise.
    Detectability,
}

/// Colours of objects that can be seen, and of those that cannot.
const SEEN: [[u8; 3]; 2] = [[0, 158, 115], [213, 94, 0]];

impl Colouring {
    pub(super) fn by_name(name: &str) -> Option<Self> {
        match name {
            "object" => Some(Self::Object),
            "class" => Some(Self::Class),
            "detectability" => Some(Self::Detectability),
            _ => None,
        }
    }

    /// Returns the colours of the objects of a group by id; none for [`Object`](Self::Object).
    pub(super) fn colours(self, truth: &Truth, group: Group) -> BTreeMap<u32, [u8; 3]> {
        let classes = classes(truth);
        let number = |object: &ObjectTruth| classes.iter().position(|class| *class == object.class).unwrap_or(0);
        let objects = truth.objects.iter().filter(|object| object.group() == group);
        match self {
            Self::Object => BTreeMap::new(),
            Self::Class => objects.map(|object| (object.id, numbered_colour(number(object)))).collect(),
            Self::Detectability => {
                objects.map(|object| (object.id, SEEN[usize::from(!is_detectable(object))])).collect()
            }
        }
    }

    /// Returns the colours of a group and their meaning; none for [`Object`](Self::Object).
    pub(super) fn legend(self, truth: &Truth, group: Group) -> Vec<([u8; 3], String)> {
        let has_objects = |class: &str| truth.objects.iter().any(|o| o.group() == group && o.class == class);
        match self {
            Self::Object => Vec::new(),
            Self::Class => classes(truth)
                .into_iter()
                .enumerate()
                .filter(|(_, class)| has_objects(class))
                .map(|(number, class)| (numbered_colour(number), class.to_owned()))
                .collect(),
            Self::Detectability => vec![
                (SEEN[0], format!("contrast of at least {MIN_DETECTABILITY} times the noise")),
                (SEEN[1], "less contrast".to_owned()),
            ],
        }
    }
}

/// Returns the classes of cells of an image, then the kinds of debris.
fn classes(truth: &Truth) -> Vec<&str> {
    let of = |is_debris: bool| {
        let objects = truth.objects.iter().filter(|object| (object.group() == Group::Debris) == is_debris);
        objects.map(|object| object.class.as_str()).collect::<BTreeSet<_>>()
    };
    of(false).into_iter().chain(of(true)).collect()
}

fn is_detectable(object: &ObjectTruth) -> bool {
    object.detectability.iter().any(|contrast| *contrast >= MIN_DETECTABILITY)
}
