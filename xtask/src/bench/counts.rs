//! Instructions of small works, compared with those that are kept.

use std::collections::BTreeMap;
use std::fs;
use std::path::Path;
use std::process::Command;

use anyhow::{Context, Result, ensure};

use crate::arguments::Arguments;
use crate::chore::Outcome;
use crate::shell;
use crate::workspace::Workspace;

/// The program that does the works, and the counts that are kept of them.
const PACKAGE: &str = "papsynth-benches";
const PROGRAM: &str = "counts";
const FILE: &str = "benches/counts.json";

/// Makes the C library clear and copy memory by plain vectors at every size. Else it goes by the caches of the machine, and a string
/// instruction counts once for each byte.
const PLAIN_MEMORY: &str = "glibc.cpu.x86_rep_movsb_threshold=0xffffffffffffffff:\
                            glibc.cpu.x86_rep_stosb_threshold=0xffffffffffffffff:\
                            glibc.cpu.x86_non_temporal_threshold=0xfffffffffffffff";

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
    let found = count(workspace)?;
    let old = kept.get(&compiler).cloned().unwrap_or_default();
    let lines = compare(&old, &found);
    println!("\nInstructions, {compiler}:\n\n{}", table(&lines));
    if bless {
        kept.insert(compiler, found);
        let text = serde_json::to_string_pretty(&kept).context("counts as JSON")?;
        fs::write(&path, text + "\n").with_context(|| format!("cannot write {FILE}"))?;
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
        Ok(text) => serde_json::from_str(&text).with_context(|| format!("{FILE} is not in order")),
        Err(error) if error.kind() == std::io::ErrorKind::NotFound => Ok(BTreeMap::new()),
        Err(error) => Err(error).with_context(|| format!("cannot read {FILE}")),
    }
}

/// Builds the program and runs each of its works under valgrind.
fn count(workspace: &Workspace) -> Result<Counts> {
    // With the features that the program papsynth has, so that both share what they are built of.
    let packages = ["--package", PACKAGE, "--package", "papsynth-cli"];
    shell::run(workspace.cargo().args(["build", "--release", "--bin", PROGRAM]).args(packages))?;
    let program = workspace.target.join("release").join(PROGRAM);
    let names = shell::output(&mut Command::new(&program))?;
    names.lines().map(|name| Ok((name.to_owned(), instructions(&program, name)?))).collect()
}

/// Instructions of a work, without those of its inputs.
fn instructions(program: &Path, work: &str) -> Result<u64> {
    let mut valgrind = Command::new("valgrind");
    valgrind.args([
        "--tool=callgrind",
        "--cache-sim=no",
        "--toggle-collect=*counted*",
        "--callgrind-out-file=/dev/null",
    ]);
    // No other variable: the environment moves memory, and with it the counts.
    valgrind.arg(program).arg(work).env_clear().env("GLIBC_TUNABLES", PLAIN_MEMORY);
    let output = valgrind.output().context("cannot start valgrind")?;
    let text = String::from_utf8_lossy(&output.stderr);
    ensure!(output.status.success(), "`{work}` failed under valgrind ({}): {text}", output.status);
    collected(&text).with_context(|| format!("valgrind counted nothing of `{work}`: {text}"))
}

/// The number in the line `==1== Collected : 42`.
fn collected(text: &str) -> Option<u64> {
    let number = text.lines().find_map(|line| line.split_once("Collected :"))?.1.trim().parse().ok()?;
    (number > 0).then_some(number)
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
    fn the_count_is_read() {
        let text = "==7== Events    : Ir\n==7== Collected : 398413\n==7==\n";
        assert_eq!(collected(text), Some(398_413));
        assert_eq!(collected("==7== Collected : 0"), None);
    }
}
