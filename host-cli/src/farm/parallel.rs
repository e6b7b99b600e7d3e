//! Job for GNU parallel: a script that calls itself for each task.

use super::job::Job;
use super::script::functions;
use crate::shell::quoted;

/// Script of the job.
pub(super) fn script(job: &Job) -> String {
    let (home, last) = (quoted(&job.home), job.tasks() - 1);
    let functions = functions(job, "");
    format!(
        r#"#!/bin/sh
# Renders {name} by GNU parallel, $JOBS tasks at once (1 if it is not set). Another run of the script goes on with what is done.
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

/// Converts text to one line, for a comment.
pub(super) fn comment(text: &str) -> String {
    text.chars().map(|c| if c.is_control() { '?' } else { c }).collect()
}
