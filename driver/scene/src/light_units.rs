//! Units of lights without extent.

use photoncard_picture::choice::choices;

/// Luminous efficacy by which Blender's exporter converts watts to lumens, lm/W.
const EFFICACY: f32 = 683.0;

/// Units in which a file states lights without extent (`KHR_lights_punctual`).
///
/// Emission of surfaces is always radiance in W/(sr m^2), and the constant radiance of an environment too. A
/// file is consistent if its lights are in W/sr and W/m^2, or in cd and lx beside emission in cd/m^2, which
/// is the same but for a factor of all light: both are [`Radiometric`](Self::Radiometric).
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum LightUnits {
    /// Units of the exporter that the file names: [`Photometric`](Self::Photometric) for Blender's own,
    /// [`Watts`](Self::Watts) for Blender's before 3.4, [`Radiometric`](Self::Radiometric) for others.
    #[default]
    Auto,
    /// Points and spots in W/sr, directional lights in W/m^2: numbers of candela and lux as they stand.
    Radiometric,
    /// Points and spots in cd, directional lights in lx, both of 683 lm/W.
    Photometric,
    /// Points and spots by the flux of a point that radiates in all directions, W; directional lights in
    /// W/m^2.
    Watts,
}

choices!(LightUnits {
    Auto = "auto":
        "Those of the exporter that the file names: photometric for Blender's, watts before 3.4, radiometric for others",
    Radiometric = "radiometric": "As they stand: a candela is a W/sr, a lux a W/m^2",
    Photometric = "photometric": "Candela and lux of 683 lm/W, beside emission in W/(sr m^2)",
    Watts = "watts": "Points and spots by their flux in all directions, W; directional lights in W/m^2",
});

impl LightUnits {
    /// Number by which intensities of points and spots are divided to be in W/sr.
    pub(super) fn points(self) -> f32 {
        match self {
            Self::Auto | Self::Radiometric => 1.0,
            Self::Photometric => EFFICACY,
            Self::Watts => 4.0 * std::f32::consts::PI,
        }
    }

    /// Number by which irradiances of directional lights are divided to be in W/m^2.
    pub(super) fn directional(self) -> f32 {
        match self {
            Self::Auto | Self::Radiometric | Self::Watts => 1.0,
            Self::Photometric => EFFICACY,
        }
    }
}
