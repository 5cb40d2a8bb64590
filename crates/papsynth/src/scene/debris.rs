//! Drawing everything that is no epithelial cell.

use crate::key::Stream;
use crate::random;
use crate::recipe::{Bacilli, Leukocytes, NucleusForm, Number, OutOfFocus, Recipe, Speckles};

use super::draw::FieldNumbers;
use super::{Body, Object, View};

/// Adds the debris of a field to its cells.
pub(super) fn draw_debris(
    recipe: &Recipe,
    view: View,
    field: &FieldNumbers,
    objects: &mut Vec<Object>,
) -> Result<(), String> {
    let cells: Vec<CellPlace> = objects.iter().filter_map(CellPlace::of).collect();
    let debris = &recipe.debris;
    objects.extend(leukocytes(&debris.leukocytes, view, field, &cells));
    objects.extend(bacilli(&debris.bacilli, view, field, &cells));
    objects.extend(speckles(&debris.speckles, view, field));
    objects.extend(out_of_focus(&debris.out_of_focus, view, field));
    if u32::try_from(objects.len()).is_err() {
        return Err(format!("{} objects are more than labels can number; ask for fewer", objects.len()));
    }
    Ok(())
}

/// Where a cell lies, for what lies on it.
struct CellPlace {
    centre_um: [f64; 2],
    depth_um: f64,
    radius_um: f64,
}

impl CellPlace {
    fn of(object: &Object) -> Option<Self> {
        match &object.body {
            Body::Cell(body) => {
                Some(Self { centre_um: object.centre_um, depth_um: object.depth_um, radius_um: body.radius_um })
            }
            _ => None,
        }
    }
}

/// Where a cluster lies, and how wide it is.
struct Cluster {
    centre_um: [f64; 2],
    depth_um: f64,
    radius_um: f64,
}

/// Height of what lies on a cell above the cell's middle, µm.
const ON_TOP_UM: f64 = 0.8;

/// Puts a cluster onto a cell or anywhere.
fn cluster(on_cells: &Number, radius_um: &Number, view: View, cells: &[CellPlace], rng: &mut Stream) -> Cluster {
    let on_cell = random::chance(on_cells.draw(rng), rng);
    let radius_um = radius_um.draw(rng);
    let cell = random::below(cells.len(), rng);
    let (angle, distance) = (random::direction(rng), random::uniform(rng).sqrt());
    let [width, height] = view.size_um();
    let anywhere = [random::between(0.0, width, rng), random::between(0.0, height, rng)];
    match cells.get(cell) {
        Some(cell) if on_cell => {
            let reach = distance * cell.radius_um * 0.9;
            let centre_um =
                [cell.centre_um[0] + reach * libm::cos(angle), cell.centre_um[1] + reach * libm::sin(angle)];
            Cluster { centre_um, depth_um: cell.depth_um + ON_TOP_UM, radius_um }
        }
        _ => Cluster { centre_um: anywhere, depth_um: random::normal(rng), radius_um },
    }
}

impl Cluster {
    /// A place in the cluster: normal about its middle, the weight map of a single clump.
    fn place(&self, rng: &mut Stream) -> [f64; 2] {
        [
            self.centre_um[0] + self.radius_um * random::normal(rng),
            self.centre_um[1] + self.radius_um * random::normal(rng),
        ]
    }
}

fn leukocytes(recipe: &Leukocytes, view: View, field: &FieldNumbers, cells: &[CellPlace]) -> Vec<Object> {
    /// Leukocytes lie beside each other rather than in each other: nearer than this many radii is tried again …
    const APART: f64 = 1.5;
    /// … this often.
    const TRIES: usize = 24;
    let mut objects: Vec<Object> = Vec::new();
    for index in 0..field.count("debris.leukocytes.clusters", &recipe.clusters) as u64 {
        let mut rng = field.key.stream("leukocyte", index, "cluster");
        let clump = cluster(&recipe.on_cells, &recipe.cluster_um, view, cells, &mut rng);
        let first = objects.len();
        for member in 0..recipe.per_cluster.draw_count(&mut rng).max(1) as u64 {
            let number = index << 32 | member;
            let mut rng = field.key.stream("leukocyte", number, "body");
            let radius_um = recipe.radius_um.draw(&mut rng);
            let mut centre_um = clump.place(&mut rng);
            for _ in 0..TRIES {
                let crowded = objects[first..].iter().any(|other| near(other.centre_um, centre_um, APART * radius_um));
                if !crowded {
                    break;
                }
                centre_um = clump.place(&mut rng);
            }
            let lobes = match recipe.form {
                NucleusForm::Round => 1,
                NucleusForm::Lobed => 2 + random::below(3, &mut rng),
            };
            let body = Body::Leukocyte {
                radius_um,
                lobes,
                alpha: recipe.alpha.draw(&mut rng),
                beta: recipe.beta.draw(&mut rng),
                absorbance: recipe.absorbance.draw(&mut rng),
                halo: recipe.halo.draw(&mut rng),
            };
            let depth_um = clump.depth_um + 0.5 * random::normal(&mut rng);
            objects.push(object(number, index, centre_um, depth_um, body, &mut rng));
        }
    }
    objects
}

