//! Draws the weight map of a layout, and places cells with a minimum distance.

use portable_numerics::rounding::round_to_count;
use rand_core::Rng;

use crate::error::ErrorKind;
use crate::random;
use crate::recipe::section::named;
use crate::recipe::{Clusters, Labels, Layout};

use super::view::{FieldNumbers, Region, View};
use super::weight::{Sampler, WeightMap};

/// Pixel size of a weight map, µm: far below the size of a cell.
const PITCH_UM: f64 = 4.0;

/// Largest number of pixels along a side of a weight map.
const MOST_PIXELS: usize = 2048;

/// Width of the margin of a field, µm: about the largest radius of common cells.
pub(crate) const MARGIN_UM: f64 = 60.0;

/// Largest accepted number of expected tries for a field.
const MOST_TRIES: f64 = 1e9;

/// Fraction of a plane that randomly placed discs cover when no further disc fits:
/// random sequential adsorption jams at 0.547 (Feder 1980, doi:10.1016/0022-5193(80)90358-6).
const JAMMED: f64 = 0.547;

/// Weights of the places of a field, and of a margin around it.
///
/// Objects whose number is a density (`per_mm2`) are also placed in the margin. Then the mean coverage at the border of
/// the image is the same as at its centre.
pub(super) struct Weights {
    /// The field.
    pub(super) field: Region,
    /// The field and its margin.
    pub(super) region: Region,
    of_field: WeightMap,
    of_region: WeightMap,
    /// Area that a density is multiplied by, mm².
    pub(super) populated_mm2: f64,
}

/// Draws the weights of a field.
pub(super) fn weights(
    layout: &Layout,
    given: Option<&WeightMap>,
    view: View,
    numbers: &FieldNumbers,
) -> Result<Weights, ErrorKind> {
    let field = Region::of(view);
    let pixels = field.size_um.map(|length| round_to_count((length / PITCH_UM).ceil()).clamp(1, MOST_PIXELS));
    let pitch_um = [0, 1].map(|axis| field.size_um[axis] / pixels[axis] as f64);
    let margin_px = pitch_um.map(|pitch| round_to_count((MARGIN_UM / pitch).ceil()));
    let region = field.with_margin([0, 1].map(|axis| margin_px[axis] as f64 * pitch_um[axis]));
    let size = [0, 1].map(|axis| pixels[axis] + 2 * margin_px[axis]);
    // A given map has no margin.
    let of_map = |map: WeightMap| {
        let (of_field, of_region, populated_mm2) = (map.clone(), map, field.area_mm2());
        Weights { field, region: field, of_field, of_region, populated_mm2 }
    };
    let (of_region, is_stationary) = match layout {
        Layout::Uniform {} => {
            let even = WeightMap { width: 1, weights: vec![1.0] };
            return Ok(Weights {
                field,
                region,
                of_field: even.clone(),
                of_region: even,
                populated_mm2: region.area_mm2(),
            });
        }
        Layout::Clusters(layout) => (cluster_map(layout, field, region, size, numbers), layout.count.is_density()),
        Layout::Band(layout) => {
            let band = numbers.draw(named!("layout", layout.width_um));
            let outside = numbers.draw(named!("layout", layout.outside));
            let mut rng = numbers.key.stream("field", 0, "layout.band");
            let angle = random::direction(&mut rng);
            let (nx, ny) = (libm::cos(angle), libm::sin(angle));
            let through = field.at([random::between(0.25, 0.75, &mut rng), random::between(0.25, 0.75, &mut rng)]);
            let map = WeightMap::from_fn(size[0], size[1], |at| {
                let [x, y] = region.at(at);
                let distance = ((x - through[0]) * nx + (y - through[1]) * ny) / band;
                outside + (1.0 - outside) * libm::exp(-0.5 * distance * distance)
            });
            (map, false)
        }
        Layout::DensityMap { path } => return given.cloned().ok_or_else(|| not_given(path, "an image")).map(of_map),
        Layout::Labels(layout) => {
            let map = given.ok_or_else(|| not_given(&layout.path, "a label image"))?;
            let smooth = numbers.draw(named!("layout", layout.smooth_um));
            return smoothed(map, smooth * map.width as f64 / field.size_um[0]).map(of_map);
        }
    };
    let of_field = cropped(&of_region, margin_px, pixels);
    let sum = |map: &WeightMap| map.weights.iter().map(|w| f64::from(*w)).sum::<f64>();
    let populated_mm2 = if is_stationary {
        region.area_mm2()
    } else {
        // Makes the mean density in the field that of the recipe.
        field.area_mm2() * sum(&of_region) / sum(&of_field).max(f64::MIN_POSITIVE)
    };
    Ok(Weights { field, region, of_field, of_region, populated_mm2 })
}

