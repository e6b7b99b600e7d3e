//! A waiting gather: position, partial reflection, and the sum that the gathered radiance is added to.

use glam::Vec3;
use photoncard_shared::budget::{MAX_IN_FLIGHT, MAX_TILE_PIXELS, MAX_WAITING_BLOCKS, MAX_WAITING_POINTS};

use super::HilbertCode;
use crate::scene::PartialReflection;

/// Request to gather photons at a position and add the radiance to a gather point's sum; 24 bytes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct GatherRequest {
    /// Position on the photon grid, and length of the gather ray that ends there.
    pub position: HilbertCode,
    /// Partial reflection, multiplied by the gather ray's weight and by `photon power unit / radiance unit`.
    pub reflection: PartialReflection,
    /// Sum to which the gathered radiance is added.
    pub target: GatherTarget,
}

/// Length of an encoded request, bytes.
pub const REQUEST_BYTES: usize = 24;
const _: () = assert!(size_of::<GatherRequest>() == REQUEST_BYTES);

impl GatherRequest {
    /// Request that nothing refers to.
    pub const NONE: Self = Self {
        position: HilbertCode::ORIGIN,
        reflection: PartialReflection::NONE,
        target: GatherTarget::new(0, PointIndex::Pixel(0)),
    };

    /// Encodes the request.
    pub fn to_bytes(&self) -> [u8; REQUEST_BYTES] {
        let position = self.position.bits().to_le_bytes().into_iter();
        let parts = position.chain(self.reflection.to_bytes()).chain(self.target.to_bytes());
        let mut bytes = [0; REQUEST_BYTES];
        bytes.iter_mut().zip(parts).for_each(|(byte, part)| *byte = part);
        bytes
    }

    /// Request of the bytes that [`Self::to_bytes`] returned.
    pub fn from_bytes(bytes: &[u8; REQUEST_BYTES]) -> Self {
        let (position, rest) = bytes.split_first_chunk().unwrap_or((&[0; 8], &[]));
        let (reflection, rest) = rest.split_first_chunk().unwrap_or((&[0; 13], &[]));
        let target = rest.first_chunk().copied().unwrap_or_default();
        Self {
            position: HilbertCode::of_bits(u64::from_le_bytes(*position)),
            reflection: PartialReflection::from_bytes(reflection),
            target: GatherTarget::from_bytes(target),
        }
    }
}

/// Length of an encoded request of a Lambertian surface, bytes.
pub(super) const LAMBERTIAN_BYTES: usize = 15;

/// Number of upper bits of a position that a [`LambertianRequest`] leaves out.
pub(super) const OMITTED_BITS: u32 = 8;

/// Request whose reflection has no lobe, without the upper bits of its position: 15 bytes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct LambertianRequest(pub(super) [u8; LAMBERTIAN_BYTES]);

impl LambertianRequest {
    /// Encodes a request; `None` if its reflection has a lobe.
    pub(super) fn new(request: &GatherRequest) -> Option<Self> {
        let [position @ .., _] = request.position.bits().to_le_bytes();
        let reflection = request.reflection.to_lambertian_bytes()?;
        let mut bytes = [0; LAMBERTIAN_BYTES];
        let parts = position.into_iter().chain(reflection).chain(request.target.to_bytes());
        bytes.iter_mut().zip(parts).for_each(|(byte, part)| *byte = part);
        Some(Self(bytes))
    }

    /// Request whose position has the upper bits `part`.
    pub(super) fn request(&self, part: u8) -> GatherRequest {
        let [a, b, c, d, e, f, g, reflection @ .., h, i, j] = self.0;
        GatherRequest {
            position: HilbertCode::of_bits(u64::from_le_bytes([a, b, c, d, e, f, g, part])),
            reflection: PartialReflection::from_lambertian_bytes(reflection),
            target: GatherTarget::from_bytes([h, i, j]),
        }
    }
}

/// Radiance of a light group that a gather has brought, and the sum to which it is added; 15 bytes in card
/// memory. The group is in the signs of the first two channels, which are not negative.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct GatherResult {
    /// Sum to which the radiance is added.
    pub target: GatherTarget,
    /// Light group, below 4.
    pub light_group: u8,
    /// Radiance, in the card image's radiance units.
    pub brought: Vec3,
}

/// Position of the sign bit of an `f32`.
const SIGN: u32 = u32::BITS - 1;
/// Length of an encoded result, bytes.
pub const RESULT_BYTES: usize = 15;

