//! Tests that run farm jobs, some without their engines. The picture of a job must equal that of a single
//! render, byte for byte.
#![cfg(unix)]

use std::process::Command;

use crate::support::{Outcome, Room, shipped, skip};
use serde_json::Value;

/// Folder name that shells and farm engines misread unless it is quoted.
const FOLDER: &str = "it's a {{Param.x}} $HOME";
const SCENE: &str = "a {1} \"b\" {}.gltf";
const PICTURE: &str = "o{{}}ut `id`.exr";

/// Options of a small picture. With the last two, no setting is left for a pilot render to choose.
const OPTIONS: [&str; 17] = [
    "--quality",
    "draft",
    "--size",
    "40x24",
    "--photons",
    "900",
    "--gather-rays",
    "6",
    "--spp",
    "2",
    "--card",
    "emulated:1",
    "--set",
    "white.diffuse=0.3,0.4,0.5",
    "--irradiance-cache=on",
    "--shadow-rays=1",
    "--ic-error=0.1",
];

/// Returns a temporary folder with the scene in its subfolder [`FOLDER`], and the EXR that a single render
/// writes.
fn room() -> (Room, Vec<u8>) {
    let room = Room::new();
    std::fs::create_dir(room.path(FOLDER)).unwrap();
    std::fs::copy(shipped("cornell.gltf"), room.path(FOLDER).join(SCENE)).unwrap();
    let whole = run(&room, &[&["render", SCENE, "-o", "whole.exr"], &OPTIONS[..]].concat());
    assert_eq!(whole.status, Some(0), "{}", whole.stderr);
    let whole = room.path(FOLDER).join("whole.exr");
    (room, std::fs::read(whole).unwrap())
}

/// Runs the command in [`FOLDER`].
fn run(room: &Room, arguments: &[&str]) -> Outcome {
    Outcome::of(&room.command().current_dir(room.path(FOLDER)).args(arguments).output().unwrap())
}

/// Text that `photoncard farm` prints for an engine, for a picture with half-precision samples.
fn job(room: &Room, engine: &str) -> String {
    job_with(room, engine, &["--sample-type", "half"])
}

fn job_with(room: &Room, engine: &str, options: &[&str]) -> String {
    let own = ["farm", engine, SCENE, "--parts", "3", "-o", PICTURE, "-o", "out.png"];
    let outcome = run(room, &[&own[..], options, &OPTIONS].concat());
    assert_eq!((outcome.status, &*outcome.stderr), (Some(0), ""));
    outcome.stdout
}

/// Command `program`, in whose `PATH` `photoncard` is found.
fn in_path(program: &str) -> Command {
    let own = std::path::Path::new(env!("CARGO_BIN_EXE_photoncard")).parent().unwrap();
    let path = format!("{}:{}", own.display(), std::env::var("PATH").unwrap());
    let mut command = Command::new(program);
    command.env("PATH", path);
    command
}

fn is_there(program: &str, test: &str) -> bool {
    Command::new(program).arg(test).output().is_ok_and(|output| output.status.success())
}

/// Runs a job's script, whose own file name needs quoting as well.
fn run_script(room: &Room, script: &str, arguments: &[&str]) {
    let path = room.path("the {2} job's.sh");
    std::fs::write(&path, script).unwrap();
    let outcome = Outcome::of(&in_path("sh").arg(&path).args(arguments).output().unwrap());
    assert_eq!(outcome.status, Some(0), "{script}\n{}\n{}", outcome.stdout, outcome.stderr);
}

/// Checks that a finished job's EXR and PNG have the bytes of a single render's.
fn check_pictures(room: &Room) {
    let own = ["render", SCENE, "-o", "half.exr", "-o", "whole.png", "--sample-type", "half"];
    let outcome = run(room, &[&own[..], &OPTIONS].concat());
    assert_eq!(outcome.status, Some(0), "{}", outcome.stderr);
    let read = |name: &str| std::fs::read(room.path(FOLDER).join(name)).unwrap();
    assert!(read(PICTURE) == read("half.exr"));
    assert!(read("out.png") == read("whole.png"));
}

