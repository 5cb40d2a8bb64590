//! Draws epithelial cells: places, sizes, stains, folds.

use std::collections::BTreeMap;

use portable_numerics::rounding::round_to_count;
use rand_core::Rng;

use crate::error::ErrorKind;
use crate::key::{Key, Stream};
use crate::model::{CellClass, CytoplasmTexture, HaloStatistics, MAX_RADIUS_UM, Model, TextureKind};
use crate::random;
use crate::recipe::section::named;
use crate::recipe::{CellMix, GroupForm, Number, Recipe};

use super::cell::{CellBody, CellDetail, Fold, FoldForm, Halo, NucleusBody, stretched};
use super::depth::Relief;
use super::field::{ClassCount, Object};
use super::groups::{Groups, Place};
use super::layout::{Places, weights};
use super::stain::FieldStain;
use super::view::{FieldNumbers, Region, View};
use super::weight::WeightMap;
use crate::debris::Body;

/// The cells of a field and its margin.
pub(super) struct Cells {
    pub(super) objects: Vec<Object>,
    pub(super) field: Region,
    pub(super) region: Region,
    /// Cells by class.
    pub(super) counts: BTreeMap<String, ClassCount>,
}

/// Handling of cells without a place.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Crowding {
    /// They are an error.
    Error,
    /// They are left out.
    LeaveOut,
}

/// Draws every cell of a field, class by class.
pub(super) fn draw_cells(
    recipe: &Recipe,
    model: &Model,
    given: Option<&WeightMap>,
    view: View,
    numbers: &FieldNumbers,
    stain: &FieldStain<'_>,
    crowding: Crowding,
) -> Result<Cells, ErrorKind> {
    let weights = weights(&recipe.layout, given, view, numbers)?;
    let count = |(class, mix): (&String, &CellMix)| {
        numbers.number_of((&format!("cells.{class}.count"), &mix.count), weights.populated_mm2) as usize
    };
    let requested: Vec<usize> = recipe.cells.iter().map(count).collect();
    let spacing = numbers.draw(named!(recipe.slide.spacing_um));
    let mut places = Places::new(&weights, spacing)?;
    let wanted = fitting(recipe, &places, &requested, crowding)?;
    let relief = Relief::new(
        view.size_um(),
        numbers.draw(named!(recipe.slide.depth_um)),
        numbers.draw(named!(recipe.slide.depth_scale_um)),
        numbers.draw(named!(recipe.slide.depth_filter_um)),
        numbers.key.stream("field", 0, "slide.relief").next_u64(),
    );
    let mut objects = Vec::with_capacity(wanted.iter().sum());
    let mut counts = BTreeMap::new();
    let mut groups_begun = 0;
    for (((name, mix), requested), wanted) in recipe.cells.iter().zip(requested).zip(wanted) {
        let kind = Class { name, mix, class: model.class(name)?, texture: model.texture() };
        let mut groups = Groups::new(&mix.group, groups_begun);
        let in_margin = mix.count.is_density();
        let before = objects.len();
        for _ in 0..wanted {
            let number = objects.len() as u64;
            let cell = Drawn::new(recipe, kind, stain, numbers.key, number);
            let mut place_rng = numbers.key.stream("cell", number, "place");
            let place = groups.next(cell.body.radius_um, |rng| places.next(in_margin, rng), &mut place_rng);
            let place = match place {
                Err(ErrorKind::Crowded { .. }) if crowding == Crowding::LeaveOut => break,
                place => place?,
            };
            let depth_um = relief.at(place.centre_um);
            objects.push(cell.placed(kind, number, &place, depth_um));
        }
        groups_begun = groups.begun();
        let placed = &objects[before..];
        let in_field = placed.iter().filter(|cell| weights.field.touches(cell.centre_um, 0.0)).count();
        let [requested, placed, in_field] = [requested, placed.len(), in_field].map(|count| count as u64);
        counts.insert(name.clone(), ClassCount { requested, placed, in_field });
    }
    Ok(Cells { objects, field: weights.field, region: weights.region, counts })
}

