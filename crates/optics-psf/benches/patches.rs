//! Benchmarks of a field of many small objects imaged patch by patch, relative to the real FFT pairs of complete slabs.

#![expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "small numbers")]

use criterion::{Criterion, Throughput, criterion_group, criterion_main};
use optics_psf::{
    BrightField, BrightFieldParams, Factor, Microscope, MicroscopeParams, Padding, Patch, PatchImager, PatchScratch,
    TransmittedLight, fast_length,
};
use realfft::RealFftPlanner;
use realfft::num_complex::Complex32;

/// Frame size in camera pixels of two samples.
const WIDTH: usize = 1376;
const HEIGHT: usize = 1038;

/// Objects: number, width in pixels, absorbance.
const OBJECTS: [(usize, usize, f32); 4] = [(30, 200, 0.1), (40, 40, 0.4), (400, 20, 0.15), (100, 6, 0.5)];

/// Stage positions of a stack.
const PLANES: i32 = 21;
const STAGE_STEP_UM: f64 = 0.5;

struct Object {
    transmittance: Vec<f32>,
    side: usize,
    at_px: [i64; 2],
    depth_um: f64,
}

/// Returns a term of a Weyl sequence, equidistributed from 0 to 1.
fn weyl(i: usize, step: f64) -> f64 {
    let v = (i as f64 + 0.5) * step;
    v - v.floor()
}

fn scene() -> Vec<Object> {
    let mut objects = Vec::new();
    for (count, side_px, absorbance) in OBJECTS {
        for _ in 0..count {
            let i = objects.len();
            let side = 2 * side_px;
            let sample = |k: usize| {
                let [x, y] = [k % side, k / side].map(|v| v as f32 + 0.5 - side as f32 / 2.0);
                if x * x + y * y < (side * side / 4) as f32 { libm::exp10f(-absorbance) } else { 1.0 }
            };
            let place = |step, pixels: usize| (weyl(i, step) * pixels as f64) as i64 - side_px as i64 / 2;
            objects.push(Object {
                transmittance: (0..side * side).map(sample).collect(),
                side,
                at_px: [place(0.754_877_666, WIDTH), place(0.569_840_291, HEIGHT)],
                depth_um: 8.0 * weyl(i, 0.618_033_988_75) - 4.0,
            });
        }
    }
    objects
}

/// Images every object at every plane.
struct Patches {
    imager: PatchImager,
    stages_um: Vec<f64>,
    lights: Vec<TransmittedLight>,
    patch: Patch,
    scratch: PatchScratch,
    factor: Factor,
    image: Vec<f32>,
}

impl Patches {
    fn new(params: &MicroscopeParams, planes: i32) -> Self {
        let microscope = Microscope::new(params).expect("the parameters are valid");
        let stages_um: Vec<f64> = (0..planes).map(|k| STAGE_STEP_UM * f64::from(k - planes / 2)).collect();
        Self {
            lights: vec![TransmittedLight::new(&microscope, WIDTH, HEIGHT); stages_um.len()],
            stages_um,
            imager: PatchImager::new(&microscope),
            patch: Patch::default(),
            scratch: PatchScratch::default(),
            factor: Factor::default(),
            image: vec![0.0; WIDTH * HEIGHT],
        }
    }

    fn image(&mut self, scene: &[Object]) {
        self.lights.iter_mut().for_each(TransmittedLight::clear);
        for object in scene {
            self.imager.load(&object.transmittance, &[], object.side, &mut self.patch);
            for (&stage, light) in self.stages_um.iter().zip(&mut self.lights) {
                let focus = self.imager.focus(object.depth_um, stage).expect("depths are small");
                self.imager.expose(&mut self.patch, &focus, &mut self.scratch, &mut self.factor);
                light.multiply(&self.factor, object.at_px);
            }
        }
        for light in &self.lights {
            light.image_into(&mut self.image);
        }
    }
}

/// Returns parameters for the band of a colour filter.
fn colour(wavelength_um: f64, bandwidth_um: f64) -> MicroscopeParams {
    MicroscopeParams { wavelength_um, bandwidth_um, ..MicroscopeParams::default() }
}

fn patches(c: &mut Criterion) {
    let scene = scene();
    let mut group = c.benchmark_group("patches");
    group.sample_size(10).throughput(Throughput::Elements((WIDTH * HEIGHT) as u64));
    let mut one = Patches::new(&MicroscopeParams::default(), 1);
    group.bench_function("one plane", |b| b.iter(|| one.image(&scene)));
    let mut colours = [colour(0.45, 0.08), colour(0.54, 0.1), colour(0.61, 0.1)].map(|params| Patches::new(&params, 1));
    group.bench_function("three colours", |b| b.iter(|| colours.iter_mut().for_each(|channel| channel.image(&scene))));
    let mut stack = Patches::new(&MicroscopeParams::default(), PLANES);
    group.bench_function("21 planes", |b| b.iter(|| stack.image(&scene)));
    group.finish();
    for (name, params) in [("narrow", MicroscopeParams::default()), ("broad", colour(0.54, 0.1))] {
        let microscope = Microscope::new(&params).expect("the parameters are valid");
        c.bench_function(&format!("transfer at 3 um, {name} band"), |b| b.iter(|| microscope.transfer(3.0, 0.0)));
    }
    c.bench_function("a focus at 1.3 um", |b| b.iter(|| one.imager.focus(1.3, 0.0)));
}

