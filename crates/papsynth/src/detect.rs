//! Signal detection: from light to grey levels (Eq. 13), and how detectable an object is in them.

use ccd_noise::{Blooming, Camera, CameraParams, Jpeg, JpegParams, ReadNoise, SaturatedRun};
use dye_spectra::{Colour, ColourParams, Lamp};
use multiversion::multiversion;

use crate::error::Cause;
use crate::recipe::{Binning, Mixing, PhotonNoise, Rendition, Subsampling};
use crate::scene::{Scene, SceneCamera, SceneLight};
use crate::truth::{Mask, Run};

/// Electrons above which [`PhotonNoise::Normal`] draws one normal deviate: the skewness 1/√µ is below 0.05.
const NORMAL_ABOVE_E: f64 = 400.0;

/// How much more than the largest grey level stands for a pixel holds: the converter clips first, as in real cameras.
const WELL_MARGIN: f64 = 1.02;

/// Bits of the converter of a camera that makes colours of its grey levels before it hands them over.
const INNER_BITS: u32 = 16;

/// Colours of the sensor as they are.
const UNCHANGED: [[f64; 3]; 3] = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];

/// The camera of a scene.
pub(crate) struct Detector {
    channels: Vec<Channel>,
    /// Bits of the grey levels that it makes; planes that are to be fused have more than the picture.
    pub(crate) bits: u32,
    /// How colours are made of the channels, if they are.
    srgb: Option<Srgb>,
    jpeg: Option<Jpeg>,
}

/// The camera as one channel sees it.
struct Channel {
    camera: Camera,
    /// Electrons of light 1: white balance leaves fewer to the colours of which lamp and sensor have little.
    full_scale_e: f64,
    /// Part of these that is glare, whatever lies in the light's way.
    glare: f64,
}

/// What is on its way from electrons to grey levels, channel by channel.
#[derive(Debug, Default)]
pub(crate) struct Developing {
    /// Columns of the frame.
    width: usize,
    /// Of the noise of each channel.
    keys: Vec<u64>,
    levels: Vec<Vec<u16>>,
    means: Vec<Vec<f32>>,
    /// Runs of saturated pixels, of all channels.
    saturated: Vec<SaturatedRun>,
    /// Electrons of the whole frame, for a camera that blooms.
    frame: Vec<Vec<f32>>,
}

impl Developing {
    /// Makes room for a frame.
    pub(crate) fn start(&mut self, width: usize, keys: Vec<u64>) {
        (self.width, self.keys) = (width, keys);
        self.saturated.clear();
        self.frame.iter_mut().for_each(Vec::clear);
    }

    /// The pixels that were saturated in some channel.
    pub(crate) fn saturated(&mut self) -> Mask {
        self.saturated.sort_by_key(|run| (run.y, run.x0));
        let mut runs: Vec<Run> = Vec::new();
        for run in &self.saturated {
            match runs.last_mut() {
                Some(last) if last.y == run.y && last.x1 >= run.x0 => last.x1 = last.x1.max(run.x1),
                _ => runs.push(Run { y: run.y, x0: run.x0, x1: run.x1 }),
            }
        }
        Mask::from_runs(runs)
    }
}

/// How dyes become colours in the light of a lamp.
pub(crate) fn colour(lamp_k: f64, mixing: Mixing) -> Result<Colour, Cause> {
    let params = ColourParams {
        lamp: Lamp::Halogen { temperature_k: lamp_k },
        mixing: match mixing {
            Mixing::Spectral | Mixing::PerWavelength => dye_spectra::Mixing::Spectral,
            Mixing::ThreeVectors => dye_spectra::Mixing::ThreeVectors,
        },
        ..ColourParams::default()
    };
    Ok(Colour::new(&params)?)
}

