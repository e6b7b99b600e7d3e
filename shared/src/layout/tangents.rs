//! Tangents at triangle corners: the x axes of normal maps.

use super::attributes::{decode_octahedral, encode_octahedral};
use super::{Attributes, LEAF_TRIANGLES, LeafAttributes, Record, read_u32, write_u32};

/// Code that marks a corner without a tangent.
const NO_TANGENT: u32 = u32::MAX;
const SIGNS: usize = 12;

/// Tangents at the corners of one triangle, 16 bytes.
///
/// | bytes | contents |
/// |---|---|
/// | 0..12 | tangents, 32 bits each: octahedral, 16 bits per axis; all ones for none |
/// | 12..16 | bit `i`, 0 to 2: set if the sign of corner `i` is -1 |
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Tangents {
    /// Tangents of the corners, of length 0.57 to 1. A zero vector stands for no tangent: a normal map has no
    /// effect there.
    pub directions: [[f32; 3]; 3],
    /// Signs of the corners, 1 or -1 (glTF's `TANGENT.w`): the bitangent is `sign * (normal x tangent)`.
    pub signs: [f32; 3],
}

impl Tangents {
    const BYTES: usize = 16;

    /// Number of triangles whose tangents one record holds. A record has the size of [`Attributes`].
    const PER_RECORD: usize = Attributes::BYTES / Self::BYTES;

    /// Number of records with tangents before the first [`Attributes`] of a leaf.
    pub const RECORDS: usize = LEAF_TRIANGLES / Self::PER_RECORD;

    /// Tangents of a triangle that has none.
    pub const NONE: Self = Self { directions: [[0.0; 3]; 3], signs: [1.0; 3] };

    /// Returns the index, among the [`Attributes`], of the record with the tangents of triangle `slot` of a
    /// leaf. Only leaves with a normal-mapped material have these records.
    #[inline(always)]
    pub fn locate(leaf: LeafAttributes, slot: u32) -> u32 {
        leaf.first.wrapping_sub(Self::RECORDS as u32).wrapping_add(Self::record(slot))
    }

    /// Reads the tangents of triangle `slot` from the record at [`Self::locate`].
    #[inline(always)]
    pub fn read(bytes: &[u8; Attributes::BYTES], slot: u32) -> Self {
        let at = Self::offset(slot);
        let signs = read_u32(bytes, at + SIGNS);
        Self {
            directions: [0, 1, 2].map(|corner| match read_u32(bytes, at + 4 * corner) {
                NO_TANGENT => [0.0; 3],
                code => decode_octahedral(code),
            }),
            signs: [0, 1, 2].map(|corner| if signs >> corner & 1 == 0 { 1.0 } else { -1.0 }),
        }
    }

    /// Encodes the tangents of a leaf's triangles, in the order of their slots.
    pub fn to_records(leaf: &[Self]) -> [[u8; Attributes::BYTES]; Self::RECORDS] {
        let mut records = [[0; Attributes::BYTES]; Self::RECORDS];
        for (slot, tangents) in (0..).zip(leaf) {
            if let Some(record) = records.get_mut(Self::record(slot) as usize) {
                tangents.write(record, Self::offset(slot));
            }
        }
        records
    }

    fn write(&self, bytes: &mut [u8; Attributes::BYTES], at: usize) {
        let mut signs = 0;
        for (corner, (direction, sign)) in self.directions.into_iter().zip(self.signs).enumerate() {
            let code = if direction == [0.0; 3] { NO_TANGENT } else { encode_octahedral(direction) };
            write_u32(bytes, at + 4 * corner, code);
            signs |= u32::from(sign < 0.0) << corner;
        }
        write_u32(bytes, at + SIGNS, signs);
    }

    /// Returns the number, 0 to [`Self::RECORDS`] - 1, of the record that holds the tangents of triangle
    /// `slot`.
    #[inline(always)]
    fn record(slot: u32) -> u32 {
        slot / Self::PER_RECORD as u32
    }

    #[inline(always)]
    fn offset(slot: u32) -> usize {
        slot as usize % Self::PER_RECORD * Self::BYTES
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn tangents_survive_their_records() {
        let axis = |axis: usize, sign: f32| core::array::from_fn(|k| if k == axis { sign } else { 0.0 });
        let leaf: [Tangents; LEAF_TRIANGLES] = core::array::from_fn(|slot| Tangents {
            directions: [axis(slot % 3, 1.0), axis((slot + 1) % 3, -1.0), [0.0; 3]],
            signs: [0, 1, 2].map(|corner| if slot >> corner & 1 == 0 { 1.0 } else { -1.0 }),
        });
        let records = Tangents::to_records(&leaf);
        for (slot, tangents) in (0..).zip(leaf) {
            assert_eq!(Tangents::read(&records[Tangents::record(slot) as usize], slot), tangents, "{slot}");
        }
    }

    #[test]
    fn tangents_lie_before_the_attributes() {
        for two_sets in [false, true] {
            let leaf = LeafAttributes { first: 40, two_sets };
            assert_eq!([0, 3, 4, 7].map(|slot| Tangents::locate(leaf, slot)), [38, 38, 39, 39]);
        }
    }

    #[test]
    fn a_leaf_has_a_fixed_number_of_tangent_records() {
        let one = Tangents { directions: [[0.0, 1.0, 0.0]; 3], signs: [-1.0; 3] };
        let records = Tangents::to_records(&[one]);
        assert_eq!((records.len(), Tangents::read(&records[0], 0)), (Tangents::RECORDS, one));
    }
}
