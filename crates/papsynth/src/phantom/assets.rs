//! Data shared by all images of one recipe: shape models, cloth mesh, donors, noise field plans.

use std::collections::BTreeMap;
use std::sync::{Arc, OnceLock};

use cloth_verlet::{Cloth, ClothParams};
use fsd_shape::{Descriptors, ShapeModel};
use portable_numerics::rounding::round_to_count;
use quilt_texture::QuiltParams;
use voronoi_cytoskeleton::{DescentPath, Skeleton, SkeletonParams, Torus};

use super::chromatin::DonorSet;
use super::noise_fields::NoiseFieldGenerator;
use super::texture_pool::TexturePools;
use super::tile::Point;
use crate::error::ErrorKind;
use crate::key::{Key, Stream};
use crate::model::{CellClass, Model, OutlineForm, Shapes};
use crate::profile::StageTimer;
use crate::random;
use crate::recipe::{Acceptance, Chromatin, Number, Recipe, Seam, ShapeSpread, Sheet};

/// The part of a recipe that phantoms depend on, in addition to the scene.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct PhantomSettings {
    /// Names of the classes of cells.
    classes: Vec<String>,
    sheet: Sheet,
    /// Variation of the outlines of cytoplasm, and of nuclei.
    shapes: [ShapeSpread; 2],
    pub(crate) chromatin: Chromatin,
    pub(crate) donors: Number,
    patch_um: Number,
    overlap_um: Number,
    acceptance: Acceptance,
    d_max: Number,
    seam: Seam,
}

impl PhantomSettings {
    pub(crate) fn of(recipe: &Recipe) -> Self {
        let (nucleus, cytoplasm) = (&recipe.nucleus, &recipe.cytoplasm);
        Self {
            classes: recipe.cells.keys().cloned().collect(),
            sheet: cytoplasm.sheet,
            shapes: [cytoplasm.shape, nucleus.shape],
            chromatin: nucleus.chromatin,
            donors: nucleus.donors.clone(),
            patch_um: nucleus.patch_um.clone(),
            overlap_um: nucleus.overlap_um.clone(),
            acceptance: nucleus.acceptance,
            d_max: nucleus.d_max.clone(),
            seam: nucleus.seam,
        }
    }
}

/// Data for drawing phantoms, shared by all images of one recipe.
#[derive(Debug)]
pub(crate) struct PhantomAssets {
    pub(crate) settings: PhantomSettings,
    pub(crate) classes: BTreeMap<String, ClassAssets>,
    /// Cloth simulation of cytoplasm sheets; `None` for flat sheets.
    pub(crate) cloth: Option<Cloth>,
    pub(crate) cytoskeletons: Cytoskeletons,
    pub(crate) noise_fields: NoiseFieldGenerator,
    pub(crate) textures: TexturePools,
    pub(crate) timer: StageTimer,
}

/// Relaxed Voronoi diagrams for cytoskeletons, the same for every image. Each is computed on first use.
#[derive(Debug)]
pub(crate) struct Cytoskeletons {
    skeleton: Skeleton,
    lloyd_passes: usize,
    tori: [OnceLock<Torus>; TORI],
}

/// Number of diagrams. A cell uses a quarter of a diagram, with random position, rotation and edge weights.
const TORI: usize = 4;

/// Sites per diagram. A cell uses 300 of them, enough for a cell three times as long as wide.
const TORUS_SITES: usize = 1200;

/// Data for drawing the cells of one class.
#[derive(Debug)]
pub(crate) struct ClassAssets {
    pub(crate) class: CellClass,
    cytoplasm: ShapeModel,
    nucleus: Arc<ShapeModel>,
    pub(crate) donors: DonorSet,
    pub(crate) quilt: QuiltParams,
}

impl PhantomAssets {
    pub(crate) fn new(settings: PhantomSettings, model: &Model, timer: StageTimer) -> Result<Self, ErrorKind> {
        let mut classes = BTreeMap::new();
        for name in &settings.classes {
            classes.insert(name.clone(), ClassAssets::new(name, model.class(name)?, &settings)?);
        }
        let cloth = match settings.sheet {
            Sheet::Flat => None,
            Sheet::Verlet => Some(ClothParams::paper()),
            Sheet::Xpbd => Some(ClothParams::default()),
        };
        Ok(Self {
            settings,
            classes,
            cloth: cloth.map(|params| Cloth::new(&params).expect("the built-in cloth parameters are valid")),
            cytoskeletons: Cytoskeletons::new(),
            noise_fields: NoiseFieldGenerator::new(),
            textures: TexturePools::new(model.texture()),
            timer,
        })
    }
}

