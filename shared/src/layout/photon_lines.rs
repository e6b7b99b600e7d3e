//! The photon map in lines: inner nodes in treelets, photons in leaves that fill a line each.
//!
//! Nothing is lost against [`super::Photon`]: positions lie on a grid in either layout, so that a leaf can tell them by a
//! few bits each from its own corner.

use crate::address::LINE_BYTES;

/// Bits of a coordinate on the grid.
pub const GRID_BITS: u32 = 20;
const GRID_MASK: u32 = (1 << GRID_BITS) - 1;
/// Coordinates are whole numbers below this, so that they are exact as `f32`.
const MOST_COORDINATE: f64 = (1 << 24) as f64;

/// The grid that photons' positions are on: 2^20 cells each way, of which the longest side of the scene takes half or more;
/// fewer far from the origin, where `f32` is coarser than that. A position is `(origin + q) * cell`, exact in `f32`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PhotonGrid {
    /// The lower corner, cells.
    pub origin: [i32; 3],
    /// Side of a cell, metres: a power of two.
    pub cell: f32,
}

impl PhotonGrid {
    /// Cells of a metre from the origin on.
    pub const UNIT: Self = Self { origin: [0; 3], cell: 1.0 };

    /// The finest grid that holds all places of a box.
    pub fn around(lower: [f32; 3], upper: [f32; 3]) -> Self {
        let mut least = f64::from(f32::MIN_POSITIVE);
        for (lower, upper) in lower.into_iter().zip(upper) {
            let [lower, upper] = [f64::from(lower), f64::from(upper)];
            // Two cells are left for rounding at both ends.
            let by_side = (upper - lower) / f64::from(GRID_MASK - 2);
            let by_place = lower.abs().max(upper.abs()) / (MOST_COORDINATE - f64::from(1 << GRID_BITS));
            least = [by_side, by_place].into_iter().filter(|c| c.is_finite()).fold(least, f64::max);
        }
        let cell = power_of_two_above(least);
        let origin = lower.map(|lower| floor(f64::from(lower) / f64::from(cell)));
        Self { origin, cell }
    }

    /// The grid point nearest to a place; of a place outside, the one nearest to it on the grid's border.
    pub fn nearest(&self, place: [f32; 3]) -> [u32; 3] {
        let [x, y, z] = place;
        let [a, b, c] = self.origin;
        [(x, a), (y, b), (z, c)].map(|(coordinate, origin)| {
            let relative = f64::from(coordinate) / f64::from(self.cell) - f64::from(origin);
            ((relative + 0.5) as u32).min(GRID_MASK)
        })
    }

    /// The coordinates of a grid point, metres.
    #[inline(always)]
    pub fn position(&self, point: [u32; 3]) -> [f32; 3] {
        let [x, y, z] = point;
        let [a, b, c] = self.origin;
        [self.metres(a, x), self.metres(b, y), self.metres(c, z)]
    }

    /// One coordinate of a grid point, metres.
    #[inline(always)]
    pub fn coordinate(&self, axis: u8, point: u32) -> f32 {
        let [a, b, c] = self.origin;
        let origin = match axis {
            0 => a,
            1 => b,
            _ => c,
        };
        self.metres(origin, point)
    }

    #[inline(always)]
    fn metres(&self, origin: i32, point: u32) -> f32 {
        // Wraps in unsound images only.
        origin.wrapping_add(point as i32) as f32 * self.cell
    }
}

fn floor(value: f64) -> i32 {
    let towards_zero = value as i32;
    if f64::from(towards_zero) > value { towards_zero - 1 } else { towards_zero }
}

/// The least power of two that is not below `value`, within the normal numbers of `f32`.
pub fn power_of_two_above(value: f64) -> f32 {
    // By the bits, and not by a logarithm, whose last digit differs between systems.
    let bits = value.max(f64::MIN_POSITIVE).to_bits();
    let is_power = bits & ((1 << 52) - 1) == 0;
    let exponent = (bits >> 52) as i32 - 1023 + i32::from(!is_power);
    f32::from_bits(((exponent.clamp(-126, 127) + 127) as u32) << 23)
}

