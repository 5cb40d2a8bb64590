use core::f64::consts::{PI, TAU};
use core::ops::ControlFlow;

use num_complex::Complex64;
use portable_numerics::fourier::{ComplexPlane, PlaneScratch};

use crate::Microscope;
use crate::error::{Error, within};
use crate::grid::{SIDES, signed};
use crate::microscope::distance;
use crate::pupil::{Pupil, RIM, turn};

/// Directions of the condenser's light.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Source {
    /// Equal-area directions over the aperture on Vogel's spiral. More defocus needs more points.
    Vogel {
        /// Number of directions, 1 to 65 536.
        points: usize,
    },
    /// Directions on the frequency lattice of the FFT, or every `stride`-th in x and y. A stride of 1 gives every
    /// direction that the grid resolves.
    Lattice {
        /// Stride in x and y, 1 to 32 768.
        stride: usize,
    },
    /// One direction along the optical axis: coherent illumination.
    Axis,
}

/// Parameters of [`Abbe`]: grid and source.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct AbbeParams {
    /// Width of the object in samples, 1 to 32 768. Default 512, ours.
    pub width: usize,
    /// Height of the object in samples, 1 to 32 768. Default 512, ours.
    pub height: usize,
    /// Directions of light. Default 64 Vogel points, ours.
    pub source: Source,
}

impl Default for AbbeParams {
    fn default() -> Self {
        Self { width: 512, height: 512, source: Source::Vogel { points: 64 } }
    }
}

/// A thin layer of the object at one depth: the complex amplitude transmittance √T · exp(iφ) of each sample.
#[derive(Debug, Clone, PartialEq)]
pub struct Layer {
    depth_um: f64,
    amplitude: Vec<[f64; 2]>,
}

impl Layer {
    /// Creates a layer of complex amplitude transmittances, as real and imaginary parts. `depth_um` is the distance
    /// from the focal plane with the stage at rest, positive towards the objective.
    ///
    /// # Errors
    ///
    /// If `depth_um` is not a number from −1000 to 1000.
    pub fn new(depth_um: f64, amplitude: Vec<[f64; 2]>) -> Result<Self, Error> {
        Ok(Self { depth_um: distance("depth_um", depth_um)?, amplitude })
    }

    /// Creates a layer from decadic absorbance A and phase delay φ in radians: amplitudes 10^(−A/2) exp(iφ) (Eq. 11's
    /// transmittance). An empty `phase_rad` means no phase delay.
    ///
    /// # Errors
    ///
    /// See [`Layer::new`].
    ///
    /// # Panics
    ///
    /// If the slices differ in length.
    pub fn from_absorbance(depth_um: f64, absorbance: &[f32], phase_rad: &[f32]) -> Result<Self, Error> {
        let same = phase_rad.is_empty() || phase_rad.len() == absorbance.len();
        assert!(same, "absorbance and phase must have the same length");
        let phases = phase_rad.iter().copied().chain(core::iter::repeat(0.0));
        let amplitude = absorbance.iter().zip(phases).map(|(&a, phase)| {
            let (size, (cos, sin)) = (libm::exp10(-0.5 * f64::from(a)), turn(f64::from(phase) / TAU));
            [size * cos, size * sin]
        });
        Self::new(depth_um, amplitude.collect())
    }
}

/// Image formation from first principles: Abbe's integration over the source, with multislice propagation between
/// layers.
///
/// Each direction s of the condenser gives a coherent image, and their intensities add: I(x) = ∑ₛ |IFFT[T(f) P(f +
/// s)]|² / ∑ₛ |P(s)|². T is the spectrum of the amplitude behind the uppermost layer. Propagation between layers
/// multiplies the spectrum by exp 2πi Δz γ_n(f + s). The cost is one FFT per direction and two more per further layer.
/// [`BrightField`](crate::BrightField) is tested against this type. The grid is periodic.
#[derive(Debug, Clone)]
pub struct Abbe {
    microscope: Microscope,
    params: AbbeParams,
}

/// A complex image and its spectrum, in column-major order.
struct Plane {
    plan: ComplexPlane<f64, 8>,
    field: Vec<Complex64>,
    spectrum: Vec<Complex64>,
    /// Spectrum of the amplitude behind the deepest layer.
    entering: Vec<Complex64>,
    scratch: PlaneScratch<f64, 8>,
}

