//! From a layout to a weight map, and from that to places that keep their distance.

use rand_core::Rng;

use crate::error::Cause;
use crate::random;
use crate::recipe::section::named;
use crate::recipe::{Labels, Layout};

use super::view::{FieldNumbers, View};
use super::weight::{Sampler, WeightMap};

/// Size of a pixel of a weight map, µm: far below the size of a cell.
const PITCH_UM: f64 = 4.0;

/// Largest number of pixels along a side of a weight map, for huge fields.
const MOST_PIXELS: usize = 2048;

/// Most tries that a whole field may be expected to take.
const MOST_TRIES: f64 = 1e9;

/// Share of a plane that discs cover when no further one fits, if each was placed at random:
/// random sequential adsorption jams at 0.547 (Feder 1980, doi:10.1016/0022-5193(80)90358-6).
const JAMMED: f64 = 0.547;

pub(super) fn weight_map(
    layout: &Layout,
    given: Option<&WeightMap>,
    view: View,
    field: &FieldNumbers,
) -> Result<WeightMap, Cause> {
    let [width_um, height_um] = view.size_um();
    let pixels = |length: f64| random::count((length / PITCH_UM).ceil()).clamp(1, MOST_PIXELS);
    let (width, height) = (pixels(width_um), pixels(height_um));
    let place = move |[x, y]: [f64; 2]| [x * width_um, y * height_um];
    match layout {
        Layout::Uniform {} => Ok(WeightMap { width: 1, weights: vec![1.0] }),
        Layout::Clusters(layout) => {
            let count = field.count(named!("layout", layout.count)).max(1);
            let outside = field.draw(named!("layout", layout.outside));
            let clusters: Vec<[f64; 3]> = (0..count as u64)
                .map(|cluster| {
                    let mut rng = field.key.stream("field", cluster, "layout.cluster");
                    let radius = layout.radius_um.draw(&mut rng);
                    [random::between(0.0, width_um, &mut rng), random::between(0.0, height_um, &mut rng), radius]
                })
                .collect();
            let distances = nearest_of(&clusters, [width, height], [width_um, height_um]);
            let weight = |square: &f64| (outside + (1.0 - outside) * libm::exp(-0.5 * square)) as f32;
            Ok(WeightMap { width, weights: distances.iter().map(weight).collect() })
        }
        Layout::Swath(layout) => {
            let band = field.draw(named!("layout", layout.width_um));
            let outside = field.draw(named!("layout", layout.outside));
            let mut rng = field.key.stream("field", 0, "layout.swath");
            let angle = random::direction(&mut rng);
            let (nx, ny) = (libm::cos(angle), libm::sin(angle));
            let through = place([random::between(0.25, 0.75, &mut rng), random::between(0.25, 0.75, &mut rng)]);
            Ok(WeightMap::from_fn(width, height, |at| {
                let [x, y] = place(at);
                let distance = ((x - through[0]) * nx + (y - through[1]) * ny) / band;
                outside + (1.0 - outside) * libm::exp(-0.5 * distance * distance)
            }))
        }
        Layout::Map { path } => given.cloned().ok_or_else(|| not_given(path, "an image")),
        Layout::Labels(layout) => {
            let map = given.ok_or_else(|| not_given(&layout.path, "a label image"))?;
            let smooth = field.draw(named!("layout", layout.smooth_um));
            smoothed(map, smooth * map.width as f64 / width_um)
        }
    }
}

/// The square of the distance of each pixel's middle to the nearest of some clusters, in radii of the cluster; infinite far from all.
///
/// Each cluster is looked at only round itself, so that the time grows with the field and not with its square.
fn nearest_of(clusters: &[[f64; 3]], [width, height]: [usize; 2], size_um: [f64; 2]) -> Vec<f64> {
    /// How many radii from its middle a cluster ends: with 10⁻⁸ of its weight.
    const REACH: f64 = 6.0;
    let mut nearest = vec![f64::INFINITY; width * height];
    for [x, y, radius] in clusters {
        // From a pixel to a distance from the cluster, and to pixels within reach.
        let along = |middle: f64, pixels: usize, length: f64| {
            let pitch = length / pixels as f64;
            let pixel = |at: f64| random::count((at / pitch).clamp(0.0, pixels as f64));
            let within = pixel(middle - REACH * radius)..pixel(middle + REACH * radius);
            let place = move |pixel: usize| ((pixel as f64 + 0.5) / pixels as f64 * length - middle) / radius;
            (within, place)
        };
        let (columns, across) = along(*x, width, size_um[0]);
        let (rows, down) = along(*y, height, size_um[1]);
        let squares: Vec<f64> = columns.clone().map(|x| across(x) * across(x)).collect();
        for row in rows {
            let dy = down(row) * down(row);
            let line = &mut nearest[row * width..][columns.clone()];
            line.iter_mut().zip(&squares).for_each(|(least, dx)| *least = least.min(dx + dy));
        }
    }
    nearest
}

