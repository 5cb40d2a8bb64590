//! Instructions of small works, compared with those that are kept.

use std::collections::BTreeMap;
use std::ffi::OsString;
use std::fs;
use std::path::Path;
use std::process::Command;

use anyhow::{Context, Result, bail, ensure};
use serde_json::Value;

use crate::arguments::Arguments;
use crate::outcome::Outcome;
use crate::shell;
use crate::workspace::Workspace;

/// The works, and the counts that are kept of them.
pub(super) const PACKAGE: &str = "papsynth-benches";
const BENCH: &str = "counts";
const FILE: &str = "benches/counts.toml";
const HEAD: &str = "# Instructions of the works of benches/benches/counts.rs, for each compiler.\n\
                    # `cargo xtask bench counts --bless` writes this file.\n";

/// The program that runs the works; its version must be the library's.
const RUNNER: &str = "gungraun-runner";
const RUNNER_VERSION: &str = "0.20.0";

/// How many per cent more or less than is kept go without a word.
const TOLERANCE_PERCENT: f64 = 2.0;

/// Instructions by name of the work.
type Counts = BTreeMap<String, u64>;

pub(super) fn run(workspace: &Workspace, mut arguments: Arguments) -> Result<Outcome> {
    let bless = arguments.flag("--bless");
    arguments.finish()?;
    let path = workspace.root.join(FILE);
    let compiler = compiler(workspace)?;
    let mut kept = read(&path)?;
    if !shell::answers(Command::new("valgrind").arg("--version")) {
        return Outcome::skipped_unless_ci("valgrind is not installed, which counts instructions".to_owned());
    }
    if !bless && !kept.contains_key(&compiler) {
        return Outcome::skipped_unless_ci(format!("{FILE} has no counts for {compiler}; --bless adds them"));
    }
    let tools = match runner(workspace)? {
        Ok(tools) => tools,
        Err(reason) => return Outcome::skipped_unless_ci(reason),
    };
    let found = count(workspace, &tools)?;
    let old = kept.get(&compiler).cloned().unwrap_or_default();
    let lines = compare(&old, &found);
    println!("\nInstructions, {compiler}:\n\n{}", table(&lines));
    if bless {
        kept.insert(compiler, found);
        let text = toml::to_string(&kept).context("counts as TOML")?;
        fs::write(&path, format!("{HEAD}\n{text}")).with_context(|| format!("cannot write {FILE}"))?;
        println!("{FILE} holds them now.");
        return Ok(Outcome::Done);
    }
    let bad: Vec<&str> = lines.iter().filter(|line| line.verdict.is_bad()).map(|line| line.name.as_str()).collect();
    ensure!(
        bad.is_empty(),
        "more than {TOLERANCE_PERCENT} % above what is kept, or not kept at all: {}. `cargo xtask bench counts --bless` takes it as it is",
        bad.join(", ")
    );
    if lines.iter().any(|line| line.verdict == Verdict::Fewer) {
        println!("Some take fewer instructions than is kept: bless it, so that they stay so.");
    }
    Ok(Outcome::Done)
}

/// The compiler and the machine it makes programs for.
fn compiler(workspace: &Workspace) -> Result<String> {
    let rustc = std::env::var_os("RUSTC").unwrap_or_else(|| "rustc".into());
    let text = shell::output(Command::new(rustc).arg("-vV").current_dir(&workspace.root))?;
    let after = |key: &str| text.lines().find_map(|line| line.strip_prefix(key)).map(str::trim);
    let both = after("release:").zip(after("host:")).with_context(|| format!("`rustc -vV` says {text}"))?;
    Ok(format!("rustc {} {}", both.0, both.1))
}

fn read(path: &Path) -> Result<BTreeMap<String, Counts>> {
    match fs::read_to_string(path) {
        Ok(text) => toml::from_str(&text).with_context(|| format!("{FILE} is not in order")),
        Err(error) if error.kind() == std::io::ErrorKind::NotFound => Ok(BTreeMap::new()),
        Err(error) => Err(error).with_context(|| format!("cannot read {FILE}")),
    }
}

/// The `PATH` with the runner on it, which is installed below the target folder if it is not there; or why it cannot be had.
fn runner(workspace: &Workspace) -> Result<Result<OsString, String>> {
    let root = workspace.target.join("tools");
    let installed = fs::read_to_string(root.join(".crates.toml")).unwrap_or_default();
    if !installed.contains(&format!("\"{RUNNER} {RUNNER_VERSION} ")) {
        let mut command = workspace.cargo();
        let version = format!("={RUNNER_VERSION}");
        // Optimised it would take three times as long to compile, and all it does is to read what valgrind wrote.
        command.args(["install", RUNNER, "--version", &version, "--locked", "--debug", "--root"]).arg(&root);
        if let Err(error) = shell::run(&mut command) {
            return Ok(Err(format!("{RUNNER} {RUNNER_VERSION} cannot be installed: {error}")));
        }
    }
    let path = std::env::var_os("PATH").unwrap_or_default();
    let folders = [root.join("bin")].into_iter().chain(std::env::split_paths(&path));
    Ok(Ok(std::env::join_paths(folders).context("the PATH cannot be extended")?))
}

