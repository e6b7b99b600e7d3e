//! Images, and how they lie on surfaces.

/// The most texels of an image, or of an environment, a side.
pub const MAX_SIDE: u32 = 16_384;

/// The most texels of all images of a scene together, and of an environment.
pub const MAX_TEXELS: u64 = 1 << 28;

/// How an image lies on surfaces.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Texture {
    /// Index into [`Scene::images`](super::Scene::images).
    pub image: u32,
    /// Which of the texture coordinates of [`Attributes`](super::Attributes) it takes: 0 or 1.
    pub set: u32,
    /// What lies beyond the image's borders, to the sides and above and below.
    pub wrap: [Wrap; 2],
    /// Whether the nearest texel is taken (`magFilter` `NEAREST`) instead of a bilinear mean of four.
    pub nearest: bool,
    /// Rows of the matrix m of `KHR_texture_transform`: coordinates are m (u, v) + offset. The identity without it.
    pub matrix: [[f32; 2]; 2],
    /// The offset of `KHR_texture_transform`, in images.
    pub offset: [f32; 2],
}

impl Texture {
    /// The whole image once from 0 to 1, repeated, bilinear, by the first set of coordinates.
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

/// What lies beyond an image's border.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Wrap {
    /// The image again.
    Repeat,
    /// The image mirrored, then again, by turns.
    Mirror,
    /// The texel at the border.
    Clamp,
}

/// The texels of an image.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Image {
    /// The name in the file, or its file's, or `image N`.
    pub name: String,
    /// Texels of a row.
    pub width: u32,
    /// Rows.
    pub height: u32,
    /// RGBA, rows from the top.
    pub texels: Vec<[u8; 4]>,
    /// What red, green and blue stand for.
    pub encoding: Encoding,
}

impl Image {
    /// Bytes of its texels.
    pub fn bytes(&self) -> u64 {
        size_of_val(&self.texels[..]) as u64
    }
}

/// What red, green and blue of a texel stand for. Alpha is always linear.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Encoding {
    /// Values of IEC 61966-2-1: colours.
    Srgb,
    /// Proportional: roughness, metalness.
    Linear,
}
