//! Parsers of option values: names, numbers, ranges, sizes.

use std::fmt::Display;
use std::ops::Range;
use std::str::FromStr;

use clap::builder::{PossibleValue, PossibleValuesParser, TypedValueParser};
use papsynth::recipe::{CameraPreset, Preset};
use papsynth_dataset::{Extra, Format};

/// Parses one of a few values by its name.
pub(super) fn named<T: Copy + Send + Sync + 'static, const N: usize>(
    all: [T; N],
    name: fn(T) -> &'static str,
) -> impl TypedValueParser<Value = T> {
    explained(all, name, move |value| PossibleValue::new(name(value)))
}

/// The same, with a description of each value.
fn explained<T: Copy + Send + Sync + 'static, const N: usize>(
    all: [T; N],
    name: fn(T) -> &'static str,
    explained: impl Fn(T) -> PossibleValue,
) -> impl TypedValueParser<Value = T> {
    PossibleValuesParser::new(all.map(explained)).try_map(move |typed| {
        all.into_iter().find(|value| name(*value) == typed).ok_or_else(|| format!("unknown value `{typed}`"))
    })
}

/// Parses names of presets.
pub(super) fn preset_parser() -> impl TypedValueParser<Value = Preset> {
    explained(Preset::ALL, Preset::name, |preset| PossibleValue::new(preset.name()).help(preset.summary()))
}

/// Parses names of cameras.
pub(super) fn camera_parser() -> impl TypedValueParser<Value = CameraPreset> {
    explained(CameraPreset::ALL, CameraPreset::name, |camera| PossibleValue::new(camera.name()).help(camera.summary()))
}

/// Parses names of formats.
pub(super) fn format_parser() -> impl TypedValueParser<Value = Format> {
    let about = |format: Format| {
        let needs = format.needs().map(|feature| format!(" (needs a build with --features {feature})"));
        PossibleValue::new(format.name()).help(format!("{}{}", format.about(), needs.unwrap_or_default()))
    };
    explained(Format::ALL, Format::name, about).try_map(|format| match format.needs() {
        None => Ok(format),
        Some(feature) => {
            Err(format!("`--format {}` needs a build of papsynth with `--features {feature}`", format.name()))
        }
    })
}

/// Parses names of files that can be left out.
pub(super) fn extra_parser() -> impl TypedValueParser<Value = Extra> {
    explained(Extra::ALL, Extra::name, |extra| PossibleValue::new(extra.name()).help(extra.about()))
}

/// Parses integers of a range, both ends included.
pub(super) fn integer<T>(low: T, high: T) -> impl Fn(&str) -> Result<T, String> + Clone
where
    T: Copy + Display + FromStr + PartialOrd,
{
    move |text| match text.parse() {
        Ok(value) if low <= value && value <= high => Ok(value),
        _ => Err(format!("expected an integer from {low} to {high}")),
    }
}

/// Parses numbers of a range, both ends included.
pub(super) fn number(low: f64, high: f64) -> impl Fn(&str) -> Result<f64, String> + Clone {
    move |text| match text.parse() {
        Ok(value) if low <= value && value <= high => Ok(value),
        _ => Err(format!("expected a number from {low} to {high}")),
    }
}

/// Parses `A..B`, B excluded.
pub(super) fn parse_range(text: &str) -> Result<Range<u64>, String> {
    let expected = || "expected A..B with integers A < B, for example 0..100".to_owned();
    let (from, to) = text.split_once("..").ok_or_else(expected)?;
    let number = |part: &str| part.trim().parse::<u64>().map_err(|_| expected());
    let range = number(from)?..number(to)?;
    if range.is_empty() { Err(expected()) } else { Ok(range) }
}

/// Parses two integers.
pub(super) fn parse_pair(text: &str) -> Result<[u32; 2], String> {
    let expected = || "expected two integers, for example 1024,768".to_owned();
    let (first, second) = text.split_once([',', 'x']).ok_or_else(expected)?;
    let number = |part: &str| part.trim().parse::<u32>().map_err(|_| expected());
    Ok([number(first)?, number(second)?])
}

/// Parses a width and a height of at least 1 pixel.
pub(super) fn parse_extent(text: &str) -> Result<[u32; 2], String> {
    match parse_pair(text)? {
        [0, _] | [_, 0] => Err("expected a width and a height of at least 1, for example 1024,768".to_owned()),
        extent => Ok(extent),
    }
}

/// Parses a pixel size, µm.
#[cfg(any(feature = "calibrate", feature = "judge", feature = "learn", feature = "web"))]
pub(super) fn parse_pixel(text: &str) -> Result<f64, String> {
    /// The range of `field.pixel_um` of a recipe.
    const ALLOWED: std::ops::RangeInclusive<f64> = 0.05..=4.0;
    match text.parse() {
        Ok(value) if ALLOWED.contains(&value) => Ok(value),
        _ => Err(format!("expected {} to {} micrometres", ALLOWED.start(), ALLOWED.end())),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn integers_outside_the_range_name_the_range() {
        let parse = integer(1, 1024_u16);
        assert_eq!(parse("1024"), Ok(1024));
        for bad in ["0", "1025", "-1", "1.5", "", "x"] {
            assert_eq!(parse(bad), Err("expected an integer from 1 to 1024".to_owned()), "{bad}");
        }
    }

    #[test]
    fn numbers_outside_the_range_name_the_range() {
        let parse = number(1.0, 5.0);
        assert_eq!(parse("1.5"), Ok(1.5));
        for bad in ["0.9", "5.1", "nan", "inf", "", "x"] {
            assert_eq!(parse(bad), Err("expected a number from 1 to 5".to_owned()), "{bad}");
        }
    }

    #[test]
    fn ranges_are_parsed() {
        assert_eq!(parse_range("3..7"), Ok(3..7));
        for bad in ["3", "7..3", "3..3", "a..b", "-1..3", "1..", "..4", "0..99999999999999999999999"] {
            assert!(parse_range(bad).unwrap_err().contains("A..B"), "{bad}");
        }
    }

    #[cfg(any(feature = "calibrate", feature = "judge", feature = "learn", feature = "web"))]
    #[test]
    fn pixel_sizes_are_bounded() {
        assert_eq!(parse_pixel("0.25"), Ok(0.25));
        for bad in ["0", "-1", "nan", "inf", "1e400", "x", "5"] {
            assert!(parse_pixel(bad).is_err(), "{bad}");
        }
    }
}
