//! How much memory may be used, how people say it, and when freed memory is given back.

use std::fs;

use papsynth_dataset::memory::{MemoryEstimate, MemoryPlan, available, format_bytes};

use crate::exit::{self, Failure};

/// Share of what is available that is used where nothing else is said.
const SHARE: f64 = 0.8;

/// How a run goes with the memory that may be used; `refuse` says why not even one frame fits.
pub(crate) fn fit(
    need: &MemoryEstimate,
    threads: usize,
    (workers, shared): (usize, bool),
    asked: Option<u64>,
    refuse: impl FnOnce(u64) -> Failure,
) -> Result<MemoryPlan, Failure> {
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "a share of a number of bytes")]
    let budget = asked.or_else(|| available().map(|bytes| (bytes as f64 * SHARE) as u64));
    let may = budget.unwrap_or_default();
    let Some(fit) = need.plan(workers, shared, budget) else { return Err(refuse(may)) };
    if (fit.workers, fit.shared) != (workers, shared) {
        let may = format_bytes(may as f64);
        exit::note(format!("{} of {threads} threads make frames, so that they fit into {may}", fit.workers));
    }
    Ok(fit)
}

/// Keeps what a long run holds from growing with its length. By itself glibc keeps twice as much freed memory in the heap of every thread as
/// the largest block had that was ever given back (mallopt(3)), so that each object larger than all before raises it. With fixed numbers a
/// run of small images holds a third less, and takes a twentieth longer; of larger images neither differs.
#[cfg(all(target_os = "linux", target_env = "gnu"))]
#[allow(unsafe_code, reason = "there is no other way to tell it")]
pub(crate) fn settle() {
    /// Larger blocks are the system's own.
    const OWN: libc::c_int = 4 << 20;
    /// Freed memory at the end of a heap that is kept.
    const KEPT: libc::c_int = 2 << 20;
    // SAFETY: both calls set a number of the allocator. They take any value, and what they refuse stays as it was.
    unsafe {
        libc::mallopt(libc::M_MMAP_THRESHOLD, OWN);
        libc::mallopt(libc::M_TRIM_THRESHOLD, KEPT);
    }
}

/// Other allocators are left as they are.
#[cfg(not(all(target_os = "linux", target_env = "gnu")))]
pub(crate) fn settle() {}

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
