//! What can be chosen, and what is chosen unless told otherwise.

use crate::Error;

/// The mesh, the excess of sheet over outline, and the way it is pressed.
#[derive(Debug, Clone, PartialEq)]
pub struct ClothParams {
    /// Vertices of the circular mesh, 32 to 65 536. Default 1200 (ours): folds as thin as
    /// real ones. The paper's program has 75 on the rim, 538 in all.
    pub vertices: usize,
    /// Points into which the outline is divided while it shrinks, 8 to 65 536. Default 112 (ours): as many as
    /// there are vertices on the rim of the default mesh. The paper: 75.
    /// With [`Solver::Xpbd`] the rim follows the outline point by point and its own number of vertices is used.
    pub outline_points: usize,
    /// Area of the flat sheet over that of the outline, 1 to 4, unless a [`Job`](crate::Job) has its own. Default 1.15 (ours).
    /// With [`Rest::Disc`] a least value: the disc may need to be larger.
    pub excess: f64,
    /// What the sheet is cut from.
    pub rest: Rest,
    /// Steps in which the outline shrinks, 1 to 100 000. Default 60, the paper's.
    pub steps: usize,
    /// How the sheet moves.
    pub solver: Solver,
    /// What is done to the pressed mesh.
    pub smoothing: Smoothing,
}

/// What the sheet is before it is pressed.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Rest {
    /// A disc round the outline's farthest point (the paper's).
    Disc,
    /// The outline's own shape, grown outwards here and there by the excess (ours, the default).
    Outline,
}

/// What is done to the pressed mesh.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Smoothing {
    /// Nothing: the paper's, and the default. Pictures have no facets all the same.
    None,
    /// One step of Loop's subdivision: four times the triangles and rounder, softer folds (ours), for pixels
    /// much smaller than the mesh.
    Loop,
}

/// How the sheet moves.
#[derive(Debug, Clone, PartialEq)]
pub enum Solver {
    /// The paper's way.
    Verlet(VerletParams),
    /// Extended position-based dynamics in small steps, with bending and a ceiling: the default.
    Xpbd(XpbdParams),
}

/// Verlet integration of every vertex (Eq. 4), with distances restored by projection.
#[derive(Debug, Clone, PartialEq)]
pub struct VerletParams {
    /// Part of the velocity lost in a step, 0 to 1. Default .1, the paper's; 0 is Eq. 4 itself.
    pub damping: f64,
    /// Δt² of Eq. 4, above 0, at most 1. Default .49, the paper's.
    pub dt_squared: f64,
    /// Passes over all distances in a step, 1 to 1000. Default 2, the paper's.
    pub passes: usize,
    /// Acceleration of an outline point per distance from its target, above 0, at most 1. Default 1/102: the paper divides by the
    /// radius in pixels, 102 for its typical outline.
    pub attraction: f64,
    /// Radius of the outline at the start over that of the farthest point, 1 to 2. Default 1.03, the paper's.
    pub outline_start: f64,
    /// Heights at the start are even random numbers from 0 to this, in equivalent radii, 0 to 1.
    /// Default 1/102: the paper's one pixel.
    pub lift: f64,
    /// Downward acceleration in equivalent radii, 0 to 1. Default 2e-5 (ours): keeps folds from floating.
    pub gravity: f64,
}

/// Extended position-based dynamics (Macklin, Müller and Chentanez 2016, doi:10.1145/2994258.2994272), one
/// iteration for each of several substeps. Time is counted in steps, mass in vertices, length in equivalent radii.
#[derive(Debug, Clone, PartialEq)]
pub struct XpbdParams {
    /// Substeps of a step, 1 to 1000. Default 3 (ours).
    pub substeps: usize,
    /// Compliance of the edges in step²/vertex mass, 0 to 1000. Default 4e-5 (ours): next to inextensible.
    pub stretch_compliance: f64,
    /// Compliance of the distances across edges, which resist bending, 0 to 1000. Default 1e-3 (ours).
    pub bend_compliance: f64,
    /// Relative shortening of such a distance beyond which the resistance grows no more, 0 to 1. Default .005 (ours). A crease gives
    /// way there, so that excess gathers in few sharp folds instead of many soft waves; 1 keeps the sheet elastic.
    pub bend_yield: f64,
    /// Part of the velocity lost in a step, 0 to 1. Default .6 (ours): friction that keeps the middle in place, so that folds
    /// arise near the rim.
    pub damping: f64,
    /// Height of the ceiling in equivalent radii, above 0, at most 10. Default .08 (ours).
    pub ceiling: f64,
    /// Downward acceleration in equivalent radii per step², 0 to 1. Default 1e-5 (ours).
    pub gravity: f64,
    /// Heights at the start are even random numbers from 0 to this, in equivalent radii, 0 to 1. Default .01 (ours).
    pub lift: f64,
}

impl Default for ClothParams {
    fn default() -> ClothParams {
        ClothParams {
            vertices: 1200,
            outline_points: 112,
            excess: 1.15,
            rest: Rest::Outline,
            steps: 60,
            solver: Solver::Xpbd(XpbdParams::default()),
            smoothing: Smoothing::None,
        }
    }
}