/// Returns how many cells of each class to place: those requested, or the same fraction of each class where they do not
/// fit.
fn fitting(recipe: &Recipe, places: &Places, requested: &[usize], crowding: Crowding) -> Result<Vec<usize>, ErrorKind> {
    /// Fraction of the cells that fit which is placed in a crowded field, so that each class gets places.
    const CROWDED: f64 = 0.9;
    let mut counts = [0; 2];
    for (mix, count) in recipe.cells.values().zip(requested) {
        // Only the first cell of a group keeps its distance.
        counts[usize::from(mix.count.is_density())] += match mix.group.form {
            GroupForm::Single => *count,
            _ => round_to_count((*count as f64 / mix.group.size.mean_count().max(1.0)).ceil()),
        };
    }
    let [in_field, in_both] = counts;
    for (count, in_margin) in [(in_field, false), (in_both, true)] {
        places.check_tries(count, in_margin)?;
    }
    if in_field + in_both < 2 {
        return Ok(requested.to_vec());
    }
    match places.check(in_field, in_both) {
        Err(fraction) if crowding == Crowding::LeaveOut => {
            let fewer = |count: &usize| round_to_count((*count as f64 * CROWDED * fraction).ceil());
            Ok(requested.iter().map(fewer).collect())
        }
        Err(_) => Err(places.no_room(in_field, in_both)),
        Ok(()) => Ok(requested.to_vec()),
    }
}

/// A class of cells of a recipe.
#[derive(Clone, Copy)]
pub(super) struct Class<'a> {
    pub(super) name: &'a str,
    pub(super) mix: &'a CellMix,
    pub(super) class: &'a CellClass,
    pub(super) texture: &'a CytoplasmTexture,
}

/// A drawn cell without a place.
pub(super) struct Drawn {
    pub(super) body: CellBody,
    /// Direction of a single cell, degrees.
    any_deg: f64,
    /// Depth relative to the relief, µm.
    stacking_um: f64,
}

impl Drawn {
    /// Draws the cell with this number.
    pub(super) fn new(recipe: &Recipe, kind: Class<'_>, stain: &FieldStain<'_>, key: Key, number: u64) -> Self {
        let own = |purpose: &str| key.stream("cell", number, purpose);
        let mut rng = own("body");
        let any_deg = random::between(0.0, 360.0, &mut rng);
        let body = draw_body(recipe, kind, stain, &mut rng, own);
        let stacking_um = recipe.slide.stacking_um.draw(&mut rng) * random::normal(&mut rng);
        Self { body, any_deg, stacking_um }
    }

    /// Returns the cell at its place, with the depth of the relief there.
    pub(super) fn placed(self, kind: Class<'_>, number: u64, place: &Place, depth_um: f64) -> Object {
        let Self { mut body, any_deg, stacking_um } = self;
        let rotation_deg = if place.group == 0 { any_deg } else { place.rotation_deg };
        let off_centre = polar(body.nucleus.off_centre, kind.class.nucleus.polarity, rotation_deg);
        body.nucleus.off_centre = stretched(off_centre, body.detail.elongation, rotation_deg.to_radians());
        Object {
            id: 0,
            number,
            cluster: place.group,
            plot: None,
            centre_um: place.centre_um,
            depth_um: depth_um + stacking_um,
            rotation_deg,
            bethesda: kind.class.bethesda.clone(),
            coat: None,
            body: Body::Cell(Box::new(body)),
        }
    }
}

/// Rotates a displacement towards one end of the long axis of the cell: completely at polarity 1.
fn polar(off_centre: [f64; 2], polarity: f64, rotation_deg: f64) -> [f64; 2] {
    if polarity <= 0.0 {
        return off_centre;
    }
    let distance = libm::hypot(off_centre[0], off_centre[1]);
    let any = libm::atan2(off_centre[1], off_centre[0]);
    let angle = rotation_deg.to_radians() + (1.0 - polarity) * any;
    [distance * libm::cos(angle), distance * libm::sin(angle)]
}

