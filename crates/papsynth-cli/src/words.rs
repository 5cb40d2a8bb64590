//! Numbers as people read them.

use std::ops::Range;

pub(crate) fn counted(count: u64, one: &str, many: &str) -> String {
    format!("{count} {}", if count == 1 { one } else { many })
}

/// Runs of numbers that follow each other, of numbers in rising order.
pub(crate) fn runs(numbers: &[u64]) -> Vec<Range<u64>> {
    numbers.chunk_by(|a, b| a + 1 == *b).map(|run| run[0]..run[0] + run.len() as u64).collect()
}

/// So many bytes, in the largest unit that they fill.
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
    fn sizes_are_readable() {
        assert_eq!([999.0, 1_234_567.0, 1.5e9].map(size), ["999 bytes", "1.2 MB", "1.5 GB"]);
    }
}