impl Cytoskeletons {
    fn new() -> Self {
        let params = SkeletonParams::default();
        let skeleton = Skeleton::new(&params).expect("the default parameters are valid");
        Self { skeleton, lloyd_passes: params.lloyd_passes, tori: Default::default() }
    }

    /// Returns the cytoskeleton lines of one cell inside its outline.
    pub(crate) fn grow(&self, outline: &[Point], rng: &mut Stream) -> Result<Vec<DescentPath>, ErrorKind> {
        /// Step between the points of the outline that distances are measured to: some 2 µm.
        const STEP: usize = 4;
        let outline: Vec<Point> = outline.iter().step_by(STEP).copied().collect();
        let number = random::below(TORI, rng);
        let torus = self.tori[number].get_or_init(|| {
            let mut torus_rng = Key { seed: 0, index: 0 }.stream("studio", number as u64, "torus");
            let torus = Torus::new(TORUS_SITES, self.lloyd_passes, &mut torus_rng);
            torus.expect("a diagram with this number of sites is valid")
        });
        Ok(self.skeleton.grow_from(torus, &outline, rng)?)
    }
}

impl ClassAssets {
    fn new(name: &str, class: &CellClass, settings: &PhantomSettings) -> Result<Self, ErrorKind> {
        let model = |shapes: &Shapes, spread: ShapeSpread| {
            let statistics = match spread {
                ShapeSpread::Correlated => &shapes.correlated,
                ShapeSpread::Independent => &shapes.independent,
            };
            ShapeModel::from_statistics(statistics.clone())
                .map_err(|error| ErrorKind::Shapes(format!("classes.{name}"), error))
        };
        let cytoplasm = model(&class.cytoplasm.shapes, settings.shapes[0])?;
        let nucleus = Arc::new(model(&class.nucleus.shapes, settings.shapes[1])?);
        let donors = DonorSet::new(name, &class.nucleus, &nucleus)?;
        let quilt = quilt(settings, class, donors.pixel_um);
        Ok(Self { class: class.clone(), cytoplasm, nucleus, donors, quilt })
    }

    /// Draws the outline of a cytoplasm with this radius, its long axis along x.
    pub(crate) fn cytoplasm(&self, radius_px: f64, rng: &mut Stream) -> Result<Descriptors, ErrorKind> {
        let drawn = self.cytoplasm.draw(radius_px, rng)?;
        Ok(formed(&drawn.descriptors, &self.class.cytoplasm.form, rng))
    }

    /// Draws the outline of a nucleus with this radius, its long axis along x.
    pub(crate) fn nucleus(&self, radius_px: f64, rng: &mut Stream) -> Result<Descriptors, ErrorKind> {
        let drawn = self.nucleus.draw(radius_px, rng)?;
        Ok(formed(&drawn.descriptors, &self.class.nucleus.form, rng))
    }
}

/// Largest elongation: the half axes are 1.8 and 0.2 of the radius.
const MAX_ELONGATION: f64 = 0.8;
/// Largest elongation that the variation of an outline form gives: 2.6 times as long as wide. Longer nuclei look like
/// rods. Set by eye.
const MAX_VARIED: f64 = 0.45;

/// Aligns a drawn shape with its long axis along x and applies the outline form of its class.
fn formed(drawn: &Descriptors, form: &OutlineForm, rng: &mut Stream) -> Descriptors {
    let aligned = drawn.aligned();
    let elongation = form.elongation.map(|e| (e.mean + e.sd * random::normal(rng)).clamp(0.0, MAX_ELONGATION));
    if elongation.is_none() && form.taper == 0.0 && form.unevenness == 1.0 && form.variation == 0.0 {
        return aligned;
    }
    // A log-normal factor whose square has the mean 1.
    let varied =
        if form.variation == 0.0 { 1.0 } else { libm::exp(form.variation * (random::normal(rng) - form.variation)) };
    let centre = aligned.harmonics();
    let radius = aligned.radius();
    let mut terms = aligned.as_slice().to_vec();
    for (index, term) in terms.iter_mut().enumerate() {
        match (index.abs_diff(centre), index < centre) {
            // Position and radius.
            (0, _) | (1, false) => {}
            (1, true) => {
                let own = elongation.unwrap_or(term[0] / radius);
                let varied = (varied * own).min(own.max(MAX_VARIED));
                *term = [varied.min(MAX_ELONGATION) * radius, 0.0];
            }
            _ => *term = [varied * form.unevenness * term[0], varied * form.unevenness * term[1]],
        }
    }
    if let Some(asymmetry) = terms.get_mut(centre + 2) {
        asymmetry[0] += form.taper * radius;
    }
    // Ignores forms that make the outline cross itself.
    match Descriptors::from_harmonics(terms) {
        Ok(changed) if !fsd_shape::self_intersects(&changed.outline(TEST_POINTS)) => changed,
        _ => aligned,
    }
}

