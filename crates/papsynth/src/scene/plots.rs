//! The objects of a whole slide, square by square.
//!
//! A slide is divided into plots. The objects of a plot depend only on the key of the slide and the number of the plot:
//! the number of tries, the place of each try, and whether it is accepted, by the density at its place, which is a
//! function of the place. Any part of a slide can be drawn alone, and a slide is a part of each larger slide.

use std::collections::BTreeMap;
use std::convert::Infallible;
use std::sync::{Arc, Mutex, PoisonError};

use perlin_bg::{Fractal, FractalParams};
use portable_numerics::rounding::round_to_count;
use rand_core::Rng;

use super::cells::{Class, Drawn};
use super::draw::{add_debris, empty, pixel_um};
use super::field::{Object, Plot, Scene};
use super::groups::Groups;
use super::stain::FieldStain;
use super::view::{FieldNumbers, Region, View};
use crate::debris::placement::{PlotDensity, near};
use crate::error::ErrorKind;
use crate::key::Key;
use crate::model::Model;
use crate::random;
use crate::recipe::scan::SceneDeposit;
use crate::recipe::section::named;
use crate::recipe::{Clusters as ClusterLayout, Deposit as DepositSection, GroupForm, Layout, Number, Recipe};

/// Size of a plot, pixels.
pub(crate) const PLOT_PX: i64 = 1024;

/// Number of plots beyond the upper and left border of a slide whose objects may reach into the slide.
pub(crate) const BEYOND: i64 = 8;

/// Bits of the column and the row of a plot in its number, and of an object in its id.
const SIDE_BITS: u32 = 10;
const OBJECT_BITS: u32 = 12;

/// Number of plots whose objects are cached.
const CACHED_PLOTS: usize = 192;

/// The objects of a slide.
#[derive(Debug)]
pub(crate) struct Population {
    recipe: Recipe,
    model: Model,
    key: Key,
    pixel_um: f64,
    /// Area of a plot relative to that of a field.
    share: f64,
    spacing_um: f64,
    deposit: Deposit,
    places: Places,
    relief: Relief,
    sown: PlotCache,
    plots: PlotCache,
}

/// The layout of the cells of a slide: uniform, or in clusters.
#[derive(Debug)]
struct Places {
    clusters: Option<ClusterLayout>,
    /// Weight outside the clusters.
    outside: f64,
    /// Number of plots that a cluster reaches beyond its own.
    reach: i64,
    /// Mean weight.
    mean: f64,
}

/// Centre and radius of a cluster, µm.
type Cluster = [f64; 3];

/// Depth of the cells of a slide: the noise of the relief of a field, as a function of the place.
#[derive(Debug)]
struct Relief {
    noise: Fractal,
    cell_um: f64,
    scale_um: f64,
}

/// Cached objects of plots, by row and column.
#[derive(Debug, Default)]
struct PlotCache {
    known: Mutex<BTreeMap<[i64; 2], Arc<Vec<Object>>>>,
}

impl PlotCache {
    /// Returns the cached objects of a plot, or the result of `make`.
    fn get<E>(&self, at: [i64; 2], make: impl FnOnce() -> Result<Vec<Object>, E>) -> Result<Arc<Vec<Object>>, E> {
        let known = || self.known.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(found) = known().get(&[at[1], at[0]]) {
            return Ok(Arc::clone(found));
        }
        let made = Arc::new(make()?);
        let mut known = known();
        known.insert([at[1], at[0]], Arc::clone(&made));
        if known.len() > CACHED_PLOTS {
            // Slides are generated from the top: the first row is needed least.
            known.pop_first();
        }
        Ok(made)
    }
}

