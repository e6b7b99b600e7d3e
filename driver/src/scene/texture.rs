//! Images, and textures that map them to surfaces.

/// Maximum width and height of an image or an environment, texels.
pub const MAX_SIDE: u32 = 16_384;

/// Maximum number of texels of all images of a scene together, and of an environment.
pub const MAX_TEXELS: u64 = 1 << 28;

/// Mapping of an image to surfaces: transform of coordinates, wrap modes and filter.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Texture {
    /// Index into [`Scene::images`](super::Scene::images).
    pub image: u32,
    /// Index of the set of texture coordinates in [`VertexAttributes`](super::VertexAttributes): 0 or 1.
    pub set: u32,
    /// Wrap modes of u and v.
    pub wrap: [Wrap; 2],
    /// True for the nearest texel (`magFilter` `NEAREST`), false for bilinear interpolation.
    pub nearest: bool,
    /// Rows of the matrix M of `KHR_texture_transform`: coordinates are M (u, v) + offset. The identity without it.
    pub matrix: [[f32; 2]; 2],
    /// Offset of `KHR_texture_transform`, in widths and heights of the image.
    pub offset: [f32; 2],
}

impl Texture {
    /// A texture of an image by the first set of coordinates, untransformed, repeated and bilinear.
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

/// Wrap mode of texture coordinates beyond the image's border.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Wrap {
    /// The image repeated (`REPEAT`).
    Repeat,
    /// The image repeated, every other one mirrored (`MIRRORED_REPEAT`).
    Mirror,
    /// The texels at the border (`CLAMP_TO_EDGE`).
    Clamp,
}

/// The texels of an image.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Image {
    /// Name in the scene's file, or of the image's file, or `image N`.
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
}

/// Encoding of red, green and blue of a texel. Alpha is always linear.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Encoding {
    /// sRGB transfer function (IEC 61966-2-1), for colours.
    Srgb,
    /// Linear, for roughness and metalness.
    Linear,
    /// Linear, of nine bits a channel with a shared exponent (OpenGL's `RGB9_E5`), without alpha: for
    /// emission of more than 8 bits.
    SharedExponent,
}
