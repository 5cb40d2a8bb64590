//! Memory limits, sizes in bytes, and settings of the allocator.

use std::fs;

use papsynth::recipe::Recipe;
use papsynth::scene::Scene;
use papsynth_dataset::Layout;
use papsynth_dataset::memory::{MemoryEstimate, MemoryPlan, available, format_bytes};

use crate::exit::{self, ExitError};
use crate::setup::Setup;

/// Fraction of the available memory that a run uses without `--max-memory`.
const FRACTION: f64 = 0.8;

/// Address space that a thread reserves, bytes: a heap of glibc (64 MiB) and a stack (2 MiB).
const THREAD_ADDRESSES: u64 = 66 << 20;

/// Address space that the program needs to read a recipe and a model, bytes.
const PROGRAM_ADDRESSES: u64 = 128 << 20;

/// The allocator of musl maps blocks of 128 KiB or more one by one, and the system clears each of their pages again.
/// That takes a third more processor time. This one takes 3 % more than glibc, and as little memory.
#[cfg(target_env = "musl")]
#[global_allocator]
static ALLOCATOR: dlmalloc::GlobalDlmalloc = dlmalloc::GlobalDlmalloc;

/// Memory that a run may use, and the limit that it follows from.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Budget {
    pub(crate) bytes: u64,
    /// The limit in words, for messages.
    pub(crate) source: &'static str,
}

/// Limits of the system and of `--max-memory`. `None` where the system states none.
#[derive(Debug, Clone, Copy)]
struct Limits {
    memory: Option<Budget>,
    /// Free address space, bytes.
    addresses: Option<u64>,
}

impl Limits {
    fn new(asked: Option<u64>) -> Self {
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "a fraction of a number of bytes")]
        let fraction = |bytes: u64| (bytes as f64 * FRACTION) as u64;
        let memory = match asked {
            Some(bytes) => Some(Budget { bytes, source: "--max-memory" }),
            None => available().map(|all| Budget { bytes: fraction(all), source: "80 % of the available memory" }),
        };
        Self { memory, addresses: free_addresses() }
    }

    /// The budget of a run with this many threads.
    fn budget(&self, threads: usize) -> Option<Budget> {
        let reserved = THREAD_ADDRESSES.saturating_mul(threads as u64);
        let addresses = self.addresses.map(|bytes| Budget {
            bytes: bytes.saturating_sub(reserved),
            source: "the address-space limit of the process, `ulimit -v`",
        });
        self.memory.into_iter().chain(addresses).min_by_key(|budget| budget.bytes)
    }
}

/// Memory that a program may use, bytes: as asked, or a fraction of the available memory; `None` if that is unknown.
#[cfg(feature = "web")]
pub(crate) fn limit(asked: Option<u64>) -> Option<u64> {
    Limits::new(asked).budget(1).map(|budget| budget.bytes)
}

/// How a run fits into its budget: with at most `workers` frames at the same time. `too_large` is the error for a
/// budget that is too small for one frame.
pub(crate) fn fit(
    need: &MemoryEstimate,
    threads: usize,
    (workers, shared): (usize, bool),
    asked: Option<u64>,
    too_large: impl FnOnce(Budget) -> ExitError,
) -> Result<MemoryPlan, ExitError> {
    let limits = Limits::new(asked);
    let bytes = |threads: usize| limits.budget(threads).map(|budget| budget.bytes);
    let all_on_one = if shared { need.plan(threads, true, bytes(threads)).filter(|fit| fit.shared) } else { None };
    // Each thread reserves addresses, so that fewer threads have a larger budget.
    let separate = |frames: usize| need.plan(frames, false, bytes(frames)).filter(|fit| fit.workers == frames);
    let Some(fit) = all_on_one.or_else(|| (1..=workers).rev().find_map(separate)) else {
        let budget = limits.budget(1);
        return Err(too_large(budget.unwrap_or(Budget { bytes: 0, source: "the available memory" })));
    };
    if (fit.workers, fit.shared) != (workers, shared)
        && let Some(Budget { bytes, source }) = limits.budget(fit.workers)
    {
        let (used, may) = (fit.workers, format_bytes(bytes as f64));
        exit::note(format!("{used} of {threads} threads are used, to stay below {may} ({source})"));
    }
    Ok(fit)
}

/// Returns the number of frames, at most `workers`, that fit into memory at the same time.
///
/// # Errors
/// If not even one fits.
pub(crate) fn frames_at_once(setup: &Setup, layout: &Layout, workers: usize) -> Result<usize, ExitError> {
    frames_of(&setup.recipe.recipe, setup, layout, workers)
}