/// Images the same objects in complete slabs of 1 µm.
fn slabs(c: &mut Criterion) {
    let scene = scene();
    let depths: Vec<f64> = (-4..=4).map(f64::from).collect();
    let side = [2 * WIDTH, 2 * HEIGHT];
    let slabs: Vec<Vec<f32>> = depths
        .iter()
        .map(|&depth| {
            let mut slab = vec![1.0; side[0] * side[1]];
            for object in scene.iter().filter(|t| t.depth_um.round() == depth) {
                for (k, t) in object.transmittance.iter().enumerate() {
                    let x = 2 * object.at_px[0] + (k % object.side) as i64;
                    let y = 2 * object.at_px[1] + (k / object.side) as i64;
                    if (0..side[0] as i64).contains(&x) && (0..side[1] as i64).contains(&y) {
                        slab[y as usize * side[0] + x as usize] *= t;
                    }
                }
            }
            slab
        })
        .collect();
    let microscope = Microscope::new(&MicroscopeParams::default()).expect("the defaults are valid");
    let params = BrightFieldParams {
        width: side[0],
        height: side[1],
        padding: Padding::Clear { px: 64 },
        depths_um: depths,
        ..BrightFieldParams::default()
    };
    let field = BrightField::new(&microscope, &params).expect("the parameters are valid");
    let mut specimen = field.specimen();
    let mut out = vec![0.0; WIDTH * HEIGHT];
    let mut group = c.benchmark_group("complete slabs");
    group.sample_size(10).throughput(Throughput::Elements((WIDTH * HEIGHT) as u64));
    group.bench_function(format!("{} slabs, one plane", slabs.len()), |b| {
        b.iter(|| {
            for (k, slab) in slabs.iter().enumerate() {
                field.set_transmittance(&mut specimen, k, slab);
            }
            field.image_into(&mut specimen, 0, &mut out)
        });
    });
    group.finish();
}

/// A real FFT and its inverse on the grid of the image's samples, rounded up to fast lengths: the unit of comparison,
/// per non-empty slab.
fn fft_pair(c: &mut Criterion) {
    let (width, height) = (fast_length(2 * WIDTH), fast_length(2 * HEIGHT));
    let mut planner = RealFftPlanner::<f32>::new();
    let (forward, inverse) = (planner.plan_fft_forward(width), planner.plan_fft_inverse(width));
    let mut complex = rustfft::FftPlanner::<f32>::new();
    let (down, up) = (complex.plan_fft_forward(height), complex.plan_fft_inverse(height));
    let half = width / 2 + 1;
    let image = vec![0.5_f32; width * height];
    let mut rows = image.clone();
    let mut spectrum = vec![Complex32::default(); half * height];
    let mut columns = spectrum.clone();
    let mut group = c.benchmark_group("reference");
    group.sample_size(10).throughput(Throughput::Elements((width * height) as u64));
    group.bench_function(format!("real FFT pair, {width} x {height}"), |b| {
        b.iter(|| {
            rows.copy_from_slice(&image);
            for (row, out) in rows.chunks_exact_mut(width).zip(spectrum.chunks_exact_mut(half)) {
                forward.process(row, out).expect("the lengths fit");
            }
            transpose(&spectrum, half, &mut columns);
            down.process(&mut columns);
            up.process(&mut columns);
            transpose(&columns, height, &mut spectrum);
            for (row, input) in rows.chunks_exact_mut(width).zip(spectrum.chunks_exact_mut(half)) {
                input[0].im = 0.0;
                input[half - 1].im = 0.0;
                inverse.process(input, row).expect("the lengths fit");
            }
        });
    });
    group.finish();
}

fn transpose(from: &[Complex32], width: usize, to: &mut [Complex32]) {
    const TILE: usize = 16;
    let height = from.len() / width;
    for top in (0..height).step_by(TILE) {
        for left in (0..width).step_by(TILE) {
            for x in left..(left + TILE).min(width) {
                for y in top..(top + TILE).min(height) {
                    to[x * height + y] = from[y * width + x];
                }
            }
        }
    }
}

criterion_group!(benches, fft_pair, patches, slabs);
criterion_main!(benches);