/// What is wrong with what a layout names, before anything is drawn.
pub(crate) fn check_layout(layout: &Layout, given: Option<&WeightMap>) -> Result<(), Cause> {
    let (Layout::Map { path } | Layout::Labels(Labels { path, .. })) = layout else { return Ok(()) };
    let map = given.ok_or_else(|| not_given(path, "an image"))?;
    map.sampler().map(|_| ()).map_err(|cause| Cause::Map { path: path.clone(), cause: Box::new(cause) })
}

fn not_given(path: &str, what: &'static str) -> Cause {
    Cause::NotGiven { path: path.to_owned(), what }
}

/// A map blurred by a Gaussian, since a cell's middle may lie beside a given label.
fn smoothed(map: &WeightMap, sigma_px: f64) -> Result<WeightMap, Cause> {
    map.sampler()?;
    let kernel = optics_psf::Gaussian::new(sigma_px).map_err(Cause::Smoothing)?;
    Ok(WeightMap { width: map.width, weights: kernel.blur(&map.weights, map.width, optics_psf::Border::Reflect) })
}

/// Places cells one after the other, none nearer to another than a given distance.
pub(super) struct Places {
    sampler: Sampler,
    size_um: [f64; 2],
    spacing_um: f64,
    taken: Vec<[f64; 2]>,
    /// Indices of `taken` by square of the field, squares as wide as the spacing.
    squares: std::collections::BTreeMap<(i64, i64), Vec<usize>>,
}

impl Places {
    /// Prepares to place `count` cells, or says why they will not fit: before the search starts.
    pub(super) fn new(map: &WeightMap, count: usize, spacing_um: f64, view: View) -> Result<Self, Cause> {
        let sampler = map.sampler()?;
        let size_um = view.size_um();
        let area = size_um[0] * size_um[1] * sampler.possible_share();
        let disc = core::f64::consts::FRAC_PI_4 * spacing_um * spacing_um;
        // A cell at the edge of what is possible takes only part of its disc from it.
        let margin = 1.0 + spacing_um / area.sqrt();
        let room = JAMMED * area * margin * margin / disc;
        if count > 1 && disc > 0.0 && count as f64 > room {
            return Err(Cause::NoRoom { count, spacing_um, area_um2: area, room });
        }
        let tries = sampler.expected_tries() * count as f64;
        if tries > MOST_TRIES {
            return Err(Cause::TooUneven { count, tries, most: MOST_TRIES });
        }
        Ok(Self { sampler, size_um, spacing_um, taken: Vec::new(), squares: std::collections::BTreeMap::new() })
    }

    /// The next place, µm.
    pub(super) fn next<R: Rng + ?Sized>(&mut self, rng: &mut R) -> Result<[f64; 2], Cause> {
        /// Accepted candidates that may turn out too near to others before the search is given up.
        const CROWDED: usize = 20_000;
        let mut crowded = 0;
        while crowded < CROWDED {
            let Some([x, y]) = self.sampler.try_place(rng) else { continue };
            let place = [x * self.size_um[0], y * self.size_um[1]];
            if self.is_free(place) {
                let square = self.square(place);
                self.squares.entry(square).or_default().push(self.taken.len());
                self.taken.push(place);
                return Ok(place);
            }
            crowded += 1;
        }
        Err(Cause::Crowded { placed: self.taken.len(), spacing_um: self.spacing_um })
    }

    fn square(&self, place: [f64; 2]) -> (i64, i64) {
        #[expect(clippy::cast_possible_truncation, reason = "a field is far smaller than 2⁶³ squares")]
        let cell = |value: f64| (value / self.spacing_um.max(1.0)).floor() as i64;
        (cell(place[0]), cell(place[1]))
    }

    fn is_free(&self, place: [f64; 2]) -> bool {
        let (column, row) = self.square(place);
        for x in column - 1..=column + 1 {
            for y in row - 1..=row + 1 {
                for &other in self.squares.get(&(x, y)).map_or(&[][..], Vec::as_slice) {
                    let (dx, dy) = (self.taken[other][0] - place[0], self.taken[other][1] - place[1]);
                    if dx * dx + dy * dy < self.spacing_um * self.spacing_um {
                        return false;
                    }
                }
            }
        }
        true
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn clusters_weigh_what_the_nearest_does() {
        let clusters = [[100.0, 40.0, 30.0], [300.0, 200.0, 12.0], [-20.0, 260.0, 25.0], [390.0, 90.0, 60.0]];
        let (size, size_um) = ([101, 77], [404.0, 308.0]);
        let found = nearest_of(&clusters, size, size_um);
        for (index, found) in found.iter().enumerate() {
            let at = [index % size[0], index / size[0]];
            let [x, y] = [0, 1].map(|axis| (at[axis] as f64 + 0.5) / size[axis] as f64 * size_um[axis]);
            let weight = |square: f64| libm::exp(-0.5 * square);
            let wanted = clusters.iter().fold(0.0_f64, |most, [cx, cy, radius]| {
                let (dx, dy) = ((x - cx) / radius, (y - cy) / radius);
                most.max(weight(dx * dx + dy * dy))
            });
            assert!((weight(*found) - wanted).abs() < 2e-8, "{at:?}");
        }
    }
}