/// Points of the outline for the self-intersection test.
const TEST_POINTS: usize = 240;

/// Returns the quilting parameters of a recipe for donors with this pixel size.
fn quilt(nucleus: &PhantomSettings, class: &CellClass, pixel_um: f64) -> QuiltParams {
    let pixels = |um: f64, least: usize| round_to_count(um / pixel_um).max(least);
    // All patches of a quilt have the same size: the midpoints of the recipe's ranges.
    let midpoint = |number: &Number| number.bounds().iter().sum::<f64>() / 2.0;
    let (overlap_px, core_px) = (pixels(midpoint(&nucleus.overlap_um), 1), pixels(midpoint(&nucleus.patch_um), 2));
    let patch_px = core_px + overlap_px;
    let default = QuiltParams::default();
    QuiltParams {
        patch_px: patch_px.max(2 * overlap_px),
        overlap_px,
        acceptance: match nucleus.acceptance {
            // The donors are scaled to a standard deviation of 1, so the threshold is divided by the standard deviation
            // of the class.
            Acceptance::Threshold => quilt_texture::Acceptance::Threshold {
                d_max: midpoint(&nucleus.d_max) / class.nucleus.chromatin.sd.mean.max(1e-6),
                max_tries: MAX_TRIES,
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

/// Maximum number of random candidates before the best one is used.
const MAX_TRIES: usize = 400;

#[cfg(test)]
mod tests {
    use super::*;
    use crate::key::Key;
    use crate::model::Normal;

    #[test]
    fn a_variation_of_outlines_keeps_the_radius_and_the_variances() {
        let harmonics = vec![[0.02, 0.01], [0.1, 0.0], [0.0, 0.0], [1.0, 0.0], [0.03, 0.0]];
        let drawn = Descriptors::from_harmonics(harmonics).unwrap().aligned();
        let form = OutlineForm { variation: 0.3, ..OutlineForm::default() };
        let mut rng = Key { seed: 2, index: 0 }.stream("test", 0, "outlines");
        const COUNT: u32 = 4000;
        let (mut sum, mut extremes) = (0.0, [f64::INFINITY, 0.0_f64]);
        for _ in 0..COUNT {
            let outline = formed(&drawn, &form, &mut rng);
            assert!((outline.radius() - drawn.radius()).abs() < 1e-12);
            let factors = [-2, -1, 2].map(|l| outline.harmonic(l)[0] / drawn.harmonic(l)[0]);
            assert!((factors[0] - factors[1]).abs() < 1e-9 && (factors[2] - factors[1]).abs() < 1e-9, "{factors:?}");
            sum += factors[1] * factors[1];
            extremes = [extremes[0].min(factors[1]), extremes[1].max(factors[1])];
        }
        // The square has the mean 1 and the standard deviation 0.66: a standard error of 0.01.
        assert!((sum / f64::from(COUNT) - 1.0).abs() < 0.05, "{sum}");
        assert!(extremes[0] < 0.5 && extremes[1] > 1.8, "{extremes:?}");
    }

    #[test]
    fn a_variation_makes_no_rods_but_an_elongation_of_the_form_may() {
        let round = Descriptors::from_harmonics(vec![[0.3, 0.0], [0.0, 0.0], [1.0, 0.0]]).unwrap();
        let mut rng = Key { seed: 3, index: 0 }.stream("test", 0, "rods");
        for (given, longest) in [(None, 0.45), (Some(0.2), 0.45), (Some(0.7), 0.7)] {
            let elongation = given.map(|mean| Normal { mean, sd: 0.0 });
            let form = OutlineForm { variation: 0.8, elongation, ..OutlineForm::default() };
            let all = (0..500).map(|_| formed(&round, &form, &mut rng).harmonic(-1)[0]);
            let found = all.fold(0.0, f64::max);
            assert!((found - longest).abs() < 1e-9, "{given:?}: {found}");
        }
    }
}
