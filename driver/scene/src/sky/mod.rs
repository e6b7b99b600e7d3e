//! Clear sky by place and time: an environment map and the sun, in absolute units.
//!
//! | module | what it does |
//! |---|---|
//! | `moment` | dates and times |
//! | `sun` | the sun's place in the sky |
//! | `sunlight` | the sun's direct light |
//! | `hosek_wilkie` | the sky's luminance |

mod hosek_wilkie;
mod moment;
mod sun;
mod sunlight;

use std::f64::consts::{FRAC_PI_2, PI, TAU};
use std::fmt::{self, Display};
use std::ops::RangeInclusive;
use std::str::FromStr;

use glam::Vec3;
use rayon::prelude::*;

use self::hosek_wilkie::{ClearSky, angle_between};
use self::sun::SunPlace;
use crate::environment::Environment;
use crate::light::{LightAxes, PunctualKind, PunctualLight};

/// Size of the map, texels: the horizon is between two rows.
const MAP: [u32; 2] = [512, 256];
/// Albedo of the ground below the horizon.
const GROUND_ALBEDO: f64 = 0.2;
/// Angle across the sun's disk, degrees: its mean.
const SUN_DEGREES: f32 = 0.533;
/// Name of the sun among the lights of a scene.
const SUN: &str = "sun";
const TURBIDITIES: RangeInclusive<f64> = 1.7..=10.0;
const TURBIDITY: f64 = 3.0;

/// Place, time and haze that determine a clear sky: `LAT,LON,TIME` or `LAT,LON,TIME,TURBIDITY`, with latitude
/// and longitude in degrees, north and east positive, and a date and time of ISO 8601 with its offset from
/// UTC. The turbidity is the optical depth of air and haze over that of air alone, 1.7 to 10, and 3 by
/// default.
#[derive(Clone, Debug, PartialEq)]
pub struct Sky {
    text: String,
    /// Latitude and longitude, degrees.
    place: [f64; 2],
    /// Days since 2000-01-01T12:00Z.
    days: f64,
    turbidity: f64,
}

/// Reason why a text states no sky, as a sentence.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{0}")]
pub struct NoSky(String);

impl FromStr for Sky {
    type Err = NoSky;

    fn from_str(text: &str) -> Result<Self, NoSky> {
        let mut parts = text.split(',').map(str::trim);
        let (Some(latitude), Some(longitude), Some(time)) = (parts.next(), parts.next(), parts.next()) else {
            return Err(NoSky("a sky is LAT,LON,TIME, such as 52.5,13.4,2026-06-21T14:30+02:00".into()));
        };
        let turbidity = parts.next();
        if let Some(more) = parts.next() {
            return Err(NoSky(format!(
                "'{more}' follows the turbidity: a sky is LAT,LON,TIME or LAT,LON,TIME,TURBIDITY"
            )));
        }
        let turbidity = turbidity.map(|text| number("turbidity", "a clear sky has 3", text, TURBIDITIES));
        Ok(Self {
            place: [
                number("latitude", "degrees north of the equator", latitude, -90.0..=90.0)?,
                number("longitude", "degrees east of Greenwich", longitude, -180.0..=180.0)?,
            ],
            days: moment::parse(time).map_err(NoSky)?,
            turbidity: turbidity.transpose()?.unwrap_or(TURBIDITY),
            text: text.split_whitespace().collect(),
        })
    }
}

fn number(name: &str, meaning: &str, text: &str, range: RangeInclusive<f64>) -> Result<f64, NoSky> {
    let value = text.parse().ok().filter(|value| range.contains(value));
    value.ok_or_else(|| {
        NoSky(format!("'{text}' is no {name}: it is {} to {}, {meaning}", range.start(), range.end()))
    })
}

/// The text from which the sky was parsed, without spaces.
impl Display for Sky {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        formatter.write_str(&self.text)
    }
}

/// Light of a sky in lumens: luminances in cd/m^2 and illuminances in lx.
#[derive(Clone, Debug, PartialEq)]
pub struct Daylight {
    /// The sky above the horizon, and below it a ground of an albedo of 0.2 under its light. Black if the sun
    /// is below the horizon.
    pub environment: Environment,
    /// The sun: a directional light called `sun`, from a disk. `None` if it is below the horizon.
    pub sun: Option<PunctualLight>,
    /// Elevation of the sun, degrees.
    pub elevation: f64,
}