/// Runs all tasks of a script one after another, without an engine.
fn by_hand(room: &Room, script: &str) {
    let seq = script.lines().find(|line| line.contains("| parallel ")).unwrap();
    let tasks = seq.split('|').next().unwrap().trim();
    run_script(
        room,
        &script.replace(seq, &format!("for task in $({tasks}); do sh \"$job\" task \"$task\"; done")),
        &[],
    );
}

#[test]
fn the_script_of_gnu_parallel_renders_the_picture() {
    let (room, _) = room();
    let script = job(&room, "parallel");
    if is_there("parallel", "--version") {
        run_script(&room, &script, &[]);
    } else {
        skip("GNU parallel is missing, and a loop does its work");
        by_hand(&room, &script);
    }
    check_pictures(&room);
}

#[test]
fn the_last_step_of_a_job_denoises_the_picture() {
    let (room, _) = room();
    if !crate::denoise::is_there(&room) {
        return;
    }
    by_hand(&room, &job_with(&room, "parallel", &["--denoise"]));
    let own = ["render", SCENE, "-o", "whole.exr", "-o", "whole.png", "--denoise"];
    let outcome = run(&room, &[&own[..], &OPTIONS].concat());
    assert_eq!(outcome.status, Some(0), "{}", outcome.stderr);
    let read = |name: &str| std::fs::read(room.path(FOLDER).join(name)).unwrap();
    assert!(read(PICTURE) == read("whole.exr") && read("out.png") == read("whole.png"));
}

/// Parts may be missing or begun, and the scene may have changed, when a job is run again.
#[test]
fn a_repeated_job_continues_or_starts_again() {
    let (room, whole) = room();
    let folder = room.path(FOLDER);
    let script = job(&room, "parallel").replace(" --sample-type half", "");
    by_hand(&room, &script);
    let picture = || std::fs::read(folder.join(PICTURE)).unwrap();
    assert!(picture() == whole);
    let farm = std::fs::read_dir(&folder).unwrap().map(|entry| entry.unwrap().path());
    let farm = farm.into_iter().find(|path| path.extension().is_some_and(|ending| ending == "farm")).unwrap();
    // One part is missing, and only its partial file is left.
    std::fs::remove_file(farm.join("2of3.part")).unwrap();
    std::fs::write(farm.join("2of3.part.partial"), b"photoncard partial ren").unwrap();
    std::fs::remove_file(folder.join(PICTURE)).unwrap();
    by_hand(&room, &script);
    assert!(picture() == whole);
    // Parts of another scene with the same file name are not merged.
    std::fs::copy(shipped("cornell-uplight.gltf"), folder.join(SCENE)).unwrap();
    by_hand(&room, &script);
    let outcome = run(&room, &[&["render", SCENE, "-o", "other.exr"], &OPTIONS[..]].concat());
    assert_eq!(outcome.status, Some(0), "{}", outcome.stderr);
    assert!(picture() == std::fs::read(folder.join("other.exr")).unwrap() && picture() != whole);
}

/// Runs the steps of the job in order, by the command that Slurm would run for each.
#[test]
fn the_script_of_slurm_submits_steps_that_render_the_picture() {
    let (room, _) = room();
    let script = job(&room, "slurm");
    // In place of `sbatch`, a function writes down what is submitted.
    let stand_in = "sbatch() { printf '%s\\n' \"$*\" >>submitted; wc -l <submitted | tr -d ' '; }\n";
    run_script(
        &room,
        &script.replacen("set -eu\n", &format!("set -eu\n{stand_in}"), 1),
        &["--partition=farm"],
    );
    let submitted = std::fs::read_to_string(room.path(FOLDER).join("submitted")).unwrap();
    let lines: Vec<&str> = submitted.lines().collect();
    assert_eq!(lines.len(), 3, "{submitted}");
    for (line, words) in lines.iter().zip([
        ["prepare", "--partition=farm"],
        ["tasks", "--array=0-2 --dependency=afterok:1"],
        ["merge", "--dependency=afterok:2"],
    ]) {
        assert!(words.iter().all(|word| line.contains(word)), "{line}");
    }
    run_script(&room, &script, &["prepare"]);
    for task in ["0", "1", "2", "1"] {
        run_script(&room, &format!("export SLURM_ARRAY_TASK_ID={task}\n{script}"), &["tasks"]);
    }
    run_script(&room, &script, &["merge"]);
    check_pictures(&room);
}

