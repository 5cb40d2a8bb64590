//! What was found in a data set or a slide.

use std::path::Path;

use papsynth_dataset::{Finding, Fix};

use crate::exit::{self, Failure};
use crate::words::counted;

/// Findings that are printed in full; the rest is counted.
const MOST_FINDINGS: usize = 50;

pub(crate) fn print_findings(findings: &[Finding]) -> Result<(), Failure> {
    let mut text = String::new();
    for finding in findings.iter().take(MOST_FINDINGS) {
        text.push_str(&format!("{}: {}\n", finding.path, finding.message));
    }
    if findings.len() > MOST_FINDINGS {
        text.push_str(&format!("and {} more\n", findings.len() - MOST_FINDINGS));
    }
    exit::print(&text)
}

/// Nothing found is good; else there is something to do.
pub(crate) fn judge(dir: &Path, findings: &[Finding]) -> Result<(), Failure> {
    if findings.is_empty() {
        return Ok(());
    }
    let things = counted(findings.len() as u64, "thing is", "things are");
    let wants = |fix: Fix| findings.iter().any(|finding| finding.fix == fix);
    let mends: Vec<&str> = [
        (Fix::Generate, "the command that made it, with --verify, makes again what is wrong"),
        (Fix::Merge, "`papsynth merge` closes it when all shards are there"),
        (Fix::Clean, "`papsynth clean --strays` takes away what does not belong there"),
    ]
    .into_iter()
    .filter(|(mend, _)| wants(*mend))
    .map(|(_, words)| words)
    .collect();
    Err(Failure::wrong(format!("{}: {things} wrong", dir.display()), mends.join("; ")))
}
