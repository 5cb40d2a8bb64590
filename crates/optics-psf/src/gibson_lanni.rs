use crate::error::{Error, require, within};
use crate::microscope::distance;
use crate::overlap::quadrature_rule;
use crate::pupil::turn;

/// Parameters of [`GibsonLanni`]: design and actual values of the optical path.
#[derive(Debug, Clone, PartialEq)]
pub struct GibsonLanniParams {
    /// Numerical aperture, above 0, at most the immersion and cover glass indices, below the index of the mountant.
    /// Default 0.95, the paper's.
    pub na: f64,
    /// Vacuum wavelength, 0.1 to 10 µm. Default 0.57, the paper's filter.
    pub wavelength_um: f64,
    /// Depth of the point below the cover glass, 0 to 1000 µm. Default 0, ours.
    pub depth_um: f64,
    /// Refractive index of the mountant, 1 to 3. Default 1.515, ours.
    pub mount_index: f64,
    /// Refractive index of the immersion medium, actual and design value, 1 to 3. Default 1, ours: air.
    pub immersion_index: [f64; 2],
    /// Design working distance, 0 to 10 000 µm. Default 150, ours.
    pub working_distance_um: f64,
    /// Thickness of the cover glass, actual and design value, 0 to 10 000 µm. Default 170, the standard.
    pub cover_um: [f64; 2],
    /// Refractive index of the cover glass, actual and design value, 1 to 3. Default 1.515, ours.
    pub cover_index: [f64; 2],
}

impl Default for GibsonLanniParams {
    fn default() -> Self {
        Self {
            na: 0.95,
            wavelength_um: 0.57,
            depth_um: 0.0,
            mount_index: 1.515,
            immersion_index: [1.0; 2],
            working_distance_um: 150.0,
            cover_um: [170.0; 2],
            cover_index: [1.515; 2],
        }
    }
}

/// The scalar point spread function of a lens used away from its design conditions (Gibson and Lanni, DOI
/// 10.1364/JOSAA.8.001601): a self-luminous point below a cover glass.
///
/// I(r, z) = |2 ∫₀¹ J₀(k NA r ρ) exp(ik OPD) ρ dρ|², 1 in the focus of a perfect lens, with OPD = z_p g(n_s) + t g(n_i)
/// − t_i⁰ g(n_i⁰) + t_g g(n_g) − t_g⁰ g(n_g⁰), g(n) = √(n² − NA² ρ²). The thickness of the immersion layer at focus z
/// is t = z_p − z + n_i (−z_p/n_s − t_g/n_g + t_g⁰/n_g⁰ + t_i⁰/n_i⁰).
#[derive(Debug, Clone, PartialEq)]
pub struct GibsonLanni {
    params: GibsonLanniParams,
}

/// Quadrature nodes: a minimum, and the number per fringe on the pupil.
const NODES: (usize, f64) = (24, 4.0);

impl GibsonLanni {
    /// Validates the parameters and creates the model.
    ///
    /// # Errors
    ///
    /// If a number is not finite or out of the range of its field.
    pub fn new(params: &GibsonLanniParams) -> Result<Self, Error> {
        let p = params;
        for (field, value) in [
            ("mount_index", p.mount_index),
            ("immersion_index[0]", p.immersion_index[0]),
            ("immersion_index[1]", p.immersion_index[1]),
            ("cover_index[0]", p.cover_index[0]),
            ("cover_index[1]", p.cover_index[1]),
        ] {
            within(field, value, 1.0..=3.0, "a number from 1 to 3")?;
        }
        let smallest = p.immersion_index.into_iter().chain(p.cover_index).fold(f64::INFINITY, f64::min);
        let holds = p.na > 0.0 && p.na <= smallest && p.na < p.mount_index;
        require("na", p.na, holds, "above 0, at most immersion_index and cover_index, and below mount_index")?;
        within("wavelength_um", p.wavelength_um, 0.1..=10.0, "a number from 0.1 to 10")?;
        within("depth_um", p.depth_um, 0.0..=1000.0, "a number from 0 to 1000")?;
        let [cover, designed] = p.cover_um;
        for (field, value) in
            [("working_distance_um", p.working_distance_um), ("cover_um[0]", cover), ("cover_um[1]", designed)]
        {
            within(field, value, 0.0..=10_000.0, "a number from 0 to 10000")?;
        }
        Ok(Self { params: params.clone() })
    }

    /// Returns the intensity at the distances `r_um` from the axis, one row per focus position `z_um`. 1 is the
    /// intensity of a perfect lens in focus. Larger z focuses deeper.
    ///
    /// # Errors
    ///
    /// If a distance is not finite or beyond ±1000 µm.
    pub fn profile(&self, r_um: &[f64], z_um: &[f64]) -> Result<Vec<f64>, Error> {
        for (field, list) in [("r_um", r_um), ("z_um", z_um)] {
            list.iter().try_for_each(|&value| distance(field, value).map(drop))?;
        }
        let p = &self.params;
        let fringes = |&z: &f64| {
            let at = |i: i32| self.waves(f64::from(i) / 32.0, z);
            (1..=32).map(|i| (at(i) - at(i - 1)).abs()).sum::<f64>()
        };
        let rings = r_um.iter().fold(0.0_f64, |most, r| most.max(r.abs())) * p.na / p.wavelength_um;
        let most = z_um.iter().map(fringes).fold(0.0, f64::max) + rings;
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "float to integer casts saturate")]
        let nodes = NODES.0 + (most * NODES.1) as usize;
        let rule = quadrature_rule(nodes);
        // Wavefront phases per node and z, and Bessel functions per node and r.
        let wave = |&z: &f64| rule.iter().map(|&[rho, _]| turn(self.waves(rho, z) - self.waves(0.0, z))).collect();
        let waves: Vec<Vec<(f64, f64)>> = z_um.iter().map(wave).collect();
        let k_na = core::f64::consts::TAU * p.na / p.wavelength_um;
        let mut intensity = vec![0.0; r_um.len() * z_um.len()];
        for (i, &r) in r_um.iter().enumerate() {
            let weights: Vec<f64> = rule.iter().map(|&[rho, w]| 2.0 * w * rho * libm::j0(k_na * r * rho)).collect();
            for (row, waves) in intensity.chunks_exact_mut(r_um.len()).zip(&waves) {
                let add = |[re, im]: [f64; 2], (w, (c, s)): (&f64, &(f64, f64))| [re + w * c, im + w * s];
                let [re, im] = weights.iter().zip(waves).fold([0.0; 2], add);
                row[i] = re * re + im * im;
            }
        }
        Ok(intensity)
    }

    /// Returns OPD/λ at a normalised pupil radius; the rim is at 1.
    fn waves(&self, rho: f64, z: f64) -> f64 {
        let p = &self.params;
        let g = |n: f64| (n * n - p.na * p.na * rho * rho).max(0.0).sqrt();
        let ([ni, ni0], [ng, ng0], [tg, tg0]) = (p.immersion_index, p.cover_index, p.cover_um);
        let (zp, ns, ti0) = (p.depth_um, p.mount_index, p.working_distance_um);
        let t = zp - z + ni * (-zp / ns - tg / ng + tg0 / ng0 + ti0 / ni0);
        (zp * g(ns) + t * g(ni) - ti0 * g(ni0) + tg * g(ng) - tg0 * g(ng0)) / p.wavelength_um
    }
}
