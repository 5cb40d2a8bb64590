//! Placement of debris: positions on the slide and on its cells, and clusters of objects.

use crate::key::Stream;
use crate::random;
use crate::recipe::abundance::Abundance;
use crate::recipe::dyes::DyeAmounts;
use crate::recipe::number::Number;
use crate::scene::stain::FieldStain;
use crate::scene::view::{FieldNumbers, Region};

/// A field with placed cells.
pub(crate) struct Field<'a> {
    /// The field, and the field with its margin.
    pub(crate) field: Region,
    pub(crate) region: Region,
    pub(crate) numbers: &'a FieldNumbers,
    pub(crate) stain: &'a FieldStain<'a>,
    /// Cells; the first `cells_in_field` have their centres in the field, the others in the margin.
    pub(crate) cells: Vec<CellPosition>,
    pub(crate) cells_in_field: usize,
    /// On a slide: the density of debris in one plot.
    pub(crate) plot_density: Option<PlotDensity<'a>>,
}

/// Places the objects of one kind on a field.
pub(crate) struct KindPlacer<'a, T> {
    field: &'a Field<'a>,
    /// Name of the kind.
    kind: &'static str,
    /// Name of its section of the recipe.
    section: &'static str,
    is_on_glass: bool,
    /// Whether objects are also placed in the margin of the field.
    in_margin: bool,
    /// Leukocytes at which debris collects, with their cluster.
    leukocytes: Vec<(u32, CellPosition)>,
    pub(super) objects: Vec<PlacedObject<T>>,
}

/// A placed object.
pub(crate) struct PlacedObject<T> {
    /// Number within its kind.
    pub(crate) number: u64,
    /// Number of its cluster; 0 for a single object.
    pub(crate) cluster: u32,
    pub(crate) placement: Placement,
    pub(crate) body: T,
}

/// The density of debris in one plot of a slide.
pub(crate) struct PlotDensity<'a> {
    /// Area of the plot relative to a field.
    pub(crate) area_in_fields: f64,
    /// Maximum relative density of objects that are not on the glass; this many candidates are drawn.
    pub(crate) max_density: f64,
    /// Returns the probability that a candidate at a position (µm) is kept.
    pub(crate) keep_probability: &'a dyn Fn([f64; 2]) -> f64,
}

/// The position of a cell, for objects on it.
pub(crate) struct CellPosition {
    pub(crate) centre_um: [f64; 2],
    pub(crate) depth_um: f64,
    pub(crate) radius_um: f64,
}

/// The position and radius of a cluster.
pub(super) struct Cluster {
    pub(super) centre_um: [f64; 2],
    pub(super) depth_um: f64,
    radius_um: f64,
}

/// Parameters of clusters of objects.
pub(super) struct Clusters<'a> {
    /// Purpose of the random streams of clusters.
    pub(super) purpose: &'static str,
    /// Fraction of clusters that are on a cell.
    pub(super) on_cells: &'a Number,
    pub(super) radius_um: &'a Number,
    /// Objects per cluster.
    pub(super) members: &'a Number,
    /// Standard deviation of the depths in a cluster, µm.
    pub(super) depth_sd_um: f64,
}

/// Position and rotation of an object.
pub(crate) struct Placement {
    pub(crate) centre_um: [f64; 2],
    pub(crate) depth_um: f64,
    pub(crate) rotation_deg: f64,
}

/// Height of objects on a cell above the centre of the cell, µm.
const ON_CELL_UM: f64 = 0.8;

/// Fraction of the objects at a cell that are below it.
const BELOW_CELL: f64 = 0.25;

/// Distance from the centre of a cell of objects on it, relative to its radius: minimum, maximum.
const ON_CELL: [f64; 2] = [0.0, 0.9];

/// Number of leukocytes of which debris collects at the one with the largest cluster.
const CANDIDATES: usize = 2;
/// Maximum distance of leukocytes between which debris collects, in diameters.
const BETWEEN: f64 = 2.2;
/// Distance of debris between two leukocytes from the line between them (standard deviation), in diameters.
const BESIDE: f64 = 0.3;
/// Distance of debris from a leukocyte without neighbours, in diameters: minimum, maximum.
const AT_LEUKOCYTE: [f64; 2] = [0.35, 0.85];

impl<'a, T> KindPlacer<'a, T> {
    pub(super) fn new(
        field: &'a Field<'a>,
        kind: &'static str,
        section: &'static str,
        is_on_glass: bool,
        in_margin: bool,
    ) -> Self {
        Self { field, kind, section, is_on_glass, in_margin, leukocytes: Vec::new(), objects: Vec::new() }
    }

    /// Sets the leukocytes at which debris collects, with their clusters.
    pub(super) fn with_leukocytes(mut self, leukocytes: impl Iterator<Item = (u32, CellPosition)>) -> Self {
        let region = self.region();
        self.leukocytes = leukocytes.filter(|(_, leukocyte)| region.touches(leukocyte.centre_um, 0.0)).collect();
        self
    }

