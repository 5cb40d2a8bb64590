//! The abundance of objects: a count per field, or a density per mm².

use std::borrow::Cow;
use std::fmt;

use rand_core::Rng;
use serde::de::{self, Deserializer, MapAccess, Visitor};
use serde::ser::{SerializeMap, Serializer};
use serde::{Deserialize, Serialize};

use super::conditions::NumberMut;
use super::number::{Entries, Number};
use super::section::{Bounds, Declared, Part, Value};

/// The abundance of objects: a count per field, or a density per mm².
///
/// ```toml
/// count = 30                                  # 30 in each field of any size
/// count = { uniform = [20, 40] }              # 20 to 40 in each field
/// count = { per_mm2 = 180 }                   # 180 per mm²
/// count = { per_mm2 = { uniform = [90, 270] } }
/// ```
///
/// A count is drawn once per field and rounded to the nearest integer. A density is drawn once per field, multiplied by
/// the area, and rounded up or down at random, so that the mean is exact.
#[derive(Debug, Clone, PartialEq)]
pub enum Abundance {
    /// Objects per field, for a field of any size.
    PerField(Number),
    /// Objects per mm².
    PerMm2(Number),
}

/// The key of a density in a recipe.
pub(crate) const PER_MM2: &str = "per_mm2";

impl From<Number> for Abundance {
    fn from(count: Number) -> Self {
        Self::PerField(count)
    }
}

impl From<f64> for Abundance {
    fn from(count: f64) -> Self {
        Self::PerField(count.into())
    }
}

impl From<i32> for Abundance {
    fn from(count: i32) -> Self {
        Self::PerField(count.into())
    }
}

impl Abundance {
    /// Returns a density.
    #[must_use]
    pub fn per_mm2(density: impl Into<Number>) -> Self {
        Self::PerMm2(density.into())
    }

    /// Returns the count or the density.
    #[must_use]
    pub fn number(&self) -> &Number {
        match self {
            Self::PerField(number) | Self::PerMm2(number) => number,
        }
    }

    /// Returns whether it is a density.
    #[must_use]
    pub fn is_density(&self) -> bool {
        matches!(self, Self::PerMm2(_))
    }

    /// Returns the smallest and the largest number of objects in an area, mm².
    #[must_use]
    pub fn bounds(&self, area_mm2: f64) -> [f64; 2] {
        let [low, high] = self.number().bounds();
        match self {
            Self::PerField(_) => [low, high],
            Self::PerMm2(_) => [(low * area_mm2).floor(), (high * area_mm2).ceil()],
        }
    }

    /// Returns the mean number of objects in an area, mm².
    #[must_use]
    pub fn mean(&self, area_mm2: f64) -> f64 {
        match self {
            Self::PerField(number) => number.mean_count(),
            Self::PerMm2(number) => number.mean() * area_mm2,
        }
    }

    /// Draws the number of objects in an area of `area_mm2`, which is `fields` times the area of a field, before
    /// rounding.
    pub(crate) fn draw<R: Rng + ?Sized>(&self, area_mm2: f64, fields: f64, rng: &mut R) -> f64 {
        let factor = if self.is_density() { area_mm2 } else { fields };
        (self.number().draw(rng) * factor).max(0.0)
    }
}

impl fmt::Display for Abundance {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::PerField(number) => number.fmt(f),
            Self::PerMm2(number) => write!(f, "{{ {PER_MM2} = {number} }}"),
        }
    }
}

impl Part for Abundance {
    fn list<'a>(&'a self, path: &str, bounds: Option<Bounds>, found: &mut Vec<Declared<'a>>) {
        let value = match self {
            Self::PerField(number) => Value::Real(Cow::Borrowed(number)),
            Self::PerMm2(number) => Value::Density(number),
        };
        found.extend(bounds.map(|bounds| Declared { path: path.to_owned(), value, bounds }));
    }

    fn number_mut(&mut self, path: &str) -> Option<NumberMut<'_>> {
        path.is_empty().then_some(NumberMut::Abundance(self))
    }
}

impl Serialize for Abundance {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        match self {
            Self::PerField(number) => number.serialize(serializer),
            Self::PerMm2(number) => {
                let mut map = serializer.serialize_map(Some(1))?;
                map.serialize_entry(PER_MM2, number)?;
                map.end()
            }
        }
    }
}

impl<'de> Deserialize<'de> for Abundance {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        deserializer.deserialize_any(AbundanceVisitor)
    }
}

struct AbundanceVisitor;