impl Population {
    /// Returns the population of the slide with this key, and the scene of the empty slide.
    pub(crate) fn new(recipe: &Recipe, model: &Model, key: Key) -> Result<(Self, Scene), ErrorKind> {
        let condition = recipe.condition_of_slide(key.seed, key.index);
        let recipe = &*recipe.under(condition);
        let slide = FieldNumbers { key };
        let stain = FieldStain::of_slide(&recipe.stain, &slide);
        let pixel_um = pixel_um(recipe, &slide);
        let view = View { width: 0, height: 0, pixel_um };
        let scene = Scene { condition, ..empty(recipe, view, &slide, &stain) };
        let middle = |number: &Number| number.bounds().iter().sum::<f64>() / 2.0;
        let field_px = middle(&recipe.field.width_px) * middle(&recipe.field.height_px);
        let relief_key = key.stream("slide", 0, "slide.relief").next_u64();
        let mut population = Self {
            recipe: recipe.clone(),
            model: model.clone(),
            key,
            pixel_um,
            share: (PLOT_PX * PLOT_PX) as f64 / field_px,
            spacing_um: slide.draw(named!(recipe.slide.spacing_um)),
            deposit: Deposit::draw(&recipe.scan.deposit, &slide),
            places: Places { clusters: None, outside: 1.0, reach: 0, mean: 1.0 },
            relief: Relief::new(
                slide.draw(named!(recipe.slide.depth_um)),
                slide.draw(named!(recipe.slide.depth_scale_um)),
                relief_key,
            ),
            sown: PlotCache::default(),
            plots: PlotCache::default(),
        };
        population.place_clusters(&slide)?;
        Ok((population, scene))
    }

    /// Returns the centre of the deposit, µm.
    pub(crate) fn middle_um(&self) -> [f64; 2] {
        self.deposit.centre_um()
    }

    fn side_um(&self) -> f64 {
        PLOT_PX as f64 * self.pixel_um
    }

    fn plot_mm2(&self) -> f64 {
        self.side_um() * self.side_um() * 1e-6
    }

    /// Prepares the layout.
    fn place_clusters(&mut self, slide: &FieldNumbers) -> Result<(), ErrorKind> {
        /// Largest number of plots that a cluster may reach beyond its own.
        const FARTHEST: i64 = 4;
        /// Number of places along a side for the mean weight, and of plots that contain them.
        const PLACES: i64 = 96;
        const ACROSS: i64 = 12;
        let layout = match &self.recipe.layout {
            Layout::Uniform {} => return Ok(()),
            Layout::Clusters(layout) => layout,
            _ => return Err(ErrorKind::LayoutOfField),
        };
        let largest = layout.radius_um.bounds()[1];
        let reach = round_to_count((CLUSTER_REACH * largest / self.side_um()).ceil()) as i64;
        if reach > FARTHEST {
            return Err(ErrorKind::WideClusters(largest, FARTHEST as f64 * self.side_um() / CLUSTER_REACH));
        }
        let outside = slide.draw(named!("layout", layout.outside));
        self.places = Places { clusters: Some(layout.clone()), outside, reach, mean: 1.0 };
        // The mean over an area that does not depend on the size of the slide.
        let mut sum = 0.0;
        for row in 0..ACROSS {
            for column in 0..ACROSS {
                let clusters = self.clusters([column, row]);
                let places = PLACES / ACROSS;
                for place in 0..places * places {
                    let local = [place % places, place / places].map(|at| (at as f64 + 0.5) / places as f64);
                    let um = [column, row].map(|at| at as f64 * self.side_um());
                    let place = [0, 1].map(|axis| um[axis] + local[axis] * self.side_um());
                    sum += weight(&clusters, outside, place);
                }
            }
        }
        self.places.mean = sum / (PLACES * PLACES) as f64;
        Ok(())
    }

    /// Returns the clusters that reach into a plot.
    fn clusters(&self, at: [i64; 2]) -> Vec<Cluster> {
        let Places { clusters: Some(layout), reach, .. } = &self.places else { return Vec::new() };
        let mut clusters = Vec::new();
        for row in at[1] - reach..=at[1] + reach {
            for column in at[0] - reach..=at[0] + reach {
                let field = FieldNumbers { key: self.key.plot(number([column, row])) };
                let count = named!("layout", layout.count);
                for cluster in 0..field.number_on_slide(count, [self.plot_mm2(), self.share], 1.0) {
                    let mut rng = field.key.stream("field", cluster, "layout.cluster");
                    let radius = layout.radius_um.draw(&mut rng);
                    let place = [column, row].map(|at| (at as f64 + random::uniform(&mut rng)) * self.side_um());
                    clusters.push([place[0], place[1], radius]);
                }
            }
        }
        clusters
    }

