//! Commands `photoncard completions` and `photoncard man`: documents that are generated from the arguments.

// Released packages are built with `photoncard study`, which the reference in `docs/cli.md` therefore lists.
#[cfg(all(test, feature = "study"))]
mod tests;

use std::path::Path;

use clap::{Command, CommandFactory};
use clap_complete::{Shell, generate};
use clap_mangen::Man;
use photoncard_driver::output;

use crate::arguments::Arguments;
use crate::console::write_out;
use crate::failure::Failure;

/// Name of the program.
const NAME: &str = env!("CARGO_PKG_NAME");

/// Prints the completions for a shell.
pub(crate) fn completions(shell: Shell) -> Result<(), Failure> {
    let mut script = Vec::new();
    generate(shell, &mut Arguments::command(), NAME, &mut script);
    write_out(&String::from_utf8_lossy(&script))
}

/// Writes a manual page for each command into a folder.
pub(crate) fn man(folder: &Path) -> Result<(), Failure> {
    std::fs::create_dir_all(folder).map_err(|error| Failure::folder(folder, &error))?;
    let mut command = Arguments::command().disable_help_subcommand(true);
    command.build();
    write_pages(&command, folder)
}

/// Writes the manual pages of a command and of all commands below it.
fn write_pages(command: &Command, folder: &Path) -> Result<(), Failure> {
    let page = Man::new(command.clone());
    let mut text = Vec::new();
    page.render(&mut text).map_err(|error| Failure::work_error(&error))?;
    output::write(&folder.join(page.get_filename()), &text).map_err(|error| Failure::work_error(&error))?;
    command.get_subcommands().try_for_each(|below| write_pages(below, folder))
}
