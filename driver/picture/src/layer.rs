//! Layers of a picture (arbitrary output variables) and their channels, in `OpenEXR` files and on a display
//! server.

use std::fmt;
use std::str::FromStr;

use photoncard_shared::message::PixelForm;

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
const ALPHA: [Channel; 1] = [Channel { name: "alpha.Y", value: |film| film.alpha }];
const POSITION: [Channel; 3] = [
    Channel { name: "P.X", value: |film| film.position[0] },
    Channel { name: "P.Y", value: |film| film.position[1] },
    Channel { name: "P.Z", value: |film| film.position[2] },
];
/// Channel of alpha in the unnamed layer of a transparent picture.
pub(crate) const COLOUR_ALPHA: Channel = Channel { name: "A", value: |film| film.alpha };
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
    /// Fraction of the pixel that surfaces cover, 0 to 1. Glass in front of the environment covers it.
    Alpha,
    /// Mean position, in the coordinates of the scene's file, metres, of the first surfaces that the eye rays
    /// hit; 0 if no surface is visible.
    Position,
    /// Coverage by object, by the names of nodes, as [Cryptomatte](crate::cryptomatte).
    Object,
    /// Coverage by material, by the materials' names, as [Cryptomatte](crate::cryptomatte).
    Material,
    /// Illuminance of the first surfaces that the eye rays meet, lx. It takes an irradiance frame of its own.
    Illuminance,
}

impl Layer {
    /// All layers.
    pub const ALL: [Self; 12] = [
        Self::Direct,
        Self::Indirect,
        Self::Caustic,
        Self::Albedo,
        Self::Normal,
        Self::Depth,
        Self::Gathers,
        Self::Alpha,
        Self::Position,
        Self::Object,
        Self::Material,
        Self::Illuminance,
    ];

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
            Self::Alpha => "alpha",
            Self::Position => "position",
            Self::Object => "object",
            Self::Material => "material",
            Self::Illuminance => "illuminance",
        }
    }

    /// Channels of the layer; none for the mattes and illuminance, which are not values of a [`FilmPixel`]
    /// ([`crate::cryptomatte::Matte`], [`crate::exr::Content`]).
    pub fn channels(self) -> &'static [Channel] {
        match self {
            Self::Direct => &DIRECT,
            Self::Indirect => &INDIRECT,
            Self::Caustic => &CAUSTIC,
            Self::Albedo => &ALBEDO,
            Self::Normal => &NORMAL,
            Self::Depth => &DEPTH,
            Self::Gathers => &GATHERS,
            Self::Alpha => &ALPHA,
            Self::Position => &POSITION,
            Self::Object | Self::Material | Self::Illuminance => &[],
        }
    }

    /// Returns whether chips send what the layer needs only on request.
    pub fn is_of_chip(self) -> bool {
        self.form() != PixelForm::PLAIN
    }

    /// Optional contents of pixels that the layer needs.
    fn form(self) -> PixelForm {
        let plain = PixelForm::PLAIN;
        match self {
            Self::Direct | Self::Indirect | Self::Caustic | Self::Gathers => PixelForm::LAYERED,
            Self::Albedo | Self::Normal | Self::Depth | Self::Illuminance => plain,
            Self::Alpha => PixelForm { coverage: true, ..plain },
            Self::Position => PixelForm { position: true, ..plain },
            Self::Object | Self::Material => PixelForm { coverage: true, identities: true, ..plain },
        }
    }

    /// Returns whether the layer is always stored in single precision, because distances and counts exceed
    /// the precision of halves.
    pub(crate) fn is_always_single(self) -> bool {
        matches!(self, Self::Depth | Self::Gathers | Self::Position)
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

    /// The layers, and `more`.
    #[must_use]
    pub fn with(&self, more: impl IntoIterator<Item = Layer>) -> Self {
        self.and(&Self(more.into_iter().collect()))
    }

    /// All layers of one frame: without illuminance.
    pub fn all() -> Self {
        Self(Layer::ALL.into()).of_one_frame()
    }

    /// The layers, each once.
    pub fn iter(&self) -> impl Iterator<Item = Layer> {
        self.0.iter().copied()
    }

    /// The layers, and those of `more`.
    #[must_use]
    pub fn and(&self, more: &Self) -> Self {
        let either = |layer: &Layer| self.0.contains(layer) || more.0.contains(layer);
        Self(Layer::ALL.into_iter().filter(either).collect())
    }

    /// All layers of one frame but the mattes.
    pub fn without_mattes() -> Self {
        Self(Self::all().iter().filter(|layer| !layer.form().identities).collect())
    }

    /// Returns whether a layer is illuminance.
    pub fn have_illuminance(&self) -> bool {
        self.0.contains(&Layer::Illuminance)
    }

    /// The layers without illuminance.
    #[must_use]
    pub fn of_one_frame(&self) -> Self {
        Self(self.iter().filter(|layer| *layer != Layer::Illuminance).collect())
    }

    /// Optional contents of pixels that the layers need: those that chips send only on request.
    pub fn form(&self) -> PixelForm {
        self.iter().map(Layer::form).fold(PixelForm::PLAIN, PixelForm::union)
    }

    /// Returns whether the layers separate the light: whether any of them is direct light, indirect light,
    /// caustics or final gathers ([`photoncard_shared::message::FrameParameters::layers`]).
    pub fn separate_light(&self) -> bool {
        self.form().layers
    }

    /// Returns all layers for which chips send the optional contents that `self` needs, except those that
    /// chips always send. Pictures whose layers have the same result have the same sums.
    pub fn of_chip(&self) -> Self {
        let form = self.form();
        let is_sent = |layer: &Layer| {
            let needed = layer.form();
            layer.is_of_chip() && needed.union(form) == form
        };
        Self(Layer::ALL.into_iter().filter(is_sent).collect())
    }

    /// Returns whether any layer is a matte, for which the card image must have identities.
    pub fn have_mattes(&self) -> bool {
        self.form().identities
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
                let names = Self(Layer::ALL.into());
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
            ("all", "direct,indirect,caustic,albedo,N,Z,gathers,alpha,position,object,material"),
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
        let light = "direct,indirect,caustic,gathers";
        for (text, rendered) in [
            ("none", "none"),
            ("albedo,N,Z", "none"),
            ("caustic", light),
            ("Z,gathers", light),
            ("alpha", "alpha"),
            ("position,N", "position"),
            ("object", "alpha,object,material"),
            ("material,direct", "direct,indirect,caustic,gathers,alpha,object,material"),
        ] {
            let layers: Layers = text.parse().unwrap();
            assert_eq!(layers.separate_light(), rendered.contains("direct"), "{text}");
            assert_eq!(layers.have_mattes(), rendered.contains("material"), "{text}");
            assert_eq!(layers.of_chip().to_string(), rendered, "{text}");
            assert_eq!(layers.of_chip().form(), layers.form(), "{text}");
        }
    }
}
