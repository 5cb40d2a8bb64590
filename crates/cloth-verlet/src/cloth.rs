use crate::batch::{Batch, Flat, Phase, Start, Topology};
use crate::coarse::CoarseMesh;
use crate::mesh::Disc;
use crate::outline::{Inside, Outline};
use crate::params::check_area_ratio;
use crate::refine::Refinement;
use crate::{ClothParams, Error, Point, Rng, Sheet, Solver, Vertex, rest};
use multiversion::multiversion;

/// Sheets solved at once: the number of f32 in the widest registers.
const LANES: usize = 16;
/// Lanes of a batch of at most this many sheets.
const HALF: usize = LANES / 2;

/// A circular mesh that can be crumpled into any number of outlines.
#[derive(Debug)]
pub struct Cloth {
    params: ClothParams,
    disc: Disc,
    topology: Topology,
    refinement: Refinement,
    coarse: Option<CoarseMesh>,
    /// The steps on the full mesh.
    phase: Phase,
}

/// Outline and area of one sheet of [`Cloth::crumple_each`].
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SheetSpec<'a> {
    /// The target outline: a simple polygon in either orientation, in any unit.
    pub outline: &'a [Point],
    /// Ratio of the areas of flat sheet and outline, 1 to 4; see [`ClothParams::area_ratio`].
    pub area_ratio: f64,
}

impl Cloth {
    /// Builds the mesh, which depends only on the number of vertices.
    ///
    /// # Errors
    ///
    /// [`Error::Parameter`] with the first field that is out of range.
    pub fn new(params: &ClothParams) -> Result<Cloth, Error> {
        params.check()?;
        let disc = Disc::new(params.vertices)?;
        let topology = Topology::new(&disc, rest::outline_points(&disc, params), &params.solver);
        let refinement = Refinement::new(&disc, params.smoothing);
        let [first, phase] = phases(params);
        let coarse = if first.steps.is_empty() { None } else { Some(CoarseMesh::new(&disc, first, &params.solver)?) };
        Ok(Cloth { params: params.clone(), disc, topology, refinement, coarse, phase })
    }

    /// Crumples one sheet into an outline: a simple polygon in either orientation, in any unit.
    ///
    /// # Errors
    ///
    /// If the outline has fewer than 3 points, a point that is not finite, or no area.
    pub fn crumple<R: Rng + ?Sized>(&self, outline: &[Point], rng: &mut R) -> Result<Sheet, Error> {
        let start = self.start(SheetSpec { outline, area_ratio: self.params.area_ratio }, rng)?;
        self.solved(&[&start]).pop().ok_or(Error::TooFewPoints { points: 0 })
    }

    /// Crumples several sheets, each with its own random number generator. Sixteen are solved at once, which is faster
    /// than one by one. Each result or error equals that of [`Cloth::crumple`], bit for bit.
    ///
    /// # Panics
    ///
    /// If the numbers of outlines and generators differ.
    pub fn crumple_many<R: Rng>(&self, outlines: &[&[Point]], rngs: &mut [R]) -> Vec<Result<Sheet, Error>> {
        let area_ratio = self.params.area_ratio;
        let specs: Vec<SheetSpec> = outlines.iter().map(|&outline| SheetSpec { outline, area_ratio }).collect();
        self.crumple_each(&specs, rngs)
    }

