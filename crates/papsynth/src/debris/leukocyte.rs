//! Leukocytes: neutrophils and histiocytes, or the paper's round cells (paper, section "White blood cells", Eqs. 6, 7,
//! Fig. 9).

mod lobed;
mod round;

use super::prelude::*;

section! {
    /// Shape of the nucleus of a leukocyte.
    pub enum NucleusForm {
        /// Overlapping lobes in a pale, irregular cytoplasm, as in neutrophils; clusters are dense.
        Lobed,
        /// A bean in a wide, foamy cytoplasm, as in histiocytes; clusters are dense.
        Kidney,
        /// The paper's shape: one perturbed circle (Eq. 7).
        Round,
    }
}

section! {
    /// Leukocytes (paper, section "White blood cells", Eqs. 6, 7, Fig. 9).
    ///
    /// The defaults come from 24 EDF fields of liquid-based cytology with 0.33 µm per pixel. 51 single dark
    /// bodies have these values at 10 %, 50 % and 90 %, with the outline at half of the contrast:
    ///
    /// - area 26, 39 and 51 µm², solidity 0.91, 0.92 and 0.94, eccentricity 0.36, 0.60 and 0.76;
    /// - absorbance of the core 0.32, 0.47 and 0.65, its standard deviation inside the core 0.032, 0.058 and 0.085;
    /// - absorbance 1 to 2 µm outside the outline 0.05, 0.09 and 0.22.
    ///
    /// The logarithm of the absorbance of the core has a standard deviation of 0.16 within and 0.24 between fields. The
    /// slope of the edge is 0.14 to 0.20 of the contrast per pixel. The area with an absorbance above 0.045,
    /// cytoplasm included, is 96, 122 and 156 µm² at 25 %, 50 % and 75 % of 35 isolated bodies of eight normal
    /// fields. The fractions of degenerated and pyknotic leukocytes, and of those on cells, are estimates by eye.
    /// There are about 45 leukocytes per mm². About two thirds of the clusters are single leukocytes; one to three in
    /// a hundred clusters have more than 10. The centres of touching leukocytes are 5 to 10 µm apart.
    pub struct Leukocytes {
        /// Number of clusters; drawn once per field.
        clusters: Abundance = Abundance::per_mm2(Number::log_normal(27.0, 1.0)), 0..=100000, "per field or per mm²";
        /// Leukocytes per cluster, rounded; at least 1.
        per_cluster: Count = Number::log_normal(1.0, 1.1).at_most(80.0), 0..=10000;
        /// Radius (standard deviation) of a cluster; for lobed leukocytes only of those that do not touch another one.
        cluster_radius_um: Number = Number::uniform(8.0, 20.0), 0..=1000, "µm";
        /// Fraction of the lobed leukocytes of a cluster that touch another one.
        touching: Number = 0.7, 0..=1;
        /// Fraction of the clusters that are on a cell, most of them near its rim.
        on_cells: Number = 0.3, 0..=1;
        /// Shape of the nucleus.
        form: NucleusForm = NucleusForm::Lobed;
        /// Radius of the nucleus (s of Eq. 7); for a lobed nucleus, radius of a disc of the same area.
        radius_um: Number = Number::normal(4.4, 0.5).at_least(2.8), 0.3..=20, "µm";
        /// Range of the radial perturbation (α of Eq. 7).
        alpha: Number = 0.10, 0..=0.5;
        /// Range of the angular perturbation (β of Eq. 7).
        beta: Number = 0.10, 0..=0.5, "radians";
        /// Lobes of a lobed nucleus.
        lobes: Count = Number::choice([1.0, 1.0, 2.0, 2.0, 2.0, 3.0, 3.0, 3.0, 4.0]), 1..=8;
        /// Diameter of the cytoplasm of a lobed leukocyte.
        cytoplasm_diameter_um: Number = Number::normal(12.4, 1.7).at_least(7.0), 1..=100, "µm";
        /// Probability that a lobed leukocyte is degenerated, with a smudged or pyknotic nucleus and frayed cytoplasm.
        degenerated: Number = 0.45, 0..=1;
        /// Fraction of the degenerated leukocytes whose nucleus is pyknotic: small and dark, without structure.
        pyknotic: Number = 0.2, 0..=1;
        /// Fraction of the lobed leukocytes that are histiocytes, which are larger and have a kidney-shaped nucleus.
        histiocytes: Number = 0.04, 0..=1;
        /// Probability that granular remains stick to a lobed leukocyte. They belong to its mask.
        remains: Number = 0.3, 0..=1;
        /// Absorbance of the nucleus, before the nuclear stain factor of the field.
        absorbance: Number = Number::normal(0.29, 0.06).at_least(0.1), 0..=4;
        /// Absorbance of the cytoplasm.
        cytoplasm_absorbance: Number = Number::log_normal(0.13, 0.4), 0..=4;
    }
}

