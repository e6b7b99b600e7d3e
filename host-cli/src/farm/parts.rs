//! Steps of a job that does the work of a command in parts, by the command's own `--part`.

use std::path::Path;

use clap::CommandFactory;

use super::words::{not_for_a_job, options};
use crate::arguments::Arguments;
use crate::failure::Failure;

/// Clap's ids of options that a job states itself.
const OF_JOB: [&str; 3] = ["output", "farm", "parts"];
/// Clap's ids of options that a job cannot have.
const OF_NO_JOB: [&str; 2] = ["part", "progress"];

/// Work that can be divided into parts.
pub(crate) struct Work<'a> {
    /// Name of the command.
    pub(crate) command: &'static str,
    /// Files that the command reads; the scene is the first.
    pub(crate) inputs: &'a [&'a Path],
    pub(crate) output: &'a Path,
    pub(crate) merge: Merge,
}

/// Method by which parts become the output.
#[derive(Clone, Copy)]
pub(crate) enum Merge {
    /// One after another.
    Tables,
    /// By `--merge` of the command, whose options with these of Clap's ids are not for parts.
    Command { not_in_parts: &'static [&'static str] },
}

/// Words of the steps.
pub(super) struct PartSteps {
    pub(super) command: &'static str,
    pub(super) scene: String,
    pub(super) inputs: Vec<String>,
    /// Arguments of the command for a part, without those of the job.
    pub(super) words: Vec<String>,
    /// Arguments of the command that puts parts together.
    pub(super) of_merge: Vec<String>,
    pub(super) output: String,
    pub(super) merge: Merge,
}

impl PartSteps {
    /// Steps of the work whose command has the arguments `given`. `text` returns a path as text.
    ///
    /// # Errors
    /// If an option is not for a job, or a path is not text.
    pub(super) fn new(
        work: &Work,
        given: Vec<String>,
        text: impl Fn(&Path) -> Result<String, Failure>,
    ) -> Result<Self, Failure> {
        let arguments = Arguments::command();
        let not_in_parts = match work.merge {
            Merge::Tables => &[][..],
            Merge::Command { not_in_parts } => not_in_parts,
        };
        let (mut words, mut of_merge) = (Vec::new(), Vec::new());
        if let Some(command) = arguments.find_subcommand(work.command) {
            for (option, given) in options(given, command) {
                let id = option.map_or("", |option| option.get_id().as_str());
                if OF_NO_JOB.contains(&id) {
                    return Err(not_for_a_job(given[0].split('=').next().unwrap_or_default()));
                }
                if OF_JOB.contains(&id) {
                    continue;
                }
                of_merge.extend(given.iter().cloned());
                words.extend(given.into_iter().filter(|_| !not_in_parts.contains(&id)));
            }
        }
        let inputs: Vec<String> = work.inputs.iter().map(|path| text(path)).collect::<Result<_, _>>()?;
        Ok(Self {
            command: work.command,
            scene: inputs.first().cloned().unwrap_or_default(),
            inputs,
            words,
            of_merge,
            output: text(work.output)?,
            merge: work.merge,
        })
    }
}
