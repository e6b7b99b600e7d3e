//! Leaves of the bounding volume hierarchy: neighbouring triangles in one 128-byte line, tested together for
//! ray intersection.
//!
//! A vertex shared by several triangles is stored once. A line therefore holds up to eight triangles of a
//! mesh, or three triangles without common vertices.

use core::ops::Range;

use super::{Rows, read_f32, read_u32, write_f32, write_u32};
use crate::address::LINE_BYTES;

/// Maximum number of triangles of a leaf. A triangle's index in the card image is `LEAF_TRIANGLES * leaf +
/// slot`, where `slot` is its number in the leaf.
pub const LEAF_TRIANGLES: usize = 8;
/// Maximum number of vertices of a leaf.
pub const LEAF_VERTICES: usize = 9;
/// Number of lanes of [`BvhLeaf::coordinates`]: nine vertices, rounded up to whole vector registers.
pub const VERTEX_LANES: usize = 12;

const COORDINATE_BYTES: usize = 4 * LEAF_VERTICES;
const CORNERS: usize = 3 * COORDINATE_BYTES;
const MATERIALS: usize = CORNERS + 12;
const MATERIAL_BYTES: usize = 3;
const LEAF_MATERIALS: usize = 2;
const SECOND_MATERIAL: usize = MATERIALS + MATERIAL_BYTES * LEAF_MATERIALS;
const COUNTS: usize = SECOND_MATERIAL + 1;
const _: () = assert!(COUNTS + 1 == LINE_BYTES && 2 * COORDINATE_BYTES + 4 * VERTEX_LANES <= LINE_BYTES);

/// Exclusive limit of material indices: 2^22.
pub const MAX_MATERIALS: u32 = 1 << (8 * MATERIAL_BYTES - 2);
/// Flag in a leaf's material index: triangles with this material may have cut-outs.
const CUT_OUT: u32 = 2 * MAX_MATERIALS;
/// Flag in a leaf's material index: triangles with this material are flat glass.
const FLAT_GLASS: u32 = MAX_MATERIALS;
/// Returns the part of `flag` that lies in the last of the three bytes of a material index.
const fn in_last_byte(flag: u32) -> u8 {
    (flag >> (8 * (MATERIAL_BYTES - 1))) as u8
}

/// A leaf of the bounding volume hierarchy, one line.
///
/// | bytes | contents |
/// |---|---|
/// | 0..108 | coordinates of nine vertices: all x, all y, all z, metres |
/// | 108..120 | vertex indices of the triangles' first corners, four bits each; of the second corners; of the third |
/// | 120..126 | indices of two materials, three bytes each; bit 23: triangles may have cut-outs, bit 22: triangles are flat glass |
/// | 126 | bit `i`: triangle `i` has the second material |
/// | 127 | bits 0-3 number of triangles, 4-7 number of vertices |
#[derive(Clone, Copy)]
pub struct BvhLeaf<'a>(pub &'a [u8; LINE_BYTES]);

/// A triangle and its material. The corners are counter-clockwise, seen from the front.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Triangle {
    /// Positions of the corners, metres.
    pub vertices: [[f32; 3]; 3],
    /// Index of the material, below [`MAX_MATERIALS`].
    pub material: u32,
    /// True if parts of the triangle may be absent (glTF alpha mode `MASK`), where the alpha of the base
    /// texture or of the vertex colours is low.
    pub cut_out: bool,
    /// True if the triangle is flat glass: a perfectly smooth thin wall or pane, through which light passes
    /// without a change of direction.
    pub flat_glass: bool,
}

