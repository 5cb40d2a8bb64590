//! A number of a recipe: a fixed value or a distribution.

use std::fmt;

use portable_numerics::rounding::round_to_count;
use rand_core::Rng;
use serde::de::{self, Deserializer, MapAccess, Visitor};
use serde::ser::{SerializeMap, Serializer};
use serde::{Deserialize, Serialize};

use crate::random;

/// Number of standard deviations at which normal and log-normal distributions are cut on both sides.
///
/// All distributions are bounded, so that a recipe can be checked before anything is drawn.
pub const REACH_SD: f64 = 4.0;

/// A number of a recipe.
///
/// ```toml
/// depth = 3                                     # always 3
/// depth = { uniform = [2, 4] }                  # uniform from 2 to 4
/// size  = { normal = [1.0, 0.1] }               # mean, standard deviation
/// stain = { log_normal = [1.0, 0.44] }          # median, standard deviation of the logarithm
/// depth = { choice = [2, 4, 8] }                # one of these values
/// size  = { normal = [1.0, 0.3], min = 0.5 }    # cut off below (or above, with max)
/// ```
///
/// Normal and log-normal distributions are cut at 4 standard deviations.
#[derive(Debug, Clone, PartialEq)]
pub enum Number {
    /// A fixed value.
    Fixed(f64),
    /// A distribution, cut to `min..=max`.
    Drawn {
        /// The distribution.
        distribution: Distribution,
        /// Smallest value.
        min: f64,
        /// Largest value.
        max: f64,
    },
}

/// A distribution of a recipe.
#[derive(Debug, Clone, PartialEq)]
pub enum Distribution {
    /// Uniform between two values.
    Uniform(f64, f64),
    /// Normal with a mean and a standard deviation.
    Normal(f64, f64),
    /// Log-normal with a median and the standard deviation of the natural logarithm.
    LogNormal(f64, f64),
    /// One of a list, all equally likely.
    Choice(Vec<f64>),
}

/// A count. A fixed value and the values of `choice` must be integers; values of other distributions are rounded.
pub type Count = Number;

impl From<f64> for Number {
    fn from(value: f64) -> Self {
        Self::Fixed(value)
    }
}

impl From<i32> for Number {
    fn from(value: i32) -> Self {
        Self::Fixed(value.into())
    }
}

impl Number {
    /// Returns a uniform distribution between `low` and `high`.
    #[must_use]
    pub fn uniform(low: f64, high: f64) -> Self {
        Self::drawn(Distribution::Uniform(low, high))
    }

    /// Returns a normal distribution with a mean and a standard deviation, cut at 4 standard deviations.
    #[must_use]
    pub fn normal(mean: f64, sd: f64) -> Self {
        Self::drawn(Distribution::Normal(mean, sd))
    }

    /// Returns a log-normal distribution with a median and the standard deviation of the logarithm, cut at 4 standard
    /// deviations.
    #[must_use]
    pub fn log_normal(median: f64, log_sd: f64) -> Self {
        Self::drawn(Distribution::LogNormal(median, log_sd))
    }

    /// Returns a distribution of equally likely values.
    #[must_use]
    pub fn choice(values: impl Into<Vec<f64>>) -> Self {
        Self::drawn(Distribution::Choice(values.into()))
    }

    fn drawn(distribution: Distribution) -> Self {
        Self::Drawn { distribution, min: f64::NEG_INFINITY, max: f64::INFINITY }
    }

    /// Returns the number, cut below `floor`.
    #[must_use]
    pub fn at_least(self, floor: f64) -> Self {
        match self {
            Self::Drawn { distribution, min, max } => Self::Drawn { distribution, min: min.max(floor), max },
            Self::Fixed(value) => Self::Fixed(value.max(floor)),
        }
    }

