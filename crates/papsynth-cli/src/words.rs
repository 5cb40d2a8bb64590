//! Numbers in messages.

use std::ops::Range;

/// A number with its noun in singular or plural.
pub(crate) fn counted(count: u64, one: &str, many: &str) -> String {
    format!("{count} {}", if count == 1 { one } else { many })
}

/// The result of a run: `8 frames written`, and how many were already present, if any.
pub(crate) fn frames_written(written: u64, present: u64) -> String {
    let written = counted(written, "frame written", "frames written");
    if present > 0 { format!("{written}, {present} already present") } else { written }
}

/// Ranges of consecutive numbers in a sorted list.
pub(crate) fn ranges(numbers: &[u64]) -> Vec<Range<u64>> {
    numbers.chunk_by(|a, b| a + 1 == *b).map(|run| run[0]..run[0] + run.len() as u64).collect()
}

/// Bytes in the largest unit below the number.
pub(crate) fn size(bytes: f64) -> String {
    let units = [(1e12, "TB"), (1e9, "GB"), (1e6, "MB"), (1e3, "kB")];
    match units.into_iter().find(|(unit, _)| bytes >= *unit) {
        Some((unit, name)) => format!("{:.1} {name}", bytes / unit),
        None => format!("{bytes:.0} bytes"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sizes_have_units() {
        assert_eq!([999.0, 1_234_567.0, 1.5e9].map(size), ["999 bytes", "1.2 MB", "1.5 GB"]);
    }

    #[test]
    fn nouns_agree_with_their_numbers() {
        assert_eq!(frames_written(1, 0), "1 frame written");
        assert_eq!(frames_written(0, 2), "0 frames written, 2 already present");
    }
}
