//! Materials: reflectance, transmittance and emission of surfaces.

use crate::budget::MAX_LIGHT_GROUPS;

use super::{Record, read_f32, read_u32, read_vector, write_f32, write_u32, write_vector};

/// Flag of [`Material::flags`]: the back reflects and emits like the front (glTF `doubleSided`).
pub const DOUBLE_SIDED: u32 = 1;
/// Flag of [`Material::flags`] for [`Reflectance::Glass`]: a thin wall, which transmits light without
/// refraction. A glTF material is thin-walled if it has no `KHR_materials_volume`, or one of thickness 0.
pub const THIN_WALLED: u32 = 2;
/// Flag of [`Material::flags`]: some triangles of the material have [`super::Attributes`].
pub const HAS_ATTRIBUTES: u32 = 4;

/// Flag of [`Material::flags`]: the GGX lobe is narrow at some texel. Reflection by this lobe is sampled with
/// rays, not estimated from photons.
pub const NARROW_LOBE: u32 = 8;

/// Value of `a = roughness^2` below which a GGX lobe is narrow. At this value half of the lobe's light is
/// within 28 degrees of the mirror direction, an eighth of the hemisphere. A material whose lobe is narrow at
/// some texel has [`NARROW_LOBE`] at all texels, because photons are stored for the lobe everywhere on a
/// surface or nowhere.
pub const NARROW_ALPHA: f32 = 0.25;

/// Flag of [`Material::flags`]: glTF's `alphaMode` is `BLEND`. Coverage, the fraction of the surface that is
/// present, is then alpha times [`Material::cutoff`].
pub const BLENDS: u32 = 64;

/// Flag of [`Material::flags`]: the GGX lobe includes multiple scattering between microfacets (energy
/// compensation).
pub const COMPENSATED: u32 = 128;

/// Flag of [`Material::flags`] for [`Reflectance::Glass`]: a face of a pane, a slab with parallel faces whose
/// thickness is small beside its extents. The face where light enters has the reflectance and transmittance
/// of the whole slab. The face where light leaves transmits it unchanged.
pub const PANE: u32 = 256;

/// Flag of [`Material::flags`]: eye rays pass the surface.
pub const HIDDEN: u32 = 1 << 11;

/// Flag of [`Material::flags`]: a lamp without substance. Shadow rays and photons pass it, and so does any
/// ray from behind. Rays that gather radiance meet its front.
pub const LAMP: u32 = 1 << 12;

const FLAGS: u32 =
    DOUBLE_SIDED | THIN_WALLED | HAS_ATTRIBUTES | NARROW_LOBE | BLENDS | COMPENSATED | PANE | HIDDEN | LAMP;

const KIND_SHIFT: u32 = 4;
const KIND_BITS: u32 = 2;
/// Position, in the flags word, of the lowest bit of the light group.
const GROUP_SHIFT: u32 = 9;
const GROUP_MASK: u32 = MAX_LIGHT_GROUPS as u32 - 1;
/// Position, in the flags word, of the lowest bit of the layers field. The field holds the index of the
/// [`super::Layers`] plus 1; 0 stands for no layers.
const LAYERS_SHIFT: u32 = 13;
const METALLIC_ROUGHNESS: u32 = 1;
const GLASS: u32 = 2;

/// Maximum exponent `n` of a Phong lobe. At this exponent `cos^n alpha` falls to 1/2 at 0.7 degrees: the lobe
/// is narrower than the rounding error of photon directions, 1 degree.
pub const MAX_PHONG_EXPONENT: f32 = 10_000.0;

/// Index that marks an absent texture.
pub const NO_TEXTURE: u16 = u16::MAX;

/// A material.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Material {
    /// Model of reflection and transmission.
    pub reflectance: Reflectance,
    /// Emitted radiance, W/(sr m^2), to be multiplied by the emissive texture.
    pub emission: [f32; 3],
    /// Combination of [`DOUBLE_SIDED`], [`THIN_WALLED`], [`HAS_ATTRIBUTES`], [`NARROW_LOBE`], [`BLENDS`],
    /// [`COMPENSATED`], [`PANE`], [`HIDDEN`] and [`LAMP`].
    pub flags: u32,
    /// glTF's `alphaCutoff`: a triangle with cut-outs is absent where alpha, the product of base texture and
    /// vertex alpha, is below `cutoff`. With [`BLENDS`], coverage is `cutoff` times alpha.
    pub cutoff: f32,
    /// Indices of three textures: base colour or diffuse albedo; metallic-roughness, with roughness in green
    /// and metalness in blue; emission. [`NO_TEXTURE`] if absent.
    pub textures: [u16; 3],
    /// Index of the material's [`super::Layers`], below 2^19 - 1; `None` without layers.
    pub layers: Option<u32>,
    /// Light group of the emission, below [`MAX_LIGHT_GROUPS`].
    pub light_group: u8,
}