    /// Draws a position between neighbouring leukocytes, or beside one, with its depth; `None` without leukocytes.
    pub(super) fn at_leukocytes(&self, rng: &mut Stream) -> Option<([f64; 2], f64)> {
        let others = |index: usize| {
            let (cluster, leukocyte) = &self.leukocytes[index];
            let close = move |(of, other): &&(u32, CellPosition)| {
                let distance = (of == cluster).then_some(BETWEEN * 2.0 * leukocyte.radius_um);
                distance.is_some_and(|distance| {
                    near(other.centre_um, leukocyte.centre_um, distance) && other.centre_um != leukocyte.centre_um
                })
            };
            self.leukocytes.iter().filter(close).map(|(_, other)| other).collect::<Vec<_>>()
        };
        if self.leukocytes.is_empty() {
            return None;
        }
        let mut candidate = || {
            let index = random::below(self.leukocytes.len(), rng);
            (index, others(index))
        };
        let first = candidate();
        let (index, others) = (1..CANDIDATES).fold(first, |most, _| {
            let next = candidate();
            if next.1.len() > most.1.len() { next } else { most }
        });
        let leukocyte = &self.leukocytes[index].1;
        let ([x, y], diameter_um) = (leukocyte.centre_um, 2.0 * leukocyte.radius_um);
        let position = if others.is_empty() {
            let distance = diameter_um * random::between(AT_LEUKOCYTE[0], AT_LEUKOCYTE[1], rng);
            let angle = random::direction(rng);
            [x + distance * libm::cos(angle), y + distance * libm::sin(angle)]
        } else {
            let other = others[random::below(others.len(), rng)].centre_um;
            let along = random::uniform(rng);
            let mut off = || BESIDE * diameter_um * random::normal(rng);
            [x + along * (other[0] - x) + off(), y + along * (other[1] - y) + off()]
        };
        Some((position, leukocyte.depth_um + 0.5 * random::normal(rng)))
    }

    /// Draws the number of objects or clusters in the field or plot.
    pub(super) fn count(&self, (name, abundance): (&str, &Abundance)) -> u64 {
        let path = format!("debris.{}.{name}", self.section);
        let (numbers, area_mm2) = (self.field.numbers, self.field.region.area_mm2());
        let Some(plot) = &self.field.plot_density else { return numbers.number_of((&path, abundance), area_mm2) };
        let factor = if self.is_on_glass { 1.0 } else { plot.max_density };
        numbers.number_on_slide((&path, abundance), [area_mm2, plot.area_in_fields], factor)
    }

    /// Returns the region in which objects are placed.
    fn region(&self) -> Region {
        if self.in_margin { self.field.region } else { self.field.field }
    }

    /// Returns the cells in that region.
    fn cells(&self) -> &[CellPosition] {
        if self.in_margin { &self.field.cells } else { &self.field.cells[..self.field.cells_in_field] }
    }

    /// Returns the random stream of one object of the kind for a purpose.
    pub(super) fn stream(&self, number: u64, purpose: &str) -> Stream {
        self.field.numbers.key.stream(self.kind, number, purpose)
    }

    /// Returns amounts of dye with the stain balance of the field.
    pub(super) fn dyes(&self, dyes: &DyeAmounts) -> dye_spectra::Amounts {
        self.field.stain.balanced(dyes)
    }

    /// Returns the factor on the absorbance of nuclei in this field.
    pub(super) fn nuclear_stain(&self) -> f64 {
        self.field.stain.nucleus
    }

    /// Returns the dyes of cyanophilic cytoplasm.
    pub(super) fn cyanophilic(&self) -> dye_spectra::Amounts {
        self.field.stain.cyanophilic()
    }

    /// Draws a uniform position in the field.
    pub(super) fn anywhere(&self, rng: &mut Stream) -> [f64; 2] {
        let Region { low_um: [left, top], size_um: [width, height] } = self.region();
        [left + random::between(0.0, width, rng), top + random::between(0.0, height, rng)]
    }

    /// Draws a cluster on a cell or anywhere.
    pub(super) fn cluster(&self, on_cells: &Number, radius_um: &Number, rng: &mut Stream) -> Cluster {
        self.cluster_within(ON_CELL, on_cells, radius_um, rng)
    }

