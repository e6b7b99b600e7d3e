//! Steps of a job as functions of a POSIX shell. A step may be run again at any time, even while an earlier
//! run of it is active, or after that run was killed.

use super::job::{Frames, Job, Steps};
use super::parts::{Merge, PartSteps};
use super::words::Words;
use crate::shell::quoted;

/// Returns the definitions of the shell functions `prepare`, `part`, `merge` and `task`, to be called in the
/// folder `job.home`. `task N` renders task N, from 0. `extra` is text, such as ` --progress openjd`, that is
/// appended to each `photoncard` command.
pub(super) fn functions(job: &Job, extra: &str) -> String {
    let parts = job.parts;
    let folder = word(&job.folder);
    let of_pictures = match &job.steps {
        Steps::Pictures(words) => words,
        Steps::Parts(steps) => return format!("folder={folder}\n\n{}", of_parts(steps, parts, extra)),
    };
    let prepare = prepare(job, of_pictures, extra);
    match job.frames {
        None => format!(
            "folder={folder}\n\n{prepare}\n{}\n{}\n{}",
            part(job, of_pictures, extra),
            format_args!(
                "merge() {{ photoncard merge \"$folder\"/*of{parts}.part{}{extra}; }}\n",
                words(&of_pictures.merge)
            ),
            "task() { part \"$(($1 + 1))\"; }\n",
        ),
        Some(Frames { first, last }) => format!(
            "folder={folder}\n\n{prepare}\n{}\n{}\n{}",
            part_of_frames(job, of_pictures, extra),
            merge_frames((job, of_pictures), [first, last], extra),
            format_args!("task() {{ part \"$(($1 % {parts} + 1))\" \"$(({first} + $1 / {parts}))\"; }}\n"),
        ),
    }
}

/// Quoted words, each after a blank.
fn words(words: &[String]) -> String {
    words.iter().map(|each| format!(" {}", word(each))).collect()
}

/// Word quoted for a shell. An empty string (`''`) follows each brace, because double braces enclose
/// expressions of Open Job Description.
fn word(word: &str) -> String {
    quoted(word).replace('{', "{''").replace('}', "}''")
}

/// Definitions of the shell functions of a job of parts. `prepare` removes the parts of other inputs.
fn of_parts(steps: &PartSteps, parts: u32, extra: &str) -> String {
    let PartSteps { command, scene, inputs, words: given, of_merge, output, merge } = steps;
    let (scene, inputs, given, output) = (word(scene), words(inputs), words(given), word(output));
    let merge = match merge {
        // Parts in the order of their numbers.
        Merge::Tables => format!(
            "merge() {{
    for part in $(seq {parts}); do cat \"$folder/${{part}}of{parts}.part\"; done >\"$folder/merged\"
    mv \"$folder/merged\" {output}
}}
"
        ),
        Merge::Command { .. } => format!(
            "merge() {{ photoncard {command}{}{extra} --merge \"$folder\"/*of{parts}.part -o {output}; }}\n",
            words(of_merge)
        ),
    };
    format!(
        "prepare() {{
    mkdir -p \"$folder\"
    {{ photoncard scene info --json {scene}; cksum{inputs}; }} >\"$folder/new\"
    if cmp -s \"$folder/new\" \"$folder/inputs\"; then
        rm -f \"$folder/new\"
    else
        find \"$folder\" -name '*.part*' -exec rm -f '{{}}' +
        rm -f \"$folder/joblog\"
        mv \"$folder/new\" \"$folder/inputs\"
    fi
}}

part() {{
    [ -e \"$folder/$1of{parts}.part\" ] ||
        photoncard {command}{given} --part \"$1/{parts}\"{extra} -o \"$folder/$1of{parts}.part\"
}}

{merge}
task() {{ part \"$(($1 + 1))\"; }}
"
    )
}

/// File name of a prepared scene. For frames it has a run of `#`, which the frame's number replaces.
fn card(job: &Job) -> &'static str {
    if job.frames.is_some() { "######.card" } else { "scene.card" }
}

/// Definition of the shell function `prepare`, which prepares the scene in a new folder. If the files there
/// differ from those of an earlier preparation, the new files replace the earlier ones, and the existing
/// parts are removed.
fn prepare(job: &Job, of_pictures: &Words, extra: &str) -> String {
    let Words { scene, prepare, both, .. } = of_pictures;
    let words = [scene, prepare, both].map(|list| words(list)).concat();
    let frames =
        job.frames.map_or(String::new(), |Frames { first, last }| format!(" --frames {first}-{last}"));
    let card = card(job);
    format!(
        "prepare() {{
    rm -rf \"$folder/new\"
    mkdir -p \"$folder/new\"
    photoncard prepare{words}{frames}{extra} -o \"$folder/new/{card}\"
    if diff -r \"$folder/new\" \"$folder/cards\" >/dev/null 2>&1; then
        rm -rf \"$folder/new\"
    else
        find \"$folder\" -name '*.part*' -exec rm -f '{{}}' +
        rm -rf \"$folder/joblog\" \"$folder/cards\"
        mv \"$folder/new\" \"$folder/cards\"
    fi
}}
"
    )
}

fn part(job: &Job, of_pictures: &Words, extra: &str) -> String {
    let part = format!("\"$folder/$1of{}.part\"", job.parts);
    format!(
        "part() {{
    [ -e {part} ] ||
        {} --resume --part \"$1/{}\" -o {part}
}}
",
        render(job, of_pictures, extra),
        job.parts
    )
}

/// Definition of the shell function `part` for a job with frames: `part K N` renders part K of frame N, and
/// `part K A-B` renders part K of each of the frames A to B.
fn part_of_frames(job: &Job, of_pictures: &Words, extra: &str) -> String {
    let parts = job.parts;
    let render = render(job, of_pictures, extra);
    format!(
        "part() {{
    [ \"${{2%-*}}\" != \"${{2#*-}}\" ] || [ ! -e \"$folder/$(printf %06d \"${{2%-*}}\").$1of{parts}.part\" ] || return 0
    {render} --frames \"$2\" --resume --part \"$1/{parts}\" -o \"$folder/######.$1of{parts}.part\"
}}
"
    )
}

/// Start of the command that renders a part, without the part's number, its frames and its output.
fn render(job: &Job, of_pictures: &Words, extra: &str) -> String {
    let words = [&of_pictures.both, &of_pictures.render].map(|list| words(list)).concat();
    format!("photoncard render --prepared \"$folder/cards/{}\"{words}{extra}", card(job))
}

fn merge_frames((job, of_pictures): (&Job, &Words), [first, last]: [u32; 2], extra: &str) -> String {
    let outputs: String = of_pictures.merge.iter().map(|word| format!(" {}", numbered(word))).collect();
    format!(
        "merge() {{
    frame={first}
    while [ \"$frame\" -le {last} ]; do
        photoncard merge \"$folder/$(printf %06d \"$frame\")\".*of{}.part{outputs}{extra}
        frame=$((frame + 1))
    done
}}
",
        job.parts
    )
}

/// Quoted word in which the frame's number replaces the last run of `#`.
fn numbered(text: &str) -> String {
    let Some((before, after)) = text.rsplit_once('#') else { return word(text) };
    let kept = before.trim_end_matches('#');
    let width = before.len() - kept.len() + 1;
    format!("{}\"$(printf %0{width}d \"$frame\")\"{}", word(kept), word(after))
}
