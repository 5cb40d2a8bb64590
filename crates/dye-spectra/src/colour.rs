use crate::curve::Curve;
use crate::dye::{Amounts, DYES, Dye};
use crate::params::{ColourParams, Error, Mixing, require};
use crate::rows::{self, Terms, Wavelength};
use crate::srgb;

/// Bands of the integral of lamp times sensitivity: 0.25 nm each. The sharpest edge of a sensitivity has a standard
/// deviation of 3.7 nm.
const FINE_BANDS: usize = 1200;

/// A wavelength of a channel with its weight.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Node {
    /// Wavelength in µm.
    pub wavelength_um: f64,
    /// Fraction of the channel's light. The weights of a channel sum to 1.
    pub weight: f64,
}

/// Properties of a camera channel for an empty slide.
#[derive(Debug, Clone, PartialEq)]
pub struct Channel {
    /// Mean wavelength of its light in µm.
    pub wavelength_um: f64,
    /// Full width in µm of a rectangular band with the same variance.
    pub bandwidth_um: f64,
    /// Light relative to the strongest channel.
    pub relative_light: f64,
    /// Wavelengths, the same in all channels, with their weights.
    pub nodes: Vec<Node>,
}

/// Light of each channel as a function of dye amounts.
#[derive(Debug, Clone, PartialEq)]
pub struct Colour {
    channels: [Channel; 3],
    terms: Vec<Wavelength>,
    rows: Terms,
    to_srgb: [[f64; 3]; 3],
}

impl Colour {
    /// Evaluates lamp and sensor at the wavelengths.
    ///
    /// # Errors
    ///
    /// [`Error::OutOfRange`] if a field of `params` is out of range.
    pub fn new(params: &ColourParams) -> Result<Self, Error> {
        params.check()?;
        let channels = channels(params);
        let spectral: Vec<Wavelength> = (0..params.wavelengths)
            .map(|i| {
                let wavelength_um = channels[0].nodes[i].wavelength_um;
                let weights = std::array::from_fn(|c| channels[c].nodes[i].weight);
                (Dye::ALL.map(|dye| dye.absorbance(wavelength_um)), weights)
            })
            .collect();
        let to_srgb = srgb::matrix(params, &spectral);
        let terms = match params.mixing {
            Mixing::Spectral => spectral,
            Mixing::ThreeVectors => (0..3).map(|c| mean_term(&spectral, c)).collect(),
        };
        Ok(Self { channels, rows: Terms::new(&terms), terms, to_srgb })
    }

    /// Returns the properties of the red, green and blue channels for an empty slide.
    #[must_use]
    pub fn channels(&self) -> &[Channel; 3] {
        &self.channels
    }

    /// Returns white balance gains, which make the empty slide grey: 1 / `relative_light`.
    #[must_use]
    pub fn white_balance(&self) -> [f64; 3] {
        self.channels.each_ref().map(|channel| 1.0 / channel.relative_light)
    }

    /// Returns the colour matrix from white-balanced camera channels to linear sRGB, one row per red, green and blue.
    ///
    /// White stays white. The rest is a least-squares fit to the colours of stained smears for the 1931 standard
    /// observer, adapted to the lamp. Results may lie slightly outside 0 to 1.
    #[must_use]
    pub fn to_srgb(&self) -> &[[f64; 3]; 3] {
        &self.to_srgb
    }

    /// Returns the light in each channel relative to an empty slide, in double precision.
    #[must_use]
    pub fn transmittance(&self, amounts: &Amounts) -> [f64; 3] {
        rows::exact(&self.terms, amounts)
    }

    /// Writes the light in each channel relative to an empty slide to `out`.
    ///
    /// `amounts` are planes in the order of [`Dye::ALL`], with values of at least 0. An empty plane means no dye. Each
    /// pixel depends only on its own amounts, and is exactly 1 if they are 0. The absolute error is below 1e-5.
    ///
    /// # Panics
    ///
    /// If the planes of `out` differ in length, or a non-empty plane of `amounts` has another length.
    pub fn transmittance_into(&self, amounts: [&[f32]; DYES], out: [&mut [f32]; 3]) {
        let pixels = out[0].len();
        assert!(out.iter().all(|plane| plane.len() == pixels), "all channels must have the same length");
        let fits = |plane: &&[f32]| plane.is_empty() || plane.len() == pixels;
        assert!(amounts.iter().all(fits), "planes of amounts must be empty or as long as the channels");
        rows::transmittance(&self.rows, amounts, out);
    }

    /// Returns the light of a mixture of dyes as a function of its amount.
    ///
    /// # Errors
    ///
    /// [`Error::OutOfRange`] if an amount in `mix` is not from 0 to 1000.
    pub fn curve(&self, mix: &Amounts) -> Result<Curve, Error> {
        for amount in mix {
            require("mix", *amount, (0.0..=1e3).contains(amount), "from 0 to 1000")?;
        }
        Ok(Curve::new(&self.terms, mix))
    }

