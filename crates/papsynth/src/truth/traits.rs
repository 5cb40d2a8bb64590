//! Variants of the shapes of objects.

use std::collections::BTreeSet;
use std::fmt;

use serde::{Deserialize, Serialize};

use crate::words::words;

words! {
    /// A variant of the shape of an object. Files list traits in this order.
    #[derive(PartialOrd, Ord, Hash, Serialize, Deserialize)]
    #[serde(rename_all = "kebab-case")]
    pub enum Trait {
        /// Part of the cell is folded flat onto itself.
        Flap = "flap",
        /// Part of the cell is rolled up.
        Rolled = "rolled",
        /// Both sides of the cell are folded to its centre.
        Folded = "folded",
        /// The cytoplasm is cleared around the nucleus.
        Koilocytic = "koilocytic",
        /// The cytoplasm contains keratohyalin granules.
        Granular = "granular",
        /// The nucleus is small, dark and without texture.
        Pyknotic = "pyknotic",
        /// The nucleus is wrinkled.
        Wrinkled = "wrinkled",
        /// Bacteria cover the cell.
        Clue = "clue",
        /// A red blood cell that has lost its haemoglobin.
        Ghost = "ghost",
        /// A pseudohypha.
        Hypha = "hypha",
        /// A yeast.
        Yeast = "yeast",
        /// A leukocyte with a smudged or pyknotic nucleus.
        Degenerated = "degenerated",
        /// A large leukocyte with a kidney-shaped nucleus.
        Histiocyte = "histiocyte",
    }
}

/// The traits of an object. Written as their names, separated by semicolons, in the order of [`Trait::ALL`].
#[derive(Debug, Clone, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(try_from = "String", into = "String")]
pub struct Traits(BTreeSet<Trait>);

/// Error: a string is not the name of a [`Trait`].
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("unknown trait `{}`; expected {}", .0.escape_default(), Trait::ALL.map(Trait::name).join(", "))]
pub struct UnknownTrait(String);

impl Traits {
    /// Whether the set contains a trait.
    #[must_use]
    pub fn contains(&self, one: Trait) -> bool {
        self.0.contains(&one)
    }
}

impl FromIterator<Trait> for Traits {
    fn from_iter<I: IntoIterator<Item = Trait>>(traits: I) -> Self {
        Self(traits.into_iter().collect())
    }
}

impl fmt::Display for Traits {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let names: Vec<&str> = self.0.iter().map(|one| one.name()).collect();
        f.write_str(&names.join(";"))
    }
}

impl From<Traits> for String {
    fn from(traits: Traits) -> Self {
        traits.to_string()
    }
}

impl TryFrom<String> for Traits {
    type Error = UnknownTrait;

    fn try_from(text: String) -> Result<Self, UnknownTrait> {
        let named = |name: &str| Trait::by_name(name).ok_or_else(|| UnknownTrait(name.to_owned()));
        text.split(';').filter(|name| !name.is_empty()).map(named).collect()
    }
}
