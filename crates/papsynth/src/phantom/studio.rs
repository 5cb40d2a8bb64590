//! What all images of one recipe share: models, meshes, donors, plans.

use std::collections::BTreeMap;
use std::sync::OnceLock;

use cloth_verlet::{Cloth, ClothParams};
use fsd_shape::{Descriptors, ShapeModel};
use quilt_texture::QuiltParams;
use voronoi_cytoskeleton::{DescentPath, Skeleton, SkeletonParams, Torus};

use super::chromatin::Donors;
use super::pools::PoolMaker;
use super::tile::Point;
use crate::error::Cause;
use crate::key::{Key, Stream};
use crate::model::{CellClass, Form, Model, Shapes};
use crate::profile::Watch;
use crate::random;
use crate::recipe::{Acceptance, Recipe, Seam, ShapeSpread, Sheet};

#[derive(Debug)]
pub(crate) struct Studio {
    pub(crate) recipe: Recipe,
    pub(crate) classes: BTreeMap<String, ClassStudio>,
    /// The mesh of all sheets, if cells have any.
    pub(crate) cloth: Option<Cloth>,
    pub(crate) cytoskeletons: Cytoskeletons,
    pub(crate) pools: PoolMaker,
    pub(crate) watch: Watch,
}

/// What cytoskeletons are grown with: relaxed diagrams of which every cell takes a piece of its own, the same for every
/// image. Each is made when a cell first asks for it.
#[derive(Debug)]
pub(crate) struct Cytoskeletons {
    skeleton: Skeleton,
    lloyd_passes: usize,
    tori: [OnceLock<Torus>; TORI],
}

/// Number of diagrams. A cell's piece is a quarter of one, at any place and turned any way, and its springs are its own: no two
/// look alike.
const TORI: usize = 4;

/// Sites of each: of 300 for a cell, enough for one three times as long as wide.
const TORUS_SITES: usize = 1200;

/// What cells of one class are made with.
#[derive(Debug)]
pub(crate) struct ClassStudio {
    pub(crate) class: CellClass,
    cytoplasm: ShapeModel,
    nucleus: ShapeModel,
    pub(crate) donors: Donors,
    pub(crate) quilt: QuiltParams,
}

impl Studio {
    pub(crate) fn new(recipe: &Recipe, model: &Model, watch: Watch) -> Result<Self, Cause> {
        let mut classes = BTreeMap::new();
        for name in recipe.cells.keys() {
            classes.insert(name.clone(), ClassStudio::new(name, model.class(name)?, recipe)?);
        }
        let cloth = match recipe.cytoplasm.sheet {
            Sheet::Flat => None,
            Sheet::Verlet => Some(ClothParams::paper()),
            Sheet::Xpbd => Some(ClothParams::default()),
        };
        Ok(Self {
            recipe: recipe.clone(),
            classes,
            cloth: cloth.map(|params| Cloth::new(&params).expect("the cloths that ship are valid")),
            cytoskeletons: Cytoskeletons::new(),
            pools: PoolMaker::new(),
            watch,
        })
    }
}

impl Cytoskeletons {
    fn new() -> Self {
        let params = SkeletonParams::default();
        let skeleton = Skeleton::new(&params).expect("the defaults are valid");
        Self { skeleton, lloyd_passes: params.lloyd_passes, tori: Default::default() }
    }

    /// Returns the cytoskeleton of one cell in its outline.
    pub(crate) fn grow(&self, outline: &[Point], rng: &mut Stream) -> Result<Vec<DescentPath>, Cause> {
        let number = random::below(TORI, rng);
        let torus = self.tori[number].get_or_init(|| {
            let mut own = Key { seed: 0, index: 0 }.stream("studio", number as u64, "torus");
            let torus = Torus::new(TORUS_SITES, self.lloyd_passes, &mut own);
            torus.expect("a diagram of so many sites can be made")
        });
        Ok(self.skeleton.grow_from(torus, outline, rng)?)
    }
}

