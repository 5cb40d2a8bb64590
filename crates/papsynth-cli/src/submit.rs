//! `papsynth submit`: a script that generates a data set on a cluster.

use std::path::Path;

use crate::args::{self, Cli, Generate, Submit, Verb};
use crate::exit::{self, ExitError};
use crate::setup::Setup;
use crate::words::counted;

pub(crate) fn run(args: &Submit) -> Result<(), ExitError> {
    // Reports errors of the tasks before they run.
    let words = ["papsynth", "generate"].into_iter().chain(args.arguments.iter().map(String::as_str));
    let generate = match args::parse(words.map(Into::into)) {
        Ok(Cli { verb: Verb::Generate(generate) }) => generate,
        Ok(_) => return Err(ExitError::input("after `--`: expected only arguments of `papsynth generate`")),
        Err(error) => {
            let text = error.to_string();
            return Err(ExitError::input(text.strip_prefix("error: ").unwrap_or(&text).trim_end()));
        }
    };
    if generate.task.task.is_some() || generate.engine.threads.is_some() {
        return Err(ExitError::with_help(
            "the script sets --task and --threads",
            "remove them after `--`; give --tasks and --threads before `--`",
        ));
    }
    check_here(&generate)?;
    let frames = generate.indices().end;
    let (layout, _) = generate.layout.layout(frames);
    if let Some(message) = layout.refusal() {
        return Err(ExitError::input(message));
    }
    let shards = frames.div_ceil(layout.frames_per_shard);
    if args.tasks > shards {
        return Err(ExitError::with_help(
            format!("--tasks {}: there are only {}", args.tasks, counted(shards, "shard", "shards")),
            "give fewer tasks, or fewer frames per shard with --frames-per-shard",
        ));
    }
    let script = match args.scheduler.as_str() {
        "slurm" => slurm(args),
        _ => {
            let out = &generate.out;
            if !out.starts_with("/data") && !papsynth_dataset::Location::is_address(out) {
                exit::note(format!(
                    "{} is inside the pod and is deleted with it; write below /data, where the volume is mounted, or to an \
                     object store",
                    out.display()
                ));
            }
            kubernetes(args)
        }
    };
    exit::print(&script)
}

/// Checks the recipe, if it is on this machine.
fn check_here(generate: &Generate) -> Result<(), ExitError> {
    match &generate.engine.recipe.recipe {
        Some(path) if !path.exists() => {
            if path == Path::new("generate") {
                return Err(ExitError::with_help(
                    "`generate` after `--` means a recipe file of this name",
                    "give only the arguments of `papsynth generate`",
                ));
            }
            exit::note(format!("{} is not on this machine; it must exist where the tasks run", path.display()));
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
         # A killed or requeued task continues. Tasks with exit code 74 (input/output) are run again.\n\
         papsynth generate {arguments} --threads {threads} --task auto/{tasks}\n\
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
    let own = ["--threads".to_owned(), threads.to_string(), "--task".to_owned(), format!("auto/{tasks}")];
    let words = std::iter::once(&"generate".to_owned()).chain(&args.arguments).chain(&own).cloned().collect::<Vec<_>>();
    // Kubernetes replaces `$(NAME)` by an environment variable.
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
         \x20   # Usage, recipe or input: the task would fail again.\n\
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

/// A word, quoted for a shell.
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
    fn words_are_quoted_for_a_shell() {
        assert_eq!(quoted("cells=3"), "cells=3");
        assert_eq!(quoted("it's { here }"), r"'it'\''s { here }'");
        assert_eq!(quoted(""), "''");
    }
}