/// Draws the weights of round clusters. Clusters of a density also have centres beyond the margin.
fn cluster_map(
    layout: &Clusters,
    field: Region,
    region: Region,
    [width, height]: [usize; 2],
    numbers: &FieldNumbers,
) -> WeightMap {
    /// Distance beyond the margin up to which clusters have centres, in largest radii.
    const RADII: f64 = 2.0;
    /// Largest distance beyond the margin at which clusters have centres, µm.
    const FARTHEST_UM: f64 = 500.0;
    let area = if layout.count.is_density() {
        region.with_margin([(RADII * layout.radius_um.bounds()[1]).min(FARTHEST_UM); 2])
    } else {
        field
    };
    let count = numbers.number_of(named!("layout", layout.count), area.area_mm2());
    let outside = numbers.draw(named!("layout", layout.outside));
    let clusters: Vec<[f64; 3]> = (0..count)
        .map(|cluster| {
            let mut rng = numbers.key.stream("field", cluster, "layout.cluster");
            let radius = layout.radius_um.draw(&mut rng);
            let [x, y] = area.at([random::uniform(&mut rng), random::uniform(&mut rng)]);
            [x - region.low_um[0], y - region.low_um[1], radius]
        })
        .collect();
    let distances = nearest_of(&clusters, [width, height], region.size_um);
    let is_empty = distances.iter().all(|square| square.is_infinite());
    // Without a cluster in reach, all places have the same weight.
    let outside = if is_empty { 1.0 } else { outside };
    let weight = |square: &f64| (outside + (1.0 - outside) * libm::exp(-0.5 * square)) as f32;
    WeightMap { width, weights: distances.iter().map(weight).collect() }
}

/// Returns the part of a map that starts at a column and a row. If all its weights are zero, returns a uniform map.
fn cropped(map: &WeightMap, first: [usize; 2], size: [usize; 2]) -> WeightMap {
    let rows = map.weights.chunks_exact(map.width).skip(first[1]).take(size[1]);
    let weights: Vec<f32> = rows.flat_map(|row| &row[first[0]..first[0] + size[0]]).copied().collect();
    if weights.iter().all(|weight| *weight <= 0.0) {
        return WeightMap { width: 1, weights: vec![1.0] };
    }
    WeightMap { width: size[0], weights }
}

