//! A field of view: its objects and how it is imaged.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};

use super::imaging::{Fusion, Restoration, SceneBackground, SceneDyes, SceneLight, SceneOptics};
use super::view::View;
use crate::debris::{Body, Coat};
use crate::key::Key;
use crate::phantom::PhantomScene;
use crate::recipe::camera::SceneCamera;

/// A field of view: its objects and how it is imaged.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Scene {
    /// Seed and index the scene was drawn from.
    pub key: Key,
    /// Number of the slide of the field.
    pub slide: u64,
    /// Index of the entry of `conditions` in the recipe, if it has any.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub condition: Option<usize>,
    /// The image and its pixels.
    pub view: View,
    /// Position of the stage at each focal plane, µm, in the order of the stack. Larger values focus nearer to the
    /// objective.
    pub planes_um: Vec<f64>,
    /// The planes that are fused to an EDF image, if it is one: `planes_um` then has their centre.
    pub fusion: Option<Fusion>,
    /// Light of the empty slide.
    pub background: SceneBackground,
    /// Light.
    pub light: SceneLight,
    /// Optics.
    pub optics: SceneOptics,
    /// Restoration of nuclei whose donors are images.
    pub restoration: Restoration,
    /// Dyes of debris.
    pub dyes: SceneDyes,
    /// Camera.
    pub camera: SceneCamera,
    /// The frame of a whole slide, if it is one.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub frame: Option<SlideFrame>,
    /// Number of times that the objects were drawn: more than 1 if the cells of the first draws did not fit.
    #[serde(default = "one")]
    pub attempts: u32,
    /// Number of cells, by class.
    #[serde(default)]
    pub cells: BTreeMap<String, ClassCount>,
    /// Objects, by id.
    pub objects: Vec<Object>,
}

/// Number of cells of a class in a field.
///
/// Cells whose `count` is a density also have centres in a margin of 60 µm around the field, so that they reach into
/// the image.
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
    /// Number on the slide.
    pub number: u32,
    /// Pixel of the slide at its first pixel.
    pub origin_px: [i64; 2],
}

/// The plot of a whole slide in which an object was drawn.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Plot {
    /// Number on the slide.
    pub number: u32,
    /// Position of its first pixel, in pixels from the first pixel of the image.
    pub at_px: [i64; 2],
}

/// An object on the slide.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Object {
    /// Id within the image, from 1.
    pub id: u32,
    /// Number within its kind, from 0: part of the names of its streams.
    pub number: u64,
    /// Cluster or group, from 1; 0 for single objects.
    pub cluster: u32,
    /// Plot in which it was drawn, for an object of a whole slide.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub plot: Option<Plot>,
    /// Centre, µm from the upper left corner of the image, or of its plot.
    pub centre_um: [f64; 2],
    /// Depth, µm, positive towards the objective.
    pub depth_um: f64,
    /// Direction, degrees.
    pub rotation_deg: f64,
    /// Category of the Bethesda system, of a cell whose class has one; otherwise empty.
    pub bethesda: String,
    /// Bacteria on the cell, if it is a clue cell.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub coat: Option<Coat>,
    /// The object and its drawn numbers.
    pub body: Body,
}

impl Scene {
    /// Returns how many of the requested cells found no place.
    #[must_use]
    pub fn unplaced(&self) -> u64 {
        self.cells.values().map(|count| count.requested.saturating_sub(count.placed)).sum()
    }

    /// Returns the grid on which the slide is rendered: that of the image, or a finer one.
    #[must_use]
    pub fn grid(&self) -> View {
        self.view.finer(self.oversampling())
    }

    /// Returns the part of the scene that phantoms depend on.
    pub(crate) fn of_phantoms(&self) -> PhantomScene {
        PhantomScene { key: self.key, view: self.view, oversampling: self.oversampling(), dyes: self.dyes }
    }

    /// Returns the same objects in an image with pixels `factor` times as large, and one sample of the slide for each
    /// pixel: a preview that is computed several times faster. Width and height are rounded down to whole pixels.
    #[must_use]
    pub fn reduced(mut self, factor: usize) -> Self {
        let View { width, height, pixel_um } = self.view;
        let factor = factor.clamp(1, width.min(height).max(1));
        self.view = View { width: width / factor, height: height / factor, pixel_um: pixel_um * factor as f64 };
        if let (SceneOptics::BrightField(microscope), true) = (&mut self.optics, factor > 1) {
            microscope.oversampling = 1;
        }
        self
    }

    /// Returns the oversampling: samples of the slide along the side of a pixel.
    #[must_use]
    pub fn oversampling(&self) -> usize {
        match &self.optics {
            SceneOptics::BrightField(microscope) => microscope.oversampling as usize,
            SceneOptics::Gaussian { .. } => 1,
        }
    }

    /// Returns the depth in focus at a position of the stage, µm. Because of refraction at the cover glass, it is 1.5
    /// times the position with a dry lens.
    #[must_use]
    pub fn in_focus_um(&self, plane_um: f64) -> f64 {
        match &self.optics {
            SceneOptics::BrightField(microscope) => plane_um * microscope.mount_index / microscope.immersion_index,
            SceneOptics::Gaussian { .. } => plane_um,
        }
    }

    /// Returns the position of the stage at which an object of a depth is imaged in a plane: that of the plane or, in
    /// an EDF image, that of the sharpest plane of the object.
    #[must_use]
    pub fn seen_at_um(&self, plane_um: f64, depth_um: f64) -> f64 {
        // Depth and position are proportional.
        self.fusion.map_or(plane_um, |fusion| fusion.nearest_um(depth_um / self.in_focus_um(1.0)))
    }

    /// Returns the key of the streams of the complete image.
    pub(crate) fn own_key(&self) -> Key {
        self.frame.map_or(self.key, |frame| self.key.frame(frame.number))
    }

    /// Returns the centre of an object, µm from the upper left corner of the image.
    #[must_use]
    pub fn place_um(&self, object: &Object) -> [f64; 2] {
        let corner = object.plot.map_or([0; 2], |plot| plot.at_px);
        [0, 1].map(|axis| object.centre_um[axis] + corner[axis] as f64 * self.view.pixel_um)
    }

    /// Returns the number of channels: 1 or 3.
    #[must_use]
    pub fn channels(&self) -> usize {
        match self.light {
            SceneLight::Monochrome { .. } => 1,
            SceneLight::Colour { .. } => 3,
        }
    }
}
