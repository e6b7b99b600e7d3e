//! Jobs for the engines of farms: `photoncard farm` prints a render job, and other commands jobs of their
//! parts.
//!
//! All engines run the same script ([`script`]), whose steps may be repeated at any time. A scene that is
//! prepared again is compared with the existing one, existing parts are not rendered again, and unfinished
//! parts are continued. Engines differ only in what calls the steps.

mod engines;
mod job;
mod openjd;
mod parts;
mod script;
mod words;

use self::job::{Job, of_arguments};
pub(crate) use self::parts::{Merge, Work};
use crate::arguments::{Engine, FarmCommand};
use crate::console::write_out;
use crate::failure::Failure;

/// Prints a job.
pub(crate) fn run(command: &FarmCommand) -> Result<(), Failure> {
    let (engine, options) = match command {
        FarmCommand::Openjd(options) => (Engine::Openjd, options),
        FarmCommand::Slurm(options) => (Engine::Slurm, options),
        FarmCommand::Flamenco(options) => (Engine::Flamenco, options),
        FarmCommand::Parallel(options) => (Engine::Parallel, options),
    };
    write_out(&text(engine, &Job::new(options, std::env::args_os().skip(3))?))
}

/// Prints a job that does the work of this process's command in `parts` parts.
pub(crate) fn print(engine: Engine, work: &Work, parts: u32) -> Result<(), Failure> {
    write_out(&text(engine, &of_arguments(work, parts, std::env::args_os().skip(2))?))
}

fn text(engine: Engine, job: &Job) -> String {
    match engine {
        Engine::Openjd => openjd::template(job),
        Engine::Slurm => engines::slurm(job),
        Engine::Flamenco => engines::flamenco(job),
        Engine::Parallel => engines::parallel(job),
    }
}
