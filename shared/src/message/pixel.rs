//! Pixels of a tile in the wire format.

/// A pixel of a tile: ten `f32`, little-endian.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Pixel {
    /// Radiance towards the eye, W/(sr m^2).
    pub radiance: [f32; 3],
    /// Mean albedo of the visible surfaces, 0 to 1 a channel; 0 if no sample sees a surface.
    pub albedo: [f32; 3],
    /// Mean of the visible surfaces' unit normals, in world space, on the side of the eye; 0 if no sample sees a
    /// surface.
    pub normal: [f32; 3],
    /// Mean depth of the visible surfaces, metres along the view axis; infinite if no sample sees a surface.
    pub depth: f32,
}

/// Layers of a pixel: the components of its radiance, and its number of final gathers; ten `f32`, little-endian.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct PixelLayers {
    /// Direct light, W/(sr m^2): visible emission, and light of emitters by shadow rays and by the pixel's own gather
    /// rays.
    pub direct: [f32; 3],
    /// Indirect light, W/(sr m^2): radiance estimates at the ends of gather rays, and interpolated irradiance, which
    /// includes the emission met by the irradiance records' rays.
    pub indirect: [f32; 3],
    /// Caustics, W/(sr m^2): radiance estimates in the caustic map.
    pub caustic: [f32; 3],
    /// Number of the pixel's samples with a final gather of their own instead of interpolated irradiance.
    pub gathers: f32,
}

/// A pixel in the wire format: [`Pixel`], followed by [`PixelLayers`] if the frame has layers.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct PixelRecord {
    /// Radiance, albedo, normal and depth.
    pub pixel: Pixel,
    /// Layers; `None` in a picture without layers.
    pub layers: Option<PixelLayers>,
}

/// Bytes of one [`Pixel`].
pub const PIXEL_BYTES: usize = 40;
/// Bytes of one [`PixelLayers`].
pub const LAYER_BYTES: usize = 40;
/// Maximum length of the pixels in one [`super::Reply::Pixels`], bytes.
pub const PIXELS_BYTES: usize = 25 * PIXEL_BYTES;

/// Bytes of one [`PixelRecord`] without or with layers.
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
    /// Reads a record; `None` if `bytes` is not [`record_bytes`] long.
    pub fn read(bytes: &[u8]) -> Option<Self> {
        let (pixel, rest) = bytes.split_first_chunk()?;
        let layers = if rest.is_empty() { None } else { Some(PixelLayers::read(rest.try_into().ok()?)) };
        Some(Self { pixel: Pixel::read(pixel), layers })
    }
}
