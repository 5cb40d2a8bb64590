//! Which share of the work is this process's: as given, or as a scheduler says in its environment.

use papsynth_dataset::Share;

use crate::args::Shards;
use crate::exit::{Complaint, Failure};

/// The share that is asked for.
pub(crate) fn of(shards: Shards) -> Result<Share, Failure> {
    match shards {
        Shards::Given(share) => Ok(share),
        Shards::Environment(of) => from_environment(of, |name| std::env::var(name).ok()),
    }
}

/// Slurm tells task, first and last task and step of an array; Kubernetes tells the index of a completion alone.
fn from_environment(of: Option<u64>, variable: impl Fn(&str) -> Option<String>) -> Result<Share, Failure> {
    let number = |name: &str| -> Result<Option<u64>, Failure> {
        let Some(text) = variable(name) else { return Ok(None) };
        let wrong = |_| Failure::input(Complaint::new(format!("{name} is {text:?}; a whole number is expected")));
        text.trim().parse().map(Some).map_err(wrong)
    };
    let share = if let Some(task) = number("SLURM_ARRAY_TASK_ID")? {
        // Of a repaired array (`--array=3,17`) only its own numbers say how many tasks there once were.
        let (count, first) = (number("SLURM_ARRAY_TASK_COUNT")?, number("SLURM_ARRAY_TASK_MIN")?.unwrap_or(0));
        match of {
            Some(of) => Share { index: task, of },
            None => {
                let last = number("SLURM_ARRAY_TASK_MAX")?;
                let whole = last.is_none_or(|last| count == Some(last.saturating_sub(first) + 1));
                match count {
                    Some(of) if whole && first == 0 => Share { index: task, of },
                    _ => {
                        return Err(ask(
                            "the Slurm array has not the tasks 0 to N − 1, so that it does not say how many shares there are",
                        ));
                    }
                }
            }
        }
    } else if let Some(index) = number("JOB_COMPLETION_INDEX")? {
        match of {
            Some(of) => Share { index, of },
            None => return Err(ask("Kubernetes does not say how many completions there are")),
        }
    } else {
        let message = "neither SLURM_ARRAY_TASK_ID nor JOB_COMPLETION_INDEX is set, which `--shard auto` reads";
        return Err(Failure::wrong(message, "give the share itself: --shard 0/4"));
    };
    if share.index < share.of {
        return Ok(share);
    }
    let Share { index, of } = share;
    Err(Failure::input(Complaint::new(format!("task {index} is none of {of}, which are counted from 0"))))
}

fn ask(message: &str) -> Failure {
    Failure::wrong(message, "say it: --shard auto/N")
}

#[cfg(test)]
mod tests {
    use super::*;

    fn share(of: Option<u64>, variables: &[(&str, &str)]) -> Option<Share> {
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
        assert_eq!(share(None, &array), Some(Share { index: 3, of: 20 }));
        // A repaired array: two of the twenty.
        let repaired = [array[0], ("SLURM_ARRAY_TASK_COUNT", "2"), ("SLURM_ARRAY_TASK_MIN", "3"), array[3]];
        assert_eq!(share(None, &repaired), None);
        assert_eq!(share(Some(20), &repaired), Some(Share { index: 3, of: 20 }));
        let gaps = [array[0], ("SLURM_ARRAY_TASK_COUNT", "2"), ("SLURM_ARRAY_TASK_MIN", "0"), array[3]];
        assert_eq!(share(None, &gaps), None);
        assert_eq!(share(Some(8), &[("JOB_COMPLETION_INDEX", "7")]), Some(Share { index: 7, of: 8 }));
        assert_eq!(share(None, &[("JOB_COMPLETION_INDEX", "7")]), None);
        assert_eq!(share(Some(7), &[("JOB_COMPLETION_INDEX", "7")]), None);
        assert_eq!(share(Some(7), &[("JOB_COMPLETION_INDEX", "x")]), None);
        assert_eq!(share(Some(7), &[]), None);
    }
}
