//! Objects other than epithelial cells (paper, section "Debris Object Generation").
//!
//! Each kind of object has one file with its section of the recipe, the accepted ranges, and the numbers drawn for each
//! object. `draw` places the objects of a field, `reach_um` returns the maximum radius of an object for a pixel size,
//! and `phantom` draws its phantom. The list below generates the recipe's `[debris]`, the bodies of scenes and the
//! classes of the ground truth. To add a kind, add its file and its entry.

mod bacillus;
mod bare_nucleus;
mod bubble;
mod candida;
mod canvas;
mod clue;
mod coccus;
mod crystal;
mod dirt;
mod dust;
mod fibre;
mod leukocyte;
mod mucus;
mod object_context;
mod out_of_focus;
pub(crate) mod placement;
mod red_cell;
mod scratch;
mod smudge;
mod speckle;
mod trichomonad;
mod tuft;

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
pub(crate) use clue::add_coat;
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

pub(crate) use object_context::ObjectContext;
use placement::{CellPosition, Field, KindPlacer, PlacedObject};

/// Imports shared by the files of the kinds.
mod prelude {
    pub(super) use dye_spectra::Amounts;
    pub(super) use rand_core::Rng;
    pub(super) use serde::{Deserialize, Serialize};

    pub(super) use super::canvas::{ObjectCanvas, Stroke};
    pub(super) use super::object_context::ObjectContext;
    pub(super) use super::placement::{Cluster, Clusters, KindPlacer, Placement, cluster_id, member_number, near};
    pub(super) use crate::key::Stream;
    pub(super) use crate::phantom::noise_fields::FieldSampler;
    pub(super) use crate::phantom::parametric_shape::{make_irregular, perturbed_circle, placed, smooth, textured};
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
    ($($(#[$doc:meta])* $field:ident: $Section:ident { $count:ident } => $Kind:ident($Object:ident), $name:literal;)*) => {
        section! {
            /// Objects other than epithelial cells.
            pub struct Debris {
                /// Clue cells: epithelial cells covered with coccobacilli.
                clue_cells: ClueCells;
                $($(#[$doc])* $field: $Section;)*
            }
        }

        words! {
            /// Kind of an object; objects are numbered in this order. Objects other than cells have the name of their
            /// kind as class.
            #[derive(PartialOrd, Ord, Hash, Serialize, Deserialize)]
            #[serde(rename_all = "kebab-case")]
            pub enum ObjectKind {
                /// Epithelial cells: cytoplasm and nucleus.
                Cell = "cell",
                $($(#[$doc])* $Kind = $name,)*
            }
        }

        /// The kind of an object with its drawn numbers.
        #[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
        #[serde(tag = "kind", rename_all = "kebab-case")]
        pub enum Body {
            /// An epithelial cell.
            Cell(Box<CellBody>),
            $($(#[$doc])* $Kind($Object),)*
        }

        impl ObjectKind {
            /// Whether all objects of the kind share one row and one mask of the ground truth: a layer of uncounted
            /// objects.
            #[must_use]
            pub fn is_layer(self) -> bool {
                self == Self::Dirt
            }

            /// Whether it is on the glass: its density on a slide does not follow that of the cells.
            pub(crate) fn is_on_glass(self) -> bool {
                matches!(self, Self::Dust | Self::Fibre | Self::Bubble | Self::Scratch)
            }
        }

        impl Body {
            /// Returns the kind of the object.
            #[must_use]
            pub fn kind(&self) -> ObjectKind {
                match self {
                    Self::Cell(_) => ObjectKind::Cell,
                    $(Self::$Kind(_) => ObjectKind::$Kind,)*
                }
            }

            /// Returns the maximum distance of its parts from its centre for this pixel size, µm.
            pub(crate) fn reach_um(&self, pixel_um: f64) -> f64 {
                match self {
                    Self::Cell(cell) => cell.reach_um(),
                    $(Self::$Kind(body) => body.reach_um(pixel_um),)*
                }
            }

            /// Draws its phantom; `None` for cells, which are drawn in batches.
            pub(crate) fn phantom(&self, context: &ObjectContext<'_>) -> Option<Phantom> {
                match self {
                    Self::Cell(_) => None,
                    $(Self::$Kind(body) => Some(body.phantom(context)),)*
                }
            }

            /// Returns its mean absorbance; for a cell that of its cytoplasm.
            pub(crate) fn absorbance(&self) -> f64 {
                match self {
                    Self::Cell(cell) => cell.cytoplasm_absorbance,
                    $(Self::$Kind(body) => body.absorbance,)*
                }
            }
        }

        impl Debris {
            /// Returns debris with all counts 0.
            #[must_use]
            pub fn none() -> Self {
                Self {
                    clue_cells: ClueCells { fraction: 0.into(), ..ClueCells::default() },
                    $($field: $Section { $count: 0.into(), ..$Section::default() },)*
                }
            }

            /// Returns the abundance of a kind; none of cells.
            pub(crate) fn abundance(&self, kind: ObjectKind) -> Option<&Abundance> {
                match kind {
                    ObjectKind::Cell => None,
                    $(ObjectKind::$Kind => Some(&self.$field.$count),)*
                }
            }

            /// Returns the abundance of each kind, with its key.
            pub(crate) fn abundances(&self) -> Vec<(&'static str, &Abundance)> {
                vec![$((concat!("debris.", stringify!($field), ".", stringify!($count)), &self.$field.$count)),*]
            }

            /// Returns the abundance of a kind; none of cells.
            #[cfg(test)]
            fn count_mut(&mut self, kind: ObjectKind) -> Option<&mut Abundance> {
                match kind {
                    ObjectKind::Cell => None,
                    $(ObjectKind::$Kind => Some(&mut self.$field.$count),)*
                }
            }

            /// Draws all debris on a slide with these cells, kind by kind.
            pub(crate) fn draw(&self, field: &Field<'_>) -> Vec<PlacedObject<Body>> {
                let mut objects: Vec<PlacedObject<Body>> = Vec::new();
                $({
                    let kind = ObjectKind::$Kind;
                    let in_margin = self.$field.$count.is_density();
                    let mut placer = KindPlacer::new(field, kind.name(), stringify!($field), kind.is_on_glass(), in_margin);
                    if kind == ObjectKind::Smudge {
                        placer = placer.with_leukocytes(objects.iter().filter_map(leukocyte));
                    }
                    self.$field.draw(&mut placer);
                    objects.extend(placer.objects.into_iter().map(|PlacedObject { number, cluster, placement, body }| {
                        PlacedObject { number, cluster, placement, body: Body::$Kind(body) }
                    }));
                })*
                objects
            }
        }
    };
}

/// Returns the cluster and position of an object that is a leukocyte.
fn leukocyte(object: &PlacedObject<Body>) -> Option<(u32, CellPosition)> {
    let Body::Leukocyte(body) = &object.body else { return None };
    let (centre_um, depth_um) = (object.placement.centre_um, object.placement.depth_um);
    let radius_um = (0.5 * body.cytoplasm_diameter_um).max(body.radius_um);
    Some((object.cluster, CellPosition { centre_um, depth_um, radius_um }))
}

// Section of the recipe, its key for the number of objects, and the drawn type.
kinds! {
    /// Leukocytes, single and in clusters.
    leukocytes: Leukocytes { clusters } => Leukocyte(Leukocyte), "leukocyte";
    /// Rod-shaped bacteria, in clusters, on cells and between them.
    bacilli: Bacilli { clusters } => Bacillus(Bacillus), "bacillus";
    /// Specks of dust and stain.
    speckles: Speckles { count } => Speckle(Speckle), "speckle";
    /// Objects far outside the depth of the specimen.
    out_of_focus: OutOfFocus { count } => OutOfFocus(Blob), "out-of-focus";
    /// Amorphous debris: granular clumps.
    smudges: Smudges { count } => Smudge(Smudge), "smudge";
    /// Faint flecks of background dirt.
    dirt: Dirt { clusters } => Dirt(Fleck), "dirt";
    /// Colonies of cocci and coccobacilli.
    cocci: Cocci { colonies } => Coccus(Colony), "coccus";
    /// *Candida*: pseudohyphae and budding yeasts.
    candida: Candidas { colonies } => Candida(Candida), "candida";
    /// Trichomonads: pale pear-shaped flagellates.
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
    /// Textile fibres.
    fibres: Fibres { count } => Fibre(Fibre), "fibre";
    /// Air bubbles in the mountant.
    bubbles: Bubbles { count } => Bubble(Bubble), "bubble";
    /// Scratches in the glass.
    scratches: Scratches { count } => Scratch(Scratch), "scratch";
}

#[cfg(test)]
mod tests;
