//! Trichomonads: pale pear-shaped flagellates with a small, spindle-shaped nucleus.

use super::prelude::*;

section! {
    /// Trichomonads, pale pear-shaped flagellates.
    pub struct Trichomonads, drawn from rng as pub Trichomonad {
        /// Number of groups; drawn once a field.
        groups: Abundance (undrawn) = Abundance::per_mm2(Number::log_normal(0.11, 0.9)), 0..=100000, "per field or per mm²";
        /// Trichomonads of a group.
        per_group: Count (undrawn) = Number::log_normal(5.0, 0.7).at_least(1.0), 1..=10000;
        /// Radius (standard deviation) of a group.
        group_um: Number (undrawn) = Number::uniform(12.0, 30.0), 0..=1000, "µm";
        /// Share of the groups that lie on a cell.
        on_cells: Number (undrawn) = 0.4, 0..=1;
        /// Length.
        length_um: Number = Number::normal(12.0, 1.0), 2..=60, "µm";
        /// Width relative to the length.
        width: Number = Number::uniform(0.55, 0.8), 0.2..=1;
        /// Absorbance of the pale body.
        absorbance: Number = Number::log_normal(0.09, 0.25), 0..=4;
        /// Absorbance of the nucleus above the body.
        nucleus: Number = Number::uniform(0.08, 0.2), 0..=4;
        /// Its dyes; the nucleus takes those of other nuclei.
        dyes: DyeAmounts = DyeAmounts { light_green: 2.2, eosin_y: 0.6, haematein: 0.15, ..DyeAmounts::none() };
    }
}

impl Trichomonads {
    pub(super) fn draw(&self, ground: &mut Ground<'_, Trichomonad>) {
        let dyes = ground.dyes(&self.dyes);
        let clusters = Clusters {
            purpose: "group",
            on_cells: &self.on_cells,
            radius_um: &self.group_um,
            members: &self.per_group,
            spread_um: 0.5,
        };
        ground.strew_in_clusters(named!(self.groups), &clusters, |_, _, rng| Trichomonad { dyes, ..self.one(rng) });
    }
}

/// Corners of the outline before it is smoothed, and points between two of them.
const CORNERS: usize = 16;
const BETWEEN: usize = 4;

/// How much wider the front of the pear is than its tail.
const PEAR: f64 = 0.32;

/// Strength of the cytoplasm's grain, and its size, µm.
const GRAIN: f32 = 0.2;
const GRAIN_UM: f64 = 0.4;

/// Width of a flagellum, µm, and its absorbance relative to the body's.
const FLAGELLUM_UM: f64 = 0.25;
const FLAGELLUM: f64 = 0.3;

impl Trichomonad {
    pub(super) fn reach_um(&self, _pixel_um: f64) -> f64 {
        1.1 * self.length_um
    }

    pub(super) fn phantom(&self, site: &Site<'_>) -> Phantom {
        let mut rng = site.stream("shape");
        let (a, b) = (0.5 * self.length_um, 0.5 * self.length_um * self.width);
        let corners: Vec<Point> = (0..CORNERS)
            .map(|i| {
                let angle = core::f64::consts::TAU * i as f64 / CORNERS as f64;
                let (sin, cos) = (libm::sin(angle), libm::cos(angle));
                let wobble = 1.0 + 0.05 * random::normal(&mut rng);
                [a * cos * wobble, b * sin * wobble * (1.0 + PEAR * cos)]
            })
            .collect();
        let outline = site.places(&smooth(&corners, BETWEEN));
        // Flagella start in front, the axostyle sticks out behind.
        let mut threads: Vec<[Point; 3]> = (0..3 + random::below(2, &mut rng))
            .map(|_| {
                let mut ahead = |reach: f64| [reach * a, 0.3 * a * random::normal(&mut rng)];
                [[0.85 * a, 0.0], ahead(1.25), ahead(1.6)]
            })
            .collect();
        threads.push([[-0.8 * a, 0.0], [-1.1 * a, 0.05 * a], [-1.3 * a, 0.1 * a * random::normal(&mut rng)]]);
        let threads: Vec<[Point; 3]> = threads.iter().map(|thread| thread.map(|p| site.place(p))).collect();
        let mut painting = site.painting(outline.iter().chain(threads.iter().flatten()), 0.5);
        painting.fill(&outline, self.absorbance);
        let look = FieldSampler::clouds(site.px(GRAIN_UM), &mut rng);
        painting.texture(site.noise_fields.clouds(), &look, GRAIN);
        let mut hairs = painting.blank();
        let half_width = site.px(0.5 * FLAGELLUM_UM);
        for pair in threads.iter().flat_map(|thread| thread.windows(2)) {
            hairs.stroke(&Stroke::even(pair[0], pair[1], half_width), FLAGELLUM * self.absorbance);
        }
        let mut nucleus = painting.blank();
        let (at, tilt) = ([0.42 * a, 0.2 * b * random::normal(&mut rng)], 0.4 * random::normal(&mut rng));
        let reach = 0.15 * self.length_um;
        let tip =
            |side: f64| site.place([at[0] + side * reach * libm::cos(tilt), at[1] + side * reach * libm::sin(tilt)]);
        let (middle, thick) = (site.place(at), site.px(0.07 * self.length_um));
        for side in [-1.0, 1.0] {
            let half_widths = [thick, 0.35 * thick];
            nucleus.stroke(&Stroke { ends: [middle, tip(side)], half_widths }, 0.0);
        }
        nucleus.even(self.nucleus);
        // Flagella are no part of its outline: nobody would draw it round them.
        painting
            .finish(self.dyes, 0.0, self.absorbance)
            .with_inclusion(nucleus.absorbance, site.dyes.nucleus)
            .with_inclusion(hairs.absorbance, self.dyes)
    }
}
