//! Options of output files and of the display server.

use std::path::{Path, PathBuf};

use clap::Args;
use photoncard_driver::display::{DisplayAddress, DisplaySettings};
use photoncard_driver::exr::SampleFormat;
use photoncard_driver::partial::PartialSettings;
use photoncard_driver::preview::{ToneCurve, ToneMapping};
use photoncard_driver::render::TileOutputs;

use super::choice::choice;

#[derive(Args)]
pub(crate) struct OutputOptions {
    /// Continue a render that was stopped or has failed: its finished tiles are kept beside the picture, in
    /// OUT.exr.partial, until the picture is written
    #[arg(long)]
    resume: bool,
    /// Type of the picture's samples; Z and gathers are always float
    #[arg(long, default_value = "float", value_parser = choice::<SampleFormat>())]
    pub(crate) sample_type: SampleFormat,
    /// Write a tone-mapped PNG as well
    #[arg(long, value_name = "OUT.png")]
    pub(crate) preview: Option<PathBuf>,
    /// Exposure of the PNG in stops: radiance is multiplied by 2^EXPOSURE; or auto, which makes its log-average 0.18
    #[arg(
        long,
        value_name = "EV",
        requires = "preview",
        default_value = "auto",
        value_parser = exposure,
        allow_negative_numbers = true
    )]
    exposure: Exposure,
    /// Tone curve of the PNG
    #[arg(
        long = "tonemap",
        value_name = "CURVE",
        requires = "preview",
        default_value = "reinhard",
        value_parser = choice::<ToneCurve>()
    )]
    tone_curve: ToneCurve,
    /// Show tiles as they are finished, in tev or another viewer that speaks its protocol [default port: 14158]
    #[arg(long, value_name = "HOST:PORT")]
    display_server: Option<DisplayAddress>,
    /// Write statistics of the render as JSON
    #[arg(long, value_name = "OUT.json")]
    pub(crate) stats: Option<PathBuf>,
}

#[derive(Clone, Copy)]
enum Exposure {
    Auto,
    Stops(f32),
}

impl OutputOptions {
    /// Settings of these options for the picture in the file `output`.
    pub(super) fn settings(&self, output: &Path) -> TileOutputs {
        TileOutputs {
            partial: Some(PartialSettings { path: partial_path(output), resume: self.resume }),
            display: self.display(output),
        }
    }

    /// Display server, and the picture's name on it: that of its file.
    fn display(&self, output: &Path) -> Option<DisplaySettings> {
        let address = self.display_server.clone()?;
        let image = output.file_name().unwrap_or(output.as_os_str());
        Some(DisplaySettings { address, image: image.to_string_lossy().into_owned() })
    }

    /// Tone mapping of the PNG.
    pub(crate) fn tone_mapping(&self) -> ToneMapping {
        ToneMapping {
            exposure: match self.exposure {
                Exposure::Auto => None,
                Exposure::Stops(stops) => Some(stops),
            },
            curve: self.tone_curve,
        }
    }
}

/// Path of the file in which finished tiles are kept until the picture is written.
pub(super) fn partial_path(output: &Path) -> PathBuf {
    let mut name = output.as_os_str().to_owned();
    name.push(".partial");
    name.into()
}

fn exposure(text: &str) -> Result<Exposure, String> {
    match text.parse() {
        _ if text == "auto" => Ok(Exposure::Auto),
        Ok(stops) if f32::is_finite(stops) => Ok(Exposure::Stops(stops)),
        _ => Err("an exposure is a number of stops, such as -1.5, or auto".into()),
    }
}
