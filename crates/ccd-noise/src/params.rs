use crate::error::{Error, require, within};

/// Model of photon noise (shot noise): g_po of Eq. 13.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub enum PhotonNoise {
    /// A Poisson deviate, exact at every mean.
    #[default]
    Exact,
    /// One normal deviate for shot and read noise together for means of at least `mean_e` electrons; exact below. Mean
    /// and variance are correct. The skewness, 1/√µ, is missing: 0.007 at 17 850 electrons, 0.07 at 200.
    NormalAbove {
        /// The smallest mean that uses the normal deviate, in electrons, >= 0.
        mean_e: f64,
    },
    /// No photon noise: each pixel holds its mean. Read noise remains.
    Off,
}

/// Model of read noise: g_g of Eq. 13.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum ReadNoise {
    /// The same in every pixel: one amplifier reads all pixels, as in a CCD.
    Same {
        /// Standard deviation in electrons, 0 to 1e6.
        e: f64,
    },
    /// One amplifier per pixel, as in CMOS. The standard deviations are log-normal over pixels; a few pixels are very
    /// noisy. Data sheets give both numbers.
    PerPixel {
        /// Median over pixels, in electrons, above 0, at most 1e6.
        median_e: f64,
        /// Root mean square over pixels, in electrons, `median_e` to 20 times `median_e`. EMVA 1288 measures this
        /// value.
        rms_e: f64,
    },
}

impl ReadNoise {
    /// Returns the root mean square over pixels, in electrons: σ_d of EMVA 1288 without dark current.
    #[must_use]
    pub fn rms_e(self) -> f64 {
        match self {
            Self::Same { e } => e,
            Self::PerPixel { rms_e, .. } => rms_e,
        }
    }

    /// Returns the standard deviation of the natural logarithm over pixels: rms² = median²·exp(2s²).
    pub(crate) fn spread(self) -> f64 {
        match self {
            Self::Same { .. } => 0.0,
            Self::PerPixel { median_e, rms_e } => libm::log(rms_e / median_e).sqrt(),
        }
    }
}

/// Model of blooming: where charge beyond the full-well capacity goes.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub enum Blooming {
    /// Excess charge is lost; the pixel stays full.
    #[default]
    Off,
    /// Excess charge flows to neighbouring pixels, as in a CCD. The anti-blooming drain removes the fraction
    /// `anti_blooming`. Of the rest, the fraction `vertical` moves along the column, half up and half down, to the next
    /// pixels with free capacity. The remainder moves to the left and right neighbours, half each.
    On {
        /// 0 to 1; near 1 in a CCD, where channel stops separate the columns.
        vertical: f64,
        /// 0 to 1; 0 conserves charge, 1 equals [`Blooming::Off`].
        anti_blooming: f64,
    },
}

