//! Signal transmission: from phantoms to the light on the sensor (Eqs. 8–14).
//!
//! Two ways lead there, as the scene's optics say: [`bright_field`], partially coherent bright field, object by object;
//! [`gaussian`], the paper's Gaussians on the absorbance. Both give the light of a plane in bands of rows.

mod abbe;
mod bright_field;
mod canvas;
mod gaussian;
mod lenses;
mod lights;
mod overlap;
mod passage;

use perlin_bg::{Background, BackgroundParams, FractalParams, Illumination, Scatter};
use rand_core::Rng;

use crate::error::Cause;
use crate::scene::{Scene, SceneIllumination, SceneOptics};
use crate::threads::Threads;

use bright_field::BrightFieldPath;
use gaussian::GaussianPath;
pub(crate) use lenses::Lenses;
pub(crate) use passage::{BAND, Band, FocusAt, Light, Passage, Slide};

/// What all planes of one scene share.
pub(crate) enum LightPath {
    Gaussian(Box<GaussianPath>),
    BrightField(Box<BrightFieldPath>),
}

impl LightPath {
    /// Prepares the path, and the empty slide's light in `light`.
    pub(crate) fn new(slide: Slide<'_>, lenses: &Lenses, threads: Threads, light: &mut Light) -> Result<Self, Cause> {
        let view = slide.scene.view;
        light.empty_log10.resize(view.width * view.height, 0.0);
        background(slide.scene)?.log10_into(&mut light.empty_log10, view.width, [0, 0]);
        light.channels.resize(slide.scene.channels(), Vec::new());
        Ok(match &slide.scene.optics {
            SceneOptics::Gaussian { sigma_xy_um, sigma_z_um_per_um } => {
                Self::Gaussian(Box::new(GaussianPath::new(slide, *sigma_xy_um, *sigma_z_um_per_um, threads)?))
            }
            SceneOptics::BrightField(microscope) => {
                Self::BrightField(Box::new(BrightFieldPath::new(slide, microscope, lenses, threads)?))
            }
        })
    }

    /// Lets light through the phantoms.
    pub(crate) fn pass(&self, slide: Slide<'_>, focus: FocusAt, light: &mut Light) -> Result<Passage, Cause> {
        match self {
            Self::Gaussian(path) => path.absorb(slide, focus, light),
            Self::BrightField(path) => path.pass(slide, focus, light),
        }
    }

    /// Gives the light, band by band from the top.
    pub(crate) fn spread(&self, light: &mut Light, visit: impl FnMut(Band<'_>)) {
        match self {
            Self::Gaussian(path) => path.spread(light, visit),
            Self::BrightField(path) => path.spread(light, visit),
        }
    }
}

/// The background of a scene (Eqs. 8–10), in fractions of full scale.
fn background(scene: &Scene) -> Result<Background, Cause> {
    let view = scene.view;
    let illumination = match scene.background.illumination {
        SceneIllumination::Border { exponent } => Illumination::BorderDistance { exponent },
        // A bowl whose top is off the centre, 1 − x2 (x − tx)² − …, has a tilt; the constant left over is in the level.
        SceneIllumination::Bowl { x2, y2, top } => {
            Illumination::Bowl { x2, y2, tilt: [2.0 * x2 * top[0], 2.0 * y2 * top[1]] }
        }
    };
    let params = BackgroundParams {
        level: scene.background.level,
        illumination,
        scatter: Scatter {
            strength: scene.background.scatter,
            cell_px: (scene.background.scatter_um / view.pixel_um).max(1.0),
            noise: FractalParams::default(),
            ..Scatter::default()
        },
    };
    let key = scene.key.stream("field", 0, "background").next_u64();
    let background = Background::new(&params, view.width, view.height, key)?;
    Ok(match scene.frame {
        Some(frame) => background.on_slide(frame.origin_px),
        None => background,
    })
}

/// How far optics spread what lies in a scene.
pub(crate) struct Spread {
    kind: SpreadKind,
}

enum SpreadKind {
    /// Light of the whole picture by so many pixels, light of an object by what its lenses say.
    BrightField {
        further_px: usize,
        groups: Vec<lights::Group>,
    },
    Gaussian {
        in_plane_px: usize,
        px_per_um: f64,
    },
}

impl Spread {
    /// Of the optics of a scene, whose objects are not looked at.
    pub(crate) fn new(scene: &Scene, lenses: &Lenses) -> Result<Self, Cause> {
        let empty = Slide { scene, phantoms: &[], masks: &[] };
        let kind = match &scene.optics {
            SceneOptics::Gaussian { sigma_xy_um, sigma_z_um_per_um } => {
                let path = GaussianPath::new(empty, *sigma_xy_um, *sigma_z_um_per_um, Threads::One)?;
                let px_per_um = sigma_z_um_per_um / scene.view.pixel_um;
                SpreadKind::Gaussian { in_plane_px: path.in_plane_px(), px_per_um }
            }
            SceneOptics::BrightField(microscope) => {
                let further = bright_field::further(microscope, scene.view.pixel_um)?;
                let further_px = further.as_ref().map_or(0, optics_psf::Gaussian::radius);
                let groups = lights::groups(empty, microscope, lenses, Threads::One)?;
                SpreadKind::BrightField { further_px, groups }
            }
        };
        Ok(Self { kind })
    }

    /// Pixels round a picture that light reaches it from.
    pub(crate) fn of_picture_px(&self) -> usize {
        match &self.kind {
            SpreadKind::BrightField { further_px, .. } => *further_px,
            SpreadKind::Gaussian { in_plane_px, .. } => *in_plane_px,
        }
    }

    /// Pixels by which an object of that depth is spread in some plane of its scene.
    pub(crate) fn of_object_px(&self, scene: &Scene, depth_um: f64) -> Result<usize, Cause> {
        let mut widest = 0;
        for &plane_um in &scene.planes_um {
            let seen_at_um = scene.seen_at_um(plane_um, depth_um);
            match &self.kind {
                SpreadKind::BrightField { groups, .. } => {
                    for light in groups.iter().flat_map(|group| &group.lights) {
                        let margin = light.lens.imager.margin_px(depth_um, seen_at_um - light.shift_um);
                        widest = widest.max(margin?);
                    }
                }
                SpreadKind::Gaussian { px_per_um, .. } => {
                    widest = widest.max(gaussian::reach_px(px_per_um * (seen_at_um - depth_um).abs())?);
                }
            }
        }
        Ok(widest)
    }
}
