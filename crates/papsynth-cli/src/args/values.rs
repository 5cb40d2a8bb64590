//! How values are typed: names, ranges, sizes.

use std::ops::Range;

use clap::builder::{PossibleValue, PossibleValuesParser, TypedValueParser};
use papsynth::recipe::{CameraPreset, Preset};
use papsynth_dataset::Format;

/// One of a few values by its name.
pub(super) fn named<T: Copy + Send + Sync + 'static, const N: usize>(
    all: [T; N],
    name: fn(T) -> &'static str,
) -> impl TypedValueParser<Value = T> {
    explained(all, name, move |value| PossibleValue::new(name(value)))
}

/// The same, each with what it is.
fn explained<T: Copy + Send + Sync + 'static, const N: usize>(
    all: [T; N],
    name: fn(T) -> &'static str,
    explained: impl Fn(T) -> PossibleValue,
) -> impl TypedValueParser<Value = T> {
    PossibleValuesParser::new(all.map(explained)).try_map(move |typed| {
        all.into_iter().find(|value| name(*value) == typed).ok_or_else(|| format!("there is no `{typed}`"))
    })
}

/// Names of presets, each with what it shows.
pub(super) fn preset_parser() -> impl TypedValueParser<Value = Preset> {
    explained(Preset::ALL, Preset::name, |preset| PossibleValue::new(preset.name()).help(preset.summary()))
}

pub(super) fn camera_parser() -> impl TypedValueParser<Value = CameraPreset> {
    explained(CameraPreset::ALL, CameraPreset::name, |camera| PossibleValue::new(camera.name()).help(camera.summary()))
}

/// Names of formats, each with what it is.
pub(super) fn format_parser() -> impl TypedValueParser<Value = Format> {
    let about = |format: Format| {
        let needs = format.needs().map(|feature| format!(" (wants a build with --features {feature})"));
        PossibleValue::new(format.name()).help(format!("{}{}", format.about(), needs.unwrap_or_default()))
    };
    explained(Format::ALL, Format::name, about).try_map(|format| match format.needs() {
        None => Ok(format),
        Some(feature) => {
            Err(format!("`--format {}` needs a build of papsynth with `--features {feature}`", format.name()))
        }
    })
}

pub(super) fn parse_range(text: &str) -> Result<Range<u64>, String> {
    let expected = "expected A..B with whole numbers A < B, such as 0..100";
    let (from, to) = text.split_once("..").ok_or(expected)?;
    let number = |part: &str| part.trim().parse::<u64>().map_err(|e| format!("{part:?}: {e}; {expected}"));
    let range = number(from)?..number(to)?;
    if range.is_empty() {
        return Err(format!("no frame lies in it; {expected}"));
    }
    Ok(range)
}

/// Two whole numbers.
pub(super) fn parse_pair(text: &str) -> Result<[u32; 2], String> {
    let expected = "expected two whole numbers, such as 1024,768";
    let (first, second) = text.split_once([',', 'x']).ok_or(expected)?;
    let number = |part: &str| part.trim().parse::<u32>().map_err(|e| format!("{part:?}: {e}; {expected}"));
    Ok([number(first)?, number(second)?])
}

#[cfg(any(feature = "calibrate", feature = "judge", feature = "learn", feature = "web"))]
pub(super) fn parse_pixel(text: &str) -> Result<f64, String> {
    /// What a recipe's `field.pixel_um` may be as well.
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
    fn ranges_are_read() {
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
