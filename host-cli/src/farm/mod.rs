//! `photoncard farm`: the job of a render, printed for a farm's engine.
//!
//! Each engine gets the same script ([`script`]), whose steps may be repeated at any time: a scene that is
//! prepared again is compared with the one that is there, parts that are there are not rendered again, and a
//! part that was begun is gone on with. The engines differ in who calls the steps.

mod flamenco;
mod job;
mod openjd;
mod parallel;
mod script;
mod slurm;
mod words;

use self::job::Job;
use crate::arguments::{FarmCommand, FarmOptions};
use crate::console::write_out;
use crate::failure::Failure;

/// Prints a job.
pub(crate) fn run(command: &FarmCommand) -> Result<(), Failure> {
    let job = |options: &FarmOptions| Job::new(options, std::env::args_os().skip(3));
    let text = match command {
        FarmCommand::Openjd(options) => openjd::template(&job(options)?),
        FarmCommand::Slurm(options) => slurm::script(&job(options)?),
        FarmCommand::Flamenco(options) => flamenco::script(&job(options)?),
        FarmCommand::Parallel(options) => parallel::script(&job(options)?),
    };
    write_out(&text)
}