    /// Draws the cells of a plot, including those too near to cells of other plots.
    fn sow(&self, at: [i64; 2]) -> Vec<Object> {
        let field = FieldNumbers { key: self.key.plot(number(at)) };
        let slide = FieldNumbers { key: self.key };
        let stain = FieldStain::of_slide(&self.recipe.stain, &slide);
        let clusters = self.clusters(at);
        let Places { outside, mean, .. } = self.places;
        let side_um = self.side_um();
        let global = |place: [f64; 2]| [0, 1].map(|axis| place[axis] + at[axis] as f64 * side_um);
        let stays = |place: [f64; 2]| weight(&clusters, outside, place) * self.deposit.density(place) / DENSEST;
        let mut cells: Vec<Object> = Vec::new();
        let mut first: Vec<[f64; 2]> = Vec::new();
        let (mut tried, mut begun) = (0_u64, 0);
        for (name, mix) in &self.recipe.cells {
            // The engine has checked that the model has the class.
            let kind = Class { name, mix, class: &self.model.classes[name], texture: self.model.texture() };
            let path = format!("cells.{name}.count");
            let alone = mix.group.form == GroupForm::Single;
            let size = if alone { 1.0 } else { mean_of(&mix.group.size) };
            let factor = DENSEST / mean / size;
            for _ in 0..field.number_on_slide((&path, &mix.count), [self.plot_mm2(), self.share], factor) {
                let mut rng = field.key.stream("cell", tried, "origin");
                let origin = [0, 1].map(|_| random::between(0.0, side_um, &mut rng));
                let number = tried;
                tried += 1;
                if !random::chance(stays(global(origin)), &mut rng)
                    || first.iter().any(|other| near(*other, origin, self.spacing_um))
                {
                    continue;
                }
                first.push(origin);
                let mut groups = Groups::new(&mix.group, begun);
                // The numbers of members of a group are above those of all tries.
                let mut member = 0;
                loop {
                    let number = if member == 0 { number } else { number << 16 | 1 << 56 | member };
                    let cell = Drawn::new(&self.recipe, kind, &stain, field.key, number);
                    let mut place_rng = field.key.stream("cell", number, "place");
                    let Ok(place) = groups.next(cell.body.radius_um, |_| Ok::<_, Infallible>(origin), &mut place_rng);
                    let depth_um = self.relief.at(global(place.centre_um));
                    cells.push(cell.placed(kind, number, &place, depth_um));
                    member += 1;
                    if alone || groups.is_full() {
                        break;
                    }
                }
                begun = groups.begun();
            }
        }
        cells
    }

    fn sown(&self, at: [i64; 2]) -> Arc<Vec<Object>> {
        let Ok(sown) = self.sown.get(at, || Ok::<_, Infallible>(self.sow(at)));
        sown
    }

    /// Returns the objects of a plot, by id. Places are relative to the corner of the plot.
    pub(crate) fn plot(&self, at: [i64; 2]) -> Result<Arc<Vec<Object>>, ErrorKind> {
        self.plots.get(at, || self.draw(at))
    }

    fn draw(&self, at: [i64; 2]) -> Result<Vec<Object>, ErrorKind> {
        let number = number(at);
        let field = FieldNumbers { key: self.key.plot(number) };
        let slide = FieldNumbers { key: self.key };
        let stain = FieldStain::of_slide(&self.recipe.stain, &slide);
        let side_um = self.side_um();
        let mut objects = self.sown(at).as_ref().clone();
        // Of two cells of neighbouring plots that are too near to each other, that of the plot with the larger number
        // is removed.
        let mut taken = Vec::new();
        for [x, y] in [[-1, -1], [0, -1], [1, -1], [-1, 0]] {
            let corner = [x, y].map(|step: i64| step as f64 * side_um);
            let others = self.sown([at[0] + x, at[1] + y]);
            let places = others.iter().map(|other| [0, 1].map(|axis| other.centre_um[axis] + corner[axis]));
            taken.extend(places.filter(|place| place.iter().all(|v| *v > -self.spacing_um)));
        }
        objects.retain(|cell| {
            cell.cluster > 0 || !taken.iter().any(|other| near(*other, cell.centre_um, self.spacing_um))
        });
        let region = Region { low_um: [0.0; 2], size_um: [side_um; 2] };
        let stays = |place: [f64; 2]| {
            let place = [0, 1].map(|axis| place[axis] + at[axis] as f64 * side_um);
            self.deposit.density(place) / DENSEST
        };
        // Objects on the glass are not rejected, so that they need no additional tries.
        let plot_density = PlotDensity { area_in_fields: self.share, max_density: DENSEST, keep_probability: &stays };
        add_debris(&self.recipe.debris, [region; 2], &field, &stain, Some(plot_density), &mut objects);
        let most = (1 << OBJECT_BITS) - 2;
        if objects.len() > most {
            return Err(ErrorKind::FullPlot { side_px: PLOT_PX, found: objects.len(), most });
        }
        for (id, object) in (1_u32..).zip(&mut objects) {
            object.id = number << OBJECT_BITS | id;
            if object.cluster > 0 {
                object.cluster |= number << OBJECT_BITS;
            }
            object.plot = Some(Plot { number, at_px: [0; 2] });
        }
        Ok(objects)
    }
}

