//! Job type for Flamenco: a JavaScript file that the manager compiles to tasks.

use serde_json::json;

use super::job::Job;
use super::script::functions;
use crate::shell::quoted;

/// Script of the job type.
pub(super) fn script(job: &Job) -> String {
    let shell = format!("set -eu\ncd {}\n{}\n\"$@\"\n", quoted(&job.home), functions(job, ""));
    // A string of JSON is one of JavaScript.
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
