//! Instances: groups of triangles that a transform places in the scene.

use super::{BvhLeaf, Rows, read_f32, read_u32, write_f32, write_u32};
use crate::address::LINE_BYTES;

/// Instance of a group of triangles. It takes one line among the [`BvhLeaf`]s: a leaf without triangles. The
/// nodes and leaves of the group's hierarchy are in the group's space, and contain no instances.
///
/// | bytes | contents |
/// |---|---|
/// | 0..48 | transform from the group's space to the world: rows of four `f32` |
/// | 48..96 | transform from the world to the group's space |
/// | 96..100 | index of the root of the group's hierarchy |
/// | 100..104 | greatest absolute coordinate of the instance in the world, metres |
/// | 104..128 | 0 |
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Instance {
    /// Transform from the group's space to the world.
    pub to_world: Rows,
    /// Transform from the world to the group's space.
    pub to_group: Rows,
    /// Index of the root of the group's hierarchy, a [`BvhNode`](super::BvhNode).
    pub root: u32,
    /// Greatest absolute coordinate of the instance in the world, metres.
    pub reach: f32,
}

/// [`TriangleId::instance`] of a triangle that is not part of an instance.
pub const NO_INSTANCE: u32 = u32::MAX;

/// A triangle of the scene.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct TriangleId {
    /// Index of the triangle in the card image.
    pub index: u32,
    /// Index of the line of its [`Instance`], or [`NO_INSTANCE`].
    pub instance: u32,
}

impl TriangleId {
    /// Triangle `index`, which is not part of an instance.
    pub const fn lone(index: u32) -> Self {
        Self { index, instance: NO_INSTANCE }
    }
}

const ROOT: usize = 96;
const REACH: usize = ROOT + 4;

impl Instance {
    /// Reads the instance in a line of [`BvhLeaf`]s; `None` if the line is a leaf with triangles.
    #[inline(always)]
    pub fn read(line: &[u8; LINE_BYTES]) -> Option<Self> {
        if BvhLeaf(line).triangles() > 0 {
            return None;
        }
        let [to_world, to_group] = [0, ROOT / 2].map(|first| {
            [0, 1, 2].map(|row| [0, 1, 2, 3].map(|column| read_f32(line, first + 16 * row + 4 * column)))
        });
        Some(Self { to_world, to_group, root: read_u32(line, ROOT), reach: read_f32(line, REACH) })
    }

    /// Encodes the instance.
    pub fn to_bytes(&self) -> [u8; LINE_BYTES] {
        let mut line = [0; LINE_BYTES];
        let values = self.to_world.iter().chain(&self.to_group).flatten();
        for (index, &value) in values.enumerate() {
            write_f32(&mut line, 4 * index, value);
        }
        write_u32(&mut line, ROOT, self.root);
        write_f32(&mut line, REACH, self.reach);
        line
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::layout::{placed_point, placed_vector};

    const INSTANCE: Instance = Instance {
        to_world: [[2.0, 0.0, 0.0, 1.0], [0.0, 0.0, -2.0, 3.0], [0.0, 2.0, 0.0, -5.0]],
        to_group: [[0.5, 0.0, 0.0, -0.5], [0.0, 0.0, 0.5, 2.5], [0.0, -0.5, 0.0, 1.5]],
        root: 77,
        reach: 9.5,
    };

    #[test]
    fn an_instance_survives_its_line() {
        assert_eq!(Instance::read(&INSTANCE.to_bytes()), Some(INSTANCE));
    }

    #[test]
    fn a_point_returns_to_the_space_of_its_group() {
        let point = [0.25, -3.0, 8.0];
        let placed = placed_point(&INSTANCE.to_world, point);
        assert_eq!(placed, [1.5, -13.0, -11.0]);
        assert_eq!(placed_point(&INSTANCE.to_group, placed), point);
        assert_eq!(placed_vector(&INSTANCE.to_world, point), [0.5, -16.0, -6.0]);
    }
}
