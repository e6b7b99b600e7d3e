//! The record of a waiting gather: position, partial reflection, and the sum that takes its result.

use photoncard_shared::budget::{MAX_IN_FLIGHT, MAX_TILE_PIXELS};

use super::HilbertCode;
use crate::scene::PartialReflection;

/// Gather of photons at a position, whose radiance is added to a gather point's sum; 24 bytes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct GatherRequest {
    /// Position, on the photons' grid.
    pub position: HilbertCode,
    /// Partial reflection times the gather ray's weight, from photon power units to radiance units.
    pub reflection: PartialReflection,
    /// The sum that takes the result.
    pub target: GatherTarget,
}

const _: () = assert!(size_of::<GatherRequest>() == 24);

/// The sum that takes the result of a gather: number of the tile in flight, and the gather point in it; 3
/// bytes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct GatherTarget {
    /// Index of the gather point in 15 bits, and [`Self::OF_RECORD`]; little-endian.
    point: [u8; 2],
    /// Cell of the hemisphere in 5 bits, below the number of the tile in flight in 3.
    cell_and_flight: u8,
}

/// A gather point of a tile in flight.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum PointIndex {
    /// Number of a pixel's sum.
    Pixel(u16),
    /// Index of an irradiance record.
    Record(u16),
}

const CELL_BITS: u32 = 5;
const _: () = assert!(crate::importance::CELLS <= 1 << CELL_BITS);
const _: () = assert!(MAX_IN_FLIGHT <= 1 << (u8::BITS - CELL_BITS));
const _: () = assert!(MAX_TILE_PIXELS <= GatherTarget::OF_RECORD as u32);

impl GatherTarget {
    /// Marks an irradiance record.
    const OF_RECORD: u16 = 1 << 15;

    /// The target of gathers of a point of the tile in flight `flight`, which is below [`MAX_IN_FLIGHT`].
    pub const fn new(flight: usize, point: PointIndex) -> Self {
        let bits = match point {
            PointIndex::Pixel(index) => index & !Self::OF_RECORD,
            PointIndex::Record(index) => index | Self::OF_RECORD,
        };
        Self { point: bits.to_le_bytes(), cell_and_flight: (flight as u8) << CELL_BITS }
    }

    /// The target with the cell of the hemisphere that the gather ray is in.
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

    /// Cell of the hemisphere.
    #[inline(always)]
    pub const fn cell(self) -> u8 {
        self.cell_and_flight & ((1 << CELL_BITS) - 1)
    }

    /// The gather point.
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
    fn a_target_gives_back_its_parts() {
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
