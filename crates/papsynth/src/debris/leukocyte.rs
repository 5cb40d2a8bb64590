//! White blood cells ("White blood cells", Eqs. 6, 7, Fig. 9): neutrophils, or the paper's round ones.

mod neutrophil;
mod round;

use super::prelude::*;

section! {
    /// How the nucleus of a leukocyte is shaped.
    pub enum NucleusForm {
        /// Lobes joined by bridges within a pale, ragged cytoplasm, as neutrophils have them; clusters are tight.
        Lobed,
        /// The paper's: one perturbed circle (Eq. 7).
        Round,
    }
}

section! {
    /// White blood cells ("White blood cells", Eqs. 6, 7, Fig. 9).
    pub struct Leukocytes {
        /// Number of clusters; drawn once a field.
        clusters: Abundance = Abundance::per_mm2(Number::log_normal(27.0, 1.0)), 0..=100000, "per field or per mm²";
        /// Leukocytes of a cluster.
        per_cluster: Count = Number::log_normal(1.7, 0.75).at_least(1.0), 1..=10000;
        /// Radius (standard deviation) of a cluster; of lobed ones that of those which do not touch another.
        cluster_um: Number = Number::uniform(8.0, 20.0), 0..=1000, "µm";
        /// Share of a cluster's lobed leukocytes that touch another one.
        touching: Number = 0.7, 0..=1;
        /// Share of the clusters that lie on a cell.
        on_cells: Number = 0.45, 0..=1;
        /// How the nucleus is shaped.
        form: NucleusForm = NucleusForm::Lobed;
        /// Radius of a leukocyte's nucleus (s of Eq. 7); of a lobed one that of the disc of its area.
        radius_um: Number = Number::normal(3.2, 0.28), 0.3..=20, "µm";
        /// Range of the radial perturbation (α of Eq. 7).
        alpha: Number = 0.10, 0..=0.5;
        /// Range of the angular perturbation (β of Eq. 7).
        beta: Number = 0.10, 0..=0.5, "radians";
        /// Lobes of a lobed nucleus.
        lobes: Count = Number::choice([1.0, 2.0, 2.0, 2.0, 3.0, 3.0, 3.0, 4.0, 5.0]), 1..=8;
        /// Diameter of a lobed leukocyte's cytoplasm.
        cell_um: Number = Number::normal(9.6, 0.7), 1..=100, "µm";
        /// Probability that a lobed leukocyte is degenerated: its nucleus smudged, its cytoplasm frayed.
        degenerated: Number = 0.2, 0..=1;
        /// Absorbance, before the field's stain of nuclei.
        absorbance: Number = Number::normal(0.30, 0.05), 0..=4;
        /// Absorbance of the pale cytoplasm round the nucleus.
        halo: Number = Number::log_normal(0.10, 0.35), 0..=4;
    }
}

/// A white blood cell, its numbers drawn.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Leukocyte {
    /// How the nucleus is shaped.
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
    /// Absorbance of the cytoplasm round it.
    pub halo: f64,
    /// Diameter of the cytoplasm, µm.
    pub cell_um: f64,
    /// Nucleus smudged, cytoplasm frayed.
    pub degenerated: bool,
    /// Dyes of the cytoplasm where its absorbance is 1.
    pub dyes: dye_spectra::Amounts,
}

