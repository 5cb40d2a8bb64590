//! A number of a recipe: a fixed value or a distribution.

use std::fmt;

use rand_core::Rng;
use serde::de::{self, Deserializer, MapAccess, Visitor};
use serde::ser::{SerializeMap, Serializer};
use serde::{Deserialize, Serialize};

use crate::random;

/// How many standard deviations a normal or log-normal reaches to either side of its middle.
///
/// Every distribution of a recipe is bounded, so that a recipe can be checked before anything is drawn.
pub const REACH_SD: f64 = 4.0;

/// A number of a recipe.
///
/// ```toml
/// count = 30                                    # always 30
/// count = { uniform = [20, 40] }                # anything from 20 to 40
/// size  = { normal = [1.0, 0.1] }               # mean, standard deviation
/// stain = { log_normal = [1.0, 0.44] }          # median, standard deviation of the logarithm
/// depth = { choice = [2, 4, 8] }                # one of these
/// size  = { normal = [1.0, 0.3], min = 0.5 }    # cut off below (or above, with max)
/// ```
///
/// Normal and log-normal are cut at 4 standard deviations to either side.
#[derive(Debug, Clone, PartialEq)]
pub enum Number {
    /// Always this value.
    Fixed(f64),
    /// One of a family, cut to `min..=max`.
    Drawn {
        /// The family.
        law: Law,
        /// Nothing below this is drawn.
        min: f64,
        /// Nothing above this is drawn.
        max: f64,
    },
}

/// The families of distributions a recipe knows.
#[derive(Debug, Clone, PartialEq)]
pub enum Law {
    /// Uniform between two values.
    Uniform(f64, f64),
    /// Normal with a mean and a standard deviation.
    Normal(f64, f64),
    /// Log-normal with a median and the standard deviation of the natural logarithm.
    LogNormal(f64, f64),
    /// One of a list, all equally likely.
    Choice(Vec<f64>),
}

