//! Layers of a picture, and the channels that they are told in: the EXR file and the display server have the same ones.

use std::fmt;
use std::str::FromStr;

use crate::film::FilmPixel;

/// One channel.
#[derive(Clone, Copy, Debug)]
pub struct Channel {
    /// Its name, as `OpenEXR` has it: the layer's, a dot, and the component's; without a layer the component's alone.
    pub name: &'static str,
    /// A pixel's number.
    pub value: fn(&FilmPixel) -> f32,
}

/// Radiance, in the unnamed layer: what every viewer shows.
const COLOUR: [Channel; 3] = [
    Channel { name: "R", value: |film| film.pixel.radiance[0] },
    Channel { name: "G", value: |film| film.pixel.radiance[1] },
    Channel { name: "B", value: |film| film.pixel.radiance[2] },
];
const DIRECT: [Channel; 3] = [
    Channel { name: "direct.R", value: |film| film.layers.direct[0] },
    Channel { name: "direct.G", value: |film| film.layers.direct[1] },
    Channel { name: "direct.B", value: |film| film.layers.direct[2] },
];
const INDIRECT: [Channel; 3] = [
    Channel { name: "indirect.R", value: |film| film.layers.indirect[0] },
    Channel { name: "indirect.G", value: |film| film.layers.indirect[1] },
    Channel { name: "indirect.B", value: |film| film.layers.indirect[2] },
];
const CAUSTIC: [Channel; 3] = [
    Channel { name: "caustic.R", value: |film| film.layers.caustic[0] },
    Channel { name: "caustic.G", value: |film| film.layers.caustic[1] },
    Channel { name: "caustic.B", value: |film| film.layers.caustic[2] },
];
const ALBEDO: [Channel; 3] = [
    Channel { name: "albedo.R", value: |film| film.pixel.albedo[0] },
    Channel { name: "albedo.G", value: |film| film.pixel.albedo[1] },
    Channel { name: "albedo.B", value: |film| film.pixel.albedo[2] },
];
const NORMAL: [Channel; 3] = [
    Channel { name: "N.X", value: |film| film.pixel.normal[0] },
    Channel { name: "N.Y", value: |film| film.pixel.normal[1] },
    Channel { name: "N.Z", value: |film| film.pixel.normal[2] },
];
const DEPTH: [Channel; 1] = [Channel { name: "Z", value: |film| film.pixel.depth }];
const GATHERS: [Channel; 1] = [Channel { name: "gathers.Y", value: |film| film.layers.gathers }];

/// A layer of a picture besides radiance.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Layer {
    /// Direct light ([`photoncard_shared::message::PixelLayers::direct`]), W/(sr m^2).
    Direct,
    /// Indirect light, W/(sr m^2).
    Indirect,
    /// Light through specular surfaces, W/(sr m^2). It, direct and indirect light add up to radiance.
    Caustic,
    /// Mean albedo of the surfaces seen, 0 to 1.
    Albedo,
    /// Mean of the unit normals seen.
    Normal,
    /// Mean distance along the view's axis, metres; infinite where nothing is seen.
    Depth,
    /// How many of a pixel's samples took a final gather of their own, and no interpolated irradiance.
    Gathers,
}

impl Layer {
    /// All layers.
    pub const ALL: [Self; 7] =
        [Self::Direct, Self::Indirect, Self::Caustic, Self::Albedo, Self::Normal, Self::Depth, Self::Gathers];

