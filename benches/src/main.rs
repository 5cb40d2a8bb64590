//! Times workloads for another program: `papsynth-benches FOLDER`.
//!
//! Each input line contains the name of a workload and a number of seconds. The workload runs for about this time, at
//! least once. The output is a line of JSON with the CPU time of each run. Each workload runs once before its first
//! measurement. Output files are written to the folder.

#![forbid(unsafe_code)]
#![expect(clippy::print_stdout, reason = "prints its measurements")]

use std::collections::BTreeMap;
use std::error::Error;
use std::io::{Write, stdin, stdout};
use std::path::PathBuf;

use papsynth_benches::{Timed, cpu_seconds, named};

/// Shorter workloads run several times per clock reading.
const LEAST_S: f64 = 2e-3;

/// A workload after its first run, and its runs per clock reading.
struct Warm {
    timed: Timed,
    at_once: u32,
}

fn main() -> Result<(), Box<dyn Error>> {
    let folder = PathBuf::from(std::env::args().nth(1).ok_or("missing argument: folder for output files")?);
    let mut known = BTreeMap::new();
    for line in stdin().lines() {
        let line = line?;
        let (name, seconds) = line.split_once(' ').ok_or("expected a name and seconds")?;
        let seconds: f64 = seconds.trim().parse()?;
        if !known.contains_key(name) {
            let timed = named(name, &folder).ok_or_else(|| format!("unknown workload `{name}`"))?;
            known.insert(name.to_owned(), warm(timed));
        }
        if let Some(work) = known.get_mut(name) {
            let figures: Vec<String> = measure(work, seconds).iter().map(|s| format!("{s:.9}")).collect();
            println!("{{\"work\":\"{name}\",\"cpu_s\":[{}]}}", figures.join(","));
            stdout().flush()?;
        }
    }
    Ok(())
}

/// Runs a workload once, and short ones again to measure their duration.
fn warm(mut timed: Timed) -> Warm {
    let mut once = || {
        let start = cpu_seconds();
        (timed.work)();
        cpu_seconds() - start
    };
    let first = once();
    let usual = if first < 0.1 { once() } else { first };
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "float to integer casts saturate")]
    let at_once = (LEAST_S / usual.max(1e-9)).ceil() as u32;
    Warm { timed, at_once }
}

/// Returns the CPU seconds of each run.
fn measure(Warm { timed, at_once }: &mut Warm, seconds: f64) -> Vec<f64> {
    let begin = cpu_seconds();
    let mut figures = Vec::new();
    while figures.is_empty() || cpu_seconds() - begin < seconds {
        let start = cpu_seconds();
        (0..*at_once).for_each(|_| (timed.work)());
        figures.push((cpu_seconds() - start) / (f64::from(*at_once) * timed.parts));
    }
    figures
}
