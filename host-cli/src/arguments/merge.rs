//! Arguments of `photoncard merge`.

use std::path::PathBuf;

use clap::Args;
use photoncard_driver::choice::Choice;
use photoncard_driver::exr::SampleFormat;

use super::choice::choice;
use super::files::{PictureOutput, picture};
use super::progress::ProgressForm;
use super::tone::ToneOptions;

#[derive(Args)]
pub(crate) struct MergeOptions {
    /// The parts of a picture, as photoncard render --part writes them, in any order
    #[arg(value_name = "PART", required = true)]
    pub(crate) parts: Vec<PathBuf>,
    /// The picture to write: OUT.exr, linear radiance, or OUT.png, tone-mapped; may be repeated
    #[arg(short = 'o', long = "output", value_name = "OUT.exr|OUT.png", required = true, value_parser = picture())]
    pub(crate) pictures: Vec<PictureOutput>,
    /// Type of the EXR's samples; layers Z, gathers, position and mattes are always float
    #[arg(long, default_value = SampleFormat::Float.name(), value_parser = choice::<SampleFormat>())]
    pub(crate) sample_type: SampleFormat,
    #[command(flatten)]
    pub(crate) tone: ToneOptions,
    /// Remove noise by Open Image Denoise, as photoncard render --denoise does
    #[arg(long)]
    pub(crate) denoise: bool,
    /// Form in which progress and a failure are reported
    #[arg(long, value_enum, default_value_t, hide_short_help = true)]
    pub(crate) progress: ProgressForm,
}
