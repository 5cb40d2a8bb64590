use crate::curve::Curve;
use crate::dye::{Amounts, DYES, Dye};
use crate::params::{ColourParams, Error, Mixing, require};
use crate::rows::{self, Terms, Wavelength};
use crate::srgb;

/// Bands over which lamp times sensitivity is summed: 0.25 nm each, where the sharpest edge of a sensitivity has a
/// standard deviation of 3.7 nm.
const FINE_BANDS: usize = 1200;

/// One wavelength of a channel.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Node {
    /// The wavelength in µm.
    pub wavelength_um: f64,
    /// Its share of the channel's light; the shares of a channel add up to 1.
    pub weight: f64,
}

/// What one channel of the camera sees of an empty slide.
#[derive(Debug, Clone, PartialEq)]
pub struct Channel {
    /// Mean wavelength of its light in µm.
    pub wavelength_um: f64,
    /// Full width in µm of an even band with the same variance.
    pub bandwidth_um: f64,
    /// Its light, relative to that of the strongest channel, whose is 1.
    pub share: f64,
    /// The wavelengths, the same in all channels, and how much each counts.
    pub nodes: Vec<Node>,
}

/// The light of each channel as a function of the amounts of dye.
#[derive(Debug, Clone, PartialEq)]
pub struct Colour {
    channels: [Channel; 3],
    terms: Vec<Wavelength>,
    rows: Terms,
    to_srgb: [[f64; 3]; 3],
}

impl Colour {
    /// Takes lamp and sensor at their wavelengths.
    ///
    /// # Errors
    ///
    /// [`Error::OutOfRange`] if a field of `params` is outside its range.
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

    /// What red, green and blue see of an empty slide.
    #[must_use]
    pub fn channels(&self) -> &[Channel; 3] {
        &self.channels
    }

    /// Factors that make the empty slide grey, as a microscope camera's white balance does: 1 / share.
    #[must_use]
    pub fn white_balance(&self) -> [f64; 3] {
        self.channels.each_ref().map(|channel| 1.0 / channel.share)
    }

    /// From white-balanced light in the camera's channels to linear sRGB: a row of the matrix for each of red, green
    /// and blue. White stays white; the rest is a least-squares fit to how the 1931 standard observer, adapted to
    /// the lamp, sees stained smears. Results can lie somewhat outside 0 to 1.
    #[must_use]
    pub fn to_srgb(&self) -> &[[f64; 3]; 3] {
        &self.to_srgb
    }

    /// Light in each channel relative to the empty slide, in double precision.
    #[must_use]
    pub fn transmittance(&self, amounts: &Amounts) -> [f64; 3] {
        rows::exact(&self.terms, amounts)
    }

    /// Light in each channel relative to the empty slide, from planes of amounts in the order of [`Dye::ALL`], each 0
    /// or more; an empty plane stands for none of that dye. What a pixel gets depends on its own amounts alone, and
    /// is exactly 1 where they are 0. Absolute error below 1e-5.
    ///
    /// # Panics
    ///
    /// If the planes of `out` differ in length, or a plane of `amounts` is neither empty nor as long as they are.
    pub fn transmittance_into(&self, amounts: [&[f32]; DYES], out: [&mut [f32]; 3]) {
        let pixels = out[0].len();
        assert!(out.iter().all(|plane| plane.len() == pixels), "the channels differ in length");
        let fits = |plane: &&[f32]| plane.is_empty() || plane.len() == pixels;
        assert!(amounts.iter().all(fits), "a plane of amounts is not as long as the channels");
        rows::transmittance(&self.rows, amounts, out);
    }

    /// The light of a mixture of dyes as a function of how much there is of it.
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

    /// Absorbance in each channel of a thin amount of a dye, scaled to length 1: the dye's vector of colour
    /// deconvolution.
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

/// Mean absorbance of each dye over a channel's light, for that channel alone.
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
    let fine: Vec<(f64, [f64; 3])> = params.middles(FINE_BANDS).map(|w| (w, light(w))).collect();
    let total = |c: usize| fine.iter().map(|(_, light)| light[c]).sum::<f64>();
    let strongest = (0..3).map(total).fold(0.0, f64::max);
    std::array::from_fn(|c| {
        let mean = |f: &dyn Fn(f64) -> f64| fine.iter().map(|(w, light)| f(*w) * light[c]).sum::<f64>() / total(c);
        let wavelength_um = mean(&|w| w);
        let variance = mean(&|w| (w - wavelength_um) * (w - wavelength_um));
        let at = |w: f64| Node { wavelength_um: w, weight: light(w)[c] };
        let mut nodes: Vec<Node> = params.middles(params.wavelengths).map(at).collect();
        let sum: f64 = nodes.iter().map(|node| node.weight).sum();
        nodes.iter_mut().for_each(|node| node.weight /= sum);
        // An even band of width b has the variance b²/12.
        Channel { wavelength_um, bandwidth_um: (12.0 * variance).sqrt(), share: total(c) / strongest, nodes }
    })
}

#[cfg(feature = "image")]
impl Colour {
    /// The picture that a screen shows: light of [`transmittance_into`](Self::transmittance_into), row by row of `width`,
    /// by the matrix [`to_srgb`](Self::to_srgb) and the curve [`encode_srgb`](crate::encode_srgb).
    ///
    /// ```
    /// use dye_spectra::{Colour, ColourParams, Dye, amounts};
    ///
    /// let colour = Colour::new(&ColourParams::default())?;
    /// let ramp: Vec<f32> = (0..64 * 48).map(|i| (i % 64) as f32 / 64.0).collect();
    /// let mut light = [(); 3].map(|()| vec![0.0; ramp.len()]);
    /// let eosin = colour.curve(&amounts([(Dye::EosinY, 1.0)]))?;
    /// eosin.transmittance_into(&ramp, light.each_mut().map(|plane| &mut plane[..]));
    /// let picture = colour.srgb_image(light.each_ref().map(|plane| &plane[..]), 64);
    /// assert_eq!(picture.get_pixel(0, 0).0, [255; 3]);
    /// # Ok::<(), dye_spectra::Error>(())
    /// ```
    ///
    /// # Panics
    ///
    /// If the planes of `light` are not whole rows of `width`, all of one length.
    #[must_use]
    pub fn srgb_image(&self, light: [&[f32]; 3], width: usize) -> image::RgbImage {
        let pixels = light[0].len();
        assert!(light.iter().all(|plane| plane.len() == pixels), "the channels differ in length");
        assert!(width > 0 && pixels.is_multiple_of(width), "width {width} must divide the {pixels} pixels");
        let side = |pixels: usize| u32::try_from(pixels).expect("sides are below 2^32");
        image::RgbImage::from_fn(side(width), side(pixels / width), |x, y| {
            let i = y as usize * width + x as usize;
            let seen = light.map(|plane| f64::from(plane[i]));
            image::Rgb(self.to_srgb().map(|row| srgb::encode_srgb(row.iter().zip(seen).map(|(m, v)| m * v).sum())))
        })
    }
}
