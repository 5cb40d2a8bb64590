use crate::error::{Error, require};

/// How the number of photo-electrons in a pixel is drawn: g_po of Eq. 13.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub enum PhotonNoise {
    /// A Poisson deviate, exact at every mean.
    #[default]
    Exact,
    /// One normal deviate for shot and read noise together where the mean is `mean_e` electrons or
    /// more, exact below. Mean and variance are right; the skewness, 1/√µ, is missing: 0.007 at
    /// 17 850 electrons, 0.07 at 200.
    NormalAbove {
        /// The least mean at which the normal deviate is used, in electrons, >= 0.
        mean_e: f64,
    },
    /// None: the mean itself. Read noise remains.
    Off,
}

/// How much noise reading a pixel adds: g_g of Eq. 13.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum ReadNoise {
    /// As much in every pixel: one amplifier reads them all, as in a CCD.
    Same {
        /// Standard deviation in electrons, 0 to 1e6.
        e: f64,
    },
    /// Every pixel has an amplifier of its own, as in CMOS: their standard deviations are log-normal
    /// over the pixels, with few very noisy ones. Data sheets give both numbers.
    PerPixel {
        /// The median over the pixels in electrons, above 0, at most 1e6.
        median_e: f64,
        /// The root of the mean square over the pixels in electrons, `median_e` to 20 times that. It is what
        /// EMVA 1288 measures.
        rms_e: f64,
    },
}

impl ReadNoise {
    /// Root mean square over the pixels, in electrons: σ_d of EMVA 1288 without dark current.
    #[must_use]
    pub fn rms_e(self) -> f64 {
        match self {
            Self::Same { e } => e,
            Self::PerPixel { rms_e, .. } => rms_e,
        }
    }

    /// Standard deviation of the logarithm over the pixels: rms² = median²·exp(2s²).
    pub(crate) fn spread(self) -> f64 {
        match self {
            Self::Same { .. } => 0.0,
            Self::PerPixel { median_e, rms_e } => libm::log(rms_e / median_e).sqrt(),
        }
    }
}

/// Where the charge goes that a full pixel cannot hold.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub enum Blooming {
    /// Nowhere: it is lost, and the pixel stays full.
    #[default]
    Off,
    /// To its neighbours, as in a CCD. A share of `anti_blooming` goes down the drain beside the pixel; of the
    /// rest, a share of `vertical` goes half up and half down its column, until it finds room, the remainder
    /// half to the left and half to the right neighbour.
    On {
        /// 0 to 1; near 1 in a CCD, whose columns are kept apart by channel stops.
        vertical: f64,
        /// 0 to 1; 0 conserves charge, 1 is [`Blooming::Off`].
        anti_blooming: f64,
    },
}

/// A camera that turns photo-electrons into grey levels: the linear model of EMVA 1288.
///
/// The default camera is even and dark: no fixed pattern, no dark current. The presets
/// [`orca_05g`](Self::orca_05g) and [`scmos`](Self::scmos) have both.
#[derive(Debug, Clone, PartialEq)]
pub struct CameraParams {
    /// Photo-electrons per photon, above 0, at most 1. It matters to
    /// [`Camera::electrons_from_photons`](crate::Camera::electrons_from_photons) alone; frames are made from
    /// photo-electrons. Default 0.65, ours: assumed for an interline CCD at 570 nm.
    pub quantum_efficiency: f64,
    /// How long the pixels gather dark current, in seconds, 0 to 1e6. The light of a frame is given as it is
    /// gathered in this time. Default 0.02, ours: of the order used in bright field.
    pub exposure_s: f64,
    /// Dark current at `dark_reference_c` in electrons per second and pixel, 0 to 1e6. Default 0, the paper's.
    pub dark_current_e_per_s: f64,
    /// Temperature of the sensor for which the dark current is given, in °C, -273.15 to 150. Default 25, ours.
    pub dark_reference_c: f64,
    /// Temperature of the sensor in °C, -273.15 to 150. Default 25, ours.
    pub temperature_c: f64,
    /// Warming, in kelvin, that doubles the dark current, above 0, at most 100. Default 8, ours: silicon has 6 to 10.
    pub dark_doubling_c: f64,
    /// Photo response non-uniformity: standard deviation of the pixels' responses as a share of their mean,
    /// 0 to 1. Default 0, the paper's.
    pub prnu: f64,
    /// Dark signal non-uniformity: standard deviation of the pixels' offsets in electrons, 0 to 1e6.
    /// Default 0, the paper's.
    pub dsnu_e: f64,
    /// Which of all cameras of this kind it is: the fixed pattern of response, offset and per-pixel read noise is a
    /// function of this number and of the place, the same in every frame. Default 1, ours.
    pub serial: u64,
    /// Electrons that a pixel can hold, above 0, at most 1e7. Default 18 000, ours: an interline
    /// CCD with pixels of 6.45 µm. The paper's program has 255 · 70 = 17 850.
    pub full_well_e: f64,
    /// What happens to more. Default off, ours: it is lost.
    pub blooming: Blooming,
    /// The noise of reading a pixel. Default 8 electrons in every pixel, ours: the
    /// data sheet of such a camera. The paper's program has one grey level, 70 electrons.
    pub read_noise: ReadNoise,
    /// Overall system gain K in grey levels per electron (EMVA 1288), above 0, at most 1e6. Default
    /// 255 / 17 600, ours: the converter clips just before the pixel is full. The paper's program
    /// has 1 / 70.
    pub gain_dn_per_e: f64,
    /// Grey level of a dark pixel without dark current, from -10 times to below the highest grey level 2ᵇ - 1; a negative one
    /// is a black level that was taken off. Default 0, the paper's.
    pub offset_dn: f64,
    /// Bits of the converter, 8 to 16. Default 8, the paper's.
    pub bit_depth: u32,
    /// How photo-electrons are drawn. Default exact, the paper's.
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
    /// Mean dark electrons of an exposure: i_ref · 2^((T - T_ref) / T_d) · t.
    #[must_use]
    pub fn dark_e(&self) -> f64 {
        let doublings = (self.temperature_c - self.dark_reference_c) / self.dark_doubling_c;
        self.dark_current_e_per_s * libm::exp2(doublings) * self.exposure_s
    }