/// A number of things: a value that is written out must be whole, one that is drawn from a range is rounded.
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
    /// Uniform between `low` and `high`.
    #[must_use]
    pub fn uniform(low: f64, high: f64) -> Self {
        Self::law(Law::Uniform(low, high))
    }

    /// Normal with a mean and a standard deviation, cut at 4 of them.
    #[must_use]
    pub fn normal(mean: f64, sd: f64) -> Self {
        Self::law(Law::Normal(mean, sd))
    }

    /// Log-normal with a median and the standard deviation of the logarithm, cut at 4 of them.
    #[must_use]
    pub fn log_normal(median: f64, log_sd: f64) -> Self {
        Self::law(Law::LogNormal(median, log_sd))
    }

    /// One of these values, all equally likely.
    #[must_use]
    pub fn choice(values: impl Into<Vec<f64>>) -> Self {
        Self::law(Law::Choice(values.into()))
    }

    fn law(law: Law) -> Self {
        Self::Drawn { law, min: f64::NEG_INFINITY, max: f64::INFINITY }
    }

    /// Cuts the number below, and moves it by whole standard deviations no further than that.
    #[must_use]
    pub fn at_least(self, floor: f64) -> Self {
        match self {
            Self::Drawn { law, min, max } => Self::Drawn { law, min: min.max(floor), max },
            Self::Fixed(value) => Self::Fixed(value.max(floor)),
        }
    }

    /// Cuts the number above.
    #[must_use]
    pub fn at_most(self, ceiling: f64) -> Self {
        match self {
            Self::Drawn { law, min, max } => Self::Drawn { law, min, max: max.min(ceiling) },
            Self::Fixed(value) => Self::Fixed(value.min(ceiling)),
        }
    }

    /// The smallest and the largest value that can be drawn.
    #[must_use]
    pub fn bounds(&self) -> [f64; 2] {
        match self {
            Self::Fixed(value) => [*value, *value],
            Self::Drawn { law, min, max } => {
                let [low, high] = law.bounds();
                [low.max(*min), high.min(*max)]
            }
        }
    }

    /// Draws a value.
    pub fn draw<R: Rng + ?Sized>(&self, rng: &mut R) -> f64 {
        /// Tries before a cut-off tail is left to the uniform law between its bounds: reached only when nearly
        /// the whole distribution is cut off.
        const TRIES: usize = 1000;
        match self {
            Self::Fixed(value) => *value,
            Self::Drawn { law, .. } => {
                let [low, high] = self.bounds();
                for _ in 0..TRIES {
                    let value = law.draw(rng);
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
        random::count(self.draw(rng))
    }

    /// Returns the mean of the drawn values.
    #[must_use]
    pub fn mean(&self) -> f64 {
        self.mean_of(|value| value)
    }

    /// Returns the mean of the drawn values, rounded to counts.
    pub(crate) fn mean_count(&self) -> f64 {
        self.mean_of(|value| random::count(value) as f64)
    }

    /// Returns the mean of a function of the drawn values.
    fn mean_of(&self, of: impl Fn(f64) -> f64) -> f64 {
        /// Points of the midpoint rule over the bounds.
        const POINTS: u32 = 4096;
        let Self::Drawn { law, .. } = self else { return of(self.bounds()[0]) };
        let [low, high] = self.bounds();
        let is_within = |value: &&f64| (low..=high).contains(*value);
        if let Law::Choice(values) = law {
            let kept: Vec<f64> = values.iter().filter(is_within).map(|value| of(*value)).collect();
            return kept.iter().sum::<f64>() / kept.len().max(1) as f64;
        }
        let [from, to] = [law.scaled(low), law.scaled(high)];
        let points = (0..POINTS).map(|i| from + (to - from) * (f64::from(i) + 0.5) / f64::from(POINTS));
        let (sum, weights) = points.fold((0.0, 0.0), |(sum, weights), x| {
            let (value, weight) = law.at(x);
            (sum + weight * of(value), weights + weight)
        });
        if weights > 0.0 { sum / weights } else { of(0.5 * (low + high)) }
    }

    /// What is wrong with this number where something is counted: what is written out must be whole, what is drawn from a
    /// range is rounded.
    pub(crate) fn fraction(&self) -> Option<String> {
        let written: &[f64] = match self {
            Self::Fixed(value) => &[*value],
            Self::Drawn { law: Law::Choice(values), .. } => values,
            Self::Drawn { .. } => &[],
        };
        let value = written.iter().find(|value| value.is_finite() && value.floor() != **value)?;
        Some(format!("{value} is not a whole number"))
    }

    /// What is wrong with this number, if it must lie within `low..=high`.
    pub(crate) fn problem(&self, low: f64, high: f64) -> Option<String> {
        if let Self::Drawn { law, min, max } = self {
            if let Some(problem) = law.problem() {
                return Some(problem);
            }
            if min.is_nan() || max.is_nan() {
                return Some("`min` and `max` must be numbers".to_owned());
            }
        }
        let [least, most] = self.bounds();
        if !least.is_finite() || !most.is_finite() {
            return Some(format!("{self} is not a finite number; expected {}", range(low, high)));
        }
        if least > most {
            return Some(format!("{self} leaves nothing to draw between `min` and `max`"));
        }
        if least < low || most > high {
            let reach = if least < most { format!(", which reaches from {least} to {most}") } else { String::new() };
            return Some(format!("{self}{reach} is outside {}", range(low, high)));
        }
        None
    }
}

fn range(low: f64, high: f64) -> String {
    format!("{low} to {high}")
}

impl Law {
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

    /// Returns the value on the scale on which [`Law::at`] is uniform or normal: standard deviations from the centre.
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
                Some("`uniform` needs two finite numbers".to_owned())
            }
            Self::Uniform(low, high) if low > high => {
                Some(format!("`uniform = [{low}, {high}]` has its ends swapped; write [{high}, {low}]"))
            }
            Self::Normal(mean, sd) if !number(mean) || !number(sd) || *sd < 0.0 => {
                Some(format!("`normal = [{mean}, {sd}]` needs a finite mean and a standard deviation of 0 or more"))
            }
            Self::LogNormal(median, sd) if !number(median) || *median <= 0.0 || !number(sd) || *sd < 0.0 => {
                Some(format!("`log_normal = [{median}, {sd}]` needs a median above 0 and a deviation of 0 or more"))
            }
            Self::Choice(values) if values.is_empty() || values.iter().any(|v| !v.is_finite()) => {
                Some("`choice` needs at least one number, all of them finite".to_owned())
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
            Self::Fixed(value) => write!(f, "{value}"),
            Self::Drawn { law, min, max } => {
                write!(f, "{{ {} = {:?}", law.name(), law.values())?;
                if min.is_finite() {
                    write!(f, ", min = {min}")?;
                }
                if max.is_finite() {
                    write!(f, ", max = {max}")?;
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
            Self::Drawn { law, min, max } => {
                let mut map = serializer.serialize_map(None)?;
                map.serialize_entry(law.name(), &law.values())?;
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

/// Whole numbers print without a fraction: `planes = 21`, not `21.0`.
fn serialize_plain<S: Serializer>(value: f64, serializer: S) -> Result<S::Ok, S::Error> {
    /// Whole numbers up to 2⁵³ are exact in f64.
    const EXACT: f64 = 9_007_199_254_740_992.0;
    if value.fract() == 0.0 && value.abs() < EXACT {
        #[expect(clippy::cast_possible_truncation, reason = "whole and below 2⁵³")]
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

/// The names that stand for a distribution, as error messages list them.
const LAWS: &[&str] = &["uniform", "normal", "log_normal", "choice", "min", "max"];

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
    law: Option<Law>,
    min: Option<f64>,
    max: Option<f64>,
}

impl Entries {
    pub(crate) fn is_empty(&self) -> bool {
        self.law.is_none() && self.min.is_none() && self.max.is_none()
    }

    /// Reads the value of the entry `name`.
    pub(crate) fn take<'de, A: MapAccess<'de>>(&mut self, name: &str, map: &mut A) -> Result<(), A::Error> {
        match name {
            "min" => self.min = Some(map.next_value()?),
            "max" => self.max = Some(map.next_value()?),
            "uniform" | "normal" | "log_normal" if self.law.is_none() => {
                let [a, b]: [f64; 2] = map.next_value()?;
                self.law = Some(match name {
                    "uniform" => Law::Uniform(a, b),
                    "normal" => Law::Normal(a, b),
                    _ => Law::LogNormal(a, b),
                });
            }
            "choice" if self.law.is_none() => self.law = Some(Law::Choice(map.next_value()?)),
            "uniform" | "normal" | "log_normal" | "choice" => {
                return Err(de::Error::custom("expected one distribution, found two"));
            }
            other => return Err(de::Error::unknown_field(other, LAWS)),
        }
        Ok(())
    }

    pub(crate) fn finish<E: de::Error>(self) -> Result<Number, E> {
        let law = self.law.ok_or_else(|| E::custom("expected one of `uniform`, `normal`, `log_normal`, `choice`"))?;
        let (min, max) = (self.min.unwrap_or(f64::NEG_INFINITY), self.max.unwrap_or(f64::INFINITY));
        Ok(Number::Drawn { law, min, max })
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
        let law = |name: &str, values: serde_json::Value| {
            serde_json::json!({
                "type": "object",
                "properties": { name: values, "min": { "type": "number" }, "max": { "type": "number" } },
                "required": [name],
                "additionalProperties": false,
            })
        };
        vec![
            serde_json::json!({ "type": "number" }),
            law("uniform", pair.clone()),
            law("normal", pair.clone()),
            law("log_normal", pair),
            law("choice", serde_json::json!({ "type": "array", "items": { "type": "number" }, "minItems": 1 })),
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
    fn a_normal_has_its_mean_and_spread() {
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
    fn what_is_wrong_is_said() {
        assert!(parse("{ unifrom = [1, 2] }").unwrap_err().contains("unknown field `unifrom`"));
        assert!(parse("{ min = 2 }").unwrap_err().contains("expected one of `uniform`"));
        assert!(parse("{ uniform = [1, 2], choice = [1] }").unwrap_err().contains("found two"));
        assert!(parse("\"many\"").is_err());
        assert!(parse("{ uniform = [2, 1] }").unwrap().problem(0.0, 9.0).unwrap().contains("swapped"));
        assert!(parse("nan").unwrap().problem(0.0, 9.0).unwrap().contains("finite"));
        assert!(parse("inf").unwrap().problem(0.0, 9.0).is_some());
        assert!(parse("{ normal = [1, -1] }").unwrap().problem(0.0, 9.0).is_some());
        assert!(parse("{ normal = [1, 1] }").unwrap().problem(0.0, 9.0).unwrap().contains("reaches from -3 to 5"));
        assert!(parse("{ choice = [] }").unwrap().problem(0.0, 9.0).is_some());
        assert!(parse("{ normal = [1, 1], min = 8 }").unwrap().problem(0.0, 9.0).unwrap().contains("nothing to draw"));
        assert!(parse("-1").unwrap().problem(0.0, 9.0).unwrap().contains("outside 0 to 9"));
    }
}