/// A part of the inner tree, one line.
///
/// | bytes | what |
/// |---|---|
/// | 5 i .. 5 i + 3 | node i: its plane, bits 0-19 the grid coordinate, 20-21 the axis |
/// | 5 i + 3, 5 i + 4 | its children below and above the plane: 0 to 23 a node here, 64 + e and 128 + e leaf and treelet e |
/// | 120..124 | index of leaf 0 |
/// | 124..128 | index of treelet 0 |
///
/// The root of the treelet is node 0. Photons on the plane may be on either side.
#[derive(Clone, Copy)]
pub struct PhotonTreelet<'a>(pub &'a [u8; LINE_BYTES]);

/// Nodes that a treelet may have; its exits are at most one more.
pub const TREELET_NODES: usize = 24;
const NODE_BYTES: usize = 5;
const LEAF_EXIT: u8 = 0x40;
const TREELET_EXIT: u8 = 0x80;
const EXIT_MASK: u8 = 0x3f;
const FIRST_LEAF: usize = NODE_BYTES * TREELET_NODES;
const _: () = assert!(FIRST_LEAF + 8 == LINE_BYTES);

/// An inner node of the photon map: a plane, and what is on either side.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct PhotonNode {
    /// The axis across the plane: 0, 1 or 2.
    pub axis: u8,
    /// Grid coordinate of the plane.
    pub plane: u32,
    /// Below and above it.
    pub children: [PhotonChild; 2],
}

/// What is on a side of a plane.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum PhotonChild {
    /// Another node of the treelet.
    Node(u8),
    /// A leaf, by its index in the image.
    Leaf(u32),
    /// A treelet, by its index in the image.
    Treelet(u32),
}

impl PhotonTreelet<'_> {
    /// Bytes of a node.
    pub const NODE_BYTES: u32 = NODE_BYTES as u32;

    /// Node `index`; `None` if there cannot be one.
    #[inline(always)]
    pub fn node(&self, index: u8) -> Option<PhotonNode> {
        let (nodes, _) = self.0.as_chunks::<NODE_BYTES>();
        let &[a, b, c, below, above] = nodes.get(..TREELET_NODES)?.get(index as usize)?;
        let plane = u32::from_le_bytes([a, b, c, 0]);
        Some(PhotonNode {
            axis: (plane >> GRID_BITS & 3) as u8,
            plane: plane & GRID_MASK,
            children: [self.child(below), self.child(above)],
        })
    }

    #[inline(always)]
    fn child(&self, code: u8) -> PhotonChild {
        let exit = u32::from(code & EXIT_MASK);
        if code & TREELET_EXIT != 0 {
            PhotonChild::Treelet(super::read_u32(self.0, FIRST_LEAF + 4).wrapping_add(exit))
        } else if code & LEAF_EXIT != 0 {
            PhotonChild::Leaf(super::read_u32(self.0, FIRST_LEAF).wrapping_add(exit))
        } else {
            PhotonChild::Node(code)
        }
    }

    /// The line of some nodes whose leaves and treelets are numbered from the given first ones on; `None` if there are
    /// too many, or a child is out of reach.
    pub fn encode(nodes: &[PhotonNode], first_leaf: u32, first_treelet: u32) -> Option<[u8; LINE_BYTES]> {
        let mut line = [0; LINE_BYTES];
        let exit = |index: u32, first: u32| {
            let exit = u8::try_from(index.checked_sub(first)?).ok()?;
            (exit <= EXIT_MASK).then_some(exit)
        };
        let (slots, _) = line.as_chunks_mut::<NODE_BYTES>();
        let slots = slots.get_mut(..TREELET_NODES)?;
        if nodes.len() > slots.len() {
            return None;
        }
        for (slot, node) in slots.iter_mut().zip(nodes) {
            let [a, b, c, _] = (node.plane & GRID_MASK | u32::from(node.axis) << GRID_BITS).to_le_bytes();
            let code = |child: PhotonChild| match child {
                PhotonChild::Node(index) => (usize::from(index) < nodes.len()).then_some(index),
                PhotonChild::Leaf(index) => exit(index, first_leaf).map(|exit| LEAF_EXIT | exit),
                PhotonChild::Treelet(index) => exit(index, first_treelet).map(|exit| TREELET_EXIT | exit),
            };
            let [below, above] = node.children.map(code);
            *slot = [a, b, c, below?, above?];
        }
        super::write_u32(&mut line, FIRST_LEAF, first_leaf);
        super::write_u32(&mut line, FIRST_LEAF + 4, first_treelet);
        Some(line)
    }
}

