//! Distant lights: parallel light from infinitely far.

use super::{Record, read_u32, read_vector, write_u32, write_vector};

/// A distant light (`directional` of glTF's `KHR_lights_punctual`).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DistantLight {
    /// Unit vector along which the light travels.
    pub direction: [f32; 3],
    /// Radiance times solid angle, W/m^2: without a spread, the irradiance of a surface perpendicular to the
    /// light.
    pub irradiance: [f32; 3],
    /// Cumulative probability of choosing this distant light or one before it, in units of 2^-32. The last
    /// light has 2^32 - 1.
    pub threshold: u32,
    /// Light group, below [`MAX_LIGHT_GROUPS`](crate::budget::MAX_LIGHT_GROUPS).
    pub light_group: u8,
    /// 1 minus the cosine of the half angle of the disk from which the light comes, 0 to 1; 0 for parallel
    /// light. A record holds it rounded by [`Self::rounded_spread`].
    pub spread: f32,
}

impl Record for DistantLight {
    const BYTES: usize = 32;
}

const THRESHOLD_OFFSET: usize = 24;
/// Offset of the word of the light group, its lowest byte, and of the spread, the upper three bytes of its
/// bits.
const GROUP_OFFSET: usize = 28;
const SPREAD_BITS: u32 = 0xffff_ff00;

impl DistantLight {
    /// The spread as a record stores it: its last eight bits are 0.
    #[inline(always)]
    pub fn rounded_spread(spread: f32) -> f32 {
        f32::from_bits(spread.to_bits() & SPREAD_BITS)
    }

    /// Reads a record.
    #[inline(always)]
    pub fn read(bytes: &[u8; Self::BYTES]) -> Self {
        let last = read_u32(bytes, GROUP_OFFSET);
        Self {
            direction: read_vector(bytes, 0),
            irradiance: read_vector(bytes, 12),
            threshold: Self::threshold(bytes),
            light_group: last as u8,
            spread: f32::from_bits(last & SPREAD_BITS),
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
        let spread = Self::rounded_spread(self.spread).to_bits();
        write_u32(&mut bytes, GROUP_OFFSET, spread | u32::from(self.light_group));
        bytes
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn distant_lights_survive_their_bytes() {
        let light = DistantLight {
            direction: [0.0, -1.0, 0.0],
            irradiance: [3.0, 2.0, 1.0],
            threshold: 0x89ab_cdef,
            light_group: 2,
            spread: 0.0,
        };
        assert_eq!(DistantLight::read(&light.to_bytes()), light);
        // Of the sun's spread, 1e-5, rounding takes less than 2^-15.
        let sun = DistantLight { spread: 1.07e-5, ..light };
        let read = DistantLight::read(&sun.to_bytes());
        assert_eq!(read, DistantLight { spread: DistantLight::rounded_spread(sun.spread), ..light });
        assert!((sun.spread - read.spread) / sun.spread < 1.0 / 32768.0, "{}", read.spread);
    }
}
