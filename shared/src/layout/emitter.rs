//! Emitters.

use super::{Record, read_f32, read_u32, read_vector, write_f32, write_u32, write_vector};

/// An emissive triangle: a Lambertian area light.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Emitter {
    /// Corners, metres.
    pub vertices: [[f32; 3]; 3],
    /// Emitted radiance, W/(sr m^2).
    pub emission: [f32; 3],
    /// Probability density of a shadow ray's end on this triangle, 1/m^2: the probability of the emitter over its area.
    pub density: f32,
    /// [`super::DOUBLE_SIDED`] or 0.
    pub flags: u32,
}

impl Record for Emitter {
    const BYTES: usize = 64;
}

impl Emitter {
    /// Reads a record.
    #[inline(always)]
    pub fn read(bytes: &[u8; Self::BYTES]) -> Self {
        Self {
            vertices: [read_vector(bytes, 0), read_vector(bytes, 12), read_vector(bytes, 24)],
            emission: read_vector(bytes, 36),
            density: read_f32(bytes, 48),
            flags: read_u32(bytes, 52),
        }
    }

    /// The record's bytes.
    pub fn to_bytes(&self) -> [u8; Self::BYTES] {
        let mut bytes = [0; Self::BYTES];
        for (corner, vertex) in self.vertices.into_iter().enumerate() {
            write_vector(&mut bytes, 12 * corner, vertex);
        }
        write_vector(&mut bytes, 36, self.emission);
        write_f32(&mut bytes, 48, self.density);
        write_u32(&mut bytes, 52, self.flags);
        bytes
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::layout::DOUBLE_SIDED;

    #[test]
    fn emitters_survive_their_bytes() {
        let vertices = [[1.0, 2.0, 3.0], [-4.0, 5.5, 6.0], [7.0, -8.0, 9.25]];
        let emitter = Emitter { vertices, emission: [1.0, 2.0, 3.0], density: 0.75, flags: DOUBLE_SIDED };
        assert_eq!(Emitter::read(&emitter.to_bytes()), emitter);
    }
}
