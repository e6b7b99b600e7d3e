//! Channels of a picture: a name and a number of each pixel. The EXR file and the display server tell the same ones.

use crate::film::PixelValue;

/// One channel.
#[derive(Clone, Copy, Debug)]
pub struct Channel {
    /// Its name, as `OpenEXR` has it: the layer's, a dot, and the component's; without a layer the component's alone.
    pub name: &'static str,
    /// A pixel's number.
    pub value: fn(&PixelValue) -> f32,
}

/// Radiance, in the unnamed layer: what every viewer shows.
pub const COLOUR: [Channel; 3] = [
    Channel { name: "R", value: |pixel| pixel.radiance[0] },
    Channel { name: "G", value: |pixel| pixel.radiance[1] },
    Channel { name: "B", value: |pixel| pixel.radiance[2] },
];
