//! The options of `photoncard render` that say what becomes of the picture.

use std::path::{Path, PathBuf};

use clap::Args;
use photoncard_driver::display::{DisplayAddress, DisplaySettings};
use photoncard_driver::exr::SampleFormat;
use photoncard_driver::layer::Layers;
use photoncard_driver::preview::{ToneCurve, ToneMapping};

use super::choice::choice;

#[derive(Args)]
pub(crate) struct PictureOptions {
    /// Layers of the picture besides radiance, with commas between them: direct, indirect, caustic, albedo, N, Z, gathers; or
    /// all, or none
    #[arg(long, value_name = "LIST", default_value_t = Layers::default())]
    pub(crate) aov: Layers,
    /// Type of the picture's samples; Z and gathers are always float
    #[arg(long, default_value = "float", value_parser = choice::<SampleFormat>())]
    pub(crate) sample_type: SampleFormat,
    /// Write a tone-mapped PNG as well
    #[arg(long, value_name = "OUT.png")]
    pub(crate) preview: Option<PathBuf>,
    /// Exposure of that PNG in stops: radiance is doubled so often; or auto, which makes its log-average 0.18
    #[arg(
        long,
        value_name = "EV",
        requires = "preview",
        default_value = "auto",
        value_parser = exposure,
        allow_negative_numbers = true
    )]
    exposure: Exposure,
    /// What compresses the radiance of that PNG
    #[arg(
        long = "tonemap",
        value_name = "CURVE",
        requires = "preview",
        default_value = "reinhard",
        value_parser = choice::<ToneCurve>()
    )]
    tone_curve: ToneCurve,
    /// Show tiles as they land, in tev or another viewer that speaks its protocol; port 14158 without one
    #[arg(long, value_name = "HOST:PORT")]
    display_server: Option<DisplayAddress>,
}

#[derive(Clone, Copy)]
enum Exposure {
    Auto,
    Stops(f32),
}

impl PictureOptions {
    /// Where the picture is shown, by the name of its file.
    pub(super) fn display(&self, output: &Path) -> Option<DisplaySettings> {
        let address = self.display_server.clone()?;
        let image = output.file_name().unwrap_or(output.as_os_str());
        Some(DisplaySettings { address, image: image.to_string_lossy().into_owned() })
    }

    /// How the PNG shows radiance.
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

fn exposure(text: &str) -> Result<Exposure, String> {
    match text.parse() {
        _ if text == "auto" => Ok(Exposure::Auto),
        Ok(stops) if f32::is_finite(stops) => Ok(Exposure::Stops(stops)),
        _ => Err("an exposure is a number of stops, such as -1.5, or auto".into()),
    }
}
