//! The halo of a koilocyte.

use super::endoplasm::ramp;
use crate::key::Stream;
use crate::phantom::cell_context::CellContext;
use crate::phantom::parametric_shape::perturbed_circle;
use crate::phantom::tile::{Point, Tile, scaled_about};
use crate::random;
use crate::scene::cell::{Halo, stretched};

/// Applies the halo of a koilocyte: the cleared space around the nucleus and the condensed cytoplasm at its edge.
pub(super) fn add_halo(thickness: &mut Tile, nucleus: Point, cell: &CellContext<'_>) {
    let Some(halo) = &cell.body.halo else { return };
    let factors = factors(halo, halo.radius_um / cell.pixel_um(), nucleus, &mut cell.stream("halo"));
    thickness.blend(&factors, |values, factors| {
        values.iter_mut().zip(factors).for_each(|(value, factor)| *value *= factor);
    });
}

/// Returns factors on the thickness of the cell around its nucleus. `radius` is that of the halo, px.
fn factors(halo: &Halo, radius: f64, nucleus: Point, rng: &mut Stream) -> Tile {
    /// Outer radius of the condensed rim, relative to the cleared space.
    const RIM: f64 = 1.35;
    /// Size of the space that is fully cleared, relative to its edge: minimum, maximum.
    const CLEAR: [f64; 2] = [0.55, 0.85];
    /// Length of the cleared space relative to its width: minimum, maximum.
    const LENGTH: [f64; 2] = [1.0, 1.4];
    /// Greatest distance of the centre of the cleared space from that of the nucleus, in radii of the space.
    const OFF_CENTRE: f64 = 0.2;
    let [direction, towards, dense] = [(); 3].map(|()| random::direction(rng));
    let length = random::between(LENGTH[0], LENGTH[1], rng);
    let off = radius * random::between(0.0, OFF_CENTRE, rng);
    let centre = [nucleus[0] + off * libm::cos(towards), nucleus[1] + off * libm::sin(towards)];
    let edge = perturbed_circle(radius, 0.12, 0.10, rng);
    let placed = |p: Point| [p[0] + centre[0], p[1] + centre[1]];
    let edge: Vec<Point> = edge.iter().map(|p| placed(stretched(*p, length, direction))).collect();
    let mut factors = Tile::around(&scaled_about(&edge, centre, RIM), 1.0);
    let clear = ramp(&factors, &edge, centre, random::between(CLEAR[0], CLEAR[1], rng), 1.0);
    let outer = ramp(&factors, &edge, centre, 1.0, RIM);
    // The rim is condensed on one side.
    let slope = [libm::cos(dense), libm::sin(dense)].map(|part| part / (RIM * radius));
    let mut ramps = clear.values.iter().zip(&outer.values);
    factors.for_each(|p, factor| {
        if let Some((clear, outer)) = ramps.next() {
            let side = 1.0 + slope[0] * (p[0] - centre[0]) + slope[1] * (p[1] - centre[1]);
            let rim = (halo.rim * side.clamp(0.0, 2.0)) as f32 * (outer - clear);
            *factor = (1.0 + rim) * (1.0 - halo.clearing as f32 * clear);
        }
    });
    factors
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::key::Key;
    use crate::phantom::tile::tests::at;

    #[test]
    fn a_halo_is_clear_around_the_nucleus_and_condensed_at_its_edge_on_one_side() {
        let halo = Halo { radius_um: 6.0, clearing: 0.5, rim: 0.6 };
        for index in 0..20 {
            let mut rng = Key { seed: 2, index }.stream("test", 0, "halo");
            let mut factors = factors(&halo, 24.0, [40.0, -7.0], &mut rng);
            assert!((at(&factors, [40, -7]) - 0.5).abs() < 1e-6);
            let (mut sums, mut counts) = ([0.0; 8], [0.0; 8]);
            factors.for_each(|p, factor| {
                let angle = libm::atan2(p[1] + 7.0, p[0] - 40.0) + core::f64::consts::PI;
                let sector = ((angle * 8.0 / core::f64::consts::TAU) as usize).min(7);
                sums[sector] += f64::from((*factor - 1.0).max(0.0));
                counts[sector] += f64::from(u8::from(*factor > 1.0));
                assert!((0.49..2.3).contains(factor), "{p:?} {factor}");
            });
            let half = |first: usize| (0..4).map(|k| sums[(first + k) % 8]).sum::<f64>();
            let densest = (0..8).map(half).fold(0.0, f64::max);
            assert!(densest > 0.6 * sums.iter().sum::<f64>(), "{sums:?}");
            assert!(counts.iter().sum::<f64>() > 300.0, "{counts:?}");
        }
    }
}
