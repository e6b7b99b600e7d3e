//! The pixels of a tile, as the wire carries them.

/// A pixel of a tile: ten `f32`, little-endian.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Pixel {
    /// Radiance towards the eye, W/(sr m^2).
    pub radiance: [f32; 3],
    /// Mean albedo of the surfaces seen, 0 to 1 a channel; 0 of what sees none.
    pub albedo: [f32; 3],
    /// Mean of the unit normals seen, in world space, on the side of the eye; 0 of what sees none.
    pub normal: [f32; 3],
    /// Mean distance along the view's axis of the surfaces seen, metres; infinite where none is.
    pub depth: f32,
}

/// What a pixel's radiance consists of, and what it took: ten `f32`, little-endian.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct PixelLayers {
    /// Emission that is seen, light of emitters by shadow rays, and emission that gather rays of the pixel meet, W/(sr m^2).
    pub direct: [f32; 3],
    /// Light that photons bring at the ends of gather rays, and interpolated irradiance, W/(sr m^2). Emission that the rays of an
    /// irradiance record met is a part of that irradiance.
    pub indirect: [f32; 3],
    /// Light that comes through specular surfaces, W/(sr m^2).
    pub caustic: [f32; 3],
    /// How many of the pixel's samples took a final gather of their own, and no interpolated irradiance.
    pub gathers: f32,
}

/// A pixel as the wire carries it: [`Pixel`], and behind it [`PixelLayers`] if the frame has layers.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct PixelRecord {
    /// What every picture has.
    pub pixel: Pixel,
    /// What a picture with layers has besides.
    pub layers: Option<PixelLayers>,
}

/// Bytes of one [`Pixel`].
pub const PIXEL_BYTES: usize = 40;
/// Bytes of one [`PixelLayers`].
pub const LAYER_BYTES: usize = 40;
/// Bytes of pixels that one [`super::Reply::Pixels`] may carry.
pub const PIXELS_BYTES: usize = 25 * PIXEL_BYTES;

/// Bytes of one [`PixelRecord`].
pub const fn record_bytes(layers: bool) -> usize {
    if layers { PIXEL_BYTES + LAYER_BYTES } else { PIXEL_BYTES }
}

/// Reads ten numbers.
fn read_numbers(bytes: &[u8; 40]) -> ([[f32; 3]; 3], f32) {
    let word = |index: usize| bytes.as_chunks().0.get(index).map_or(0.0, |w| f32::from_le_bytes(*w));
    let vector = |first: usize| [word(first), word(first + 1), word(first + 2)];
    ([vector(0), vector(3), vector(6)], word(9))
}

/// The bytes of ten numbers.
fn number_bytes(vectors: [[f32; 3]; 3], last: f32) -> [u8; 40] {
    let mut bytes = [0; 40];
    let values = vectors.into_iter().flatten().chain([last]);
    for (word, value) in bytes.as_chunks_mut().0.iter_mut().zip(values) {
        *word = value.to_le_bytes();
    }
    bytes
}

impl Pixel {
    /// Reads a record.
    pub fn read(bytes: &[u8; PIXEL_BYTES]) -> Self {
        let ([radiance, albedo, normal], depth) = read_numbers(bytes);
        Self { radiance, albedo, normal, depth }
    }

    /// The record's bytes.
    pub fn to_bytes(&self) -> [u8; PIXEL_BYTES] {
        number_bytes([self.radiance, self.albedo, self.normal], self.depth)
    }
}

impl PixelLayers {
    /// Reads a record.
    pub fn read(bytes: &[u8; LAYER_BYTES]) -> Self {
        let ([direct, indirect, caustic], gathers) = read_numbers(bytes);
        Self { direct, indirect, caustic, gathers }
    }

    /// The record's bytes.
    pub fn to_bytes(&self) -> [u8; LAYER_BYTES] {
        number_bytes([self.direct, self.indirect, self.caustic], self.gathers)
    }
}

impl PixelRecord {
    /// Reads a record of [`record_bytes`]; `None` of any other length.
    pub fn read(bytes: &[u8]) -> Option<Self> {
        let (pixel, rest) = bytes.split_first_chunk()?;
        let layers = if rest.is_empty() { None } else { Some(PixelLayers::read(rest.try_into().ok()?)) };
        Some(Self { pixel: Pixel::read(pixel), layers })
    }
}
