use crate::batch::{Batch, Start, Topology};
use crate::mesh::Disc;
use crate::outline::{Inside, Outline};
use crate::params::check_excess;
use crate::refine::Refinement;
use crate::{ClothParams, Error, Point, Rng, Sheet, Solver, VerletParams, XpbdParams, rest};
use multiversion::multiversion;

/// Sheets solved side by side: as many as there are f32 in the widest registers.
const LANES: usize = 16;
/// Up to this many sheets are solved one by one: that takes less time than all lanes for a few.
const FEW: usize = 2;

/// A circular mesh, ready to be pressed into any number of outlines.
#[derive(Debug)]
pub struct Cloth {
    params: ClothParams,
    disc: Disc,
    topology: Topology,
    refinement: Refinement,
}

/// A sheet that is wanted.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Job<'a> {
    /// What it is pressed into: a simple polygon, either way round, of any unit.
    pub outline: &'a [Point],
    /// Area of the flat sheet over that of the outline, 1 to 4; see [`ClothParams::excess`].
    pub excess: f64,
}

/// An outline on its way to a sheet.
struct Task {
    outline: Outline,
    start: Start,
    offset: f64,
}

impl Cloth {
    /// Builds the mesh: the same for the same number of vertices.
    ///
    /// # Errors
    ///
    /// [`Error::Parameter`] names the first field outside its range.
    pub fn new(params: &ClothParams) -> Result<Cloth, Error> {
        params.check()?;
        let disc = Disc::new(params.vertices)?;
        let topology = Topology::new(&disc, rest::outline_points(&disc, params));
        let refinement = Refinement::new(&disc, params.smoothing);
        Ok(Cloth { params: params.clone(), disc, topology, refinement })
    }

    /// Presses one sheet into an outline: a simple polygon, either way round, of any unit.
    ///
    /// # Errors
    ///
    /// If the outline has fewer than 3 points, one that is not finite, or no area.
    pub fn crumple<R: Rng + ?Sized>(&self, outline: &[Point], rng: &mut R) -> Result<Sheet, Error> {
        let task = self.task(Job { outline, excess: self.params.excess }, rng)?;
        let mut sheets = self.solved(std::slice::from_ref(&task));
        sheets.pop().ok_or(Error::TooFewPoints { points: 0 })
    }

    /// Presses sheets into outlines, each with its own source of random numbers, many at a time: the quick way.
    /// Each result is that of [`Cloth::crumple`], bit by bit.
    ///
    /// # Errors
    ///
    /// Each outline has its own result; see [`Cloth::crumple`].
    ///
    /// # Panics
    ///
    /// If there are not as many sources as outlines.
    pub fn crumple_many<R: Rng>(&self, outlines: &[&[Point]], rngs: &mut [R]) -> Vec<Result<Sheet, Error>> {
        let excess = self.params.excess;
        let jobs: Vec<Job> = outlines.iter().map(|&outline| Job { outline, excess }).collect();
        self.crumple_each(&jobs, rngs)
    }