    /// Returns the number, cut above `ceiling`.
    #[must_use]
    pub fn at_most(self, ceiling: f64) -> Self {
        match self {
            Self::Drawn { distribution, min, max } => Self::Drawn { distribution, min, max: max.min(ceiling) },
            Self::Fixed(value) => Self::Fixed(value.min(ceiling)),
        }
    }

    /// Returns the smallest and the largest value that can be drawn.
    #[must_use]
    pub fn bounds(&self) -> [f64; 2] {
        match self {
            Self::Fixed(value) => [*value, *value],
            Self::Drawn { distribution, min, max } => {
                let [low, high] = distribution.bounds();
                [low.max(*min), high.min(*max)]
            }
        }
    }

    /// Draws a value.
    pub fn draw<R: Rng + ?Sized>(&self, rng: &mut R) -> f64 {
        /// Tries before the value is drawn uniformly between the bounds, if nearly the complete distribution is cut
        /// off.
        const TRIES: usize = 1000;
        match self {
            Self::Fixed(value) => *value,
            Self::Drawn { distribution, .. } => {
                let [low, high] = self.bounds();
                for _ in 0..TRIES {
                    let value = distribution.draw(rng);
                    if (low..=high).contains(&value) {
                        return value;
                    }
                }
                random::between(low, high, rng)
            }
        }
    }

    /// Draws a value and rounds it to a count.
    pub fn draw_count<R: Rng + ?Sized>(&self, rng: &mut R) -> usize {
        round_to_count(self.draw(rng))
    }

    /// Returns the mean of the drawn values.
    #[must_use]
    pub fn mean(&self) -> f64 {
        self.mean_of(|value| value)
    }

    /// Returns the mean of the drawn values, rounded to counts.
    pub(crate) fn mean_count(&self) -> f64 {
        self.mean_of(|value| round_to_count(value) as f64)
    }

    /// Returns the mean of a function of the drawn values.
    fn mean_of(&self, of: impl Fn(f64) -> f64) -> f64 {
        /// Points of the midpoint rule over the bounds.
        const POINTS: u32 = 4096;
        let Self::Drawn { distribution, .. } = self else { return of(self.bounds()[0]) };
        let [low, high] = self.bounds();
        let is_within = |value: &&f64| (low..=high).contains(*value);
        if let Distribution::Choice(values) = distribution {
            let kept: Vec<f64> = values.iter().filter(is_within).map(|value| of(*value)).collect();
            return kept.iter().sum::<f64>() / kept.len().max(1) as f64;
        }
        let [from, to] = [distribution.scaled(low), distribution.scaled(high)];
        let points = (0..POINTS).map(|i| from + (to - from) * (f64::from(i) + 0.5) / f64::from(POINTS));
        let (sum, weights) = points.fold((0.0, 0.0), |(sum, weights), x| {
            let (value, weight) = distribution.at(x);
            (sum + weight * of(value), weights + weight)
        });
        if weights > 0.0 { sum / weights } else { of(0.5 * (low + high)) }
    }

    /// Returns a message if the number is not a valid [`Count`].
    pub(crate) fn fraction(&self) -> Option<String> {
        let written: &[f64] = match self {
            Self::Fixed(value) => &[*value],
            Self::Drawn { distribution: Distribution::Choice(values), .. } => values,
            Self::Drawn { .. } => &[],
        };
        let value = written.iter().find(|value| value.is_finite() && value.floor() != **value)?;
        Some(format!("{} is not an integer", shown(*value)))
    }

    /// Returns a message if the number is invalid or not within `low..=high`.
    pub(crate) fn problem(&self, low: f64, high: f64) -> Option<String> {
        if let Self::Drawn { distribution, min, max } = self {
            if let Some(problem) = distribution.problem() {
                return Some(problem);
            }
            if min.is_nan() || max.is_nan() {
                return Some("`min` and `max` must be numbers".to_owned());
            }
        }
        let [least, most] = self.bounds();
        if !least.is_finite() || !most.is_finite() {
            return Some(format!("{self} is not finite: expected {}", range(low, high)));
        }
        if least > most {
            return Some(format!("{self} has no value between `min` and `max`"));
        }
        if least < low || most > high {
            let reach =
                if least < most { format!(" (from {} to {})", shown(least), shown(most)) } else { String::new() };
            return Some(format!("{self}{reach} is out of range: expected {}", range(low, high)));
        }
        None
    }
}