/// Runs the works under valgrind.
fn count(workspace: &Workspace, path: &OsString) -> Result<Counts> {
    workspace.expect_target(PACKAGE, "bench", BENCH)?;
    let mut command = workspace.cargo();
    command.args(["bench", "--package", PACKAGE, "--bench", BENCH]);
    // Whatever a person has set for other programs of this kind would change the counts or their form.
    let theirs =
        std::env::vars_os().map(|(name, _)| name).filter(|name| name.to_string_lossy().starts_with("GUNGRAUN_"));
    theirs.for_each(|name| {
        command.env_remove(name);
    });
    command.env("PATH", path).env("GUNGRAUN_OUTPUT_FORMAT", "json");
    let text = shell::output(&mut command)?;
    let counts = text.lines().filter(|line| line.starts_with('{')).map(summary).collect::<Result<Counts>>()?;
    ensure!(!counts.is_empty(), "the works told no counts");
    Ok(counts)
}

/// The name and the count of a line of JSON.
fn summary(line: &str) -> Result<(String, u64)> {
    let value: Value = serde_json::from_str(line).with_context(|| format!("no JSON: {line}"))?;
    let name = value.get("id").and_then(Value::as_str);
    let count = value.pointer("/profiles/0/data/total/metrics/Ir/values/new").and_then(Value::as_u64);
    let Some((name, count)) = name.zip(count) else { bail!("no count of instructions in {line}") };
    Ok((name.to_owned(), count))
}

/// A work, what is kept and what was found.
struct Line {
    name: String,
    kept: Option<u64>,
    found: Option<u64>,
    verdict: Verdict,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Verdict {
    Same,
    More,
    Fewer,
    /// It is not kept yet.
    New,
    /// There is no such work any more.
    Gone,
}

impl Verdict {
    fn is_bad(self) -> bool {
        matches!(self, Self::More | Self::New | Self::Gone)
    }
}

fn compare(kept: &Counts, found: &Counts) -> Vec<Line> {
    let mut names: Vec<&String> = kept.keys().chain(found.keys()).collect();
    names.sort();
    names.dedup();
    let line = |name: &String| {
        let (kept, found) = (kept.get(name).copied(), found.get(name).copied());
        let verdict = match (kept, found) {
            (Some(kept), Some(found)) => match change(kept, found) {
                change if change > TOLERANCE_PERCENT => Verdict::More,
                change if change < -TOLERANCE_PERCENT => Verdict::Fewer,
                _ => Verdict::Same,
            },
            (None, _) => Verdict::New,
            (_, None) => Verdict::Gone,
        };
        Line { name: name.clone(), kept, found, verdict }
    };
    names.into_iter().map(line).collect()
}

/// The change in per cent.
fn change(kept: u64, found: u64) -> f64 {
    100.0 * (found as f64 - kept as f64) / kept as f64
}

fn table(lines: &[Line]) -> String {
    let mut text = format!("{:<16} {:>14} {:>14} {:>9}\n", "work", "kept", "found", "change");
    for Line { name, kept, found, verdict } in lines {
        let shown = |count: &Option<u64>| count.map_or("-".to_owned(), |count| count.to_string());
        let change = kept.zip(*found).map_or("-".to_owned(), |(kept, found)| format!("{:+.2} %", change(kept, found)));
        let words = match verdict {
            Verdict::Same => "",
            Verdict::More => "  MORE",
            Verdict::Fewer => "  fewer: bless it",
            Verdict::New => "  not kept yet",
            Verdict::Gone => "  gone",
        };
        text.push_str(&format!("{name:<16} {:>14} {:>14} {change:>9}{words}\n", shown(kept), shown(found)));
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    fn counts(pairs: &[(&str, u64)]) -> Counts {
        pairs.iter().map(|(name, count)| ((*name).to_owned(), *count)).collect()
    }

    #[test]
    fn two_per_cent_more_go_and_more_does_not() {
        let kept = counts(&[("a", 1000), ("b", 1000), ("c", 1000), ("d", 1000)]);
        let found = counts(&[("a", 1020), ("b", 1021), ("c", 979), ("e", 5)]);
        let verdicts: Vec<_> = compare(&kept, &found).iter().map(|line| line.verdict).collect();
        assert_eq!(verdicts, [Verdict::Same, Verdict::More, Verdict::Fewer, Verdict::Gone, Verdict::New]);
    }

    #[test]
    fn a_summary_has_its_count() {
        let line = r#"{"id":"blur","profiles":[{"data":{"total":{"metrics":{"Ir":{"values":{"new":42,"old":41}}}}}}]}"#;
        assert_eq!(summary(line).unwrap(), ("blur".to_owned(), 42));
        assert!(summary("{}").is_err());
    }
}
