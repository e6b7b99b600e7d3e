//! Layers of a picture (arbitrary output variables) and their channels, in `OpenEXR` files and on a display
//! server.

use std::fmt;
use std::str::FromStr;

use crate::sums::FilmPixel;

/// One channel of a picture.
#[derive(Clone, Copy, Debug)]
pub struct Channel {
    /// Name by the convention of `OpenEXR`: `layer.component`, or `component` in the unnamed layer.
    pub name: &'static str,
    /// Function that returns the channel's value in a pixel.
    pub value: fn(&FilmPixel) -> f32,
}

/// Channels of radiance. They are in the unnamed layer, which every viewer shows.
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
    /// Direct light, W/(sr m^2) ([`photoncard_shared::message::PixelLayers::direct`]).
    Direct,
    /// Indirect light, W/(sr m^2).
    Indirect,
    /// Caustics, W/(sr m^2): light from the caustic map, through specular surfaces. Direct light, indirect
    /// light and caustics add up to radiance.
    Caustic,
    /// Mean albedo of the visible surfaces, 0 to 1.
    Albedo,
    /// Mean of the visible surfaces' unit normals, in world space; 0 if no surface is visible.
    Normal,
    /// Mean distance along the view axis, metres; infinite if no surface is visible.
    Depth,
    /// Number of the pixel's samples with a final gather instead of interpolated irradiance.
    Gathers,
}

impl Layer {
    /// All layers.
    pub const ALL: [Self; 7] =
        [Self::Direct, Self::Indirect, Self::Caustic, Self::Albedo, Self::Normal, Self::Depth, Self::Gathers];

    /// Name of the layer in channel names and lists of layers.
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

    /// Channels of the layer.
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

    /// Returns whether chips send the layer only in frames that ask for it
    /// ([`photoncard_shared::message::FrameParameters::layers`]).
    fn is_of_chip(self) -> bool {
        matches!(self, Self::Direct | Self::Indirect | Self::Caustic | Self::Gathers)
    }

    /// Returns whether the layer is always stored in single precision, because distances and counts exceed
    /// the precision of halves.
    pub(crate) fn is_always_single(self) -> bool {
        matches!(self, Self::Depth | Self::Gathers)
    }
}

/// Layers of a picture besides radiance, each once, in the order of [`Layer::ALL`].
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Layers(Vec<Layer>);

impl Default for Layers {
    /// Albedo, normals and depth, which denoisers and compositors need. Chips send them in every frame.
    fn default() -> Self {
        Self(vec![Layer::Albedo, Layer::Normal, Layer::Depth])
    }
}

impl Layers {
    /// No layers.
    pub const NONE: Self = Self(Vec::new());

    /// All layers.
    pub fn all() -> Self {
        Self(Layer::ALL.into())
    }

    /// The layers, each once.
    pub fn iter(&self) -> impl Iterator<Item = Layer> {
        self.0.iter().copied()
    }

    /// Returns whether any of the layers is one that chips send only on request
    /// ([`photoncard_shared::message::FrameParameters::layers`]): direct light, indirect light, caustics or
    /// final gathers.
    pub fn are_of_chip(&self) -> bool {
        self.iter().any(Layer::is_of_chip)
    }

    /// Returns all four layers that chips send only on request if `self` contains any of them, otherwise
    /// none.
    pub fn of_chip(&self) -> Self {
        let are_of_chip = self.are_of_chip();
        Self(Layer::ALL.into_iter().filter(|layer| are_of_chip && layer.is_of_chip()).collect())
    }

    /// Channels `R G B` of radiance.
    pub fn colour() -> &'static [Channel] {
        &COLOUR
    }

    /// Channels of the picture: radiance first, then the layers.
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
        // Each layer once, in the order of [`Layer::ALL`].
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
    fn chips_render_only_some_layers() {
        for (text, are_of_chip) in
            [("none", false), ("albedo,N,Z", false), ("caustic", true), ("Z,gathers", true)]
        {
            let layers: Layers = text.parse().unwrap();
            assert_eq!(layers.are_of_chip(), are_of_chip, "{text}");
            let rendered = if are_of_chip { "direct,indirect,caustic,gathers" } else { "none" };
            assert_eq!(layers.of_chip().to_string(), rendered, "{text}");
        }
    }
}