fn range(low: f64, high: f64) -> String {
    format!("{} to {}", shown(low), shown(high))
}

/// Returns a number for a message: very large and very small ones in scientific notation.
pub(crate) fn shown(value: f64) -> String {
    let is_usual = value == 0.0 || !value.is_finite() || (1e-4..1e10).contains(&value.abs());
    if is_usual { value.to_string() } else { format!("{value:e}") }
}

impl Distribution {
    fn bounds(&self) -> [f64; 2] {
        match self {
            Self::Uniform(low, high) => [*low, *high],
            Self::Normal(mean, sd) => [mean - REACH_SD * sd, mean + REACH_SD * sd],
            Self::LogNormal(median, log_sd) => {
                let factor = libm::exp(REACH_SD * log_sd);
                [median / factor, median * factor]
            }
            Self::Choice(values) => {
                values.iter().fold([f64::INFINITY, f64::NEG_INFINITY], |[a, b], v| [a.min(*v), b.max(*v)])
            }
        }
    }

    fn draw<R: Rng + ?Sized>(&self, rng: &mut R) -> f64 {
        match self {
            Self::Uniform(low, high) => random::between(*low, *high, rng),
            Self::Normal(mean, sd) => mean + sd * random::normal(rng),
            Self::LogNormal(median, log_sd) => median * libm::exp(log_sd * random::normal(rng)),
            Self::Choice(values) => values.get(random::below(values.len(), rng)).copied().unwrap_or(0.0),
        }
    }

    /// Returns the value on the scale on which [`Distribution::at`] is uniform or normal: standard deviations from the
    /// centre.
    fn scaled(&self, value: f64) -> f64 {
        match self {
            Self::Normal(mean, sd) if *sd > 0.0 => (value - mean) / sd,
            Self::LogNormal(median, log_sd) if *log_sd > 0.0 && value > 0.0 => libm::log(value / median) / log_sd,
            Self::Normal(..) => 0.0,
            Self::LogNormal(..) => -REACH_SD,
            Self::Uniform(..) | Self::Choice(_) => value,
        }
    }

    /// Returns the value at a place of that scale, and its relative density there.
    fn at(&self, x: f64) -> (f64, f64) {
        match self {
            Self::Normal(mean, sd) => (mean + sd * x, libm::exp(-0.5 * x * x)),
            Self::LogNormal(median, log_sd) => (median * libm::exp(log_sd * x), libm::exp(-0.5 * x * x)),
            Self::Uniform(..) | Self::Choice(_) => (x, 1.0),
        }
    }

    fn problem(&self) -> Option<String> {
        let number = |value: &f64| value.is_finite();
        match self {
            Self::Uniform(low, high) if !number(low) || !number(high) => {
                Some("expected two finite numbers in `uniform`".to_owned())
            }
            Self::Uniform(low, high) if low > high => {
                let [low, high] = [low, high].map(|value| shown(*value));
                Some(format!("`uniform = [{low}, {high}]` has its bounds swapped: expected [{high}, {low}]"))
            }
            Self::Normal(mean, sd) if !number(mean) || !number(sd) || *sd < 0.0 => Some(format!(
                "`normal = [{}, {}]`: expected a finite mean and a standard deviation of at least 0",
                shown(*mean),
                shown(*sd)
            )),
            Self::LogNormal(median, sd) if !number(median) || *median <= 0.0 || !number(sd) || *sd < 0.0 => {
                Some(format!(
                    "`log_normal = [{}, {}]`: expected a median above 0 and a standard deviation of at least 0",
                    shown(*median),
                    shown(*sd)
                ))
            }
            Self::Choice(values) if values.is_empty() || values.iter().any(|v| !v.is_finite()) => {
                Some("expected at least one number in `choice`, and finite numbers".to_owned())
            }
            _ => None,
        }
    }