/// Some photons, one line.
///
/// | bits | what |
/// |---|---|
/// | 0..60 | the leaf's corner on the grid: x, y, z, 20 bits each |
/// | 60..64 | number of photons |
/// | 64..79 | bits of a coordinate: x, y, z, 5 bits each |
/// | 80.. | photons: coordinates from the corner on, x, y, z; where they take more than 57 bits, at every 64th |
/// | to 1024 | contents, 8 bytes each, the first photon's at the end of the line |
///
/// Contents are the last 8 bytes of [`super::Photon`], without an axis.
#[derive(Clone, Copy)]
pub struct PhotonLeaf<'a> {
    line: &'a [u8; LINE_BYTES],
    corner: [u32; 3],
    widths: [u32; 3],
    stride: u32,
    photons: u32,
}

/// Bytes of what a photon carries besides its position.
pub const PHOTON_CONTENT_BYTES: usize = 8;
/// Photons that a leaf may have.
pub const LEAF_PHOTONS: usize = 14;
const FIRST_POSITION: u32 = 80;
const LINE_BITS: u32 = 8 * LINE_BYTES as u32;
const CONTENT_BITS: u32 = 8 * PHOTON_CONTENT_BYTES as u32;

/// Bits from one photon's coordinates to the next: what one shifted word of 64 bits can hold.
#[inline(always)]
const fn stride(widths: [u32; 3]) -> u32 {
    let [x, y, z] = widths;
    let all = x + y + z;
    if all > 57 { 64 } else { all }
}

impl<'a> PhotonLeaf<'a> {
    /// Reads a leaf's header.
    #[inline(always)]
    pub fn read(line: &'a [u8; LINE_BYTES]) -> Self {
        let low = word(line, 0);
        let high = word(line, 8);
        let corner = [low, low >> GRID_BITS, low >> (2 * GRID_BITS)].map(|c| c as u32 & GRID_MASK);
        // More than the grid's bits are in unsound images only.
        let widths = [high, high >> 5, high >> 10].map(|w| (w as u32 & 31).min(GRID_BITS));
        let photons = ((low >> 60) as u32).min(LEAF_PHOTONS as u32);
        Self { line, corner, widths, stride: stride(widths), photons }
    }

    /// Number of photons.
    #[inline(always)]
    pub fn photons(&self) -> u32 {
        self.photons
    }

    /// The grid point of photon `index`.
    #[inline(always)]
    pub fn point(&self, index: u32) -> [u32; 3] {
        let bit = FIRST_POSITION + index * self.stride;
        let byte = (bit / 8).min(LINE_BYTES as u32 - 8);
        let bits = word(self.line, byte as usize) >> ((bit - 8 * byte) & 63);
        let [x, y, z] = self.widths;
        let field = |shift: u32, width: u32| (bits >> shift) as u32 & ((1 << width) - 1);
        let [a, b, c] = self.corner;
        [a + field(0, x), b + field(x, y), c + field(x + y, z)]
    }

    /// What photon `index` carries.
    #[inline(always)]
    pub fn content(&self, index: u32) -> [u8; PHOTON_CONTENT_BYTES] {
        let (contents, _) = self.line.as_chunks();
        let last = contents.len() - 1;
        contents.get(last.wrapping_sub(index as usize)).copied().unwrap_or_default()
    }

