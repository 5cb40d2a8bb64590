//! The slide on which debris of one kind is strewn: where its cells lie, and the clusters that lie among them.

use crate::key::Stream;
use crate::random;
use crate::recipe::abundance::Abundance;
use crate::recipe::dyes::DyeAmounts;
use crate::recipe::number::Number;
use crate::scene::stain::FieldStain;
use crate::scene::view::{FieldNumbers, Region};

/// A field whose cells have their places.
pub(crate) struct Field<'a> {
    /// The field, and the field with its margin.
    pub(crate) field: Region,
    pub(crate) region: Region,
    pub(crate) numbers: &'a FieldNumbers,
    pub(crate) stain: &'a FieldStain<'a>,
    /// Cells; the first `inside` have their centres in the field, the others in the margin.
    pub(crate) cells: Vec<CellPlace>,
    pub(crate) inside: usize,
    /// What may lie on a part of a slide: how much there is relative to a field, and where it stays.
    pub(crate) sieve: Option<Sieve<'a>>,
}

/// A field on which objects of one kind are strewn.
pub(crate) struct Ground<'a, T> {
    field: &'a Field<'a>,
    /// The name of the kind, and of its section.
    kind: &'static str,
    section: &'static str,
    lies_on_glass: bool,
    /// Whether its objects also lie in the margin of the field.
    in_margin: bool,
    pub(super) strewn: Vec<Strewn<T>>,
}

/// An object that was strewn, and what it is.
pub(crate) struct Strewn<T> {
    /// Its number within its kind.
    pub(crate) number: u64,
    /// Its cluster; 0 if it is alone.
    pub(crate) cluster: u32,
    pub(crate) lie: Lie,
    pub(crate) thing: T,
}

/// What is strewn on a part of a slide.
pub(crate) struct Sieve<'a> {
    /// How large the part is, in fields.
    pub(crate) share: f64,
    /// How many more are tried of what came with the cells.
    pub(crate) most: f64,
    /// The probability that one of those stays at a place, µm.
    pub(crate) stays: &'a dyn Fn([f64; 2]) -> f64,
}

/// Where a cell lies, for what lies on it.
pub(crate) struct CellPlace {
    pub(crate) centre_um: [f64; 2],
    pub(crate) depth_um: f64,
    pub(crate) radius_um: f64,
}

/// Where a cluster lies, and how wide it is.
pub(super) struct Cluster {
    pub(super) centre_um: [f64; 2],
    pub(super) depth_um: f64,
    radius_um: f64,
}

/// Clusters of objects: the purpose of their streams, and what is drawn of each.
pub(super) struct Clusters<'a> {
    pub(super) purpose: &'static str,
    /// Share that lies on a cell.
    pub(super) on_cells: &'a Number,
    pub(super) radius_um: &'a Number,
    /// Objects of a cluster.
    pub(super) members: &'a Number,
    /// Standard deviation of their depths, µm.
    pub(super) spread_um: f64,
}

/// Where an object lies.
pub(crate) struct Lie {
    pub(crate) centre_um: [f64; 2],
    pub(crate) depth_um: f64,
    pub(crate) rotation_deg: f64,
}

/// Height of what lies on a cell above the cell's middle, µm.
const ON_TOP_UM: f64 = 0.8;

/// Share of what lies with a cell that lies beneath it.
const BENEATH: f64 = 0.25;

impl<'a, T> Ground<'a, T> {
    pub(super) fn new(
        field: &'a Field<'a>,
        kind: &'static str,
        section: &'static str,
        lies_on_glass: bool,
        in_margin: bool,
    ) -> Self {
        Self { field, kind, section, lies_on_glass, in_margin, strewn: Vec::new() }
    }

    /// Draws the number of objects, or of clusters, of the field or of the part of a slide.
    pub(super) fn count(&self, (name, abundance): (&str, &Abundance)) -> u64 {
        let path = format!("debris.{}.{name}", self.section);
        let (numbers, area_mm2) = (self.field.numbers, self.field.region.area_mm2());
        let Some(sieve) = &self.field.sieve else { return numbers.number_of((&path, abundance), area_mm2) };
        let more = if self.lies_on_glass { 1.0 } else { sieve.most };
        numbers.number_on_slide((&path, abundance), [area_mm2, sieve.share], more)
    }

    /// Returns the area where the objects lie.
    fn region(&self) -> Region {
        if self.in_margin { self.field.region } else { self.field.field }
    }

    /// Returns the cells there.
    fn cells(&self) -> &[CellPlace] {
        if self.in_margin { &self.field.cells } else { &self.field.cells[..self.field.inside] }
    }

    /// The stream of a purpose of one object of the kind.
    pub(super) fn stream(&self, number: u64, purpose: &str) -> Stream {
        self.field.numbers.key.stream(self.kind, number, purpose)
    }

    /// Dyes as this field was stained.
    pub(super) fn dyes(&self, dyes: &DyeAmounts) -> dye_spectra::Amounts {
        self.field.stain.balanced(dyes)
    }

    /// How strongly the field's nuclei are stained.
    pub(super) fn nuclear_stain(&self) -> f64 {
        self.field.stain.nucleus
    }

