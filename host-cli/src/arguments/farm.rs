//! Options of `photoncard farm`.

use clap::{Args, Subcommand, ValueEnum};
use photoncard_driver::parts::MAX_PARTS;

use super::render::RenderOptions;

#[derive(Subcommand)]
pub(crate) enum FarmCommand {
    /// Print a job template of Open Job Description, as AWS Deadline Cloud and the openjd command run it
    Openjd(Box<FarmOptions>),
    /// Print a script that submits the job to Slurm
    Slurm(Box<FarmOptions>),
    /// Print a job type for Flamenco that renders this one job
    Flamenco(Box<FarmOptions>),
    /// Print a script that runs the job by GNU parallel
    Parallel(Box<FarmOptions>),
}

/// Engine of a render farm.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(crate) enum Engine {
    /// Open Job Description
    Openjd,
    Slurm,
    Flamenco,
    /// GNU parallel
    Parallel,
}

/// Options of a command that divides its own work into the tasks of a farm's job.
#[derive(Args)]
#[command(next_help_heading = "Farm")]
pub(crate) struct JobOptions {
    /// Print the job that does the work in parts on a render farm of this engine, and do nothing else
    #[arg(long, value_enum, value_name = "ENGINE", conflicts_with = "part", hide_short_help = true)]
    pub(crate) farm: Option<Engine>,
    /// Number of parts of the farm's job; each is a task
    #[arg(
        long,
        value_name = "N",
        default_value_t = 8,
        requires = "farm",
        value_parser = clap::value_parser!(u32).range(1..=i64::from(MAX_PARTS)),
        hide_short_help = true
    )]
    pub(crate) parts: u32,
}

#[derive(Args)]
pub(crate) struct FarmOptions {
    #[command(flatten)]
    pub(crate) render: RenderOptions,
    /// Number of parts that each picture is divided into; each part is a task
    #[arg(long, value_name = "N", default_value_t = 8, value_parser = clap::value_parser!(u32).range(1..=i64::from(MAX_PARTS)), help_heading = "Farm")]
    pub(crate) parts: u32,
}