    /// The same, each sheet with an excess of its own.
    ///
    /// # Errors
    ///
    /// Each sheet has its own result; see [`Cloth::crumple`].
    ///
    /// # Panics
    ///
    /// If there are not as many sources as sheets.
    pub fn crumple_each<R: Rng>(&self, jobs: &[Job<'_>], rngs: &mut [R]) -> Vec<Result<Sheet, Error>> {
        assert_eq!(jobs.len(), rngs.len(), "each outline needs its own source of random numbers");
        let mut tasks = Vec::with_capacity(jobs.len());
        let mut errors = Vec::with_capacity(jobs.len());
        for (job, rng) in jobs.iter().zip(rngs) {
            match self.task(*job, rng) {
                Ok(task) => {
                    tasks.push(task);
                    errors.push(None);
                }
                Err(error) => errors.push(Some(error)),
            }
        }
        let mut sheets = tasks.chunks(LANES).flat_map(|chunk| self.solved(chunk));
        let mut next = || sheets.next().ok_or(Error::TooFewPoints { points: 0 });
        errors.into_iter().map(|error| error.map_or_else(&mut next, Err)).collect()
    }

    fn task<R: Rng + ?Sized>(&self, job: Job<'_>, rng: &mut R) -> Result<Task, Error> {
        check_excess(job.excess)?;
        let outline = Outline::new(job.outline)?;
        let (start, offset) = rest::start(&self.disc, &outline, job.excess, &self.params, rng);
        Ok(Task { outline, start, offset })
    }

    /// Up to [`LANES`] tasks.
    fn solved(&self, tasks: &[Task]) -> Vec<Sheet> {
        if tasks.len() <= FEW {
            tasks.iter().map(|task| self.finished(task, &self.run(&[&task.start], narrow).lane(0))).collect()
        } else {
            let starts: Vec<&Start> = tasks.iter().map(|t| &t.start).collect();
            let batch = self.run(&starts, wide);
            tasks.iter().enumerate().map(|(l, task)| self.finished(task, &batch.lane(l))).collect()
        }
    }

    fn run<const L: usize>(
        &self,
        starts: &[&Start],
        solve: fn(&mut Batch<f32, L>, &Topology, &ClothParams),
    ) -> Batch<f32, L> {
        let mut batch = Batch::new(&self.topology, starts);
        solve(&mut batch, &self.topology, &self.params);
        batch
    }

    fn finished(&self, task: &Task, vertices: &[crate::Vertex]) -> Sheet {
        let mut parts = self.refinement.apply(vertices, &task.start.rest);
        let hemmed = matches!(self.params.solver, Solver::Xpbd(_));
        if hemmed {
            self.refinement.hem(&mut parts, &task.outline, task.offset);
        }
        let Outline { points, centre, radius } = &task.outline;
        let inside = Inside::new(points);
        for (v, &from_centre) in parts.vertices.iter_mut().zip(parts.radius.iter()) {
            // The hem lies on the outline already.
            let [x, y] = if hemmed && from_centre == 1.0 { [v[0], v[1]] } else { inside.nearest([v[0], v[1]]) };
            *v = [centre[0] + radius * x, centre[1] + radius * y, radius * v[2]];
        }
        for r in &mut parts.rest {
            *r = r.map(|c| c * radius);
        }
        Sheet::new(parts, (!hemmed).then(|| self.refinement.edges()))
    }
}

fn narrow(batch: &mut Batch<f32, 1>, topology: &Topology, params: &ClothParams) {
    match &params.solver {
        Solver::Verlet(p) => batch.verlet(topology, params.steps, p),
        Solver::Xpbd(p) => batch.xpbd(topology, params.steps, p),
    }
}

fn wide(batch: &mut Batch<f32, LANES>, topology: &Topology, params: &ClothParams) {
    match &params.solver {
        Solver::Verlet(p) => verlet_wide(batch, topology, params.steps, p),
        Solver::Xpbd(p) => xpbd_wide(batch, topology, params.steps, p),
    }
}

// The same plain loops, compiled for each instruction set; nothing is contracted, so that all give the same bits.

#[multiversion(targets = "simd")]
fn verlet_wide(batch: &mut Batch<f32, LANES>, topology: &Topology, steps: usize, params: &VerletParams) {
    batch.verlet(topology, steps, params);
}

#[multiversion(targets = "simd")]
fn xpbd_wide(batch: &mut Batch<f32, LANES>, topology: &Topology, steps: usize, params: &XpbdParams) {
    batch.xpbd(topology, steps, params);
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::cross;
    use crate::outline::{distance, sides};
    use crate::testing::{angular, area, rng, wavy};
    use crate::{Rest, Vertex};

    fn few() -> ClothParams {
        ClothParams { vertices: 300, ..ClothParams::default() }
    }

    fn outlines() -> Vec<Vec<Point>> {
        vec![wavy(3.0, 0.2), angular(), wavy(7.0, 0.1), vec![[0.0, 0.0], [3.0, 0.2], [1.0, 4.0]], wavy(2.0, 0.5)]
    }

    fn task(cloth: &Cloth, outline: &[Point], seed: u64) -> Task {
        cloth.task(Job { outline, excess: cloth.params.excess }, &mut rng(seed)).unwrap()
    }

    /// How far outside the polygon a point is.
    fn outside(polygon: &[Point], v: &Vertex) -> f64 {
        let p = [v[0], v[1]];
        distance(p, Inside::new(polygon).nearest(p))
    }

    #[test]
    fn law_24_sheets_stay_where_they_belong() {
        let xpbd = |p: &ClothParams| match &p.solver {
            Solver::Xpbd(x) => x.ceiling,
            Solver::Verlet(_) => f64::INFINITY,
        };
        let both = [
            few(),
            ClothParams::paper(),
            ClothParams { rest: Rest::Disc, smoothing: crate::Smoothing::Loop, ..few() },
            ClothParams { rest: Rest::Outline, excess: 1.3, ..ClothParams::paper() },
        ];
        for params in both {
            let cloth = Cloth::new(&params).unwrap();
            for outline in outlines() {
                let size = (area(&outline).abs() / std::f64::consts::PI).sqrt();
                let sheet = cloth.crumple(&outline, &mut rng(6)).unwrap();
                for v in sheet.vertices() {
                    assert!(
                        outside(&outline, v) < 1e-6 * size
                            && v[2] >= 0.0
                            && v[2] <= xpbd(&params) * size * (1.0 + 1e-6),
                        "{v:?}"
                    );
                }
            }
        }
    }

    #[test]
    fn law_24_a_sheet_is_hardly_stretched() {
        let cloth = Cloth::new(&ClothParams { excess: 1.12, ..ClothParams::default() }).unwrap();
        let outline = wavy(2.0, 0.08);
        for stream in 7..10 {
            let sheet = cloth.crumple(&outline, &mut rng(stream)).unwrap();
            assert!(sheet.edge_strain_rms() < 0.03, "{}", sheet.edge_strain_rms());
            assert!(
                (sheet.rest_area() / area(&outline) - 1.12).abs() < 0.005,
                "{}",
                sheet.rest_area() / area(&outline)
            );
        }
    }

    #[test]
    fn the_default_sheet_ends_exactly_on_its_outline() {
        for smoothing in [crate::Smoothing::None, crate::Smoothing::Loop] {
            let cloth = Cloth::new(&ClothParams { smoothing, ..few() }).unwrap();
            for outline in outlines() {
                let sheet = cloth.crumple(&outline, &mut rng(10)).unwrap();
                // Green: the signed areas of all triangles add up to what the rim encloses.
                let shadow: f64 = sheet
                    .triangles()
                    .iter()
                    .map(|t| t.map(|v| [sheet.vertices()[v as usize][0], sheet.vertices()[v as usize][1]]))
                    .map(|[a, b, c]| cross(a, b, c) / 2.0)
                    .sum();
                assert!((shadow / area(&outline).abs() - 1.0).abs() < 1e-9, "{shadow}");
                for (a, _) in sides(&outline) {
                    assert!(sheet.vertices().iter().any(|v| distance([v[0], v[1]], a) < 1e-6));
                }
            }
        }
    }

    #[test]
    fn a_sheets_bits_depend_on_itself_alone() {
        for params in [few(), ClothParams { vertices: 300, ..ClothParams::paper() }] {
            let cloth = Cloth::new(&params).unwrap();
            let outlines: Vec<Vec<Point>> =
                (0..18_u8).map(|k| wavy(2.0 + f64::from(k % 4), 0.02 * f64::from(k % 7))).collect();
            let borrowed: Vec<&[Point]> = outlines.iter().map(Vec::as_slice).collect();
            let mut rngs: Vec<_> = (0..18).map(rng).collect();
            let together = cloth.crumple_many(&borrowed, &mut rngs);
            for (k, sheet) in together.iter().enumerate() {
                let alone = cloth.crumple(borrowed[k], &mut rng(k as u64)).unwrap();
                assert_eq!(sheet.as_ref().unwrap(), &alone, "sheet {k}");
            }
            let other = cloth.crumple(borrowed[0], &mut rng(99)).unwrap();
            assert_ne!(&other, together[0].as_ref().unwrap());
        }
    }

    #[test]
    fn each_sheet_has_its_own_excess() {
        let (plain, outline) = (Cloth::new(&few()).unwrap(), wavy(3.0, 0.1));
        let excesses = [1.02, 1.3, 5.0, 1.15];
        let jobs = excesses.map(|excess| Job { outline: &outline, excess });
        let sheets = plain.crumple_each(&jobs, &mut [0, 1, 2, 3].map(rng));
        for (k, excess) in excesses.into_iter().enumerate() {
            let alone =
                Cloth::new(&ClothParams { excess, ..few() }).and_then(|c| c.crumple(&outline, &mut rng(k as u64)));
            assert_eq!(sheets[k], alone, "{excess}");
        }
    }

    #[test]
    fn errors_stay_with_their_outline() {
        let cloth = Cloth::new(&few()).unwrap();
        let good = wavy(3.0, 0.1);
        let mut rngs: Vec<_> = (0..3).map(rng).collect();
        let results = cloth.crumple_many(&[&good, &good[..2], &good], &mut rngs);
        assert_eq!(results[0].as_ref().unwrap(), &cloth.crumple(&good, &mut rng(0)).unwrap());
        assert_eq!(results[1], Err(Error::TooFewPoints { points: 2 }));
        assert_eq!(results[2].as_ref().unwrap(), &cloth.crumple(&good, &mut rng(2)).unwrap());
        assert!(cloth.crumple_many::<rand_xoshiro::Xoshiro256PlusPlus>(&[], &mut []).is_empty());
    }

    #[test]
    fn size_and_place_do_not_matter() {
        let cloth = Cloth::new(&few()).unwrap();
        let outline = wavy(3.0, 0.15);
        // Powers of two, so that rounding is the same too.
        let other: Vec<Point> = outline.iter().map(|p| p.map(|c| c / 64.0)).collect();
        let (a, b) = (cloth.crumple(&outline, &mut rng(11)).unwrap(), cloth.crumple(&other, &mut rng(11)).unwrap());
        for (p, q) in a.vertices().iter().zip(b.vertices()) {
            assert!((0..3).all(|axis| (p[axis] - 64.0 * q[axis]).abs() < 1e-9));
        }
    }

    /// The paper's solver, one sheet in f64, every vertex against every side.
    fn slow_verlet(topology: &Topology, start: &Start, steps: usize, p: &VerletParams) -> Vec<Vertex> {
        let mut now: Vec<Vertex> = start.rest.iter().zip(&start.heights).map(|(r, &h)| [r[0], r[1], h]).collect();
        let (mut before, mut ring) = (now.clone(), start.outline[0].clone());
        let mut ring_before = ring.clone();
        for _ in 0..steps {
            for _ in 0..p.passes {
                for &[a, b] in topology.edges.iter().flatten() {
                    let (a, b) = (a as usize, b as usize);
                    let d: Vertex = std::array::from_fn(|i| now[b][i] - now[a][i]);
                    let length = (d[0] * d[0] + d[1] * d[1] + d[2] * d[2]).sqrt();
                    let part = 0.5 * (1.0 - distance(start.rest[a], start.rest[b]) / length);
                    for axis in 0..3 {
                        now[a][axis] += part * d[axis];
                        now[b][axis] -= part * d[axis];
                    }
                }
            }
            for ((r, b), target) in ring.iter_mut().zip(&mut ring_before).zip(&start.outline[1]) {
                let next: Point = std::array::from_fn(|i| {
                    r[i] + (r[i] - b[i]) * (1.0 - p.damping) + (target[i] - r[i]) * p.attraction * p.dt_squared
                });
                (*b, *r) = (*r, next);
            }
            let inside = Inside::new(&ring);
            for (n, b) in now.iter_mut().zip(&mut before) {
                let next: Vertex = std::array::from_fn(|i| n[i] + (n[i] - b[i]) * (1.0 - p.damping));
                let [x, y] = inside.nearest([next[0], next[1]]);
                (*b, *n) = (*n, [x, y, (next[2] - p.gravity * p.dt_squared).max(0.0)]);
            }
        }
        now
    }

    #[test]
    fn lanes_agree_with_the_slow_solver() {
        let params = ClothParams::paper();
        let cloth = Cloth::new(&params).unwrap();
        let Solver::Verlet(verlet) = &params.solver else { panic!("not the paper's solver") };
        let tasks: Vec<Task> = (0..4_u8).map(|k| task(&cloth, &wavy(2.0 + f64::from(k), 0.08), u64::from(k))).collect();
        let starts: Vec<&Start> = tasks.iter().map(|t| &t.start).collect();
        let batch = cloth.run(&starts, wide);
        for (l, start) in starts.iter().enumerate() {
            let slow = slow_verlet(&cloth.topology, start, params.steps, verlet);
            let apart: f64 = batch
                .lane(l)
                .iter()
                .zip(&slow)
                .map(|(p, q)| (0..3).map(|i| (p[i] - q[i]) * (p[i] - q[i])).sum::<f64>())
                .sum();
            #[expect(clippy::cast_precision_loss, reason = "a small count")]
            let rms = (apart / slow.len() as f64).sqrt();
            assert!(rms < 1e-3, "lane {l}: {rms}");
        }
    }

    #[test]
    fn f32_lanes_agree_with_f64() {
        let params = ClothParams { steps: 12, ..few() };
        let Solver::Xpbd(xpbd) = &params.solver else { panic!("not the default solver") };
        let cloth = Cloth::new(&params).unwrap();
        let task = task(&cloth, &wavy(3.0, 0.1), 12);
        let mut exact = Batch::<f64, 1>::new(&cloth.topology, &[&task.start]);
        exact.xpbd(&cloth.topology, params.steps, xpbd);
        let lanes = cloth.run(&[&task.start, &task.start], wide);
        for (p, q) in lanes.lane(1).iter().zip(exact.lane(0)) {
            assert!((0..3).all(|i| (p[i] - q[i]).abs() < 1e-3), "{p:?} {q:?}");
        }
    }
}