/// Runs the template by the command `openjd`, which `tests/ci.sh` installs.
#[test]
fn the_template_of_open_job_description_renders_the_picture() {
    let (room, _) = room();
    let template = job(&room, "openjd");
    let parsed: Value = serde_json::from_str(&template).unwrap();
    assert_eq!(parsed["specificationVersion"], "jobtemplate-2023-09");
    assert_eq!(parsed["steps"][1]["dependencies"][0]["dependsOn"], "prepare");
    let parameters = &parsed["steps"][1]["parameterSpace"]["taskParameterDefinitions"];
    assert_eq!((&parameters[0]["type"], &parameters[0]["range"]), (&"CHUNK[INT]".into(), &"1-3".into()));
    let openjd = std::env::var("PHOTONCARD_OPENJD").unwrap_or("openjd".to_owned());
    if !is_there(&openjd, "--version") {
        skip("openjd is missing (pip install openjd-cli), and the template is not run");
        return;
    }
    let path = room.path(FOLDER).join("job.json");
    std::fs::write(&path, template).unwrap();
    let output = in_path(&openjd).arg("run").arg(&path).output().unwrap();
    let said =
        String::from_utf8_lossy(&output.stdout).into_owned() + &String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{said}");
    assert!(said.contains("openjd_progress: 100"), "{said}");
    check_pictures(&room);
}

/// Compiles the job type without Flamenco's manager, and runs the tasks' commands in an order that their
/// dependencies allow.
#[test]
fn the_job_type_of_flamenco_renders_the_picture() {
    let (room, _) = room();
    let script = job(&room, "flamenco");
    if !is_there("node", "--version") {
        skip("node is missing, and the job type is not run");
        return;
    }
    let manager = r#"
        const { execFileSync } = require("child_process");
        const author = {
            Task: (name, type) => ({ commands: [], before: [],
                addCommand(command) { this.commands.push(command); },
                addDependency(task) { this.before.push(task); } }),
            Command: (name, settings) => ({ name, settings }),
        };
        const tasks = [];
        compileJob({ settings: {}, addTask: (task) => tasks.push(task) });
        const done = new Set();
        const run = (task) => {
            if (done.has(task)) return;
            done.add(task);
            task.before.forEach(run);
            for (const { name, settings } of task.commands) {
                if (name !== "exec") throw new Error(name);
                execFileSync(settings.exe, settings.args);
            }
        };
        if (tasks.length !== 5) throw new Error("tasks: " + tasks.length);
        tasks.reverse().forEach(run);
    "#;
    room.write("job.js", script + manager);
    let outcome = Outcome::of(&in_path("node").arg(room.path("job.js")).output().unwrap());
    assert_eq!(outcome.status, Some(0), "{}", outcome.stderr);
    check_pictures(&room);
}

