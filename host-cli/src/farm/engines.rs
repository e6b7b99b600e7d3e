//! Jobs for GNU parallel, Flamenco and Slurm.

use serde_json::json;

use super::job::Job;
use super::script::functions;
use crate::shell::quoted;

/// Returns a shell script that runs itself by GNU parallel, once for each task.
pub(super) fn parallel(job: &Job) -> String {
    let (home, last) = (quoted(&job.home), job.tasks() - 1);
    let functions = functions(job, "");
    format!(
        r#"#!/bin/sh
# Runs the job {name} by GNU parallel, $JOBS tasks at once (1 if it is not set). Another run of the script goes on with what is done.
set -eu
job=$(realpath "$0")
export job
cd {home}
{functions}
case "${{1:-all}}" in
task) task "$2" ;;
all)
    prepare
    seq 0 {last} | parallel --joblog "$folder/joblog" --resume-failed --retries 3 --jobs "${{JOBS:-1}}" 'sh "$job" task {{}}'
    merge
    ;;
esac
"#,
        name = comment(&job.name),
    )
}

/// Returns `text` as one line for a comment: control characters, such as line ends, become `?`.
fn comment(text: &str) -> String {
    text.chars().map(|c| if c.is_control() { '?' } else { c }).collect()
}

/// Job type for Flamenco: a JavaScript file that the manager compiles to tasks.
pub(super) fn flamenco(job: &Job) -> String {
    let shell = format!("set -eu\ncd {}\n{}\n\"$@\"\n", quoted(&job.home), functions(job, ""));
    // A JSON string literal is also a JavaScript string literal.
    let (label, shell) = (json!(format!("photoncard {}", job.name)), json!(shell));
    format!(
        r#"// A job type of Flamenco that renders one job: save it in the manager's folder of scripts, and submit a job of this type.
const JOB_TYPE = {{ label: {label}, settings: [] }};

// The job's steps, as functions of a shell: the first word behind names one.
const STEPS = {shell};

function step(name, type, words) {{
    const task = author.Task(name, type);
    task.addCommand(author.Command("exec", {{ exe: "sh", args: ["-c", STEPS, "job"].concat(words) }}));
    return task;
}}

function compileJob(job) {{
    const prepare = step("prepare", "misc", ["prepare"]);
    const merge = step("merge", "misc", ["merge"]);
    job.addTask(prepare);
    for (let number = 0; number < {tasks}; number++) {{
        const task = step("render-" + number, "misc", ["task", String(number)]);
        task.addDependency(prepare);
        merge.addDependency(task);
        job.addTask(task);
    }}
    job.addTask(merge);
}}
"#,
        tasks = job.tasks(),
    )
}

/// Maximum number of tasks in a job array, one less than Slurm's default `MaxArraySize` of 1001.
const MAX_ARRAY: u64 = 1000;

/// Returns a shell script that submits itself to Slurm as three jobs (preparation, array of tasks, merge),
/// each dependent on the one before.
pub(super) fn slurm(job: &Job) -> String {
    let (home, tasks) = (quoted(&job.home), job.tasks());
    let functions = functions(job, "");
    let step = tasks.min(MAX_ARRAY);
    format!(
        r#"#!/bin/sh
#SBATCH --requeue
#SBATCH --open-mode=append
# Runs the job {name} by Slurm: `sh SCRIPT` submits it, with further options of sbatch behind. A task that fails or is killed is queued
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
