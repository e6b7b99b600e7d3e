//! The `photoncard` command: arguments and printing, no rendering.
//!
//! Standard output is for data, standard error for messages. Exit status: 0 done; 1 the work failed; 2
//! invalid arguments or unreadable input; 130 stopped by an interrupt.
//!
//! | module | contents |
//! |---|---|
//! | `console`, `report` | standard streams, on which unprintable characters are escaped; layout of errors |
//! | `failure` | errors with their exit status |
//! | `flags` | replacement of the settings' names in the library's errors by flags of the command line |
//! | `arguments`, `environment` | command line: options of every command, and their values |
//! | `input` | scene and environment of a render |
//! | `memory` | free memory of the machine |
//! | `web_module` | WebAssembly module that browsers run |
//! | `notices` | contents of a scene that are ignored, missing or interpreted in another way |
//! | `shell` | quoting of commands |
//! | `outputs`, `picture_files` | checks of output files before any work; pictures as files |
//! | `progress`, `hang_up` | progress of a render, and the signals that stop it |
//! | `render` (and `prepare`), `measure`, `bake`, `autonomy`, `farm`, `view` | one module for each command |
//! | `scene`, `documents`, `study`, `page_folder` | one module for each command |
//! | `card`, `pictures` | commands on cards, and on pictures (`merge`, `mix`, `tonemap`, `diff`) |
//!
//! A command turns arguments into settings of `photoncard_driver`, calls it, and prints the result. To render
//! from Rust, use `photoncard_driver` directly.
#![forbid(unsafe_code)]
#![cfg_attr(target_family = "wasm", expect(dead_code, unused_imports, reason = "a browser has `view` alone"))]

mod arguments;
#[cfg(not(target_family = "wasm"))]
mod autonomy;
#[cfg(not(target_family = "wasm"))]
mod bake;
#[cfg(not(target_family = "wasm"))]
mod card;
mod console;
#[cfg(not(target_family = "wasm"))]
mod documents;
mod environment;
mod failure;
#[cfg(not(target_family = "wasm"))]
mod farm;
mod flags;
#[cfg(target_os = "linux")]
mod hang_up;
mod input;
#[cfg(not(target_family = "wasm"))]
mod measure;
mod memory;
mod notices;
#[cfg(not(target_family = "wasm"))]
mod outputs;
#[cfg(not(target_family = "wasm"))]
mod page_folder;
mod picture_files;
#[cfg(not(target_family = "wasm"))]
mod pictures;
#[cfg(not(target_family = "wasm"))]
mod progress;
#[cfg(not(target_family = "wasm"))]
mod render;
mod report;
#[cfg(not(target_family = "wasm"))]
mod scene;
mod shell;
#[cfg(feature = "study")]
mod study;
mod view;
#[cfg(not(target_family = "wasm"))]
mod web_module;

#[cfg(not(target_family = "wasm"))]
use std::process::ExitCode;

#[cfg(not(target_family = "wasm"))]
use crate::arguments::{Arguments, CardCommand, Command, ProgressForm, SceneCommand};
#[cfg(not(target_family = "wasm"))]
use crate::progress::fail_openjd;

/// A view for programs that may not wait: the host in a browser's page.
pub mod page {
    pub use crate::view::browser::{Message, PageView};
}

#[cfg(not(any(feature = "study", target_family = "wasm")))]
fn without_studies() -> failure::Failure {
    let remedy = "build it with them: cargo build --release -p photoncard --features study";
    failure::Failure::Input(
        miette::MietteDiagnostic::new("this program was built without studies").with_help(remedy).into(),
    )
}

#[cfg(not(target_family = "wasm"))]
/// Runs the command that the process's arguments state, and returns the command's exit status. Invalid
/// arguments end the process with status 2.
pub fn main() -> ExitCode {
    // Invalid arguments end the process here, with status 2.
    let mut arguments = Arguments::parse_printably();
    report::lay_out_errors();
    if arguments.command.progress() == ProgressForm::Json {
        console::speak_json();
    }
    let result = match &mut arguments.command {
        Command::Render(options) => render::run(options),
        Command::Prepare(options) => render::prepare::run(options),
        Command::Measure(options) => measure::run(options),
        Command::Autonomy(options) => autonomy::run(options),
        Command::Bake(options) => bake::run(options),
        Command::Merge(options) => pictures::merge(options),
        Command::Farm(command) => farm::run(command),
        Command::View(options) => view::run(options),
        Command::Page(options) => page_folder::run(options),
        Command::Mix(options) => pictures::mix(options),
        Command::Tonemap(options) => pictures::tonemap(options),
        Command::Scene(SceneCommand::Info { scene, json, lights }) => scene::info(scene, *json, lights),
        Command::Card(CardCommand::List) => card::list(),
        Command::Card(CardCommand::Info { card }) => card::info(card),
        Command::Card(CardCommand::Ping { card, count }) => card::ping(card, *count),
        Command::Card(CardCommand::Selftest { card, quiet }) => card::self_test(card, *quiet),
        Command::Emulate(options) => card::emulate(options),
        Command::Diff(options) => pictures::diff(options),
        Command::Completions { shell } => documents::completions(*shell),
        Command::Man { folder } => documents::man(folder),
        #[cfg(feature = "study")]
        Command::Study(arguments) => study::run(arguments),
        #[cfg(not(feature = "study"))]
        Command::Study { .. } => Err(without_studies()),
    };
    match result {
        Ok(()) => ExitCode::SUCCESS,
        Err(failure) => {
            console::say_failure(&failure);
            if arguments.command.progress() == ProgressForm::Openjd {
                fail_openjd(&failure);
            }
            failure.status()
        }
    }
}
