//! What can be typed about shares of the work.

use clap::Args;
use papsynth_dataset::Share;

/// Which shards to make.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Shards {
    /// Those of this share.
    Given(Share),
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

/// A share of the shards.
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
            let share = Share { index: number(index)?, of: number(of)? };
            if share.index < share.of { Ok(Shards::Given(share)) } else { Err(expected.to_owned()) }
        }
        None => Err(expected.to_owned()),
    }
}
