//! Leaves of the photon map: neighbouring photons in one 128-byte line.
//!
//! A leaf stores photons without loss of precision, because all positions lie on the [`super::PhotonGrid`].
//! Each coordinate is stored as a 16-bit offset from the leaf's corner. The offsets on one axis are
//! contiguous, so that one vector instruction reads all of them.

use super::photon::{PHOTON_CONTENT_BYTES, Photon};
use super::photon_grid::{GRID_BITS, GRID_MASK};
use super::photon_node::GridBox;
use crate::address::LINE_BYTES;

/// A leaf of a photon map, one line.
///
/// | bytes | contents |
/// |---|---|
/// | 0..8 | bits 0-2 varying axes, 3-6 number of photons, then the corner's grid coordinates x, y, z |
/// | 8.. | for each varying axis, the photons' offsets from the corner, two bytes each |
/// | ..128 | contents of the photons, 8 bytes each, in reverse: the first photon's at the end of the line |
///
/// An axis varies if the photons' coordinates on it differ; at least one axis is marked as varying. A corner
/// coordinate takes 20 bits. On a varying axis it is a multiple of 8, and only its upper 17 bits are stored.
/// A photon's content is the last 8 bytes of [`super::Photon`], without the splitting axis.
#[derive(Clone, Copy)]
pub struct PhotonLeaf<'a> {
    line: &'a [u8; LINE_BYTES],
    axes: [LeafAxis; 3],
    photons: u32,
}

/// One axis of a leaf, as stored.
#[derive(Clone, Copy)]
struct LeafAxis {
    corner: u32,
    /// Offset in the line of the first photon's coordinate, bytes.
    first: u32,
    /// Mask that is applied to each offset: all ones, or 0 if the axis does not vary.
    mask: u16,
}

/// Coordinates of a leaf's photons on one axis. The grid coordinate of photon `i` is
/// `corner + (offsets[i] & mask)`.
#[derive(Clone, Copy)]
pub struct LeafCoordinates<'a> {
    /// Grid coordinate of the leaf's corner.
    pub corner: u32,
    /// Offset of each photon from the corner, little-endian. Lanes past the last photon hold other bytes of
    /// the line.
    pub offsets: &'a [[u8; 2]; LEAF_LANES],
    /// Mask that is applied to each offset: all ones, or 0 if the axis does not vary.
    pub mask: u16,
}

/// Maximum number of photons of a leaf.
pub const LEAF_PHOTONS: usize = 12;
/// Number of offsets in [`LeafCoordinates`], at least `LEAF_PHOTONS`.
pub const LEAF_LANES: usize = 16;

const HEADER_BYTES: usize = 8;
const AXES_BITS: u32 = 3;
const COUNT_BITS: u32 = 4;
/// Number of low bits of the corner's coordinate on a varying axis. They are zero and not stored.
const CORNER_ROUNDING: u32 = 3;
const _: () = assert!(HEADER_BYTES + 2 * 2 * LEAF_PHOTONS + 2 * LEAF_LANES <= LINE_BYTES);

/// Returns the maximum number of photons in a leaf if their coordinates differ on `axes` axes.
pub const fn leaf_capacity(axes: usize) -> usize {
    let axes = if axes < 1 { 1 } else { axes };
    (LINE_BYTES - HEADER_BYTES) / (PHOTON_CONTENT_BYTES + 2 * axes)
}

impl<'a> PhotonLeaf<'a> {
    /// Reads a leaf's header.
    #[inline(always)]
    pub fn read(line: &'a [u8; LINE_BYTES]) -> Self {
        let header = line.first_chunk().map_or(0, |&bytes| u64::from_le_bytes(bytes));
        // A number above the maximum occurs in unsound card images only.
        let photons = ((header >> AXES_BITS) as u32 & ((1 << COUNT_BITS) - 1)).min(LEAF_PHOTONS as u32);
        let mut bit = AXES_BITS + COUNT_BITS;
        let mut first = HEADER_BYTES as u32;
        let mut axes = [LeafAxis { corner: 0, first: 0, mask: 0 }; 3];
        // A loop, because compilers may leave `map` as a function call.
        for (axis, read) in (0..).zip(&mut axes) {
            let varies = (header >> axis) as u32 & 1;
            let rounding = varies * CORNER_ROUNDING;
            let bits = GRID_BITS - rounding;
            let corner = ((header >> bit) as u32 & (GRID_MASK >> rounding)) << rounding;
            *read = LeafAxis { corner, first, mask: (varies as u16).wrapping_neg() };
            bit += bits;
            first += varies * 2 * photons;
        }
        Self { line, axes, photons }
    }