    /// Crumples several sheets like [`Cloth::crumple_many`], each with its own area ratio.
    ///
    /// # Panics
    ///
    /// If the numbers of sheets and generators differ.
    pub fn crumple_each<R: Rng>(&self, specs: &[SheetSpec<'_>], rngs: &mut [R]) -> Vec<Result<Sheet, Error>> {
        assert_eq!(specs.len(), rngs.len(), "the numbers of outlines and generators differ");
        let starts: Vec<Result<Start, Error>> =
            specs.iter().zip(rngs).map(|(spec, rng)| self.start(*spec, rng)).collect();
        let good: Vec<&Start> = starts.iter().flatten().collect();
        let mut sheets = good.chunks(LANES).flat_map(|chunk| self.solved(chunk));
        let mut next = |_: &Start| sheets.next().ok_or(Error::TooFewPoints { points: 0 });
        starts.iter().map(|start| start.as_ref().map_err(Error::clone).and_then(&mut next)).collect()
    }

    fn start<R: Rng + ?Sized>(&self, spec: SheetSpec<'_>, rng: &mut R) -> Result<Start, Error> {
        check_area_ratio(spec.area_ratio)?;
        Ok(rest::start(&self.disc, Outline::new(spec.outline)?, spec.area_ratio, &self.params, rng))
    }

    /// Solves up to [`LANES`] sheets.
    fn solved(&self, starts: &[&Start]) -> Vec<Sheet> {
        match starts.len() {
            1 => self.solved_in_lanes::<1>(starts),
            2..=HALF => self.solved_in_lanes::<HALF>(starts),
            _ => self.solved_in_lanes::<LANES>(starts),
        }
    }

    fn solved_in_lanes<const L: usize>(&self, starts: &[&Start]) -> Vec<Sheet> {
        let flats: Vec<&Flat> = starts.iter().map(|start| &start.flat).collect();
        let batch = self.run::<L>(&flats);
        starts.iter().enumerate().map(|(l, start)| self.finished(start, &batch.lane(l))).collect()
    }

    fn run<const L: usize>(&self, flats: &[&Flat]) -> Batch<L> {
        let Cloth { params, topology, coarse, phase, .. } = self;
        let mut batch = Batch::new(topology, flats);
        if let Some(coarse) = coarse {
            let run = |batch: &mut Batch<L>| solve(batch, &coarse.topology, &coarse.phase, params);
            coarse.advance(&mut batch, flats, phase.substeps, run);
        }
        solve(&mut batch, topology, phase, params);
        batch
    }

    fn finished(&self, start: &Start, vertices: &[Vertex]) -> Sheet {
        let mut sheet = self.refinement.apply(vertices, &start.flat.rest);
        let rim_on_outline = matches!(self.params.solver, Solver::Xpbd(_));
        if rim_on_outline {
            self.refinement.snap_rim(&mut sheet, &start.shape, start.offset);
        }
        let Outline { points, centre, radius } = &start.shape;
        let inside = Inside::new(points);
        for (v, &from_centre) in sheet.vertices.iter_mut().zip(sheet.radius.iter()) {
            // The rim is already on the outline.
            let [x, y] = if rim_on_outline && from_centre == 1.0 { [v[0], v[1]] } else { inside.nearest([v[0], v[1]]) };
            *v = [centre[0] + radius * x, centre[1] + radius * y, radius * v[2]];
        }
        for r in &mut sheet.rest {
            *r = r.map(|c| c * radius);
        }
        sheet
    }
}

/// Returns the steps on the coarse mesh and those on the full mesh.
#[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "a number of steps")]
fn phases(params: &ClothParams) -> [Phase; 2] {
    let all = params.steps;
    let (coarse, substeps) = match &params.solver {
        Solver::Verlet(_) => (0, 1),
        Solver::Xpbd(p) => ((p.coarse_fraction * all as f64).round() as usize, p.substeps),
    };
    [Phase { steps: 0..coarse, all, substeps: 1 }, Phase { steps: coarse..all, all, substeps }]
}

/// Compiled for each instruction set. No operations are fused, so that all give the same bits.
#[multiversion(targets = "simd")]
fn solve<const L: usize>(batch: &mut Batch<L>, topology: &Topology, phase: &Phase, params: &ClothParams) {
    match &params.solver {
        Solver::Verlet(p) => batch.verlet(topology, phase.all, p),
        Solver::Xpbd(p) => batch.xpbd(topology, phase, p),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::batch::{Group, Kind};
    use crate::outline::{distance, moments, sides};
    use crate::refine::mean;
    use crate::sheet::cross;
    use crate::testing::{angular, rng, wavy};
    use crate::{PixelGrid, RestShape, XpbdParams};

    fn coarse() -> ClothParams {
        ClothParams { vertices: 300, ..ClothParams::default() }
    }

    fn outlines() -> Vec<Vec<Point>> {
        vec![wavy(3.0, 0.2), angular(), wavy(7.0, 0.1), vec![[0.0, 0.0], [3.0, 0.2], [1.0, 4.0]], wavy(2.0, 0.5)]
    }

    /// Returns the distance of a point from the polygon, 0 inside.
    fn outside(polygon: &[Point], v: &Vertex) -> f64 {
        let p = [v[0], v[1]];
        distance(p, Inside::new(polygon).nearest(p))
    }

    #[test]
    fn sheets_stay_inside_the_outline_and_below_the_ceiling() {
        let both = [
            coarse(),
            ClothParams::paper(),
            ClothParams { rest_shape: RestShape::Disc, smoothing: crate::Smoothing::Loop, ..coarse() },
            ClothParams { rest_shape: RestShape::Outline, area_ratio: 1.3, ..ClothParams::paper() },
        ];
        for params in both {
            let cloth = Cloth::new(&params).unwrap();
            let ceiling = if let Solver::Xpbd(x) = &params.solver { x.ceiling } else { f64::INFINITY };
            for outline in outlines() {
                let size = (moments(&outline).0.abs() / std::f64::consts::PI).sqrt();
                let sheet = cloth.crumple(&outline, &mut rng(6)).unwrap();
                for v in sheet.vertices() {
                    let most = ceiling * size * (1.0 + 1e-6);
                    assert!(outside(&outline, v) < 1e-6 * size && (0.0..=most).contains(&v[2]), "{v:?}");
                }
            }
        }
    }

    #[test]
    fn a_sheet_is_hardly_stretched() {
        let cloth = Cloth::new(&ClothParams { area_ratio: 1.12, ..ClothParams::default() }).unwrap();
        let outline = wavy(2.0, 0.08);
        for stream in 7..10 {
            let sheet = cloth.crumple(&outline, &mut rng(stream)).unwrap();
            let (strain, area_ratio) = (sheet.edge_strain_rms(), sheet.rest_area() / moments(&outline).0);
            assert!(strain < 0.03 && (area_ratio - 1.12).abs() < 0.005, "{strain} {area_ratio}");
        }
    }

    #[test]
    fn the_coarse_mesh_hardly_changes_the_folds() {
        const SHEETS: u64 = 64;
        // Means over sheets of the strain, and of the spread and the dark part of the thickness.
        let statistics = |coarse_fraction: f64| -> [f64; 3] {
            let solver = Solver::Xpbd(XpbdParams { coarse_fraction, ..XpbdParams::default() });
            let cloth = Cloth::new(&ClothParams { solver, ..ClothParams::default() }).unwrap();
            let outlines: Vec<Vec<Point>> = (0..SHEETS).map(|k| wavy(2.0 + (k % 4) as f64, 0.1)).collect();
            let borrowed: Vec<&[Point]> = outlines.iter().map(Vec::as_slice).collect();
            let mut sums = [0.0; 3];
            for sheet in cloth.crumple_many(&borrowed, &mut (0..SHEETS).map(rng).collect::<Vec<_>>()) {
                let sheet = sheet.unwrap();
                let mut image = vec![0.0_f32; 230 * 230];
                let grid = PixelGrid { origin: [-85.0, -135.0], pixel_size: 1.0 };
                sheet.thickness_into(&mut image, 230, &grid, |_| 1.0);
                let inner: Vec<f64> = image.iter().filter(|t| **t > 0.9).map(|&t| f64::from(t)).collect();
                let mean = inner.iter().sum::<f64>() / inner.len() as f64;
                let variance = inner.iter().map(|t| (t - mean) * (t - mean)).sum::<f64>() / inner.len() as f64;
                let dark = inner.iter().filter(|t| **t > 1.5).count() as f64 / inner.len() as f64;
                for (sum, value) in sums.iter_mut().zip([sheet.edge_strain_rms(), variance.sqrt(), dark]) {
                    *sum += value / SHEETS as f64;
                }
            }
            sums
        };
        let (with, without) = (statistics(2.0 / 3.0), statistics(0.0));
        assert!(with.iter().zip(without).all(|(a, b)| (a / b - 1.0).abs() < 0.1), "{with:?} {without:?}");
    }

    #[test]
    fn the_rim_of_the_default_sheet_is_the_outline() {
        for smoothing in [crate::Smoothing::None, crate::Smoothing::Loop] {
            let cloth = Cloth::new(&ClothParams { smoothing, ..coarse() }).unwrap();
            for outline in outlines() {
                let sheet = cloth.crumple(&outline, &mut rng(10)).unwrap();
                // Green's theorem: the signed areas of all triangles add up to the area inside the rim.
                let shadow: f64 = sheet
                    .triangles()
                    .iter()
                    .map(|t| t.map(|v| [sheet.vertices()[v as usize][0], sheet.vertices()[v as usize][1]]))
                    .map(|[a, b, c]| cross(a, b, c) / 2.0)
                    .sum();
                assert!((shadow / moments(&outline).0.abs() - 1.0).abs() < 1e-9, "{shadow}");
                for (a, _) in sides(&outline) {
                    assert!(sheet.vertices().iter().any(|v| distance([v[0], v[1]], a) < 1e-6));
                }
            }
        }
    }

    #[test]
    fn the_bits_of_a_sheet_do_not_depend_on_its_batch() {
        for params in [coarse(), ClothParams { vertices: 300, ..ClothParams::paper() }] {
            let cloth = Cloth::new(&params).unwrap();
            // One batch of all lanes, and one of half of them.
            let outlines: Vec<Vec<Point>> =
                (0..22_u8).map(|k| wavy(2.0 + f64::from(k % 4), 0.02 * f64::from(k % 7))).collect();
            let borrowed: Vec<&[Point]> = outlines.iter().map(Vec::as_slice).collect();
            let mut rngs: Vec<_> = (0..22).map(rng).collect();
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
    fn each_sheet_has_its_own_area_ratio_and_its_own_error() {
        let (plain, outline) = (Cloth::new(&coarse()).unwrap(), wavy(3.0, 0.1));
        let cases = [(1.02, 200), (1.3, 200), (5.0, 200), (1.15, 2), (1.15, 200)];
        let specs = cases.map(|(area_ratio, points)| SheetSpec { outline: &outline[..points], area_ratio });
        let sheets = plain.crumple_each(&specs, &mut [0, 1, 2, 3, 4].map(rng));
        for (k, spec) in specs.iter().enumerate() {
            let own = Cloth::new(&ClothParams { area_ratio: spec.area_ratio, ..coarse() });
            assert_eq!(sheets[k], own.and_then(|c| c.crumple(spec.outline, &mut rng(k as u64))), "{k}");
        }
        assert_eq!(sheets[3], Err(Error::TooFewPoints { points: 2 }));
        assert!(plain.crumple_many::<rand_xoshiro::Xoshiro256PlusPlus>(&[], &mut []).is_empty());
    }

    #[test]
    fn the_result_does_not_depend_on_scale() {
        let cloth = Cloth::new(&coarse()).unwrap();
        let outline = wavy(3.0, 0.15);
        // A power of two, so that rounding errors are the same.
        let other: Vec<Point> = outline.iter().map(|p| p.map(|c| c / 64.0)).collect();
        let (a, b) = (cloth.crumple(&outline, &mut rng(11)).unwrap(), cloth.crumple(&other, &mut rng(11)).unwrap());
        for (p, q) in a.vertices().iter().zip(b.vertices()) {
            assert!((0..3).all(|axis| (p[axis] - 64.0 * q[axis]).abs() < 1e-9));
        }
    }

    /// Reference implementation of both solvers: one sheet in f64, every vertex against every side.
    fn reference(cloth: &Cloth, flat: &Flat) -> Vec<Vertex> {
        let at = |flat: &Flat| -> Vec<Vertex> {
            flat.rest.iter().zip(&flat.heights).map(|(r, &h)| [r[0], r[1], h]).collect()
        };
        let (start, substeps) = (at(flat), cloth.phase.substeps);
        let Some(coarse) = &cloth.coarse else {
            return reference_steps(&cloth.params, &cloth.topology, &cloth.phase, flat, [start.clone(), start])[0]
                .clone();
        };
        let small = coarse.flat(flat);
        let begin = at(&small);
        let moved =
            reference_steps(&cloth.params, &coarse.topology, &coarse.phase, &small, [begin.clone(), begin.clone()]);
        // Displacement since the start and in the last substep, for each coarse vertex.
        let change = |from: &[Vertex]| -> Vec<Vertex> {
            moved[0].iter().zip(from).map(|(p, q)| std::array::from_fn(|i| p[i] - q[i])).collect()
        };
        let fine = |values: &[Vertex]| -> Vec<Vertex> { mean(&coarse.to_fine, values).collect() };
        let (way, last) = (fine(&change(&begin)), fine(&change(&moved[1])));
        let now: Vec<Vertex> = start.iter().zip(&way).map(|(p, w)| std::array::from_fn(|i| p[i] + w[i])).collect();
        let slow = |(p, v): (&Vertex, &Vertex)| -> Vertex { std::array::from_fn(|i| p[i] - v[i] / substeps as f64) };
        let before = now.iter().zip(&last).map(slow).collect();
        reference_steps(&cloth.params, &cloth.topology, &cloth.phase, flat, [now, before])[0].clone()
    }

    /// Runs the steps of `phase` from the last two positions. Returns the new last two.
    fn reference_steps(
        params: &ClothParams,
        topology: &Topology,
        phase: &Phase,
        flat: &Flat,
        [mut now, mut before]: [Vec<Vertex>; 2],
    ) -> [Vec<Vertex>; 2] {
        let [mut ring, target] = flat.outline.clone();
        let mut ring_before = ring.clone();
        let project =
            |now: &mut [Vertex], pairs: &[[u32; 2]], weights: [f64; 2], compliance: f64, yield_strain: f64| {
                let gain = 1.0 / (weights[0] + weights[1] + compliance);
                for &[a, b] in pairs {
                    let (a, b) = (a as usize, b as usize);
                    let d: Vertex = std::array::from_fn(|i| now[b][i] - now[a][i]);
                    let length = (d[0] * d[0] + d[1] * d[1] + d[2] * d[2]).sqrt();
                    let part = gain * (1.0 - distance(flat.rest[a], flat.rest[b]) / length).max(-yield_strain);
                    for axis in 0..3 {
                        now[a][axis] += weights[0] * part * d[axis];
                        now[b][axis] -= weights[1] * part * d[axis];
                    }
                }
            };
        let advance = |now: &mut [Vertex], before: &mut [Vertex], keep: f64, gravity: f64| {
            for (n, b) in now.iter_mut().zip(before) {
                let next: Vertex = std::array::from_fn(|i| n[i] + (n[i] - b[i]) * keep);
                (*b, *n) = (*n, [next[0], next[1], next[2] - gravity]);
            }
        };
        let confine = |now: &mut [Vertex], ring: Option<&[Point]>, ceiling: f64| {
            let inside = ring.map(Inside::new);
            for n in now {
                let [x, y] = inside.as_ref().map_or([n[0], n[1]], |inside| inside.nearest([n[0], n[1]]));
                *n = [x, y, n[2].clamp(0.0, ceiling)];
            }
        };
        match &params.solver {
            Solver::Verlet(p) => {
                for _ in 0..params.steps {
                    for group in std::iter::repeat_n(&topology.groups, p.passes).flatten() {
                        project(&mut now, &group.pairs, [1.0; 2], 0.0, f64::INFINITY);
                    }
                    for ((r, b), target) in ring.iter_mut().zip(&mut ring_before).zip(&target) {
                        let next: Point = std::array::from_fn(|i| {
                            r[i] + (r[i] - b[i]) * (1.0 - p.damping) + (target[i] - r[i]) * p.attraction * p.dt_squared
                        });
                        (*b, *r) = (*r, next);
                    }
                    advance(&mut now, &mut before, 1.0 - p.damping, p.gravity * p.dt_squared);
                    confine(&mut now, Some(&ring), f64::INFINITY);
                }
            }
            Solver::Xpbd(p) => {
                let (rim, small) = (topology.rim, phase.substeps as f64);
                for substep in phase.steps.start * phase.substeps + 1..=phase.steps.end * phase.substeps {
                    let s = substep as f64 / (phase.all as f64 * small);
                    for (k, (a, b)) in flat.outline[0].iter().zip(&target).enumerate() {
                        ring[k] = [0, 1].map(|i| a[i] + (b[i] - a[i]) * s * s * (3.0 - 2.0 * s));
                        now[k] = [ring[k][0], ring[k][1], now[k][2]];
                    }
                    let keep = libm::pow(1.0 - p.damping, 1.0 / small);
                    advance(&mut now[rim..], &mut before[rim..], keep, p.gravity / small / small);
                    for Group { kind, fixed, pairs } in &topology.groups {
                        let (compliance, yield_strain) = match kind {
                            Kind::Stretch => (p.stretch_compliance, f64::INFINITY),
                            Kind::Bend => (p.bend_compliance, p.bend_yield),
                        };
                        let weights = if *fixed { [0.0, 1.0] } else { [1.0, 1.0] };
                        project(&mut now, pairs, weights, compliance * small * small, yield_strain);
                    }
                    let pressed = substep.is_multiple_of(phase.substeps);
                    confine(&mut now[rim..], pressed.then_some(&ring), p.ceiling);
                }
            }
        }
        [now, before]
    }

    #[test]
    fn lanes_agree_with_the_reference_solvers() {
        for params in [ClothParams::paper(), ClothParams { steps: 12, ..coarse() }] {
            let cloth = Cloth::new(&params).unwrap();
            let start = |k: u8| {
                let (outline, area_ratio) = (wavy(2.0 + f64::from(k), 0.08), params.area_ratio);
                cloth.start(SheetSpec { outline: &outline, area_ratio }, &mut rng(u64::from(k))).unwrap()
            };
            let starts: Vec<Start> = (0..4).map(start).collect();
            let batch = cloth.run::<LANES>(&starts.iter().map(|start| &start.flat).collect::<Vec<_>>());
            for (l, start) in starts.iter().enumerate() {
                let (found, reference) = (batch.lane(l), reference(&cloth, &start.flat));
                let errors = found.as_flattened().iter().zip(reference.as_flattened()).map(|(p, q)| (p - q) * (p - q));
                let rms = (errors.sum::<f64>() / reference.len() as f64).sqrt();
                assert!(rms < 1e-3, "lane {l}: {rms}");
            }
        }
    }
}
