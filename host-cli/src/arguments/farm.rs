//! Options of `photoncard farm`.

use clap::{Args, Subcommand};
use photoncard_driver::parts::MAX_PARTS;

use super::render::RenderOptions;

#[derive(Subcommand)]
pub(crate) enum FarmCommand {
    /// Print a job template of Open Job Description, as AWS Deadline Cloud and the openjd command run it
    Openjd(Box<FarmOptions>),
    /// Print a script that submits the job to Slurm
    Slurm(Box<FarmOptions>),
    /// Print a script that runs the job by GNU parallel
    Parallel(Box<FarmOptions>),
}

#[derive(Args)]
pub(crate) struct FarmOptions {
    #[command(flatten)]
    pub(crate) render: RenderOptions,
    /// Number of parts of a picture, each of which is a task
    #[arg(long, value_name = "N", default_value_t = 8, value_parser = clap::value_parser!(u32).range(1..=i64::from(MAX_PARTS)), help_heading = "Farm")]
    pub(crate) parts: u32,
    /// Frames of the scene's animations, each of which is a picture: -o OUT.####.exr has a place for their numbers
    #[arg(long, value_name = "A-B", value_parser = frames, help_heading = "Farm")]
    pub(crate) frames: Option<Frames>,
}

/// The first and the last of consecutive frames.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Frames {
    pub(crate) first: u32,
    pub(crate) last: u32,
}

/// Maximum number of a frame.
const MAX_FRAME: u32 = 999_999;

fn frames(text: &str) -> Result<Frames, String> {
    let ends = text.split_once('-').unwrap_or((text, text));
    let [first, last] =
        [ends.0, ends.1].map(|number| number.parse().ok().filter(|frame| *frame <= MAX_FRAME));
    let frames = first.zip(last).filter(|(first, last)| first <= last);
    frames
        .map(|(first, last)| Frames { first, last })
        .ok_or_else(|| format!("frames are A-B, two numbers up to {MAX_FRAME}, such as 1-240"))
}
