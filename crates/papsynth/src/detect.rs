//! Signal detection: light to grey levels (Eq. 13), and the contrast of objects relative to noise.

use ccd_noise::{Blooming, Camera, CameraParams, Jpeg, JpegParams, ReadNoise, SaturatedRun};
use dye_spectra::{Colour, ColourParams, Lamp};
use multiversion::multiversion;

use crate::error::ErrorKind;
use crate::recipe::{Binning, Mixing, PhotonNoise, Rendition, Subsampling};
use crate::scene::{Scene, SceneCamera, SceneLight};
use crate::truth::{Mask, Run};

/// Mean electrons above which [`PhotonNoise::Normal`] draws one normal deviate: the skewness 1/√µ is below 0.05.
const NORMAL_ABOVE_E: f64 = 400.0;

/// Full-well capacity relative to the charge of the highest grey level: the converter clips first, as in real cameras.
const WELL_MARGIN: f64 = 1.02;

/// Largest full-well capacity of the camera model after binning, electrons.
const MAX_WELL_E: f64 = 1e7;

/// Bit depth of the converter of a camera that computes colours or fused planes from its grey levels.
const INNER_BITS: u32 = 16;

/// Highest grey level of planes for fusion relative to that of the image, so that their noise is not clipped.
const HEADROOM: f64 = 1.25;

/// The identity matrix: sensor colours without conversion.
const UNCHANGED: [[f64; 3]; 3] = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];

/// The camera of a scene.
pub(crate) struct Detector {
    channels: Vec<Channel>,
    /// Grey level of light 1. Planes for fusion have more bits than the final image, and levels above this one.
    pub(crate) full_scale: f32,
    /// Conversion of the channels to colours, if any.
    srgb: Option<Srgb>,
    jpeg: Option<Jpeg>,
}

/// The camera parameters of one channel.
struct Channel {
    camera: Camera,
    /// Electrons of light 1; fewer in channels where lamp and sensor give little light, which white balance amplifies.
    full_scale_e: f64,
    /// Fraction of these electrons that is glare, independent of the specimen.
    glare: f64,
}

/// Buffers for the conversion of electrons to grey levels, one entry per channel.
#[derive(Debug, Default)]
pub(crate) struct ExposureBuffers {
    /// Columns of the frame.
    width: usize,
    /// Noise key of each channel.
    keys: Vec<u64>,
    levels: Vec<Vec<u16>>,
    means: Vec<Vec<f32>>,
    /// Runs of saturated pixels in all channels.
    saturated: Vec<SaturatedRun>,
    /// Electrons of the complete frame, for a camera with blooming.
    frame: Vec<Vec<f32>>,
}

impl ExposureBuffers {
    /// Resets the buffers for a frame.
    pub(crate) fn start(&mut self, width: usize, keys: Vec<u64>) {
        (self.width, self.keys) = (width, keys);
        self.saturated.clear();
        self.frame.iter_mut().for_each(Vec::clear);
    }

