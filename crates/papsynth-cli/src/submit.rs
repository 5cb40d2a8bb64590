//! `papsynth submit`: the script that makes a data set on a cluster.

use std::path::Path;

use clap::Parser;

use crate::args::{Cli, Generate, Submit, Verb};
use crate::exit::{self, Failure};
use crate::setup::Setup;

pub(crate) fn run(args: &Submit) -> Result<(), Failure> {
    // What the tasks would refuse is refused here.
    let words = ["papsynth", "generate"].into_iter().chain(args.arguments.iter().map(String::as_str));
    let generate = match Cli::try_parse_from(words) {
        Ok(Cli { verb: Verb::Generate(generate) }) => generate,
        Ok(_) => return Err(Failure::input("what follows `--` is not for `papsynth generate`")),
        Err(error) => return Err(Failure::input(error)),
    };
    if generate.share.shard.is_some() || generate.engine.threads.is_some() {
        return Err(Failure::wrong(
            "--shard and --threads are for the script to set",
            "leave them out; --tasks and --threads before `--` say both",
        ));
    }
    check_here(&generate)?;
    let frames = generate.indices().end;
    let (layout, _) = generate.layout.layout(frames);
    let shards = frames.div_ceil(layout.frames_per_shard);
    if args.tasks > shards {
        return Err(Failure::wrong(
            format!("{} tasks for {shards} shards; some would have nothing to do", args.tasks),
            format!("at most {shards}, or fewer --frames-per-shard"),
        ));
    }
    let script = match args.scheduler.as_str() {
        "slurm" => slurm(args),
        _ => {
            let out = &generate.out;
            if !out.starts_with("/data") && !papsynth_dataset::Location::is_address(out) {
                exit::note(format!(
                    "{} lies in the pod and is lost with it; the volume is mounted at /data, and addresses of object stores need none",
                    out.display()
                ));
            }
            kubernetes(args)
        }
    };
    exit::print(&script)
}

/// What can be told of the recipe on this machine: all of it where it is here.
fn check_here(generate: &Generate) -> Result<(), Failure> {
    match &generate.engine.recipe.recipe {
        Some(path) if !path.exists() => {
            if path == Path::new("generate") {
                return Err(Failure::wrong(
                    "`generate` after `--` would be taken for a recipe",
                    "leave it out; what follows it is meant",
                ));
            }
            exit::note(format!("{} is not on this machine; the tasks must find it", path.display()));
            Ok(())
        }
        _ => Setup::load(&generate.engine, None).map(drop),
    }
}

fn slurm(args: &Submit) -> String {
    let Submit { tasks, threads, .. } = args;
    let arguments: Vec<String> = args.arguments.iter().map(|word| quoted(word)).collect();
    format!(
        "#!/bin/sh\n\
         #SBATCH --job-name=papsynth\n\
         #SBATCH --array=0-{last}\n\
         #SBATCH --cpus-per-task={threads}\n\
         #SBATCH --requeue\n\
         #SBATCH --open-mode=append\n\
         # A task that is killed or requeued goes on where it was. Exit code 74 (input/output) is worth another try.\n\
         papsynth generate {arguments} --threads {threads} --shard auto/{tasks}\n\
         code=$?\n\
         if [ \"$code\" -eq 74 ] && [ \"${{SLURM_RESTART_COUNT:-0}}\" -lt 5 ]; then\n\
         \x20 scontrol requeue \"${{SLURM_ARRAY_JOB_ID}}_${{SLURM_ARRAY_TASK_ID}}\"\n\
         fi\n\
         exit \"$code\"\n",
        last = tasks - 1,
        arguments = arguments.join(" "),
    )
}

fn kubernetes(args: &Submit) -> String {
    let Submit { tasks, threads, .. } = args;
    let image = serde_json::Value::from(args.image.as_deref().unwrap_or_default());
    let own = ["--threads".to_owned(), threads.to_string(), "--shard".to_owned(), format!("auto/{tasks}")];
    let words = std::iter::once(&"generate".to_owned()).chain(&args.arguments).chain(&own).cloned().collect::<Vec<_>>();
    // `$(NAME)` would be replaced by a variable of the environment.
    let words: Vec<String> = words.iter().map(|word| word.replace("$(", "$$(")).collect();
    let words = serde_json::Value::from(words);
    format!(
        "apiVersion: batch/v1\n\
         kind: Job\n\
         metadata:\n\
         \x20 name: papsynth\n\
         spec:\n\
         \x20 completionMode: Indexed\n\
         \x20 completions: {tasks}\n\
         \x20 parallelism: {tasks}\n\
         \x20 backoffLimitPerIndex: 5\n\
         \x20 podFailurePolicy:\n\
         \x20   rules:\n\
         \x20   # Usage, recipe or input: another try would fail as well.\n\
         \x20   - action: FailIndex\n\
         \x20     onExitCodes: {{ containerName: papsynth, operator: In, values: [2] }}\n\
         \x20   - action: Ignore\n\
         \x20     onPodConditions: [{{ type: DisruptionTarget }}]\n\
         \x20 template:\n\
         \x20   spec:\n\
         \x20     restartPolicy: Never\n\
         \x20     containers:\n\
         \x20     - name: papsynth\n\
         \x20       image: {image}\n\
         \x20       command: [papsynth]\n\
         \x20       args: {words}\n\
         \x20       resources: {{ requests: {{ cpu: {threads}, memory: 1Gi }} }}\n\
         \x20       # Mount the volume that --out names here.\n\
         \x20       volumeMounts: [{{ name: data, mountPath: /data }}]\n\
         \x20     volumes: [{{ name: data, persistentVolumeClaim: {{ claimName: papsynth }} }}]\n"
    )
}

/// A word that a shell takes as it stands.
fn quoted(word: &str) -> String {
    let plain = |c: char| c.is_ascii_alphanumeric() || "-_./=,:+".contains(c);
    match !word.is_empty() && word.chars().all(plain) {
        true => word.to_owned(),
        false => format!("'{}'", word.replace('\'', r"'\''")),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn words_survive_a_shell() {
        assert_eq!(quoted("cells=3"), "cells=3");
        assert_eq!(quoted("it's { here }"), r"'it'\''s { here }'");
        assert_eq!(quoted(""), "''");
    }
}
