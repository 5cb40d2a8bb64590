//! How values are typed: names, ranges, sizes, windows.

use std::ops::Range;

use clap::builder::{PossibleValue, PossibleValuesParser, TypedValueParser};
use optics_psf::calibrate::Window;
use papsynth::recipe::{CameraPreset, Preset};
use papsynth_dataset::{Flatten, Format, Share};
use papsynth_judge::NucleiFrom;
use papsynth_study::{Grey, Task};

use super::sets::Shards;

/// Names of presets, each with what it shows.
pub(super) fn preset_parser() -> impl TypedValueParser<Value = Preset> {
    let names = Preset::ALL.map(|preset| PossibleValue::new(preset.name()).help(preset.summary()));
    PossibleValuesParser::new(names)
        .try_map(|name| Preset::by_name(&name).ok_or_else(|| format!("there is no preset `{name}`")))
}

pub(super) fn camera_parser() -> impl TypedValueParser<Value = CameraPreset> {
    let names = CameraPreset::ALL.map(|preset| PossibleValue::new(preset.name()).help(preset.summary()));
    PossibleValuesParser::new(names)
        .try_map(|name| CameraPreset::by_name(&name).ok_or_else(|| format!("there is no camera `{name}`")))
}

pub(super) fn nuclei_parser() -> impl TypedValueParser<Value = NucleiFrom> {
    let names = NucleiFrom::ALL.map(|from| PossibleValue::new(from.name()));
    PossibleValuesParser::new(names).try_map(|name| {
        NucleiFrom::ALL.into_iter().find(|from| from.name() == name).ok_or_else(|| format!("there is no way `{name}`"))
    })
}

pub(super) fn task_parser() -> impl TypedValueParser<Value = Task> {
    PossibleValuesParser::new(Task::ALL.map(Task::name)).try_map(|name| {
        Task::ALL.into_iter().find(|task| task.name() == name).ok_or_else(|| format!("there is no design `{name}`"))
    })
}

pub(super) fn grey_parser() -> impl TypedValueParser<Value = Grey> {
    PossibleValuesParser::new(Grey::ALL.map(Grey::name)).try_map(|name| {
        Grey::ALL.into_iter().find(|grey| grey.name() == name).ok_or_else(|| format!("there is no scale `{name}`"))
    })
}

/// Names of formats, each with what it is.
pub(super) fn format_parser() -> impl TypedValueParser<Value = Format> {
    let named = |format: Format| {
        let needs = format.needs().map(|feature| format!(" (wants a build with --features {feature})"));
        PossibleValue::new(format.name()).help(format!("{}{}", format.about(), needs.unwrap_or_default()))
    };
    PossibleValuesParser::new(Format::ALL.map(named)).try_map(|name| {
        let format = Format::ALL.into_iter().find(|f| f.name() == name);
        let format = format.ok_or_else(|| format!("there is no format `{name}`"))?;
        match format.needs() {
            None => Ok(format),
            Some(feature) => Err(format!("`--format {name}` needs a build of papsynth with `--features {feature}`")),
        }
    })
}

pub(super) fn flatten_parser() -> impl TypedValueParser<Value = Flatten> {
    PossibleValuesParser::new(Flatten::ALL.map(Flatten::name)).try_map(|name| {
        Flatten::ALL.into_iter().find(|f| f.name() == name).ok_or_else(|| format!("there is no policy `{name}`"))
    })
}

/// A share of the shards.
pub(super) fn parse_share(text: &str) -> Result<Shards, String> {
    let expected = "expected I/N with 0 ≤ I < N, such as 0/4, or `auto`, or `auto/N`";
    let number = |part: &str| part.trim().parse::<u64>().map_err(|e| format!("{part:?}: {e}; {expected}"));
    match text.split_once('/') {
        None if text == "auto" => Ok(Shards::Environment(None)),
        Some(("auto", of)) => match number(of)? {
            0 => Err(expected.to_owned()),
            of => Ok(Shards::Environment(Some(of))),
        },
        Some((index, of)) => {
            let share = Share { index: number(index)?, of: number(of)? };
            if share.index < share.of { Ok(Shards::Given(share)) } else { Err(expected.to_owned()) }
        }
        None => Err(expected.to_owned()),
    }
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

/// A name that can stand in a recipe without quotes.
pub(super) fn parse_class(text: &str) -> Result<String, String> {
    let plain = |c: char| c.is_ascii_alphanumeric() || c == '-' || c == '_';
    match !text.is_empty() && text.chars().all(plain) {
        true => Ok(text.to_owned()),
        false => Err("expected letters, digits, `-` and `_`".to_owned()),
    }
}

pub(super) fn parse_budget(text: &str) -> Result<usize, String> {
    /// Fewer windows teach nothing.
    const ALLOWED: std::ops::RangeInclusive<usize> = 60..=1_000_000;
    match text.parse() {
        Ok(value) if ALLOWED.contains(&value) => Ok(value),
        _ => Err(format!("expected {} to {} windows", ALLOWED.start(), ALLOWED.end())),
    }
}

pub(super) fn parse_pixel(text: &str) -> Result<f64, String> {
    /// What a recipe's `field.pixel_um` may be as well.
    const ALLOWED: std::ops::RangeInclusive<f64> = 0.05..=4.0;
    match text.parse() {
        Ok(value) if ALLOWED.contains(&value) => Ok(value),
        _ => Err(format!("expected {} to {} micrometres", ALLOWED.start(), ALLOWED.end())),
    }
}

pub(super) fn parse_step(text: &str) -> Result<f64, String> {
    match text.parse() {
        Ok(value) if value > 0.0 && value <= 100.0 => Ok(value),
        _ => Err("expected more than 0 and at most 100 micrometres".to_owned()),
    }
}

/// Four numbers between commas.
fn parse_four<T: std::str::FromStr>(text: &str) -> Option<[T; 4]> {
    let numbers: Vec<T> = text.split(',').map(|part| part.trim().parse().ok()).collect::<Option<_>>()?;
    numbers.try_into().ok()
}

pub(super) fn parse_window(text: &str) -> Result<Window, String> {
    let [left, top, width, height] = parse_four(text)
        .ok_or("expected X,Y,W,H: left, top, width and height in whole pixels, such as 120,80,48,52")?;
    // No image is so large; sums of them never overflow.
    match [left, top, width, height].iter().all(|v| *v <= 1 << 20) {
        true => Ok(Window { left, top, width, height }),
        false => Err("expected numbers up to 1048576".to_owned()),
    }
}

pub(super) fn parse_line(text: &str) -> Result<[f64; 4], String> {
    let line = parse_four(text).filter(|line| line.iter().all(|v: &f64| v.is_finite()));
    line.ok_or_else(|| "expected X0,Y0,X1,Y1: two points in pixels, such as 40,10,40,60".to_owned())
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

    #[test]
    fn pixel_sizes_are_bounded() {
        assert_eq!(parse_pixel("0.25"), Ok(0.25));
        for bad in ["0", "-1", "nan", "inf", "1e400", "x", "5"] {
            assert!(parse_pixel(bad).is_err(), "{bad}");
        }
    }
}