/// Returns the squared distance of the centre of each pixel to the nearest cluster, in radii of the cluster; infinite
/// far from all.
///
/// Each cluster changes only the pixels around it, so that the time is proportional to the area.
fn nearest_of(clusters: &[[f64; 3]], [width, height]: [usize; 2], size_um: [f64; 2]) -> Vec<f64> {
    /// Radius of influence of a cluster, in its radii: its weight is 10⁻⁸ there.
    const REACH: f64 = 6.0;
    let mut nearest = vec![f64::INFINITY; width * height];
    for [x, y, radius] in clusters {
        // The pixels in reach, and the distance of a pixel from the cluster.
        let along = |middle: f64, pixels: usize, length: f64| {
            let pitch = length / pixels as f64;
            let pixel = |at: f64| round_to_count((at / pitch).clamp(0.0, pixels as f64));
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

/// Checks the file of a layout.
pub(crate) fn check_layout(layout: &Layout, given: Option<&WeightMap>) -> Result<(), ErrorKind> {
    let (Layout::DensityMap { path } | Layout::Labels(Labels { path, .. })) = layout else { return Ok(()) };
    let map = given.ok_or_else(|| not_given(path, "an image"))?;
    map.sampler().map(|_| ()).map_err(|cause| ErrorKind::Map { path: path.clone(), cause: Box::new(cause) })
}

fn not_given(path: &str, what: &'static str) -> ErrorKind {
    ErrorKind::NotGiven { path: path.to_owned(), what }
}

/// Returns a map blurred by a Gaussian, because the centre of a cell may be next to a given label.
fn smoothed(map: &WeightMap, sigma_px: f64) -> Result<WeightMap, ErrorKind> {
    map.sampler()?;
    let kernel = optics_psf::Gaussian::new(sigma_px).map_err(ErrorKind::Smoothing)?;
    Ok(WeightMap { width: map.width, weights: kernel.blur(&map.weights, map.width, optics_psf::Border::Reflect) })
}

/// Places cells one after the other, none nearer to another than a given distance.
pub(super) struct Places {
    /// The field, and the field with its margin.
    areas: [(Sampler, Region); 2],
    spacing_um: f64,
    taken: Vec<[f64; 2]>,
    /// Indices of `taken` by square of the field, squares as wide as the spacing.
    squares: std::collections::BTreeMap<(i64, i64), Vec<usize>>,
}

impl Places {
    pub(super) fn new(weights: &Weights, spacing_um: f64) -> Result<Self, ErrorKind> {
        let areas = [(weights.of_field.sampler()?, weights.field), (weights.of_region.sampler()?, weights.region)];
        Ok(Self { areas, spacing_um, taken: Vec::new(), squares: std::collections::BTreeMap::new() })
    }

    /// Returns about how many cells fit into the field, or into the field and its margin.
    fn room(&self, in_margin: bool) -> f64 {
        let disc = core::f64::consts::FRAC_PI_4 * self.spacing_um * self.spacing_um;
        let area = self.area_um2(in_margin);
        // Only a part of the disc of a cell at the edge of the area is inside the area.
        let margin = 1.0 + self.spacing_um / area.sqrt();
        if disc > 0.0 { (JAMMED * area * margin * margin / disc).max(1.0) } else { f64::INFINITY }
    }

    /// Returns the area in which cells may have their centres, µm².
    fn area_um2(&self, in_margin: bool) -> f64 {
        let (sampler, region) = &self.areas[usize::from(in_margin)];
        region.size_um[0] * region.size_um[1] * sampler.possible_share()
    }

    /// Returns the expected number of cells in the field, if `in_field` cells are placed in the field and `in_both`
    /// cells in the field and its margin.
    fn count_in_field(&self, in_field: usize, in_both: usize) -> f64 {
        in_field as f64 + in_both as f64 * (self.area_um2(false) / self.area_um2(true)).min(1.0)
    }

    /// Checks whether so many cells fit into the field, and into the field and its margin, before the search starts.
    ///
    /// # Errors
    /// If they do not: the fraction of them that fits.
    pub(super) fn check(&self, in_field: usize, in_both: usize) -> Result<(), f64> {
        let fraction = (self.room(false) / self.count_in_field(in_field, in_both))
            .min(self.room(true) / (in_field + in_both) as f64);
        if fraction < 1.0 { Err(fraction) } else { Ok(()) }
    }

    /// Returns the error about cells that do not fit.
    pub(super) fn no_room(&self, in_field: usize, in_both: usize) -> ErrorKind {
        ErrorKind::NoRoom {
            count: round_to_count(self.count_in_field(in_field, in_both)),
            spacing_um: self.spacing_um,
            area_um2: self.area_um2(false),
            room: self.room(false),
        }
    }

    /// Checks the expected number of tries.
    pub(super) fn check_tries(&self, count: usize, in_margin: bool) -> Result<(), ErrorKind> {
        let tries = self.areas[usize::from(in_margin)].0.expected_tries() * count as f64;
        if tries > MOST_TRIES {
            return Err(ErrorKind::TooUneven { count, tries, most: MOST_TRIES });
        }
        Ok(())
    }

    /// Returns the next place, µm: in the field, or in the field and its margin.
    pub(super) fn next<R: Rng + ?Sized>(&mut self, in_margin: bool, rng: &mut R) -> Result<[f64; 2], ErrorKind> {
        /// Largest number of accepted candidates that are too near to others.
        const CROWDED: usize = 20_000;
        let mut crowded = 0;
        let (sampler, region) = &self.areas[usize::from(in_margin)];
        while crowded < CROWDED {
            let Some(place) = sampler.try_place(rng) else { continue };
            let place = region.at(place);
            if self.is_free(place) {
                let square = self.square(place);
                self.squares.entry(square).or_default().push(self.taken.len());
                self.taken.push(place);
                return Ok(place);
            }
            crowded += 1;
        }
        Err(ErrorKind::Crowded { placed: self.taken.len(), spacing_um: self.spacing_um })
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
    fn the_weight_is_that_of_the_nearest_cluster() {
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
