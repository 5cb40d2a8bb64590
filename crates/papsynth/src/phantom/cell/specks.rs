//! Granules and specks of cytoplasm: dark dots and short rods. Each adds the thickness of cytoplasm that absorbs as
//! much.

use portable_numerics::elementary::exp_f32;
use portable_numerics::rounding::round_to_count;

use crate::key::Stream;
use crate::phantom::cell_context::CellContext;
use crate::phantom::tile::{Point, Tile};
use crate::random;

/// Standard deviation of the absorbance profile of a granule or speck, µm.
const GRANULE_UM: f64 = 0.28;

/// Absorbance of a granule relative to the flat sheet.
const GRANULE: f64 = 0.55;

/// Adds keratohyalin granules: small dark dots throughout the cell.
pub(super) fn add_granules(thickness: &mut Tile, per_100_um2: f64, pixel_um: f64, rng: &mut Stream) {
    for _ in 0..count_in_box(thickness, per_100_um2, pixel_um, rng) {
        let at = [thickness.width, thickness.height()].map(|side| random::between(0.0, side as f64, rng));
        let sigma = GRANULE_UM / pixel_um * random::between(0.6, 1.3, rng);
        Rod { ends: [at; 2], sigma, strength: GRANULE * random::between(0.3, 1.5, rng) }.draw(thickness);
    }
}

/// Fraction of specks that lie near the previous one, and the standard deviation of their distance in x and y, µm.
const GROUPED: f64 = 0.85;
const GROUP_UM: f64 = 3.0;

/// Fraction of specks that are rods, and their length, µm: minimum, maximum.
const RODS: f64 = 0.6;
const ROD_UM: [f64; 2] = [0.5, 2.5];

/// Mean absorbance of a speck relative to the flat sheet, and the maximum.
const SPECK: [f64; 2] = [0.32, 1.3];

/// Adds specks: dark dots and short rods, in groups. The rods of a cell have similar directions.
pub(super) fn add_specks(thickness: &mut Tile, cell: &CellContext<'_>) {
    /// Standard deviation of the directions, radians.
    const SPREAD: f64 = 0.7;
    let (pixel_um, rng) = (cell.pixel_um(), &mut cell.stream("specks"));
    let direction = random::direction(rng);
    let sides = [thickness.width, thickness.height()];
    let mut at = [0.0; 2];
    for index in 0..count_in_box(thickness, cell.body.detail.specks, pixel_um, rng) {
        at = match index > 0 && random::chance(GROUPED, rng) {
            true => at.map(|x| x + GROUP_UM / pixel_um * random::normal(rng)),
            false => sides.map(|side| random::between(0.0, side as f64, rng)),
        };
        let length =
            if random::chance(RODS, rng) { random::between(ROD_UM[0], ROD_UM[1], rng) / pixel_um } else { 0.0 };
        let angle = direction + SPREAD * random::normal(rng);
        let half = [0.5 * length * libm::cos(angle), 0.5 * length * libm::sin(angle)];
        let ends = [[at[0] - half[0], at[1] - half[1]], [at[0] + half[0], at[1] + half[1]]];
        let sigma = GRANULE_UM / pixel_um * random::between(0.6, 1.3, rng);
        let strength = (-SPECK[0] * libm::log(1.0 - random::uniform(rng))).min(SPECK[1]);
        Rod { ends, sigma, strength }.draw(thickness);
    }
}

/// Draws how many objects lie in the bounding box of a cell, so that the expected number inside the cell is right.
fn count_in_box(like: &Tile, per_100_um2: f64, pixel_um: f64, rng: &mut Stream) -> usize {
    if per_100_um2 <= 0.0 {
        return 0;
    }
    let expected = per_100_um2 * (like.width * like.height()) as f64 * pixel_um * pixel_um / 100.0;
    round_to_count(expected + random::uniform(rng) - 0.5)
}

/// A dark rod: a segment with a normal profile around it.
struct Rod {
    /// Ends, px in the tile.
    ends: [Point; 2],
    /// Standard deviation of the profile, px.
    sigma: f64,
    /// Absorbance on the segment relative to the flat sheet.
    strength: f64,
}

impl Rod {
    fn draw(&self, thickness: &mut Tile) {
        let [from, to] = self.ends;
        let along = [to[0] - from[0], to[1] - from[1]];
        let square = (along[0] * along[0] + along[1] * along[1]).max(1e-12);
        let reach = 3.0 * self.sigma;
        let sides = [thickness.width, thickness.height()];
        let [columns, rows] = [0, 1].map(|axis| {
            let whole = |at: f64| at.clamp(0.0, sides[axis] as f64) as usize;
            whole((from[axis].min(to[axis]) - reach).ceil())..whole(from[axis].max(to[axis]) + reach + 1.0)
        });
        for y in rows {
            let row = &mut thickness.values[y * sides[0]..][columns.clone()];
            for (value, x) in row.iter_mut().zip(columns.clone()) {
                let off = [x as f64 - from[0], y as f64 - from[1]];
                let t = ((off[0] * along[0] + off[1] * along[1]) / square).clamp(0.0, 1.0);
                let [dx, dy] = [off[0] - t * along[0], off[1] - t * along[1]];
                let exponent = -(dx * dx + dy * dy) / (2.0 * self.sigma * self.sigma);
                *value += self.strength as f32 * exp_f32(exponent as f32);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::key::Key;

    #[test]
    fn a_rod_falls_with_the_distance_from_its_segment_and_is_cut_at_the_tile() {
        let blank = || Tile { origin: [0, 0], width: 30, values: vec![0.0; 30 * 20] };
        for ends in [[[8.3, 6.1], [17.9, 11.4]], [[12.0, 9.0], [12.0, 9.0]], [[-2.0, 3.0], [4.0, 25.0]]] {
            let mut tile = blank();
            Rod { ends, sigma: 1.5, strength: 0.6 }.draw(&mut tile);
            tile.for_each(|p, found| {
                // The smallest distance to many points of the segment.
                let square = |k: u16| {
                    let t = f64::from(k) / 2000.0;
                    let [dx, dy] = [0, 1].map(|axis| p[axis] - ends[0][axis] - t * (ends[1][axis] - ends[0][axis]));
                    dx * dx + dy * dy
                };
                let nearest = (0..=2000).map(square).fold(f64::INFINITY, f64::min);
                let expected = if nearest > 20.25 { 0.0 } else { 0.6 * libm::exp(-nearest / 4.5) };
                // Beyond three standard deviations, a pixel may be in the box of the rod or not.
                assert!((f64::from(*found) - expected).abs() < 0.007, "{p:?}: {found} {expected}");
            });
        }
        let mut outside = blank();
        Rod { ends: [[50.0, 5.0], [60.0, -40.0]], sigma: 1.5, strength: 0.6 }.draw(&mut outside);
        assert_eq!(outside, blank());
    }

    #[test]
    fn the_number_of_specks_is_that_per_area() {
        let tile = Tile { origin: [0, 0], width: 50, values: vec![0.0; 50 * 40] };
        let rng = &mut Key { seed: 1, index: 0 }.stream("test", 0, "specks");
        // A tile of 125 µm².
        let total: usize = (0..4000).map(|_| count_in_box(&tile, 2.1, 0.25, rng)).sum();
        assert!((total as f64 / 4000.0 - 2.625).abs() < 0.05, "{total}");
        assert_eq!(count_in_box(&tile, 0.0, 0.25, rng), 0);
    }
}
