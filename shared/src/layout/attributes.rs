//! Vertex attributes of triangles: normals, texture coordinates and colours.

use super::{Record, read_f32, read_u32, write_f32, write_u32};

/// Encoded [`LeafAttributes`] of a leaf without attributes.
pub const NO_ATTRIBUTES: u32 = u32::MAX;

const NO_NORMALS: u32 = u32::MAX;
const NO_EMITTER: u32 = u32::MAX;
const NORMALS: usize = 0;
const COORDINATES: usize = 12;
const COLOURS: usize = 36;
const EMITTER: usize = 60;

/// Position of the [`Attributes`] of a leaf's triangles. They are consecutive records, in the order of the
/// triangles in the leaf.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct LeafAttributes {
    /// Index of the leaf's first [`Attributes`] record.
    pub first: u32,
    /// True if each triangle has two records, the second for a second set of texture coordinates.
    pub two_sets: bool,
}

const TWO_SETS: u32 = 1 << 31;

impl LeafAttributes {
    /// Decodes a leaf's entry; `None` if the leaf has no attributes.
    #[inline(always)]
    pub fn read(entry: u32) -> Option<Self> {
        let two_sets = entry & TWO_SETS != 0;
        (entry != NO_ATTRIBUTES).then_some(Self { first: entry & !TWO_SETS, two_sets })
    }

    /// Encodes the entry that [`Self::read`] decodes.
    pub fn to_entry(self) -> u32 {
        self.first | if self.two_sets { TWO_SETS } else { 0 }
    }

    /// Returns the index of the [`Attributes`] record that holds texture coordinate set `set`, 0 or 1, of the
    /// leaf's triangle `slot`. The record of set 0 also holds the triangle's other attributes.
    #[inline(always)]
    pub fn record(self, slot: u32, set: u32) -> u32 {
        let index = if self.two_sets { 2 * slot + (set & 1) } else { slot };
        self.first.wrapping_add(index)
    }
}

/// Vertex attributes of one triangle, 64 bytes.
///
/// | bytes | contents |
/// |---|---|
/// | 0..12 | unit normals, 32 bits each: octahedral, 16 bits per axis |
/// | 12..36 | texture coordinates, two `f32` each |
/// | 36..60 | colours, linear RGBA, 16 bits per channel |
/// | 60..64 | index of the triangle's emitter; 2^32 - 1 for none |
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Attributes {
    /// Shading normals at the corners, on the front side; `None` if the triangle is shaded with its geometric
    /// normal.
    pub normals: Option<[[f32; 3]; 3]>,
    /// Texture coordinates of the corners.
    pub coordinates: [[f32; 2]; 3],
    /// Vertex colours, linear RGBA, 0 to 1.
    pub colours: [[f32; 4]; 3],
    /// Index of the triangle's emitter, if it emits.
    pub emitter: Option<u32>,
}

impl Record for Attributes {
    const BYTES: usize = 64;
}

impl Attributes {
    /// Attributes of a triangle that has none: no shading normals, white vertex colours.
    pub const NONE: Self =
        Self { normals: None, coordinates: [[0.0; 2]; 3], colours: [[1.0; 4]; 3], emitter: None };

    /// Reads a record.
    #[inline(always)]
    pub fn read(bytes: &[u8; Self::BYTES]) -> Self {
        let normal = |corner: usize| read_u32(bytes, NORMALS + 4 * corner);
        let emitter = read_u32(bytes, EMITTER);
        Self {
            normals: (normal(0) != NO_NORMALS)
                .then(|| [0, 1, 2].map(|corner| decode_octahedral(normal(corner)))),
            coordinates: [0, 1, 2].map(|corner| Self::coordinate(bytes, corner)),
            colours: [0, 1, 2].map(|corner| {
                let at = COLOURS + 8 * corner;
                let [low, high] = [read_u32(bytes, at), read_u32(bytes, at + 4)];
                [low & 0xffff, low >> 16, high & 0xffff, high >> 16]
                    .map(|channel| channel as f32 * (1.0 / 65535.0))
            }),
            emitter: (emitter != NO_EMITTER).then_some(emitter),
        }
    }

    /// Reads the texture coordinates of one corner, 0 to 2, without the rest of the record.
    #[inline(always)]
    pub fn coordinate(bytes: &[u8; Self::BYTES], corner: usize) -> [f32; 2] {
        let at = COORDINATES + 8 * corner;
        [read_f32(bytes, at), read_f32(bytes, at + 4)]
    }

