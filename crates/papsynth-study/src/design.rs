//! What a study asks: its parameters, and the order of its trials.

use portable_numerics::random::{below, shuffle};
use rand_core::Rng;
use serde::{Deserialize, Serialize};

use crate::error::Error;

/// Longest name of a subject, bytes: it becomes the name of a folder.
const LONGEST_NAME: usize = 64;

/// The name of the row of random answers; no subject may have it.
pub const RANDOM: &str = "x";

/// An enum whose values have names: those of files, options and messages.
macro_rules! named {
    ($($(#[$about:meta])* $Kind:ident { $($(#[$of:meta])* $Value:ident = $name:literal,)* })*) => {$(
        $(#[$about])*
        #[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
        pub enum $Kind {
            $($(#[$of])* #[serde(rename = $name)] $Value,)*
        }

        impl $Kind {
            /// All of them.
            pub const ALL: [Self; [$($name),*].len()] = [$(Self::$Value),*];

            /// The name it goes by.
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
    /// The question of each trial.
    Task {
        /// One patch: real or synthetic? The paper's.
        YesNo = "yes-no",
        /// Two patches, one of each side: which is real, left or right?
        TwoAlternatives = "2afc",
    }
    /// How grey levels are brought to 8 bits, on both sides alike.
    Grey {
        /// As they are; of deeper images, the full scale of the side's camera becomes 255.
        AsIs = "as-is",
        /// Each field so that its bright glass becomes one level: how it was exposed tells nothing.
        Glass = "glass",
    }
    /// Where an image comes from.
    Side {
        /// A microscope: the positives.
        Real = "real",
        /// A simulation: the negatives.
        Synthetic = "synthetic",
    }
    /// What of a study counts.
    Stage {
        /// For practice; not counted.
        Training = "training",
        /// Counted.
        Counted = "counted",
    }
    /// What a subject says.
    Answer {
        /// The patch is real.
        Real = "real",
        /// The patch is synthetic.
        Synthetic = "synthetic",
        /// Of two patches, the left one is real.
        Left = "left",
        /// Of two patches, the right one is real.
        Right = "right",
    }
}

impl Answer {
    /// Whether it is one that the task knows.
    pub(crate) fn fits(self, task: Task) -> bool {
        (task == Task::YesNo) == matches!(self, Self::Real | Self::Synthetic)
    }

    /// Whether a positive was claimed: "real", or "left".
    pub(crate) fn is_positive(self) -> bool {
        matches!(self, Self::Real | Self::Left)
    }
}

/// Parameters of a study.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct StudyParams {
    /// Who looks: letters, digits, `-`, `_` and `.`, at most 64, not beginning with a dot, and not `x`. Default `1` (ours).
    pub subject: String,
    /// What is asked. Default yes-no (the paper's).
    pub task: Task,
    /// Trials that count, 1 to 10000. Default 118 (the paper's).
    pub trials: usize,
    /// Trials for practice before them, 0 to 100. Default 2 (the paper's).
    pub training: usize,
    /// How long a patch is shown, ms, 50 to 60000. Default 2000 (the paper's).
    pub exposure_ms: u32,
    /// Standard deviation of the Gaussian noise on every pixel, grey levels of 8 bits, 0 to 50. Default 0.7 (the paper's).
    pub noise_dn: f64,
    /// Side of a patch, pixels, 32 to 1024. Default 200 (the paper's).
    pub patch_px: usize,
    /// Fields of each side, 1 to 10000; if there are fewer, those there are. Default 25 (the paper's).
    pub fields: usize,
    /// Decides which fields, patches, order and noise. Default 0 (ours).
    pub seed: u64,
    /// How grey levels are brought to 8 bits. Default as they are (the paper's).
    pub grey: Grey,
    /// Size of a real pixel, µm, 0.01 to 100; nothing if it is not known. Default nothing (ours).
    pub real_pixel_um: Option<f64>,
    /// Size of a synthetic pixel, µm, 0.01 to 100; nothing if it is unknown or the data set tells it. Default nothing (ours).
    pub synthetic_pixel_um: Option<f64>,
}

impl Default for StudyParams {
    fn default() -> Self {
        Self {
            subject: "1".to_owned(),
            task: Task::YesNo,
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
    /// Refuses what no study can have; the error names the parameter.
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
        // Sizes that are not known are fine.
        within("real_pixel_um", self.real_pixel_um.unwrap_or(1.0), 0.01..=100.0, "0.01 to 100 µm")?;
        within("synthetic_pixel_um", self.synthetic_pixel_um.unwrap_or(1.0), 0.01..=100.0, "0.01 to 100 µm")
    }
}

/// A name becomes the name of a folder, and must not lead anywhere else.
pub(crate) fn check_name(subject: &str) -> Result<(), Error> {
    let plain = |c: char| c.is_ascii_alphanumeric() || "-_.".contains(c);
    let fine = !subject.is_empty()
        && subject.len() <= LONGEST_NAME
        && subject.chars().all(plain)
        && !subject.starts_with('.')
        && subject != RANDOM;
    if fine {
        return Ok(());
    }
    let expected = "1 to 64 letters, digits, `-`, `_` and `.`, not beginning with a dot; `x` is the random row";
    Err(Error::parameter("subject", format!("`{}`", subject.escape_debug()), expected))
}

/// Which sides each trial shows, one or two from left to right, and whether it counts: the training ones first; within each
/// stage both sides (or both places of the real one) equally often, which of an odd number has one more being random, in a
/// random order.
pub(crate) fn order(params: &StudyParams, rng: &mut impl Rng) -> Vec<(Stage, Vec<Side>)> {
    let mut orders = Vec::with_capacity(params.training + params.trials);
    for (stage, count) in [(Stage::Training, params.training), (Stage::Counted, params.trials)] {
        let first = below(2, rng);
        let mut sides: Vec<Side> = (0..count).map(|k| Side::ALL[(k + first) % 2]).collect();
        shuffle(&mut sides, rng);
        orders.extend(sides.into_iter().map(|side| {
            let sides = match (params.task, side) {
                (Task::YesNo, side) => vec![side],
                (Task::TwoAlternatives, Side::Real) => vec![Side::Real, Side::Synthetic],
                (Task::TwoAlternatives, Side::Synthetic) => vec![Side::Synthetic, Side::Real],
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
    fn the_paper_s_defaults() {
        let params = StudyParams::default();
        assert_eq!((params.task, params.trials, params.training), (Task::YesNo, 118, 2));
        assert_eq!((params.exposure_ms, params.noise_dn, params.patch_px, params.fields), (2000, 0.7, 200, 25));
        params.check().unwrap();
    }

    #[test]
    fn both_sides_are_shown_equally_often_in_either_design() {
        for task in Task::ALL {
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
                    Task::YesNo => sides.len() == 1,
                    Task::TwoAlternatives => sides.len() == 2 && sides[0] != sides[1],
                }));
            }
        }
    }

    #[test]
    fn no_place_in_the_order_tells_the_side() {
        // Over many seeds each trial is real half the time, and one trial tells nothing of the next: within 4.5
        // standard errors of ½, over 119 places.
        let runs = 2000;
        let params = StudyParams { training: 0, ..StudyParams::default() };
        let all: Vec<Vec<bool>> = (0..runs)
            .map(|seed| order(&params, &mut rng(seed)).iter().map(|o| o.1[0] == Side::Real).collect())
            .collect();
        let bound = 4.5 * (0.25 / runs as f64).sqrt();
        for place in 0..118 {
            let share = all.iter().filter(|order| order[place]).count() as f64 / runs as f64;
            assert!((share - 0.5).abs() < bound, "trial {place}: {share}");
        }
        let repeats: usize = all.iter().map(|order| order.windows(2).filter(|pair| pair[0] == pair[1]).count()).sum();
        // Of a balanced order, 58 of the 117 others are like a given one.
        let share = repeats as f64 / (runs as f64 * 117.0);
        assert!((share - 58.0 / 117.0).abs() < 4.5 * (0.25 / (runs as f64 * 117.0)).sqrt(), "{share}");
    }

    #[test]
    fn wrong_parameters_are_named() {
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