impl Abbe {
    /// Validates the parameters and creates the integration. Samples are [`Microscope::pitch_um`] apart.
    ///
    /// # Errors
    ///
    /// If a side, the stride or the number of directions is 0 or too large.
    pub fn new(microscope: &Microscope, params: &AbbeParams) -> Result<Self, Error> {
        let side = |field, value: usize| within(field, value as f64, SIDES, "a whole number from 1 to 32768");
        side("width", params.width)?;
        side("height", params.height)?;
        match params.source {
            Source::Vogel { points } => {
                within("source.points", points as f64, 1.0..=65_536.0, "a whole number from 1 to 65536")?
            }
            Source::Lattice { stride } => side("source.stride", stride)?,
            Source::Axis => 0.0,
        };
        Ok(Self { microscope: microscope.clone(), params: params.clone() })
    }

    /// Returns the number of coherent images per image.
    #[must_use]
    pub fn directions(&self) -> usize {
        self.microscope.bands().into_iter().map(|(wavelength, _)| self.directions_of(wavelength).len()).sum()
    }

    /// Returns the intensity image of `layers` relative to an empty slide, at a stage position (see
    /// [`Microscope::transfer`]).
    ///
    /// The image is a reference in double precision, without stray light. Layers may be in any order; light passes the
    /// deepest first.
    ///
    /// # Errors
    ///
    /// If `stage_um` is not a number from −1000 to 1000.
    ///
    /// # Panics
    ///
    /// If the number of samples of a layer differs from that of the grid.
    pub fn image(&self, layers: &[Layer], stage_um: f64) -> Result<Vec<f64>, Error> {
        Ok(self.image_while(layers, stage_um, &|| true)?.unwrap_or_default())
    }

    /// As [`image`](Self::image), or `None` as soon as `goes_on` returns false. It is called before each pair of FFTs.
    ///
    /// # Errors
    ///
    /// As `image`.
    ///
    /// # Panics
    ///
    /// As `image`.
    pub fn image_while(
        &self,
        layers: &[Layer],
        stage_um: f64,
        goes_on: &dyn Fn() -> bool,
    ) -> Result<Option<Vec<f64>>, Error> {
        distance("stage_um", stage_um)?;
        let samples = self.params.width * self.params.height;
        for layer in layers {
            assert_eq!(layer.amplitude.len(), samples, "each layer must have as many samples as the grid");
        }
        let mut layers: Vec<&Layer> = layers.iter().collect();
        layers.sort_by(|a, b| a.depth_um.total_cmp(&b.depth_um));
        let Some(first) = layers.first() else { return Ok(Some(vec![1.0; samples])) };
        let mut plane = Plane {
            plan: ComplexPlane::new(self.params.width, self.params.height),
            field: first.amplitude.iter().map(|&[re, im]| Complex64::new(re, im)).collect(),
            spectrum: Vec::new(),
            entering: vec![Complex64::ZERO; samples],
            scratch: PlaneScratch::default(),
        };
        plane.plan.forward(&plane.field, &mut plane.entering, &mut plane.scratch);
        plane.spectrum.clone_from(&plane.entering);
        let mut image = vec![0.0; samples];
        for band in self.microscope.bands() {
            if self.add(band, &layers, stage_um, goes_on, &mut plane, &mut image).is_break() {
                return Ok(None);
            }
        }
        Ok(Some(image))
    }