/// Points are measured in parts, of which one is repeated, and all when the points change.
#[test]
fn a_job_of_a_measurement_makes_its_table() {
    let room = Room::new();
    let folder = room.path(FOLDER);
    std::fs::create_dir(&folder).unwrap();
    std::fs::copy(shipped("cornell.gltf"), folder.join(SCENE)).unwrap();
    let points = "p {} 'x'.txt";
    let write = |height: f64| {
        let line = |index: u32| format!("0.1 {} {} 0 1 0\n", height, f64::from(index) * 0.05 - 0.2);
        std::fs::write(folder.join(points), (0..7).map(line).collect::<String>()).unwrap();
    };
    let own = ["measure", SCENE, "--points", points, "--photons", "900", "--spp", "2", "--quiet"];
    let whole = || {
        let outcome = run(&room, &[&own[..], &["-o", "whole.csv"]].concat());
        assert_eq!(outcome.status, Some(0), "{}", outcome.stderr);
        std::fs::read(folder.join("whole.csv")).unwrap()
    };
    write(-0.5);
    let of_farm = ["-o", "{{out}}.csv", "--farm", "parallel", "--parts", "3"];
    let job = run(&room, &[&own[..], &of_farm].concat());
    assert_eq!((job.status, &*job.stderr), (Some(0), ""));
    let table = || std::fs::read(folder.join("{{out}}.csv")).unwrap();
    by_hand(&room, &job.stdout);
    assert_eq!(table(), whole());
    write(0.2);
    by_hand(&room, &job.stdout);
    assert_eq!(table(), whole());
    for (options, words) in [
        (&["-o", "-", "--farm", "slurm"][..], "writes its table to a file"),
        (&["-o", "a.csv", "--farm", "slurm", "--progress", "openjd"], "--progress is not for a farm's job"),
        (&["-o", "a.csv", "--farm", "slurm", "--part", "1/2"], "cannot be used with"),
        (&["-o", "a.csv", "--parts", "3"], "--farm"),
    ] {
        let outcome = run(&room, &[&own[..], options].concat());
        assert_eq!(outcome.status, Some(2), "{options:?}");
        assert!(outcome.stderr.contains(words), "{}", outcome.stderr);
    }
}

/// Lightmaps are baked in parts; files of the pages are written by the last step.
#[test]
fn a_job_of_a_bake_makes_its_glb() {
    let room = Room::new();
    let folder = room.path(FOLDER);
    std::fs::create_dir(&folder).unwrap();
    std::fs::copy(shipped("cornell.gltf"), folder.join(SCENE)).unwrap();
    let own =
        ["bake", SCENE, "--texels-per-metre", "4", "--photons", "900", "--spp", "1", "--exr", "--quiet"];
    let whole = run(&room, &[&own[..], &["-o", "whole.glb"]].concat());
    assert_eq!(whole.status, Some(0), "{}", whole.stderr);
    let of_farm = ["-o", "out {}.glb", "--farm", "parallel", "--parts", "3"];
    let job = run(&room, &[&own[..], &of_farm].concat());
    assert_eq!((job.status, &*job.stderr), (Some(0), ""));
    by_hand(&room, &job.stdout);
    let read = |name: &str| std::fs::read(folder.join(name)).unwrap();
    assert!(read("out {}.glb") == read("whole.glb"));
    assert!(read("out {}.0.exr") == read("whole.0.exr"));
}

#[test]
fn progress_and_failure_are_lines_of_open_job_description() {
    let (room, _) = room();
    let own = ["render", SCENE, "-o", "a.exr", "--progress", "openjd"];
    let outcome = run(&room, &[&own[..], &OPTIONS].concat());
    assert_eq!(outcome.status, Some(0), "{}", outcome.stderr);
    let percents: Vec<u32> = outcome
        .stdout
        .lines()
        .map(|line| line.strip_prefix("openjd_progress: ").and_then(|number| number.parse().ok()).unwrap())
        .collect();
    assert!(percents.is_sorted() && percents.last() == Some(&100), "{percents:?}");
    let outcome = run(&room, &["render", "absent\n.gltf", "-o", "a.exr", "--progress", "openjd"]);
    assert_eq!(outcome.status, Some(2));
    let (line, rest) = outcome.stdout.split_once('\n').unwrap();
    assert!(line.starts_with("openjd_fail: cannot read absent\\n.gltf: ") && rest.is_empty(), "{line}");
    let outcome = run(&room, &["merge", "absent.part", "-o", "a.exr", "--progress", "openjd"]);
    assert!(outcome.stdout.starts_with("openjd_fail: cannot read absent.part"), "{}", outcome.stdout);
}