impl Sky {
    /// Light of the sky. North is -z and east is +x, turned about +y by `north` degrees, counter-clockwise
    /// seen from above.
    pub fn daylight(&self, north: f32) -> Daylight {
        let SunPlace { elevation, azimuth } = SunPlace::new(self.days, self.place.map(f64::to_radians));
        let degrees = elevation.to_degrees();
        if elevation < 0.0 {
            return Daylight {
                environment: Environment::constant(Vec3::ZERO),
                sun: None,
                elevation: degrees,
            };
        }
        let azimuth = azimuth - f64::from(north).to_radians();
        let sunlight = sunlight::illuminance(self.turbidity, elevation);
        let (sine, cosine) = libm::sincos(elevation);
        let (east, north) = libm::sincos(azimuth);
        let towards = [east * cosine, sine, -north * cosine].map(|value| value as f32);
        let sun = PunctualLight {
            name: SUN.into(),
            kind: PunctualKind::Directional {
                direction: -Vec3::from_array(towards),
                angle: SUN_DEGREES.to_radians(),
            },
            intensity: Vec3::from_array(sunlight.map(|value| value as f32)),
            axes: LightAxes::default(),
        };
        let sky = ClearSky::new(self.turbidity, GROUND_ALBEDO, elevation.min(FRAC_PI_2));
        let environment = map(&sky, [sine, azimuth], sunlight.map(|value| value * sine));
        Daylight { environment, sun: Some(sun), elevation: degrees }
    }
}

impl Daylight {
    /// Converts the light to watts, of which each has `lumens_per_watt` lumens.
    #[must_use]
    pub fn in_watts(mut self, lumens_per_watt: f32) -> Self {
        self.environment.texels.as_flattened_mut().iter_mut().for_each(|value| *value /= lumens_per_watt);
        if let Some(sun) = &mut self.sun {
            sun.intensity /= lumens_per_watt;
        }
        self
    }
}

/// Map of a sky and of the ground below it. `sun` is the sine of the sun's elevation, and its azimuth from -z
/// towards +x, radians; `sunlight` is its illuminance of the ground per channel, lx.
fn map(sky: &ClearSky, [sine, azimuth]: [f64; 2], sunlight: [f64; 3]) -> Environment {
    let [width, height] = MAP;
    let rows = height / 2;
    let row = |row: u32| -> Vec<[f64; 3]> {
        let cosine = libm::cos(PI * (f64::from(row) + 0.5) / f64::from(height));
        let texel = |column: u32| {
            let across = TAU * ((f64::from(column) + 0.5) / f64::from(width) - 0.5) - azimuth;
            sky.luminance(cosine, angle_between(cosine, sine, across))
        };
        (0..width).map(texel).collect()
    };
    let above: Vec<Vec<[f64; 3]>> = (0..rows).into_par_iter().map(row).collect();
    let mut received = sunlight;
    for (row, texels) in above.iter().enumerate() {
        let weight = solid_angle_times_cosine(row as u32);
        for texel in texels {
            received.iter_mut().zip(texel).for_each(|(sum, value)| *sum += value * weight);
        }
    }
    let ground = received.map(|illuminance| (illuminance * GROUND_ALBEDO / PI) as f32);
    let mut texels: Vec<[f32; 3]> =
        above.into_iter().flatten().map(|texel| texel.map(|value| value as f32)).collect();
    texels.resize((width * height) as usize, ground);
    Environment { width, height, texels, strength: 1.0 }
}

/// Integral of the cosine to the zenith over a texel of a row above the horizon, sr.
fn solid_angle_times_cosine(row: u32) -> f64 {
    let [width, height] = MAP.map(f64::from);
    let border = |row: u32| {
        let sine = libm::sin(PI * f64::from(row) / height);
        0.5 * sine * sine
    };
    (border(row + 1) - border(row)) * TAU / width
}

#[cfg(test)]
mod tests;
