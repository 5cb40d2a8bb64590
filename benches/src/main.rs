//! Times works for another program: `papsynth-benches FOLDER`.
//!
//! Each line of the input is a name of a work and a number of seconds. The work is done for about as long, at least once, and a line of
//! JSON tells the CPU time of each time. The first time a work is asked for, it is done once before. Files that
//! works write go below the folder.

#![forbid(unsafe_code)]
#![expect(clippy::print_stdout, reason = "what it measures is its output")]

use std::collections::BTreeMap;
use std::error::Error;
use std::io::{Write, stdin, stdout};
use std::path::PathBuf;

use papsynth_benches::{Timed, cpu_seconds, named};

/// Works shorter than this are done several times between two looks at the clock.
const LEAST_S: f64 = 2e-3;

/// A work that has been done before, and how often it is done between two looks at the clock.
struct Warm {
    timed: Timed,
    at_once: u32,
}

fn main() -> Result<(), Box<dyn Error>> {
    let folder = PathBuf::from(std::env::args().nth(1).ok_or("a folder for files is missing")?);
    let mut known = BTreeMap::new();
    for line in stdin().lines() {
        let line = line?;
        let (name, seconds) = line.split_once(' ').ok_or("expected a name and seconds")?;
        let seconds: f64 = seconds.trim().parse()?;
        if !known.contains_key(name) {
            let timed = named(name, &folder).ok_or_else(|| format!("there is no work `{name}`"))?;
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

/// Does a work once, and short ones once more to see how long they take.
fn warm(mut timed: Timed) -> Warm {
    let mut once = || {
        let start = cpu_seconds();
        (timed.work)();
        cpu_seconds() - start
    };
    let first = once();
    let usual = if first < 0.1 { once() } else { first };
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "a float to whole saturates")]
    let at_once = (LEAST_S / usual.max(1e-9)).ceil() as u32;
    Warm { timed, at_once }
}

/// CPU seconds of each time.
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