    /// Returns the pixels that are saturated in at least one channel.
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

/// The conversion of dye amounts to colours under a lamp.
pub(crate) fn colour(lamp_k: f64, mixing: Mixing) -> Result<Colour, ErrorKind> {
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
    pub(crate) fn new(scene: &Scene) -> Result<Self, ErrorKind> {
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
        // Fusion rounds once more, so the planes keep more bits.
        let (plane_bits, headroom) = if scene.fusion.is_some() { (INNER_BITS, HEADROOM) } else { (camera.bits, 1.0) };
        let full_scale = |bits: u32, headroom: f64| (highest(bits) / headroom) as f32;
        match scene.light {
            SceneLight::Monochrome { .. } => {
                let channels = vec![Channel::new(&camera, plane_bits, 1.0, headroom)?];
                let full_scale = full_scale(plane_bits, headroom);
                Ok(Self { channels, full_scale, srgb: None, jpeg })
            }
            SceneLight::Colour { rendition, lamp_k, mixing, .. } => {
                let colour = colour(lamp_k, mixing)?;
                // The conversion to colours clips at the highest level.
                let (bits, output_bits, headroom) = match rendition {
                    Rendition::Raw => (plane_bits, plane_bits, headroom),
                    Rendition::Display | Rendition::Srgb => (INNER_BITS, camera.bits, 1.0),
                };
                let channel = |of: &dye_spectra::Channel| Channel::new(&camera, bits, of.relative_light, headroom);
                let channels = colour.channels().iter().map(channel).collect::<Result<_, _>>()?;
                let srgb = match rendition {
                    Rendition::Raw => None,
                    Rendition::Display => Some(Srgb::new(&UNCHANGED, INNER_BITS, camera.bits)),
                    Rendition::Srgb => Some(Srgb::new(colour.to_srgb(), INNER_BITS, camera.bits)),
                };
                let full_scale = full_scale(output_bits, headroom);
                Ok(Self { channels, full_scale, srgb, jpeg })
            }
        }
    }

    /// Converts light as a fraction of full scale to mean electrons, in place.
    pub(crate) fn electrons(&self, channel: usize, light: &mut [f32]) {
        let Channel { full_scale_e, glare, .. } = self.channels[channel];
        let (scale, glare) = ((full_scale_e * (1.0 - glare)) as f32, (full_scale_e * glare) as f32);
        scale_and_add(light, scale, glare);
    }

    /// Exposes rows from row `first` on and writes their grey levels, channels interleaved, to `grey`.
    ///
    /// If charge crosses rows in this camera, [`finish`](Self::finish) writes the grey levels instead.
    pub(crate) fn expose(
        &self,
        electrons: &[&mut [f32]],
        first: usize,
        grey: &mut [u16],
        buffers: &mut ExposureBuffers,
    ) {
        if self.needs_whole_frame() {
            buffers.frame.resize(self.channels.len(), Vec::new());
            buffers.frame.iter_mut().zip(electrons).for_each(|(frame, rows)| frame.extend_from_slice(rows));
            return;
        }
        let ExposureBuffers { width, keys, levels, saturated, .. } = buffers;
        let origin = [0, u32::try_from(first).unwrap_or(u32::MAX)];
        let mut expose = |channel: &Channel, electrons: &[f32], key, levels: &mut [u16]| {
            channel.camera.expose_window_marking(electrons, *width, origin, key, levels, saturated);
        };
        match (&self.channels[..], electrons) {
            ([channel], [electrons]) => expose(channel, electrons, keys[0], grey),
            _ => self.expose_channels(electrons.iter().map(|rows| &**rows), keys, levels, grey, expose),
        }
    }

    /// Exposes the complete frame if charge crosses rows in this camera.
    pub(crate) fn finish(&self, grey: &mut [u16], buffers: &mut ExposureBuffers) {
        if self.needs_whole_frame() {
            let ExposureBuffers { width, keys, levels, saturated, frame, .. } = buffers;
            self.expose_channels(
                frame.iter().map(|rows| &rows[..]),
                keys,
                levels,
                grey,
                |channel, electrons, key, levels| {
                    channel.camera.expose_frame(electrons, *width, key, levels, saturated);
                },
            );
        }
    }

    /// Writes the grey levels of all channels, interleaved. `levels` is a buffer for each channel.
    fn expose_channels<'a>(
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
            Some(srgb) => render_levels(srgb, levels, grey),
            None => interleave(levels, grey),
        }
    }

    /// Compresses and decompresses a finished frame as JPEG, if the camera does.
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

    /// Writes expected grey levels, without noise and before rounding.
    pub(crate) fn mean_dn_into(&self, electrons: &[&mut [f32]], out: &mut [f32], buffers: &mut ExposureBuffers) {
        if let ([channel], [electrons]) = (&self.channels[..], electrons) {
            channel.camera.mean_dn_into(electrons, out);
            return;
        }
        let means = &mut buffers.means;
        means.resize(self.channels.len(), Vec::new());
        for ((channel, electrons), means) in self.channels.iter().zip(electrons).zip(means.iter_mut()) {
            means.resize(electrons.len(), 0.0);
            channel.camera.mean_dn_into(electrons, means);
        }
        match &self.srgb {
            Some(srgb) => render_means(srgb, means, out),
            None => interleave(means, out),
        }
    }

    /// Returns the difference in grey level between a pixel with `without` and with `electrons` mean electrons,
    /// relative to the noise of the latter.
    pub(crate) fn contrast(&self, channel: usize, electrons: f64, without: f64) -> f64 {
        let camera = &self.channels[channel].camera;
        let noise_dn = camera.temporal_noise_dn(electrons).max(f64::MIN_POSITIVE);
        (camera.expected_dn(without) - camera.expected_dn(electrons)) / noise_dn
    }
}

