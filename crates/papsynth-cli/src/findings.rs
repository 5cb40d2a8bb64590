//! Findings of `papsynth verify`, for a data set or a slide.

use std::path::Path;

use papsynth_dataset::{Finding, Fix};

use crate::exit::{self, ExitError};
use crate::words::counted;

/// Findings that are printed at most.
const MAX_PRINTED: usize = 50;

pub(crate) fn print_findings(findings: &[Finding]) -> Result<(), ExitError> {
    let mut text = String::new();
    for finding in findings.iter().take(MAX_PRINTED) {
        text.push_str(&format!("{}: {}\n", finding.path, finding.message));
    }
    if findings.len() > MAX_PRINTED {
        text.push_str(&format!("and {} more\n", findings.len() - MAX_PRINTED));
    }
    exit::print(&text)
}

/// Returns an error with the commands that repair the findings, if there are any.
pub(crate) fn check(dir: &Path, findings: &[Finding]) -> Result<(), ExitError> {
    if findings.is_empty() {
        return Ok(());
    }
    let problems = counted(findings.len() as u64, "problem", "problems");
    let needs = |mend: Fix| findings.iter().any(|finding| finding.fix == mend);
    let dir = dir.display();
    let repairs: Vec<String> = [
        (
            Fix::Merge,
            "to complete an interrupted run, run the same `papsynth generate` command again; after several tasks, run \
             `papsynth merge`"
                .to_owned(),
        ),
        (
            Fix::Generate,
            "to repair frames, run `papsynth generate` or `papsynth slide make` again with --verify, or the command \
             that wrote them (`convert`, `rerender`, `sweep`) with a new folder"
                .to_owned(),
        ),
        (Fix::Clean, format!("`papsynth clean {dir}` removes temporary files of interrupted runs")),
        (Fix::CleanUntracked, format!("`papsynth clean {dir} --untracked` would delete the untracked files")),
    ]
    .into_iter()
    // Before the merge, untracked files can be frames of a killed run: the same command writes them again.
    .filter(|(mend, _)| needs(*mend) && !(*mend == Fix::CleanUntracked && needs(Fix::Merge)))
    .map(|(_, repair)| repair)
    .collect();
    Err(ExitError::with_help(format!("{dir}: {problems}"), repairs.join("; ")))
}