    /// The line of some photons; `None` if it cannot hold them, or there is none.
    pub fn encode(photons: &[([u32; 3], [u8; PHOTON_CONTENT_BYTES])]) -> Option<[u8; LINE_BYTES]> {
        let (corner, widths) = extent(photons)?;
        let stride = stride(widths);
        let bits = FIRST_POSITION + photons.len() as u32 * (stride + CONTENT_BITS);
        if photons.len() > LEAF_PHOTONS || bits > LINE_BITS {
            return None;
        }
        let mut line = [0; LINE_BYTES];
        let [a, b, c] = corner.map(u64::from);
        let [x, y, z] = widths;
        put(&mut line, 0, a | b << GRID_BITS | c << (2 * GRID_BITS) | (photons.len() as u64) << 60);
        put(&mut line, 64, u64::from(x | y << 5 | z << 10));
        let contents = line.as_chunks_mut().0.iter_mut().rev();
        for (slot, (_, content)) in contents.zip(photons) {
            *slot = *content;
        }
        for (index, (point, _)) in (0..).zip(photons) {
            let [p, q, r] = [0, 1, 2].map(|axis: usize| {
                let [point, corner] = [point, &corner].map(|of| of.get(axis).copied().unwrap_or(0));
                u64::from(point - corner)
            });
            put(&mut line, FIRST_POSITION + index * stride, p | q << x | r << (x + y));
        }
        Some(line)
    }
}

/// The corner of some grid points, and the bits of each coordinate from there; `None` without points.
fn extent(photons: &[([u32; 3], [u8; PHOTON_CONTENT_BYTES])]) -> Option<([u32; 3], [u32; 3])> {
    let (first, _) = photons.first()?;
    let (mut lower, mut upper) = (*first, *first);
    for (point, _) in photons {
        for ((lower, upper), coordinate) in lower.iter_mut().zip(&mut upper).zip(point) {
            *lower = (*lower).min(*coordinate);
            *upper = (*upper).max(*coordinate);
        }
    }
    let [a, b, c] = lower;
    let [x, y, z] = upper;
    Some((lower, [x - a, y - b, z - c].map(|side| u32::BITS - side.leading_zeros())))
}

/// The 64 bits from a byte on; zero past the end.
#[inline(always)]
fn word(line: &[u8; LINE_BYTES], byte: usize) -> u64 {
    match line.get(byte..).and_then(<[u8]>::first_chunk) {
        Some(bytes) => u64::from_le_bytes(*bytes),
        None => 0,
    }
}

/// Sets bits of the line from a bit on, as [`PhotonLeaf::point`] reads them.
fn put(line: &mut [u8; LINE_BYTES], bit: u32, value: u64) {
    let byte = (bit / 8).min(LINE_BYTES as u32 - 8);
    let shifted = value << ((bit - 8 * byte) & 63);
    if let Some(bytes) = line.get_mut(byte as usize..).and_then(<[u8]>::first_chunk_mut) {
        *bytes = (u64::from_le_bytes(*bytes) | shifted).to_le_bytes();
    }
}

#[cfg(test)]
mod tests {
    extern crate std;

    use std::vec::Vec;

    use super::*;

    type Placed = ([u32; 3], [u8; PHOTON_CONTENT_BYTES]);

    fn random(seed: u64) -> impl FnMut() -> u64 {
        let mut state = seed.wrapping_mul(0x9e37_79b9_7f4a_7c15) | 1;
        move || {
            state ^= state << 13;
            state ^= state >> 7;
            state ^= state << 17;
            state
        }
    }

    fn photons(seed: u64, count: usize, widths: [u32; 3]) -> Vec<Placed> {
        let mut next = random(seed);
        let corner = widths.map(|width| next() as u32 & (GRID_MASK >> 1) & !((1 << width) - 1));
        (0..count)
            .map(|_| {
                let point = [0, 1, 2].map(|axis| corner[axis] + (next() as u32 & ((1 << widths[axis]) - 1)));
                (point, next().to_le_bytes())
            })
            .collect()
    }

    #[test]
    fn a_leaf_gives_back_its_photons_to_the_last_bit() {
        for widths in [[0, 0, 0], [14, 0, 15], [15, 15, 0], [11, 12, 13], [19, 19, 19], [1, 19, 0]] {
            for count in 1..=LEAF_PHOTONS {
                for seed in 0..20 {
                    let photons = photons(seed, count, widths);
                    let Some(line) = PhotonLeaf::encode(&photons) else { continue };
                    let leaf = PhotonLeaf::read(&line);
                    assert_eq!(leaf.photons(), count as u32);
                    for (index, photon) in (0..).zip(&photons) {
                        assert_eq!((leaf.point(index), leaf.content(index)), *photon, "{widths:?} {count}");
                    }
                }
            }
        }
    }