/// Radius of influence of a cluster, in its radii.
const CLUSTER_REACH: f64 = 4.3;

/// Returns the weight of a place, from `outside` to 1.
fn weight(clusters: &[Cluster], outside: f64, [x, y]: [f64; 2]) -> f64 {
    let square = |[cx, cy, radius]: &Cluster| ((x - cx) * (x - cx) + (y - cy) * (y - cy)) / (radius * radius);
    let nearest = clusters.iter().map(square).fold(f64::INFINITY, f64::min);
    let share = if nearest < CLUSTER_REACH * CLUSTER_REACH { libm::exp(-0.5 * nearest) } else { 0.0 };
    outside + (1.0 - outside) * share
}

/// Returns the number of a plot on its slide.
fn number([column, row]: [i64; 2]) -> u32 {
    let side = |at: i64| (at + BEYOND).clamp(0, (1 << SIDE_BITS) - 1) as u32;
    side(row) << SIDE_BITS | side(column)
}

/// Returns the mean of a drawn count of at least 1.
fn mean_of(number: &Number) -> f64 {
    const DRAWS: u64 = 256;
    let mut rng = Key { seed: 0, index: 0 }.stream("slide", 0, "mean");
    ((0..DRAWS).map(|_| number.draw_count(&mut rng).max(1) as f64).sum::<f64>()) / DRAWS as f64
}

impl Relief {
    fn new(depth_um: f64, cell_um: f64, key: u64) -> Self {
        /// Mean range of the noise over a field.
        const RANGE: f64 = 1.1;
        let params = FractalParams { octaves: 2, ..FractalParams::default() };
        let noise = Fractal::new(&params, key).expect("two octaves of noise are valid");
        Self { noise, cell_um, scale_um: depth_um / RANGE }
    }

    /// Returns the depth at a place of the slide, µm.
    fn at(&self, [x, y]: [f64; 2]) -> f64 {
        self.scale_um * f64::from(self.noise.at(x / self.cell_um, y / self.cell_um))
    }
}

/// Largest density, relative to the mean.
const DENSEST: f64 = 2.5;

/// The round deposit of a slide, with drawn numbers.
#[derive(Debug)]
struct Deposit {
    drawn: SceneDeposit,
    patches: Fractal,
}

impl Deposit {
    fn draw(section: &DepositSection, slide: &FieldNumbers) -> Self {
        let key = slide.key.stream("slide", 0, "scan.deposit.patches").next_u64();
        let params = FractalParams { octaves: 3, ..FractalParams::default() };
        Self {
            drawn: section.draw("scan.deposit", |path| slide.stream(path)),
            patches: Fractal::new(&params, key).expect("three octaves of noise are valid"),
        }
    }

    /// Returns its centre, µm.
    fn centre_um(&self) -> [f64; 2] {
        [self.drawn.x_um, self.drawn.y_um]
    }

    /// Returns the density at a place of the slide, relative to the mean inside the deposit; at most [`DENSEST`].
    fn density(&self, [x, y]: [f64; 2]) -> f64 {
        /// Standard deviation of the noise.
        const SPREAD: f64 = 0.27;
        let SceneDeposit {
            x_um,
            y_um,
            radius_um,
            edge_um,
            density_variation: sd,
            density_scale_um,
            outside_density: outside,
        } = self.drawn;
        let (dx, dy) = (x - x_um, y - y_um);
        let inside = (radius_um - (dx * dx + dy * dy).sqrt()) / edge_um;
        let share = (0.5 + 0.5 * inside).clamp(0.0, 1.0);
        let share = share * share * (3.0 - 2.0 * share);
        let noise = f64::from(self.patches.at(x / density_scale_um, y / density_scale_um)) / SPREAD;
        let uneven = libm::exp(sd * (noise - 0.5 * sd)).min(DENSEST);
        uneven * (outside + (1.0 - outside) * share)
    }
}
