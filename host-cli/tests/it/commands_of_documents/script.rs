//! Shell commands in documents: they are run, or checked without being run.

use std::net::TcpListener;
use std::os::unix::fs::symlink;
use std::process::{Command, Stdio};

use super::command_tree::CommandTree;
use super::repository;
use crate::support::{Outcome, Room};

const PRELUDE: &str = include_str!("prelude.sh");

/// Programs outside this project that commands of documents may run.
const FOREIGN: [&str; 4] = ["cmp", "mkdir", "export", "python"];

/// Runs a script in an empty folder with links to `scenes` and `tests`. Returns its messages if it fails.
pub(crate) fn run(text: &str) -> Result<(), String> {
    let room = Room::new();
    for folder in ["scenes", "tests"] {
        symlink(repository::path(folder), room.path(folder)).unwrap();
    }
    let script = format!("{PRELUDE}\n{}", with_free_ports(text));
    let mut command = Command::new("timeout");
    command.args(["--kill-after=5", "120", "bash", "-euo", "pipefail", "-c", &script]);
    command.current_dir(room.path("")).env("HOME", room.path("")).stdin(Stdio::null());
    command.env("PHOTONCARD", env!("CARGO_BIN_EXE_photoncard"));
    let outcome = Outcome::of(&command.output().unwrap());
    let said = || format!("status {:?}: {}{}", outcome.status, outcome.stdout, outcome.stderr);
    if outcome.status == Some(0) { Ok(()) } else { Err(said()) }
}

/// Replaces each port behind `--listen tcp:` by a free one, wherever it occurs in the text.
fn with_free_ports(text: &str) -> String {
    let stated = text.split("--listen tcp:").skip(1).map(|rest| rest.split_whitespace().next().unwrap());
    stated.fold(text.to_owned(), |text, port| {
        let free = TcpListener::bind("127.0.0.1:0").unwrap().local_addr().unwrap().port();
        text.replace(&format!(":{port}"), &format!(":{free}"))
    })
}

/// Words of each simple command of a script, without quotes, redirections and variable assignments.
fn commands(script: &str) -> Vec<Vec<&str>> {
    let lines = script.lines().filter(|line| !line.trim_start().starts_with('#'));
    let parts = lines.flat_map(|line| line.split("&&").flat_map(|part| part.split([';', '|', '&'])));
    let words = parts.map(|part| {
        let words = part.split('>').next().unwrap_or_default().split_whitespace();
        let words = words.skip_while(|word| word.contains('=') && !word.starts_with('-'));
        words.map(|word| word.trim_matches(['"', '\''])).collect::<Vec<_>>()
    });
    words.filter(|words| !words.is_empty()).collect()
}

/// Defects of a script's commands, which are not run.
pub(crate) fn defects(tree: &CommandTree, text: &str) -> Vec<String> {
    let text = text.replace("\\\n", " ");
    commands(&text).into_iter().flat_map(|words| defects_of_command(tree, &words)).collect()
}

fn defects_of_command(tree: &CommandTree, words: &[&str]) -> Vec<String> {
    let (program, arguments) = (words[0], &words[1..]);
    let mut defects: Vec<String> =
        arguments.iter().filter_map(|word| repository::defect_of_path(word)).collect();
    match program.rsplit('/').next().unwrap_or(program) {
        "photoncard" => defects.extend(tree.defect_of_arguments(arguments)),
        // GNU parallel calls a command with each word after `:::`.
        "parallel" => {
            let mut parts = arguments.split(|&argument| argument == ":::");
            let command = parts.next().unwrap_or_default();
            let word = parts.next().and_then(<[_]>::first).unwrap_or(&"{}");
            let words: Vec<_> = command.iter().map(|argument| argument.replace("{}", word)).collect();
            let words: Vec<_> = words.iter().map(String::as_str).collect();
            if !words.is_empty() {
                defects.extend(defects_of_command(tree, &words));
            }
        }
        "cargo" => {
            defects.extend(repository::defects_of_cargo(arguments));
            let mut parts = arguments.split(|&argument| argument == "--");
            let is_program = parts
                .next()
                .is_some_and(|own| own.starts_with(&["run"]) && own.ends_with(&["-p", "photoncard"]));
            if let Some(arguments) = parts.next().filter(|_| is_program) {
                defects.extend(tree.defect_of_arguments(arguments));
            }
        }
        _ if program.contains('/') => defects.extend(repository::defect_of_script(program)),
        _ if FOREIGN.contains(&program) => {}
        _ => defects.push(format!("{program} is no program that documents call")),
    }
    defects
}

/// Defects of inline code, which may contain placeholders.
pub(crate) fn defects_of_inline_code(tree: &CommandTree, text: &str) -> Vec<String> {
    let words: Vec<_> = text.split_whitespace().collect();
    let mut defects = match words[..] {
        ["photoncard", ref words @ ..] => tree.defects_of_form(words),
        ["cargo", ref arguments @ ..] => repository::defects_of_cargo(arguments),
        [option, ..] if option.len() > 2 && option.starts_with("--") => defects_of_options(tree, &words),
        [program, ..] if program.contains('/') && program.ends_with(".sh") => {
            return repository::defect_of_script(program).into_iter().collect();
        }
        _ if text.contains(" --") && tree.is_command(text) => tree.defects_of_form(&words),
        _ => Vec::new(),
    };
    defects.extend(words.iter().filter_map(|word| repository::defect_of_path(word)));
    defects
}

/// Defects of options with values: some command must have all these options, and accept each value that is no
/// placeholder.
fn defects_of_options(tree: &CommandTree, words: &[&str]) -> Vec<String> {
    let options: Vec<_> = words.iter().copied().filter(|word| word.starts_with("--")).collect();
    let commands = tree.commands_with(&options);
    if commands.is_empty() {
        let is_known = options.iter().all(|option| repository::has_script_with(option));
        let defect = format!("no command has {}", options.join(" and "));
        return if is_known { Vec::new() } else { vec![defect] };
    }
    let mut defects = Vec::new();
    for pair in words.windows(2).filter(|pair| pair[0].starts_with("--") && !pair[1].starts_with("--")) {
        for value in pair[1].split('|').filter(|value| !is_placeholder(value)) {
            let defect = |command: &&str| {
                let argument = format!("{}={value}", pair[0]);
                let arguments = command.split(' ').chain([argument.as_str()]).collect::<Vec<_>>();
                tree.defect_of_arguments(&arguments)
            };
            let of_commands: Option<Vec<_>> = commands.iter().map(defect).collect();
            defects.extend(of_commands.and_then(|defects| defects.into_iter().next()));
        }
    }
    defects
}

fn is_placeholder(value: &str) -> bool {
    value.contains(|c: char| c.is_ascii_uppercase()) || value.contains("..")
}

#[test]
fn a_script_is_read_as_simple_commands() {
    let script = "# Comment.\nA=1 photoncard render 'a.gltf' --set floor.exponent=32 >log &\n\nmkdir -p x && cmp a b\n";
    let expected: [&[&str]; 3] = [
        &["photoncard", "render", "a.gltf", "--set", "floor.exponent=32"],
        &["mkdir", "-p", "x"],
        &["cmp", "a", "b"],
    ];
    assert_eq!(commands(script), expected);
}