    /// Whether the converter is at its highest level before a pixel is full.
    #[must_use]
    pub fn is_limited_by_converter(&self) -> bool {
        self.offset_dn + self.gain_dn_per_e * self.full_well_e >= libm::exp2(f64::from(self.bit_depth)) - 1.0
    }

    pub(crate) fn check(&self) -> Result<(), Error> {
        let share = |field, value: f64| require(field, value, (0.0..=1.0).contains(&value), "from 0 to 1");
        let electrons = |field, value: f64| require(field, value, (0.0..=1e6).contains(&value), "from 0 to 1e6");
        let positive =
            |field, value: f64| require(field, value, value > 0.0 && value <= 1e6, "above 0 and at most 1e6");
        let celsius =
            |field, value: f64| require(field, value, (-273.15..=150.0).contains(&value), "from -273.15 to 150");
        let efficiency = self.quantum_efficiency;
        require("quantum_efficiency", efficiency, efficiency > 0.0 && efficiency <= 1.0, "above 0 and at most 1")?;
        electrons("exposure_s", self.exposure_s)?;
        electrons("dark_current_e_per_s", self.dark_current_e_per_s)?;
        celsius("dark_reference_c", self.dark_reference_c)?;
        celsius("temperature_c", self.temperature_c)?;
        let doubling = self.dark_doubling_c;
        require("dark_doubling_c", doubling, doubling > 0.0 && doubling <= 100.0, "above 0 and at most 100")?;
        share("prnu", self.prnu)?;
        electrons("dsnu_e", self.dsnu_e)?;
        let well = self.full_well_e;
        require("full_well_e", well, well > 0.0 && well <= 1e7, "above 0 and at most 1e7")?;
        let room = "so short that dark current leaves room in full_well_e";
        require("exposure_s", self.exposure_s, self.dark_e() < well, room)?;
        if let Blooming::On { vertical, anti_blooming } = self.blooming {
            share("blooming.vertical", vertical)?;
            share("blooming.anti_blooming", anti_blooming)?;
            require("full_well_e", well, well >= 1.0, "1 or more where blooming is on")?;
        }
        match self.read_noise {
            ReadNoise::Same { e } => electrons("read_noise.e", e)?,
            ReadNoise::PerPixel { median_e, rms_e } => {
                positive("read_noise.median_e", median_e)?;
                let holds = rms_e >= median_e && rms_e <= MOST_UNEVEN * median_e;
                require("read_noise.rms_e", rms_e, holds, "from read_noise.median_e to 20 times that")?
            }
        };
        positive("gain_dn_per_e", self.gain_dn_per_e)?;
        let bits = self.bit_depth;
        require("bit_depth", f64::from(bits), (8..=16).contains(&bits), "from 8 to 16")?;
        let offset = self.offset_dn;
        let highest = f64::from(self.max_dn());
        let level = offset >= -10.0 * highest && offset < highest;
        require("offset_dn", offset, level, "from -10 times to below the highest grey level, 2^bit_depth - 1")?;
        if let PhotonNoise::NormalAbove { mean_e } = self.photon_noise {
            require("photon_noise.mean_e", mean_e, mean_e >= 0.0, "0 or more")?;
        }
        Ok(())
    }

    /// The highest grey level, 2ᵇ - 1; the bit depth has been checked.
    #[expect(clippy::cast_possible_truncation, reason = "at most 16 bits")]
    pub(crate) fn max_dn(&self) -> u16 {
        ((1_u32 << self.bit_depth) - 1) as u16
    }
}

