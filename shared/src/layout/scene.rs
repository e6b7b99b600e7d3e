//! Geometry, materials and emitters.

use super::{Record, read_f32, read_u32, read_vector, write_f32, write_u32, write_vector};
use crate::address::LINE_BYTES;

/// Four children of the bounding volume hierarchy, one line: their boxes by coordinate, then their references.
///
/// | bytes | what |
/// |---|---|
/// | 0..48 | lower corners: four x, four y, four z |
/// | 48..96 | upper corners: four x, four y, four z |
/// | 96..112 | four [`ChildReference`] |
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BvhNode {
    /// Lower corners, by axis and child, metres.
    pub lower: [[f32; 4]; 3],
    /// Upper corners, by axis and child, metres.
    pub upper: [[f32; 4]; 3],
    /// What each box holds.
    pub children: [ChildReference; 4],
}

impl Record for BvhNode {
    const BYTES: usize = LINE_BYTES;
}

impl BvhNode {
    /// A node without children: boxes that no ray meets.
    pub const EMPTY: Self = Self {
        lower: [[f32::INFINITY; 4]; 3],
        upper: [[f32::NEG_INFINITY; 4]; 3],
        children: [ChildReference::EMPTY; 4],
    };

    /// Reads a record.
    #[inline(always)]
    pub fn read(bytes: &[u8; LINE_BYTES]) -> Self {
        let four = |offset: usize| core::array::from_fn(|child| read_f32(bytes, offset + 4 * child));
        Self {
            lower: [four(0), four(16), four(32)],
            upper: [four(48), four(64), four(80)],
            children: core::array::from_fn(|child| ChildReference(read_u32(bytes, 96 + 4 * child))),
        }
    }

    /// The record's bytes.
    #[expect(clippy::indexing_slicing, reason = "constant bounds")]
    pub fn to_bytes(&self) -> [u8; LINE_BYTES] {
        let mut bytes = [0; LINE_BYTES];
        for child in 0..4 {
            for axis in 0..3 {
                write_f32(&mut bytes, 16 * axis + 4 * child, self.lower[axis][child]);
                write_f32(&mut bytes, 48 + 16 * axis + 4 * child, self.upper[axis][child]);
            }
            write_u32(&mut bytes, 96 + 4 * child, self.children[child].0);
        }
        bytes
    }
}

/// Triangles a leaf may hold.
pub const MAX_LEAF_TRIANGLES: u32 = 15;

const LEAF: u32 = 1 << 31;
const COUNT_SHIFT: u32 = 27;
const FIRST_MASK: u32 = (1 << COUNT_SHIFT) - 1;

/// A child of a [`BvhNode`]: another node, or a run of triangles.
///
/// Bit 31 marks a leaf, whose bits 27-30 are the number of triangles and bits 0-26 the index of the first. An inner
/// child is its node's index. All ones is no child.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ChildReference(pub u32);

impl ChildReference {
    /// No child.
    pub const EMPTY: Self = Self(u32::MAX);
    /// Nodes, and triangles, that a reference can tell apart.
    pub const LIMIT: u32 = FIRST_MASK;

    /// A reference to the node of this index; `None` at or above [`Self::LIMIT`].
    pub fn node(index: u32) -> Option<Self> {
        (index < Self::LIMIT).then_some(Self(index))
    }

    /// A reference to `count` triangles from `first` on; `None` if that cannot be told.
    pub fn leaf(first: u32, count: u32) -> Option<Self> {
        let fits = first < Self::LIMIT && (1..=MAX_LEAF_TRIANGLES).contains(&count);
        fits.then_some(Self(LEAF | count << COUNT_SHIFT | first))
    }

    /// First triangle and number of triangles, of a leaf.
    #[inline(always)]
    pub fn triangles(self) -> Option<(u32, u32)> {
        (self.0 & LEAF != 0).then_some((self.0 & FIRST_MASK, (self.0 >> COUNT_SHIFT) & 15))
    }
}

/// A triangle: three corners, counter-clockwise seen from the front, and its material.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Triangle {
    /// Corners, metres.
    pub vertices: [[f32; 3]; 3],
    /// Index of the material.
    pub material: u32,
}

impl Record for Triangle {
    const BYTES: usize = 40;
}

