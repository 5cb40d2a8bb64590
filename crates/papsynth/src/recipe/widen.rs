//! Wider distributions of the numbers that differ between slides, for training data.

use super::abundance::Abundance;
use super::conditions::NumberMut;
use super::number::{Distribution, Number, REACH_SD};
use super::section::{Bounds, Part};
use super::whole::Recipe;

/// Spread of numbers between real slides: paths, where `*` stands for any name, and standard deviations of the
/// logarithm. Measured with `papsynth match` on 24 EDF fields of liquid-based cytology, the blur before the
/// fields of a match shared one.
const SPREADS: [(&str, f64); 17] = [
    ("stain.field_cytoplasm", 0.25),
    ("stain.field_nucleus", 0.2),
    ("stain.field_texture", 0.45),
    ("cytoplasm.texture", 0.35),
    ("optics.extra_blur_um", 0.25),
    ("background.level", 0.06),
    ("background.texture", 0.25),
    ("background.illumination.falloff_x", 0.3),
    ("background.illumination.falloff_y", 0.3),
    ("camera.full_well_e", 0.2),
    ("camera.read_noise_e", 0.2),
    ("layout.count", 0.3),
    ("layout.radius_um", 0.3),
    ("cells.*.count", 0.35),
    ("debris.*.count", 0.5),
    ("debris.*.clusters", 0.5),
    ("slide.depth_um", 0.3),
];

/// Spread of the position of the focus between fields, µm.
const FOCUS: (&str, f64) = ("focus.centre_um", 1.0);

impl Recipe {
    /// Returns the recipe with wider distributions of stain, focus, light, noise, texture, debris and crowding, as
    /// training data need them (domain randomisation: Tobin et al. 2017, doi:10.1109/IROS.2017.8202133).
    ///
    /// At a factor of 1 the recipe is unchanged. At a factor f, each of these numbers gets an additional spread of
    /// f − 1 times its spread between real slides, cut at two standard deviations; conditions are widened in the same
    /// way. Values stay in the range of their field; numbers that are 0 stay 0, except for the position of the focus.
    #[must_use]
    pub fn widened(&self, factor: f64) -> Self {
        let mut wide = self.clone();
        let share = factor - 1.0;
        if share.is_nan() || share <= 0.0 {
            return wide;
        }
        let numbers = self.numbers();
        for declared in &numbers {
            let Some(spread) = Spread::of(&declared.path, share) else { continue };
            match wide.number_mut(&declared.path) {
                Some(NumberMut::Real(number)) => *number = spread.widen(number, declared.bounds),
                Some(NumberMut::Abundance(abundance)) => {
                    *abundance = spread.widen_abundance(abundance, declared.bounds)
                }
                None => {}
            }
        }
        for condition in &mut wide.conditions {
            for (path, value) in &mut condition.numbers {
                let declared = numbers.iter().find(|declared| declared.path == *path);
                if let (Some(spread), Some(declared)) = (Spread::of(path, share), declared) {
                    *value = spread.widen_abundance(value, declared.bounds);
                }
            }
        }
        wide
    }
}

/// An additional spread of a number.
enum Spread {
    /// Standard deviation of the logarithm.
    Relative(f64),
    /// Standard deviation.
    Absolute(f64),
}

impl Spread {
    /// Returns the spread of the number of this path.
    fn of(path: &str, share: f64) -> Option<Self> {
        if path == FOCUS.0 {
            return Some(Self::Absolute(share * FOCUS.1));
        }
        let matches = |pattern: &str| match pattern.split_once('*') {
            Some((start, end)) => {
                let name = path.strip_prefix(start).and_then(|rest| rest.strip_suffix(end));
                name.is_some_and(|name| !name.contains('.'))
            }
            None => path == pattern,
        };
        SPREADS.iter().find(|(pattern, _)| matches(pattern)).map(|(_, spread)| Self::Relative(share * spread))
    }

    fn widen_abundance(&self, abundance: &Abundance, bounds: Bounds) -> Abundance {
        match abundance {
            Abundance::PerField(number) => Abundance::PerField(self.widen(number, bounds)),
            Abundance::PerMm2(number) => Abundance::PerMm2(self.widen(number, bounds)),
        }
    }

