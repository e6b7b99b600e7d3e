//! A waiting gather: position, partial reflection, and the sum that the gathered radiance is added to.

use photoncard_shared::budget::{MAX_IN_FLIGHT, MAX_TILE_PIXELS};

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

const _: () = assert!(size_of::<GatherRequest>() == 24);

/// Identity of the sum to which the radiance of a gather is added, 3 bytes: the tile in flight, the gather
/// point in it, and the cell of the hemisphere that contains the gather ray.
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
}