impl ClothParams {
    /// The paper's way, with the numbers of its published program where the text gives none.
    #[must_use]
    pub fn paper() -> ClothParams {
        ClothParams {
            vertices: 538,
            outline_points: 75,
            excess: 1.0,
            rest: Rest::Disc,
            steps: 60,
            solver: Solver::Verlet(VerletParams::default()),
            smoothing: Smoothing::None,
        }
    }
}

impl Default for VerletParams {
    fn default() -> VerletParams {
        VerletParams {
            damping: 0.1,
            dt_squared: 0.49,
            passes: 2,
            attraction: 1.0 / 102.0,
            outline_start: 1.03,
            lift: 1.0 / 102.0,
            gravity: 2e-5,
        }
    }
}

impl Default for XpbdParams {
    fn default() -> XpbdParams {
        XpbdParams {
            substeps: 3,
            stretch_compliance: 4e-5,
            bend_compliance: 1e-3,
            bend_yield: 0.005,
            damping: 0.6,
            ceiling: 0.08,
            gravity: 1e-5,
            lift: 0.01,
        }
    }
}

impl ClothParams {
    pub(crate) fn check(&self) -> Result<(), Error> {
        range("vertices", self.vertices as f64, (32.0, 65_536.0), "32 to 65536")?;
        range("outline_points", self.outline_points as f64, (8.0, 65_536.0), "8 to 65536")?;
        check_excess(self.excess)?;
        range("steps", self.steps as f64, (1.0, 100_000.0), "1 to 100000")?;
        match &self.solver {
            Solver::Verlet(p) => {
                range("damping", p.damping, (0.0, 1.0), "0 to 1")?;
                range("dt_squared", p.dt_squared, (f64::MIN_POSITIVE, 1.0), "above 0, at most 1")?;
                range("passes", p.passes as f64, (1.0, 1000.0), "1 to 1000")?;
                range("attraction", p.attraction, (f64::MIN_POSITIVE, 1.0), "above 0, at most 1")?;
                range("outline_start", p.outline_start, (1.0, 2.0), "1 to 2")?;
                range("lift", p.lift, (0.0, 1.0), "0 to 1")?;
                range("gravity", p.gravity, (0.0, 1.0), "0 to 1")
            }
            Solver::Xpbd(p) => {
                range("substeps", p.substeps as f64, (1.0, 1000.0), "1 to 1000")?;
                range("stretch_compliance", p.stretch_compliance, (0.0, 1000.0), "0 to 1000")?;
                range("bend_compliance", p.bend_compliance, (0.0, 1000.0), "0 to 1000")?;
                range("bend_yield", p.bend_yield, (0.0, 1.0), "0 to 1")?;
                range("damping", p.damping, (0.0, 1.0), "0 to 1")?;
                range("ceiling", p.ceiling, (f64::MIN_POSITIVE, 10.0), "above 0, at most 10")?;
                range("gravity", p.gravity, (0.0, 1.0), "0 to 1")?;
                range("lift", p.lift, (0.0, 1.0), "0 to 1")
            }
        }
    }
}

/// Whether a sheet may be so large.
pub(crate) fn check_excess(excess: f64) -> Result<(), Error> {
    range("excess", excess, (1.0, 4.0), "1 to 4")
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
    fn the_papers_defaults() {
        let params = ClothParams::paper();
        assert_eq!(
            (params.outline_points, params.steps, params.rest, params.smoothing),
            (75, 60, Rest::Disc, Smoothing::None)
        );
        let Solver::Verlet(verlet) = params.solver else { panic!("not the paper's solver") };
        assert_eq!((verlet.damping, verlet.dt_squared, verlet.passes, verlet.outline_start), (0.1, 0.49, 2, 1.03));
        assert_eq!((verlet.attraction, verlet.lift), (1.0 / 102.0, 1.0 / 102.0));
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
            ("excess", ClothParams { excess: 0.9, ..base() }),
            ("excess", ClothParams { excess: bad, ..base() }),
            ("steps", ClothParams { steps: 0, ..base() }),
            ("damping", verlet(VerletParams { damping: 1.1, ..v() })),
            ("dt_squared", verlet(VerletParams { dt_squared: 0.0, ..v() })),
            ("passes", verlet(VerletParams { passes: 0, ..v() })),
            ("attraction", verlet(VerletParams { attraction: -1.0, ..v() })),
            ("outline_start", verlet(VerletParams { outline_start: 0.5, ..v() })),
            ("lift", verlet(VerletParams { lift: bad, ..v() })),
            ("gravity", verlet(VerletParams { gravity: f64::INFINITY, ..v() })),
            ("substeps", xpbd(XpbdParams { substeps: 0, ..x() })),
            ("stretch_compliance", xpbd(XpbdParams { stretch_compliance: -1.0, ..x() })),
            ("bend_compliance", xpbd(XpbdParams { bend_compliance: bad, ..x() })),
            ("bend_yield", xpbd(XpbdParams { bend_yield: 2.0, ..x() })),
            ("damping", xpbd(XpbdParams { damping: -0.1, ..x() })),
            ("ceiling", xpbd(XpbdParams { ceiling: 0.0, ..x() })),
            ("gravity", xpbd(XpbdParams { gravity: -1.0, ..x() })),
            ("lift", xpbd(XpbdParams { lift: 1.1, ..x() })),
        ] {
            let error = params.check().unwrap_err();
            assert!(matches!(error, Error::Parameter { field: found, .. } if found == field), "{error}");
            assert!(error.to_string().starts_with(field));
        }
    }
}