/// Of root mean square to median of the read noise: beyond it the noisiest pixels overflow single precision.
const MOST_UNEVEN: f64 = 20.0;

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn impossible_numbers_are_refused_by_name() {
        let good = CameraParams::default();
        type Set = fn(&mut CameraParams, f64);
        let same: [(&str, Set); 16] = [
            ("quantum_efficiency", |p, v| p.quantum_efficiency = v),
            ("exposure_s", |p, v| p.exposure_s = v),
            ("dark_current_e_per_s", |p, v| p.dark_current_e_per_s = v),
            ("dark_reference_c", |p, v| p.dark_reference_c = v * 300.0),
            ("temperature_c", |p, v| p.temperature_c = v * 300.0),
            ("dark_doubling_c", |p, v| p.dark_doubling_c = v),
            ("prnu", |p, v| p.prnu = v),
            ("dsnu_e", |p, v| p.dsnu_e = v),
            ("full_well_e", |p, v| p.full_well_e = v),
            ("gain_dn_per_e", |p, v| p.gain_dn_per_e = v),
            ("offset_dn", |p, v| p.offset_dn = v),
            ("read_noise.e", |p, v| p.read_noise = ReadNoise::Same { e: v }),
            ("read_noise.median_e", |p, v| p.read_noise = ReadNoise::PerPixel { median_e: v, rms_e: 2.0 }),
            ("read_noise.rms_e", |p, v| p.read_noise = ReadNoise::PerPixel { median_e: 1.0, rms_e: v }),
            ("blooming.vertical", |p, v| p.blooming = Blooming::On { vertical: v, anti_blooming: 0.0 }),
            ("blooming.anti_blooming", |p, v| p.blooming = Blooming::On { vertical: 0.5, anti_blooming: v }),
        ];
        let mut bad = Vec::new();
        for value in [f64::NAN, f64::INFINITY, -1.0, 1e300] {
            for (field, set) in same {
                let mut params = good.clone();
                set(&mut params, value);
                bad.push((field, params));
            }
        }
        for bit_depth in [0, 7, 17, u32::MAX] {
            bad.push(("bit_depth", CameraParams { bit_depth, ..good.clone() }));
        }
        for mean_e in [f64::NAN, -1.0] {
            let photon_noise = PhotonNoise::NormalAbove { mean_e };
            bad.push(("photon_noise.mean_e", CameraParams { photon_noise, ..good.clone() }));
        }
        for (field, set, value) in [
            ("full_well_e", same[8].1, 0.0),
            ("gain_dn_per_e", same[9].1, 0.0),
            ("quantum_efficiency", same[0].1, 0.0),
            ("quantum_efficiency", same[0].1, 1.01),
            ("dark_doubling_c", same[5].1, 0.0),
            ("read_noise.rms_e", same[13].1, 0.99),
            ("read_noise.rms_e", same[13].1, 20.1),
            ("offset_dn", same[10].1, 255.0),
            ("prnu", same[6].1, 1.1),
        ] {
            let mut params = good.clone();
            set(&mut params, value);
            bad.push((field, params));
        }
        let hot = CameraParams { dark_current_e_per_s: 1e3, exposure_s: 18.0, ..good.clone() };
        bad.push(("exposure_s", hot));
        for (field, params) in bad {
            let error = params.check().unwrap_err().to_string();
            assert!(error.starts_with(&format!("{field} is ")), "{error}");
        }
        let error = CameraParams { offset_dn: 255.0, ..good.clone() }.check().unwrap_err().to_string();
        assert_eq!(
            error,
            "offset_dn is 255; it must be from -10 times to below the highest grey level, 2^bit_depth - 1"
        );
        CameraParams { offset_dn: 254.9, ..good }.check().unwrap();
    }

    #[test]
    fn dark_current_doubles_with_each_doubling_temperature() {
        let cold = CameraParams { dark_current_e_per_s: 3.0, exposure_s: 2.0, ..CameraParams::default() };
        assert_eq!(cold.dark_e(), 6.0);
        for doublings in [-3_i32, -1, 1, 2, 5] {
            let temperature_c = cold.temperature_c + f64::from(doublings) * cold.dark_doubling_c;
            let warm = CameraParams { temperature_c, ..cold.clone() };
            assert_eq!(warm.dark_e(), 6.0 * libm::exp2(f64::from(doublings)));
        }
        assert_eq!(CameraParams { exposure_s: 4.0, ..cold }.dark_e(), 12.0);
    }

    #[test]
    fn spread_gives_the_root_mean_square() {
        let noise = ReadNoise::PerPixel { median_e: 1.0, rms_e: 1.6 };
        let spread = noise.spread();
        assert!((libm::exp(spread * spread) - 1.6).abs() < 1e-12, "{spread}");
        assert_eq!((noise.rms_e(), ReadNoise::Same { e: 3.0 }.rms_e()), (1.6, 3.0));
    }
}
