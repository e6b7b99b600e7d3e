//! Distant lights: parallel light from infinitely far.

use super::{Record, read_u32, read_vector, write_u32, write_vector};

/// A distant light (`directional` of glTF's `KHR_lights_punctual`).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DistantLight {
    /// Unit vector along which the light travels.
    pub direction: [f32; 3],
    /// Irradiance of a surface perpendicular to the light, W/m^2.
    pub irradiance: [f32; 3],
    /// Cumulative probability of choosing this distant light or one before it, in units of 2^-32. The last
    /// light has 2^32 - 1.
    pub threshold: u32,
}

impl Record for DistantLight {
    const BYTES: usize = 32;
}

const THRESHOLD_OFFSET: usize = 24;

impl DistantLight {
    /// Reads a record.
    #[inline(always)]
    pub fn read(bytes: &[u8; Self::BYTES]) -> Self {
        Self {
            direction: read_vector(bytes, 0),
            irradiance: read_vector(bytes, 12),
            threshold: Self::threshold(bytes),
        }
    }

    /// Reads [`Self::threshold`](Self#structfield.threshold) from a record without reading the rest.
    #[inline(always)]
    pub fn threshold(bytes: &[u8; Self::BYTES]) -> u32 {
        read_u32(bytes, THRESHOLD_OFFSET)
    }

    /// The record's bytes.
    pub fn to_bytes(&self) -> [u8; Self::BYTES] {
        let mut bytes = [0; Self::BYTES];
        write_vector(&mut bytes, 0, self.direction);
        write_vector(&mut bytes, 12, self.irradiance);
        write_u32(&mut bytes, THRESHOLD_OFFSET, self.threshold);
        bytes
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn distant_lights_survive_their_bytes() {
        let light =
            DistantLight { direction: [0.0, -1.0, 0.0], irradiance: [3.0, 2.0, 1.0], threshold: 0x89ab_cdef };
        assert_eq!(DistantLight::read(&light.to_bytes()), light);
    }
}
