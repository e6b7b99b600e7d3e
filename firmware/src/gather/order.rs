//! Keys of deferred reordering: requests are done in the order of a number that their place gives.

use glam::Vec3;
use photoncard_shared::layout::BvhNode;
use photoncard_shared::message::Drain;

use crate::sampler::hash;
use crate::vector::{max, min};

/// Bits of a Hilbert key's coordinates.
const HILBERT_BITS: u32 = 10;
/// Bits of a hash cell's coordinates: 16 cells each way.
const CELL_BITS: u32 = 4;
/// Buckets that cells are hashed to.
const BUCKETS: u32 = 256;
/// Requests of one bucket keep the order of their arrival, told by so many bits.
const ARRIVAL_BITS: u32 = 24;

/// The scene's box, by which a place becomes a cell.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct KeyScale {
    lower: Vec3,
    inverse_size: Vec3,
}

impl KeyScale {
    /// A scale of which every place is in the first cell.
    pub const POINT: Self = Self { lower: Vec3::ZERO, inverse_size: Vec3::ZERO };

    /// Of the box of all children of the root.
    pub fn new(root: &BvhNode) -> Self {
        let lower = root.lower.map(|corners| corners.into_iter().fold(f32::INFINITY, min));
        let upper = root.upper.map(|corners| corners.into_iter().fold(f32::NEG_INFINITY, max));
        let [lower, upper] = [lower, upper].map(Vec3::from_array);
        let size = (upper - lower).max(Vec3::splat(f32::MIN_POSITIVE));
        Self { lower, inverse_size: size.recip() }
    }

    /// The cell of a place, of `2^bits` each way; places outside the box are in the cell nearest to them.
    #[inline(always)]
    fn cell(&self, position: Vec3, bits: u32) -> [u32; 3] {
        let cells = 1_u32 << bits;
        let relative = (position - self.lower) * self.inverse_size * cells as f32;
        // The conversion takes what is below zero, or no number, as zero.
        relative.to_array().map(|coordinate| (coordinate as u32).min(cells - 1))
    }

    /// The key of a request that came as number `arrival` since the queue was last empty.
    #[inline(always)]
    pub fn key(&self, drain: Drain, position: Vec3, arrival: u32) -> u32 {
        match drain {
            Drain::Immediate => arrival,
            Drain::Hash => {
                let [x, y, z] = self.cell(position, CELL_BITS);
                let bucket = hash((x << CELL_BITS | y) << CELL_BITS | z) % BUCKETS;
                bucket << ARRIVAL_BITS | arrival
            }
            Drain::Sort => hilbert_index(self.cell(position, HILBERT_BITS), HILBERT_BITS),
        }
    }
}

/// The place of a cell along the Hilbert curve through `2^bits` cells each way (Skilling 2004, *Programming the Hilbert
/// curve*); `bits` from 1 to 10.
pub fn hilbert_index(cell: [u32; 3], bits: u32) -> u32 {
    let [mut x, mut y, mut z] = cell;
    for level in (1..bits).rev() {
        let (bit, below) = (1 << level, (1 << level) - 1);
        let turn = |x: &mut u32, other: u32| {
            if other & bit != 0 {
                *x ^= below;
                return other;
            }
            let exchange = (*x ^ other) & below;
            *x ^= exchange;
            other ^ exchange
        };
        let first = x;
        if first & bit != 0 {
            x ^= below;
        }
        y = turn(&mut x, y);
        z = turn(&mut x, z);
    }
    y ^= x;
    z ^= y;
    let mut gray = 0;
    for level in 1..bits {
        if z >> level & 1 != 0 {
            gray ^= (1 << level) - 1;
        }
    }
    let [x, y, z] = [x ^ gray, y ^ gray, z ^ gray];
    (0..bits).rev().fold(0, |index, level| {
        let bit = |v: u32| v >> level & 1;
        index << 3 | bit(x) << 2 | bit(y) << 1 | bit(z)
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_hilbert_curve_visits_every_cell_once_and_steps_to_neighbours() {
        const BITS: u32 = 4;
        const SIDE: u32 = 1 << BITS;
        let mut cells = [[u32::MAX; 3]; (SIDE * SIDE * SIDE) as usize];
        for cell in 0..SIDE * SIDE * SIDE {
            let place = [cell / SIDE / SIDE, cell / SIDE % SIDE, cell % SIDE];
            let visited = &mut cells[hilbert_index(place, BITS) as usize];
            assert_eq!(*visited, [u32::MAX; 3]);
            *visited = place;
        }
        for pair in cells.windows(2) {
            let steps: u32 = (0..3).map(|axis| pair[0][axis].abs_diff(pair[1][axis])).sum();
            assert_eq!(steps, 1, "{pair:?}");
        }
    }

    #[test]
    fn places_outside_the_box_have_a_key() {
        let mut root = BvhNode::EMPTY;
        for axis in 0..3 {
            root.lower[axis][0] = -1.0;
            root.upper[axis][0] = 1.0;
        }
        let scale = KeyScale::new(&root);
        for place in [-9.0, 9.0, f32::NAN, f32::INFINITY] {
            for drain in [Drain::Hash, Drain::Sort] {
                scale.key(drain, Vec3::splat(place), 3);
            }
        }
        assert_eq!(scale.cell(Vec3::splat(0.999), 4), [15; 3]);
    }
}