impl BvhLeaf<'_> {
    /// Range of the line's bytes that are needed to read one triangle: all but the last byte, which holds the
    /// numbers of triangles and vertices.
    pub const OF_TRIANGLE: Range<u32> = 0..LINE_BYTES as u32 - 1;

    /// Number of triangles, at most [`LEAF_TRIANGLES`].
    #[inline(always)]
    pub fn triangles(&self) -> u32 {
        u32::from(self.byte(COUNTS) & 15).min(LEAF_TRIANGLES as u32)
    }

    /// Number of vertices, at most nine.
    #[inline(always)]
    pub fn vertices(&self) -> u32 {
        u32::from(self.byte(COUNTS) >> 4).min(LEAF_VERTICES as u32)
    }

    /// Coordinates of all vertices on one axis, metres. Lanes past the last vertex are meaningless.
    #[inline(always)]
    pub fn coordinates(&self, axis: usize) -> [f32; VERTEX_LANES] {
        let bytes: Option<&[u8; 4 * VERTEX_LANES]> =
            self.0.get(COORDINATE_BYTES * axis..).and_then(<[u8]>::first_chunk);
        bytes.map_or([0.0; VERTEX_LANES], |bytes| core::array::from_fn(|lane| read_f32(bytes, 4 * lane)))
    }

    /// Vertex indices of the first, the second and the third corner of every triangle.
    #[inline(always)]
    pub fn all_corners(&self) -> [[u32; LEAF_TRIANGLES]; 3] {
        [self.corners(0), self.corners(1), self.corners(2)]
    }

    /// Vertex indices of corner `corner` of all triangles. The indices are below nine even in a damaged card
    /// image.
    #[inline(always)]
    fn corners(&self, corner: usize) -> [u32; LEAF_TRIANGLES] {
        let vertices = read_u32(self.0, CORNERS + 4 * corner);
        let mut corners = [0; LEAF_TRIANGLES];
        // A loop, because compilers compile `from_fn` without the vector instructions that the caller
        // enables.
        for (slot, corner) in (0_u32..).zip(&mut corners) {
            // An index above the maximum occurs in unsound card images only.
            *corner = (vertices >> (4 * slot) & 15).min(LEAF_VERTICES as u32 - 1);
        }
        corners
    }

    /// Vertex indices of triangle `slot`, below [`LEAF_TRIANGLES`].
    #[inline(always)]
    pub fn vertices_of(&self, slot: usize) -> [usize; 3] {
        [self.vertex_of(slot, 0), self.vertex_of(slot, 1), self.vertex_of(slot, 2)]
    }

    #[inline(always)]
    fn vertex_of(&self, slot: usize, corner: usize) -> usize {
        let vertex = read_u32(self.0, CORNERS + 4 * corner) >> (4 * (slot % LEAF_TRIANGLES)) & 15;
        // An index above the maximum occurs in unsound card images only.
        (vertex as usize).min(LEAF_VERTICES - 1)
    }

    #[inline(always)]
    fn vertex(&self, vertex: usize) -> [f32; 3] {
        [self.coordinate(vertex, 0), self.coordinate(vertex, 1), self.coordinate(vertex, 2)]
    }

    /// One coordinate of a vertex, metres.
    #[inline(always)]
    pub fn coordinate(&self, vertex: usize, axis: usize) -> f32 {
        read_f32(self.0, COORDINATE_BYTES * axis + 4 * vertex)
    }

    /// Returns the offset in the line, bytes, of the material index of triangle `slot`.
    #[inline(always)]
    fn material_of(&self, slot: usize) -> usize {
        let is_second = self.byte(SECOND_MATERIAL) >> (slot % LEAF_TRIANGLES) & 1;
        MATERIALS + MATERIAL_BYTES * usize::from(is_second)
    }

    /// Returns whether triangle `slot`, below [`LEAF_TRIANGLES`], may have cut-outs.
    #[inline(always)]
    pub fn is_cut_out(&self, slot: usize) -> bool {
        self.last_byte(slot) & in_last_byte(CUT_OUT) != 0
    }

    /// Returns whether triangle `slot`, below [`LEAF_TRIANGLES`], is flat glass.
    #[inline(always)]
    pub fn is_flat_glass(&self, slot: usize) -> bool {
        self.last_byte(slot) & in_last_byte(FLAT_GLASS) != 0
    }

    /// Returns the last byte of a triangle's material index. This byte contains the flags.
    #[inline(always)]
    fn last_byte(&self, slot: usize) -> u8 {
        self.byte(self.material_of(slot) + MATERIAL_BYTES - 1)
    }

    /// Reads triangle `slot`, which is below [`LEAF_TRIANGLES`].
    #[inline(always)]
    pub fn triangle(&self, slot: usize) -> Triangle {
        let at = self.material_of(slot);
        let [low, middle, high] = [self.byte(at), self.byte(at + 1), self.byte(at + 2)];
        let material = u32::from(low) | u32::from(middle) << 8 | u32::from(high) << 16;
        let [a, b, c] = self.vertices_of(slot);
        Triangle {
            vertices: [self.vertex(a), self.vertex(b), self.vertex(c)],
            material: material & (MAX_MATERIALS - 1),
            cut_out: material & CUT_OUT != 0,
            flat_glass: material & FLAT_GLASS != 0,
        }
    }

    #[inline(always)]
    fn byte(&self, index: usize) -> u8 {
        self.0.get(index).copied().unwrap_or(0)
    }

    /// Returns the leaf's line with all vertices moved by an affine transform.
    #[inline(always)]
    pub fn placed(&self, rows: &Rows) -> [u8; LINE_BYTES] {
        let coordinates = [self.coordinates(0), self.coordinates(1), self.coordinates(2)];
        let mut line = *self.0;
        for (axis, &[a, b, c, d]) in rows.iter().enumerate() {
            let mut lanes = [0.0; VERTEX_LANES];
            let [x, y, z] = &coordinates;
            for (((lane, x), y), z) in lanes.iter_mut().zip(x).zip(y).zip(z) {
                *lane = a * x + b * y + c * z + d;
            }
            for (vertex, &coordinate) in lanes.iter().take(LEAF_VERTICES).enumerate() {
                write_f32(&mut line, COORDINATE_BYTES * axis + 4 * vertex, coordinate);
            }
        }
        line
    }

    /// Encodes a leaf. Returns `None` if there are no triangles, more triangles, vertices or materials than a
    /// leaf can hold, or a material index of [`MAX_MATERIALS`] or more.
    pub fn encode(triangles: &[Triangle]) -> Option<[u8; LINE_BYTES]> {
        if triangles.is_empty() || triangles.len() > LEAF_TRIANGLES {
            return None;
        }
        let mut line = [0; LINE_BYTES];
        let mut vertices = Distinct::<[u32; 3], LEAF_VERTICES>::new();
        let mut materials = Distinct::<u32, LEAF_MATERIALS>::new();
        for (slot, triangle) in triangles.iter().enumerate() {
            for (corner, vertex) in triangle.vertices.iter().enumerate() {
                // Coordinates are compared as bits: a vertex with -0 must not replace an equal one with 0, or
                // hits would depend on the order of triangles.
                let vertex = vertices.index(vertex.map(f32::to_bits))?;
                let at = CORNERS + 4 * corner;
                let before = read_u32(&line, at);
                write_u32(&mut line, at, before | (vertex as u32) << (4 * slot));
            }
            if triangle.material >= MAX_MATERIALS {
                return None;
            }
            let flags = [(triangle.cut_out, CUT_OUT), (triangle.flat_glass, FLAT_GLASS)];
            let flags = flags.into_iter().filter(|(is_set, _)| *is_set).map(|(_, flag)| flag);
            let material = flags.fold(triangle.material, |material, flag| material | flag);
            *line.get_mut(SECOND_MATERIAL)? |= (materials.index(material)? << slot) as u8;
        }
        for (index, vertex) in vertices.items().enumerate() {
            for (axis, coordinate) in vertex.into_iter().enumerate() {
                write_f32(&mut line, COORDINATE_BYTES * axis + 4 * index, f32::from_bits(coordinate));
            }
        }
        for (index, material) in materials.items().enumerate() {
            let [low, middle, high, _] = material.to_le_bytes();
            let slot = line.get_mut(MATERIALS + MATERIAL_BYTES * index..)?.first_chunk_mut()?;
            *slot = [low, middle, high];
        }
        *line.get_mut(COUNTS)? = triangles.len() as u8 | (vertices.count as u8) << 4;
        Some(line)
    }
}