    /// Number of photons, at most [`LEAF_PHOTONS`].
    #[inline(always)]
    pub fn photons(&self) -> u32 {
        self.photons
    }

    /// Coordinates of all photons, by axis.
    #[inline(always)]
    pub fn coordinates(&self) -> [LeafCoordinates<'a>; 3] {
        let [x, y, z] = self.axes;
        [self.coordinates_of(x), self.coordinates_of(y), self.coordinates_of(z)]
    }

    #[inline(always)]
    fn coordinates_of(&self, axis: LeafAxis) -> LeafCoordinates<'a> {
        const NONE: &[[u8; 2]; LEAF_LANES] = &[[0; 2]; LEAF_LANES];
        let LeafAxis { corner, first, mask } = axis;
        // Never out of range: with the maximum number of photons, the lanes of the third axis end within the
        // line.
        let bytes = self.line.get(first as usize..).unwrap_or_default();
        LeafCoordinates { corner, offsets: bytes.as_chunks().0.first_chunk().unwrap_or(NONE), mask }
    }

    /// Grid point of photon number `index`.
    #[inline(always)]
    pub fn point(&self, index: u32) -> [u32; 3] {
        let [x, y, z] = self.coordinates();
        [x.coordinate(index), y.coordinate(index), z.coordinate(index)]
    }

    /// Returns the photons' contents (power, direction and flags) in reverse order: the last element is the
    /// content of photon 0. Elements before the content of the last photon hold other bytes of the line.
    #[inline(always)]
    pub fn contents(&self) -> &'a [[u8; PHOTON_CONTENT_BYTES]; LEAF_LANES] {
        const NONE: &[[u8; PHOTON_CONTENT_BYTES]; LEAF_LANES] = &[[0; PHOTON_CONTENT_BYTES]; LEAF_LANES];
        self.line.as_chunks().0.first_chunk().unwrap_or(NONE)
    }

    /// Content of photon number `index`.
    #[inline(always)]
    pub fn content(&self, index: u32) -> [u8; PHOTON_CONTENT_BYTES] {
        self.contents().iter().nth_back(index as usize).copied().unwrap_or_default()
    }

    /// Returns, for each axis, whether a leaf of photons with the bounding box `bounds` stores offsets on
    /// that axis. It does so on the axes on which coordinates differ, or on x if there is no such axis.
    fn varying(bounds: &GridBox) -> [bool; 3] {
        let ([a, b, c], [x, y, z]) = (bounds.lower, bounds.upper);
        let varies = [a != x, b != y, c != z];
        if varies == [false; 3] { [true, false, false] } else { varies }
    }

    /// Returns whether a leaf can hold `photons` photons with this bounding box.
    pub fn fits(bounds: &GridBox, photons: usize) -> bool {
        let varies = Self::varying(bounds);
        let axes = varies.into_iter().filter(|&varies| varies).count();
        let mut sides = varies.into_iter().zip(bounds.lower).zip(bounds.upper);
        let is_near = |((varies, lower), upper): ((bool, u32), u32)| {
            !varies || upper - (lower >> CORNER_ROUNDING << CORNER_ROUNDING) <= u32::from(u16::MAX)
        };
        photons > 0 && photons <= leaf_capacity(axes) && sides.all(is_near)
    }

    /// Encodes a leaf. Returns `None` if there are no photons or the leaf cannot hold them ([`Self::fits`]).
    pub fn encode(photons: &[([u32; 3], [u8; PHOTON_CONTENT_BYTES])]) -> Option<[u8; LINE_BYTES]> {
        let bounds = photons.iter().map(|(point, _)| GridBox::of(*point)).reduce(GridBox::union)?;
        if !Self::fits(&bounds, photons.len()) {
            return None;
        }
        let lower = bounds.lower;
        let varies = Self::varying(&bounds);
        let mut line = [0; LINE_BYTES];
        let mut header = (photons.len() as u64) << AXES_BITS;
        let (mut bit, mut first) = (AXES_BITS + COUNT_BITS, HEADER_BYTES);
        for (axis, (varies, lower)) in varies.into_iter().zip(lower).enumerate() {
            let rounding = if varies { CORNER_ROUNDING } else { 0 };
            let corner = lower >> rounding;
            header |= u64::from(varies) << axis | u64::from(corner) << bit;
            bit += GRID_BITS - rounding;
            if varies {
                let slots = line.get_mut(first..)?.as_chunks_mut().0;
                for (slot, (point, _)) in slots.iter_mut().zip(photons) {
                    *slot = ((point.get(axis)? - (corner << rounding)) as u16).to_le_bytes();
                }
                first += 2 * photons.len();
            }
        }
        *line.first_chunk_mut()? = header.to_le_bytes();
        for (slot, (_, content)) in line.as_chunks_mut().0.iter_mut().rev().zip(photons) {
            *slot = *content;
        }
        Some(line)
    }

    /// Sets the code of the disc fraction (see `Photon`) of photon `index` in a leaf's line. Does nothing if
    /// the leaf has no such photon.
    pub fn set_disc(line: &mut [u8; LINE_BYTES], index: u32, disc: u8) {
        if index >= PhotonLeaf::read(line).photons() {
            return;
        }
        if let Some(content) = line.as_chunks_mut().0.iter_mut().nth_back(index as usize) {
            *content = Photon::content_with_disc(*content, disc);
        }
    }
}

