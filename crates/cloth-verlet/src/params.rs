//! Parameters and their defaults.

use crate::Error;

/// Parameters of the mesh, the size of the flat sheet, and the solver.
#[derive(Debug, Clone, PartialEq)]
pub struct ClothParams {
    /// Vertices of the circular mesh, 32 to 65 536. Default 1200 (ours): folds are as thin as real
    /// ones. The paper's program has 75 on the rim, 538 in all.
    pub vertices: usize,
    /// Points of the outline while it shrinks, 8 to 65 536. Default 112 (ours): the number of rim vertices of the
    /// default mesh. The paper: 75. [`Solver::Xpbd`] ignores it and uses one point for each rim vertex.
    pub outline_points: usize,
    /// Ratio of the areas of flat sheet and outline, 1 to 4; a [`SheetSpec`](crate::SheetSpec) overrides it. Default
    /// 1.15 (ours). With [`RestShape::Disc`] a lower limit: the disc may need to be larger.
    pub area_ratio: f64,
    /// Shape of the flat sheet.
    pub rest_shape: RestShape,
    /// Steps in which the outline shrinks, 1 to 100 000. Default 60, the paper's.
    pub steps: usize,
    /// Simulation method.
    pub solver: Solver,
    /// Smoothing of the crumpled mesh.
    pub smoothing: Smoothing,
}

/// Shape of the flat sheet.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum RestShape {
    /// A disc through the farthest point of the outline (the paper's).
    Disc,
    /// The shape of the outline, expanded at random places to the area ratio (ours, the default).
    Outline,
}

/// Smoothing of the crumpled mesh.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Smoothing {
    /// No smoothing: the paper's, and the default. Thickness images have no facets in either case.
    None,
    /// One step of Loop's subdivision: four times the triangles and rounder, softer folds (ours), for pixels
    /// much smaller than the mesh.
    Loop,
}

/// Simulation method.
#[derive(Debug, Clone, PartialEq)]
pub enum Solver {
    /// The paper's method.
    Verlet(VerletParams),
    /// Extended position-based dynamics in small steps, with bending and a ceiling: the default.
    Xpbd(XpbdParams),
}