    /// Returns a number with this additional spread, cut to the range of its field.
    fn widen(&self, number: &Number, bounds: Bounds) -> Number {
        let (distribution, min, max) = match number {
            Number::Fixed(value) => (Distribution::Normal(*value, 0.0), f64::NEG_INFINITY, f64::INFINITY),
            Number::Drawn { distribution, min, max } => (distribution.clone(), *min, *max),
        };
        let (wide, [low, high]) = match (self, distribution) {
            (Self::Absolute(sd), Distribution::Normal(mean, own)) => {
                let reach = REACH_SD * own + CUT_SD * sd;
                (Distribution::Normal(mean, own + sd), [mean - reach, mean + reach])
            }
            (Self::Absolute(sd), Distribution::Uniform(low, high)) => {
                let [low, high] = [low - UNIFORM_SD * sd, high + UNIFORM_SD * sd];
                (Distribution::Uniform(low, high), [low, high])
            }
            (Self::Relative(log_sd), Distribution::LogNormal(median, own)) => log_normal(median, own, *log_sd),
            (Self::Relative(log_sd), Distribution::Normal(value, 0.0)) if value > 0.0 => {
                log_normal(value, 0.0, *log_sd)
            }
            (Self::Relative(log_sd), Distribution::Normal(mean, own)) => {
                let sd = log_sd * mean.abs();
                let reach = REACH_SD * own + CUT_SD * sd;
                (Distribution::Normal(mean, own + sd), [mean - reach, mean + reach])
            }
            (Self::Relative(log_sd), Distribution::Uniform(low, high)) => {
                let factor = libm::exp(UNIFORM_SD * log_sd);
                let [low, high] = [(low, low < 0.0), (high, high > 0.0)]
                    .map(|(value, away)| if away { value * factor } else { value / factor });
                (Distribution::Uniform(low, high), [low, high])
            }
            (Self::Absolute(_), Distribution::LogNormal(..)) | (_, Distribution::Choice(_)) => return number.clone(),
        };
        // A normal distribution without spread is a fixed value.
        if let Distribution::Normal(value, 0.0) = wide {
            return Number::Fixed(value);
        }
        let number = Number::Drawn { distribution: wide, min, max };
        number.at_least(low.max(bounds.low)).at_most(high.min(bounds.high))
    }
}

/// Returns a log-normal distribution with an additional spread, and its cut.
fn log_normal(median: f64, own: f64, log_sd: f64) -> (Distribution, [f64; 2]) {
    let factor = libm::exp(REACH_SD * own + CUT_SD * log_sd);
    (Distribution::LogNormal(median, own + log_sd), [median / factor, median * factor])
}

/// Maximum deviation that is added, in standard deviations of the additional spread.
const CUT_SD: f64 = 2.0;

/// Half width of a uniform distribution in standard deviations, √3.
const UNIFORM_SD: f64 = 1.732_050_807_568_877_2;

#[cfg(test)]
mod tests {
    use super::*;
    use crate::recipe::Preset;

    #[test]
    fn a_factor_of_1_changes_nothing_and_every_preset_can_be_widened() {
        for preset in Preset::ALL {
            let recipe = preset.recipe();
            assert_eq!(recipe.widened(1.0), recipe);
            for factor in [1.5, 4.0] {
                let wide = recipe.widened(factor);
                assert_eq!(wide.problems(), [], "{preset:?} {factor}");
                assert_ne!(wide, recipe);
            }
        }
    }

    #[test]
    fn spreads_are_added_and_conditions_are_widened_too() {
        let recipe = Recipe::from_toml(
            r#"
            stain.field_cytoplasm = { log_normal = [1.2, 0.1] }
            stain.field_nucleus = 0.9
            cells.intermediate.count = { per_mm2 = { uniform = [50, 100] } }
            debris.leukocytes.clusters = 0
            [[conditions]]
            [conditions.numbers]
            "stain.field_nucleus" = 0.7
            "debris.dirt.clusters" = { per_mm2 = 200 }
            "#,
        )
        .unwrap();
        let wide = recipe.widened(1.5);
        let factor = libm::exp(4.0 * 0.1 + 2.0 * 0.125);
        assert_eq!(
            wide.stain.field_cytoplasm,
            Number::log_normal(1.2, 0.225).at_least(1.2 / factor).at_most(1.2 * factor)
        );
        let [low, high] = wide.cells["intermediate"].count.number().bounds();
        let factor = libm::exp(3.0_f64.sqrt() * 0.175);
        assert!((low - 50.0 / factor).abs() < 1e-9 && (high - 100.0 * factor).abs() < 1e-9, "{low} {high}");
        assert_eq!(wide.debris.leukocytes.clusters, recipe.debris.leukocytes.clusters);
        let of = |path: &str| wide.conditions[0].numbers[path].number().clone();
        let median_and_spread = |number: Number| match number {
            Number::Drawn { distribution: Distribution::LogNormal(median, log_sd), .. } => [median, log_sd],
            other => panic!("{other}"),
        };
        assert_eq!(median_and_spread(of("stain.field_nucleus")), [0.7, 0.1]);
        assert_eq!(median_and_spread(of("debris.dirt.clusters")), [200.0, 0.25]);
        assert_eq!(median_and_spread(wide.stain.field_nucleus.clone()), [0.9, 0.1]);
    }

    #[test]
    fn every_path_exists() {
        let text = "background.illumination = { kind = \"quadratic\", falloff_x = 0.1, falloff_y = 0.1 }";
        let recipe = Recipe::from_toml(text).unwrap();
        let paths: Vec<String> = recipe.numbers().into_iter().map(|declared| declared.path).collect();
        for (pattern, _) in SPREADS.into_iter().chain([FOCUS]) {
            let (start, end) = pattern.split_once('*').unwrap_or((pattern, ""));
            assert!(paths.iter().any(|path| path.starts_with(start) && path.ends_with(end)), "{pattern}");
        }
    }
}