    fn name(&self) -> &'static str {
        match self {
            Self::Uniform(..) => "uniform",
            Self::Normal(..) => "normal",
            Self::LogNormal(..) => "log_normal",
            Self::Choice(_) => "choice",
        }
    }

    fn values(&self) -> Vec<f64> {
        match self {
            Self::Uniform(a, b) | Self::Normal(a, b) | Self::LogNormal(a, b) => vec![*a, *b],
            Self::Choice(values) => values.clone(),
        }
    }
}

impl fmt::Display for Number {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Fixed(value) => f.write_str(&shown(*value)),
            Self::Drawn { distribution, min, max } => {
                write!(f, "{{ {} = {:?}", distribution.name(), distribution.values())?;
                if min.is_finite() {
                    write!(f, ", min = {}", shown(*min))?;
                }
                if max.is_finite() {
                    write!(f, ", max = {}", shown(*max))?;
                }
                write!(f, " }}")
            }
        }
    }
}

impl Serialize for Number {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        match self {
            Self::Fixed(value) => serialize_plain(*value, serializer),
            Self::Drawn { distribution, min, max } => {
                let mut map = serializer.serialize_map(None)?;
                map.serialize_entry(distribution.name(), &distribution.values())?;
                if min.is_finite() {
                    map.serialize_entry("min", min)?;
                }
                if max.is_finite() {
                    map.serialize_entry("max", max)?;
                }
                map.end()
            }
        }
    }
}

/// Writes integers without a fraction: `planes = 21`, not `21.0`.
fn serialize_plain<S: Serializer>(value: f64, serializer: S) -> Result<S::Ok, S::Error> {
    /// Integers up to 2⁵³ are exact in f64.
    const EXACT: f64 = 9_007_199_254_740_992.0;
    if value.fract() == 0.0 && value.abs() < EXACT {
        #[expect(clippy::cast_possible_truncation, reason = "an integer below 2⁵³")]
        let whole = value as i64;
        serializer.serialize_i64(whole)
    } else {
        serializer.serialize_f64(value)
    }
}

impl<'de> Deserialize<'de> for Number {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        deserializer.deserialize_any(NumberVisitor)
    }
}

struct NumberVisitor;

/// Keys of a distribution.
const KEYS: &[&str] = &["uniform", "normal", "log_normal", "choice", "min", "max"];

impl<'de> Visitor<'de> for NumberVisitor {
    type Value = Number;

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("a number, or a distribution such as { uniform = [1, 2] }")
    }

    fn visit_f64<E: de::Error>(self, value: f64) -> Result<Number, E> {
        Ok(Number::Fixed(value))
    }

    fn visit_i64<E: de::Error>(self, value: i64) -> Result<Number, E> {
        Ok(Number::Fixed(value as f64))
    }

    fn visit_u64<E: de::Error>(self, value: u64) -> Result<Number, E> {
        Ok(Number::Fixed(value as f64))
    }

    fn visit_i128<E: de::Error>(self, value: i128) -> Result<Number, E> {
        Ok(Number::Fixed(value as f64))
    }

    fn visit_map<A: MapAccess<'de>>(self, mut map: A) -> Result<Number, A::Error> {
        let mut entries = Entries::default();
        while let Some(name) = map.next_key::<String>()? {
            entries.take(&name, &mut map)?;
        }
        entries.finish()
    }
}

/// The entries of a table that describes a distribution.
#[derive(Default)]
pub(crate) struct Entries {
    distribution: Option<Distribution>,
    min: Option<f64>,
    max: Option<f64>,
}

