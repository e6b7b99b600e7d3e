//! Arguments of `photoncard mix`.

use std::path::PathBuf;

use clap::Args;
use photoncard_driver::exr::mix::Gain;

use super::files::{PictureOutput, picture};
use super::tone::ToneOptions;

#[derive(Args)]
pub(crate) struct MixOptions {
    /// An EXR picture that was rendered with --light-groups
    #[arg(value_name = "IN.exr")]
    pub(crate) input: PathBuf,
    /// Multiply the light of a group by a factor, or by one for each channel; may be repeated
    ///
    /// Groups that are not named keep their light. 0 switches a group off.
    #[arg(long = "group", value_name = "NAME=FACTOR|R,G,B")]
    pub(crate) gains: Vec<Gain>,
    /// The picture to write: OUT.exr, with all layers of the input, or OUT.png, tone-mapped; may be repeated
    #[arg(short = 'o', long = "output", value_name = "OUT.exr|OUT.png", required = true, value_parser = picture())]
    pub(crate) pictures: Vec<PictureOutput>,
    #[command(flatten)]
    pub(crate) tone: ToneOptions,
    /// Remove noise by Open Image Denoise, as photoncard render --denoise does
    ///
    /// The input needs the layers albedo, N and Z, which an EXR has by default. Without this option, a
    /// denoised layer of the input is left out.
    #[arg(long)]
    pub(crate) denoise: bool,
}