/// A set of at most `MOST` distinct items, in insertion order.
struct Distinct<T, const MOST: usize> {
    items: [Option<T>; MOST],
    count: usize,
}

impl<T: Copy + PartialEq, const MOST: usize> Distinct<T, MOST> {
    fn new() -> Self {
        Self { items: [None; MOST], count: 0 }
    }

    /// Returns the index of `item`, after adding it if the set does not contain it. `None` if the set is full
    /// and does not contain it.
    fn index(&mut self, item: T) -> Option<usize> {
        let index = self.items().position(|other| other == item).unwrap_or(self.count);
        *self.items.get_mut(index)? = Some(item);
        self.count = self.count.max(index + 1);
        Some(index)
    }

    fn items(&self) -> impl Iterator<Item = T> {
        self.items.iter().copied().flatten()
    }
}

#[cfg(test)]
mod tests {
    extern crate std;

    use std::vec::Vec;

    use super::*;
    use crate::layout::placed_point;
    use crate::layout::tests::random;

    fn apart(number: usize) -> Triangle {
        let coordinate = |corner: usize, axis: usize| (100 * number + 10 * corner + axis) as f32;
        let vertices = [0, 1, 2].map(|corner| [0, 1, 2].map(|axis| coordinate(corner, axis)));
        let material = 70_000 + number as u32 % 2;
        Triangle { vertices, material, cut_out: number.is_multiple_of(2), flat_glass: number % 2 == 1 }
    }