impl Entries {
    pub(crate) fn is_empty(&self) -> bool {
        self.distribution.is_none() && self.min.is_none() && self.max.is_none()
    }

    /// Reads the value of the entry `name`.
    pub(crate) fn take<'de, A: MapAccess<'de>>(&mut self, name: &str, map: &mut A) -> Result<(), A::Error> {
        match name {
            "min" => self.min = Some(map.next_value()?),
            "max" => self.max = Some(map.next_value()?),
            "uniform" | "normal" | "log_normal" if self.distribution.is_none() => {
                // The TOML reader ignores the rest of an array that is longer than the type.
                let values: Vec<f64> = map.next_value()?;
                let [a, b] = values[..] else {
                    let message = format!("expected 2 numbers in `{name}`, found {}", values.len());
                    return Err(de::Error::custom(message));
                };
                self.distribution = Some(match name {
                    "uniform" => Distribution::Uniform(a, b),
                    "normal" => Distribution::Normal(a, b),
                    _ => Distribution::LogNormal(a, b),
                });
            }
            "choice" if self.distribution.is_none() => {
                self.distribution = Some(Distribution::Choice(map.next_value()?))
            }
            "uniform" | "normal" | "log_normal" | "choice" => {
                return Err(de::Error::custom("expected one distribution, found two"));
            }
            other => return Err(de::Error::unknown_field(other, KEYS)),
        }
        Ok(())
    }

    pub(crate) fn finish<E: de::Error>(self) -> Result<Number, E> {
        let distribution = self
            .distribution
            .ok_or_else(|| E::custom("expected one of `uniform`, `normal`, `log_normal`, `choice`"))?;
        let (min, max) = (self.min.unwrap_or(f64::NEG_INFINITY), self.max.unwrap_or(f64::INFINITY));
        Ok(Number::Drawn { distribution, min, max })
    }
}

impl schemars::JsonSchema for Number {
    fn schema_name() -> std::borrow::Cow<'static, str> {
        "Number".into()
    }

    fn json_schema(_: &mut schemars::SchemaGenerator) -> schemars::Schema {
        schemars::json_schema!({
            "description": "A number, or a distribution it is drawn from.",
            "anyOf": Self::forms(),
        })
    }
}