/// Parameters of a camera that converts photo-electrons to grey levels: the linear model of EMVA 1288.
///
/// The default camera has no fixed pattern and no dark current. The presets [`orca_05g`](Self::orca_05g) and
/// [`scmos`](Self::scmos) have both.
#[derive(Debug, Clone, PartialEq)]
pub struct CameraParams {
    /// Quantum efficiency: photo-electrons per photon, above 0, at most 1. Only
    /// [`Camera::electrons_from_photons`](crate::Camera::electrons_from_photons) uses it; frames are computed from
    /// photo-electrons. Default 0.65, ours: assumed for an interline CCD at 570 nm.
    pub quantum_efficiency: f64,
    /// Exposure time in seconds, 0 to 1e6. It determines the dark signal; the light of a frame is given per exposure.
    /// Default 0.02, ours: a typical value in bright field.
    pub exposure_s: f64,
    /// Dark current at `dark_reference_c` in electrons per second and pixel, 0 to 1e6. Default 0, the paper's.
    pub dark_current_e_per_s: f64,
    /// Sensor temperature at which the dark current is given, in °C, -273.15 to 150. Default 25, ours.
    pub dark_reference_c: f64,
    /// Sensor temperature in °C, -273.15 to 150. Default 25, ours.
    pub temperature_c: f64,
    /// Temperature rise that doubles the dark current, in kelvin, above 0, at most 100. Default 8, ours: silicon has 6
    /// to 10.
    pub dark_doubling_c: f64,
    /// Photo response non-uniformity (PRNU): standard deviation of the pixels' responses as a fraction of their mean, 0
    /// to 1. Default 0, the paper's.
    pub prnu: f64,
    /// Dark signal non-uniformity (DSNU): standard deviation of the pixels' offsets in electrons, 0 to 1e6. Default 0,
    /// the paper's.
    pub dsnu_e: f64,
    /// Serial number of the camera. The fixed pattern of response, offset and per-pixel read noise is a function of
    /// this number and of the pixel position; it is the same in every frame. Default 1, ours.
    pub serial: u64,
    /// Full-well capacity: the most electrons that a pixel can hold, dark current included, above 0, at most 1e7. It is
    /// not the saturation capacity of EMVA 1288, which
    /// [`Camera::saturation_capacity_e`](crate::Camera::saturation_capacity_e) returns. Default 18 000, ours: an
    /// interline CCD with pixels of 6.45 µm. The paper's program has 255 · 70 = 17 850.
    pub full_well_e: f64,
    /// Model of charge beyond the full-well capacity. Default off, ours: it is lost.
    pub blooming: Blooming,
    /// Read noise. Default 8 electrons in every pixel, ours: the data sheet of a CCD of this class. The paper's program
    /// has one grey level, 70 electrons.
    pub read_noise: ReadNoise,
    /// Overall system gain K in grey levels per electron (EMVA 1288), above 0, at most 1e6. Default 255 / 17 600, ours:
    /// the converter clips just below the full-well capacity. The paper's program has 1 / 70.
    pub gain_dn_per_e: f64,
    /// Grey level of a dark pixel without dark current, from -10 times to below the highest grey level 2ᵇ - 1. A
    /// negative value is a subtracted black level. Default 0, the paper's.
    pub offset_dn: f64,
    /// Bit depth of the converter, 8 to 16. Default 8, the paper's.
    pub bit_depth: u32,
    /// Model of photon noise. Default exact, the paper's.
    pub photon_noise: PhotonNoise,
}

impl Default for CameraParams {
    fn default() -> Self {
        Self {
            quantum_efficiency: 0.65,
            exposure_s: 0.02,
            dark_current_e_per_s: 0.0,
            dark_reference_c: 25.0,
            temperature_c: 25.0,
            dark_doubling_c: 8.0,
            prnu: 0.0,
            dsnu_e: 0.0,
            serial: 1,
            full_well_e: 18_000.0,
            blooming: Blooming::Off,
            read_noise: ReadNoise::Same { e: 8.0 },
            gain_dn_per_e: 255.0 / 17_600.0,
            offset_dn: 0.0,
            bit_depth: 8,
            photon_noise: PhotonNoise::Exact,
        }
    }
}

impl CameraParams {
    /// Returns the camera of the authors' program: 8 bits, 70 electrons per grey level, read noise of one grey level,
    /// no fixed pattern and no dark current.
    ///
    /// The full-well capacity is 255 · 70 electrons. The program counts electrons; the quantum efficiency is therefore
    /// 1.
    #[must_use]
    pub fn paper() -> Self {
        Self {
            quantum_efficiency: 1.0,
            full_well_e: 255.0 * 70.0,
            gain_dn_per_e: 1.0 / 70.0,
            read_noise: ReadNoise::Same { e: 70.0 },
            ..Self::default()
        }
    }

    /// Returns the camera used in the paper, a Hamamatsu ORCA-05G: an interline CCD of 1344 x 1024 pixels of 6.45 µm,
    /// at its full 12 bits.
    ///
    /// The table in the crate documentation lists the values and their sources. Dark current doubles per 8 K (assumed).
    #[must_use]
    pub fn orca_05g() -> Self {
        Self {
            quantum_efficiency: 0.65,
            dark_current_e_per_s: 1.0,
            prnu: 0.007,
            dsnu_e: 2.0,
            gain_dn_per_e: (4095.0 - 100.0) / 17_600.0,
            offset_dn: 100.0,
            bit_depth: 12,
            ..Self::default()
        }
    }