impl GatherResult {
    /// Result without light.
    pub const NONE: Self = Self { target: GatherRequest::NONE.target, light_group: 0, brought: Vec3::ZERO };

    /// Encodes the result.
    pub fn to_bytes(&self) -> [u8; RESULT_BYTES] {
        let signs = [self.light_group & 1, self.light_group >> 1 & 1, 0].map(|bit| u32::from(bit) << SIGN);
        let channels = self.brought.to_array().into_iter().zip(signs);
        let brought =
            channels.flat_map(|(channel, sign)| (channel.to_bits() & !(1 << SIGN) | sign).to_le_bytes());
        let mut bytes = [0; RESULT_BYTES];
        let parts = self.target.to_bytes().into_iter().chain(brought);
        bytes.iter_mut().zip(parts).for_each(|(byte, part)| *byte = part);
        bytes
    }

    /// Result of the bytes that [`Self::to_bytes`] returned.
    pub fn from_bytes(bytes: &[u8; RESULT_BYTES]) -> Self {
        let (target, rest) = bytes.split_first_chunk().unwrap_or((&[0; 3], &[]));
        let channels: [[u8; 4]; 3] = rest.as_chunks().0.first_chunk().copied().unwrap_or_default();
        let [red, green, blue] = channels.map(u32::from_le_bytes);
        let light_group = (red >> SIGN | green >> SIGN << 1) as u8;
        let brought = [red, green, blue].map(|channel| f32::from_bits(channel & !(1 << SIGN)));
        Self { target: GatherTarget::from_bytes(*target), light_group, brought: Vec3::from_array(brought) }
    }
}

/// Identity of the sum to which the radiance of a gather is added, 3 bytes: the tile in flight, the gather
/// point in it, and the cell of the hemisphere that contains the gather ray. A gather that waits in card
/// memory names its block instead, by 3 further bits in place of the upper ones of the point's index.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct GatherTarget {
    /// Index of the gather point in 15 bits, and the flag [`Self::OF_RECORD`]; little-endian.
    point: [u8; 2],
    /// Cell of the hemisphere in the low 5 bits, number of the tile in flight in the high 3.
    cell_and_flight: u8,
}

/// Index of a gather point in a tile in flight.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum PointIndex {
    /// Number of a pixel among the tile's pixels with sums.
    Pixel(u16),
    /// Index of an irradiance record in the tile's cache.
    Record(u16),
}

const CELL_BITS: u32 = 5;
const _: () = assert!(crate::importance::CELLS <= 1 << CELL_BITS);
const _: () = assert!(MAX_IN_FLIGHT <= 1 << (u8::BITS - CELL_BITS));
const _: () = assert!(MAX_TILE_PIXELS <= GatherTarget::OF_RECORD as u32);
/// Number of bits of a number of a tile in flight.
const FLIGHT_BITS: u32 = u8::BITS - CELL_BITS;
/// Number of bits of the index of a gather point in a block whose gathers wait in card memory.
const WAITING_POINT_BITS: u32 = MAX_WAITING_POINTS.ilog2();
const _: () = assert!(MAX_WAITING_BLOCKS * MAX_WAITING_POINTS <= MAX_TILE_PIXELS << FLIGHT_BITS);

impl GatherTarget {
    /// Flag of an irradiance record.
    const OF_RECORD: u16 = 1 << 15;

    /// Target of the gathers of `point` in the tile in flight with number `flight`, which is below
    /// [`MAX_IN_FLIGHT`]. The cell is 0.
    pub const fn new(flight: usize, point: PointIndex) -> Self {
        let bits = match point {
            PointIndex::Pixel(index) => index & !Self::OF_RECORD,
            PointIndex::Record(index) => index | Self::OF_RECORD,
        };
        Self { point: bits.to_le_bytes(), cell_and_flight: (flight as u8) << CELL_BITS }
    }

    /// Target of the gathers of `point` in block number `block`, which is below [`MAX_WAITING_BLOCKS`]; the
    /// point's index is below [`MAX_WAITING_POINTS`]. The cell is 0.
    pub const fn of_block(block: usize, point: PointIndex) -> Self {
        let upper = (block as u16 >> FLIGHT_BITS) << WAITING_POINT_BITS;
        let flight = block & ((1 << FLIGHT_BITS) - 1);
        Self::new(
            flight,
            match point {
                PointIndex::Pixel(index) => PointIndex::Pixel(index | upper),
                PointIndex::Record(index) => PointIndex::Record(index | upper),
            },
        )
    }

