//! One field of view: how it is imaged and what lies in it.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};

use super::imaging::{Fusion, Restoration, SceneBackground, SceneDyes, SceneLight, SceneOptics};
use super::view::View;
use crate::debris::{Body, Coat};
use crate::key::{Key, Stream};
use crate::recipe::camera::SceneCamera;

/// One field of view: how it is imaged and what lies in it.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Scene {
    /// Seed and index the scene was drawn from.
    pub key: Key,
    /// Number of the slide that the field is part of.
    pub slide: u64,
    /// The image and its pixels.
    pub view: View,
    /// Travel of the stage to each focal plane, µm, in the order of the stack; larger where what is nearer to the objective
    /// is in focus.
    pub planes_um: Vec<f64>,
    /// The planes that are fused to one picture of extended focus, if it is one: `planes_um` then holds their middle.
    pub fusion: Option<Fusion>,
    /// The empty slide.
    pub background: SceneBackground,
    /// The light.
    pub light: SceneLight,
    /// How it spreads.
    pub optics: SceneOptics,
    /// What happens to nuclei whose donors were images already.
    pub restoration: Restoration,
    /// What stains everything that is no epithelial cell.
    pub dyes: SceneDyes,
    /// The camera.
    pub camera: SceneCamera,
    /// Which frame of a whole slide it is, if it is one.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub frame: Option<SlideFrame>,
    /// Number of times that the objects were drawn: more than 1 if the cells of the first draws did not fit.
    #[serde(default = "one")]
    pub attempts: u32,
    /// Number of cells, by class.
    #[serde(default)]
    pub cells: BTreeMap<String, ClassCount>,
    /// Every object, by id.
    pub objects: Vec<Object>,
}

/// Number of cells of a class in a field.
///
/// Cells whose `count` is a density also lie in a margin of 60 µm round the field, from which they reach into the image.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ClassCount {
    /// Cells that the recipe requested, in the field and its margin.
    pub requested: u64,
    /// Cells placed there: fewer than requested if there was no room.
    pub placed: u64,
    /// Cells placed whose centre is in the field.
    pub in_field: u64,
}

fn one() -> u32 {
    1
}

/// A frame of a whole slide.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SlideFrame {
    /// Its number on the slide.
    pub number: u32,
    /// The pixel of the slide that its first pixel is.
    pub origin_px: [i64; 2],
}

/// The square of a whole slide that an object was drawn with.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Plot {
    /// Its number on the slide.
    pub number: u32,
    /// Where its first pixel lies, in pixels from that of the image.
    pub at_px: [i64; 2],
}

/// One thing on the slide.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Object {
    /// Id within the image, from 1.
    pub id: u32,
    /// Its number within its kind, from 0: what its streams are named by.
    pub number: u64,
    /// The cluster it was placed with, from 1; 0 if alone.
    pub cluster: u32,
    /// The square of the slide it was drawn with, of an object on a whole slide.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub plot: Option<Plot>,
    /// Place of its middle, µm from the upper left corner of the image, or of its plot.
    pub centre_um: [f64; 2],
    /// Depth, µm, positive towards the objective.
    pub depth_um: f64,
    /// Direction it is turned to, degrees.
    pub rotation_deg: f64,
    /// Category of the Bethesda system, of a cell whose class has one; else empty.
    pub bethesda: String,
    /// The bacteria that cover it, if it is a clue cell.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub coat: Option<Coat>,
    /// What it is.
    pub body: Body,
}

impl Scene {
    /// Returns how many of the requested cells found no place.
    #[must_use]
    pub fn unplaced(&self) -> u64 {
        self.cells.values().map(|count| count.requested.saturating_sub(count.placed)).sum()
    }

    /// The grid on which the slide is rendered: that of the image, or a finer one.
    #[must_use]
    pub fn grid(&self) -> View {
        let n = self.oversampling();
        View { width: self.view.width * n, height: self.view.height * n, pixel_um: self.view.pixel_um / n as f64 }
    }

    /// Samples of the slide along the side of a pixel.
    #[must_use]
    pub fn oversampling(&self) -> usize {
        match &self.optics {
            SceneOptics::BrightField(microscope) => microscope.oversampling as usize,
            SceneOptics::Gaussian { .. } => 1,
        }
    }

    /// The grid that cytoplasm is made on: the camera's pixels where these are fine enough for wrinkles, else the slide's
    /// grid.
    pub(crate) fn sheet_grid(&self) -> View {
        /// A Gaussian crest of σ that is sampled every p changes by 2·exp(−2π²σ²/p²) with where it falls: not at all at σ = .34 µm, that of
        /// the default's middle; by a twentieth at σ = .11 µm, its narrowest, and p = .25 µm, by a quarter at .33 µm.
        const COARSEST_UM: f64 = 0.35;
        if self.view.pixel_um <= COARSEST_UM { self.view } else { self.grid() }
    }

    /// The depth that is in focus at a travel of the stage, µm. Light bends at the cover glass: with a dry lens the focus
    /// goes 1.5 times as deep as the stage.
    #[must_use]
    pub fn in_focus_um(&self, plane_um: f64) -> f64 {
        match &self.optics {
            SceneOptics::BrightField(microscope) => plane_um * microscope.mount_index / microscope.immersion_index,
            SceneOptics::Gaussian { .. } => plane_um,
        }
    }

    /// Travel of the stage at which an object of a depth is seen in a plane: the plane's own or, where planes were fused, that
    /// of the one which shows the object sharpest.
    #[must_use]
    pub fn seen_at_um(&self, plane_um: f64, depth_um: f64) -> f64 {
        // Depth and travel are proportional.
        self.fusion.map_or(plane_um, |fusion| fusion.nearest_um(depth_um / self.in_focus_um(1.0)))
    }

    /// The stream of a purpose of one object.
    pub(crate) fn stream(&self, kind: &str, object: &Object, purpose: &str) -> Stream {
        self.key_of(object).stream(kind, object.number, purpose)
    }

    /// The key of an object's streams: that of the scene, or of the plot it was drawn with.
    pub(crate) fn key_of(&self, object: &Object) -> Key {
        object.plot.map_or(self.key, |plot| self.key.plot(plot.number))
    }

    /// The key of what belongs to the whole image.
    pub(crate) fn own_key(&self) -> Key {
        self.frame.map_or(self.key, |frame| self.key.frame(frame.number))
    }

    /// Place of an object's middle, µm from the image's upper left corner.
    #[must_use]
    pub fn place_um(&self, object: &Object) -> [f64; 2] {
        let corner = object.plot.map_or([0; 2], |plot| plot.at_px);
        [0, 1].map(|axis| object.centre_um[axis] + corner[axis] as f64 * self.view.pixel_um)
    }

    /// Channels of the image: 1 or 3.
    #[must_use]
    pub fn channels(&self) -> usize {
        match self.light {
            SceneLight::Monochrome { .. } => 1,
            SceneLight::Colour { .. } => 3,
        }
    }
}