/// A leukocyte with its drawn numbers.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Leukocyte {
    /// Shape of the nucleus.
    pub form: NucleusForm,
    /// Radius of the nucleus, µm.
    pub radius_um: f64,
    /// Number of lobes of the nucleus.
    pub lobes: usize,
    /// Range of the radial perturbation (α of Eq. 7).
    pub alpha: f64,
    /// Range of the angular perturbation (β of Eq. 7).
    pub beta: f64,
    /// Absorbance of the nucleus.
    pub absorbance: f64,
    /// Absorbance of the cytoplasm.
    pub cytoplasm_absorbance: f64,
    /// Diameter of the cytoplasm, µm.
    pub cytoplasm_diameter_um: f64,
    /// Whether the nucleus is smudged or pyknotic and the cytoplasm frayed.
    pub degenerated: bool,
    /// Whether the nucleus is small and dark, without structure.
    pub pyknotic: bool,
    /// Whether granular remains stick to the leukocyte.
    pub remains: bool,
    /// Amounts of dye of the cytoplasm where the absorbance is 1.
    pub dyes: dye_spectra::Amounts,
}

impl Leukocytes {
    pub(super) fn draw(&self, placer: &mut KindPlacer<'_, Leukocyte>) {
        let dyes = placer.dyes(&CYTOPLASM_DYES);
        for index in 0..placer.count(named!(self.clusters)) {
            let mut rng = placer.stream(index, "cluster");
            let cluster = placer.cluster_within(ON_CELL, &self.on_cells, &self.cluster_radius_um, &mut rng);
            let mut taken: Vec<[f64; 2]> = Vec::new();
            for member in 0..self.per_cluster.draw_count(&mut rng).max(1) as u64 {
                let number = member_number(index, member);
                let mut rng = placer.stream(number, "body");
                let radius_um = self.radius_um.draw(&mut rng);
                let variant = self.draw_variant(&mut placer.stream(number, "lobes"));
                let cytoplasm_diameter_um = variant.cytoplasm_diameter_um;
                let centre_um = match self.form {
                    NucleusForm::Round => cluster.separate_position(&taken, MIN_DISTANCE * radius_um, &mut rng),
                    NucleusForm::Lobed | NucleusForm::Kidney => {
                        let touching = self.touching.draw(&mut rng);
                        cluster.position(&taken, touching, cytoplasm_diameter_um, &mut rng)
                    }
                };
                taken.push(centre_um);
                let leukocyte = Leukocyte {
                    form: variant.form,
                    radius_um: radius_um * variant.radius,
                    lobes: variant.lobes,
                    alpha: self.alpha.draw(&mut rng),
                    beta: self.beta.draw(&mut rng),
                    absorbance: self.absorbance.draw(&mut rng) * variant.absorbance * placer.nuclear_stain(),
                    cytoplasm_absorbance: self.cytoplasm_absorbance.draw(&mut rng),
                    cytoplasm_diameter_um,
                    degenerated: variant.degenerated,
                    pyknotic: variant.pyknotic,
                    remains: variant.remains,
                    dyes,
                };
                let depth_um = cluster.depth_um + 0.5 * random::normal(&mut rng);
                let placement = Placement::with_random_rotation(centre_um, depth_um, &mut rng);
                placer.add(number, cluster_id(index), placement, leukocyte);
            }
        }
    }

    /// Draws the variant of a leukocyte.
    fn draw_variant(&self, rng: &mut Stream) -> Variant {
        if self.form == NucleusForm::Round {
            return Variant::ROUND;
        }
        let lobes = self.lobes.draw_count(rng).max(1);
        let cytoplasm_diameter_um = self.cytoplasm_diameter_um.draw(rng);
        let [degenerated, pyknotic, histiocyte, remains] =
            [&self.degenerated, &self.pyknotic, &self.histiocytes, &self.remains]
                .map(|fraction| random::chance(fraction.draw(rng), rng));
        let intact = Variant { form: self.form, lobes, cytoplasm_diameter_um, remains, ..Variant::ROUND };
        if histiocyte || self.form == NucleusForm::Kidney {
            let cytoplasm_diameter_um = cytoplasm_diameter_um * random::between(HISTIOCYTE[0], HISTIOCYTE[1], rng);
            let [radius, absorbance] = [HISTIOCYTE_RADIUS, HISTIOCYTE_ABSORBANCE];
            return Variant { form: NucleusForm::Kidney, radius, absorbance, cytoplasm_diameter_um, ..intact };
        }
        let ([radius, absorbance], pyknotic, lobes) = match (degenerated, pyknotic) {
            (false, _) => return intact,
            (true, true) => ([PYKNOTIC_RADIUS, PYKNOTIC_ABSORBANCE], true, 1),
            (true, false) => ([SMUDGED_RADIUS, SMUDGED_ABSORBANCE], false, lobes),
        };
        let [radius, absorbance] = [radius, absorbance].map(|range| random::between(range[0], range[1], rng));
        Variant { lobes, radius, absorbance, degenerated, pyknotic, ..intact }
    }
}

/// The form of a leukocyte and the factors on its size and absorbance.
struct Variant {
    form: NucleusForm,
    lobes: usize,
    cytoplasm_diameter_um: f64,
    /// Factor on the radius of the nucleus.
    radius: f64,
    /// Factor on the absorbance of the nucleus.
    absorbance: f64,
    degenerated: bool,
    pyknotic: bool,
    remains: bool,
}