impl Number {
    /// Returns the JSON schemas of a plain number and of each distribution.
    pub(crate) fn forms() -> Vec<serde_json::Value> {
        let pair = serde_json::json!({ "type": "array", "items": { "type": "number" }, "minItems": 2, "maxItems": 2 });
        let form = |name: &str, values: serde_json::Value| {
            serde_json::json!({
                "type": "object",
                "properties": { name: values, "min": { "type": "number" }, "max": { "type": "number" } },
                "required": [name],
                "additionalProperties": false,
            })
        };
        vec![
            serde_json::json!({ "type": "number" }),
            form("uniform", pair.clone()),
            form("normal", pair.clone()),
            form("log_normal", pair),
            form("choice", serde_json::json!({ "type": "array", "items": { "type": "number" }, "minItems": 1 })),
        ]
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::key::Key;

    fn parse(text: &str) -> Result<Number, String> {
        #[derive(Deserialize)]
        struct One {
            x: Number,
        }
        toml::from_str::<One>(&format!("x = {text}")).map(|one| one.x).map_err(|e| e.to_string())
    }

    #[test]
    fn every_form_reads_back_as_written_and_stays_within_its_bounds() {
        let mut rng = Key { seed: 1, index: 0 }.stream("test", 0, "number");
        for text in [
            "3",
            "2.5",
            "{ uniform = [1, 2.5] }",
            "{ normal = [1, 0.1], min = 0.9 }",
            "{ normal = [0, 1], min = 3.9 }",
            "{ log_normal = [2, 0.4], max = 3 }",
            "{ choice = [1, 2, 4] }",
        ] {
            let number = parse(text).unwrap();
            assert_eq!(parse(&number.to_string()).unwrap(), number, "{text}");
            assert_eq!(number.problem(-100.0, 100.0), None, "{text}");
            let [low, high] = number.bounds();
            for _ in 0..500 {
                let value = number.draw(&mut rng);
                assert!((low..=high).contains(&value), "{text}: {value}");
            }
        }
    }

    #[test]
    fn a_normal_distribution_has_its_mean_and_standard_deviation() {
        let mut rng = Key { seed: 2, index: 0 }.stream("test", 0, "number");
        let number = Number::normal(5.0, 2.0);
        let n = 10_000;
        let draws: Vec<f64> = (0..n).map(|_| number.draw(&mut rng)).collect();
        let mean = draws.iter().sum::<f64>() / f64::from(n);
        let sd = (draws.iter().map(|x| (x - mean) * (x - mean)).sum::<f64>() / f64::from(n)).sqrt();
        assert!((mean - 5.0).abs() < 4.0 * 2.0 / f64::from(n).sqrt());
        assert!((sd - 2.0).abs() < 4.0 * 2.0 / f64::from(2 * n).sqrt());
    }

    #[test]
    fn messages_about_any_number_are_short_and_exact() {
        for exponent in -300..300 {
            for digits in ["1", "-2.5", "1.2345678901234567"] {
                let value: f64 = format!("{digits}e{exponent}").parse().unwrap();
                let text = shown(value);
                assert!(text.len() <= 24, "{text}");
                assert_eq!(text.parse(), Ok(value));
                assert_eq!(parse(&Number::Fixed(value).to_string()).unwrap(), Number::Fixed(value));
            }
        }
        assert_eq!([0.0, 0.001, 250.0, 1e6, 1e83].map(shown), ["0", "0.001", "250", "1000000", "1e83"]);
        let problem = Number::log_normal(0.25, 50.0).problem(0.0, 20.0).unwrap();
        assert!(problem.len() < 140 && problem.contains("e86)"), "{problem}");
    }

    #[test]
    fn a_pair_has_exactly_two_numbers() {
        for name in ["uniform", "normal", "log_normal"] {
            for count in [0, 1, 3, 4, 9] {
                let error = parse(&format!("{{ {name} = {:?} }}", vec![1; count])).unwrap_err();
                assert!(error.contains(&format!("expected 2 numbers in `{name}`, found {count}")), "{error}");
            }
            parse(&format!("{{ {name} = [1, 1] }}")).unwrap();
        }
    }

    #[test]
    fn invalid_numbers_have_a_message() {
        assert!(parse("{ unifrom = [1, 2] }").unwrap_err().contains("unknown field `unifrom`"));
        assert!(parse("{ min = 2 }").unwrap_err().contains("expected one of `uniform`"));
        assert!(parse("{ uniform = [1, 2], choice = [1] }").unwrap_err().contains("found two"));
        assert!(parse("\"many\"").is_err());
        assert!(parse("{ uniform = [2, 1] }").unwrap().problem(0.0, 9.0).unwrap().contains("swapped"));
        assert!(parse("nan").unwrap().problem(0.0, 9.0).unwrap().contains("finite"));
        assert!(parse("inf").unwrap().problem(0.0, 9.0).is_some());
        assert!(parse("{ normal = [1, -1] }").unwrap().problem(0.0, 9.0).is_some());
        assert!(parse("{ normal = [1, 1] }").unwrap().problem(0.0, 9.0).unwrap().contains("(from -3 to 5)"));
        assert!(parse("{ choice = [] }").unwrap().problem(0.0, 9.0).is_some());
        assert!(parse("{ normal = [1, 1], min = 8 }").unwrap().problem(0.0, 9.0).unwrap().contains("no value between"));
        assert!(parse("-1").unwrap().problem(0.0, 9.0).unwrap().contains("out of range: expected 0 to 9"));
    }
}
