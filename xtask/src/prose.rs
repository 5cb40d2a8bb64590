//! Checks of comments and Markdown: line width, and words that plain technical English avoids.

use std::process::Command;

use anyhow::{Result, ensure};

use crate::shell;
use crate::workspace::Workspace;

/// Maximum width of a line of a comment or of Markdown, characters.
const WIDTH: usize = 120;

/// Words that attribute intentions or knowledge to code, or have a plainer equivalent.
const AVOIDED: [&str; 9] = [
    "whoever",
    "whatever",
    "nobody",
    "somebody",
    "gives way",
    "is none of",
    "truth value",
    "beside others",
    "lies within",
];

/// Checks all tracked Rust and Markdown files.
pub(crate) fn run(workspace: &Workspace) -> Result<()> {
    let files = shell::output(Command::new("git").args(["ls-files", "*.rs", "*.md"]).current_dir(&workspace.root))?;
    let mut findings = Vec::new();
    for file in files.lines().filter(|file| *file != "xtask/src/prose.rs") {
        let path = workspace.root.join(file);
        // A deleted file stays in the index until the next commit.
        if path.is_file() {
            let check = if file.ends_with(".md") { markdown } else { rust };
            findings
                .extend(check(&shell::read(&path)?).into_iter().map(|(line, what)| format!("{file}:{line}: {what}")));
        }
    }
    ensure!(findings.is_empty(), "{} lines to rewrite:\n{}", findings.len(), findings.join("\n"));
    Ok(())
}

/// Returns the line numbers and findings of a Markdown file. Tables and code blocks may be wider.
fn markdown(text: &str) -> Vec<(usize, String)> {
    let mut in_code = false;
    let mut findings = Vec::new();
    for (number, line) in (1..).zip(text.lines()) {
        if line.trim_start().starts_with("```") {
            in_code = !in_code;
        } else if !in_code {
            let is_table = line.starts_with('|');
            findings.extend(finding(line, !is_table).map(|what| (number, what)));
        }
    }
    findings
}

/// Returns the line numbers and findings of the comments of a Rust file.
fn rust(text: &str) -> Vec<(usize, String)> {
    let is_comment = |line: &&str| line.trim_start().starts_with("//");
    let comments = (1..).zip(text.lines()).filter(|(_, line)| is_comment(line));
    comments.filter_map(|(number, line)| Some((number, finding(line, true)?))).collect()
}

fn finding(line: &str, limit_width: bool) -> Option<String> {
    let width = line.chars().count();
    // A single long word, such as an address, cannot be wrapped.
    if limit_width && width > WIDTH && line.split_whitespace().count() > 2 {
        return Some(format!("{width} characters; expected at most {WIDTH}"));
    }
    let lower = line.to_lowercase();
    let word = AVOIDED.into_iter().find(|word| lower.contains(word))?;
    Some(format!("avoid \"{word}\""))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn wide_comments_and_avoided_words_are_found() {
        let wide = format!("/// {}", "word ".repeat(30));
        assert_eq!(rust(&format!("let a = 1;\n{wide}\n")).len(), 1);
        assert_eq!(rust("// Whoever calls this").len(), 1);
        assert!(rust(&format!("let text = \"{}\";", "x".repeat(200))).is_empty());
    }

    #[test]
    fn tables_and_code_blocks_may_be_wide() {
        let wide = "cell ".repeat(40);
        assert!(markdown(&format!("| {wide} |\n```sh\n{wide}\n```\n")).is_empty());
        assert_eq!(markdown(&wide).len(), 1);
    }
}
