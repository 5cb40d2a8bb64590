//! The task of this process: given on the command line, or read from the environment of a scheduler.

use clap::Args;
use papsynth_dataset::Task;

use crate::exit::ExitError;

/// The value of `--task`.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum TaskArg {
    Given(Task),
    /// The task is read from the environment; the number of tasks is given, or read as well.
    Environment(Option<u64>),
}

/// Which part of the work to do.
#[derive(Debug, Args)]
pub(crate) struct TaskArgs {
    /// Do task I of N: write every N-th shard, beginning with shard I (0/4 to 3/4 write all). `auto` reads I and N from
    /// a Slurm array, `auto/N` reads I from a Kubernetes job of N completions. When all tasks are done, run `papsynth
    /// merge`, or `papsynth slide finalize` for a slide
    #[arg(long, value_name = "I/N", value_parser = parse_task)]
    pub(crate) task: Option<TaskArg>,
}

impl TaskArgs {
    /// The task of this process; without `--task`, all of the work.
    pub(crate) fn task(&self) -> Result<Task, ExitError> {
        match self.task {
            None => Ok(Task::ALL),
            Some(TaskArg::Given(task)) => Ok(task),
            Some(TaskArg::Environment(count)) => from_environment(count, |name| std::env::var(name).ok()),
        }
    }
}

fn parse_task(text: &str) -> Result<TaskArg, String> {
    let expected = || "expected I/N with 0 ≤ I < N, for example 0/4, or `auto`, or `auto/N`".to_owned();
    let number = |part: &str| part.trim().parse::<u64>().map_err(|_| expected());
    match text.split_once('/') {
        None if text == "auto" => Ok(TaskArg::Environment(None)),
        Some(("auto", count)) => match number(count)? {
            0 => Err(expected()),
            count => Ok(TaskArg::Environment(Some(count))),
        },
        Some((index, count)) => {
            let task = Task { index: number(index)?, total: number(count)? };
            if task.index < task.total { Ok(TaskArg::Given(task)) } else { Err(expected()) }
        }
        None => Err(expected()),
    }
}

/// Reads the task from the environment. Slurm sets index, first and last index and count; Kubernetes sets the index
/// only.
fn from_environment(count: Option<u64>, variable: impl Fn(&str) -> Option<String>) -> Result<Task, ExitError> {
    let number = |name: &str| -> Result<Option<u64>, ExitError> {
        let Some(text) = variable(name) else { return Ok(None) };
        let wrong = |_| ExitError::input(format!("{name} is {text:?}; expected an integer"));
        text.trim().parse().map(Some).map_err(wrong)
    };
    let unknown = |message: &str| Err(ExitError::with_help(message, "give the number of tasks: --task auto/N"));
    let (name, index, count) = if let Some(index) = number("SLURM_ARRAY_TASK_ID")? {
        // A repaired array (`--array=3,17`) does not state the original number of tasks.
        let (tasks, first) = (number("SLURM_ARRAY_TASK_COUNT")?, number("SLURM_ARRAY_TASK_MIN")?.unwrap_or(0));
        let last = if count.is_none() { number("SLURM_ARRAY_TASK_MAX")? } else { None };
        let is_complete = first == 0 && last.is_none_or(|last| tasks == Some(last.saturating_add(1)));
        let Some(count) = count.or(tasks.filter(|_| is_complete)) else {
            return unknown("the Slurm array does not consist of the tasks 0 to N − 1, so N is unknown");
        };
        ("SLURM_ARRAY_TASK_ID", index, count)
    } else if let Some(index) = number("JOB_COMPLETION_INDEX")? {
        let Some(count) = count else { return unknown("Kubernetes does not set the number of completions") };
        ("JOB_COMPLETION_INDEX", index, count)
    } else {
        let message = "--task auto: neither SLURM_ARRAY_TASK_ID nor JOB_COMPLETION_INDEX is set";
        return Err(ExitError::with_help(message, "give the task, for example --task 0/4"));
    };
    match index < count {
        true => Ok(Task { index, total: count }),
        false => {
            let last = count.saturating_sub(1);
            Err(ExitError::input(format!("--task auto: {name} is {index}; expected 0 to {last}")))
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn task(count: Option<u64>, variables: &[(&str, &str)]) -> Option<Task> {
        let found = |name: &str| variables.iter().find(|(n, _)| *n == name).map(|(_, value)| (*value).to_owned());
        from_environment(count, found).ok()
    }

    #[test]
    fn tasks_are_read_from_the_environment_of_schedulers() {
        let array = [
            ("SLURM_ARRAY_TASK_ID", "3"),
            ("SLURM_ARRAY_TASK_COUNT", "20"),
            ("SLURM_ARRAY_TASK_MIN", "0"),
            ("SLURM_ARRAY_TASK_MAX", "19"),
        ];
        assert_eq!(task(None, &array), Some(Task { index: 3, total: 20 }));
        // A repaired array: two tasks of 20.
        let repaired = [array[0], ("SLURM_ARRAY_TASK_COUNT", "2"), ("SLURM_ARRAY_TASK_MIN", "3"), array[3]];
        assert_eq!(task(None, &repaired), None);
        assert_eq!(task(Some(20), &repaired), Some(Task { index: 3, total: 20 }));
        let gaps = [array[0], ("SLURM_ARRAY_TASK_COUNT", "2"), ("SLURM_ARRAY_TASK_MIN", "0"), array[3]];
        assert_eq!(task(None, &gaps), None);
        assert_eq!(task(Some(8), &[("JOB_COMPLETION_INDEX", "7")]), Some(Task { index: 7, total: 8 }));
        assert_eq!(task(None, &[("JOB_COMPLETION_INDEX", "7")]), None);
        assert_eq!(task(Some(7), &[("JOB_COMPLETION_INDEX", "7")]), None);
        assert_eq!(task(Some(7), &[("JOB_COMPLETION_INDEX", "x")]), None);
        assert_eq!(task(Some(7), &[]), None);
    }
}