#[test]
fn frames_of_a_job_equal_those_of_one_render() {
    let (room, _) = room();
    std::fs::copy(shipped("cornell-moving.glb"), room.path(FOLDER).join(SCENE)).unwrap();
    // Both the single render and the job run a pilot, as no option states its results.
    let options = &OPTIONS[..OPTIONS.len() - 2];
    let frames = [&["--frames", "8-10", "--fps", "12"], options].concat();
    let whole = run(&room, &[&["render", SCENE, "-o", "whole.##.exr"], &frames[..]].concat());
    assert_eq!(whole.status, Some(0), "{}", whole.stderr);
    let own = ["farm", "parallel", SCENE, "--parts", "2", "-o", "it's out.##.exr"];
    let script = run(&room, &[&own[..], &frames].concat()).stdout;
    by_hand(&room, &script);
    for frame in ["08", "09", "10"] {
        let read = |name: &str| std::fs::read(room.path(FOLDER).join(format!("{name}.{frame}.exr"))).unwrap();
        assert!(read("it's out") == read("whole"), "{frame}");
    }
}

/// A task renders a part of one frame; each frame's parts are merged by a command of their own.
#[test]
fn each_frame_is_a_task() {
    let room = Room::new();
    let own =
        ["farm", "slurm", "a.gltf", "--frames", "9-11", "--parts", "4", "-o", "d/p##.##.exr", "--seed", "3"];
    let script = room.run(&own).stdout;
    let stand_in = "photoncard() { printf '%s\\n' \"$*\" >>said; }\n";
    let script = script.replacen("set -eu\n", &format!("set -eu\n{stand_in}"), 1);
    room.write("job.sh", &script);
    let step = |step: &str, task: &str| {
        let mut command = Command::new("sh");
        command.arg(room.path("job.sh")).arg(step).env("SLURM_ARRAY_TASK_ID", task);
        assert!(command.status().unwrap().success(), "{script}");
    };
    step("tasks", "6");
    step("merge", "");
    let prepare = script.replacen(
        "set -eu\n",
        "set -eu\ndiff() { false; }\nmv() { printf 'mv %s\\n' \"$*\" >>said; }\n",
        1,
    );
    room.write("job.sh", &prepare);
    step("prepare", "");
    let said = String::from_utf8(room.read("said")).unwrap();
    let lines: Vec<&str> = said.lines().collect();
    assert!(lines[0].contains("/cards/######.card --frames 10 --resume --part 3/4 -o d/p."), "{said}");
    assert!(lines[1].contains("/000009.") && lines[1].ends_with("of4.part -o d/p##.09.exr"), "{said}");
    assert!(lines[4].starts_with("prepare a.gltf --seed 3 --frames 9-11 -o d/p."), "{said}");
    assert!(lines[4].ends_with("/new/######.card"), "{said}");
    assert_eq!(lines.len(), 6, "{said}");
    assert!(script.contains("--array=0-11"), "{script}");
}

#[test]
fn options_that_no_job_can_have_are_refused() {
    let room = Room::new();
    for (options, words) in [
        (&["-o", "a.exr", "--stats", "-"][..], ["--stats is not for a farm's job", "help: leave it out"]),
        (&["-o", "a.exr", "--counters"], ["--counters is not for a farm's job", "help: leave it out"]),
        (&["-o", "a.exr", "--part", "1/2"], ["--part is not for a farm's job", "help: leave it out"]),
        (&["-o", "a.part"], ["parts of its own", "help: give -o"]),
        (&["-o", "a.exr", "--frames", "1-2"], ["no place for the number of a frame", "out.####.exr"]),
        (&["-o", "a.####.exr", "--frames", "1,3"], ["follow each other", "--frames A-B"]),
        (&["-o", "a.exr", "--parts", "0"], ["--parts", "65536"]),
    ] {
        let outcome = room.run(&[&["farm", "parallel", "a.gltf"], options].concat());
        assert_eq!((outcome.status, &*outcome.stdout), (Some(2), ""), "{options:?}: {}", outcome.stderr);
        let said = outcome.stderr.to_lowercase();
        assert!(
            words.iter().all(|word| said.contains(&word.to_lowercase())),
            "{options:?}: {}",
            outcome.stderr
        );
    }
}
