//! White blood cells ("White blood cells", Eqs. 6, 7, Fig. 9): neutrophils, or the paper's round ones.

mod neutrophil;
mod round;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::check::Section;
use super::ground::{Cluster, Ground, Lie, cluster_id, member_number, near};
use super::kind::{Kinds, Thing};
use super::site::Site;
use crate::key::Stream;
use crate::phantom::piece::Phantom;
use crate::random;
use crate::recipe::number::Number;

/// How the nucleus of a leukocyte is shaped.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum NucleusForm {
    /// Lobes joined by bridges within a pale, ragged cytoplasm, as neutrophils have them; clusters are tight.
    Lobed,
    /// The paper's: one perturbed circle (Eq. 7).
    Round,
}

/// White blood cells ("White blood cells", Eqs. 6, 7, Fig. 9).
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct Leukocytes {
    /// Number of clusters, 0 to 100000; drawn once a field.
    pub clusters: Number,
    /// Leukocytes of a cluster, 1 to 10000.
    pub per_cluster: Number,
    /// Radius (standard deviation) of a cluster, µm, 0 to 1000; of lobed ones that of those which do not touch another.
    pub cluster_um: Number,
    /// Share of a cluster's lobed leukocytes that touch another one, 0 to 1.
    pub touching: Number,
    /// Share of the clusters that lie on a cell, 0 to 1.
    pub on_cells: Number,
    /// How the nucleus is shaped.
    pub form: NucleusForm,
    /// Radius of a leukocyte's nucleus, µm, 0.3 to 20 (s of Eq. 7); of a lobed one that of the disc of its area.
    pub radius_um: Number,
    /// Range of the radial perturbation, 0 to 0.5 (α of Eq. 7).
    pub alpha: Number,
    /// Range of the angular perturbation, radians, 0 to 0.5 (β of Eq. 7).
    pub beta: Number,
    /// Lobes of a lobed nucleus, 1 to 8.
    pub lobes: Number,
    /// Diameter of a lobed leukocyte's cytoplasm, µm, 1 to 100.
    pub cell_um: Number,
    /// Probability that a lobed leukocyte is degenerated: its nucleus smudged, its cytoplasm frayed; 0 to 1.
    pub degenerated: Number,
    /// Absorbance, 0 to 4, before the field's stain of nuclei.
    pub absorbance: Number,
    /// Absorbance of the pale cytoplasm round the nucleus, 0 to 4.
    pub halo: Number,
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

impl Default for Leukocytes {
    fn default() -> Self {
        Self {
            clusters: Number::log_normal(2.4, 1.0),
            per_cluster: Number::log_normal(1.7, 0.75).at_least(1.0),
            cluster_um: Number::uniform(8.0, 20.0),
            touching: 0.7.into(),
            on_cells: 0.45.into(),
            form: NucleusForm::Lobed,
            radius_um: Number::normal(3.2, 0.28),
            alpha: 0.10.into(),
            beta: 0.10.into(),
            lobes: Number::choice([1.0, 2.0, 2.0, 2.0, 3.0, 3.0, 3.0, 4.0, 5.0]),
            cell_um: Number::normal(9.6, 0.7),
            degenerated: 0.2.into(),
            absorbance: Number::normal(0.30, 0.05),
            halo: Number::log_normal(0.10, 0.35),
        }
    }
}

impl Kinds<Leukocyte> for Leukocytes {
    fn none() -> Self {
        Self { clusters: 0.0.into(), ..Self::default() }
    }

    fn check(&self, section: &mut Section<'_>) {
        section.count("clusters", &self.clusters, 0.0, 1e5);
        section.count("per_cluster", &self.per_cluster, 1.0, 1e4);
        section.number("cluster_um", &self.cluster_um, 0.0, 1000.0);
        section.share("touching", &self.touching);
        section.share("on_cells", &self.on_cells);
        section.number("radius_um", &self.radius_um, 0.3, 20.0);
        section.number("alpha", &self.alpha, 0.0, 0.5);
        section.number("beta", &self.beta, 0.0, 0.5);
        section.count("lobes", &self.lobes, 1.0, 8.0);
        section.number("cell_um", &self.cell_um, 1.0, 100.0);
        section.share("degenerated", &self.degenerated);
        section.absorbance("absorbance", &self.absorbance);
        section.absorbance("halo", &self.halo);
    }

    fn draw(&self, ground: &mut Ground<'_, Leukocyte>) {
        let dyes = ground.cyanophilic();
        for index in 0..ground.count("clusters", &self.clusters) {
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
        let mut place = self.place(rng);
        for _ in 0..TRIES {
            if !taken.iter().any(|other| near(*other, place, apart_um)) {
                break;
            }
            place = self.place(rng);
        }
        place
    }

    /// A place that touches one which is taken, or stays apart from all of them.
    fn pressed_place(&self, taken: &[[f64; 2]], touching: f64, cell_um: f64, rng: &mut Stream) -> [f64; 2] {
        if taken.is_empty() {
            return self.centre_um;
        }
        if !random::chance(touching, rng) {
            return self.free_place(taken, cell_um, rng);
        }
        let beside = |rng: &mut Stream| {
            let other = taken[random::below(taken.len(), rng)];
            let (angle, distance) = (random::direction(rng), cell_um * random::between(PRESSED[0], PRESSED[1], rng));
            [other[0] + distance * libm::cos(angle), other[1] + distance * libm::sin(angle)]
        };
        let mut place = beside(rng);
        for _ in 0..TRIES {
            if !taken.iter().any(|other| near(*other, place, PRESSED[0] * cell_um)) {
                break;
            }
            place = beside(rng);
        }
        place
    }
}

impl Thing for Leukocyte {
    fn absorbance(&self) -> f64 {
        self.absorbance
    }

    fn reach_um(&self, _pixel_um: f64) -> f64 {
        (1.3 * self.cell_um).max((2.0 + 2.0 * self.alpha) * self.radius_um)
    }

    fn phantom(&self, site: &Site<'_>) -> Phantom {
        match self.form {
            NucleusForm::Round => round::make(self, site),
            NucleusForm::Lobed => neutrophil::make(self, site),
        }
    }
}
