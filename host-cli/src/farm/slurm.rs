//! Job for Slurm: a script that submits itself in three steps, each after the previous one.

use super::job::Job;
use super::parallel::comment;
use super::script::functions;
use crate::shell::quoted;

/// Maximum number of tasks in an array, one less than Slurm's default limit.
const MAX_ARRAY: u64 = 1000;

/// Script of the job.
pub(super) fn script(job: &Job) -> String {
    let (home, tasks) = (quoted(&job.home), job.tasks());
    let functions = functions(job, "");
    let step = tasks.min(MAX_ARRAY);
    format!(
        r#"#!/bin/sh
#SBATCH --requeue
#SBATCH --open-mode=append
# Renders {name} by Slurm: `sh SCRIPT` submits it, with further options of sbatch behind. A task that fails or is killed is queued
# again, and goes on with what is done.
set -eu
job=$(realpath "$0")
cd {home}
{functions}
# Submits a step; prints its number.
submit() {{
    step=$1
    shift
    sbatch --parsable --job-name={job_name}-"$step" --output={logs}/"$step"-%j.log --kill-on-invalid-dep=yes "$@" "$job" "$step"
}}

# Queues a task again that has failed, three times at most.
again() {{
    [ "${{SLURM_RESTART_COUNT:-0}}" -ge 3 ] || scontrol requeue "$SLURM_JOB_ID"
    exit 1
}}

case "${{1:-submit}}" in
prepare) prepare ;;
tasks)
    number=$SLURM_ARRAY_TASK_ID
    while [ "$number" -lt {tasks} ]; do
        task "$number" || again
        number=$((number + {step}))
    done
    ;;
merge) merge ;;
*)
    mkdir -p "$folder"
    [ "${{1:-}}" != submit ] || shift
    first=$(submit prepare "$@")
    second=$(submit tasks --array=0-{last} --dependency="afterok:$first" "$@")
    submit merge --dependency="afterok:$second" "$@"
    ;;
esac
"#,
        name = comment(&job.name),
        job_name = quoted(&job.name),
        logs = quoted(&job.folder.replace('%', "%%")),
        last = step - 1,
    )
}