    /// Its name.
    pub fn name(self) -> &'static str {
        match self {
            Self::Direct => "direct",
            Self::Indirect => "indirect",
            Self::Caustic => "caustic",
            Self::Albedo => "albedo",
            Self::Normal => "N",
            Self::Depth => "Z",
            Self::Gathers => "gathers",
        }
    }

    /// Its channels.
    pub fn channels(self) -> &'static [Channel] {
        match self {
            Self::Direct => &DIRECT,
            Self::Indirect => &INDIRECT,
            Self::Caustic => &CAUSTIC,
            Self::Albedo => &ALBEDO,
            Self::Normal => &NORMAL,
            Self::Depth => &DEPTH,
            Self::Gathers => &GATHERS,
        }
    }

    /// Whether chips tell it only of frames with layers.
    fn is_of_chip(self) -> bool {
        matches!(self, Self::Direct | Self::Indirect | Self::Caustic | Self::Gathers)
    }

    /// Whether it is always stored in single precision: distances and counts go beyond what halves tell apart.
    pub fn is_always_single(self) -> bool {
        matches!(self, Self::Depth | Self::Gathers)
    }
}

/// The layers that a picture has besides radiance: an argument of `--aov`.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Layers(Vec<Layer>);

impl Default for Layers {
    /// What denoisers and compositors ask for, and what costs nothing: albedo, normals and depth.
    fn default() -> Self {
        Self(vec![Layer::Albedo, Layer::Normal, Layer::Depth])
    }
}

impl Layers {
    /// No layer.
    pub const NONE: Self = Self(Vec::new());

    /// All layers.
    pub fn all() -> Self {
        Self(Layer::ALL.into())
    }

    /// The layers, each once.
    pub fn iter(&self) -> impl Iterator<Item = Layer> {
        self.0.iter().copied()
    }

    /// Whether chips are to render a frame with layers.
    pub fn are_of_chip(&self) -> bool {
        self.iter().any(Layer::is_of_chip)
    }

    /// The channels of radiance.
    pub fn colour() -> &'static [Channel] {
        &COLOUR
    }

    /// All channels of the picture: those of radiance, then those of the layers.
    pub fn channels(&self) -> Vec<Channel> {
        COLOUR.into_iter().chain(self.iter().flat_map(Layer::channels).copied()).collect()
    }
}

impl fmt::Display for Layers {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        let names: Vec<_> = self.iter().map(Layer::name).collect();
        f.write_str(if names.is_empty() { "none".into() } else { names.join(",") }.as_str())
    }
}

impl FromStr for Layers {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        match text {
            "all" => return Ok(Self::all()),
            "none" => return Ok(Self::NONE),
            _ => {}
        }
        for name in text.split(',') {
            if !Layer::ALL.iter().any(|layer| layer.name() == name) {
                let names = Self::all();
                return Err(format!(
                    "{name:?} is no layer; give some of {names}, with commas between them, or all, or none"
                ));
            }
        }
        // Each once, in one order.
        let is_named = |layer: &Layer| text.split(',').any(|name| name == layer.name());
        Ok(Self(Layer::ALL.into_iter().filter(is_named).collect()))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lists_of_layers_are_read_as_they_are_written() {
        for (text, full) in [
            ("none", "none"),
            ("all", "direct,indirect,caustic,albedo,N,Z,gathers"),
            ("Z,direct,Z", "direct,Z"),
            ("gathers", "gathers"),
        ] {
            let layers: Layers = text.parse().unwrap();
            assert_eq!(layers.to_string(), full);
            assert_eq!(full.parse(), Ok(layers));
        }
        assert_eq!(Layers::default().to_string(), "albedo,N,Z");
        for (text, named) in
            [("", "\"\""), ("n", "\"n\""), ("Z,", "\"\""), ("direct,all", "\"all\""), ("Z ,N", "\"Z \"")]
        {
            let error = text.parse::<Layers>().unwrap_err();
            assert!(error.contains(named) && error.contains("gathers"), "{text}: {error}");
        }
    }

    #[test]
    fn only_some_layers_are_left_to_chips() {
        for (text, are_of_chip) in
            [("none", false), ("albedo,N,Z", false), ("caustic", true), ("Z,gathers", true)]
        {
            assert_eq!(text.parse::<Layers>().unwrap().are_of_chip(), are_of_chip, "{text}");
        }
    }
}
