//! Units of punctual lights.

use photoncard_picture::choice::choices;

/// Luminous efficacy by which Blender's exporter converts watts to lumens, lm/W.
pub(super) const EFFICACY: f32 = 683.0;

/// Units in which a file states punctual lights (`KHR_lights_punctual`).
///
/// Emission of surfaces is always radiance in W/(sr m^2), and so is the constant radiance of an environment.
/// [`Radiometric`](Self::Radiometric) suits files with lights in W/sr and W/m^2. It also suits files with
/// lights in cd and lx and emission in cd/m^2; their pictures are brighter by a constant factor.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum LightUnits {
    /// Units of the exporter that `asset.generator` names: [`Photometric`](Self::Photometric) for Blender's,
    /// [`Watts`](Self::Watts) for Blender's before 3.4, [`Radiometric`](Self::Radiometric) for others.
    #[default]
    Auto,
    /// Point and spot lights in W/sr, directional lights in W/m^2. Numbers in candela and lux are taken
    /// unchanged.
    Radiometric,
    /// Point and spot lights in cd, directional lights in lx; 683 lm are 1 W.
    Photometric,
    /// Point and spot lights by their flux over all directions, W (intensity = flux / (4 pi)); directional
    /// lights in W/m^2.
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
    /// Returns true if lights are converted to watts.
    pub(super) fn are_converted(self) -> bool {
        matches!(self, Self::Photometric | Self::Watts)
    }

    /// Divisor that converts the intensity of a point or spot light to W/sr.
    pub(super) fn points(self) -> f32 {
        match self {
            Self::Auto | Self::Radiometric => 1.0,
            Self::Photometric => EFFICACY,
            Self::Watts => 4.0 * std::f32::consts::PI,
        }
    }

    /// Divisor that converts the irradiance of a directional light to W/m^2.
    pub(super) fn directional(self) -> f32 {
        match self {
            Self::Auto | Self::Radiometric | Self::Watts => 1.0,
            Self::Photometric => EFFICACY,
        }
    }
}