    /// Adds the image of one wavelength with its weight.
    fn add(
        &self,
        (wavelength_um, weight): (f64, f64),
        layers: &[&Layer],
        stage_um: f64,
        goes_on: &dyn Fn() -> bool,
        plane: &mut Plane,
        image: &mut [f64],
    ) -> ControlFlow<()> {
        let check = || if goes_on() { ControlFlow::Continue(()) } else { ControlFlow::Break(()) };
        let params = self.microscope.params();
        let pupil = |depth, stage| Pupil::new(params, wavelength_um, depth, stage);
        let lens = pupil(layers.last().map_or(0.0, |layer| layer.depth_um), stage_um);
        let steps: Vec<(Pupil, &Layer)> =
            layers.windows(2).map(|pair| (pupil(pair[0].depth_um - pair[1].depth_um, 0.0), pair[1])).collect();
        let square = |f: [f64; 2]| f[0] * f[0] + f[1] * f[1];
        let directions = self.directions_of(wavelength_um);
        let passing = directions.iter().filter(|&&s| lens.passes(square(s))).count();
        let scale = weight / passing as f64;
        let travelling = params.mount_index / wavelength_um;
        let samples = image.len() as f64;
        for s in directions {
            plane.spectrum.copy_from_slice(&plane.entering);
            for (step, layer) in &steps {
                check()?;
                let wave = |f| (square(f) < travelling * travelling).then(|| step.medium_waves(square(f)));
                self.filter(plane, s, travelling, wave);
                for (value, &[re, im]) in plane.field.iter_mut().zip(&layer.amplitude) {
                    *value *= Complex64::new(re, im) / samples;
                }
                plane.plan.forward(&plane.field, &mut plane.spectrum, &mut plane.scratch);
            }
            check()?;
            self.filter(plane, s, lens.objective + RIM, |f| lens.passes(square(f)).then(|| lens.waves(f)));
            let scale = scale / (samples * samples);
            for (sum, value) in image.iter_mut().zip(&plane.field) {
                *sum += scale * value.norm_sqr();
            }
        }
        ControlFlow::Continue(())
    }

    /// Propagates the spectrum of an envelope, illuminated from direction `s`, by exp 2πi · `waves` at f + s, and
    /// transforms it to the field. Frequencies beyond `reach` or without `waves` are blocked.
    fn filter(&self, plane: &mut Plane, s: [f64; 2], reach: f64, waves: impl Fn([f64; 2]) -> Option<f64>) {
        let (width, height) = (self.params.width, self.params.height);
        let pitch = self.microscope.pitch_um();
        let frequency = |i, side: usize, s| signed(i, side) / (side as f64 * pitch) + s;
        let is_dark = |x| frequency(x, width, s[0]).abs() > reach;
        for (x, column) in plane.spectrum.chunks_exact_mut(height).enumerate() {
            if is_dark(x) {
                continue;
            }
            let fx = frequency(x, width, s[0]);
            for (y, value) in column.iter_mut().enumerate() {
                *value = waves([fx, frequency(y, height, s[1])]).map_or(Complex64::ZERO, |waves| {
                    let (re, im) = turn(waves);
                    *value * Complex64::new(re, im)
                });
            }
        }
        plane.plan.inverse(&plane.spectrum, is_dark, &mut plane.field, &mut plane.scratch);
    }

    /// Returns the directions of light, in cycles/µm.
    fn directions_of(&self, wavelength_um: f64) -> Vec<[f64; 2]> {
        let pitch = self.microscope.pitch_um();
        let steps = [self.params.width, self.params.height].map(|side| 1.0 / (side as f64 * pitch));
        let radius = self.microscope.params().condenser_na / wavelength_um;
        match self.params.source {
            Source::Vogel { points } => sunflower(points, radius),
            Source::Lattice { stride } => lattice(steps.map(|step| step * stride as f64), radius),
            Source::Axis => vec![[0.0; 2]],
        }
    }
}

/// Vogel's spiral, DOI 10.1016/0025-5564(79)90080-4: equal areas, golden angle.
fn sunflower(points: usize, radius: f64) -> Vec<[f64; 2]> {
    let golden = PI * (3.0 - 5_f64.sqrt());
    let seed = |i: usize| {
        let i = i as f64 + 0.5;
        let (r, angle) = (radius * (i / points as f64).sqrt(), golden * i);
        [r * libm::cos(angle), r * libm::sin(angle)]
    };
    (0..points).map(seed).collect()
}

/// Returns the points of a lattice inside a disc centred at a lattice point.
fn lattice([dx, dy]: [f64; 2], radius: f64) -> Vec<[f64; 2]> {
    #[expect(clippy::cast_possible_truncation, reason = "at most half the grid size")]
    let [nx, ny] = [dx, dy].map(|step| (radius / step) as i32 + 1);
    let points = (-ny..=ny).flat_map(|j| (-nx..=nx).map(move |i| [f64::from(i) * dx, f64::from(j) * dy]));
    points.filter(|[x, y]| x * x + y * y <= radius * radius * (1.0 + RIM)).collect()
}
