//! Options of `photoncard measure`.

use std::path::PathBuf;

use clap::{ArgGroup, Args};
use photoncard_driver::parts::Part;
use photoncard_driver::render::RenderSettings;

use super::cards::CardOptions;
use super::farm::JobOptions;
use super::files::{TextOutput, text};
use super::host::HostOptions;
use super::picture::place;
use super::scene::SceneOptions;
use super::schedule::ScheduleOptions;
use super::sensors::SensorOptions;

#[derive(Args)]
pub(crate) struct MeasureOptions {
    #[command(flatten)]
    pub(crate) scene: SceneOptions,
    #[command(flatten)]
    pub(crate) points: PointOptions,
    /// The table to write, CSV; - for standard output
    #[arg(short, long, value_name = "OUT.csv", value_parser = text())]
    pub(crate) output: TextOutput,
    #[command(flatten)]
    pub(crate) units: UnitOptions,
    #[command(flatten)]
    pub(crate) samples: SensorOptions,
    /// Measure only the K-th of N parts of the points
    ///
    /// The tables of all parts, one after another, are bit for bit the table of one measurement.
    #[arg(long, value_name = "K/N")]
    pub(crate) part: Option<Part>,
    #[command(flatten)]
    pub(crate) job: JobOptions,
    #[command(flatten)]
    pub(crate) schedule: ScheduleOptions,
    #[command(flatten)]
    pub(crate) cards: CardOptions,
    #[command(flatten)]
    pub(crate) host: HostOptions,
}

#[derive(Args)]
#[command(next_help_heading = "Points")]
#[group(skip)]
#[command(group = ArgGroup::new("places").args(["points", "grid"]).required(true))]
pub(crate) struct PointOptions {
    /// Points to measure, a line each: x y z and the normal nx ny nz, as rtrace -I reads them; or CSV, whose
    /// first line may name columns; - for standard input
    #[arg(long, value_name = "FILE")]
    pub(crate) points: Option<PathBuf>,
    /// Points on a grid: above the upward faces of a node, by its name; or in a rectangle between two corners
    ///
    /// Of the corners, one coordinate is equal. A horizontal rectangle is measured from above, an upright one
    /// from the side of the greater coordinate, unless --normal states another.
    #[arg(long, value_name = "NODE|X0,Y0,Z0,X1,Y1,Z1", allow_hyphen_values = true, requires = "spacing")]
    pub(crate) grid: Option<String>,
    /// Distance of the grid's points, metres
    #[arg(long, value_name = "METRES", requires = "grid", allow_negative_numbers = true)]
    pub(crate) spacing: Option<f64>,
    /// Height of the grid above the node, metres
    #[arg(
        long,
        value_name = "METRES",
        requires = "grid",
        default_value_t = 0.0,
        allow_negative_numbers = true
    )]
    pub(crate) height: f64,
    /// Normal of all points of the grid
    #[arg(long, value_name = "X,Y,Z", requires = "grid", value_parser = vector, allow_hyphen_values = true, hide_short_help = true)]
    pub(crate) normal: Option<[f64; 3]>,
    /// Measure the irradiance of all normals at each point, as spherical harmonics: lines are x y z, and
    /// normals are ignored
    ///
    /// The table has nine coefficients per channel, W/m^2, of the irradiance as a function of the normal.
    #[arg(long, conflicts_with_all = ["normal", "threshold"])]
    pub(crate) probes: bool,
    /// Points and normals are of a program whose z axis points up, such as Radiance; glTF's y axis does
    #[arg(long, conflicts_with = "grid")]
    pub(crate) z_up: bool,
}

#[derive(Args)]
#[command(next_help_heading = "Units")]
pub(crate) struct UnitOptions {
    /// Lumens per watt of illuminances [default: 683 for a file of Blender, whose lights become watts; 1 for
    /// others, whose lights glTF states in candela and lux]
    ///
    /// Radiance takes 179.
    #[arg(long, value_name = "LUMENS", allow_negative_numbers = true)]
    pub(crate) lumens_per_watt: Option<f64>,
    /// Weights of red, green and blue in illuminances
    ///
    /// The default is Rec. 709's; Radiance takes 0.265,0.670,0.065.
    #[arg(long, value_name = "R,G,B", value_parser = vector, default_value = "0.2126,0.7152,0.0722", allow_hyphen_values = true, hide_short_help = true)]
    pub(crate) weights: [f64; 3],
    /// Illuminance, lx, of which the summary counts the points that have it or more
    #[arg(long, value_name = "LUX", value_parser = lux, allow_negative_numbers = true)]
    pub(crate) threshold: Option<f64>,
}

impl MeasureOptions {
    /// Settings of the measurement.
    pub(crate) fn settings(&self) -> RenderSettings {
        self.samples.settings(&self.schedule, &self.cards)
    }
}

/// Parses three finite numbers.
fn vector(text: &str) -> Result<[f64; 3], String> {
    place(text).map_err(|_| format!("{text:?} is not three numbers with commas between them"))
}

fn lux(text: &str) -> Result<f64, String> {
    let lux = text.parse().ok().filter(|lux: &f64| lux.is_finite());
    lux.ok_or_else(|| format!("{text:?} is no number of lux"))
}