    /// Returns the stain vector of a dye for colour deconvolution: its absorbance in each channel at low density,
    /// normalised to length 1.
    #[must_use]
    pub fn stain_vector(&self, dye: Dye) -> [f64; 3] {
        let thin = |c: usize| {
            let nodes = self.channels[c].nodes.iter();
            nodes.map(|node| node.weight * dye.absorbance(node.wavelength_um)).sum::<f64>()
        };
        let vector: [f64; 3] = std::array::from_fn(thin);
        let length = vector.iter().map(|v| v * v).sum::<f64>().sqrt();
        vector.map(|v| v / length)
    }
}

/// Returns the mean absorbance of each dye over a channel's light, with a weight of 1 for that channel.
fn mean_term(spectral: &[Wavelength], c: usize) -> Wavelength {
    let mean = |d: usize| spectral.iter().map(|(absorbances, weights)| weights[c] * absorbances[d]).sum();
    let mut weights = [0.0; 3];
    weights[c] = 1.0;
    (std::array::from_fn(mean), weights)
}

fn channels(params: &ColourParams) -> [Channel; 3] {
    let light = |wavelength_um: f64| {
        let power = params.lamp.power(wavelength_um);
        params.sensor.sensitivity(wavelength_um).map(|sensitivity| sensitivity * power)
    };
    let fine: Vec<(f64, [f64; 3])> = params.band_centres(FINE_BANDS).map(|w| (w, light(w))).collect();
    let total = |c: usize| fine.iter().map(|(_, light)| light[c]).sum::<f64>();
    let strongest = (0..3).map(total).fold(0.0, f64::max);
    std::array::from_fn(|c| {
        let mean = |f: &dyn Fn(f64) -> f64| fine.iter().map(|(w, light)| f(*w) * light[c]).sum::<f64>() / total(c);
        let wavelength_um = mean(&|w| w);
        let variance = mean(&|w| (w - wavelength_um) * (w - wavelength_um));
        let at = |w: f64| Node { wavelength_um: w, weight: light(w)[c] };
        let mut nodes: Vec<Node> = params.band_centres(params.wavelengths).map(at).collect();
        let sum: f64 = nodes.iter().map(|node| node.weight).sum();
        nodes.iter_mut().for_each(|node| node.weight /= sum);
        // A rectangular band of width b has the variance b²/12.
        Channel { wavelength_um, bandwidth_um: (12.0 * variance).sqrt(), relative_light: total(c) / strongest, nodes }
    })
}

#[cfg(feature = "image")]
impl Colour {
    /// Returns an 8-bit sRGB image of light from [`transmittance_into`](Self::transmittance_into), in rows of `width`
    /// pixels. Applies the matrix [`to_srgb`](Self::to_srgb) and the transfer curve
    /// [`encode_srgb`](crate::encode_srgb).
    ///
    /// ```
    /// use dye_spectra::{Colour, ColourParams, Dye, amounts};
    ///
    /// let colour = Colour::new(&ColourParams::default())?;
    /// let ramp: Vec<f32> = (0..64 * 48).map(|i| (i % 64) as f32 / 64.0).collect();
    /// let mut light = [(); 3].map(|()| vec![0.0; ramp.len()]);
    /// let eosin = colour.curve(&amounts([(Dye::EosinY, 1.0)]))?;
    /// eosin.transmittance_into(&ramp, light.each_mut().map(|plane| &mut plane[..]));
    /// let image = colour.srgb_image(light.each_ref().map(|plane| &plane[..]), 64);
    /// assert_eq!(image.get_pixel(0, 0).0, [255; 3]);
    /// # Ok::<(), dye_spectra::Error>(())
    /// ```
    ///
    /// # Panics
    ///
    /// If the planes of `light` differ in length, or their length is not a multiple of `width`.
    #[must_use]
    pub fn srgb_image(&self, light: [&[f32]; 3], width: usize) -> image::RgbImage {
        let pixels = light[0].len();
        assert!(light.iter().all(|plane| plane.len() == pixels), "all channels must have the same length");
        assert!(width > 0 && pixels.is_multiple_of(width), "{pixels} pixels are not a multiple of the width, {width}");
        let side = |pixels: usize| u32::try_from(pixels).expect("width and height are below 2^32");
        image::RgbImage::from_fn(side(width), side(pixels / width), |x, y| {
            let i = y as usize * width + x as usize;
            let camera = light.map(|plane| f64::from(plane[i]));
            image::Rgb(self.to_srgb().map(|row| srgb::encode_srgb(row.iter().zip(camera).map(|(m, v)| m * v).sum())))
        })
    }
}
