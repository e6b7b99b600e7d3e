//! Command `photoncard farm`: prints a render job for a farm's engine.
//!
//! All engines run the same script ([`script`]), whose steps may be repeated at any time. A scene that is
//! prepared again is compared with the existing one, existing parts are not rendered again, and unfinished
//! parts are continued. Engines differ only in what calls the steps.

mod engines;
mod job;
mod openjd;
mod script;
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
        FarmCommand::Slurm(options) => engines::slurm(&job(options)?),
        FarmCommand::Flamenco(options) => engines::flamenco(&job(options)?),
        FarmCommand::Parallel(options) => engines::parallel(&job(options)?),
    };
    write_out(&text)
}