    #[test]
    fn a_line_holds_ten_photons_of_a_wall_and_always_seven() {
        assert!(PhotonLeaf::encode(&photons(3, 10, [15, 0, 15])).is_some());
        assert!(PhotonLeaf::encode(&photons(3, LEAF_PHOTONS, [0, 0, 0])).is_some());
        let corners = [[0; 3], [GRID_MASK; 3]].map(|point| (point, [7; 8]));
        let spread = corners.repeat(4);
        assert!(PhotonLeaf::encode(&spread[..7]).is_some());
        assert!(PhotonLeaf::encode(&spread).is_none());
        assert!(PhotonLeaf::encode(&[]).is_none());
    }

    #[test]
    fn a_treelet_gives_back_its_nodes_and_refuses_what_is_out_of_reach() {
        let node = |axis, children| PhotonNode { axis, plane: GRID_MASK - 5, children };
        let nodes = [
            node(0, [PhotonChild::Node(1), PhotonChild::Treelet(1001)]),
            node(2, [PhotonChild::Leaf(500), PhotonChild::Leaf(501)]),
        ];
        let line = PhotonTreelet::encode(&nodes, 500, 1000).expect("fits");
        let treelet = PhotonTreelet(&line);
        assert_eq!(treelet.node(0), Some(nodes[0]));
        assert_eq!(treelet.node(1), Some(nodes[1]));
        assert_eq!(treelet.node(TREELET_NODES as u8), None);
        assert!(PhotonTreelet::encode(&nodes, 400, 1000).is_none());
        assert!(PhotonTreelet::encode(&nodes, 501, 1000).is_none());
        assert!(PhotonTreelet::encode(&[nodes[1]; 25], 500, 1000).is_none());
    }

    #[test]
    fn places_on_the_grid_are_exact_and_the_nearest_is_half_a_cell_away() {
        let boxes = [
            ([0.0; 3], [0.5528, 0.5488, 0.5592]),
            ([-20.0, 0.0, -7.5], [20.0, 12.0, 7.5]),
            ([1e6; 3], [1e6 + 1.0; 3]),
            ([-1e-20; 3], [1e-20; 3]),
            ([3.0; 3], [3.0; 3]),
            ([-1e37; 3], [1e37; 3]),
        ];
        let mut next = random(1);
        for (lower, upper) in boxes {
            let grid = PhotonGrid::around(lower, upper);
            for _ in 0..1000 {
                let place: [f32; 3] = [0, 1, 2].map(|axis: usize| {
                    let t = (next() >> 40) as f32 / 16_777_216.0;
                    lower[axis] * (1.0 - t) + upper[axis] * t
                });
                let point = grid.nearest(place);
                let snapped = grid.position(point);
                assert_eq!(grid.nearest(snapped), point, "{place:?} of {grid:?}");
                for axis in 0..3 {
                    let error = f64::from(snapped[axis]) - f64::from(place[axis]);
                    assert!(error.abs() <= 0.5 * f64::from(grid.cell), "{place:?} {snapped:?} {grid:?}");
                    let exact =
                        (f64::from(grid.origin[axis]) + f64::from(point[axis])) * f64::from(grid.cell);
                    assert_eq!(f64::from(snapped[axis]), exact);
                    assert_eq!(snapped[axis], grid.coordinate(axis as u8, point[axis]));
                }
            }
        }
    }

    #[test]
    fn units_are_the_next_power_of_two() {
        for (value, unit) in [(1.0, 1.0), (1.1, 2.0), (0.3, 0.5), (0.25, 0.25), (1e6, 1_048_576.0)] {
            assert_eq!(power_of_two_above(value), unit);
        }
        for extreme in [0.0, 1e-300, 1e300, f64::INFINITY] {
            assert!(power_of_two_above(extreme).is_normal());
        }
    }

    #[test]
    fn whatever_a_line_holds_reading_it_ends() {
        let mut next = random(2);
        for _ in 0..2000 {
            let line: [u8; LINE_BYTES] = core::array::from_fn(|_| next() as u8);
            let leaf = PhotonLeaf::read(&line);
            for index in 0..leaf.photons() {
                core::hint::black_box((leaf.point(index), leaf.content(index)));
            }
            for index in 0..=u8::MAX {
                core::hint::black_box(PhotonTreelet(&line).node(index));
            }
        }
    }
}
