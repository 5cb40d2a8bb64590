//! The halo of a koilocyte.

use super::detail::ramp;
use crate::phantom::cell_context::CellContext;
use crate::phantom::parametric_shape::perturbed_circle;
use crate::phantom::tile::{Point, Tile, scaled_about};
use crate::random;
use crate::scene::cell::stretched;

/// Applies the halo of a koilocyte: the cleared space around the nucleus and the condensed cytoplasm at its edge.
pub(super) fn add_halo(absorbance: &mut Tile, nucleus: Point, cell: &CellContext<'_>) {
    /// Outer radius of the condensed rim, relative to the cleared space.
    const RIM: f64 = 1.35;
    /// Size of the space that is fully cleared, relative to its edge: minimum, maximum.
    const CLEAR: [f64; 2] = [0.55, 0.85];
    /// Length of the cleared space relative to its width: minimum, maximum.
    const LENGTH: [f64; 2] = [1.0, 1.6];
    /// Greatest distance of its centre from that of the nucleus, in radii.
    const OFF_CENTRE: f64 = 0.3;
    let Some(halo) = cell.body.halo else { return };
    let (radius, rng) = (halo.radius_um / cell.pixel_um(), &mut cell.stream("halo"));
    let [direction, towards, dense] = [(); 3].map(|()| random::direction(rng));
    let length = random::between(LENGTH[0], LENGTH[1], rng);
    let off = radius * random::between(0.0, OFF_CENTRE, rng);
    let centre = [nucleus[0] + off * libm::cos(towards), nucleus[1] + off * libm::sin(towards)];
    let edge = perturbed_circle(radius, 0.12, 0.10, rng);
    let placed = |p: Point| [p[0] + centre[0], p[1] + centre[1]];
    let edge: Vec<Point> = edge.iter().map(|p| placed(stretched(*p, length, direction))).collect();
    let near = Tile::around(&scaled_about(&edge, centre, RIM), 1.0);
    let clear = ramp(&near, &edge, centre, random::between(CLEAR[0], CLEAR[1], rng), 1.0);
    let mut factor = ramp(&near, &edge, centre, 1.0, RIM);
    // The rim is condensed on one side.
    let slope = [libm::cos(dense), libm::sin(dense)].map(|part| part / (RIM * radius));
    let mut clear = clear.values.iter();
    factor.for_each(|p, factor| {
        let clear = clear.next().copied().unwrap_or(0.0);
        let side = 1.0 + slope[0] * (p[0] - centre[0]) + slope[1] * (p[1] - centre[1]);
        let rim = (halo.rim * side.clamp(0.0, 2.0)) as f32 * (*factor - clear);
        *factor = (1.0 + rim) * (1.0 - halo.clearing as f32 * clear);
    });
    absorbance.blend(&factor, |values, factors| {
        values.iter_mut().zip(factors).for_each(|(value, factor)| *value *= factor);
    });
}