impl<'de> Visitor<'de> for AbundanceVisitor {
    type Value = Abundance;

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("a count such as 20 or { uniform = [10, 30] }, or a density such as { per_mm2 = 180 }")
    }

    fn visit_f64<E: de::Error>(self, value: f64) -> Result<Abundance, E> {
        Ok(Number::Fixed(value).into())
    }

    fn visit_i64<E: de::Error>(self, value: i64) -> Result<Abundance, E> {
        Ok(Number::Fixed(value as f64).into())
    }

    fn visit_i128<E: de::Error>(self, value: i128) -> Result<Abundance, E> {
        Ok(Number::Fixed(value as f64).into())
    }

    fn visit_u64<E: de::Error>(self, value: u64) -> Result<Abundance, E> {
        Ok(Number::Fixed(value as f64).into())
    }

    fn visit_map<A: MapAccess<'de>>(self, mut map: A) -> Result<Abundance, A::Error> {
        let (mut density, mut entries) = (None, Entries::default());
        while let Some(name) = map.next_key::<String>()? {
            if name == PER_MM2 {
                density = Some(map.next_value::<Number>()?);
            } else {
                entries.take(&name, &mut map)?;
            }
        }
        match density {
            None => entries.finish().map(Abundance::PerField),
            Some(number) if entries.is_empty() => Ok(Abundance::PerMm2(number)),
            Some(_) => Err(de::Error::custom(
                "`per_mm2` takes the distribution as its value: { per_mm2 = { uniform = [90, 270] } }",
            )),
        }
    }
}

impl schemars::JsonSchema for Abundance {
    fn schema_name() -> std::borrow::Cow<'static, str> {
        "Abundance".into()
    }

    fn json_schema(generator: &mut schemars::SchemaGenerator) -> schemars::Schema {
        let mut forms = Number::forms();
        forms.push(serde_json::json!({
            "type": "object",
            "properties": { PER_MM2: generator.subschema_for::<Number>() },
            "required": [PER_MM2],
            "additionalProperties": false,
        }));
        schemars::json_schema!({
            "description": "A count per field, or a density per mm²; each a number or a distribution.",
            "anyOf": forms,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::key::Key;

    fn parse(text: &str) -> Result<Abundance, String> {
        #[derive(Deserialize)]
        struct One {
            x: Abundance,
        }
        toml::from_str::<One>(&format!("x = {text}")).map(|one| one.x).map_err(|e| e.to_string())
    }

    #[test]
    fn counts_and_densities_read_back_as_written() {
        for (text, density) in [
            ("20", false),
            ("{ uniform = [1, 2.5] }", false),
            ("{ per_mm2 = 120 }", true),
            ("{ per_mm2 = 0.25 }", true),
            ("{ per_mm2 = { log_normal = [45, 0.8], max = 400 } }", true),
        ] {
            let abundance = parse(text).unwrap();
            assert_eq!(abundance.is_density(), density, "{text}");
            assert_eq!(parse(&abundance.to_string()).unwrap(), abundance, "{text}");
            let json = serde_json::to_string(&abundance).unwrap();
            assert_eq!(serde_json::from_str::<Abundance>(&json).unwrap(), abundance, "{text}");
        }
        assert!(parse("{ per_mm2 = 3, min = 1 }").unwrap_err().contains("takes the distribution as its value"));
        assert!(parse("{ per_mm = 3 }").unwrap_err().contains("unknown field `per_mm`"));
        assert!(parse("\"many\"").unwrap_err().contains("a density such as { per_mm2 = 180 }"));
    }

    #[test]
    fn means_are_those_of_many_draws() {
        let mut rng = Key { seed: 3, index: 0 }.stream("test", 0, "abundance");
        for text in ["7", "{ uniform = [0, 3] }", "{ log_normal = [4, 0.8] }", "{ normal = [1, 2], min = 0 }"] {
            let count = parse(text).unwrap();
            let draws: Vec<f64> = (0..20_000).map(|_| count.number().draw_count(&mut rng) as f64).collect();
            let mean = draws.iter().sum::<f64>() / draws.len() as f64;
            assert!((mean - count.mean(1.0)).abs() < 0.03 * mean.max(1.0), "{text}: {mean} {}", count.mean(1.0));
            let density = Abundance::PerMm2(count.number().clone());
            let draws: Vec<f64> = (0..20_000).map(|_| density.draw(0.1, 1.0, &mut rng)).collect();
            let mean = draws.iter().sum::<f64>() / draws.len() as f64;
            assert!((mean - density.mean(0.1)).abs() < 0.03 * mean.max(0.1), "{text}: {mean} {}", density.mean(0.1));
        }
    }
}
