//! Leukocytes: neutrophils, or the paper's round cells (paper, section "White blood cells", Eqs. 6, 7, Fig. 9).

mod neutrophil;
mod round;

use super::prelude::*;

section! {
    /// Shape of the nucleus of a leukocyte.
    pub enum NucleusForm {
        /// Lobes joined by bridges in a pale, irregular cytoplasm, as in neutrophils; clusters are dense.
        Lobed,
        /// The paper's shape: one perturbed circle (Eq. 7).
        Round,
    }
}

section! {
    /// Leukocytes (paper, section "White blood cells", Eqs. 6, 7, Fig. 9).
    pub struct Leukocytes {
        /// Number of clusters; drawn once per field.
        clusters: Abundance = Abundance::per_mm2(Number::log_normal(27.0, 1.0)), 0..=100000, "per field or per mm²";
        /// Leukocytes per cluster.
        per_cluster: Count = Number::log_normal(1.7, 0.75).at_least(1.0), 1..=10000;
        /// Radius (standard deviation) of a cluster; for lobed leukocytes only of those that do not touch another one.
        cluster_radius_um: Number = Number::uniform(8.0, 20.0), 0..=1000, "µm";
        /// Fraction of the lobed leukocytes of a cluster that touch another one.
        touching: Number = 0.7, 0..=1;
        /// Fraction of the clusters that are on a cell.
        on_cells: Number = 0.45, 0..=1;
        /// Shape of the nucleus.
        form: NucleusForm = NucleusForm::Lobed;
        /// Radius of the nucleus (s of Eq. 7); for a lobed nucleus, radius of a disc of the same area.
        radius_um: Number = Number::normal(3.2, 0.28), 0.3..=20, "µm";
        /// Range of the radial perturbation (α of Eq. 7).
        alpha: Number = 0.10, 0..=0.5;
        /// Range of the angular perturbation (β of Eq. 7).
        beta: Number = 0.10, 0..=0.5, "radians";
        /// Lobes of a lobed nucleus.
        lobes: Count = Number::choice([1.0, 2.0, 2.0, 2.0, 3.0, 3.0, 3.0, 4.0, 5.0]), 1..=8;
        /// Diameter of the cytoplasm of a lobed leukocyte.
        cytoplasm_diameter_um: Number = Number::normal(9.6, 0.7), 1..=100, "µm";
        /// Probability that a lobed leukocyte is degenerated, with a smudged nucleus and frayed cytoplasm.
        degenerated: Number = 0.2, 0..=1;
        /// Absorbance of the nucleus, before the nuclear stain factor of the field.
        absorbance: Number = Number::normal(0.30, 0.05), 0..=4;
        /// Absorbance of the cytoplasm.
        cytoplasm_absorbance: Number = Number::log_normal(0.10, 0.35), 0..=4;
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
    /// Whether the nucleus is smudged and the cytoplasm frayed.
    pub degenerated: bool,
    /// Amounts of dye of the cytoplasm where the absorbance is 1.
    pub dyes: dye_spectra::Amounts,
}

impl Leukocytes {
    pub(super) fn draw(&self, placer: &mut KindPlacer<'_, Leukocyte>) {
        let dyes = placer.cyanophilic();
        for index in 0..placer.count(named!(self.clusters)) {
            let mut rng = placer.stream(index, "cluster");
            let cluster = placer.cluster(&self.on_cells, &self.cluster_radius_um, &mut rng);
            let mut taken: Vec<[f64; 2]> = Vec::new();
            for member in 0..self.per_cluster.draw_count(&mut rng).max(1) as u64 {
                let number = member_number(index, member);
                let mut rng = placer.stream(number, "body");
                let radius_um = self.radius_um.draw(&mut rng);
                let (lobes, cytoplasm_diameter_um, degenerated) = self.draw_lobed(&mut placer.stream(number, "lobes"));
                let centre_um = match self.form {
                    NucleusForm::Round => cluster.separate_position(&taken, MIN_DISTANCE * radius_um, &mut rng),
                    NucleusForm::Lobed => {
                        let touching = self.touching.draw(&mut rng);
                        cluster.position(&taken, touching, cytoplasm_diameter_um, &mut rng)
                    }
                };
                taken.push(centre_um);
                let leukocyte = Leukocyte {
                    form: self.form,
                    radius_um,
                    lobes,
                    alpha: self.alpha.draw(&mut rng),
                    beta: self.beta.draw(&mut rng),
                    absorbance: self.absorbance.draw(&mut rng) * placer.nuclear_stain(),
                    cytoplasm_absorbance: self.cytoplasm_absorbance.draw(&mut rng),
                    cytoplasm_diameter_um,
                    degenerated,
                    dyes,
                };
                let depth_um = cluster.depth_um + 0.5 * random::normal(&mut rng);
                let placement = Placement::with_random_rotation(centre_um, depth_um, &mut rng);
                placer.add(number, cluster_id(index), placement, leukocyte);
            }
        }
    }
}

impl Leukocytes {
    /// Draws the number of lobes, the diameter, and whether the cell is degenerated.
    fn draw_lobed(&self, rng: &mut Stream) -> (usize, f64, bool) {
        match self.form {
            NucleusForm::Round => (1, 0.0, false),
            NucleusForm::Lobed => {
                let lobes = self.lobes.draw_count(rng).max(1);
                let cytoplasm_diameter_um = self.cytoplasm_diameter_um.draw(rng);
                (lobes, cytoplasm_diameter_um, random::chance(self.degenerated.draw(rng), rng))
            }
        }
    }
}

/// Minimum distance of round leukocytes, in radii; closer positions are drawn again.
const MIN_DISTANCE: f64 = 1.5;
/// Maximum number of draws of a position.
const MAX_TRIES: usize = 24;
/// Distance of touching leukocytes, relative to the diameter of their cytoplasm: minimum, maximum. They flatten each
/// other.
const TOUCHING: [f64; 2] = [0.72, 1.0];

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
        separated(taken, TOUCHING[0] * cytoplasm_diameter_um, || {
            let other = taken[random::below(taken.len(), rng)];
            let (angle, distance) =
                (random::direction(rng), cytoplasm_diameter_um * random::between(TOUCHING[0], TOUCHING[1], rng));
            [other[0] + distance * libm::cos(angle), other[1] + distance * libm::sin(angle)]
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
            NucleusForm::Lobed => neutrophil::make(self, context),
        }
    }
}
