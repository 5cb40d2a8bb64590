use core::fmt;

use crate::canvas::Canvas;
use crate::error::{Error, require_count};
use crate::filter::Filter;
use crate::grid::{LONGEST_SIDE, fast_length};
use crate::lanes::LanePlans;
use crate::microscope::distance;
use crate::{Microscope, Specimen, Transfer};

/// Which object, cut into slabs, [`BrightField`] images, and at which planes.
#[derive(Debug, Clone, PartialEq)]
pub struct BrightFieldParams {
    /// Samples of the object from left to right, a multiple of [`oversampling`], to 32 768. Default
    /// 512, ours.
    ///
    /// [`oversampling`]: crate::MicroscopeParams::oversampling
    pub width: usize,
    /// Samples from top to bottom, likewise. Default 512, ours.
    pub height: usize,
    /// What lies outside. Default 64 samples of empty slide, ours.
    pub padding: Padding,
    /// Depths of the slabs about the focal plane of the stage at rest, positive towards the objective, each −1000 to
    /// 1000 µm, as for [`Microscope::transfer`]. Default one at 0, ours.
    pub depths_um: Vec<f64>,
    /// Travels of the stage at which pictures are taken, each −1000 to 1000 µm. Default one at 0,
    /// ours.
    pub stages_um: Vec<f64>,
    /// Where slabs far from focus are computed. Default [`Defocused::OnCamera`], ours.
    pub defocused: Defocused,
}

impl Default for BrightFieldParams {
    fn default() -> Self {
        Self {
            width: 512,
            height: 512,
            padding: Padding::Clear { px: 64 },
            depths_um: vec![0.0],
            stages_um: vec![0.0],
            defocused: Defocused::OnCamera,
        }
    }
}

/// What lies outside of the object.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Padding {
    /// The object again: its left edge continues its right one. Sides with large prime factors are
    /// slow.
    Periodic,
    /// Empty slide, at least so many samples of it, 0 to 16 384, between opposite edges.
    Clear {
        /// How many: less than twice the width of the blur lets light come in from the other side.
        px: usize,
    },
}

/// Where slabs that are far from focus are computed.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Defocused {
    /// On the lattice of the object, as all others.
    OnObject,
    /// On that of the camera, as the mean over each pixel, from 2 µm of defocus on if little is
    /// left there of detail finer than the pixels. What is then lost are details that two slabs have in
    /// common within one pixel, below 0.1 % of the contrast.
    OnCamera,
}

/// Widest padding.
const MOST_PADDING: usize = 16_384;

/// Bright field: the image as a product of filtered transmittances, one factor for each slab of the
/// object.
///
/// I = ∏ⱼ (W_z ⊗ 10^(−A) + G_z ⊗ [(1 − W₀ ⊗ a)² − W₀ ⊗ 10^(−A)]) · exp(−2 ∑ⱼ H_P ⊗ φ)
///
/// for slabs of absorbance A and phase φ at distance z from focus, a = 1 − 10^(−A/2). W is the
/// transfer function H_A of [`Microscope::transfer`]: what light transmits, and not the absorbance,
/// is what a lens blurs linearly. In focus the bracket makes it (1 − W₀ ⊗ a)², the square of the
/// blurred amplitude; G_z is the disc that the condenser's cone cuts out of the plane in focus, and
/// the bracket fades out from 1 to 2 µm. Against [`Abbe`](crate::Abbe) the error is 1 % of the
/// contrast for one slab and 2 % for two that overlap.
///
/// Filters are computed once, here; a [`Specimen`] holds what is on the slide, and each picture of
/// it then costs one inverse FFT for each slab that is not empty.
///
/// # Differences from the paper
///
/// The paper blurs absorbance with Gaussians (Eqs. 11 to 14), which [`Gaussian`](crate::Gaussian)
/// and [`DepthOfFocus`](crate::DepthOfFocus) do; that is 8 to 87 % off from Abbe's image where this
/// is 1 % off.
pub struct BrightField {
    pub(crate) microscope: Microscope,
    pub(crate) size: [usize; 2],
    pub(crate) canvas: Canvas,
    pub(crate) in_focus: Filter,
    /// For each plane, the filters of the slabs.
    pub(crate) planes: Vec<Vec<Filter>>,
}

impl fmt::Debug for BrightField {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("BrightField")
            .field("microscope", &self.microscope)
            .field("size", &self.size)
            .field("grid", &[self.canvas.width(), self.canvas.height()])
            .finish_non_exhaustive()
    }
}

impl BrightField {
    /// Plans the transforms and computes the filters.
    ///
    /// # Errors
    ///
    /// If a side or the padding is out of range or a side no multiple of the oversampling; if
    /// a depth or a travel of the stage is out of range.
    pub fn new(microscope: &Microscope, params: &BrightFieldParams) -> Result<Self, Error> {
        let oversampling = microscope.params().oversampling;
        let side = |field, value: usize| {
            let holds = (1..=LONGEST_SIDE).contains(&value) && value.is_multiple_of(oversampling);
            require_count(field, value, holds, "a multiple of the oversampling from 1 to 32768")
        };
        let size = [side("width", params.width)?, side("height", params.height)?];
        let grid = match params.padding {
            Padding::Periodic => size,
            Padding::Clear { px } => {
                require_count("padding.px", px, px <= MOST_PADDING, "a whole number from 0 to 16384")?;
                size.map(|side| oversampling * fast_length((side + px).div_ceil(oversampling)))
            }
        };
        for &depth in &params.depths_um {
            distance("depths_um", depth)?;
        }
        for &stage in &params.stages_um {
            distance("stages_um", stage)?;
        }
        let plane = |&stage: &f64| {
            let filter = |&depth: &f64| {
                let filter = Filter::new(microscope, depth, stage, &Transfer::new(microscope, depth, stage));
                match params.defocused {
                    Defocused::OnCamera => filter,
                    Defocused::OnObject => filter.on_object(),
                }
            };
            params.depths_um.iter().map(filter).collect()
        };
        Ok(Self {
            microscope: microscope.clone(),
            size,
            canvas: Canvas::new(microscope, grid, &LanePlans::default()),
            in_focus: Filter::in_focus(microscope),
            planes: params.stages_um.iter().map(plane).collect(),
        })
    }

    /// An empty slide.
    #[must_use]
    pub fn specimen(&self) -> Specimen {
        Specimen::new(self.planes.first().map_or(0, Vec::len))
    }

    /// Width of a picture in pixels of the camera.
    #[must_use]
    pub fn image_width(&self) -> usize {
        self.size[0] / self.microscope.params().oversampling
    }

    /// Height of a picture in pixels of the camera.
    #[must_use]
    pub fn image_height(&self) -> usize {
        self.size[1] / self.microscope.params().oversampling
    }

    /// Whether some plane needs the correction of the in-focus form of a slab.
    pub(crate) fn is_corrected(&self, slab: usize) -> bool {
        self.planes.iter().any(|plane| plane[slab].is_corrected)
    }
}
