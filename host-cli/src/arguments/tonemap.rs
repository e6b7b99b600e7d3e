//! Arguments of `photoncard tonemap`.

use std::path::PathBuf;

use clap::Args;

use super::files::png;
use super::tone::ToneOptions;

#[derive(Args)]
pub(crate) struct TonemapOptions {
    /// An EXR picture with the channels R, G and B, linear radiance
    #[arg(value_name = "IN.exr")]
    pub(crate) input: PathBuf,
    /// The picture to write
    #[arg(short, long, value_name = "OUT.png", value_parser = png())]
    pub(crate) output: PathBuf,
    #[command(flatten)]
    pub(crate) tone: ToneOptions,
}
