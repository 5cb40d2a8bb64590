//! Checks the source of a release.

use std::process::Command;

use anyhow::{Context, Result, ensure};

use crate::shell;
use crate::workspace::Workspace;

/// The heading of changes that belong to no version yet.
const UNRELEASED: &str = "Unreleased";

/// Checks that everything is committed and that all files state the same version. Returns the release notes.
pub(super) fn check(workspace: &Workspace, trial: bool) -> Result<String> {
    let package = workspace.released()?;
    let version = &package.version;
    if package.repository.as_deref().unwrap_or_default().is_empty() {
        println!("Cargo.toml: `repository` is empty. Fill it in before publishing; docs/RELEASING.md tells more.");
    }
    let citation = shell::read(&workspace.root.join("CITATION.cff"))?;
    let is_cited = citation.lines().any(|line| line == format!("version: {version}"));
    ensure!(is_cited, "CITATION.cff: expected `version: {version}`, the version in Cargo.toml");
    let changelog = shell::read(&workspace.root.join("CHANGELOG.md"))?;
    if trial {
        return notes(&changelog, version).or_else(|_| notes(&changelog, UNRELEASED)).context("CHANGELOG.md");
    }
    let status = ["status", "--porcelain"];
    let changes = shell::output(Command::new("git").args(status).current_dir(&workspace.root))?;
    ensure!(changes.is_empty(), "uncommitted changes (commit them, or add --trial):\n{}", changes.trim_end());
    notes(&changelog, version).context("CHANGELOG.md")
}

/// Returns the section of a version in a text of the format of Keep a Changelog, without its heading.
fn notes(changelog: &str, version: &str) -> Result<String> {
    let expected = match version {
        UNRELEASED => format!("## [{UNRELEASED}]"),
        _ => format!("## [{version}] - YYYY-MM-DD"),
    };
    let start = format!("## [{version}]");
    let mut lines = changelog.lines().skip_while(|line| !line.starts_with(&start));
    let heading = lines.next().with_context(|| format!("no heading `{expected}`"))?;
    let is_complete = version == UNRELEASED || heading.strip_prefix(&format!("{start} - ")).is_some_and(is_date);
    ensure!(is_complete, "found the heading `{heading}`; expected `{expected}`");
    let section: Vec<&str> = lines.take_while(|line| !line.starts_with("## ")).collect();
    let text = section.join("\n");
    ensure!(!text.trim().is_empty(), "nothing below the heading `{heading}`");
    Ok(format!("{}\n", text.trim()))
}

/// Whether a text has the form of a date, such as 2026-11-25.
fn is_date(text: &str) -> bool {
    let parts: Vec<&str> = text.split('-').collect();
    let digits = |part: &&str| part.bytes().all(|byte| byte.is_ascii_digit());
    parts.iter().map(|part| part.len()).eq([4, 2, 2]) && parts.iter().all(digits)
}

#[cfg(test)]
mod tests {
    use super::*;

    const CHANGELOG: &str = "# Changelog\n\n## [Unreleased]\n\n- New.\n\n## [0.2.0] - 2026-12-01\n\n### Added\n\n- B.\n\n\
                             ## [0.2.0-rc.1] - soon\n\n- A.\n\n## [0.1.0] - 2026-11-25\n";

    #[test]
    fn notes_are_the_section_of_the_version() {
        assert_eq!(notes(CHANGELOG, "0.2.0").unwrap(), "### Added\n\n- B.\n");
        assert_eq!(notes(CHANGELOG, UNRELEASED).unwrap(), "- New.\n");
    }

    #[test]
    fn missing_undated_and_empty_sections_are_errors() {
        for (version, message) in [
            ("0.3.0", "no heading `## [0.3.0] - YYYY-MM-DD`"),
            ("0.2.0-rc.1", "found the heading `## [0.2.0-rc.1] - soon`; expected `## [0.2.0-rc.1] - YYYY-MM-DD`"),
            ("0.1.0", "nothing below the heading `## [0.1.0] - 2026-11-25`"),
        ] {
            assert_eq!(notes(CHANGELOG, version).unwrap_err().to_string(), message);
        }
    }
}