impl Leukocytes {
    pub(super) fn draw(&self, ground: &mut Ground<'_, Leukocyte>) {
        let dyes = ground.cyanophilic();
        for index in 0..ground.count(named!(self.clusters)) {
            let mut rng = ground.stream(index, "cluster");
            let clump = ground.cluster(&self.on_cells, &self.cluster_um, &mut rng);
            let mut taken: Vec<[f64; 2]> = Vec::new();
            for member in 0..self.per_cluster.draw_count(&mut rng).max(1) as u64 {
                let number = member_number(index, member);
                let mut rng = ground.stream(number, "body");
                let radius_um = self.radius_um.draw(&mut rng);
                let (lobes, cell_um, degenerated) = self.draw_lobed(&mut ground.stream(number, "lobes"));
                let centre_um = match self.form {
                    NucleusForm::Round => clump.free_place(&taken, APART * radius_um, &mut rng),
                    NucleusForm::Lobed => {
                        let touching = self.touching.draw(&mut rng);
                        clump.pressed_place(&taken, touching, cell_um, &mut rng)
                    }
                };
                taken.push(centre_um);
                let leukocyte = Leukocyte {
                    form: self.form,
                    radius_um,
                    lobes,
                    alpha: self.alpha.draw(&mut rng),
                    beta: self.beta.draw(&mut rng),
                    absorbance: self.absorbance.draw(&mut rng) * ground.nuclear_stain(),
                    halo: self.halo.draw(&mut rng),
                    cell_um,
                    degenerated,
                    dyes,
                };
                let depth_um = clump.depth_um + 0.5 * random::normal(&mut rng);
                let lie = Lie::any_way(centre_um, depth_um, &mut rng);
                ground.add(number, cluster_id(index), lie, leukocyte);
            }
        }
    }
}

impl Leukocytes {
    /// Lobes, diameter and whether it is degenerated.
    fn draw_lobed(&self, rng: &mut Stream) -> (usize, f64, bool) {
        match self.form {
            NucleusForm::Round => (1, 0.0, false),
            NucleusForm::Lobed => {
                let lobes = self.lobes.draw_count(rng).max(1);
                let cell_um = self.cell_um.draw(rng);
                (lobes, cell_um, random::chance(self.degenerated.draw(rng), rng))
            }
        }
    }
}

/// Leukocytes lie beside each other rather than in each other: nearer than this many radii is tried again …
const APART: f64 = 1.5;
/// … this often.
const TRIES: usize = 24;
/// Distance of two that touch, relative to the diameter of their cytoplasm: they flatten each other.
const PRESSED: [f64; 2] = [0.72, 1.0];

impl Cluster {
    /// A place of the clump that is so far from all others, if one is found.
    fn free_place(&self, taken: &[[f64; 2]], apart_um: f64, rng: &mut Stream) -> [f64; 2] {
        apart(taken, apart_um, || self.place(rng))
    }

    /// A place that touches one which is taken, or stays apart from all of them.
    fn pressed_place(&self, taken: &[[f64; 2]], touching: f64, cell_um: f64, rng: &mut Stream) -> [f64; 2] {
        if taken.is_empty() {
            return self.centre_um;
        }
        if !random::chance(touching, rng) {
            return self.free_place(taken, cell_um, rng);
        }
        apart(taken, PRESSED[0] * cell_um, || {
            let other = taken[random::below(taken.len(), rng)];
            let (angle, distance) = (random::direction(rng), cell_um * random::between(PRESSED[0], PRESSED[1], rng));
            [other[0] + distance * libm::cos(angle), other[1] + distance * libm::sin(angle)]
        })
    }
}

/// The first of some places that is so far from all others, or the last that is tried.
fn apart(taken: &[[f64; 2]], apart_um: f64, mut place: impl FnMut() -> [f64; 2]) -> [f64; 2] {
    let mut tried = place();
    for _ in 0..TRIES {
        if !taken.iter().any(|other| near(*other, tried, apart_um)) {
            break;
        }
        tried = place();
    }
    tried
}

impl Leukocyte {
    pub(super) fn reach_um(&self, _pixel_um: f64) -> f64 {
        (1.3 * self.cell_um).max((2.0 + 2.0 * self.alpha) * self.radius_um)
    }

    pub(super) fn phantom(&self, site: &Site<'_>) -> Phantom {
        match self.form {
            NucleusForm::Round => round::make(self, site),
            NucleusForm::Lobed => neutrophil::make(self, site),
        }
    }
}
