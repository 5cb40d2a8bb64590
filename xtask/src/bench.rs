//! Benches of the techniques and of the engine.

mod counts;

use std::fs;
use std::path::Path;

use anyhow::{Result, ensure};

use crate::arguments::Arguments;
use crate::chore::{Chore, Outcome};
use crate::workspace::Workspace;
use crate::{peers, shell};

pub(crate) const CHORE: Chore = Chore {
    name: "bench",
    usage: "[--save NAME] [--against NAME] [FILTER] | counts [--bless] | peers [--only NAME,...] [--repetitions N] [--record]",
    about: "runs the benches of all crates, counts instructions, or races against good programs of others",
    details: "--save keeps the figures under a name, --against compares with such a name, FILTER picks benches by name.\n\
              `counts` counts the instructions of small works under valgrind and fails where one takes 2 % more than \
              benches/counts.json keeps for this compiler; --bless writes that file.\n\
              `peers` does the works of a table in our way and in a good program of others, in turn on one thread of this machine, and \
              prints times, ratios and what is wanted; nothing is asserted. --only runs the rows whose names begin so, --repetitions says how \
              often both sides are measured in turn (5), --record adds a line to benches/history.jsonl and draws docs/performance.svg.\n\
              What needs valgrind or Python is left out with a sentence where there is none; a failure where CI is set.",
    run,
};

fn run(workspace: &Workspace, mut arguments: Arguments) -> Result<Outcome> {
    if arguments.flag("peers") {
        return peers::run(workspace, arguments);
    }
    if arguments.flag("counts") {
        return counts::run(workspace, arguments);
    }
    let save = arguments.option("--save")?;
    let against = arguments.option("--against")?;
    // Named one by one, since the test harness of a library does not know criterion's arguments.
    let benches = workspace.packages.iter().flat_map(|package| &package.targets).filter(|(kind, _)| kind == "bench");
    let mut command = workspace.cargo();
    command.args(["bench", "--workspace"]);
    for (_, name) in benches {
        command.args(["--bench", name]);
    }
    command.arg("--");
    if let Some(name) = save {
        command.args(["--save-baseline", &name]);
    }
    if let Some(name) = against {
        let saved = has_baseline(&workspace.target.join("criterion"), &name);
        ensure!(saved, "nothing was saved under the name `{name}` yet: cargo xtask bench --save {name}");
        // Lenient: a bench that is newer than the baseline is measured, and compared with nothing.
        command.args(["--baseline-lenient", &name]);
    }
    shell::run(command.args(arguments.rest()))?;
    Ok(Outcome::Done)
}

/// Whether any bench has figures of that name below a folder.
fn has_baseline(folder: &Path, name: &str) -> bool {
    let folders =
        fs::read_dir(folder).into_iter().flatten().flatten().map(|entry| entry.path()).filter(|path| path.is_dir());
    folders.into_iter().any(|path| path.file_name().is_some_and(|last| last == name) || has_baseline(&path, name))
}