fn draw_body(
    recipe: &Recipe,
    Class { name, mix, class, texture }: Class<'_>,
    stain: &FieldStain<'_>,
    rng: &mut Stream,
    own: impl Fn(&str) -> Stream,
) -> CellBody {
    let size = mix.size.draw(rng);
    let (cytoplasm, nucleus) = (&class.cytoplasm, &class.nucleus);
    // The logarithms of the radii of cell and nucleus have a bivariate normal distribution.
    let first = random::normal(rng);
    let second = random::normal(rng);
    let correlation = nucleus.size_correlation;
    let size_variation = mix.size_variation.draw(&mut own("size.variation"));
    let partner = correlation * first + (1.0 - correlation * correlation).max(0.0).sqrt() * second;
    let radius_um = size * cytoplasm.radius_um.median * libm::exp(size_variation * cytoplasm.radius_um.log_sd * first);
    let radius_um = radius_um.min(MAX_RADIUS_UM);
    let nucleus_log_sd = size_variation * nucleus.radius_um.log_sd;
    let mut nucleus_um = size
        * mix.nucleus_size.draw(&mut own("nucleus.size"))
        * nucleus.radius_um.median
        * libm::exp(nucleus_log_sd * partner);
    /// Largest radius of a nucleus relative to its cell: a larger one extends beyond the cell.
    const WIDEST: f64 = 0.72;
    nucleus_um = nucleus_um.min(WIDEST * radius_um);
    let thickness = libm::exp(stain.cytoplasm_variation * cytoplasm.absorbance.log_sd * random::normal(rng));
    let cytoplasm_absorbance =
        cytoplasm.absorbance.median * thickness * stain.cytoplasm * mix.cytoplasm_stain.draw(rng);
    let mut detail = draw_detail(recipe, cytoplasm.pliability, rng, &own);
    let mut texture_rng = own("texture");
    let textures = [0, 1].map(|_| drawn_kind(texture, stain.kind_of_texture, &mut texture_rng));
    let of_field = BETWEEN_FIELDS * texture.field_log_sd * stain.cytoplasm_texture;
    // The texture adds up at random over the absorbing material, as in `phantom/cell/detail.rs`.
    let darkness = (cytoplasm_absorbance / TEXTURE_ABSORBANCE).max(0.1);
    for (texture, kind) in detail.texture.iter_mut().zip(textures) {
        let deviation = of_field + kind.strength.log_sd * random::normal(&mut texture_rng);
        *texture *= kind.strength.median * libm::exp(stain.texture_variation * deviation) / darkness.sqrt();
    }
    let fold = draw_fold(recipe, cytoplasm.pliability, rng);
    let distance = (nucleus.off_centre.mean + nucleus.off_centre.sd * random::normal(rng)).clamp(0.0, 1.0);
    // The nucleus stays inside the cell, which can be narrow.
    let narrowness = detail.elongation.max(1.0 / detail.elongation).sqrt();
    let distance = distance.min((0.85 - narrowness * nucleus_um / radius_um).max(0.0));
    let angle = random::direction(rng);
    let pyknotic = random::chance(recipe.nucleus.pyknotic.draw(rng), rng);
    let wrinkled = random::chance(recipe.nucleus.wrinkled.draw(rng), rng);
    let variation = stain.nucleus_variation;
    let nucleus_absorbance = normal_at_least(nucleus.absorbance.mean, variation * nucleus.absorbance.sd, 0.25, rng)
        * stain.nucleus
        * mix.nucleus_stain.draw(rng);
    // Darker chromatin varies more: the contrast, sd over mean, is typical of a class.
    let contrast_sd = CONTRAST_SPREAD * variation * nucleus.chromatin.sd.sd;
    let contrast = normal_at_least(nucleus.chromatin.sd.mean, contrast_sd, 0.3, rng)
        / nucleus.absorbance.mean.max(f64::MIN_POSITIVE);
    let own_number = |(name, number): (&str, &Number)| number.draw(&mut own(name));
    let displacement = own_number(named!(recipe.nucleus.displacement));
    // The mean contrast of nuclei does not depend on the displacement.
    let displaced = displacement * cytoplasm.absorbance.median * stain.cytoplasm * mix.cytoplasm_stain.mean();
    let mut body = NucleusBody {
        radius_um: nucleus_um,
        off_centre: [distance * libm::cos(angle), distance * libm::sin(angle)],
        rotation_deg: random::between(0.0, 360.0, rng),
        absorbance: nucleus_absorbance + displaced,
        displacement,
        dyes: [0.0; dye_spectra::DYES],
        texture: contrast * nucleus_absorbance * stain.texture,
        rim: recipe.nucleus.rim.draw(rng),
        dome: own_number(named!(recipe.nucleus.dome)),
        edge_um: recipe.nucleus.edge_um.draw(&mut own("nucleus.edge")),
        clumping: own_number(named!(recipe.nucleus.clumping)),
        thickness_gradient: {
            let (name, slope) = named!(recipe.nucleus.thickness_gradient);
            let mut rng = own(name);
            let slope = slope.draw(&mut rng);
            [0, 1].map(|_| slope * random::normal(&mut rng))
        },
        pyknotic,
        wrinkle: if wrinkled { random::between(0.3, 1.0, rng) } else { 0.0 },
        // The mean number, one more or less.
        nucleoli: round_to_count(
            nucleus.nucleoli + random::between(-1.0, 1.0, &mut own("nucleoli")) * nucleus.nucleoli.min(1.0),
        ),
    };
    if pyknotic {
        // Shrunken, almost black, without structure.
        body.radius_um *= random::between(0.55, 0.8, rng);
        body.absorbance *= random::between(1.4, 2.0, rng);
        body.texture *= random::between(0.2, 0.5, rng);
    }
    let (tint, dyes, nucleus_dyes) = stain.cell(&mix.tints, &mut own("stain"));
    body.dyes = nucleus_dyes;
    CellBody {
        class: name.to_owned(),
        radius_um,
        cytoplasm_absorbance,
        tint,
        dyes,
        phase_rad: recipe.cytoplasm.phase_rad.draw(&mut own("phase")),
        detail,
        textures: textures.map(|kind| kind.name.clone()),
        halo: draw_halo(cytoplasm.halo.as_ref(), nucleus_um, radius_um, &mut own("halo")),
        fold,
        nucleus: body,
    }
}

