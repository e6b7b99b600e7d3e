//! Job template of Open Job Description, version 2023-09.

use serde_json::{Value, json};

use super::job::{Frames, Job};
use super::script::functions;

/// Job template as JSON.
pub(super) fn template(job: &Job) -> String {
    let template = json!({
        "specificationVersion": "jobtemplate-2023-09",
        "extensions": ["TASK_CHUNKING"],
        "name": name(job),
        "description": "photoncard: save this template in the folder that the paths of the job begin in, or state Home.",
        "parameterDefinitions": [{
            "name": "Home",
            "description": "Folder in which the paths of the job begin",
            "type": "PATH",
            "objectType": "DIRECTORY",
            "dataFlow": "INOUT",
            "default": ".",
        }],
        // The path reaches the script as an environment variable: no character of it is read as shell syntax.
        "jobEnvironments": [{"name": "Home", "variables": {"PHOTONCARD_HOME": "{{Param.Home}}"}}],
        "steps": [step(job, "prepare", &[]), render(job), after(step(job, "merge", &[]), "render")],
    });
    format!("{template:#}\n")
}

/// Name of the job as the specification allows: at most 128 characters, without control characters and
/// without braces, which enclose expressions.
fn name(job: &Job) -> String {
    let name: String = job.name.chars().filter(|c| !c.is_control() && !"{}".contains(*c)).take(100).collect();
    format!("photoncard {name}")
}

/// Step that renders all parts. A task's chunk is a range of consecutive frames or, without frames, of
/// consecutive parts. With frames, one `photoncard` process renders one part of each frame in the chunk.
/// Without frames, one process after another renders a part of the chunk.
fn render(job: &Job) -> Value {
    let chunks = json!({"defaultTaskCount": 1, "rangeConstraint": "CONTIGUOUS"});
    let parts = format!("1-{}", job.parts);
    let (parameters, arguments) = match job.frames {
        None => (
            json!([{"name": "Part", "type": "CHUNK[INT]", "range": parts, "chunks": chunks}]),
            ["{{Task.Param.Part}}", ""],
        ),
        Some(Frames { first, last }) => (
            json!([
                {"name": "Frame", "type": "CHUNK[INT]", "range": format!("{first}-{last}"), "chunks": chunks},
                {"name": "Part", "type": "INT", "range": parts},
            ]),
            ["{{Task.Param.Part}}", "{{Task.Param.Frame}}"],
        ),
    };
    let mut step = after(step(job, "render", &arguments), "prepare");
    step["parameterSpace"] = json!({"taskParameterDefinitions": parameters});
    step
}

/// Step `name`, which runs the job's script with the arguments `name` and `arguments`.
fn step(job: &Job, name: &str, arguments: &[&str]) -> Value {
    let words = ["{{Task.File.Job}}", name].into_iter().chain(arguments.iter().copied());
    json!({
        "name": name,
        "script": {
            "actions": {"onRun": {"command": "sh", "args": words.collect::<Vec<_>>()}},
            "embeddedFiles": [{"name": "Job", "type": "TEXT", "filename": "job.sh", "data": script(job)}],
        },
    })
}

fn after(mut step: Value, other: &str) -> Value {
    step["dependencies"] = json!([{"dependsOn": other}]);
    step
}

fn script(job: &Job) -> String {
    format!(
        r#"#!/bin/sh
set -eu
cd "$PHOTONCARD_HOME"
{}
# Works on the parts A-B, of the frames C-D if there are any.
render() {{
    number=${{1%%-*}}
    while [ "$number" -le "${{1##*-}}" ]; do
        part "$number" "$2"
        number=$((number + 1))
    done
}}

"$@"
"#,
        functions(job, " --progress openjd")
    )
}
