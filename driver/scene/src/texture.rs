//! Images, and textures that map them to surfaces.

use photoncard_shared::layout::TexelFormat;

/// Maximum width and height of an image or an environment, texels.
pub const MAX_SIDE: u32 = 16_384;

/// Mapping of an image to surfaces: transform of coordinates, wrap modes and filter.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Texture {
    /// Index into [`Scene::images`](super::SceneContents::images).
    pub image: u32,
    /// Index of the set of texture coordinates in [`VertexAttributes`](super::VertexAttributes): 0 or 1.
    pub set: u32,
    /// Wrap modes of u and v.
    pub wrap: [Wrap; 2],
    /// True for the nearest texel (`magFilter` `NEAREST`), false for bilinear interpolation.
    pub nearest: bool,
    /// Rows of the matrix M of `KHR_texture_transform`, the identity without the extension; the image is
    /// sampled at `M (u, v) + offset`.
    pub matrix: [[f32; 2]; 2],
    /// Offset of `KHR_texture_transform`, in widths and heights of the image.
    pub offset: [f32; 2],
}

impl Texture {
    /// Creates a bilinear, repeated, untransformed texture with the first set of coordinates.
    pub fn new(image: u32) -> Self {
        Self {
            image,
            set: 0,
            wrap: [Wrap::Repeat; 2],
            nearest: false,
            matrix: [[1.0, 0.0], [0.0, 1.0]],
            offset: [0.0; 2],
        }
    }
}

/// Wrap mode: the content of a texture at coordinates outside 0 to 1.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Wrap {
    /// The image repeated (`REPEAT`).
    Repeat,
    /// The image repeated, every other one mirrored (`MIRRORED_REPEAT`).
    Mirror,
    /// The texels at the border (`CLAMP_TO_EDGE`).
    Clamp,
}

/// Image as decoded texels.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Image {
    /// Name in the scene's file, name of the image's file, or `image N`.
    pub name: String,
    /// Width, texels.
    pub width: u32,
    /// Height, texels.
    pub height: u32,
    /// RGBA texels, rows from the top.
    pub texels: Vec<[u8; 4]>,
    /// Encoding of red, green and blue.
    pub encoding: Encoding,
}

impl Image {
    /// Size of the texels, bytes.
    pub fn bytes(&self) -> u64 {
        size_of_val(&self.texels[..]) as u64
    }

    /// Minimum of the encoded green channel, 0 to 1; 1 without texels.
    pub(crate) fn minimum_green(&self) -> f32 {
        let codes = self.texels.iter();
        match self.encoding {
            Encoding::LinearPair => {
                let minimum = codes.map(|&[.., low, high]| u16::from_le_bytes([low, high])).min();
                f32::from(minimum.unwrap_or(u16::MAX)) / 65_535.0
            }
            _ => f32::from(codes.map(|&[_, green, ..]| green).min().unwrap_or(u8::MAX)) / 255.0,
        }
    }
}

/// Encoding of the red, green and blue channel of texels. Alpha, where it is stored, is linear.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Encoding {
    /// sRGB transfer function (IEC 61966-2-1), for colours.
    Srgb,
    /// Linear, for roughness and metalness.
    Linear,
    /// Linear, nine bits per channel with a shared exponent (OpenGL's `RGB9_E5`), without alpha, for emission
    /// of more than 8 bits per channel.
    SharedExponent,
    /// Two linear 16-bit channels, little-endian, without alpha. The first is read as red and as blue, the
    /// second as green.
    LinearPair,
    /// x and y of a normal map, linear, 16 bits each, little-endian; z follows from the unit length. Without
    /// alpha.
    NormalPair,
}

impl From<Encoding> for TexelFormat {
    fn from(encoding: Encoding) -> Self {
        match encoding {
            Encoding::Srgb => Self::Srgb,
            Encoding::Linear => Self::Linear,
            Encoding::SharedExponent => Self::SharedExponent,
            Encoding::LinearPair => Self::LinearPair,
            Encoding::NormalPair => Self::NormalPair,
        }
    }
}

/// Encodes the nearest `RGB9_E5` texel: nine bits per channel with a shared exponent (OpenGL's
/// `EXT_texture_shared_exponent`).
pub fn shared_exponent(texel: [f32; 3]) -> [u8; 4] {
    const GREATEST: f32 = 65408.0;
    let [red, green, blue] = texel.map(|channel| channel.clamp(0.0, GREATEST));
    let greatest = red.max(green).max(blue);
    let exponent = if greatest > 0.0 { libm::ilogbf(greatest).max(-16) + 16 } else { 0 };
    let mantissa = |channel: f32, exponent: i32| libm::ldexpf(channel, 24 - exponent).round() as u32;
    // A mantissa that rounds up to 512 takes the next exponent.
    let exponent = if mantissa(greatest, exponent) > 511 { exponent + 1 } else { exponent };
    let [red, green, blue] = [red, green, blue].map(|channel| mantissa(channel, exponent).min(511));
    (red | green << 9 | blue << 18 | (exponent as u32) << 27).to_le_bytes()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn decode(texel: [u8; 4]) -> [f32; 3] {
        let bits = u32::from_le_bytes(texel);
        [0, 9, 18].map(|shift| libm::ldexpf((bits >> shift & 511) as f32, (bits >> 27) as i32 - 24))
    }

    #[test]
    fn texels_keep_eight_bits_of_their_greatest_channel() {
        for value in [1e-7_f32, 1e-4, 0.3, 0.999, 1.0, 511.5, 1023.0, 40_000.0, 65_408.0] {
            let [red, green, blue] = decode(shared_exponent([value, value * 0.25, 0.0]));
            let step = (value / 256.0).max(1.0 / 16_777_216.0);
            assert!((red - value).abs() <= 0.5 * step, "{value}: {red}");
            assert!((green - value * 0.25).abs() <= 0.5 * step, "{value}: {green}");
            assert_eq!(blue, 0.0);
        }
        assert_eq!(decode(shared_exponent([0.0; 3])), [0.0; 3]);
    }
}