impl LeafCoordinates<'_> {
    #[inline(always)]
    fn coordinate(&self, index: u32) -> u32 {
        let offset = self.offsets.get(index as usize).copied().unwrap_or_default();
        self.corner + u32::from(u16::from_le_bytes(offset) & self.mask)
    }
}

#[cfg(test)]
mod tests {
    extern crate std;

    use std::vec::Vec;

    use super::*;
    use crate::layout::tests::random;

    type Placed = ([u32; 3], [u8; PHOTON_CONTENT_BYTES]);

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
    fn a_leaf_stores_its_photons_exactly() {
        for widths in [[0, 0, 0], [14, 0, 15], [15, 15, 0], [11, 12, 13], [16, 16, 16], [1, 16, 0], [0, 0, 9]]
        {
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
    fn a_line_holds_ten_photons_of_a_wall_eight_of_any_surface_and_twelve_of_an_edge() {
        for (widths, most) in [([15, 0, 15], 10), ([12, 13, 14], 8), ([0, 16, 0], 12), ([0, 0, 0], 12)] {
            assert!(PhotonLeaf::encode(&photons(3, most, widths)).is_some(), "{widths:?}");
            assert!(PhotonLeaf::encode(&photons(3, most + 1, widths)).is_none(), "{widths:?}");
            let axes = widths.iter().filter(|&&width| width > 0).count();
            assert_eq!(leaf_capacity(axes), most);
        }
    }

    #[test]
    fn only_photons_too_far_from_each_other_are_refused() {
        let photon = |coordinate| ([coordinate, 5, 5], [7; 8]);
        assert!(PhotonLeaf::encode(&[photon(8), photon(8 + 0xffff)]).is_some());
        assert!(PhotonLeaf::encode(&[photon(8), photon(8 + 0x1_0000)]).is_none());
        assert!(PhotonLeaf::encode(&[([GRID_MASK; 3], [7; 8])]).is_some());
        assert!(PhotonLeaf::encode(&[]).is_none());
    }

    #[test]
    fn reading_a_photon_leaf_of_arbitrary_bytes_does_not_panic() {
        let mut next = random(2);
        for _ in 0..2000 {
            let line: [u8; LINE_BYTES] = core::array::from_fn(|_| next() as u8);
            let leaf = PhotonLeaf::read(&line);
            for index in 0..leaf.photons() {
                core::hint::black_box((leaf.point(index), leaf.content(index)));
            }
        }
    }
}