    /// The record's bytes.
    pub fn to_bytes(&self) -> [u8; Self::BYTES] {
        let mut bytes = [0; Self::BYTES];
        for corner in 0..3 {
            let normal = self.normals.and_then(|normals| normals.get(corner).copied());
            write_u32(&mut bytes, NORMALS + 4 * corner, normal.map_or(NO_NORMALS, encode_octahedral));
            let coordinates = self.coordinates.get(corner).copied().unwrap_or_default();
            for (axis, coordinate) in coordinates.into_iter().enumerate() {
                write_f32(&mut bytes, COORDINATES + 8 * corner + 4 * axis, coordinate);
            }
            let colour = self.colours.get(corner).copied().unwrap_or_default();
            let [red, green, blue, alpha] =
                colour.map(|channel| (channel.clamp(0.0, 1.0) * 65535.0 + 0.5) as u32);
            write_u32(&mut bytes, COLOURS + 8 * corner, red | green << 16);
            write_u32(&mut bytes, COLOURS + 8 * corner + 4, blue | alpha << 16);
        }
        write_u32(&mut bytes, EMITTER, self.emitter.unwrap_or(NO_EMITTER));
        bytes
    }
}

/// Number of quantisation steps of an octahedral coordinate. It is even, so that the axes are exact, and
/// below 2^16 - 1, so that no code equals [`NO_NORMALS`].
const STEPS: f32 = 65534.0;

/// Octahedral code of a unit vector, 16 bits per axis (Cigolle et al. 2014, *A survey of efficient
/// representations for independent unit vectors*).
pub(super) fn encode_octahedral([x, y, z]: [f32; 3]) -> u32 {
    let sum = (abs(x) + abs(y) + abs(z)).max(f32::MIN_POSITIVE);
    let [u, v] = [x / sum, y / sum];
    let [u, v] = if z < 0.0 { fold([u, v]) } else { [u, v] };
    let [u, v] = [u, v].map(|a| ((a * 0.5 + 0.5) * STEPS + 0.5) as u32);
    u | v << 16
}

/// Decodes an octahedral code to a vector, of length 0.57 to 1, in the encoded direction.
#[inline(always)]
pub(super) fn decode_octahedral(code: u32) -> [f32; 3] {
    let [u, v] = [code & 0xffff, code >> 16].map(|a| a as f32 * (2.0 / STEPS) - 1.0);
    let z = 1.0 - abs(u) - abs(v);
    let [x, y] = if z < 0.0 { fold([u, v]) } else { [u, v] };
    [x, y, z]
}

#[inline(always)]
fn fold([u, v]: [f32; 2]) -> [f32; 2] {
    let sign = |a: f32| if a < 0.0 { -1.0 } else { 1.0 };
    [(1.0 - abs(v)) * sign(u), (1.0 - abs(u)) * sign(v)]
}

#[inline(always)]
fn abs(a: f32) -> f32 {
    if a < 0.0 { -a } else { a }
}

#[cfg(test)]
mod tests {
    extern crate std;

    use super::*;
    use crate::layout::tests::random;

    fn unit([x, y, z]: [f32; 3]) -> [f32; 3] {
        let length = (x * x + y * y + z * z).sqrt();
        [x / length, y / length, z / length]
    }

    #[test]
    fn attributes_survive_their_bytes() {
        let attributes = Attributes {
            normals: Some([[1.0, 0.0, 0.0], [0.0, -1.0, 0.0], [0.0, 0.0, -1.0]]),
            coordinates: [[0.5, -3.25], [1e6, 0.1], [0.0, 1.0]],
            colours: [[0.0, 1.0, 0.0, 1.0], [1.0; 4], [0.0; 4]],
            emitter: Some(77),
        };
        assert_eq!(Attributes::read(&attributes.to_bytes()), attributes);
        assert_eq!(Attributes::read(&Attributes::NONE.to_bytes()), Attributes::NONE);
    }

    #[test]
    fn normals_keep_their_direction_to_a_ten_thousandth() {
        let mut next = random(3);
        for _ in 0..10_000 {
            let normal = unit([0, 1, 2].map(|_| next() as u32 as f32 / (1_u64 << 31) as f32 - 1.0));
            let decoded = unit(decode_octahedral(encode_octahedral(normal)));
            assert_ne!(encode_octahedral(normal), NO_NORMALS);
            for (a, b) in normal.into_iter().zip(decoded) {
                assert!(abs(a - b) < 1e-4, "{normal:?} {decoded:?}");
            }
        }
    }

    #[test]
    fn slots_have_one_record_per_texture_coordinate_set() {
        let one = LeafAttributes { first: 40, two_sets: false };
        let two = LeafAttributes { first: 40, two_sets: true };
        assert_eq!([one.record(3, 0), one.record(3, 1)], [43, 43]);
        assert_eq!([two.record(3, 0), two.record(3, 1)], [46, 47]);
        assert_eq!([one, two].map(|leaf| LeafAttributes::read(leaf.to_entry())), [Some(one), Some(two)]);
        assert_eq!(LeafAttributes::read(NO_ATTRIBUTES), None);
    }
}