impl Triangle {
    /// Reads a record.
    #[inline(always)]
    pub fn read(bytes: &[u8; Self::BYTES]) -> Self {
        Self {
            vertices: [read_vector(bytes, 0), read_vector(bytes, 12), read_vector(bytes, 24)],
            material: read_u32(bytes, 36),
        }
    }

    /// The record's bytes.
    pub fn to_bytes(&self) -> [u8; Self::BYTES] {
        let mut bytes = [0; Self::BYTES];
        for (corner, vertex) in self.vertices.into_iter().enumerate() {
            write_vector(&mut bytes, 12 * corner, vertex);
        }
        write_u32(&mut bytes, 36, self.material);
        bytes
    }
}

/// In [`Material::flags`] and [`Emitter::flags`]: the back does what the front does.
pub const DOUBLE_SIDED: u32 = 1;

/// Lambertian reflection with one Phong lobe, and emission.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Material {
    /// Lambertian albedo.
    pub diffuse: [f32; 3],
    /// Albedo of the Phong lobe.
    pub specular: [f32; 3],
    /// Exponent of the Phong lobe.
    pub exponent: f32,
    /// Emitted radiance, W/(sr m^2).
    pub emission: [f32; 3],
    /// [`DOUBLE_SIDED`] or 0.
    pub flags: u32,
}

impl Record for Material {
    const BYTES: usize = 64;
}

impl Material {
    /// Reads a record.
    #[inline(always)]
    pub fn read(bytes: &[u8; Self::BYTES]) -> Self {
        Self {
            diffuse: read_vector(bytes, 0),
            specular: read_vector(bytes, 12),
            exponent: read_f32(bytes, 24),
            emission: read_vector(bytes, 28),
            flags: read_u32(bytes, 40),
        }
    }

    /// The record's bytes.
    pub fn to_bytes(&self) -> [u8; Self::BYTES] {
        let mut bytes = [0; Self::BYTES];
        write_vector(&mut bytes, 0, self.diffuse);
        write_vector(&mut bytes, 12, self.specular);
        write_f32(&mut bytes, 24, self.exponent);
        write_vector(&mut bytes, 28, self.emission);
        write_u32(&mut bytes, 40, self.flags);
        bytes
    }
}

/// An emissive triangle: a Lambertian area light.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Emitter {
    /// Corners, metres.
    pub vertices: [[f32; 3]; 3],
    /// Emitted radiance, W/(sr m^2).
    pub emission: [f32; 3],
    /// Probability density of a shadow ray's end on this triangle, 1/m^2: the probability of the emitter over its area.
    pub density: f32,
    /// [`DOUBLE_SIDED`] or 0.
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

    #[test]
    fn records_survive_their_bytes() {
        let vertices = [[1.0, 2.0, 3.0], [-4.0, 5.5, 6.0], [7.0, -8.0, 9.25]];
        let triangle = Triangle { vertices, material: 70_000 };
        assert_eq!(Triangle::read(&triangle.to_bytes()), triangle);
        let material = Material {
            diffuse: [0.1, 0.2, 0.3],
            specular: [0.4, 0.5, 0.6],
            exponent: 32.0,
            emission: [18.0, 14.0, 6.5],
            flags: DOUBLE_SIDED,
        };
        assert_eq!(Material::read(&material.to_bytes()), material);
        let emitter = Emitter { vertices, emission: [1.0, 2.0, 3.0], density: 0.75, flags: 0 };
        assert_eq!(Emitter::read(&emitter.to_bytes()), emitter);
        let mut node = BvhNode::EMPTY;
        node.lower[1][3] = -2.5;
        node.upper[2][0] = 11.0;
        node.children[2] = ChildReference::leaf(12, 3).unwrap();
        assert_eq!(BvhNode::read(&node.to_bytes()), node);
    }

    #[test]
    fn a_reference_is_a_node_or_a_leaf_and_refuses_what_it_cannot_tell() {
        assert_eq!(ChildReference::leaf(1234, 15).unwrap().triangles(), Some((1234, 15)));
        assert_eq!(ChildReference::node(1234).unwrap().triangles(), None);
        assert_eq!(ChildReference::leaf(0, 0), None);
        assert_eq!(ChildReference::leaf(0, 16), None);
        assert_eq!(ChildReference::leaf(ChildReference::LIMIT, 1), None);
        assert_eq!(ChildReference::node(ChildReference::LIMIT), None);
    }
}