/// Checks that a scene fits into memory. Its size may differ from that of the recipe.
pub(crate) fn check_scene(setup: &Setup, scene: &Scene) -> Result<(), ExitError> {
    let mut recipe = setup.recipe.recipe.clone();
    let field = &mut recipe.field;
    (field.width_px, field.height_px) = ((scene.view.width as f64).into(), (scene.view.height as f64).into());
    (field.pixel_um, field.magnification) = (scene.view.pixel_um.into(), 0.0.into());
    recipe.focus.planes = (scene.planes_um.len() as f64).into();
    frames_of(&recipe, setup, &Layout::default(), 1).map(drop)
}

fn frames_of(recipe: &Recipe, setup: &Setup, layout: &Layout, workers: usize) -> Result<usize, ExitError> {
    let need = MemoryEstimate::of(recipe, &setup.model, layout);
    let fit = fit(&need, setup.threads, (workers, false), None, |Budget { bytes, source }| {
        let help = "smaller fields, fewer cells, one plane, monochrome light and less oversampling need less memory";
        ExitError::with_help(format!("{} ({source})", need.too_large(recipe, bytes)), help)
    });
    Ok(fit?.workers)
}

/// Checks that the address-space limit leaves room for a recipe and a model.
pub(crate) fn check_addresses() -> Result<(), ExitError> {
    let Some(free) = free_addresses().filter(|free| *free < PROGRAM_ADDRESSES) else { return Ok(()) };
    let [free, needed] = [free, PROGRAM_ADDRESSES].map(|bytes| format_bytes(bytes as f64));
    let message = format!("the address-space limit of the process leaves {free}; at least {needed} are needed");
    Err(ExitError::with_help(message, "raise the limit: `ulimit -v` shows it, in KiB"))
}

/// Bytes of address space that the limit of the process (`RLIMIT_AS`) leaves; `None` without a limit, or if unknown.
fn free_addresses() -> Option<u64> {
    let limits = fs::read_to_string("/proc/self/limits").ok()?;
    let limit = soft_limit(&limits)?;
    Some(limit.saturating_sub(status("VmSize:").unwrap_or_default()))
}

/// The soft limit of the address space in `/proc/self/limits`, bytes.
fn soft_limit(limits: &str) -> Option<u64> {
    let line = limits.lines().find_map(|line| line.strip_prefix("Max address space"))?;
    line.split_whitespace().next()?.parse().ok()
}

/// A size in `/proc/self/status`, bytes.
fn status(key: &str) -> Option<u64> {
    let status = fs::read_to_string("/proc/self/status").ok()?;
    let line = status.lines().find_map(|line| line.strip_prefix(key))?;
    line.trim().strip_suffix("kB")?.trim().parse::<u64>().ok().map(|kilobytes| kilobytes.saturating_mul(1024))
}

/// Keeps the memory of a long run from growing. glibc raises its thresholds with the largest block that was freed
/// (mallopt(3)) and then keeps up to twice as much freed memory per thread. Fixed thresholds save a third of the memory
/// of small images and cost 5 % of the time; larger images do not change.
#[cfg(all(target_os = "linux", target_env = "gnu"))]
#[allow(unsafe_code, reason = "mallopt has no safe wrapper")]
pub(crate) fn configure_allocator() {
    /// Larger blocks are mapped one by one.
    const MMAP_THRESHOLD: libc::c_int = 4 << 20;
    /// Freed memory at the end of a heap that is kept.
    const TRIM_THRESHOLD: libc::c_int = 2 << 20;
    // SAFETY: both calls set a number of the allocator. They accept any value and ignore invalid ones.
    unsafe {
        libc::mallopt(libc::M_MMAP_THRESHOLD, MMAP_THRESHOLD);
        libc::mallopt(libc::M_TRIM_THRESHOLD, TRIM_THRESHOLD);
    }
}

/// Other allocators keep their settings.
#[cfg(not(all(target_os = "linux", target_env = "gnu")))]
pub(crate) fn configure_allocator() {}

/// Parses sizes like `2GiB`, `500MB`, `1.5G` and `1048576`. Units are powers of 1024 with an `i` or without a `B`, else
/// of
/// 1000.
pub(crate) fn parse_size(text: &str) -> Result<u64, String> {
    let wrong = || String::from("expected a size, for example 2GiB, 500MB or 1048576");
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

/// Peak memory of the process, bytes; `None` if unknown.
pub(crate) fn peak() -> Option<u64> {
    status("VmHWM:")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sizes_are_parsed() {
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
    #[test]
    fn the_soft_limit_of_the_address_space_is_parsed() {
        let table =
            |soft: &str| format!("Limit  Soft  Hard  Units\nMax address space         {soft}   unlimited  bytes\n");
        assert_eq!(soft_limit(&table("409600000")), Some(409_600_000));
        assert_eq!(soft_limit(&table("unlimited")), None);
    }
}
