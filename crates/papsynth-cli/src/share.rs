//! Which share of the work is this process's: as given, or as a scheduler says in its environment.

use clap::Args;
use papsynth_dataset::Task;

use crate::exit::Failure;

/// Which shards to make.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Shards {
    Given(Task),
    /// Those that the environment of a Slurm array or of a Kubernetes job says; of how many, where it does not say.
    Environment(Option<u64>),
}

/// Which share to make.
#[derive(Debug, Args)]
pub(crate) struct ShareArgs {
    /// Make every N-th shard from the I-th on (0/4 to 3/4 make all); `auto` asks the environment of a Slurm array, `auto/N`
    /// that of a Kubernetes job of N completions. Close the data set with `papsynth merge`, a slide with
    /// `papsynth slide finalize` afterwards
    #[arg(long, value_name = "I/N", value_parser = parse_share)]
    pub(crate) shard: Option<Shards>,
}

impl ShareArgs {
    /// The share that is asked for: all where none is.
    pub(crate) fn share(&self) -> Result<Task, Failure> {
        match self.shard {
            None => Ok(Task::ALL),
            Some(Shards::Given(share)) => Ok(share),
            Some(Shards::Environment(of)) => from_environment(of, |name| std::env::var(name).ok()),
        }
    }
}

fn parse_share(text: &str) -> Result<Shards, String> {
    let expected = "expected I/N with 0 ≤ I < N, such as 0/4, or `auto`, or `auto/N`";
    let number = |part: &str| part.trim().parse::<u64>().map_err(|e| format!("{part:?}: {e}; {expected}"));
    match text.split_once('/') {
        None if text == "auto" => Ok(Shards::Environment(None)),
        Some(("auto", of)) => match number(of)? {
            0 => Err(expected.to_owned()),
            of => Ok(Shards::Environment(Some(of))),
        },
        Some((index, of)) => {
            let share = Task { index: number(index)?, total: number(of)? };
            if share.index < share.total { Ok(Shards::Given(share)) } else { Err(expected.to_owned()) }
        }
        None => Err(expected.to_owned()),
    }
}

/// Slurm tells task, first and last task and step of an array; Kubernetes tells the index of a completion alone.
fn from_environment(of: Option<u64>, variable: impl Fn(&str) -> Option<String>) -> Result<Task, Failure> {
    let number = |name: &str| -> Result<Option<u64>, Failure> {
        let Some(text) = variable(name) else { return Ok(None) };
        let wrong = |_| Failure::input(format!("{name} is {text:?}; a whole number is expected"));
        text.trim().parse().map(Some).map_err(wrong)
    };
    let ask = |message: &str| Err(Failure::wrong(message, "say it: --shard auto/N"));
    let (index, of) = if let Some(task) = number("SLURM_ARRAY_TASK_ID")? {
        // Of a repaired array (`--array=3,17`) only its own numbers say how many tasks there once were.
        let (count, first) = (number("SLURM_ARRAY_TASK_COUNT")?, number("SLURM_ARRAY_TASK_MIN")?.unwrap_or(0));
        let last = if of.is_none() { number("SLURM_ARRAY_TASK_MAX")? } else { None };
        let is_whole = first == 0 && last.is_none_or(|last| count == Some(last.saturating_add(1)));
        let Some(of) = of.or(count.filter(|_| is_whole)) else {
            return ask(
                "the Slurm array has not the tasks 0 to N − 1, so that it does not say how many shares there are",
            );
        };
        (task, of)
    } else if let Some(index) = number("JOB_COMPLETION_INDEX")? {
        let Some(of) = of else { return ask("Kubernetes does not say how many completions there are") };
        (index, of)
    } else {
        let message = "neither SLURM_ARRAY_TASK_ID nor JOB_COMPLETION_INDEX is set, which `--shard auto` reads";
        return Err(Failure::wrong(message, "give the share itself: --shard 0/4"));
    };
    match index < of {
        true => Ok(Task { index, total: of }),
        false => Err(Failure::input(format!("task {index} is none of {of}, which are counted from 0"))),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn share(of: Option<u64>, variables: &[(&str, &str)]) -> Option<Task> {
        let found = |name: &str| variables.iter().find(|(n, _)| *n == name).map(|(_, value)| (*value).to_owned());
        from_environment(of, found).ok()
    }

    #[test]
    fn schedulers_say_which_share_it_is() {
        let array = [
            ("SLURM_ARRAY_TASK_ID", "3"),
            ("SLURM_ARRAY_TASK_COUNT", "20"),
            ("SLURM_ARRAY_TASK_MIN", "0"),
            ("SLURM_ARRAY_TASK_MAX", "19"),
        ];
        assert_eq!(share(None, &array), Some(Task { index: 3, total: 20 }));
        // A repaired array: two of the twenty.
        let repaired = [array[0], ("SLURM_ARRAY_TASK_COUNT", "2"), ("SLURM_ARRAY_TASK_MIN", "3"), array[3]];
        assert_eq!(share(None, &repaired), None);
        assert_eq!(share(Some(20), &repaired), Some(Task { index: 3, total: 20 }));
        let gaps = [array[0], ("SLURM_ARRAY_TASK_COUNT", "2"), ("SLURM_ARRAY_TASK_MIN", "0"), array[3]];
        assert_eq!(share(None, &gaps), None);
        assert_eq!(share(Some(8), &[("JOB_COMPLETION_INDEX", "7")]), Some(Task { index: 7, total: 8 }));
        assert_eq!(share(None, &[("JOB_COMPLETION_INDEX", "7")]), None);
        assert_eq!(share(Some(7), &[("JOB_COMPLETION_INDEX", "7")]), None);
        assert_eq!(share(Some(7), &[("JOB_COMPLETION_INDEX", "x")]), None);
        assert_eq!(share(Some(7), &[]), None);
    }
}