impl Detector {
    pub(crate) fn new(scene: &Scene) -> Result<Self, Cause> {
        let camera = scene.camera;
        let params = JpegParams {
            quality: camera.jpeg_quality,
            subsampling: match camera.jpeg_subsampling {
                Subsampling::S444 => ccd_noise::Subsampling::S444,
                Subsampling::S422 => ccd_noise::Subsampling::S422,
                Subsampling::S420 => ccd_noise::Subsampling::S420,
            },
            bit_depth: camera.bits,
        };
        let jpeg = (camera.jpeg_quality > 0).then(|| Jpeg::new(&params)).transpose()?;
        // What is fused is rounded once more afterwards.
        let unfused = if scene.fusion.is_some() { INNER_BITS } else { camera.bits };
        match scene.light {
            SceneLight::Monochrome { .. } => {
                let channels = vec![Channel::new(&camera, unfused, 1.0)?];
                Ok(Self { channels, bits: unfused, srgb: None, jpeg })
            }
            SceneLight::Colour { rendition, lamp_k, mixing, .. } => {
                let colour = colour(lamp_k, mixing)?;
                let (bits, handed_over) = match rendition {
                    Rendition::Raw => (unfused, unfused),
                    Rendition::Display | Rendition::Srgb => (INNER_BITS, camera.bits),
                };
                let channel = |of: &dye_spectra::Channel| Channel::new(&camera, bits, of.relative_light);
                let channels = colour.channels().iter().map(channel).collect::<Result<_, _>>()?;
                let srgb = match rendition {
                    Rendition::Raw => None,
                    Rendition::Display => Some(Srgb::new(&UNCHANGED, INNER_BITS, camera.bits)),
                    Rendition::Srgb => Some(Srgb::new(colour.to_srgb(), INNER_BITS, camera.bits)),
                };
                Ok(Self { channels, bits: handed_over, srgb, jpeg })
            }
        }
    }

    /// Light as a fraction of full scale becomes mean electrons.
    pub(crate) fn electrons(&self, channel: usize, light: &mut [f32]) {
        let Channel { full_scale_e, glare, .. } = self.channels[channel];
        let (scale, glare) = ((full_scale_e * (1.0 - glare)) as f32, (full_scale_e * glare) as f32);
        scaled(light, scale, glare);
    }

    /// Takes in rows that begin at row `first`. Their grey levels, channels side by side, stand in `grey` at once, unless
    /// charge crosses rows in this camera: then when all rows were [`finish`](Self::finish)ed.
    pub(crate) fn expose(&self, electrons: &[&mut [f32]], first: usize, grey: &mut [u16], developing: &mut Developing) {
        if self.needs_whole_frame() {
            developing.frame.resize(self.channels.len(), Vec::new());
            developing.frame.iter_mut().zip(electrons).for_each(|(frame, rows)| frame.extend_from_slice(rows));
            return;
        }
        let Developing { width, keys, levels, saturated, .. } = developing;
        let origin = [0, u32::try_from(first).unwrap_or(u32::MAX)];
        let mut expose = |channel: &Channel, electrons: &[f32], key, levels: &mut [u16]| {
            channel.camera.expose_window_marking(electrons, *width, origin, key, levels, saturated);
        };
        match (&self.channels[..], electrons) {
            ([channel], [electrons]) => expose(channel, electrons, keys[0], grey),
            _ => self.develop(electrons.iter().map(|rows| &**rows), keys, levels, grey, expose),
        }
    }

    /// What can be done with a whole frame alone: charge that crosses rows.
    pub(crate) fn finish(&self, grey: &mut [u16], developing: &mut Developing) {
        if self.needs_whole_frame() {
            let Developing { width, keys, levels, saturated, frame, .. } = developing;
            self.develop(frame.iter().map(|rows| &rows[..]), keys, levels, grey, |channel, electrons, key, levels| {
                channel.camera.expose_frame(electrons, *width, key, levels, saturated);
            });
        }
    }

    /// Grey levels of all channels, side by side. `levels` is memory for those of each.
    fn develop<'a>(
        &self,
        electrons: impl Iterator<Item = &'a [f32]>,
        keys: &[u64],
        levels: &mut Vec<Vec<u16>>,
        grey: &mut [u16],
        mut expose: impl FnMut(&Channel, &[f32], u64, &mut [u16]),
    ) {
        levels.resize(self.channels.len(), Vec::new());
        for (((channel, electrons), key), levels) in self.channels.iter().zip(electrons).zip(keys).zip(&mut *levels) {
            levels.resize(electrons.len(), 0);
            expose(channel, electrons, *key, levels);
        }
        match &self.srgb {
            Some(srgb) => srgb.render(levels, grey, |value| (value + 0.5).min(srgb.largest) as u16),
            None => interleave(levels, grey),
        }
    }

    /// JPEG, of a finished frame.
    pub(crate) fn compress(&self, width: usize, grey: &mut [u16]) {
        match (&self.jpeg, self.channels.len()) {
            (None, _) => {}
            (Some(jpeg), 1) => jpeg.frame(grey, width),
            (Some(jpeg), _) => {
                let mut rgb: Vec<u8> = grey.iter().map(|level| *level as u8).collect();
                jpeg.rgb(&mut rgb, width);
                grey.iter_mut().zip(&rgb).for_each(|(level, byte)| *level = u16::from(*byte));
            }
        }
    }

    fn needs_whole_frame(&self) -> bool {
        self.channels.iter().any(|channel| channel.camera.needs_whole_frame())
    }

    /// Grey levels without any noise and before rounding.
    pub(crate) fn mean_dn_into(&self, electrons: &[&mut [f32]], out: &mut [f32], developing: &mut Developing) {
        if let ([channel], [electrons]) = (&self.channels[..], electrons) {
            channel.camera.mean_dn_into(electrons, out);
            return;
        }
        let means = &mut developing.means;
        means.resize(self.channels.len(), Vec::new());
        for ((channel, electrons), means) in self.channels.iter().zip(electrons).zip(means.iter_mut()) {
            means.resize(electrons.len(), 0.0);
            channel.camera.mean_dn_into(electrons, means);
        }
        match &self.srgb {
            Some(srgb) => srgb.render(means, out, |value| value),
            None => interleave(means, out),
        }
    }

    /// How far a pixel of so many mean electrons stands out from what it would be with more light, relative to its noise.
    pub(crate) fn contrast(&self, channel: usize, electrons: f64, without: f64) -> f64 {
        let camera = &self.channels[channel].camera;
        let noise_dn = camera.temporal_noise_dn(electrons).max(f64::MIN_POSITIVE);
        (camera.expected_dn(without) - camera.expected_dn(electrons)) / noise_dn
    }
}

