//! Toy fields: round cells with round nuclei, with known properties.

use papsynth_judge::{FieldImage, NucleiAnnotation};
use rand_core::{Rng, SeedableRng};
use rand_xoshiro::Xoshiro256PlusPlus;

/// Properties of toy fields.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Toy {
    pub(crate) width: usize,
    pub(crate) height: usize,
    pub(crate) cells: usize,
    /// Blur of all borders: standard deviation of a Gaussian, pixels.
    pub(crate) blur: f64,
    /// Absorbance of nuclei above that of cells.
    pub(crate) nucleus_a: f64,
    /// Mean radius of nuclei, pixels.
    pub(crate) nucleus_px: f64,
    /// Standard deviation of noise, grey levels of 255.
    pub(crate) noise: f64,
}

impl Default for Toy {
    fn default() -> Self {
        Self { width: 320, height: 240, cells: 6, blur: 1.2, nucleus_a: 0.35, nucleus_px: 10.0, noise: 2.0 }
    }
}

/// A disc in a field.
#[derive(Debug, Clone, Copy)]
struct Disc {
    centre: [f64; 2],
    radius: f64,
    a: f64,
    /// Strength and frequency of the texture of absorbance.
    grain: [f64; 2],
}

impl Toy {
    /// Returns the field of a seed, with annotated points.
    pub(crate) fn image(&self, seed: u64) -> FieldImage {
        let mut rng = Xoshiro256PlusPlus::seed_from_u64(seed);
        // Stain and texture differ between slides.
        let (stain, grain) = (1.0 + 0.15 * normal(&mut rng), 0.03 * (1.0 + 0.2 * normal(&mut rng)));
        let mut discs = Vec::new();
        let mut points = Vec::new();
        for _ in 0..self.cells {
            let radius = 3.6 * self.nucleus_px * (1.0 + 0.12 * normal(&mut rng));
            let own = self.nucleus_px * (1.0 + 0.12 * normal(&mut rng));
            let room = |length: usize, u: f64| radius + 4.0 + u * (length as f64 - 2.0 * radius - 8.0);
            let centre = [room(self.width, uniform(&mut rng)), room(self.height, uniform(&mut rng))];
            let off = 0.15 * radius;
            let nucleus = [
                centre[0] + off * normal(&mut rng).clamp(-2.0, 2.0),
                centre[1] + off * normal(&mut rng).clamp(-2.0, 2.0),
            ];
            discs.push(Disc { centre, radius, a: stain * 0.15 * (1.0 + 0.2 * normal(&mut rng)), grain: [0.1, 0.2] });
            discs.push(Disc {
                centre: nucleus,
                radius: own,
                a: stain * self.nucleus_a,
                grain: [grain / self.nucleus_a, 0.9],
            });
            points.push(nucleus);
        }
        let mut grey = Vec::with_capacity(self.width * self.height);
        for y in 0..self.height {
            for x in 0..self.width {
                let a: f64 = discs.iter().map(|d| d.at(x as f64, y as f64, self.blur)).sum();
                let (u, v) = (2.0 * x as f64 / self.width as f64 - 1.0, 2.0 * y as f64 / self.height as f64 - 1.0);
                let lamp = 230.0 * (1.0 - 0.03 * u * u - 0.01 * v * v);
                let light = lamp * libm::pow(10.0, -a) + self.noise * normal(&mut rng);
                #[expect(clippy::cast_possible_truncation, reason = "pixels are f32")]
                grey.push(light.round().clamp(0.0, 255.0) as f32);
            }
        }
        let name = format!("toy {seed}");
        FieldImage { name, grey, width: self.width, nuclei: NucleiAnnotation::Points(points), ..FieldImage::default() }
    }

    /// Returns the fields of consecutive seeds.
    pub(crate) fn images(&self, count: u64, seed: u64) -> Vec<FieldImage> {
        (seed..seed + count).map(|seed| self.image(seed)).collect()
    }
}

impl Disc {
    fn at(&self, x: f64, y: f64, blur: f64) -> f64 {
        let (dx, dy) = (x - self.centre[0], y - self.centre[1]);
        let inside = self.radius - (dx * dx + dy * dy).sqrt();
        if inside < -6.0 * blur {
            return 0.0;
        }
        let [strength, frequency] = self.grain;
        let grain = 1.0 + strength * (libm::sin(frequency * x) + libm::sin(frequency * (0.6 * x - 0.8 * y)));
        self.a * grain * 0.5 * (1.0 + libm::erf(inside / (blur * std::f64::consts::SQRT_2)))
    }
}

/// Draws a uniform number from 0 to 1.
pub(crate) fn uniform(rng: &mut Xoshiro256PlusPlus) -> f64 {
    (rng.next_u64() >> 11) as f64 / (1_u64 << 53) as f64
}

/// Draws a standard normal number by the Box–Muller method.
pub(crate) fn normal(rng: &mut Xoshiro256PlusPlus) -> f64 {
    let radius = (-2.0 * libm::log(1.0 - uniform(rng))).sqrt();
    radius * libm::cos(std::f64::consts::TAU * uniform(rng))
}
