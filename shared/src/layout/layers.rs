//! Material properties beyond the base: normal maps, clearcoat, sheen, diffuse transmission, and textures of
//! specular reflectance and transmission.

use super::{NO_TEXTURE, Record, read_f32, read_u32, read_vector, write_f32, write_u32, write_vector};

/// Parameters and textures of the material layers above the base (glTF extensions). Each texture, except a
/// normal map, multiplies the glTF factor that it is named after.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Layers {
    /// F0 of the dielectric, not yet multiplied by `specularFactor`: `((ior - 1) / (ior + 1))^2` times
    /// `specularColorFactor`. It may exceed 1.
    pub specular: [f32; 3],
    /// Scale of x and y of the normal map (glTF `normalTexture.scale`).
    pub normal_scale: f32,
    /// Factor that multiplies the coat's reflectance, 0 to 1 (`clearcoatFactor` of
    /// `KHR_materials_clearcoat`).
    pub coat: f32,
    /// Roughness of the coat, 0 to 1.
    pub coat_roughness: f32,
    /// Scale of x and y of the coat's normal map.
    pub coat_normal_scale: f32,
    /// Colour of the sheen, 0 to 1 (`KHR_materials_sheen`).
    pub sheen: [f32; 3],
    /// Roughness of the sheen, 0 to 1.
    pub sheen_roughness: f32,
    /// Fraction of the diffusely scattered light that is transmitted to the other side, 0 to 1
    /// (`KHR_materials_diffuse_transmission`).
    pub diffuse_transmission: f32,
    /// Colour of the diffuse transmission, 0 to 1.
    pub diffuse_transmission_colour: [f32; 3],
    /// Indices of the textures, in the order of [`LayerTexture::ALL`]; [`NO_TEXTURE`] if absent.
    pub textures: [u16; TEXTURE_COUNT],
}

/// A texture of [`Layers`]. Each variant states the glTF factor that the texture multiplies, and the channels
/// that it reads.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u8)]
pub enum LayerTexture {
    /// Tangent-space normal `2 c - 1` of the linear colour `c`: red, green and blue.
    Normal,
    /// `specularFactor`: the alpha channel.
    Specular,
    /// `specularColorFactor`: red, green and blue, sRGB.
    SpecularColour,
    /// `clearcoatFactor`: the red channel.
    Coat,
    /// `clearcoatRoughnessFactor`: the green channel.
    CoatRoughness,
    /// Tangent-space normal of the coat, in the encoding of [`Self::Normal`].
    CoatNormal,
    /// Colour of the sheen: red, green and blue, sRGB.
    Sheen,
    /// `sheenRoughnessFactor`: the alpha channel.
    SheenRoughness,
    /// `transmissionFactor`: the red channel.
    Transmission,
    /// `diffuseTransmissionFactor`: the alpha channel.
    DiffuseTransmission,
    /// `diffuseTransmissionColorFactor`: red, green and blue, sRGB.
    DiffuseTransmissionColour,
}

impl LayerTexture {
    /// All textures, in the order of `Layers::textures`.
    pub const ALL: [Self; 11] = [
        Self::Normal,
        Self::Specular,
        Self::SpecularColour,
        Self::Coat,
        Self::CoatRoughness,
        Self::CoatNormal,
        Self::Sheen,
        Self::SheenRoughness,
        Self::Transmission,
        Self::DiffuseTransmission,
        Self::DiffuseTransmissionColour,
    ];
}

const TEXTURE_COUNT: usize = LayerTexture::ALL.len();

impl Record for Layers {
    const BYTES: usize = 128;
}

const TEXTURES: usize = 64;

impl Layers {
    /// Returns true if there is neither a coat nor sheen nor diffuse transmission: the parameters are those
    /// of the base, or its normal map.
    pub fn are_of_base(&self) -> bool {
        self.coat <= 0.0 && self.sheen == [0.0; 3] && self.diffuse_transmission <= 0.0
    }

    /// Layers of a material that has only its base.
    pub const NONE: Self = Self {
        specular: [0.0; 3],
        normal_scale: 1.0,
        coat: 0.0,
        coat_roughness: 0.0,
        coat_normal_scale: 1.0,
        sheen: [0.0; 3],
        sheen_roughness: 0.0,
        diffuse_transmission: 0.0,
        diffuse_transmission_colour: [1.0; 3],
        textures: [NO_TEXTURE; TEXTURE_COUNT],
    };

    /// Index of a texture; [`NO_TEXTURE`] if absent.
    pub fn texture(&self, texture: LayerTexture) -> u16 {
        self.textures.get(texture as usize).copied().unwrap_or(NO_TEXTURE)
    }

    /// Reads a record.
    pub fn read(bytes: &[u8; Self::BYTES]) -> Self {
        let texture =
            |index: usize| (read_u32(bytes, TEXTURES + (index & !1) * 2) >> (16 * (index & 1))) as u16;
        Self {
            specular: read_vector(bytes, 0),
            normal_scale: read_f32(bytes, 12),
            coat: read_f32(bytes, 16),
            coat_roughness: read_f32(bytes, 20),
            coat_normal_scale: read_f32(bytes, 24),
            sheen: read_vector(bytes, 28),
            sheen_roughness: read_f32(bytes, 40),
            diffuse_transmission: read_f32(bytes, 44),
            diffuse_transmission_colour: read_vector(bytes, 48),
            textures: core::array::from_fn(texture),
        }
    }

    /// The record's bytes.
    pub fn to_bytes(&self) -> [u8; Self::BYTES] {
        let mut bytes = [0; Self::BYTES];
        write_vector(&mut bytes, 0, self.specular);
        write_f32(&mut bytes, 12, self.normal_scale);
        write_f32(&mut bytes, 16, self.coat);
        write_f32(&mut bytes, 20, self.coat_roughness);
        write_f32(&mut bytes, 24, self.coat_normal_scale);
        write_vector(&mut bytes, 28, self.sheen);
        write_f32(&mut bytes, 40, self.sheen_roughness);
        write_f32(&mut bytes, 44, self.diffuse_transmission);
        write_vector(&mut bytes, 48, self.diffuse_transmission_colour);
        for (index, pair) in self.textures.chunks(2).enumerate() {
            let [low, high] = [0, 1].map(|slot| pair.get(slot).copied().unwrap_or(NO_TEXTURE));
            write_u32(&mut bytes, TEXTURES + 4 * index, u32::from(low) | u32::from(high) << 16);
        }
        bytes
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn layers_survive_their_bytes() {
        let layers = Layers {
            specular: [1.5, 2.0, 0.1],
            normal_scale: -0.5,
            coat: 0.25,
            coat_roughness: 0.125,
            coat_normal_scale: 2.0,
            sheen: [0.1, 0.2, 0.3],
            sheen_roughness: 0.75,
            diffuse_transmission: 0.5,
            diffuse_transmission_colour: [0.7, 0.8, 0.9],
            textures: core::array::from_fn(|index| 1000 + index as u16),
        };
        assert_eq!(Layers::read(&layers.to_bytes()), layers);
        assert_eq!(Layers::read(&Layers::NONE.to_bytes()), Layers::NONE);
    }
}
