//! Unit vectors in 32 bits by the octahedral map (Cigolle et al. 2014, *A survey of efficient representations
//! for independent unit vectors*). The error is at most 1e-4.

use glam::Vec3;

use crate::vector::{max, min, unit};

/// Code of the octahedral coordinate 1.
const SCALE: f32 = 32_767.0;

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct PackedNormal(pub(super) u32);

/// Bits that encode no vector: the upper coordinate is -32768.
const NONE: u32 = 0x8000_0000;

impl PackedNormal {
    pub(super) const NONE: Self = Self(NONE);

    pub(super) fn new(normal: Vec3) -> Self {
        let [x, y, z] = normal.to_array();
        let sum = x.abs() + y.abs() + z.abs();
        let [u, v] = [x / sum, y / sum];
        let [u, v] = if z < 0.0 { folded([u, v]) } else { [u, v] };
        let bits = |value: f32| {
            let scaled = min(max(value, -1.0), 1.0) * SCALE;
            u32::from((scaled + if scaled < 0.0 { -0.5 } else { 0.5 }) as i16 as u16)
        };
        Self(bits(u) | bits(v) << 16)
    }

    /// Decodes the vector; `None` for [`Self::NONE`].
    pub(super) fn get(self) -> Option<Vec3> {
        if self == Self::NONE {
            return None;
        }
        let value = |bits: u32| f32::from(bits as u16 as i16) / SCALE;
        let [u, v] = [value(self.0), value(self.0 >> 16)];
        let z = 1.0 - u.abs() - v.abs();
        let [x, y] = if z < 0.0 { folded([u, v]) } else { [u, v] };
        Some(unit(Vec3::new(x, y, z)))
    }
}

/// Folds a point between the upper and the lower half of the octahedron.
fn folded([u, v]: [f32; 2]) -> [f32; 2] {
    let sign = |value: f32| if value < 0.0 { -1.0 } else { 1.0 };
    [(1.0 - v.abs()) * sign(u), (1.0 - u.abs()) * sign(v)]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn directions_of_all_octants_are_kept() {
        assert_eq!(PackedNormal::NONE.get(), None);
        let mut steps = (0..4000_u32).map(|index| index as f32);
        assert!(steps.all(|step| {
            let normal = unit(Vec3::new((step * 0.7).sin(), (step * 1.3).sin(), (step * 2.1).cos() * 0.9));
            PackedNormal::new(normal).get().is_some_and(|found| found.distance(normal) < 1e-4)
        }));
        for axis in [Vec3::X, Vec3::Y, Vec3::Z, Vec3::NEG_X, Vec3::NEG_Y, Vec3::NEG_Z] {
            assert_eq!(PackedNormal::new(axis).get(), Some(axis));
        }
    }
}
