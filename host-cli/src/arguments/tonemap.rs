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
    /// Show illuminance or luminance in false colours between two values, with contours and a legend
    ///
    /// Values are lx of the layer illuminance, W/m^2 of a picture by --irradiance, of other pictures the
    /// luminance in cd/m^2.
    #[arg(long, value_name = "LO,HI", value_parser = range, allow_hyphen_values = true, conflicts_with_all = ["exposure", "curve"])]
    pub(crate) false_color: Option<[f32; 2]>,
    /// Lumens per watt of --false-color, for a picture without the layer illuminance [default: 1 for
    /// luminance; a picture by --irradiance is shown in W/m^2 without it]
    #[arg(long, value_name = "LUMENS", requires = "false_color", value_parser = lumens, allow_negative_numbers = true)]
    pub(crate) lumens_per_watt: Option<f32>,
}

fn lumens(text: &str) -> Result<f32, String> {
    let lumens = text.parse().ok().filter(|lumens: &f32| lumens.is_finite() && *lumens > 0.0);
    lumens.ok_or_else(|| format!("{text:?} is no positive number of lumens per watt"))
}

/// Parses a lower and a greater number.
fn range(text: &str) -> Result<[f32; 2], String> {
    let numbers: Option<Vec<f32>> = text.split(',').map(|number| number.trim().parse().ok()).collect();
    match numbers.as_deref() {
        Some(&[low, high]) if low.is_finite() && high.is_finite() && low < high => Ok([low, high]),
        _ => Err(format!("{text:?} is no range: write LO,HI, such as 0,2000")),
    }
}