impl Variant {
    const ROUND: Self = Self {
        form: NucleusForm::Round,
        lobes: 1,
        cytoplasm_diameter_um: 0.0,
        radius: 1.0,
        absorbance: 1.0,
        degenerated: false,
        pyknotic: false,
        remains: false,
    };
}

/// Dyes of the cytoplasm and of remains, which contain nuclear material: greyer than cyanophilic cytoplasm.
const CYTOPLASM_DYES: DyeAmounts =
    DyeAmounts { light_green: 1.2, haematein: 0.5, eosin_y: 0.45, orange_g: 0.2, neutral: 0.15 };

/// Diameter of a histiocyte relative to a neutrophil: minimum, maximum.
const HISTIOCYTE: [f64; 2] = [1.35, 1.9];
/// Radius of its nucleus relative to that of a neutrophil.
const HISTIOCYTE_RADIUS: f64 = 1.2;
/// Absorbance of its nucleus relative to that of a neutrophil.
const HISTIOCYTE_ABSORBANCE: f64 = 0.75;
/// Radius of a pyknotic nucleus relative to an intact one: minimum, maximum.
const PYKNOTIC_RADIUS: [f64; 2] = [0.6, 0.9];
/// Absorbance of a pyknotic nucleus relative to an intact one: minimum, maximum.
const PYKNOTIC_ABSORBANCE: [f64; 2] = [1.1, 1.4];
/// Radius of a smudged nucleus relative to an intact one: minimum, maximum.
const SMUDGED_RADIUS: [f64; 2] = [0.9, 1.35];
/// Absorbance of a smudged nucleus relative to an intact one: minimum, maximum.
const SMUDGED_ABSORBANCE: [f64; 2] = [0.55, 0.95];

/// Distance of clusters from the centre of a cell, relative to its radius: minimum, maximum. Half are beyond 0.9.
const ON_CELL: [f64; 2] = [0.4, 1.1];

/// Minimum distance of round leukocytes, in radii; closer positions are drawn again.
const MIN_DISTANCE: f64 = 1.5;
/// Maximum number of draws of a position.
const MAX_TRIES: usize = 24;
/// Distance of touching leukocytes, relative to the diameter of their cytoplasm: minimum, maximum. They flatten and
/// overlap each other.
const TOUCHING: [f64; 2] = [0.56, 0.98];
/// Number of touching positions that are drawn. The one closest to the centre of the cluster is used, which makes
/// clumps compact.
const NEIGHBOURS: usize = 2;

impl Cluster {
    /// Draws a position in the cluster with a minimum distance from all others, if possible.
    fn separate_position(&self, taken: &[[f64; 2]], min_distance_um: f64, rng: &mut Stream) -> [f64; 2] {
        separated(taken, min_distance_um, || self.draw_position(rng))
    }

    /// Draws a position that touches another leukocyte, or is separate from all of them.
    fn position(&self, taken: &[[f64; 2]], touching: f64, cytoplasm_diameter_um: f64, rng: &mut Stream) -> [f64; 2] {
        if taken.is_empty() {
            return self.centre_um;
        }
        if !random::chance(touching, rng) {
            return self.separate_position(taken, cytoplasm_diameter_um, rng);
        }
        let mut touching = || {
            separated(taken, TOUCHING[0] * cytoplasm_diameter_um, || {
                let other = taken[random::below(taken.len(), rng)];
                let (angle, distance) =
                    (random::direction(rng), cytoplasm_diameter_um * random::between(TOUCHING[0], TOUCHING[1], rng));
                [other[0] + distance * libm::cos(angle), other[1] + distance * libm::sin(angle)]
            })
        };
        let square = |p: [f64; 2]| {
            let (dx, dy) = (p[0] - self.centre_um[0], p[1] - self.centre_um[1]);
            dx * dx + dy * dy
        };
        let first = touching();
        (1..NEIGHBOURS).fold(first, |best, _| {
            let other = touching();
            if square(other) < square(best) { other } else { best }
        })
    }
}

/// Draws positions until one has a minimum distance from all others; returns the last draw if none has.
fn separated(taken: &[[f64; 2]], min_distance_um: f64, mut place: impl FnMut() -> [f64; 2]) -> [f64; 2] {
    let mut candidate = place();
    for _ in 0..MAX_TRIES {
        if !taken.iter().any(|other| near(*other, candidate, min_distance_um)) {
            break;
        }
        candidate = place();
    }
    candidate
}

impl Leukocyte {
    pub(super) fn reach_um(&self, _pixel_um: f64) -> f64 {
        (1.3 * self.cytoplasm_diameter_um).max((2.0 + 2.0 * self.alpha) * self.radius_um)
    }

    pub(super) fn phantom(&self, context: &ObjectContext<'_>) -> Phantom {
        match self.form {
            NucleusForm::Round => round::make(self, context),
            NucleusForm::Lobed | NucleusForm::Kidney => lobed::make(self, context),
        }
    }
}
