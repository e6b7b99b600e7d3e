//! Options of punctual lights in a scene's file.

use clap::Args;
use photoncard_driver::choice::Choice;
use photoncard_driver::scene::LightUnits;

use super::choice::choice;

#[derive(Args, Clone)]
pub(crate) struct LightOptions {
    /// Units of the intensities of the file's point, spot and directional lights; the emission of materials
    /// is always in W/(sr m^2)
    #[arg(
        long,
        value_name = "UNITS",
        default_value = LightUnits::default().name(),
        value_parser = choice::<LightUnits>(),
        help_heading = "Scene",
        hide_short_help = true
    )]
    pub(crate) light_units: LightUnits,
}