    /// Returns a scientific CMOS camera of the class of the Hamamatsu ORCA-Flash4.0: 2048 x 2048 pixels of 6.5 µm, 16
    /// bits, one amplifier per pixel.
    ///
    /// The table in the crate documentation lists the values. Log-normal read noise and dark current that doubles per 8
    /// K are also assumed.
    #[must_use]
    pub fn scmos() -> Self {
        Self {
            quantum_efficiency: 0.82,
            dark_current_e_per_s: 0.06,
            dark_reference_c: -10.0,
            temperature_c: -10.0,
            prnu: 0.003,
            dsnu_e: 0.3,
            full_well_e: 30_000.0,
            read_noise: ReadNoise::PerPixel { median_e: 1.0, rms_e: 1.6 },
            gain_dn_per_e: (65_535.0 - 100.0) / 29_340.0,
            offset_dn: 100.0,
            bit_depth: 16,
            ..Self::default()
        }
    }

    /// Returns the mean dark signal in electrons: i_ref · 2^((T - T_ref) / T_d) · t.
    #[must_use]
    pub fn dark_e(&self) -> f64 {
        let doublings = (self.temperature_c - self.dark_reference_c) / self.dark_doubling_c;
        self.dark_current_e_per_s * libm::exp2(doublings) * self.exposure_s
    }

    pub(crate) fn check(&self) -> Result<(), Error> {
        let fraction = |field, value| within(field, value, 0.0..=1.0, "from 0 to 1");
        let up_to_1e6 = |field, value| within(field, value, 0.0..=1e6, "from 0 to 1e6");
        let positive =
            |field, value: f64, most, accepted| require(field, value, value > 0.0 && value <= most, accepted);
        let celsius = |field, value| within(field, value, -273.15..=150.0, "from -273.15 to 150");
        positive("quantum_efficiency", self.quantum_efficiency, 1.0, "above 0 and at most 1")?;
        up_to_1e6("exposure_s", self.exposure_s)?;
        up_to_1e6("dark_current_e_per_s", self.dark_current_e_per_s)?;
        celsius("dark_reference_c", self.dark_reference_c)?;
        celsius("temperature_c", self.temperature_c)?;
        positive("dark_doubling_c", self.dark_doubling_c, 100.0, "above 0 and at most 100")?;
        fraction("prnu", self.prnu)?;
        up_to_1e6("dsnu_e", self.dsnu_e)?;
        let well = positive("full_well_e", self.full_well_e, 1e7, "above 0 and at most 1e7")?;
        let room = "short enough that the dark signal is less than full_well_e";
        require("exposure_s", self.exposure_s, self.dark_e() < well, room)?;
        if let Blooming::On { vertical, anti_blooming } = self.blooming {
            fraction("blooming.vertical", vertical)?;
            fraction("blooming.anti_blooming", anti_blooming)?;
            require("full_well_e", well, well >= 1.0, "at least 1 with blooming")?;
        }
        match self.read_noise {
            ReadNoise::Same { e } => up_to_1e6("read_noise.e", e)?,
            ReadNoise::PerPixel { median_e, rms_e } => {
                positive("read_noise.median_e", median_e, 1e6, "above 0 and at most 1e6")?;
                // Larger values overflow single precision in the noisiest pixels.
                let uneven = median_e..=20.0 * median_e;
                within("read_noise.rms_e", rms_e, uneven, "from read_noise.median_e to 20 times that")?
            }
        };
        positive("gain_dn_per_e", self.gain_dn_per_e, 1e6, "above 0 and at most 1e6")?;
        within("bit_depth", self.bit_depth.into(), 8.0..=16.0, "from 8 to 16")?;
        let (offset, highest) = (self.offset_dn, f64::from(self.max_dn()));
        let level = offset >= -10.0 * highest && offset < highest;
        require("offset_dn", offset, level, "from -10 times the highest grey level, 2^bit_depth - 1, to below it")?;
        if let PhotonNoise::NormalAbove { mean_e } = self.photon_noise {
            require("photon_noise.mean_e", mean_e, mean_e >= 0.0, "at least 0")?;
        }
        Ok(())
    }

