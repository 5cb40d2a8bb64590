//! Everything that is no epithelial cell ("Debris Object Generation").
//!
//! A kind of object is one file: its section of the recipe with what is accepted there, and which of its numbers are drawn
//! of one object; `draw` strews the objects of a field, `reach_um` says how far one may reach from its middle where pixels
//! have a size, `phantom` what it absorbs where it lies. The list below makes of the files the recipe's `[debris]`, the
//! scene's bodies and the truth's classes. Adding a kind means adding its file and its entry.

mod bacillus;
mod bare_nucleus;
mod bubble;
mod candida;
mod clue;
mod coccus;
mod crystal;
mod dirt;
mod dust;
mod fibre;
pub(crate) mod ground;
mod leukocyte;
mod mucus;
mod out_of_focus;
mod paint;
mod red_cell;
mod scratch;
mod site;
mod smudge;
mod speckle;
mod trichomonad;

use serde::{Deserialize, Serialize};

use crate::phantom::piece::Phantom;
use crate::recipe::abundance::Abundance;
use crate::recipe::section::section;
use crate::scene::cell::CellBody;
use crate::words::words;

pub use bacillus::{Bacilli, Bacillus};
pub use bare_nucleus::{BareNuclei, BareNucleus};
pub use bubble::{Bubble, Bubbles};
pub use candida::{Candida, Candidas, Growth};
pub(crate) use clue::cover;
pub use clue::{ClueCells, Coat};
pub use coccus::{Cocci, Colony};
pub use crystal::{Crystal, Crystals};
pub use dirt::{Dirt, Fleck};
pub use dust::{Dust, Grain};
pub use fibre::{Fibre, Fibres};
pub use leukocyte::{Leukocyte, Leukocytes, NucleusForm};
pub use mucus::{Mucus, Strand};
pub use out_of_focus::{Blob, OutOfFocus};
pub use red_cell::{RedCell, RedCells};
pub use scratch::{Scratch, Scratches};
pub use smudge::{Smudge, Smudges};
pub use speckle::{SpeckForm, Speckle, Speckles};
pub use trichomonad::{Trichomonad, Trichomonads};

use ground::{Field, Ground, Strewn};
pub(crate) use site::Site;

/// What the files of the kinds are written with.
mod prelude {
    pub(super) use dye_spectra::Amounts;
    pub(super) use rand_core::Rng;
    pub(super) use serde::{Deserialize, Serialize};

    pub(super) use super::ground::{Cluster, Clusters, Ground, Lie, cluster_id, member_number, near};
    pub(super) use super::paint::{Painting, Stroke};
    pub(super) use super::site::Site;
    pub(super) use crate::key::Stream;
    pub(super) use crate::phantom::noise_fields::FieldSampler;
    pub(super) use crate::phantom::parametric_shape::{perturbed_circle, placed, smooth, textured};
    pub(super) use crate::phantom::piece::{MIN_ABSORBANCE, Phantom};
    pub(super) use crate::phantom::tile::{Point, Tile, area};
    pub(super) use crate::random;
    pub(super) use crate::recipe::abundance::Abundance;
    pub(super) use crate::recipe::dyes::DyeAmounts;
    pub(super) use crate::recipe::number::{Count, Number};
    pub(super) use crate::recipe::section::{named, section};
    pub(super) use crate::truth::traits::Trait;
}