    /// Dyes of pale cytoplasm.
    pub(super) fn cyanophilic(&self) -> dye_spectra::Amounts {
        self.field.stain.cyanophilic()
    }

    /// Any place of the field.
    pub(super) fn anywhere(&self, rng: &mut Stream) -> [f64; 2] {
        let Region { low_um: [left, top], size_um: [width, height] } = self.region();
        [left + random::between(0.0, width, rng), top + random::between(0.0, height, rng)]
    }

    /// A cluster on a cell or anywhere.
    pub(super) fn cluster(&self, on_cells: &Number, radius_um: &Number, rng: &mut Stream) -> Cluster {
        let on_cell = random::chance(on_cells.draw(rng), rng);
        let radius_um = radius_um.draw(rng);
        let cell = random::below(self.cells().len(), rng);
        let (angle, distance) = (random::direction(rng), random::uniform(rng).sqrt());
        let anywhere = self.anywhere(rng);
        match self.cells().get(cell) {
            Some(cell) if on_cell => {
                let reach = distance * cell.radius_um * 0.9;
                let centre_um =
                    [cell.centre_um[0] + reach * libm::cos(angle), cell.centre_um[1] + reach * libm::sin(angle)];
                Cluster { centre_um, depth_um: cell.depth_um + ON_TOP_UM, radius_um }
            }
            _ => Cluster { centre_um: anywhere, depth_um: random::normal(rng), radius_um },
        }
    }

    /// Strews objects that lie anywhere. `draw` draws one, by its number, from its stream, and `depth_um` its depth.
    pub(super) fn strew_anywhere(
        &mut self,
        count: (&str, &Abundance),
        draw: impl Fn(&Self, u64, &mut Stream) -> T,
        depth_um: impl Fn(&mut Stream) -> f64,
    ) {
        for number in 0..self.count(count) {
            let mut rng = self.stream(number, "body");
            let centre_um = self.anywhere(&mut rng);
            let thing = draw(self, number, &mut rng);
            let lie = Lie::any_way(centre_um, depth_um(&mut rng), &mut rng);
            self.add(number, 0, lie, thing);
        }
    }

    /// Strews objects of which a share lies on cells. `draw` draws one from its stream.
    pub(super) fn strew_on_cells(
        &mut self,
        count: (&str, &Abundance),
        on_cells: &Number,
        draw: impl Fn(&mut Stream) -> T,
    ) {
        for number in 0..self.count(count) {
            let mut rng = self.stream(number, "body");
            let spot = self.cluster(on_cells, &Number::Fixed(0.0), &mut rng);
            // Mostly on top of the cell, sometimes beneath it.
            let down_um = if random::chance(BENEATH, &mut rng) { 2.0 * ON_TOP_UM } else { 0.0 };
            let thing = draw(&mut rng);
            let lie = Lie::any_way(spot.centre_um, spot.depth_um - down_um, &mut rng);
            self.add(number, 0, lie, thing);
        }
    }

    /// Strews clusters of objects. `draw` draws one, by its number, from its stream.
    pub(super) fn strew_in_clusters(
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
                let centre_um = cluster.place(&mut rng);
                let thing = draw(self, number, &mut rng);
                let depth_um = cluster.depth_um + clusters.spread_um * random::normal(&mut rng);
                let lie = Lie::any_way(centre_um, depth_um, &mut rng);
                self.add(number, cluster_id(index), lie, thing);
            }
        }
    }

    /// Lets an object lie there; what is alone is of cluster 0.
    pub(super) fn add(&mut self, number: u64, cluster: u32, lie: Lie, thing: T) {
        if let Some(sieve) = self.field.sieve.as_ref().filter(|_| !self.lies_on_glass) {
            let mut rng = self.stream(number, "stays");
            if !random::chance((sieve.stays)(lie.centre_um), &mut rng) {
                return;
            }
        }
        self.strewn.push(Strewn { number, cluster, lie, thing });
    }
}

impl Cluster {
    /// A place in the cluster: normal about its middle, the weight map of a single clump.
    pub(super) fn place(&self, rng: &mut Stream) -> [f64; 2] {
        [
            self.centre_um[0] + self.radius_um * random::normal(rng),
            self.centre_um[1] + self.radius_um * random::normal(rng),
        ]
    }
}

impl Lie {
    /// Turned to any direction.
    pub(super) fn any_way(centre_um: [f64; 2], depth_um: f64, rng: &mut Stream) -> Self {
        Self { centre_um, depth_um, rotation_deg: random::between(0.0, 360.0, rng) }
    }
}

/// The name of a kind's cluster of that index.
pub(super) fn cluster_id(index: u64) -> u32 {
    u32::try_from(index + 1).unwrap_or(u32::MAX)
}

/// The number of a member of a cluster within its kind.
pub(super) fn member_number(cluster: u64, member: u64) -> u64 {
    cluster << 32 | member
}

/// Whether two places are nearer to each other than a distance.
pub(crate) fn near(a: [f64; 2], b: [f64; 2], distance: f64) -> bool {
    let (dx, dy) = (a[0] - b[0], a[1] - b[1]);
    dx * dx + dy * dy < distance * distance
}