impl Channel {
    /// `share` is the light of the channel relative to the brightest one's.
    fn new(camera: &SceneCamera, bits: u32, share: f64) -> Result<Self, Cause> {
        let largest = libm::exp2(f64::from(bits)) - 1.0;
        let offset_dn = camera.offset_dn * libm::exp2(f64::from(bits) - f64::from(camera.bits));
        let (range_dn, glare) = (largest - offset_dn, camera.glare_subtracted);
        let params = CameraParams {
            exposure_s: camera.exposure_s,
            dark_current_e_per_s: camera.dark_current_e_per_s,
            dark_reference_c: camera.dark_reference_c,
            temperature_c: camera.temperature_c,
            dark_doubling_c: camera.dark_doubling_c,
            prnu: camera.prnu,
            dsnu_e: camera.dsnu_e,
            serial: camera.serial,
            full_well_e: camera.full_well_e * WELL_MARGIN,
            blooming: match camera.blooming {
                0.0 => Blooming::Off,
                share => Blooming::On { vertical: camera.blooming_vertical, anti_blooming: 1.0 - share },
            },
            read_noise: match camera.read_noise_rms_e {
                0.0 => ReadNoise::Same { e: camera.read_noise_e },
                rms_e => ReadNoise::PerPixel { median_e: camera.read_noise_e, rms_e },
            },
            // What is left of the range without the glare fills it again.
            gain_dn_per_e: range_dn / (1.0 - glare) / (camera.full_well_e * share),
            offset_dn: offset_dn - range_dn * glare / (1.0 - glare),
            bit_depth: bits,
            photon_noise: match camera.photon_noise {
                PhotonNoise::Exact => ccd_noise::PhotonNoise::Exact,
                PhotonNoise::Normal => ccd_noise::PhotonNoise::NormalAbove { mean_e: NORMAL_ABOVE_E },
                PhotonNoise::Off => ccd_noise::PhotonNoise::Off,
            },
            ..CameraParams::default()
        };
        let side = camera.binning_px as usize;
        let binned = match (side, camera.binning) {
            (1, _) => Ok(params),
            (_, Binning::Charge) => params.binned(ccd_noise::Binning::Charge { side }),
            (_, Binning::Digital) => params.binned(ccd_noise::Binning::Digital { side }),
        };
        let camera = binned.and_then(|params| Camera::new(&params))?;
        let full_scale_e = range_dn / (1.0 - glare) * camera.electrons_per_dn();
        Ok(Self { camera, full_scale_e, glare })
    }
}

/// Values of several channels, side by side.
fn interleave<T: Copy>(channels: &[Vec<T>], out: &mut [T]) {
    for (channel, values) in channels.iter().enumerate() {
        for (out, value) in out[channel..].iter_mut().step_by(channels.len()).zip(values) {
            *out = *value;
        }
    }
}

#[multiversion(targets = "simd")]
fn scaled(values: &mut [f32], scale: f32, offset: f32) {
    values.iter_mut().for_each(|value| *value = *value * scale + offset);
}