    /// Triangles of a grid of two by two squares.
    fn mesh() -> Vec<Triangle> {
        let vertex = |x: u32, y: u32| [x as f32, y as f32, (x * y) as f32];
        let square = |x, y| {
            let [a, b, c, d] = [vertex(x, y), vertex(x + 1, y), vertex(x + 1, y + 1), vertex(x, y + 1)];
            [[a, b, c], [a, c, d]].map(|vertices| Triangle {
                vertices,
                material: x,
                cut_out: false,
                flat_glass: false,
            })
        };
        [square(0, 0), square(1, 0), square(0, 1), square(1, 1)].concat()
    }

    #[track_caller]
    fn survive(triangles: &[Triangle]) {
        let line = BvhLeaf::encode(triangles).expect("fits");
        let leaf = BvhLeaf(&line);
        assert_eq!(leaf.triangles() as usize, triangles.len());
        for (slot, triangle) in triangles.iter().enumerate() {
            assert_eq!(leaf.triangle(slot), *triangle);
            assert_eq!(leaf.is_cut_out(slot), triangle.cut_out);
            assert_eq!(leaf.is_flat_glass(slot), triangle.flat_glass);
            let vertex = |corner| {
                let index = leaf.corners(corner)[slot];
                assert!(index < leaf.vertices());
                [0, 1, 2].map(|axis| leaf.coordinates(axis)[index as usize])
            };
            assert_eq!([vertex(0), vertex(1), vertex(2)], triangle.vertices);
        }
    }

    #[test]
    fn triangles_survive_their_leaf() {
        let triangles = [1, 2, 3].map(apart);
        for count in 1..=triangles.len() {
            survive(&triangles[..count]);
        }
        let mesh = mesh();
        for count in 1..=mesh.len() {
            survive(&mesh[..count]);
        }
    }

    #[test]
    fn a_placed_leaf_has_the_placed_vertices() {
        let rows = [[1.0, 2.0, 0.0, 1.0], [0.5, 0.0, -1.0, 0.0], [0.0, 4.0, 1.0, -7.0]];
        let mesh = mesh();
        let placed = mesh.iter().map(|triangle| Triangle {
            vertices: triangle.vertices.map(|vertex| placed_point(&rows, vertex)),
            ..*triangle
        });
        let line = BvhLeaf::encode(&mesh).expect("fits");
        let line = BvhLeaf(&line).placed(&rows);
        for (slot, triangle) in placed.enumerate() {
            assert_eq!(BvhLeaf(&line).triangle(slot), triangle);
        }
    }

    #[test]
    fn a_leaf_holds_eight_triangles_of_a_mesh_and_three_of_none() {
        assert!(BvhLeaf::encode(&mesh()).is_some());
        assert!(BvhLeaf::encode(&[mesh(), mesh()[..1].to_vec()].concat()).is_none());
        assert!(BvhLeaf::encode(&[1, 2, 3, 4].map(apart)).is_none());
        assert!(BvhLeaf::encode(&[]).is_none());
    }

    #[test]
    fn a_leaf_distinguishes_two_materials_of_four_million() {
        let of = |material| Triangle { material, ..apart(1) };
        survive(&[of(MAX_MATERIALS - 1), of(0), of(MAX_MATERIALS - 1)]);
        assert!(BvhLeaf::encode(&[of(0), of(1), of(2)]).is_none());
        assert!(BvhLeaf::encode(&[of(MAX_MATERIALS)]).is_none());
    }

    #[test]
    fn reading_a_leaf_of_arbitrary_bytes_does_not_panic() {
        let mut next = random(4);
        for _ in 0..2000 {
            let line: [u8; LINE_BYTES] = core::array::from_fn(|_| next() as u8);
            let leaf = BvhLeaf(&line);
            assert!(leaf.triangles() as usize <= LEAF_TRIANGLES && leaf.vertices() as usize <= LEAF_VERTICES);
            for slot in 0..16 {
                core::hint::black_box(leaf.triangle(slot));
            }
        }
    }
}
