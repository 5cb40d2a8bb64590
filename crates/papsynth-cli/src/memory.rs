//! How much memory may be used, as people say it, and what is said where that is too little.

use std::fs;

use papsynth::recipe::Recipe;
use papsynth_dataset::memory::{Need, available};

use crate::exit::Failure;

/// Share of what is available that is used where nothing else is said.
const SHARE: f64 = 0.8;

/// What may be used: what was asked for, or a share of what is available, where the system tells.
pub(crate) fn budget(asked: Option<u64>) -> Option<u64> {
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "a share of a number of bytes")]
    asked.or_else(|| available().map(|bytes| (bytes as f64 * SHARE) as u64))
}

/// Why not even one frame fits.
pub(crate) fn refuse(need: &Need, recipe: &Recipe, budget: u64, is_given: bool) -> Failure {
    let source = if is_given { "--max-memory" } else { "80 % of what is available" };
    let help =
        "smaller fields, fewer cells, one plane, grey light and less oversampling need less; --max-memory allows more";
    Failure::wrong(format!("{} ({source})", need.too_large(recipe, budget)), help)
}

/// Why not even one frame of a slide fits.
#[cfg(feature = "zarr")]
pub(crate) fn refuse_slide(need: &Need, recipe: &Recipe, shard_px: u32, budget: u64) -> Failure {
    use papsynth_dataset::memory::shown;

    let message = format!(
        "shards of {shard_px} pixels a side with frames of {} need about {}; {} may be used",
        recipe.scan.frame_px,
        shown(need.of_one_frame()),
        shown(budget as f64)
    );
    let help = "--shard-px 2048 or less, or a smaller scan.frame_px, needs less; --max-memory allows more";
    Failure::wrong(message, help)
}

/// Reads `2GiB`, `500MB`, `1.5G`, `1048576`: powers of 1024 with an `i` and without a `B`, of 1000 else.
pub(crate) fn parse_size(text: &str) -> Result<u64, String> {
    let wrong = || format!("`{text}` is no size; expected such as 2GiB, 500MB or 1048576");
    let end = text.find(|c: char| !c.is_ascii_digit() && c != '.').unwrap_or(text.len());
    let number: f64 = text[..end].parse().map_err(|_| wrong())?;
    let unit = text[end..].trim_start().to_ascii_lowercase();
    let (prefix, base) = match unit.strip_suffix("ib").filter(|prefix| !prefix.is_empty()) {
        Some(prefix) => (prefix, 1024.0),
        None => unit.strip_suffix('b').map_or((unit.as_str(), 1024.0), |prefix| (prefix, 1000.0)),
    };
    let power = ["", "k", "m", "g", "t"].iter().position(|known| *known == prefix).ok_or_else(wrong)?;
    let bytes = (0..power).fold(number, |bytes: f64, _| bytes * base);
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "within these bounds")]
    if (1.0..9e15).contains(&bytes) { Ok(bytes as u64) } else { Err(wrong()) }
}

/// The most memory that the program has had, bytes, where the system tells.
pub(crate) fn peak() -> Option<u64> {
    let status = fs::read_to_string("/proc/self/status").ok()?;
    let line = status.lines().find_map(|line| line.strip_prefix("VmHWM:"))?;
    line.trim().strip_suffix("kB")?.trim().parse::<u64>().ok().map(|kilobytes| kilobytes.saturating_mul(1024))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sizes_are_read_as_people_write_them() {
        for (text, bytes) in [
            ("2GiB", 2 << 30),
            ("2G", 2 << 30),
            ("2gib", 2 << 30),
            ("500MB", 500_000_000),
            ("1.5 KiB", 1536),
            ("1048576", 1 << 20),
            ("7B", 7),
            ("1T", 1 << 40),
        ] {
            assert_eq!(parse_size(text), Ok(bytes), "{text}");
        }
        for text in ["", "GiB", "0", "-1", "nan", "inf", "2XiB", "2GiBs", "1e9", "99999999T", "2µB", "0.1"] {
            assert!(parse_size(text).is_err(), "{text}");
        }
    }
}
