//! The scene: a list of all objects of a field, drawn before any image is computed.
//!
//! A scene is drawn from a recipe, and an image is computed from a scene. Scenes are written as JSON
//! ([`Scene::to_json`]) and read back ([`Scene::from_json`]), so that they can be edited or made by another program.

pub(crate) mod cell;
mod cells;
mod check;
mod depth;
mod draw;
pub(crate) mod field;
mod groups;
pub(crate) mod imaging;
mod layout;
mod plots;
pub(crate) mod stain;
pub(crate) mod view;
mod weight;

pub use crate::debris::{
    Bacillus, BareNucleus, Blob, Body, Bubble, Candida, Coat, Colony, Crystal, Fibre, Fleck, Grain, Growth, Leukocyte,
    ObjectKind, RedCell, Scratch, Smudge, Speckle, Strand, Trichomonad,
};
pub use crate::recipe::camera::SceneCamera;
pub use crate::recipe::imaging::SceneMicroscope;
pub use cell::{CellBody, CellDetail, Fold, FoldForm, Halo, NucleusBody, Tint};
pub(crate) use draw::draw_under;
pub use draw::{MAX_ATTEMPTS, draw};
pub use field::{ClassCount, Object, Plot, Scene, SlideFrame};
pub use imaging::{Fusion, Restoration, SceneBackground, SceneDyes, SceneIllumination, SceneLight, SceneOptics};
pub(crate) use layout::{MARGIN_UM, check_layout};
pub(crate) use plots::{BEYOND, PLOT_PX, Population};
pub use view::View;
pub use weight::WeightMap;