    /// Returns the highest grey level, 2ᵇ - 1. `bit_depth` must be valid.
    #[expect(clippy::cast_possible_truncation, reason = "at most 16 bits")]
    pub(crate) fn max_dn(&self) -> u16 {
        ((1_u32 << self.bit_depth) - 1) as u16
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn out_of_range_values_are_rejected_by_field() {
        type Set = fn(&mut CameraParams, f64);
        // A field, rejected values besides negative, huge and non-finite ones, and accepted values.
        let fields: [(&str, Set, &[f64], &[f64]); 17] = [
            ("quantum_efficiency", |p, v| p.quantum_efficiency = v, &[0.0, 1.01], &[1.0]),
            ("exposure_s", |p, v| (p.exposure_s, p.dark_current_e_per_s) = (v, 1e3), &[18.0], &[0.0, 17.9]),
            ("dark_current_e_per_s", |p, v| p.dark_current_e_per_s = v, &[], &[0.0]),
            ("dark_reference_c", |p, v| p.dark_reference_c = 274.0 * v, &[], &[0.5]),
            ("temperature_c", |p, v| p.temperature_c = 274.0 * v, &[], &[0.5]),
            ("dark_doubling_c", |p, v| p.dark_doubling_c = v, &[0.0, 101.0], &[100.0]),
            ("prnu", |p, v| p.prnu = v, &[1.1], &[0.0, 1.0]),
            ("dsnu_e", |p, v| p.dsnu_e = v, &[], &[0.0]),
            ("full_well_e", |p, v| p.full_well_e = v, &[0.0], &[1e7]),
            ("gain_dn_per_e", |p, v| p.gain_dn_per_e = v, &[0.0], &[1e6]),
            ("offset_dn", |p, v| p.offset_dn = 2551.0 * v, &[0.1], &[-0.99, 0.099]),
            ("read_noise.e", |p, v| p.read_noise = ReadNoise::Same { e: v }, &[], &[0.0]),
            (
                "read_noise.median_e",
                |p, v| p.read_noise = ReadNoise::PerPixel { median_e: v, rms_e: v },
                &[0.0],
                &[2.0],
            ),
            (
                "read_noise.rms_e",
                |p, v| p.read_noise = ReadNoise::PerPixel { median_e: 1.0, rms_e: v },
                &[0.99, 20.1],
                &[1.0, 20.0],
            ),
            ("blooming.vertical", |p, v| p.blooming = Blooming::On { vertical: v, anti_blooming: 0.0 }, &[1.1], &[0.0]),
            (
                "blooming.anti_blooming",
                |p, v| p.blooming = Blooming::On { vertical: 0.5, anti_blooming: v },
                &[1.1],
                &[0.0, 1.0],
            ),
            ("photon_noise.mean_e", |p, v| p.photon_noise = PhotonNoise::NormalAbove { mean_e: v }, &[], &[0.0, 1e300]),
        ];
        for (field, set, rejected, accepted) in fields {
            let check = |value: f64| {
                let mut params = CameraParams::default();
                set(&mut params, value);
                params.check()
            };
            let always_rejected = [f64::NAN, f64::INFINITY, -1.0, 1e300];
            for value in always_rejected.iter().filter(|value| !accepted.contains(value)).chain(rejected) {
                let error = check(*value).unwrap_err().to_string();
                assert!(error.starts_with(&format!("{field} is ")), "{field}, {value}: {error}");
            }
            accepted.iter().for_each(|value| check(*value).unwrap());
        }
        for bit_depth in [0, 7, 17, u32::MAX] {
            let error = CameraParams { bit_depth, ..CameraParams::default() }.check().unwrap_err().to_string();
            assert!(error.starts_with("bit_depth is "), "{error}");
        }
        assert_eq!(
            CameraParams { offset_dn: 255.0, ..CameraParams::default() }.check().unwrap_err().to_string(),
            "offset_dn is 255; it must be from -10 times the highest grey level, 2^bit_depth - 1, to below it"
        );
    }

    #[test]
    fn dark_current_doubles_per_doubling_temperature() {
        let cold = CameraParams { dark_current_e_per_s: 3.0, exposure_s: 2.0, ..CameraParams::default() };
        for doublings in [-3_i32, -1, 0, 1, 2, 5] {
            let temperature_c = cold.temperature_c + f64::from(doublings) * cold.dark_doubling_c;
            let warm = CameraParams { temperature_c, ..cold.clone() };
            assert_eq!(warm.dark_e(), 6.0 * libm::exp2(f64::from(doublings)));
        }
        assert_eq!(CameraParams { exposure_s: 4.0, ..cold }.dark_e(), 12.0);
    }

    #[test]
    fn presets_saturate_at_the_converter() {
        for params in [CameraParams::default(), CameraParams::paper(), CameraParams::orca_05g(), CameraParams::scmos()]
        {
            let converter = (f64::from(params.max_dn()) - params.offset_dn) / params.gain_dn_per_e;
            assert!((0.97..1.0 + 1e-9).contains(&(converter / params.full_well_e)), "{params:?}");
        }
    }
}