/// Declares a struct of numbers, each with its default, its range and the description of the range.
macro_rules! numbers {
    ($(#[$about:meta])* $name:ident {
        $($(#[$doc:meta])* $field:ident: $type:ty = $default:expr, $low:expr, $high:expr, $accepted:literal;)*
    }) => {
        $(#[$about])*
        #[derive(Debug, Clone, PartialEq)]
        pub struct $name {
            $($(#[$doc])* pub $field: $type,)*
        }

        impl Default for $name {
            fn default() -> Self {
                Self { $($field: $default),* }
            }
        }

        impl $name {
            fn check(&self) -> Result<(), Error> {
                $(range(stringify!($field), self.$field as f64, ($low, $high), $accepted)?;)*
                Ok(())
            }
        }
    };
}

numbers! {
    /// Verlet integration of every vertex (Eq. 4), with distances restored by projection.
    VerletParams {
        /// Fraction of the velocity lost in a step, 0 to 1. Default 0.1, the paper's; 0 is Eq. 4 itself.
        damping: f64 = 0.1, 0.0, 1.0, "0 to 1";
        /// Δt² of Eq. 4, above 0, at most 1. Default 0.49, the paper's.
        dt_squared: f64 = 0.49, f64::MIN_POSITIVE, 1.0, "above 0, at most 1";
        /// Passes over all distance constraints in a step, 1 to 1000. Default 2, the paper's.
        passes: usize = 2, 1.0, 1000.0, "1 to 1000";
        /// Acceleration of an outline point divided by its distance from the target, above 0, at most 1. Default 1/102:
        /// the paper divides by the radius in pixels, 102 for its typical outline.
        attraction: f64 = 1.0 / 102.0, f64::MIN_POSITIVE, 1.0, "above 0, at most 1";
        /// Radius of the outline at the start relative to that of the farthest point, 1 to 2. Default 1.03, the
        /// paper's.
        outline_start: f64 = 1.03, 1.0, 2.0, "1 to 2";
        /// Upper limit of the uniform random heights at the start, in equivalent radii, 0 to 1.
        /// Default 1/102: the paper's one pixel.
        lift: f64 = 1.0 / 102.0, 0.0, 1.0, "0 to 1";
        /// Downward acceleration in equivalent radii, 0 to 1. Default 2e-5 (ours): lets folds settle.
        gravity: f64 = 2e-5, 0.0, 1.0, "0 to 1";
    }
}

numbers! {
    /// Extended position-based dynamics (Macklin, Müller and Chentanez 2016, doi:10.1145/2994258.2994272), one
    /// iteration for each of several substeps. The units are the step, the mass of a vertex, and the equivalent radius.
    XpbdParams {
        /// Substeps in each step, 1 to 1000. Default 3 (ours).
        substeps: usize = 3, 1.0, 1000.0, "1 to 1000";
        /// Fraction of the steps that are made on a coarse mesh, 0 to 1. Default 2/3 (ours). The coarse mesh has half
        /// as many vertices and one substep in each step; it is then refined, and the remaining steps are made on the
        /// full mesh. With 0 there is no coarse mesh: the simulation takes twice as long, the number and size of folds
        /// hardly differ, and within 0.02 equivalent radii of the rim the sheet is 5 to 10 % thicker.
        coarse_fraction: f64 = 2.0 / 3.0, 0.0, 1.0, "0 to 1";
        /// Compliance of the edges in step²/vertex mass, 0 to 1000. Default 4e-5 (ours): almost inextensible.
        stretch_compliance: f64 = 4e-5, 0.0, 1000.0, "0 to 1000";
        /// Compliance of the distances across edges, which resist bending, in step²/vertex mass, 0 to 1000. Default
        /// 1e-3 (ours).
        bend_compliance: f64 = 1e-3, 0.0, 1000.0, "0 to 1000";
        /// Relative compression of a distance across an edge beyond which the resistance is constant, 0 to 1. Default
        /// 0.005 (ours): creases yield, so that few sharp folds form instead of many soft waves. With 1 the sheet is
        /// elastic.
        bend_yield: f64 = 0.005, 0.0, 1.0, "0 to 1";
        /// Fraction of the velocity lost in a step, 0 to 1. Default 0.6 (ours): friction holds the centre in place, so
        /// that folds form near the rim.
        damping: f64 = 0.6, 0.0, 1.0, "0 to 1";
        /// Height of the ceiling in equivalent radii, above 0, at most 10. Default 0.08 (ours).
        ceiling: f64 = 0.08, f64::MIN_POSITIVE, 10.0, "above 0, at most 10";
        /// Downward acceleration in equivalent radii per step², 0 to 1. Default 1e-5 (ours).
        gravity: f64 = 1e-5, 0.0, 1.0, "0 to 1";
        /// Upper limit of the uniform random heights at the start, in equivalent radii, 0 to 1. Default 0.01 (ours).
        lift: f64 = 0.01, 0.0, 1.0, "0 to 1";
    }
}

impl Default for ClothParams {
    fn default() -> ClothParams {
        ClothParams {
            vertices: 1200,
            outline_points: 112,
            area_ratio: 1.15,
            rest_shape: RestShape::Outline,
            steps: 60,
            solver: Solver::Xpbd(XpbdParams::default()),
            smoothing: Smoothing::None,
        }
    }
}

impl ClothParams {
    /// Returns the parameters of the paper, and those of its published program where the text states none.
    #[must_use]
    pub fn paper() -> ClothParams {
        ClothParams {
            vertices: 538,
            outline_points: 75,
            area_ratio: 1.0,
            rest_shape: RestShape::Disc,
            steps: 60,
            solver: Solver::Verlet(VerletParams::default()),
            smoothing: Smoothing::None,
        }
    }

    pub(crate) fn check(&self) -> Result<(), Error> {
        range("vertices", self.vertices as f64, (32.0, 65_536.0), "32 to 65536")?;
        range("outline_points", self.outline_points as f64, (8.0, 65_536.0), "8 to 65536")?;
        check_area_ratio(self.area_ratio)?;
        range("steps", self.steps as f64, (1.0, 100_000.0), "1 to 100000")?;
        match &self.solver {
            Solver::Verlet(p) => p.check(),
            Solver::Xpbd(p) => p.check(),
        }
    }
}

/// Checks the range of an area ratio.
pub(crate) fn check_area_ratio(area_ratio: f64) -> Result<(), Error> {
    range("area_ratio", area_ratio, (1.0, 4.0), "1 to 4")
}

pub(crate) fn range(
    field: &'static str,
    value: f64,
    (low, high): (f64, f64),
    accepted: &'static str,
) -> Result<(), Error> {
    if (low..=high).contains(&value) { Ok(()) } else { Err(Error::Parameter { field, value, accepted }) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn paper_parameters_have_the_values_of_the_paper() {
        let ClothParams { outline_points, steps, rest_shape, smoothing, .. } = ClothParams::paper();
        assert_eq!((outline_points, steps, rest_shape, smoothing), (75, 60, RestShape::Disc, Smoothing::None));
        let VerletParams { damping, dt_squared, passes, outline_start, attraction, lift, .. } = VerletParams::default();
        assert_eq!((damping, dt_squared, passes, outline_start), (0.1, 0.49, 2, 1.03));
        assert_eq!((attraction, lift), (1.0 / 102.0, 1.0 / 102.0));
    }

    #[test]
    fn every_field_is_checked() {
        let bad = f64::NAN;
        let base = ClothParams::default;
        let verlet = |p: VerletParams| ClothParams { solver: Solver::Verlet(p), ..base() };
        let xpbd = |p: XpbdParams| ClothParams { solver: Solver::Xpbd(p), ..base() };
        let (v, x) = (VerletParams::default, XpbdParams::default);
        for (field, params) in [
            ("vertices", ClothParams { vertices: 31, ..base() }),
            ("outline_points", ClothParams { outline_points: 2, ..base() }),
            ("area_ratio", ClothParams { area_ratio: 0.9, ..base() }),
            ("area_ratio", ClothParams { area_ratio: bad, ..base() }),
            ("steps", ClothParams { steps: 0, ..base() }),
            ("dt_squared", verlet(VerletParams { dt_squared: 0.0, ..v() })),
            ("passes", verlet(VerletParams { passes: 1001, ..v() })),
            ("lift", verlet(VerletParams { lift: bad, ..v() })),
            ("gravity", verlet(VerletParams { gravity: f64::INFINITY, ..v() })),
            ("substeps", xpbd(XpbdParams { substeps: 0, ..x() })),
            ("coarse_fraction", xpbd(XpbdParams { coarse_fraction: 1.1, ..x() })),
            ("damping", xpbd(XpbdParams { damping: -0.1, ..x() })),
            ("ceiling", xpbd(XpbdParams { ceiling: 10.1, ..x() })),
        ] {
            let error = params.check().unwrap_err();
            assert!(matches!(error, Error::Parameter { field: found, .. } if found == field), "{error}");
            assert!(error.to_string().starts_with(field));
        }
    }
}