impl ClassStudio {
    fn new(name: &str, class: &CellClass, recipe: &Recipe) -> Result<Self, Cause> {
        let model = |shapes: &Shapes, spread: ShapeSpread| {
            let statistics = match spread {
                ShapeSpread::Correlated => &shapes.correlated,
                ShapeSpread::Independent => &shapes.independent,
            };
            ShapeModel::from_statistics(statistics.clone())
                .map_err(|error| Cause::Shapes(format!("classes.{name}"), error))
        };
        let cytoplasm = model(&class.cytoplasm.shapes, recipe.cytoplasm.shape)?;
        let nucleus = model(&class.nucleus.shapes, recipe.nucleus.shape)?;
        let donors = Donors::new(name, &class.nucleus, &nucleus)?;
        let quilt = quilt(recipe, class, donors.pixel_um);
        Ok(Self { class: class.clone(), cytoplasm, nucleus, donors, quilt })
    }

    /// The outline of a cell's cytoplasm, of so many pixels' radius, its long axis along x.
    pub(crate) fn cytoplasm(&self, radius_px: f64, rng: &mut Stream) -> Result<Descriptors, Cause> {
        let drawn = self.cytoplasm.draw(radius_px, rng)?;
        Ok(posed(&drawn.descriptors, &self.class.cytoplasm.form, rng))
    }

    /// That of its nucleus.
    pub(crate) fn nucleus(&self, radius_px: f64, rng: &mut Stream) -> Result<Descriptors, Cause> {
        let drawn = self.nucleus.draw(radius_px, rng)?;
        Ok(posed(&drawn.descriptors, &self.class.nucleus.form, rng))
    }
}

/// Most elongated outline: half axes of 1.8 and 0.2.
const LONGEST: f64 = 0.8;

/// A drawn shape, its long axis along x, with the form of its class: how that differs from learned ones.
fn posed(drawn: &Descriptors, form: &Form, rng: &mut Stream) -> Descriptors {
    let posed = drawn.aligned();
    let elongation = form.elongation.map(|e| (e.mean + e.sd * random::normal(rng)).clamp(0.0, LONGEST));
    if elongation.is_none() && form.taper == 0.0 && form.unevenness == 1.0 {
        return posed;
    }
    let middle = posed.harmonics();
    let radius = posed.radius();
    let mut terms = posed.as_slice().to_vec();
    for (place, term) in terms.iter_mut().enumerate() {
        match (place.abs_diff(middle), place < middle) {
            (0, _) | (1, false) => {}
            (1, true) => {
                if let Some(elongation) = elongation {
                    *term = [elongation * radius, 0.0];
                }
            }
            _ => *term = [form.unevenness * term[0], form.unevenness * term[1]],
        }
    }
    if let Some(egg) = terms.get_mut(middle + 2) {
        egg[0] += form.taper * radius;
    }
    // A form so extreme that the outline crosses itself is not taken.
    match Descriptors::from_harmonics(terms) {
        Ok(formed) if !fsd_shape::self_intersects(&formed.outline(CHECKED)) => formed,
        _ => posed,
    }
}

/// Points at which an outline is checked for crossing itself.
const CHECKED: usize = 240;

/// The quilting that a recipe asks for, on donors with pixels of a size.
fn quilt(recipe: &Recipe, class: &CellClass, pixel_um: f64) -> QuiltParams {
    let nucleus = &recipe.nucleus;
    let pixels = |um: f64, least: usize| random::count(um / pixel_um).max(least);
    // Patch and overlap are those in the middle of their range: a quilt has patches of one size.
    let middle = |number: &crate::recipe::Number| number.bounds().iter().sum::<f64>() / 2.0;
    let (overlap_px, core_px) = (pixels(middle(&nucleus.overlap_um), 1), pixels(middle(&nucleus.patch_um), 2));
    let patch_px = core_px + overlap_px;
    let default = QuiltParams::default();
    QuiltParams {
        patch_px: patch_px.max(2 * overlap_px),
        overlap_px,
        acceptance: match nucleus.acceptance {
            // Donors are scaled to a standard deviation of one, and so is the threshold.
            Acceptance::Threshold => quilt_texture::Acceptance::Threshold {
                d_max: middle(&nucleus.d_max) / class.nucleus.chromatin.sd.mean.max(1e-6),
                max_tries: TRIES,
            },
            Acceptance::Near => default.acceptance,
        },
        seam: match nucleus.seam {
            Seam::MinCut => default.seam,
            Seam::Feather => quilt_texture::Seam::Feather,
        },
        ..default
    }
}

/// Random candidates before the best of them is taken, where none is near enough.
const TRIES: usize = 400;
