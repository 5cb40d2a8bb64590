//! Trichomonads: pale pear-shaped flagellates with a small spindle-shaped nucleus.

use super::prelude::*;

section! {
    /// Trichomonads: pale pear-shaped flagellates.
    pub struct Trichomonads, drawn from rng as pub Trichomonad {
        /// Number of groups; drawn once per field.
        groups: Abundance (undrawn) = Abundance::per_mm2(Number::log_normal(0.11, 0.9)), 0..=100000, "per field or per mm²";
        /// Trichomonads per group.
        per_group: Count (undrawn) = Number::log_normal(5.0, 0.7).at_least(1.0), 1..=10000;
        /// Radius (standard deviation) of a group.
        group_radius_um: Number (undrawn) = Number::uniform(12.0, 30.0), 0..=1000, "µm";
        /// Fraction of the groups that are on a cell.
        on_cells: Number (undrawn) = 0.4, 0..=1;
        /// Length.
        length_um: Number = Number::normal(12.0, 1.0), 2..=60, "µm";
        /// Width relative to the length.
        width: Number = Number::uniform(0.55, 0.8), 0.2..=1;
        /// Absorbance of the body.
        absorbance: Number = Number::log_normal(0.09, 0.25), 0..=4;
        /// Absorbance of the nucleus, added to that of the body.
        nucleus_absorbance: Number = Number::uniform(0.08, 0.2), 0..=4;
        /// Dyes of the body; the nucleus has the dyes of other nuclei.
        dyes: DyeAmounts = DyeAmounts { light_green: 2.2, eosin_y: 0.6, haematein: 0.15, ..DyeAmounts::none() };
    }
}

impl Trichomonads {
    pub(super) fn draw(&self, placer: &mut KindPlacer<'_, Trichomonad>) {
        let dyes = placer.dyes(&self.dyes);
        let clusters = Clusters {
            purpose: "group",
            on_cells: &self.on_cells,
            radius_um: &self.group_radius_um,
            members: &self.per_group,
            depth_sd_um: 0.5,
        };
        placer.place_in_clusters(named!(self.groups), &clusters, |_, _, rng| Trichomonad { dyes, ..self.one(rng) });
    }
}

/// Corners of the outline before smoothing.
const CORNERS: usize = 16;
/// Curve points per corner.
const POINTS_PER_CORNER: usize = 4;

/// Relative difference in width between front and tail.
const PEAR: f64 = 0.32;

/// Strength of the grain of the cytoplasm.
const GRAIN: f32 = 0.2;
/// Size (standard deviation) of the grain, µm.
const GRAIN_UM: f64 = 0.4;

/// Width of a flagellum, µm.
const FLAGELLUM_UM: f64 = 0.25;
/// Absorbance of a flagellum relative to the body.
const FLAGELLUM: f64 = 0.3;

impl Trichomonad {
    pub(super) fn reach_um(&self, _pixel_um: f64) -> f64 {
        1.1 * self.length_um
    }

    pub(super) fn phantom(&self, context: &ObjectContext<'_>) -> Phantom {
        let mut rng = context.stream("shape");
        let (a, b) = (0.5 * self.length_um, 0.5 * self.length_um * self.width);
        let corners: Vec<Point> = (0..CORNERS)
            .map(|i| {
                let angle = core::f64::consts::TAU * i as f64 / CORNERS as f64;
                let (sin, cos) = (libm::sin(angle), libm::cos(angle));
                let wobble = 1.0 + 0.05 * random::normal(&mut rng);
                [a * cos * wobble, b * sin * wobble * (1.0 + PEAR * cos)]
            })
            .collect();
        let outline = context.curve_to_grid(&smooth(&corners, POINTS_PER_CORNER));
        // Flagella extend from the front, the axostyle from the tail.
        let mut threads: Vec<[Point; 3]> = (0..3 + random::below(2, &mut rng))
            .map(|_| {
                let mut ahead = |reach: f64| [reach * a, 0.3 * a * random::normal(&mut rng)];
                [[0.85 * a, 0.0], ahead(1.25), ahead(1.6)]
            })
            .collect();
        threads.push([[-0.8 * a, 0.0], [-1.1 * a, 0.05 * a], [-1.3 * a, 0.1 * a * random::normal(&mut rng)]]);
        let threads: Vec<[Point; 3]> = threads.iter().map(|thread| thread.map(|p| context.to_grid(p))).collect();
        let mut canvas = context.canvas(outline.iter().chain(threads.iter().flatten()), 0.5);
        canvas.fill(&outline, self.absorbance);
        let sampler = FieldSampler::clouds(context.px(GRAIN_UM), &mut rng);
        canvas.texture(context.noise_fields.clouds(), &sampler, GRAIN);
        let mut hairs = canvas.blank();
        let half_width = context.px(0.5 * FLAGELLUM_UM);
        for pair in threads.iter().flat_map(|thread| thread.windows(2)) {
            hairs.stroke(&Stroke::even(pair[0], pair[1], half_width), FLAGELLUM * self.absorbance);
        }
        let mut nucleus = canvas.blank();
        let (at, tilt) = ([0.42 * a, 0.2 * b * random::normal(&mut rng)], 0.4 * random::normal(&mut rng));
        let reach = 0.15 * self.length_um;
        let tip = |side: f64| {
            context.to_grid([at[0] + side * reach * libm::cos(tilt), at[1] + side * reach * libm::sin(tilt)])
        };
        let (middle, thick) = (context.to_grid(at), context.px(0.07 * self.length_um));
        for side in [-1.0, 1.0] {
            let half_widths = [thick, 0.35 * thick];
            nucleus.stroke(&Stroke { ends: [middle, tip(side)], half_widths }, 0.0);
        }
        nucleus.fill_covered(self.nucleus_absorbance);
        // Flagella are not part of the outline, as in manual annotations.
        canvas
            .into_phantom(self.dyes, 0.0, self.absorbance)
            .with_inclusion(nucleus.absorbance, context.dyes.nucleus)
            .with_inclusion(hairs.absorbance, self.dyes)
    }
}
