//! Emitters: the leaves of the light tree, from which light is sampled.

use crate::budget::MAX_LIGHT_GROUPS;

use super::{DOUBLE_SIDED, Record, read_f32, read_u32, read_vector, write_f32, write_u32, write_vector};

/// An emissive triangle or a punctual light with a position.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Emitter {
    /// Shape and directional distribution.
    pub kind: EmitterKind,
    /// For a triangle, the emitted radiance, W/(sr m^2), to be multiplied by the emissive texture. For a
    /// point or spot light, the intensity, W/sr; with a profile, that of the peak.
    pub emission: [f32; 3],
    /// Bit trail (PBRT 4): the path from the root of the light tree to the emitter. Each level takes two
    /// bits, the index of the child to follow. The lowest two bits belong to the root.
    pub trail: u32,
    /// Light group, below [`MAX_LIGHT_GROUPS`].
    pub light_group: u8,
}

/// Shape and directional distribution of an emitter.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum EmitterKind {
    /// A Lambertian (diffuse) area light.
    Triangle {
        /// Corners, metres.
        vertices: [[f32; 3]; 3],
        /// True if the back emits like the front.
        double_sided: bool,
        /// Index of the triangle in the card image, `LEAF_TRIANGLES * leaf + slot`.
        triangle: u32,
        /// Index of the triangle's material.
        material: u32,
        /// True if the radiance varies over the triangle. The cause is an emissive texture, cut-outs (glTF
        /// alpha mode `MASK`) or partial coverage (`BLEND`).
        varies: bool,
    },
    /// An isotropic point light.
    Point {
        /// Position, metres.
        position: [f32; 3],
    },
    /// A spot light (glTF `KHR_lights_punctual`): intensity times `clamp(cos * scale + offset, 0, 1)^2`,
    /// where `cos` is the cosine of the angle to the axis.
    Spot {
        /// Position, metres.
        position: [f32; 3],
        /// Unit vector along the axis, in the direction in which light travels.
        direction: [f32; 3],
        /// `lightAngleScale` of the falloff, as in glTF `KHR_lights_punctual`.
        scale: f32,
        /// `lightAngleOffset` of the falloff, as in glTF `KHR_lights_punctual`.
        offset: f32,
    },
    /// A point light whose intensity depends on the direction (goniometric light): emission times a texture.
    /// In the frame of `across`, `across x aim` and `-aim`, gamma is the angle to the aim, and C the angle
    /// from the first towards the second. The texture's coordinates are `C / (2 pi) + 0.5` and `gamma / pi`.
    Profile {
        /// Position, metres.
        position: [f32; 3],
        /// Unit vector of the direction gamma = 0.
        aim: [f32; 3],
        /// Unit vector of the direction C = 0, gamma = pi / 2.
        across: [f32; 3],
        /// Index of the texture.
        texture: u32,
    },
}

impl Record for Emitter {
    const BYTES: usize = 64;
}

const EMISSION: usize = 36;
const FLAGS: usize = 48;
const TRAIL: usize = 52;
const TRIANGLE: usize = 56;
const MATERIAL: usize = 60;
const TEXTURE: usize = 56;

const VARIES: u32 = 1 << 1;
const GROUP_SHIFT: u32 = 2;
const GROUP_MASK: u32 = MAX_LIGHT_GROUPS as u32 - 1;
const KIND_SHIFT: u32 = 4;
const POINT: u32 = 1;
const SPOT: u32 = 2;
const PROFILE: u32 = 3;