    /// Number of the block, and index of the gather point in it, of a target made by [`Self::of_block`].
    #[inline(always)]
    pub const fn block_and_point(self) -> (usize, PointIndex) {
        const POINT: u16 = MAX_WAITING_POINTS as u16 - 1;
        let (index, point) = match self.point() {
            PointIndex::Pixel(index) => (index, PointIndex::Pixel(index & POINT)),
            PointIndex::Record(index) => (index, PointIndex::Record(index & POINT)),
        };
        (self.flight() | (index as usize >> WAITING_POINT_BITS) << FLIGHT_BITS, point)
    }

    /// Returns the target with its cell set to `cell`, which contains the gather ray's direction.
    #[inline(always)]
    #[must_use]
    pub const fn in_cell(self, cell: u8) -> Self {
        let flight = self.cell_and_flight >> CELL_BITS << CELL_BITS;
        Self { cell_and_flight: flight | cell & ((1 << CELL_BITS) - 1), ..self }
    }

    /// Number of the tile in flight.
    #[inline(always)]
    pub const fn flight(self) -> usize {
        (self.cell_and_flight >> CELL_BITS) as usize
    }

    /// Cell of the hemisphere that contains the gather ray.
    #[inline(always)]
    pub const fn cell(self) -> u8 {
        self.cell_and_flight & ((1 << CELL_BITS) - 1)
    }

    /// Encodes the target.
    pub const fn to_bytes(self) -> [u8; 3] {
        let [low, high] = self.point;
        [low, high, self.cell_and_flight]
    }

    /// Target of the bytes that [`Self::to_bytes`] returned.
    pub const fn from_bytes([low, high, cell_and_flight]: [u8; 3]) -> Self {
        Self { point: [low, high], cell_and_flight }
    }

    /// Index of the gather point.
    #[inline(always)]
    pub const fn point(self) -> PointIndex {
        let bits = u16::from_le_bytes(self.point);
        let index = bits & !Self::OF_RECORD;
        if bits == index { PointIndex::Pixel(index) } else { PointIndex::Record(index) }
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;
    use crate::importance::CELLS;

    #[test]
    fn a_target_decodes_to_its_parts() {
        for flight in 0..MAX_IN_FLIGHT as usize {
            for index in [0, 1, 255, 4095, 32_767] {
                for point in [PointIndex::Pixel(index), PointIndex::Record(index)] {
                    for cell in 0..CELLS as u8 {
                        let target = GatherTarget::new(flight, point).in_cell(31).in_cell(cell);
                        assert_eq!((target.flight(), target.point(), target.cell()), (flight, point, cell));
                    }
                }
            }
        }
    }

    #[test]
    fn a_target_of_a_block_decodes_to_its_parts() {
        for block in 0..MAX_WAITING_BLOCKS as usize {
            for index in 0..MAX_WAITING_POINTS as u16 {
                let cell = (index as u8 ^ block as u8) % CELLS as u8;
                for point in [PointIndex::Pixel(index), PointIndex::Record(index)] {
                    let target = GatherTarget::of_block(block, point).in_cell(31).in_cell(cell);
                    assert_eq!((target.block_and_point(), target.cell()), ((block, point), cell));
                }
            }
        }
    }

    proptest! {
        #[test]
        fn requests_and_results_decode_to_their_bytes(
            position: u64,
            reflection: [u8; 13],
            target: [u8; 3],
            brought in [0.0..f32::MAX, 0.0..f32::MAX, 0.0..f32::MAX],
            light_group in 0..4_u8,
        ) {
            let target = GatherTarget::from_bytes(target);
            let position = HilbertCode::of_bits(position);
            let reflection = PartialReflection::from_bytes(&reflection);
            let request = GatherRequest { position, reflection, target };
            prop_assert_eq!(GatherRequest::from_bytes(&request.to_bytes()), request);
            let part = position.part(OMITTED_BITS) as u8;
            if let Some(short) = LambertianRequest::new(&request) {
                prop_assert_eq!(short.request(part), request);
            }
            let [a, b, c, d, .., normal] = request.reflection.to_bytes();
            let reflection = PartialReflection::from_lambertian_bytes([a, b, c, d, normal]);
            let lambertian = GatherRequest { reflection, ..request };
            let short = LambertianRequest::new(&lambertian).map(|short| short.request(part));
            prop_assert_eq!(short, Some(lambertian));
            let result = GatherResult { target, light_group, brought: Vec3::from_array(brought) };
            prop_assert_eq!(GatherResult::from_bytes(&result.to_bytes()), result);
        }
    }
}