/// Draws a kind of texture by its weight: that of the field, or one of its own.
fn drawn_kind<'a>(texture: &'a CytoplasmTexture, of_field: f64, rng: &mut Stream) -> &'a TextureKind {
    let own = random::uniform(rng);
    let place = if random::chance(texture.field_kind, rng) { of_field } else { own };
    let mut at = place * texture.kinds.iter().map(|kind| kind.weight).sum::<f64>();
    let found = texture.kinds.iter().find(|kind| {
        at -= kind.weight;
        at < 0.0
    });
    found.unwrap_or(&texture.kinds[0])
}

/// Absorbance of a cell whose texture has the strength of the model: the median of intermediate cells.
const TEXTURE_ABSORBANCE: f64 = 0.125;

/// Variation of the strength of the texture between fields, relative to that in the model, which is measured on small
/// areas and includes what differs within fields. Matched to the 24 fields of Cervix93, the strength has a logarithmic
/// standard deviation of 0.2 between fields.
const BETWEEN_FIELDS: f64 = 0.5;

/// Fraction of the variation of the standard deviation of chromatin that is independent of the absorbance.
const CONTRAST_SPREAD: f64 = 0.6;

/// Draws from a normal distribution, cut below a fraction of its mean, so that stains stay above 0.
fn normal_at_least(mean: f64, sd: f64, share: f64, rng: &mut Stream) -> f64 {
    (mean + sd * random::normal(rng)).max(share * mean)
}

fn draw_detail(recipe: &Recipe, pliability: f64, rng: &mut Stream, own: &impl Fn(&str) -> Stream) -> CellDetail {
    let cytoplasm = &recipe.cytoplasm;
    let excess_area = cytoplasm.excess_area.draw(rng);
    let granular = random::chance(cytoplasm.granular.draw(rng), rng);
    let granules = cytoplasm.granules.draw(rng);
    let (name, slope) = named!(recipe.cytoplasm.thickness_gradient);
    let mut wedge_rng = own(name);
    let slope = slope.draw(&mut wedge_rng);
    let thickness_gradient = [0, 1].map(|_| slope * random::normal(&mut wedge_rng));
    let own = |(name, number): (&str, &Number)| number.draw(&mut own(name));
    let pliable = |named: (&str, &Number)| pliability * own(named);
    CellDetail {
        excess_area,
        angularity: pliable(named!(recipe.cytoplasm.angularity)),
        elongation: own(named!(recipe.cytoplasm.elongation)),
        degeneration: own(named!(recipe.cytoplasm.degeneration)),
        notches: round_to_count(pliable(named!(recipe.cytoplasm.notches))),
        protrusions: round_to_count(pliable(named!(recipe.cytoplasm.protrusions))),
        wrinkles: round_to_count(pliable(named!(recipe.cytoplasm.wrinkles))),
        wrinkle_thickness: own(named!(recipe.cytoplasm.wrinkle_thickness)),
        ridges: own(named!(recipe.cytoplasm.ridges)),
        wrinkle_um: own(named!(recipe.cytoplasm.wrinkle_um)),
        endoplasm: own(named!(recipe.cytoplasm.endoplasm)),
        granules: if granular { granules } else { 0.0 },
        rim_um: own(named!(recipe.cytoplasm.rim_um)),
        texture: [own(named!(recipe.cytoplasm.texture)); 2],
        texture_size: own(named!(recipe.cytoplasm.texture_size)),
        thickness_gradient,
        ..cytoplasm.one(rng)
    }
}

