//! The design of a study: parameters, and the order of trials.

use portable_numerics::random::{below, shuffle};
use rand_core::Rng;
use serde::{Deserialize, Serialize};

use crate::error::Error;

/// Longest name of a subject, bytes. It is the name of a folder.
const LONGEST_NAME: usize = 64;

/// The name of the row of random answers; no subject may have it.
pub const RANDOM: &str = "x";

/// Defines an enum whose values have names in files, options and messages.
macro_rules! named {
    ($($(#[$about:meta])* $Kind:ident { $($(#[$of:meta])* $Value:ident = $name:literal,)* })*) => {$(
        $(#[$about])*
        #[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
        pub enum $Kind {
            $($(#[$of])* #[serde(rename = $name)] $Value,)*
        }

        impl $Kind {
            /// All values.
            pub const ALL: [Self; [$($name),*].len()] = [$(Self::$Value),*];

            /// The name in files, options and messages.
            #[must_use]
            pub fn name(self) -> &'static str {
                match self {
                    $(Self::$Value => $name,)*
                }
            }
        }
    )*};
}

named! {
    /// The design of each trial.
    TrialDesign {
        /// One patch: real or synthetic? As in the paper.
        YesNo = "yes-no",
        /// A real and a synthetic patch: which one is real, left or right?
        TwoAlternatives = "2afc",
    }
    /// Conversion of grey levels to 8 bits, the same for real and synthetic fields.
    Grey {
        /// Unchanged; for more than 8 bits, the full scale of the camera becomes 255.
        AsIs = "as-is",
        /// Each field is scaled so that its empty glass has a fixed level. This removes differences of exposure.
        Glass = "glass",
    }
    /// The source of an image.
    Side {
        /// A microscope: positives.
        Real = "real",
        /// A simulation: negatives.
        Synthetic = "synthetic",
    }
    /// The stage of a study.
    Stage {
        /// Practice; not counted.
        Training = "training",
        /// Counted.
        Counted = "counted",
    }
    /// The answer of a subject.
    Answer {
        /// The patch is real.
        Real = "real",
        /// The patch is synthetic.
        Synthetic = "synthetic",
        /// The left one of two patches is real.
        Left = "left",
        /// The right one of two patches is real.
        Right = "right",
    }
}

impl Answer {
    /// Whether the answer is valid for a design.
    pub(crate) fn fits(self, task: TrialDesign) -> bool {
        (task == TrialDesign::YesNo) == matches!(self, Self::Real | Self::Synthetic)
    }

    /// Whether the answer is positive: "real" or "left".
    pub(crate) fn is_positive(self) -> bool {
        matches!(self, Self::Real | Self::Left)
    }
}

/// Parameters of a study.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct StudyParams {
    /// Name of the subject: at most 64 letters, digits, `-`, `_` and `.`, without a leading dot, not `x`. Default `1`.
    pub subject: String,
    /// The design of the trials. Default yes-no (paper).
    pub task: TrialDesign,
    /// Number of counted trials, 1 to 10000. Default 118 (paper).
    pub trials: usize,
    /// Number of practice trials before, 0 to 100. Default 2 (paper).
    pub training: usize,
    /// Exposure of a patch, ms, 50 to 60000. Default 2000 (paper).
    pub exposure_ms: u32,
    /// Standard deviation of the Gaussian noise of every pixel, grey levels of 8 bits, 0 to 50. Default 0.7 (paper).
    pub noise_dn: f64,
    /// Size of a patch, px, 32 to 1024. Default 200 (paper).
    pub patch_px: usize,
    /// Largest number of real and of synthetic fields, 1 to 10000. Default 25 (paper).
    pub fields: usize,
    /// Seed of the selection of fields and patches, of the order and the noise. Default 0.
    pub seed: u64,
    /// Conversion of grey levels to 8 bits. Default as they are (paper).
    pub grey: Grey,
    /// Pixel size of real images, µm, 0.01 to 100; `None` if unknown. Default `None`.
    pub real_pixel_um: Option<f64>,
    /// Pixel size of synthetic images, µm, 0.01 to 100; `None` if unknown or recorded in the data set. Default `None`.
    pub synthetic_pixel_um: Option<f64>,
}

impl Default for StudyParams {
    fn default() -> Self {
        Self {
            subject: "1".to_owned(),
            task: TrialDesign::YesNo,
            trials: 118,
            training: 2,
            exposure_ms: 2000,
            noise_dn: 0.7,
            patch_px: 200,
            fields: 25,
            seed: 0,
            grey: Grey::AsIs,
            real_pixel_um: None,
            synthetic_pixel_um: None,
        }
    }
}

impl StudyParams {
    /// Checks the ranges; the error names the parameter.
    pub(crate) fn check(&self) -> Result<(), Error> {
        fn within<T: PartialOrd + std::fmt::Display>(
            field: &str,
            value: T,
            range: std::ops::RangeInclusive<T>,
            expected: &str,
        ) -> Result<(), Error> {
            if range.contains(&value) { Ok(()) } else { Err(Error::parameter(field, value, expected)) }
        }
        check_name(&self.subject)?;
        within("trials", self.trials, 1..=10_000, "1 to 10000")?;
        within("training", self.training, 0..=100, "0 to 100")?;
        within("exposure_ms", self.exposure_ms, 50..=60_000, "50 to 60000 ms")?;
        within("noise_dn", self.noise_dn, 0.0..=50.0, "0 to 50 grey levels")?;
        within("patch_px", self.patch_px, 32..=1024, "32 to 1024 pixels")?;
        within("fields", self.fields, 1..=10_000, "1 to 10000")?;
        // Unknown sizes are valid.
        within("real_pixel_um", self.real_pixel_um.unwrap_or(1.0), 0.01..=100.0, "0.01 to 100 µm")?;
        within("synthetic_pixel_um", self.synthetic_pixel_um.unwrap_or(1.0), 0.01..=100.0, "0.01 to 100 µm")
    }
}

/// Checks that a name is safe as the name of a folder.
pub(crate) fn check_name(subject: &str) -> Result<(), Error> {
    let plain = |c: char| c.is_ascii_alphanumeric() || "-_.".contains(c);
    let is_valid = !subject.is_empty()
        && subject.len() <= LONGEST_NAME
        && subject.chars().all(plain)
        && !subject.starts_with('.')
        && subject != RANDOM;
    if is_valid {
        return Ok(());
    }
    let expected = "1 to 64 letters, digits, `-`, `_` and `.`, no leading dot; `x` is the random row";
    Err(Error::parameter("subject", format!("`{}`", subject.escape_debug()), expected))
}

/// Returns stage and sides (one, or two from left to right) of each trial, the training first. Within each stage, both
/// sides, or both positions of the real patch, are equally frequent (an odd trial is random), in random order.
pub(crate) fn order(params: &StudyParams, rng: &mut impl Rng) -> Vec<(Stage, Vec<Side>)> {
    let mut orders = Vec::with_capacity(params.training + params.trials);
    for (stage, count) in [(Stage::Training, params.training), (Stage::Counted, params.trials)] {
        let first = below(2, rng);
        let mut sides: Vec<Side> = (0..count).map(|k| Side::ALL[(k + first) % 2]).collect();
        shuffle(&mut sides, rng);
        orders.extend(sides.into_iter().map(|side| {
            let sides = match (params.task, side) {
                (TrialDesign::YesNo, side) => vec![side],
                (TrialDesign::TwoAlternatives, Side::Real) => vec![Side::Real, Side::Synthetic],
                (TrialDesign::TwoAlternatives, Side::Synthetic) => vec![Side::Synthetic, Side::Real],
            };
            (stage, sides)
        }));
    }
    orders
}

#[cfg(test)]
mod tests {
    use rand_core::SeedableRng;
    use rand_xoshiro::Xoshiro256PlusPlus;

    use super::*;

    fn rng(seed: u64) -> Xoshiro256PlusPlus {
        Xoshiro256PlusPlus::seed_from_u64(seed)
    }

    #[test]
    fn defaults_are_those_of_the_paper() {
        let params = StudyParams::default();
        assert_eq!((params.task, params.trials, params.training), (TrialDesign::YesNo, 118, 2));
        assert_eq!((params.exposure_ms, params.noise_dn, params.patch_px, params.fields), (2000, 0.7, 200, 25));
        params.check().unwrap();
    }

    #[test]
    fn both_sides_are_shown_equally_often_in_either_design() {
        for task in TrialDesign::ALL {
            for (seed, trials) in [(1, 118), (2, 10), (3, 7), (4, 1)] {
                let params = StudyParams { task, trials, ..StudyParams::default() };
                let orders = order(&params, &mut rng(seed));
                assert_eq!(orders.len(), trials + 2);
                assert!(orders.iter().take(2).all(|o| o.0 == Stage::Training));
                for stage in Stage::ALL {
                    let of_stage: Vec<_> = orders.iter().filter(|o| o.0 == stage).collect();
                    let real_first = of_stage.iter().filter(|o| o.1[0] == Side::Real).count();
                    assert!(real_first.abs_diff(of_stage.len() - real_first) <= 1, "{task:?} {trials}");
                }
                assert!(orders.iter().all(|(_, sides)| match task {
                    TrialDesign::YesNo => sides.len() == 1,
                    TrialDesign::TwoAlternatives => sides.len() == 2 && sides[0] != sides[1],
                }));
            }
        }
    }

    #[test]
    fn the_position_in_the_order_does_not_predict_the_side() {
        // Over many seeds, each trial is real in half of the cases, and a trial does not predict the next one: within
        // 4.5 standard errors of ½, over 119 positions.
        let runs = 2000;
        let params = StudyParams { training: 0, ..StudyParams::default() };
        let all: Vec<Vec<bool>> = (0..runs)
            .map(|seed| order(&params, &mut rng(seed)).iter().map(|o| o.1[0] == Side::Real).collect())
            .collect();
        let bound = 4.5 * (0.25 / runs as f64).sqrt();
        for place in 0..118 {
            let fraction = all.iter().filter(|order| order[place]).count() as f64 / runs as f64;
            assert!((fraction - 0.5).abs() < bound, "trial {place}: {fraction}");
        }
        let repeats: usize = all.iter().map(|order| order.windows(2).filter(|pair| pair[0] == pair[1]).count()).sum();
        // In a balanced order, 58 of the 117 other trials have the side of a given one.
        let fraction = repeats as f64 / (runs as f64 * 117.0);
        assert!((fraction - 58.0 / 117.0).abs() < 4.5 * (0.25 / (runs as f64 * 117.0)).sqrt(), "{fraction}");
    }

    #[test]
    fn invalid_parameters_are_named() {
        let good = StudyParams::default();
        let nan = f64::NAN;
        let wrong = [
            (StudyParams { trials: 0, ..good.clone() }, "trials: 0"),
            (StudyParams { training: 101, ..good.clone() }, "training: 101"),
            (StudyParams { exposure_ms: 1, ..good.clone() }, "exposure_ms: 1"),
            (StudyParams { noise_dn: nan, ..good.clone() }, "noise_dn: NaN"),
            (StudyParams { noise_dn: -0.1, ..good.clone() }, "noise_dn: -0.1"),
            (StudyParams { patch_px: 0, ..good.clone() }, "patch_px: 0"),
            (StudyParams { fields: 0, ..good.clone() }, "fields: 0"),
            (StudyParams { real_pixel_um: Some(0.0), ..good.clone() }, "real_pixel_um: 0"),
            (StudyParams { synthetic_pixel_um: Some(nan), ..good.clone() }, "synthetic_pixel_um: NaN"),
        ];
        for (params, named) in wrong {
            assert!(params.check().unwrap_err().to_string().starts_with(named), "{named}");
        }
        for name in ["", "..", ".a", "a/b", "a\\b", "x", "a b", "ä", "a\0", &"a".repeat(65)] {
            assert!(check_name(name).is_err(), "{name:?}");
        }
        for name in ["1", "ann", "Ann-2_b.c", "X1"] {
            check_name(name).unwrap();
        }
    }
}
