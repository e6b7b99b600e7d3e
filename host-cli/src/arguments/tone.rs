//! Options of tone mapping.

use clap::Args;
use photoncard_driver::choice::Choice;
use photoncard_driver::tone_mapping::{ToneCurve, ToneMapping};

use super::choice::choice;

#[derive(Args, Clone)]
pub(crate) struct ToneOptions {
    /// Exposure of the PNG in stops, or auto [default: auto]
    ///
    /// Radiance is multiplied by 2^EV; auto makes the log-average of the lit pixels' luminance 0.18.
    #[arg(long, value_name = "EV", value_parser = exposure, allow_negative_numbers = true)]
    pub(super) exposure: Option<Exposure>,
    #[arg(
        long = "tonemap",
        value_name = "CURVE",
        value_parser = choice::<ToneCurve>(),
        help = format!("Tone curve of the PNG [default: {}]", ToneCurve::default().name())
    )]
    pub(super) curve: Option<ToneCurve>,
}

#[derive(Clone, Copy)]
pub(super) enum Exposure {
    Auto,
    Stops(f32),
}

impl ToneOptions {
    pub(crate) fn mapping(&self) -> ToneMapping {
        ToneMapping {
            exposure: match self.exposure {
                None | Some(Exposure::Auto) => None,
                Some(Exposure::Stops(stops)) => Some(stops),
            },
            curve: self.curve.unwrap_or_default(),
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