fn draw_halo(halo: Option<&HaloStatistics>, nucleus_um: f64, cell_um: f64, rng: &mut Stream) -> Option<Halo> {
    /// Largest radius of a halo relative to its cell. On one side, a halo may reach 1.6 times as far.
    const LARGEST: f64 = 0.6;
    let halo = halo.filter(|halo| random::chance(halo.probability, rng))?;
    let radius = halo.radius.median * libm::exp(halo.radius.log_sd * random::normal(rng));
    Some(Halo {
        radius_um: (radius.max(1.1) * nucleus_um).min(LARGEST * cell_um),
        clearing: (halo.clearing.mean + halo.clearing.sd * random::normal(rng)).clamp(0.0, 1.0),
        rim: (halo.rim.mean + halo.rim.sd * random::normal(rng)).max(0.0),
    })
}

fn draw_fold(recipe: &Recipe, pliability: f64, rng: &mut Stream) -> Option<Fold> {
    let folds = &recipe.cytoplasm.folds;
    let roll = pliability * folds.roll.draw(rng);
    let folded_over = pliability * folds.folded_over.draw(rng);
    let flap = pliability * folds.flap.draw(rng);
    let which = random::uniform(rng);
    let direction_deg = random::between(0.0, 360.0, rng);
    let depth = folds.depth.draw(rng);
    let radius_um = folds.radius_um.draw(rng);
    let side = if random::chance(0.5, rng) { -1.0 } else { 1.0 };
    let curvature = side * folds.curvature.draw(rng);
    let waviness = folds.waviness.draw(rng);
    let form = if which < folded_over {
        FoldForm::FoldedOver
    } else if which < folded_over + roll {
        FoldForm::Roll
    } else if which < folded_over + roll + flap {
        FoldForm::Flap
    } else {
        return None;
    };
    /// Depth of a rolled rim relative to that of a flap.
    const ROLLED: f64 = 0.45;
    /// Bending radius of a rolled rim relative to that of a flap.
    const ROLLED_RADIUS: f64 = 2.0;
    /// Each side of a cell that is folded over is folded at half the radius.
    const FOLDED_OVER: f64 = 0.5;
    let depth = match form {
        FoldForm::Flap => depth,
        FoldForm::Roll => depth * ROLLED,
        FoldForm::FoldedOver => FOLDED_OVER,
    };
    let radius_um = if form == FoldForm::Roll { ROLLED_RADIUS * radius_um } else { radius_um };
    Some(Fold { form, direction_deg, depth, curvature, waviness, radius_um })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn no_setting_draws_a_cell_larger_than_the_limit() {
        let mix = CellMix { count: 20.into(), size: 10.into(), size_variation: 5.into(), ..CellMix::default() };
        let recipe = Recipe { cells: [("superficial".to_owned(), mix)].into(), ..Recipe::default() };
        let scene = crate::scene::draw(&recipe, &Model::builtin(), None, Key { seed: 1, index: 0 }).unwrap();
        let radii = scene.objects.iter().filter_map(|object| match &object.body {
            Body::Cell(cell) => Some(cell.radius_um),
            _ => None,
        });
        assert_eq!(radii.fold(0.0, f64::max), MAX_RADIUS_UM);
    }
}