/// Sum of the pixels of these runs, as far as they lie in a tile of rows of `width` whose upper left pixel is pixel
/// `origin` of the image. The order of the additions is fixed.
#[multiversion(targets = "simd")]
pub(crate) fn sum_over(runs: &[Run], tile: &[f32], width: usize, origin: [i64; 2]) -> f64 {
    /// Sums that grow side by side.
    const LANES: usize = 16;
    let mut sums = [0.0_f64; LANES];
    let height = tile.len() / width;
    for run in runs {
        let Ok(y) = usize::try_from(i64::from(run.y) - origin[1]) else { continue };
        if y >= height {
            continue;
        }
        let clip = |x: u32| usize::try_from(i64::from(x) - origin[0]).unwrap_or(0).min(width);
        let mut blocks = tile[y * width + clip(run.x0)..y * width + clip(run.x1)].chunks_exact(LANES);
        for block in &mut blocks {
            for (sum, value) in sums.iter_mut().zip(block) {
                *sum += f64::from(*value);
            }
        }
        for (sum, value) in sums.iter_mut().zip(blocks.remainder()) {
            *sum += f64::from(*value);
        }
    }
    sums.iter().sum()
}

/// Steps of the tone curve's table: between two of them it is straight to a twentieth of an 8-bit grey level.
const STEPS: usize = 4096;

/// From balanced, linear grey levels of three channels to colours as microscope cameras show them: sRGB primaries and tone curve
/// (IEC 61966-2-1).
struct Srgb {
    matrix: [[f32; 3]; 3],
    inner: f32,
    largest: f32,
    /// The curve at even steps from 0 to 1, in grey levels, and once more its end.
    curve: Vec<f32>,
}

impl Srgb {
    /// `matrix` leads from the channels to linear sRGB; grey levels come with `inner_bits` and leave with `bits`.
    fn new(matrix: &[[f64; 3]; 3], inner_bits: u32, bits: u32) -> Self {
        let levels = |bits: u32| libm::exp2(f64::from(bits)) - 1.0;
        let largest = levels(bits);
        let curve =
            (0..=STEPS + 1).map(|step| (largest * encoded((step as f64 / STEPS as f64).min(1.0))) as f32).collect();
        Self {
            matrix: matrix.map(|row| row.map(|v| v as f32)),
            inner: (1.0 / levels(inner_bits)) as f32,
            largest: largest as f32,
            curve,
        }
    }

    /// Writes colours side by side.
    fn render<T: Copy + Into<f32>, U>(&self, channels: &[Vec<T>], out: &mut [U], store: impl Fn(f32) -> U) {
        let [r, g, b] = channels else { return };
        for (((out, &r), &g), &b) in out.chunks_exact_mut(3).zip(r).zip(g).zip(b) {
            for (out, value) in out.iter_mut().zip(self.convert([r.into(), g.into(), b.into()])) {
                *out = store(value);
            }
        }
    }

    /// Between 0 and the largest grey level.
    #[inline(always)]
    fn convert(&self, levels: [f32; 3]) -> [f32; 3] {
        self.matrix.map(|row| {
            let linear = self.inner * (row[0] * levels[0] + row[1] * levels[1] + row[2] * levels[2]);
            let at = linear.clamp(0.0, 1.0) * STEPS as f32;
            let step = at as usize;
            let (low, high) = (self.curve[step], self.curve[step + 1]);
            low + (at - step as f32) * (high - low)
        })
    }
}

/// The tone curve, 0 to 1.
fn encoded(linear: f64) -> f64 {
    if linear <= 0.003_130_8 { 12.92 * linear } else { 1.055 * libm::pow(linear, 1.0 / 2.4) - 0.055 }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_sum_is_that_of_the_pixels_in_the_tile() {
        let tile: Vec<f32> = (0..40 * 5).map(|i| i as f32 * 0.37).collect();
        let run = |y, x0, x1| Run { y, x0, x1 };
        let runs = [run(2, 0, 90), run(9, 0, 90), run(10, 25, 30), run(12, 3, 47), run(14, 59, 70), run(15, 20, 60)];
        let slow: f64 = runs
            .iter()
            .flat_map(|r| (r.x0..r.x1).map(|x| (x, r.y)))
            .filter(|(x, y)| (20..60).contains(x) && (10..15).contains(y))
            .map(|(x, y)| f64::from(tile[((y - 10) * 40 + x - 20) as usize]))
            .sum();
        let fast = sum_over(&runs, &tile, 40, [20, 10]);
        assert!((fast - slow).abs() < 1e-9 * slow, "{fast} {slow}");
        assert_eq!(sum_over(&[], &tile, 40, [20, 10]), 0.0);
    }
}