/// Model of reflection and transmission, with its parameters.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Reflectance {
    /// A Lambertian component plus a Phong lobe.
    Phong {
        /// Lambertian albedo, to be multiplied by the base texture.
        diffuse: [f32; 3],
        /// Albedo of the Phong lobe.
        specular: [f32; 3],
        /// Exponent of the Phong lobe, 0 to [`MAX_PHONG_EXPONENT`].
        exponent: f32,
    },
    /// glTF's metallic-roughness model.
    MetallicRoughness {
        /// Base colour: albedo of the dielectric, F0 of the metal; to be multiplied by the base texture.
        base: [f32; 3],
        /// F0 of the dielectric: its reflectance at normal incidence.
        dielectric: [f32; 3],
        /// F90 of the dielectric: its reflectance at grazing incidence, 0 to 1.
        grazing: f32,
        /// Metalness, 0 to 1.
        metallic: f32,
        /// Roughness, 0 (perfectly specular) to 1.
        roughness: f32,
    },
    /// A transparent dielectric (glTF `KHR_materials_transmission`).
    Glass {
        /// Transmission colour, to be multiplied by the base texture.
        base: [f32; 3],
        /// Absorption coefficient inside the solid, 1/m. For a [`PANE`] it is the optical depth, the
        /// coefficient times the thickness.
        absorption: [f32; 3],
        /// Fraction transmitted, 0 to 1, of the light left after Fresnel reflection. A Lambertian base with
        /// the base colour reflects the rest.
        transmission: f32,
        /// Index of refraction.
        ior: f32,
        /// Factor that multiplies the dielectric's Fresnel reflectance, 0 to 1 in steps of 1/255
        /// (`specularFactor` of `KHR_materials_specular`).
        specular: f32,
        /// Metalness, 0 to 1; metal transmits nothing.
        metallic: f32,
        /// Roughness, 0 (perfectly specular) to 1 in steps of 1/255.
        roughness: f32,
    },
}

impl Record for Material {
    const BYTES: usize = 64;
}

impl Material {
    /// Reads a record.
    #[inline(always)]
    pub fn read(bytes: &[u8; Self::BYTES]) -> Self {
        let kind = read_u32(bytes, 44);
        let [first, second] = [read_vector(bytes, 0), read_vector(bytes, 12)];
        let [a, b] = [read_f32(bytes, 24), read_f32(bytes, 28)];
        let textures = [read_u32(bytes, 52), read_u32(bytes, 56)];
        let share = |shift: u32| (textures[1] >> shift & 0xff) as f32 / 255.0;
        Self {
            reflectance: match kind >> KIND_SHIFT & ((1 << KIND_BITS) - 1) {
                METALLIC_ROUGHNESS => Reflectance::MetallicRoughness {
                    base: first,
                    dielectric: second,
                    grazing: read_f32(bytes, 60),
                    metallic: a,
                    roughness: b,
                },
                GLASS => Reflectance::Glass {
                    base: first,
                    absorption: second,
                    transmission: a,
                    ior: b,
                    specular: share(16),
                    metallic: read_f32(bytes, 60),
                    roughness: share(24),
                },
                _ => Reflectance::Phong { diffuse: first, specular: second, exponent: a },
            },
            emission: read_vector(bytes, 32),
            flags: kind & FLAGS,
            cutoff: read_f32(bytes, 48),
            textures: [textures[0] as u16, (textures[0] >> 16) as u16, textures[1] as u16],
            layers: (kind >> LAYERS_SHIFT).checked_sub(1),
            light_group: (kind >> GROUP_SHIFT & GROUP_MASK) as u8,
        }
    }

    /// The record's bytes.
    pub fn to_bytes(&self) -> [u8; Self::BYTES] {
        let mut bytes = [0; Self::BYTES];
        let (kind, first, second, a, b) = match self.reflectance {
            Reflectance::Phong { diffuse, specular, exponent } => (0, diffuse, specular, exponent, 0.0),
            Reflectance::MetallicRoughness { base, dielectric, grazing, metallic, roughness } => {
                write_f32(&mut bytes, 60, grazing);
                (METALLIC_ROUGHNESS, base, dielectric, metallic, roughness)
            }
            Reflectance::Glass { base, absorption, transmission, ior, .. } => {
                (GLASS, base, absorption, transmission, ior)
            }
        };
        write_vector(&mut bytes, 0, first);
        write_vector(&mut bytes, 12, second);
        write_f32(&mut bytes, 24, a);
        write_f32(&mut bytes, 28, b);
        write_vector(&mut bytes, 32, self.emission);
        let layers = self.layers.map_or(0, |index| index + 1);
        let group = u32::from(self.light_group) & GROUP_MASK;
        let word = self.flags | kind << KIND_SHIFT | group << GROUP_SHIFT | layers << LAYERS_SHIFT;
        write_u32(&mut bytes, 44, word);
        write_f32(&mut bytes, 48, self.cutoff);
        let [base, metallic_roughness, emissive] = self.textures.map(u32::from);
        write_u32(&mut bytes, 52, base | metallic_roughness << 16);
        write_u32(&mut bytes, 56, emissive);
        if let Reflectance::Glass { specular, metallic, roughness, .. } = self.reflectance {
            let byte = |share: f32| (share.clamp(0.0, 1.0) * 255.0 + 0.5) as u32;
            write_u32(&mut bytes, 56, emissive | byte(specular) << 16 | byte(roughness) << 24);
            write_f32(&mut bytes, 60, metallic);
        }
        bytes
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn materials_of_every_kind_survive_their_bytes() {
        let [first, second] = [[0.1, 0.2, 0.3], [0.4, 0.5, 0.6]];
        for reflectance in [
            Reflectance::Phong { diffuse: first, specular: second, exponent: 32.0 },
            Reflectance::MetallicRoughness {
                base: first,
                dielectric: second,
                grazing: 0.9,
                metallic: 0.25,
                roughness: 0.75,
            },
            Reflectance::Glass {
                base: first,
                absorption: second,
                transmission: 0.9,
                ior: 1.5,
                specular: 0.2,
                metallic: 0.7,
                roughness: 0.4,
            },
        ] {
            for flags in [0, FLAGS].into_iter().chain((0..13).map(|bit| FLAGS & 1 << bit)) {
                let material = Material {
                    reflectance,
                    emission: [18.0, 14.0, 6.5],
                    flags,
                    cutoff: 0.5,
                    textures: [3, NO_TEXTURE, 70],
                    layers: flags.checked_sub(FLAGS),
                    light_group: (flags % 4) as u8,
                };
                assert_eq!(Material::read(&material.to_bytes()), material);
            }
        }
    }
}
