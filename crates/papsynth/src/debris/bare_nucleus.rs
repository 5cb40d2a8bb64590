//! Bare nuclei: nuclei of intermediate cells without cytoplasm except for faint shreds.

use super::prelude::*;
use super::tuft::Tuft;

section! {
    /// Bare nuclei: nuclei of intermediate cells after lysis by bacteria.
    pub struct BareNuclei, drawn from rng as pub BareNucleus {
        /// Number of nuclei; drawn once per field.
        count: Abundance (undrawn) = Abundance::per_mm2(Number::log_normal(5.0, 0.9)), 0..=100000, "per field or per mm²";
        /// Fraction of the nuclei that are on a cell.
        on_cells: Number (undrawn) = 0.15, 0..=1;
        /// Radius of a disc of the same area.
        radius_um: Number = Number::normal(3.7, 0.35), 1..=20, "µm";
        /// Length relative to width.
        elongation: Number = Number::uniform(1.05, 1.5), 1..=4;
        /// Absorbance, before the nuclear stain factor of the field.
        absorbance: Number = Number::normal(0.34, 0.05), 0..=4;
        /// Contrast of chromatin relative to the absorbance.
        texture: Number = Number::uniform(0.08, 0.18), 0..=2;
        /// Absorbance of the surrounding shreds of cytoplasm.
        shreds: Number = Number::uniform(0.0, 0.06), 0..=4;
    } also {
        /// Amounts of dye of the shreds where the absorbance is 1.
        dyes: Amounts,
    }
}

impl BareNuclei {
    pub(super) fn draw(&self, placer: &mut KindPlacer<'_, BareNucleus>) {
        let dyes = placer.cyanophilic();
        let stain = placer.nuclear_stain();
        placer.place_on_cells(named!(self.count), &self.on_cells, |rng| {
            let nucleus = self.one(rng);
            BareNucleus { absorbance: nucleus.absorbance * stain, dyes, ..nucleus }
        });
    }
}

/// Width of the dark rim, µm.
const RIM_UM: f64 = 0.45;
/// Relative increase of absorbance in the rim.
const RIM: f32 = 0.15;

/// Irregularity of the outline: standard deviation of the second harmonic.
const IRREGULAR: f64 = 0.055;
/// Width over which the absorbance falls towards the outline, µm: minimum, maximum.
const EDGE_UM: [f64; 2] = [0.3, 1.2];
/// Number of steps of this fall.
const EDGE_STEPS: u8 = 4;

/// Size (standard deviation) of clumps of chromatin, µm.
const CLUMP_UM: f64 = 0.35;

/// Distance of the centre of the shreds from that of the nucleus, in its radii: minimum, maximum.
const AWAY: [f64; 2] = [0.0, 0.7];
/// Half length of the shreds in radii of the nucleus: minimum, maximum.
const LENGTH: [f64; 2] = [1.1, 1.6];
/// Width of the shreds relative to their length: minimum, maximum.
const WIDTH: [f64; 2] = [0.6, 1.0];
/// Size of the grains of the shreds, µm, and their contrast.
const GRAIN_UM: f64 = 0.9;
const GRANULARITY: f64 = 0.25;

impl BareNucleus {
    pub(super) fn reach_um(&self, _pixel_um: f64) -> f64 {
        (1.8 * self.elongation.max(1.0 / self.elongation).sqrt()).max(2.8) * self.radius_um
    }

    pub(super) fn phantom(&self, context: &ObjectContext<'_>) -> Phantom {
        let mut rng = context.stream("shape");
        let stretch = self.elongation.sqrt();
        let mut shape = perturbed_circle(self.radius_um, 0.04, 0.08, &mut rng);
        make_irregular(&mut shape, IRREGULAR, &mut rng);
        let edge_um = random::between(EDGE_UM[0], EDGE_UM[1], &mut rng);
        let scaled = |by: f64| -> Vec<Point> {
            shape.iter().map(|p| context.to_grid([by * stretch * p[0], by * p[1] / stretch])).collect()
        };
        let outline = scaled(1.0);
        let mut nucleus = context.canvas(&outline, 1.2 * self.radius_um);
        nucleus.coverage.cover(&outline);
        let mut inner = nucleus.coverage.blank();
        inner.cover(&scaled((1.0 - RIM_UM / self.radius_um).max(0.0)));
        nucleus.shade_by_coverage(&inner.values, |cover, inner| {
            self.absorbance as f32 * (cover + RIM * (cover - inner).max(0.0))
        });
        // A swollen nucleus is thinner towards its outline.
        let mut thinner = nucleus.coverage.blank();
        for step in 1..=EDGE_STEPS {
            let mut within = nucleus.coverage.blank();
            within.cover(&scaled((1.0 - edge_um * f64::from(step) / f64::from(EDGE_STEPS) / self.radius_um).max(0.0)));
            thinner.values.iter_mut().zip(&within.values).for_each(|(sum, value)| *sum += value);
        }
        let levels = nucleus.absorbance.values.iter_mut().zip(&thinner.values);
        levels.for_each(|(value, sum)| *value *= (1.0 + sum) / (1.0 + f32::from(EDGE_STEPS)));
        let sampler = FieldSampler::clouds(context.px(CLUMP_UM), &mut rng);
        nucleus.texture(context.noise_fields.clouds(), &sampler, self.texture as f32);
        let mut shreds = nucleus.blank();
        let side = random::direction(&mut rng);
        let away = self.radius_um * random::between(AWAY[0], AWAY[1], &mut rng);
        let length = self.radius_um * random::between(LENGTH[0], LENGTH[1], &mut rng);
        Tuft {
            centre: context.to_grid([away * libm::cos(side), away * libm::sin(side)]),
            half: [context.px(length), context.px(length * random::between(WIDTH[0], WIDTH[1], &mut rng))],
            turn: random::direction(&mut rng),
            grain: context.px(GRAIN_UM),
            granularity: GRANULARITY,
            ragged: 1.0,
            absorbance: self.shreds,
        }
        .draw(&mut shreds, context, &mut rng);
        nucleus.into_phantom(context.dyes.nucleus, 0.0, self.absorbance).with_inclusion(shreds.absorbance, self.dyes)
    }
}
