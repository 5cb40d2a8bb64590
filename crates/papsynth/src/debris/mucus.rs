//! Mucus: long bundles of faint parallel fibres.

use super::prelude::*;

section! {
    /// Strands of mucus: bundles of faint fibres.
    pub struct Mucus, drawn from rng as pub Strand {
        /// Number of strands; drawn once per field.
        strands: Abundance (undrawn) = Abundance::per_mm2(Number::log_normal(1.0, 0.8)), 0..=10000, "per field or per mm²";
        /// Fraction of the strands that are on a cell.
        on_cells: Number (undrawn) = 0.3, 0..=1;
        /// Length of a strand.
        length_um: Number = Number::log_normal(40.0, 0.45).at_least(10.0).at_most(150.0), 5..=400, "µm";
        /// Width of a strand.
        width_um: Number = Number::log_normal(5.0, 0.4), 1..=100, "µm";
        /// Fibres per strand.
        fibres: Count = Number::uniform(6.0, 20.0), 1..=200;
        /// Width of a fibre.
        fibre_width_um: Number = Number::uniform(0.4, 1.1), 0.1..=5, "µm";
        /// Absorbance of a fibre.
        absorbance: Number = Number::log_normal(0.05, 0.4), 0..=4;
        /// Phase delay; has an effect only with bright-field optics.
        phase_rad: Number = Number::uniform(0.0, 0.12), -3..=3, "radians of phase";
        /// Dyes.
        dyes: DyeAmounts = DyeAmounts { light_green: 2.5, eosin_y: 0.5, ..DyeAmounts::none() };
    }
}

impl Mucus {
    pub(super) fn draw(&self, placer: &mut KindPlacer<'_, Strand>) {
        let dyes = placer.dyes(&self.dyes);
        placer.place_on_cells(named!(self.strands), &self.on_cells, |rng| Strand { dyes, ..self.one(rng) });
    }
}

/// Straight segments of a strand.
const PARTS: usize = 40;

/// Standard deviation of the change of direction per segment, radians.
const BEND: f64 = 0.03;

/// Absorbance between the fibres, relative to them.
const VEIL: f64 = 0.3;
/// Strength of the texture between the fibres.
const CLOUDY: f32 = 0.8;
/// Size (standard deviation) of that texture, µm.
const CLOUD_UM: f64 = 0.7;

/// Fraction of the length over which each end tapers.
const TAPER: f64 = 0.3;

/// Minimum width of a strand relative to its nominal width.
const NECK: f64 = 0.35;

impl Strand {
    pub(super) fn reach_um(&self, _pixel_um: f64) -> f64 {
        0.8 * self.length_um + self.width_um
    }

    pub(super) fn phantom(&self, context: &ObjectContext<'_>) -> Phantom {
        let mut rng = context.stream("shape");
        let step = self.length_um / PARTS as f64;
        let (mut at, mut way, mut bend) = ([0.0, 0.0], 0.0, 0.0);
        let mut spine: Vec<(Point, f64)> = Vec::with_capacity(PARTS + 1);
        for _ in 0..=PARTS {
            spine.push((at, way));
            bend = 0.9 * bend + BEND * random::normal(&mut rng);
            way += bend;
            at = [at[0] + step * libm::cos(way), at[1] + step * libm::sin(way)];
        }
        let middle = spine[PARTS / 2].0;
        let waves: [f64; 3] = core::array::from_fn(|_| random::direction(&mut rng));
        // Half-width along the strand.
        let half: Vec<f64> = (0..=PARTS)
            .map(|i| {
                let t = i as f64 / PARTS as f64;
                let swell = 0.5 + 0.5 * libm::sin(7.0 * t + waves[0]) * libm::cos(3.0 * t + waves[1]);
                let taper = (t / TAPER).min((1.0 - t) / TAPER).min(1.0);
                0.5 * self.width_um * (NECK + (1.0 - NECK) * swell) * (0.15 + 0.85 * taper)
            })
            .collect();
        let mut fibres: Vec<Vec<Point>> = Vec::with_capacity(self.fibres);
        for _ in 0..self.fibres {
            // Fibres run parallel to the strand with small deviations; some are shorter than the strand.
            let mut across = random::between(-1.0, 1.0, &mut rng);
            let first = if random::chance(0.5, &mut rng) { 0 } else { random::below(PARTS / 2, &mut rng) };
            let last = if random::chance(0.5, &mut rng) { PARTS } else { PARTS - random::below(PARTS / 2, &mut rng) };
            let fibre = (first..=last)
                .map(|i| {
                    across = (across + 0.06 * random::normal(&mut rng)).clamp(-1.0, 1.0);
                    let ([x, y], way) = spine[i];
                    let off = across * half[i];
                    context.to_grid([x - middle[0] - off * libm::sin(way), y - middle[1] + off * libm::cos(way)])
                })
                .collect();
            fibres.push(fibre);
        }
        let mut canvas = context.canvas(fibres.iter().flatten(), self.fibre_width_um + 0.5 * self.width_um);
        for (part, half) in spine.windows(2).zip(half.windows(2)) {
            let ends = [part[0].0, part[1].0].map(|p| context.to_grid([p[0] - middle[0], p[1] - middle[1]]));
            let half_widths = [context.px(half[0]), context.px(half[1])];
            canvas.stroke_max(&Stroke { ends, half_widths }, VEIL * self.absorbance);
        }
        let sampler = FieldSampler::clouds(context.px(CLOUD_UM), &mut rng);
        canvas.texture(context.noise_fields.clouds(), &sampler, CLOUDY);
        for fibre in &fibres {
            let half_width = context.px(0.5 * self.fibre_width_um * random::between(0.6, 1.3, &mut rng));
            let strength = self.absorbance * random::between(0.4, 1.4, &mut rng);
            for part in fibre.windows(2) {
                canvas.stroke_max(&Stroke::even(part[0], part[1], half_width), strength);
            }
        }
        canvas.into_phantom(self.dyes, self.phase_rad, self.absorbance)
    }
}
