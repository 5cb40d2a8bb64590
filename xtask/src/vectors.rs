//! Checks that hot loops keep their lanes in vector registers.

use std::process::Command;

use anyhow::{Result, ensure};

use crate::dataset;
use crate::shell::{self, skipped};
use crate::workspace::Workspace;

/// Functions whose loops over lanes must not become gathers or scatters, which take several times as long.
const HOT: [&str; 11] = [
    "ccd_noise::chain::expose_row::",
    "optics_psf::canvas::mean_over_pixels::",
    "optics_psf::canvas::squares_of::",
    "optics_psf::canvas::transmit::",
    "optics_psf::canvas::write_columns::",
    "optics_psf::smooth::variances::",
    "optics_psf::spectrum::join::",
    "optics_psf::spectrum::place::",
    "optics_psf::spectrum::split::",
    "spectral_field::field::pack_rows::",
    "spectral_field::field::write_rows::",
];

pub(crate) fn run(workspace: &Workspace) -> Result<()> {
    if !cfg!(target_arch = "x86_64") {
        return Err(skipped("gathers and scatters are checked on x86-64"));
    }
    if !shell::answers("objdump", "--version") {
        return Err(skipped("objdump is not installed"));
    }
    shell::run(dataset::program(workspace, "").arg("--version"))?;
    let program = workspace.target.join("release/papsynth");
    let code = shell::output(
        Command::new("objdump").args(["--disassemble", "--demangle", "--no-show-raw-insn"]).arg(program),
    )?;
    let found = gathers(&code);
    for (function, count) in &found {
        println!("{count:>4} gathers and scatters in {function}");
    }
    let missing: Vec<&str> = HOT.into_iter().filter(|hot| !code.contains(hot)).collect();
    ensure!(missing.is_empty(), "not in the program; xtask/src/vectors.rs must name them anew: {}", missing.join(", "));
    let hot = |function: &&str| HOT.iter().any(|hot| function.starts_with(hot));
    let names: Vec<&str> = found.iter().map(|(function, _)| *function).filter(hot).collect();
    ensure!(names.is_empty(), "gathers or scatters in {}", names.join(", "));
    println!("No gathers or scatters in {} hot functions.", HOT.len());
    Ok(())
}

/// Counts gathers and scatters by function, most first.
fn gathers(code: &str) -> Vec<(&str, usize)> {
    let mut counts: Vec<(&str, usize)> = Vec::new();
    for line in code.lines() {
        if let Some(name) = line.strip_suffix(">:").and_then(|line| line.split_once('<')) {
            counts.push((name.1, 0));
        } else if let (Some(last), Some(instruction)) = (counts.last_mut(), line.split('\t').nth(1)) {
            let name = instruction.split(' ').next().unwrap_or_default();
            last.1 += usize::from(name.contains("gather") || name.contains("scatter"));
        }
    }
    counts.retain(|(_, count)| *count > 0);
    counts.sort_by_key(|(_, count)| core::cmp::Reverse(*count));
    counts
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn gathers_are_counted_by_function() {
        let code = "0010 <a::b::c_avx>:\n  10:\tvaddps %zmm1,%zmm2,%zmm3\n  18:\tvgatherdps (%rax),%zmm1{%k1}\n\n\
                    0020 <gather_d>:\n  20:\tcall   30 <gather_e>\n0030 <e>:\n  30:\tvscatterqps %ymm1,(%rax){%k1}\n  \
                    38:\tvgatherdps (%rax),%zmm1{%k1}\n";
        assert_eq!(gathers(code), [("e", 2), ("a::b::c_avx", 1)]);
    }
}
