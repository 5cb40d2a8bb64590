//! Instruction counts of small kernels, compared with recorded counts.

use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;
use std::process::Command;

use anyhow::{Context, Result, ensure};

use crate::shell::{self, skipped};
use crate::workspace::Workspace;

/// The program of the kernels, and the recorded counts.
const PACKAGE: &str = "papsynth-benches";
const PROGRAM: &str = "counts";
const FILE: &str = "benches/counts.json";

/// Makes the C library use vector instructions to copy and clear memory of any size. Its default depends on the caches
/// of the machine, and a string instruction counts once for each byte.
const PLAIN_MEMORY: &str = "glibc.cpu.x86_rep_movsb_threshold=0xffffffffffffffff:\
                            glibc.cpu.x86_rep_stosb_threshold=0xffffffffffffffff:\
                            glibc.cpu.x86_non_temporal_threshold=0xfffffffffffffff";

/// Tolerated change, per cent.
const TOLERANCE_PERCENT: f64 = 2.0;

/// Instructions by name of the kernel.
type Counts = BTreeMap<String, u64>;

pub(crate) fn run(workspace: &Workspace, bless: bool) -> Result<()> {
    let path = workspace.root.join(FILE);
    let compiler = compiler(workspace)?;
    let mut kept: BTreeMap<String, Counts> =
        serde_json::from_str(&shell::read(&path)?).with_context(|| format!("{FILE} is invalid"))?;
    if !shell::answers("valgrind", "--version") {
        return Err(skipped("valgrind is not installed"));
    }
    if !bless && !kept.contains_key(&compiler) {
        return Err(skipped(format!("{FILE} has no counts for {compiler}; --bless adds them")));
    }
    let found = count(workspace)?;
    let old = kept.get(&compiler).cloned().unwrap_or_default();
    let (table, bad) = compare(&old, &found);
    println!("\nInstructions, {compiler}:\n\n{table}");
    if bless {
        kept.insert(compiler, found);
        shell::write(&path, &(serde_json::to_string_pretty(&kept).context("counts as JSON")? + "\n"))?;
        println!("Wrote {FILE}.");
        return Ok(());
    }
    ensure!(
        bad.is_empty(),
        "more than {TOLERANCE_PERCENT} % above the recorded counts, or not recorded: {}. `cargo xtask bench counts --bless` records the new counts",
        bad.join(", ")
    );
    if table.contains(FEWER) {
        println!(
            "Some kernels take fewer instructions than recorded: record them with `cargo xtask bench counts --bless`."
        );
    }
    Ok(())
}

/// Returns the version and the host of the compiler.
fn compiler(workspace: &Workspace) -> Result<String> {
    let text = shell::output(shell::rustc().arg("-vV").current_dir(&workspace.root))?;
    let after = |key: &str| text.lines().find_map(|line| line.strip_prefix(key)).map(str::trim);
    let both = after("release:").zip(after("host:")).with_context(|| format!("`rustc -vV` printed {text}"))?;
    Ok(format!("rustc {} {}", both.0, both.1))
}

/// Builds the program and runs each kernel under valgrind.
fn count(workspace: &Workspace) -> Result<Counts> {
    // With the features of papsynth-cli, so that both share their dependencies.
    let packages = ["--package", PACKAGE, "--package", "papsynth-cli"];
    shell::run(workspace.cargo().args(["build", "--release", "--bin", PROGRAM]).args(packages))?;
    let program = workspace.target.join("release").join(PROGRAM);
    let names = shell::output(&mut Command::new(&program))?;
    names.lines().map(|name| Ok((name.to_owned(), instructions(&program, name)?))).collect()
}

/// Returns the instructions of a kernel, without those for its inputs.
fn instructions(program: &Path, work: &str) -> Result<u64> {
    let mut valgrind = Command::new("valgrind");
    valgrind.args([
        "--tool=callgrind",
        "--cache-sim=no",
        "--toggle-collect=*counted*",
        "--callgrind-out-file=/dev/null",
    ]);
    // No other variables: the size of the environment changes the memory layout and the counts.
    valgrind.arg(program).arg(work).env_clear().env("GLIBC_TUNABLES", PLAIN_MEMORY);
    let output = valgrind.output().context("cannot start valgrind")?;
    let text = String::from_utf8_lossy(&output.stderr);
    ensure!(output.status.success(), "`{work}` failed under valgrind ({}): {text}", output.status);
    collected(&text).with_context(|| format!("valgrind counted no instructions of `{work}`: {text}"))
}

/// Returns the number in the line `==1== Collected : 42`.
fn collected(text: &str) -> Option<u64> {
    let number = text.lines().find_map(|line| line.split_once("Collected :"))?.1.trim().parse().ok()?;
    (number > 0).then_some(number)
}

const FEWER: &str = "  fewer";

/// Returns the table, and the names of kernels that take more, are new or are missing.
fn compare<'a>(kept: &'a Counts, found: &'a Counts) -> (String, Vec<&'a str>) {
    let mut text = format!("{:<16} {:>14} {:>14} {:>9}\n", "kernel", "recorded", "found", "change");
    let mut bad = Vec::new();
    for name in kept.keys().chain(found.keys()).collect::<BTreeSet<_>>() {
        let (kept, found) = (kept.get(name), found.get(name));
        let change = kept.zip(found).map(|(kept, found)| 100.0 * (*found as f64 - *kept as f64) / *kept as f64);
        let words = match change {
            Some(change) if change > TOLERANCE_PERCENT => "  MORE",
            Some(change) if change < -TOLERANCE_PERCENT => FEWER,
            Some(_) => "",
            None if kept.is_none() => "  not recorded",
            None => "  missing",
        };
        if !["", FEWER].contains(&words) {
            bad.push(name.as_str());
        }
        let [kept, found] = [kept, found].map(|count| count.map_or("-".to_owned(), u64::to_string));
        let change = change.map_or("-".to_owned(), |change| format!("{change:+.2} %"));
        text += &format!("{name:<16} {kept:>14} {found:>14} {change:>9}{words}\n");
    }
    (text, bad)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn changes_above_two_per_cent_are_reported() {
        let counts = |pairs: [(&str, u64); 4]| pairs.map(|(name, count)| (name.to_owned(), count)).into();
        let kept = counts([("a", 1000), ("b", 1000), ("c", 1000), ("d", 1000)]);
        let found = counts([("a", 1020), ("b", 1021), ("c", 979), ("e", 5)]);
        let (table, bad) = compare(&kept, &found);
        assert_eq!(bad, ["b", "d", "e"]);
        let ends = ["change", "+2.00 %", "+2.10 %  MORE", "-2.10 %  fewer", "-  missing", "-  not recorded"];
        assert_eq!(table.lines().count(), ends.len());
        assert!(table.lines().zip(ends).all(|(line, end)| line.ends_with(end)), "{table}");
    }

    #[test]
    fn the_count_is_parsed() {
        let text = "==7== Events    : Ir\n==7== Collected : 398413\n==7==\n";
        assert_eq!(collected(text), Some(398_413));
        assert_eq!(collected("==7== Collected : 0"), None);
    }
}
