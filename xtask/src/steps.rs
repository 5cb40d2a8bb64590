//! Runs named steps and prints the time of each.

use std::time::{Duration, Instant};

use anyhow::{Result, ensure};

use crate::shell::Skipped;
use crate::workspace::Workspace;

pub(crate) type Step = (&'static str, fn(&Workspace) -> Result<()>);

/// Runs all steps, even if one fails, and prints a table of outcomes and times.
pub(crate) fn run<'a>(workspace: &Workspace, steps: impl IntoIterator<Item = &'a Step>) -> Result<()> {
    let mut table = String::new();
    let mut failed = Vec::new();
    let mut total = Duration::ZERO;
    for &(name, step) in steps {
        println!("\n== {name} ==");
        let (outcome, time) = timed(|| step(workspace));
        total += time;
        let words = match outcome {
            Ok(()) => "passed".to_owned(),
            Err(error) if error.is::<Skipped>() => format!("skipped: {error}"),
            Err(error) => {
                failed.push(name);
                format!("FAILED: {error:#}")
            }
        };
        println!("{words}");
        table.push_str(&format!("{name:<18} {:>6.0} s  {words}\n", time.as_secs_f64()));
    }
    println!("\n{table}{:<18} {:>6.0} s", "total", total.as_secs_f64());
    ensure!(failed.is_empty(), "failed: {}", failed.join(", "));
    Ok(())
}

#[expect(clippy::disallowed_methods, reason = "the time is only printed")]
fn timed<T>(work: impl FnOnce() -> T) -> (T, Duration) {
    let start = Instant::now();
    (work(), start.elapsed())
}
