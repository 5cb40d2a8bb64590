//! Bare nuclei: nuclei of intermediate cells that have lost their cytoplasm but for faint shreds.

use super::prelude::*;

section! {
    /// Bare nuclei: what bacteria leave of intermediate cells.
    pub struct BareNuclei, drawn from rng as pub BareNucleus {
        /// Number of nuclei; drawn once a field.
        count: Abundance (undrawn) = Abundance::per_mm2(Number::log_normal(5.0, 0.9)), 0..=100000, "per field or per mm²";
        /// Share of the nuclei that lie on a cell.
        on_cells: Number (undrawn) = 0.15, 0..=1;
        /// Radius of the disc of the same area.
        radius_um: Number = Number::normal(3.7, 0.35), 1..=20, "µm";
        /// Length relative to width.
        elongation: Number = Number::uniform(1.05, 1.5), 1..=4;
        /// Absorbance, before the field's stain of nuclei.
        absorbance: Number = Number::normal(0.34, 0.05), 0..=4;
        /// Contrast of its chromatin relative to the absorbance.
        texture: Number = Number::uniform(0.08, 0.18), 0..=2;
        /// Absorbance of the shreds of cytoplasm round it.
        shreds: Number = Number::uniform(0.0, 0.06), 0..=4;
    } also {
        /// Dyes of the shreds where their absorbance is 1.
        dyes: Amounts,
    }
}

impl BareNuclei {
    pub(super) fn draw(&self, ground: &mut Ground<'_, BareNucleus>) {
        let dyes = ground.cyanophilic();
        let stain = ground.nuclear_stain();
        ground.strew_on_cells(named!(self.count), &self.on_cells, |rng| {
            let nucleus = self.one(rng);
            BareNucleus { absorbance: nucleus.absorbance * stain, dyes, ..nucleus }
        });
    }
}

/// Width of the dark rim, µm, and how much darker it is.
const RIM_UM: f64 = 0.45;
const RIM: f32 = 0.15;

/// Size (standard deviation) of clumps of chromatin, µm.
const CLUMP_UM: f64 = 0.35;

const SHREDS: usize = 7;

impl BareNucleus {
    pub(super) fn reach_um(&self, _pixel_um: f64) -> f64 {
        (1.8 * self.elongation.max(1.0 / self.elongation).sqrt()).max(2.8) * self.radius_um
    }

    pub(super) fn phantom(&self, site: &Site<'_>) -> Phantom {
        let mut rng = site.stream("shape");
        let stretch = self.elongation.sqrt();
        let shape = perturbed_circle(self.radius_um, 0.04, 0.08, &mut rng);
        let scaled = |by: f64| -> Vec<Point> {
            shape.iter().map(|p| site.place([by * stretch * p[0], by * p[1] / stretch])).collect()
        };
        let outline = scaled(1.0);
        let mut nucleus = site.painting(&outline, 1.2 * self.radius_um);
        nucleus.coverage.cover(&outline);
        let mut inner = nucleus.coverage.blank();
        inner.cover(&scaled((1.0 - RIM_UM / self.radius_um).max(0.0)));
        nucleus
            .layered(&inner.values, |cover, inner| self.absorbance as f32 * (cover + RIM * (cover - inner).max(0.0)));
        let look = FieldSampler::clouds(site.px(CLUMP_UM), &mut rng);
        nucleus.texture(site.noise_fields.clouds(), &look, self.texture as f32);
        let mut shreds = nucleus.blank();
        for _ in 0..SHREDS {
            let (angle, reach) = (random::direction(&mut rng), self.radius_um * random::between(1.0, 1.8, &mut rng));
            let ends = [0.7 * self.radius_um, reach];
            let bend = angle + 0.3 * random::normal(&mut rng);
            let ends = ends.map(|r| site.place([r * libm::cos(bend), r * libm::sin(angle)]));
            let half_width = site.px(self.radius_um * random::between(0.12, 0.45, &mut rng));
            shreds.stroke(&Stroke { ends, half_widths: [half_width, 0.4 * half_width] }, self.shreds);
        }
        nucleus.finish(site.dyes.nucleus, 0.0, self.absorbance).with_inclusion(shreds.absorbance, self.dyes)
    }
}