macro_rules! kinds {
    ($($(#[$doc:meta])* $field:ident: $Section:ident { $count:ident } => $Kind:ident($Thing:ident), $name:literal;)*) => {
        section! {
            /// Everything that is no epithelial cell.
            pub struct Debris {
                /// Clue cells: epithelial cells covered with coccobacilli.
                clue_cells: ClueCells;
                $($(#[$doc])* $field: $Section;)*
            }
        }

        words! {
            /// What kind of thing an object is, in the order in which objects are numbered. The name of a kind is also the class of
            /// what has no class of its own.
            #[derive(PartialOrd, Ord, Hash, Serialize, Deserialize)]
            #[serde(rename_all = "kebab-case")]
            pub enum Kind {
                /// Epithelial cells: cytoplasm and nucleus.
                Cell = "cell",
                $($(#[$doc])* $Kind = $name,)*
            }
        }

        /// What an object is, its numbers drawn.
        #[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
        #[serde(tag = "kind", rename_all = "kebab-case")]
        pub enum Body {
            /// An epithelial cell.
            Cell(Box<CellBody>),
            $($(#[$doc])* $Kind($Thing),)*
        }

        impl Kind {
            /// Whether all of it in an image is one row and one mask of the truth: a layer that nobody counts.
            #[must_use]
            pub fn is_layer(self) -> bool {
                self == Self::Dirt
            }

            /// Whether it comes with the glass and not with the cells: it lies anywhere on a slide.
            pub(crate) fn lies_on_glass(self) -> bool {
                matches!(self, Self::Dust | Self::Fibre | Self::Bubble | Self::Scratch)
            }
        }

        impl Body {
            /// The kind of the object.
            #[must_use]
            pub fn kind(&self) -> Kind {
                match self {
                    Self::Cell(_) => Kind::Cell,
                    $(Self::$Kind(_) => Kind::$Kind,)*
                }
            }

            /// How far it may reach from its middle, µm, where pixels have that size.
            pub(crate) fn reach_um(&self, pixel_um: f64) -> f64 {
                match self {
                    Self::Cell(cell) => cell.reach_um(),
                    $(Self::$Kind(thing) => thing.reach_um(pixel_um),)*
                }
            }

            /// What it absorbs; nothing of cells, which are made together.
            pub(crate) fn phantom(&self, site: &Site<'_>) -> Option<Phantom> {
                match self {
                    Self::Cell(_) => None,
                    $(Self::$Kind(thing) => Some(thing.phantom(site)),)*
                }
            }

            /// The strength of its stain: of a cell that of its cytoplasm.
            pub(crate) fn absorbance(&self) -> f64 {
                match self {
                    Self::Cell(cell) => cell.cytoplasm_absorbance,
                    $(Self::$Kind(thing) => thing.absorbance,)*
                }
            }
        }

        impl Debris {
            /// A slide with nothing but cells.
            #[must_use]
            pub fn none() -> Self {
                Self {
                    clue_cells: ClueCells { share: 0.into(), ..ClueCells::default() },
                    $($field: $Section { $count: 0.into(), ..$Section::default() },)*
                }
            }

            /// Returns the abundance of a kind; none of cells.
            pub(crate) fn abundance(&self, kind: Kind) -> Option<&Abundance> {
                match kind {
                    Kind::Cell => None,
                    $(Kind::$Kind => Some(&self.$field.$count),)*
                }
            }

            /// Returns the abundance of each kind, with its key.
            pub(crate) fn abundances(&self) -> Vec<(&'static str, &Abundance)> {
                vec![$((concat!("debris.", stringify!($field), ".", stringify!($count)), &self.$field.$count)),*]
            }

            /// Returns the abundance of a kind; none of cells.
            #[cfg(test)]
            fn count_mut(&mut self, kind: Kind) -> Option<&mut Abundance> {
                match kind {
                    Kind::Cell => None,
                    $(Kind::$Kind => Some(&mut self.$field.$count),)*
                }
            }

            /// Draws everything that lies on a slide with these cells, kind by kind.
            pub(crate) fn draw(&self, field: &Field<'_>) -> Vec<Strewn<Body>> {
                let mut strewn = Vec::new();
                $({
                    let kind = Kind::$Kind;
                    let in_margin = self.$field.$count.is_density();
                    let mut ground = Ground::new(field, kind.name(), stringify!($field), kind.lies_on_glass(), in_margin);
                    self.$field.draw(&mut ground);
                    strewn.extend(ground.strewn.into_iter().map(|Strewn { number, cluster, lie, thing }| {
                        Strewn { number, cluster, lie, thing: Body::$Kind(thing) }
                    }));
                })*
                strewn
            }
        }
    };
}

// A section of the recipe, which of its numbers says how many there are, and what is drawn from it.
kinds! {
    /// White blood cells, single and in clusters.
    leukocytes: Leukocytes { clusters } => Leukocyte(Leukocyte), "leukocyte";
    /// Rod-shaped bacteria, in clusters, on cells and between them.
    bacilli: Bacilli { clusters } => Bacillus(Bacillus), "bacillus";
    /// Specks of dust and stain, anywhere.
    speckles: Speckles { count } => Speckle(Speckle), "speckle";
    /// Objects far outside the depth of the slide.
    out_of_focus: OutOfFocus { count } => OutOfFocus(Blob), "out-of-focus";
    /// Amorphous debris: granular clumps.
    smudges: Smudges { count } => Smudge(Smudge), "smudge";
    /// Faint flecks of background dirt.
    dirt: Dirt { clusters } => Dirt(Fleck), "dirt";
    /// Cocci and coccobacilli, colony by colony.
    cocci: Cocci { colonies } => Coccus(Colony), "coccus";
    /// *Candida*: pseudohyphae and budding yeasts.
    candida: Candidas { colonies } => Candida(Candida), "candida";
    /// Trichomonads, pale pear-shaped flagellates.
    trichomonads: Trichomonads { groups } => Trichomonad(Trichomonad), "trichomonad";
    /// Red blood cells and their ghosts.
    red_cells: RedCells { clusters } => RedCell(RedCell), "red-cell";
    /// Strands of mucus.
    mucus: Mucus { strands } => Mucus(Strand), "mucus";
    /// Bare nuclei.
    bare_nuclei: BareNuclei { count } => BareNucleus(BareNucleus), "bare-nucleus";
    /// Precipitated dye: dark, angular, refracting grains.
    crystals: Crystals { count } => Crystal(Crystal), "crystal";
    /// Dust on the glass, out of focus.
    dust: Dust { count } => Dust(Grain), "dust";
    /// Fibres of cotton and cloth.
    fibres: Fibres { count } => Fibre(Fibre), "fibre";
    /// Air bubbles in the mountant.
    bubbles: Bubbles { count } => Bubble(Bubble), "bubble";
    /// Scratches in the glass.
    scratches: Scratches { count } => Scratch(Scratch), "scratch";
}

#[cfg(test)]
mod tests;