impl Emitter {
    /// Reads a record.
    #[inline(always)]
    pub fn read(bytes: &[u8; Self::BYTES]) -> Self {
        let flags = read_u32(bytes, FLAGS);
        let [first, second] = [read_vector(bytes, 0), read_vector(bytes, 12)];
        let kind = match flags >> KIND_SHIFT {
            POINT => EmitterKind::Point { position: first },
            SPOT => EmitterKind::Spot {
                position: first,
                direction: second,
                scale: read_f32(bytes, 24),
                offset: read_f32(bytes, 28),
            },
            PROFILE => EmitterKind::Profile {
                position: first,
                aim: second,
                across: read_vector(bytes, 24),
                texture: read_u32(bytes, TEXTURE),
            },
            _ => EmitterKind::Triangle {
                vertices: [first, second, read_vector(bytes, 24)],
                double_sided: flags & DOUBLE_SIDED != 0,
                triangle: read_u32(bytes, TRIANGLE),
                material: read_u32(bytes, MATERIAL),
                varies: flags & VARIES != 0,
            },
        };
        Self {
            kind,
            emission: read_vector(bytes, EMISSION),
            trail: read_u32(bytes, TRAIL),
            light_group: (flags >> GROUP_SHIFT & GROUP_MASK) as u8,
        }
    }

    /// Reads the bit trail from a record without reading the rest.
    #[inline(always)]
    pub fn trail(bytes: &[u8; Self::BYTES]) -> u32 {
        read_u32(bytes, TRAIL)
    }

    /// The record's bytes.
    pub fn to_bytes(&self) -> [u8; Self::BYTES] {
        let mut bytes = [0; Self::BYTES];
        let flags = match self.kind {
            EmitterKind::Triangle { vertices, double_sided, triangle, material, varies } => {
                for (corner, vertex) in vertices.into_iter().enumerate() {
                    write_vector(&mut bytes, 12 * corner, vertex);
                }
                write_u32(&mut bytes, TRIANGLE, triangle);
                write_u32(&mut bytes, MATERIAL, material);
                (if double_sided { DOUBLE_SIDED } else { 0 }) | if varies { VARIES } else { 0 }
            }
            EmitterKind::Point { position } => {
                write_vector(&mut bytes, 0, position);
                POINT << KIND_SHIFT
            }
            EmitterKind::Spot { position, direction, scale, offset } => {
                write_vector(&mut bytes, 0, position);
                write_vector(&mut bytes, 12, direction);
                write_f32(&mut bytes, 24, scale);
                write_f32(&mut bytes, 28, offset);
                SPOT << KIND_SHIFT
            }
            EmitterKind::Profile { position, aim, across, texture } => {
                write_vector(&mut bytes, 0, position);
                write_vector(&mut bytes, 12, aim);
                write_vector(&mut bytes, 24, across);
                write_u32(&mut bytes, TEXTURE, texture);
                PROFILE << KIND_SHIFT
            }
        };
        write_vector(&mut bytes, EMISSION, self.emission);
        let group = u32::from(self.light_group) & GROUP_MASK;
        write_u32(&mut bytes, FLAGS, flags | group << GROUP_SHIFT);
        write_u32(&mut bytes, TRAIL, self.trail);
        bytes
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn emitters_survive_their_bytes() {
        let vertices = [[1.0, 2.0, 3.0], [-4.0, 5.5, 6.0], [7.0, -8.0, 9.25]];
        let triangle = |double_sided: bool, varies: bool| EmitterKind::Triangle {
            vertices,
            double_sided,
            triangle: 800_000,
            material: 7,
            varies,
        };
        let [position, direction, across] = vertices;
        let kinds = [
            triangle(false, true),
            triangle(true, false),
            EmitterKind::Point { position },
            EmitterKind::Spot { position, direction, scale: 3.0, offset: -0.5 },
            EmitterKind::Profile { position, aim: direction, across, texture: 70_000 },
        ];
        for kind in kinds {
            let emitter = Emitter { kind, emission: [1.0, 2.0, 3.0], trail: 0x89ab_cdef, light_group: 3 };
            assert_eq!(Emitter::read(&emitter.to_bytes()), emitter);
            assert_eq!(Emitter::trail(&emitter.to_bytes()), emitter.trail);
        }
    }
}
