//! Leaves of the bounding volume hierarchy: up to three triangles in one line, to be tested at once.

use super::{read_f32, read_u32, write_f32, write_u32};
use crate::address::LINE_BYTES;

/// Triangles of a leaf. The index of a triangle is this many times its leaf's and its slot in there.
pub const LEAF_TRIANGLES: usize = 3;
const CORNER_BYTES: usize = 12 * LEAF_TRIANGLES;
const COORDINATE_BYTES: usize = 4 * LEAF_TRIANGLES;
const MATERIALS: usize = 3 * CORNER_BYTES;
/// Lanes that a leaf's coordinates are read into: as many as a register has, one more than there are triangles.
pub const TRIANGLE_LANES: usize = 4;

/// A leaf, one line. One of fewer than three triangles has its first several times.
///
/// | bytes | what |
/// |---|---|
/// | 0..108 | first corners: three x, three y, three z, metres; then second and third corners |
/// | 108..120 | three indices of materials |
#[derive(Clone, Copy)]
pub struct BvhLeaf<'a>(pub &'a [u8; LINE_BYTES]);

/// A triangle: three corners, counter-clockwise seen from the front, and its material.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Triangle {
    /// Corners, metres.
    pub vertices: [[f32; 3]; 3],
    /// Index of the material.
    pub material: u32,
}

impl BvhLeaf<'_> {
    /// A coordinate of a corner of all triangles; the last lane is none's.
    #[inline(always)]
    pub fn coordinates(&self, corner: usize, axis: usize) -> [f32; TRIANGLE_LANES] {
        let first = CORNER_BYTES * corner + COORDINATE_BYTES * axis;
        let bytes: Option<&[u8; 4 * TRIANGLE_LANES]> = self.0.get(first..).and_then(<[u8]>::first_chunk);
        bytes.map_or([0.0; TRIANGLE_LANES], |bytes| core::array::from_fn(|lane| read_f32(bytes, 4 * lane)))
    }

    /// A coordinate of a corner of triangle `slot`, below [`LEAF_TRIANGLES`].
    #[inline(always)]
    pub fn coordinate(&self, slot: usize, corner: usize, axis: usize) -> f32 {
        read_f32(self.0, CORNER_BYTES * corner + COORDINATE_BYTES * axis + 4 * slot)
    }

    /// Triangle `slot`, below [`LEAF_TRIANGLES`].
    #[inline(always)]
    pub fn triangle(&self, slot: usize) -> Triangle {
        let vertex = |corner| [0, 1, 2].map(|axis| self.coordinate(slot, corner, axis));
        Triangle {
            vertices: [vertex(0), vertex(1), vertex(2)],
            material: read_u32(self.0, MATERIALS + 4 * slot),
        }
    }

    /// The line of some triangles; `None` if there are none or too many.
    pub fn encode(triangles: &[Triangle]) -> Option<[u8; LINE_BYTES]> {
        let first = triangles.first()?;
        if triangles.len() > LEAF_TRIANGLES {
            return None;
        }
        let mut line = [0; LINE_BYTES];
        for slot in 0..LEAF_TRIANGLES {
            let Triangle { vertices, material } = triangles.get(slot).unwrap_or(first);
            for (corner, vertex) in vertices.iter().enumerate() {
                for (axis, &coordinate) in vertex.iter().enumerate() {
                    let at = CORNER_BYTES * corner + COORDINATE_BYTES * axis + 4 * slot;
                    write_f32(&mut line, at, coordinate);
                }
            }
            write_u32(&mut line, MATERIALS + 4 * slot, *material);
        }
        Some(line)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn triangle(number: usize) -> Triangle {
        let coordinate = |corner: usize, axis: usize| (100 * number + 10 * corner + axis) as f32;
        let vertices = [0, 1, 2].map(|corner| [0, 1, 2].map(|axis| coordinate(corner, axis)));
        Triangle { vertices, material: 70_000 + number as u32 }
    }

    #[test]
    fn triangles_survive_their_leaf() {
        let triangles = [1, 2, 3].map(triangle);
        for count in 1..=LEAF_TRIANGLES {
            let line = BvhLeaf::encode(&triangles[..count]).expect("fits");
            for slot in 0..LEAF_TRIANGLES {
                let expected = triangles[if slot < count { slot } else { 0 }];
                assert_eq!(BvhLeaf(&line).triangle(slot), expected);
                let lane = |corner, axis| BvhLeaf(&line).coordinates(corner, axis)[slot];
                let vertices = [0, 1, 2].map(|corner| [0, 1, 2].map(|axis| lane(corner, axis)));
                assert_eq!(vertices, expected.vertices);
            }
        }
        assert!(BvhLeaf::encode(&[]).is_none());
        assert!(BvhLeaf::encode(&[triangles[0]; 4]).is_none());
    }
}