impl Channel {
    /// `relative_light` is the light of the channel relative to the brightest channel, `headroom` the highest grey
    /// level relative to that of light 1.
    fn new(camera: &SceneCamera, bits: u32, relative_light: f64, headroom: f64) -> Result<Self, ErrorKind> {
        let side = camera.binning_px as usize;
        let full_scale = highest(bits) / headroom;
        let offset_dn = camera.offset_dn * libm::exp2(f64::from(bits) - f64::from(camera.bits)) / headroom;
        let (range_dn, glare) = (full_scale - offset_dn, camera.glare_subtracted);
        let params = CameraParams {
            exposure_s: camera.exposure_s,
            dark_current_e_per_s: camera.dark_current_e_per_s,
            dark_reference_c: camera.dark_reference_c,
            temperature_c: camera.temperature_c,
            dark_doubling_c: camera.dark_doubling_c,
            prnu: camera.prnu,
            dsnu_e: camera.dsnu_e,
            serial: camera.serial,
            full_well_e: (camera.full_well_e * WELL_MARGIN * headroom).min(MAX_WELL_E / (side * side) as f64),
            blooming: match camera.blooming {
                0.0 => Blooming::Off,
                fraction => Blooming::On { vertical: camera.blooming_vertical, anti_blooming: 1.0 - fraction },
            },
            read_noise: match camera.read_noise_rms_e {
                0.0 => ReadNoise::Same { e: camera.read_noise_e },
                rms_e => ReadNoise::PerPixel { median_e: camera.read_noise_e, rms_e },
            },
            // Glare is subtracted, so the remaining light is scaled to the full range.
            gain_dn_per_e: range_dn / (1.0 - glare) / (camera.full_well_e * relative_light),
            offset_dn: offset_dn - range_dn * glare / (1.0 - glare),
            bit_depth: bits,
            photon_noise: match camera.photon_noise {
                PhotonNoise::Exact => ccd_noise::PhotonNoise::Exact,
                PhotonNoise::Normal => ccd_noise::PhotonNoise::NormalAbove { mean_e: NORMAL_ABOVE_E },
                PhotonNoise::Off => ccd_noise::PhotonNoise::Off,
            },
            ..CameraParams::default()
        };
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

/// Returns the highest grey level of a number of bits.
pub(crate) fn highest(bits: u32) -> f64 {
    libm::exp2(f64::from(bits)) - 1.0
}

/// Interleaves the values of several channels.
fn interleave<T: Copy>(channels: &[Vec<T>], out: &mut [T]) {
    for (channel, values) in channels.iter().enumerate() {
        for (out, value) in out[channel..].iter_mut().step_by(channels.len()).zip(values) {
            *out = *value;
        }
    }
}

#[multiversion(targets = "simd")]
fn scale_and_add(values: &mut [f32], scale: f32, offset: f32) {
    values.iter_mut().for_each(|value| *value = *value * scale + offset);
}

/// Returns the sum of the pixels of runs inside a tile of `width` columns whose upper left pixel is pixel `origin` of
/// the image. The order of the additions is fixed.
#[multiversion(targets = "simd")]
pub(crate) fn sum_over(runs: &[Run], tile: &[f32], width: usize, origin: [i64; 2]) -> f64 {
    /// Number of parallel partial sums.
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

/// Conversion of balanced, linear grey levels of three channels to sRGB (primaries and tone curve of IEC 61966-2-1).
struct Srgb {
    /// Converts input grey levels to linear colours, 0 to 1.
    matrix: [[f32; 3]; 3],
    largest: f32,
}

/// Pixels that are converted in parallel.
const LANES: usize = 16;

impl Srgb {
    /// `matrix` converts the channels to linear sRGB; input has `inner_bits`, output has `bits`.
    fn new(matrix: &[[f64; 3]; 3], inner_bits: u32, bits: u32) -> Self {
        let scale = 1.0 / highest(inner_bits);
        Self { matrix: matrix.map(|row| row.map(|v| (scale * v) as f32)), largest: highest(bits) as f32 }
    }

    /// Writes the colours of pixels, interleaved; `store` converts grey levels, 0 to the highest level.
    #[inline(always)]
    fn render<T: Copy + Default + Into<f32>, U: Copy>(
        &self,
        channels: &[Vec<T>],
        out: &mut [U],
        store: impl Fn(f32) -> U,
    ) {
        let [r, g, b] = channels else { return };
        let ([r, g, b], colours) = ([r, g, b].map(|channel| channel.as_chunks()), out.as_chunks_mut::<{ 3 * LANES }>());
        for (((r, g), b), out) in r.0.iter().zip(g.0).zip(b.0).zip(colours.0) {
            self.convert([r, g, b], out, &store);
        }
        let (rest, mut last) = (colours.1, [store(0.0); 3 * LANES]);
        let ends = [r.1, g.1, b.1].map(|end| {
            let mut block = [T::default(); LANES];
            block[..end.len()].copy_from_slice(end);
            block
        });
        self.convert(ends.each_ref(), &mut last, &store);
        rest.copy_from_slice(&last[..rest.len()]);
    }

    /// Writes the colours of a block of pixels.
    #[inline(always)]
    fn convert<T: Copy + Into<f32>, U>(
        &self,
        channels: [&[T; LANES]; 3],
        out: &mut [U; 3 * LANES],
        store: &impl Fn(f32) -> U,
    ) {
        let levels = channels.map(|channel| channel.map(Into::into));
        for (c, row) in self.matrix.iter().enumerate() {
            let mut colours = [0.0; LANES];
            for (i, colour) in colours.iter_mut().enumerate() {
                let linear = row[0] * levels[0][i] + row[1] * levels[1][i] + row[2] * levels[2][i];
                *colour = self.largest * encoded(linear.clamp(0.0, 1.0));
            }
            for (out, colour) in out[c..].iter_mut().step_by(3).zip(colours) {
                *out = store(colour);
            }
        }
    }
}

/// Writes colours without noise, interleaved.
#[multiversion(targets = "simd")]
fn render_means(srgb: &Srgb, channels: &[Vec<f32>], out: &mut [f32]) {
    srgb.render(channels, out, |value| value);
}

/// Writes colours as whole grey levels, interleaved.
#[multiversion(targets = "simd")]
fn render_levels(srgb: &Srgb, channels: &[Vec<u16>], out: &mut [u16]) {
    /// Adding 2²³ to a smaller number rounds it to an integer, which the lowest bits then hold.
    const UNIT: f32 = 8_388_608.0;
    srgb.render(channels, out, |value| (value + UNIT).to_bits() as u16);
}

/// Returns the sRGB tone curve from 0 to 1, with an error below 2e-6.
#[inline(always)]
fn encoded(linear: f32) -> f32 {
    /// Minimax polynomial of s^(5/3) above the straight part of the curve.
    const POWER: [f32; 7] =
        [-0.004_309_593_5, 0.132_326_34, 1.294_711_2, -0.808_488_66, 0.622_924_86, -0.301_814_45, 0.064_651_66];
    // x^(1/2.4) = (x^¼)^(5/3)
    let root = linear.sqrt().sqrt();
    let power = POWER.iter().rev().fold(0.0, |sum, coefficient| sum * root + coefficient);
    if linear <= 0.003_130_8 { 12.92 * linear } else { 1.055 * power - 0.055 }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sum_over_adds_only_the_pixels_inside_the_tile() {
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

    #[test]
    fn colours_match_the_standard() {
        let colour = colour(3200.0, Mixing::Spectral).unwrap();
        for (matrix, bits) in [(colour.to_srgb(), 8), (&UNCHANGED, 12), (&UNCHANGED, 16)] {
            let srgb = Srgb::new(matrix, 16, bits);
            let highest = highest(bits);
            for pixels in [1, LANES, 5 * LANES + 3, 70_000] {
                let level = |i: usize, channel: usize| (i * [1, 7, 11][channel] + 300 * channel) as u16;
                let levels = [0, 1, 2].map(|channel| (0..pixels).map(|i| level(i, channel)).collect::<Vec<_>>());
                let means = levels.each_ref().map(|levels| levels.iter().map(|&level| f32::from(level)).collect());
                let (mut grey, mut mean) = (vec![7; 3 * pixels], vec![7.0; 3 * pixels]);
                render_levels(&srgb, &levels, &mut grey);
                render_means(&srgb, &means, &mut mean);
                for (i, (grey, mean)) in grey.iter().zip(&mean).enumerate() {
                    let channels = [0, 1, 2].map(|channel| f64::from(level(i / 3, channel)) / 65_535.0);
                    let linear: f64 = matrix[i % 3].iter().zip(channels).map(|(m, v)| m * v).sum();
                    let linear = linear.clamp(0.0, 1.0);
                    let exact = highest
                        * if linear <= 0.003_130_8 {
                            12.92 * linear
                        } else {
                            1.055 * libm::pow(linear, 1.0 / 2.4) - 0.055
                        };
                    assert!((f64::from(*mean) - exact).abs() < 3e-6 * highest, "{bits} {i}: {mean} {exact}");
                    assert!((f64::from(*grey) - exact).abs() < 0.5 + 3e-6 * highest, "{bits} {i}: {grey} {exact}");
                }
            }
        }
    }
}