fn bacilli(recipe: &Bacilli, view: View, field: &FieldNumbers, cells: &[CellPlace]) -> Vec<Object> {
    let mut objects = Vec::new();
    for index in 0..field.count("debris.bacilli.clusters", &recipe.clusters) as u64 {
        let mut rng = field.key.stream("bacillus", index, "cluster");
        let clump = cluster(&recipe.on_cells, &recipe.cluster_um, view, cells, &mut rng);
        for member in 0..recipe.per_cluster.draw_count(&mut rng).max(1) as u64 {
            let number = index << 32 | member;
            let mut rng = field.key.stream("bacillus", number, "body");
            let centre_um = clump.place(&mut rng);
            let body = Body::Bacillus {
                length_um: recipe.length_um.draw(&mut rng),
                width_um: recipe.width_um.draw(&mut rng),
                bend_deg: recipe.bend_deg.draw(&mut rng),
                absorbance: recipe.absorbance.draw(&mut rng),
                phase_rad: recipe.phase_rad.draw(&mut field.key.stream("bacillus", number, "phase")),
            };
            let depth_um = clump.depth_um + 0.3 * random::normal(&mut rng);
            objects.push(object(number, index, centre_um, depth_um, body, &mut rng));
        }
    }
    objects
}

fn speckles(recipe: &Speckles, view: View, field: &FieldNumbers) -> Vec<Object> {
    let [width, height] = view.size_um();
    let count = field.count("debris.speckles.count", &recipe.count) as u64;
    (0..count)
        .map(|number| {
            let mut rng = field.key.stream("speckle", number, "body");
            let centre_um = [random::between(0.0, width, &mut rng), random::between(0.0, height, &mut rng)];
            let body = Body::Speckle {
                form: recipe.form,
                dilations: recipe.dilations.draw_count(&mut rng),
                absorbance: recipe.absorbance.draw(&mut rng),
                phase_rad: recipe.phase_rad.draw(&mut field.key.stream("speckle", number, "phase")),
            };
            let depth_um = random::normal(&mut rng);
            alone(object(number, 0, centre_um, depth_um, body, &mut rng))
        })
        .collect()
}

fn out_of_focus(recipe: &OutOfFocus, view: View, field: &FieldNumbers) -> Vec<Object> {
    let [width, height] = view.size_um();
    let count = field.count("debris.out_of_focus.count", &recipe.count) as u64;
    (0..count)
        .map(|number| {
            let mut rng = field.key.stream("out-of-focus", number, "body");
            let centre_um = [random::between(0.0, width, &mut rng), random::between(0.0, height, &mut rng)];
            let body = Body::OutOfFocus {
                radius_um: recipe.radius_um.draw(&mut rng),
                alpha: recipe.alpha.draw(&mut rng),
                beta: recipe.beta.draw(&mut rng),
                absorbance: recipe.absorbance.draw(&mut rng),
            };
            let side = if random::chance(0.5, &mut rng) { 1.0 } else { -1.0 };
            let depth_um = side * recipe.depth_um.draw(&mut rng);
            alone(object(number, 0, centre_um, depth_um, body, &mut rng))
        })
        .collect()
}

/// An object of a cluster; its id is given later.
fn object(number: u64, cluster: u64, centre_um: [f64; 2], depth_um: f64, body: Body, rng: &mut Stream) -> Object {
    let cluster = u32::try_from(cluster + 1).unwrap_or(u32::MAX);
    let rotation_deg = random::between(0.0, 360.0, rng);
    Object { id: 0, number, cluster, centre_um, depth_um, rotation_deg, bethesda: String::new(), body }
}

fn alone(object: Object) -> Object {
    Object { cluster: 0, ..object }
}

fn near(a: [f64; 2], b: [f64; 2], distance: f64) -> bool {
    let (dx, dy) = (a[0] - b[0], a[1] - b[1]);
    dx * dx + dy * dy < distance * distance
}
