//! The slide on which debris is strewn: where its cells lie, and the clusters that lie among them.

use super::{ClueCells, Kind};
use crate::key::Stream;
use crate::random;
use crate::recipe::dyes::DyeAmounts;
use crate::recipe::number::Number;
use crate::scene::{Body, FieldNumbers, FieldStain, Object, View};

/// A field whose cells have their places, and to which objects are added kind by kind.
pub(crate) struct Ground<'a> {
    field: &'a FieldNumbers,
    stain: &'a FieldStain<'a>,
    size_um: [f64; 2],
    cells: Vec<CellPlace>,
    /// The name of the kind that is drawn, and of its section.
    kind: &'static str,
    section: &'static str,
    lies_on_glass: bool,
    /// What may lie on a part of a slide: how much there is relative to a field, and where it stays.
    sieve: Option<Sieve<'a>>,
    objects: &'a mut Vec<Object>,
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
struct CellPlace {
    centre_um: [f64; 2],
    depth_um: f64,
    radius_um: f64,
}

/// Where a cluster lies, and how wide it is.
pub(super) struct Cluster {
    pub(super) centre_um: [f64; 2],
    pub(super) depth_um: f64,
    radius_um: f64,
}

/// Where an object lies.
pub(super) struct Lie {
    pub(super) centre_um: [f64; 2],
    pub(super) depth_um: f64,
    pub(super) rotation_deg: f64,
}

/// Height of what lies on a cell above the cell's middle, µm.
const ON_TOP_UM: f64 = 0.8;

/// Share of what lies with a cell that lies beneath it.
const BENEATH: f64 = 0.25;

impl<'a> Ground<'a> {
    pub(crate) fn new(
        view: View,
        field: &'a FieldNumbers,
        stain: &'a FieldStain<'a>,
        objects: &'a mut Vec<Object>,
    ) -> Self {
        let place = |object: &Object| match &object.body {
            Body::Cell(body) => {
                let (centre_um, depth_um) = (object.centre_um, object.depth_um);
                Some(CellPlace { centre_um, depth_um, radius_um: body.radius_um })
            }
            _ => None,
        };
        let cells = objects.iter().filter_map(place).collect();
        Self {
            field,
            stain,
            size_um: view.size_um(),
            cells,
            kind: "",
            section: "",
            lies_on_glass: false,
            sieve: None,
            objects,
        }
    }

    /// The same for a part of a slide.
    pub(crate) fn through(self, sieve: Sieve<'a>) -> Self {
        Self { sieve: Some(sieve), ..self }
    }

    /// Gives cells their coats.
    pub(super) fn dress(&mut self, clue_cells: &ClueCells) {
        clue_cells.draw(self.field, self.objects);
    }

    pub(super) fn begin(&mut self, kind: Kind, section: &'static str) {
        (self.kind, self.section, self.lies_on_glass) = (kind.name(), section, kind.lies_on_glass());
    }

    /// A number of the section that is drawn once a field, as a count.
    pub(super) fn count(&self, (name, number): (&str, &Number)) -> u64 {
        let path = format!("debris.{}.{name}", self.section);
        let Some(sieve) = &self.sieve else { return self.field.count((&path, number)) as u64 };
        let more = if self.lies_on_glass { 1.0 } else { sieve.most };
        let wanted = self.field.draw((&path, number)).max(0.0) * sieve.share * more;
        let further = random::chance(wanted - wanted.floor(), &mut self.field.key.stream("field", 1, &path));
        wanted as u64 + u64::from(further)
    }

    /// The stream of a purpose of one object of the kind.
    pub(super) fn stream(&self, number: u64, purpose: &str) -> Stream {
        self.field.key.stream(self.kind, number, purpose)
    }

    /// Dyes as this field was stained.
    pub(super) fn dyes(&self, dyes: &DyeAmounts) -> dye_spectra::Amounts {
        self.stain.balanced(dyes)
    }

    /// How strongly the field's nuclei are stained.
    pub(super) fn nuclear_stain(&self) -> f64 {
        self.stain.nucleus
    }

    /// Dyes of pale cytoplasm.
    pub(super) fn cyanophilic(&self) -> dye_spectra::Amounts {
        self.stain.cyanophilic()
    }

    /// Any place of the field.
    pub(super) fn anywhere(&self, rng: &mut Stream) -> [f64; 2] {
        let [width, height] = self.size_um;
        [random::between(0.0, width, rng), random::between(0.0, height, rng)]
    }

    /// A place and depth on a cell or anywhere.
    pub(super) fn spot(&self, on_cells: &Number, rng: &mut Stream) -> ([f64; 2], f64) {
        let Cluster { centre_um, depth_um, .. } = self.cluster(on_cells, &Number::Fixed(0.0), rng);
        (centre_um, depth_um - Self::beneath_um(rng))
    }

    /// A cluster on a cell or anywhere.
    pub(super) fn cluster(&self, on_cells: &Number, radius_um: &Number, rng: &mut Stream) -> Cluster {
        let on_cell = random::chance(on_cells.draw(rng), rng);
        let radius_um = radius_um.draw(rng);
        let cell = random::below(self.cells.len(), rng);
        let (angle, distance) = (random::direction(rng), random::uniform(rng).sqrt());
        let anywhere = self.anywhere(rng);
        match self.cells.get(cell) {
            Some(cell) if on_cell => {
                let reach = distance * cell.radius_um * 0.9;
                let centre_um =
                    [cell.centre_um[0] + reach * libm::cos(angle), cell.centre_um[1] + reach * libm::sin(angle)];
                Cluster { centre_um, depth_um: cell.depth_um + ON_TOP_UM, radius_um }
            }
            _ => Cluster { centre_um: anywhere, depth_um: random::normal(rng), radius_um },
        }
    }

    /// How far below the top of a cell something lies that is strewn with it: mostly not at all, sometimes beneath it.
    fn beneath_um(rng: &mut Stream) -> f64 {
        if random::chance(BENEATH, rng) { 2.0 * ON_TOP_UM } else { 0.0 }
    }

    /// Lets an object lie there; what is alone is of cluster 0.
    pub(super) fn add(&mut self, number: u64, cluster: u32, lie: Lie, thing: impl Into<Body>) {
        let Lie { centre_um, depth_um, rotation_deg } = lie;
        let body: Body = thing.into();
        if let Some(sieve) = self.sieve.as_ref().filter(|_| !self.lies_on_glass) {
            let mut rng = self.field.key.stream(self.kind, number, "stays");
            if !random::chance((sieve.stays)(centre_um), &mut rng) {
                return;
            }
        }
        self.objects.push(Object {
            id: 0,
            number,
            cluster,
            plot: None,
            centre_um,
            depth_um,
            rotation_deg,
            bethesda: String::new(),
            coat: None,
            body,
        });
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
pub(super) fn near(a: [f64; 2], b: [f64; 2], distance: f64) -> bool {
    let (dx, dy) = (a[0] - b[0], a[1] - b[1]);
    dx * dx + dy * dy < distance * distance
}