    /// Draws a cluster on a cell, at a distance from its centre relative to its radius, or anywhere.
    pub(super) fn cluster_within(
        &self,
        [nearest, farthest]: [f64; 2],
        on_cells: &Number,
        radius_um: &Number,
        rng: &mut Stream,
    ) -> Cluster {
        let on_cell = random::chance(on_cells.draw(rng), rng);
        let radius_um = radius_um.draw(rng);
        let cell = random::below(self.cells().len(), rng);
        let (angle, distance) = (random::direction(rng), random::uniform(rng).sqrt());
        let anywhere = self.anywhere(rng);
        match self.cells().get(cell) {
            Some(cell) if on_cell => {
                let reach = (nearest + distance * (farthest - nearest)) * cell.radius_um;
                let centre_um =
                    [cell.centre_um[0] + reach * libm::cos(angle), cell.centre_um[1] + reach * libm::sin(angle)];
                Cluster { centre_um, depth_um: cell.depth_um + ON_CELL_UM, radius_um }
            }
            _ => Cluster { centre_um: anywhere, depth_um: random::normal(rng), radius_um },
        }
    }

    /// Places objects anywhere. `draw` draws an object, given its number and stream; `depth_um` draws its depth.
    pub(super) fn place_anywhere(
        &mut self,
        count: (&str, &Abundance),
        draw: impl Fn(&Self, u64, &mut Stream) -> T,
        depth_um: impl Fn(&mut Stream) -> f64,
    ) {
        for number in 0..self.count(count) {
            let mut rng = self.stream(number, "body");
            let centre_um = self.anywhere(&mut rng);
            let body = draw(self, number, &mut rng);
            let placement = Placement::with_random_rotation(centre_um, depth_um(&mut rng), &mut rng);
            self.add(number, 0, placement, body);
        }
    }

    /// Places objects, a fraction of them on cells. `draw` draws an object from its stream.
    pub(super) fn place_on_cells(
        &mut self,
        count: (&str, &Abundance),
        on_cells: &Number,
        draw: impl Fn(&mut Stream) -> T,
    ) {
        for number in 0..self.count(count) {
            let mut rng = self.stream(number, "body");
            let position = self.cluster(on_cells, &Number::Fixed(0.0), &mut rng);
            // Most are above the cell, some below it.
            let shift_um = if random::chance(BELOW_CELL, &mut rng) { 2.0 * ON_CELL_UM } else { 0.0 };
            let body = draw(&mut rng);
            let placement = Placement::with_random_rotation(position.centre_um, position.depth_um - shift_um, &mut rng);
            self.add(number, 0, placement, body);
        }
    }

    /// Places clusters of objects. `draw` draws an object, given its number and stream.
    pub(super) fn place_in_clusters(
        &mut self,
        count: (&str, &Abundance),
        clusters: &Clusters<'_>,
        draw: impl Fn(&Self, u64, &mut Stream) -> T,
    ) {
        for index in 0..self.count(count) {
            let mut rng = self.stream(index, clusters.purpose);
            let cluster = self.cluster(clusters.on_cells, clusters.radius_um, &mut rng);
            for member in 0..clusters.members.draw_count(&mut rng).max(1) as u64 {
                let number = member_number(index, member);
                let mut rng = self.stream(number, "body");
                let centre_um = cluster.draw_position(&mut rng);
                let body = draw(self, number, &mut rng);
                let depth_um = cluster.depth_um + clusters.depth_sd_um * random::normal(&mut rng);
                let placement = Placement::with_random_rotation(centre_um, depth_um, &mut rng);
                self.add(number, cluster_id(index), placement, body);
            }
        }
    }

    /// Adds an object; single objects have cluster 0.
    pub(super) fn add(&mut self, number: u64, cluster: u32, placement: Placement, body: T) {
        if let Some(plot) = self.field.plot_density.as_ref().filter(|_| !self.is_on_glass) {
            let mut rng = self.stream(number, "stays");
            if !random::chance((plot.keep_probability)(placement.centre_um), &mut rng) {
                return;
            }
        }
        self.objects.push(PlacedObject { number, cluster, placement, body });
    }
}

impl Cluster {
    /// Draws a position in the cluster, normally distributed about its centre.
    pub(super) fn draw_position(&self, rng: &mut Stream) -> [f64; 2] {
        [
            self.centre_um[0] + self.radius_um * random::normal(rng),
            self.centre_um[1] + self.radius_um * random::normal(rng),
        ]
    }
}

impl Placement {
    /// Creates a placement with a random rotation.
    pub(super) fn with_random_rotation(centre_um: [f64; 2], depth_um: f64, rng: &mut Stream) -> Self {
        Self { centre_um, depth_um, rotation_deg: random::between(0.0, 360.0, rng) }
    }
}

/// Returns the number of the cluster with this index.
pub(super) fn cluster_id(index: u64) -> u32 {
    u32::try_from(index + 1).unwrap_or(u32::MAX)
}

/// Returns the number within its kind of a member of a cluster.
pub(super) fn member_number(cluster: u64, member: u64) -> u64 {
    cluster << 32 | member
}

/// Whether two points are closer than a distance.
pub(crate) fn near(a: [f64; 2], b: [f64; 2], distance: f64) -> bool {
    let (dx, dy) = (a[0] - b[0], a[1] - b[1]);
    dx * dx + dy * dy < distance * distance
}
