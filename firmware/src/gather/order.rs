//! Sort keys of deferred reordering: positions on the photon grid, coded along a Hilbert curve.

use photoncard_shared::layout::{GRID_BITS, PhotonGrid};
use photoncard_shared::message::Drain;

use crate::sampler::hash;

/// Number of upper bits of a grid coordinate that select a cell of the Hilbert curve.
const CURVE_BITS: u32 = 10;
/// Number of lower bits of a grid coordinate that are the offset within a cell of the Hilbert curve.
const REST_BITS: u32 = GRID_BITS - CURVE_BITS;
const REST_MASK: u64 = (1 << REST_BITS) - 1;
/// Number of bits of each coordinate of a hash cell: 16 cells along each axis of the grid.
const CELL_BITS: u32 = 4;
/// Number of buckets that hash cells are hashed to.
const BUCKETS: u32 = 256;

/// Number of low bits of a [`HilbertCode`] that hold a ray's length. Three grid coordinates take the others.
const LENGTH_BITS: u32 = u64::BITS - 3 * GRID_BITS;
const MAX_LENGTH: u64 = (1 << LENGTH_BITS) - 1;
/// Minimum length of a ray that codes distinguish, in cells of the photon grid. All shorter rays have code 0.
const LEAST_LENGTH: f32 = 64.0;

/// Position of a gather, rounded to the photon grid: its index along the Hilbert curve through 1024 cells per
/// axis, and the offset within the cell. The low four bits hold a code of the length of the gather ray that
/// ends there: 0 below 64 grid cells, and 1 more for each doubling.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct HilbertCode(u64);

impl HilbertCode {
    /// Code of the first point of the curve.
    pub const ORIGIN: Self = Self(0);

    /// All bits of the code.
    pub const fn bits(self) -> u64 {
        self.0
    }

    /// Code with these bits.
    pub const fn of_bits(bits: u64) -> Self {
        Self(bits)
    }

    /// Number, below `1 << bits`, of the part of the curve that contains the position, if the curve is
    /// divided into parts that are equally long; `bits` is below 64, and at most those of a `usize`.
    pub const fn part(self, bits: u32) -> usize {
        (self.0 >> 1 >> (u64::BITS - 1 - bits)) as usize
    }

    /// Code of the grid point nearest to a position, metres.
    #[inline(always)]
    pub fn new(grid: &PhotonGrid, position: [f32; 3]) -> Self {
        let point = grid.nearest(position);
        let curve = hilbert_index(point.map(|coordinate| coordinate >> REST_BITS), CURVE_BITS);
        let rest = |rest: u64, coordinate: u32| rest << REST_BITS | coordinate as u64 & REST_MASK;
        Self(point.into_iter().fold(curve as u64, rest) << LENGTH_BITS)
    }

    /// Returns the code with the length, metres, of the gather ray that ends at the position.
    #[inline(always)]
    #[must_use]
    pub fn with_length(self, grid: &PhotonGrid, length: f32) -> Self {
        let lengths = length / (grid.cell * LEAST_LENGTH);
        let exponent = (lengths.to_bits() >> (f32::MANTISSA_DIGITS - 1)) as u64;
        let code = (exponent + 1).saturating_sub(f32::MAX_EXP as u64 - 1).min(MAX_LENGTH);
        Self(self.0 & !MAX_LENGTH | code)
    }

    /// Upper bound of the gather ray's length, metres, at most twice the length. It is 64 grid cells for all
    /// shorter rays, and infinite from 2^20 grid cells on.
    #[inline(always)]
    pub fn upper_length(self, grid: &PhotonGrid) -> f32 {
        match self.0 & MAX_LENGTH {
            MAX_LENGTH => f32::INFINITY,
            code => (1_u64 << code) as f32 * LEAST_LENGTH * grid.cell,
        }
    }

    /// Grid point of the code.
    #[inline(always)]
    fn point(self) -> [u32; 3] {
        let place = self.0 >> LENGTH_BITS;
        let [x, y, z] = hilbert_cell((place >> (3 * REST_BITS)) as u32, CURVE_BITS);
        let rest = |axis: u32| (place >> (REST_BITS * (2 - axis)) & REST_MASK) as u32;
        [x << REST_BITS | rest(0), y << REST_BITS | rest(1), z << REST_BITS | rest(2)]
    }

    /// Position of the grid point, metres.
    #[inline(always)]
    pub fn position(self, grid: &PhotonGrid) -> [f32; 3] {
        grid.position(self.point())
    }

    /// Bucket, below [`BUCKETS`], of the hash cell that contains the position.
    fn bucket(self) -> u32 {
        let [x, y, z] = self.point().map(|coordinate| coordinate >> (GRID_BITS - CELL_BITS));
        hash((x << CELL_BITS | y) << CELL_BITS | z) % BUCKETS
    }

    /// Sort key of a gather at this position in the order `drain`.
    #[inline(always)]
    pub fn key(self, drain: Drain) -> u64 {
        match drain {
            Drain::Immediate => 0,
            Drain::Hash => self.bucket() as u64,
            Drain::Sort | Drain::Buckets => self.0,
        }
    }
}

/// Masks of a level of the curve: the level's bit in a coordinate, and all lower bits.
#[inline(always)]
fn level_masks(level: u32) -> (u32, u32) {
    (1 << level, (1 << level) - 1)
}

/// Elementary transform of the curve: mirrors the lower bits of `x` if `other` has the level's bit, else
/// exchanges the lower bits of `x` and `other`. Returns the new `other`.
#[inline(always)]
fn turn(x: &mut u32, other: u32, (bit, below): (u32, u32)) -> u32 {
    if other & bit != 0 {
        *x ^= below;
        return other;
    }
    let exchange = (*x ^ other) & below;
    *x ^= exchange;
    other ^ exchange
}

/// Index of a cell along the 3D Hilbert curve through `2^bits` cells per axis (Skilling 2004, *Programming
/// the Hilbert curve*); `bits` from 1 to 10.
#[inline]
pub fn hilbert_index(cell: [u32; 3], bits: u32) -> u32 {
    let [mut x, mut y, mut z] = cell;
    for level in (1..bits).rev() {
        let masks = level_masks(level);
        if x & masks.0 != 0 {
            x ^= masks.1;
        }
        y = turn(&mut x, y, masks);
        z = turn(&mut x, z, masks);
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

/// Cell at an index along the 3D Hilbert curve: the inverse of [`hilbert_index`].
#[inline]
pub fn hilbert_cell(index: u32, bits: u32) -> [u32; 3] {
    let coordinate =
        |offset: u32| (0..bits).fold(0, |v, level| v | (index >> (3 * level + offset) & 1) << level);
    let [mut x, mut y, mut z] = [coordinate(2), coordinate(1), coordinate(0)];
    let gray = z >> 1;
    z ^= y;
    y ^= x;
    x ^= gray;
    for level in 1..bits {
        let masks = level_masks(level);
        z = turn(&mut x, z, masks);
        y = turn(&mut x, y, masks);
        if x & masks.0 != 0 {
            x ^= masks.1;
        }
    }
    [x, y, z]
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    #[test]
    fn the_hilbert_curve_visits_every_cell_once_and_steps_to_neighbours() {
        const BITS: u32 = 4;
        const SIDE: u32 = 1 << BITS;
        let mut cells = [[u32::MAX; 3]; (SIDE * SIDE * SIDE) as usize];
        for cell in 0..SIDE * SIDE * SIDE {
            let point = [cell / SIDE / SIDE, cell / SIDE % SIDE, cell % SIDE];
            let index = hilbert_index(point, BITS);
            assert_eq!(hilbert_cell(index, BITS), point);
            let visited = &mut cells[index as usize];
            assert_eq!(*visited, [u32::MAX; 3]);
            *visited = point;
        }
        for pair in cells.windows(2) {
            let steps: u32 = (0..3).map(|axis| pair[0][axis].abs_diff(pair[1][axis])).sum();
            assert_eq!(steps, 1, "{pair:?}");
        }
    }

    #[test]
    fn a_code_decodes_to_its_grid_point() {
        let grid = PhotonGrid::around([-1.0, -2.0, 0.0], [1.0, 0.5, 4.0]);
        for i in 0..10_000 {
            let position = [0, 1, 2].map(|axis| -2.0 + 6.0 * (hash(3 * i + axis) >> 8) as f32 / 16_777_216.0);
            let expected = grid.position(grid.nearest(position));
            assert_eq!(HilbertCode::new(&grid, position).position(&grid), expected, "{position:?}");
        }
    }

    #[test]
    fn a_code_holds_a_length_within_a_factor_of_two_and_keeps_the_position() {
        for cell in [1.0 / 1024.0, 1.0, 16.0] {
            let grid = PhotonGrid { origin: [-5; 3], cell };
            let plain = HilbertCode::new(&grid, [1e6, 17.0 * cell, 0.0]);
            assert_eq!(plain.upper_length(&grid), 64.0 * cell);
            for length in [0.0, 0.01, 63.9, 64.0, 65.0, 127.0, 128.0, 1e4, 1e6, f32::INFINITY] {
                let code = plain.with_length(&grid, length * cell);
                assert_eq!(code.position(&grid), plain.position(&grid));
                assert!(code < HilbertCode(plain.0 + MAX_LENGTH + 1) && code >= plain);
                let upper = code.upper_length(&grid) / cell;
                assert!(length < upper || upper == f32::INFINITY, "{length} >= {upper}");
                assert!(!(64.0..1e5).contains(&length) || upper <= 2.0 * length, "{upper} of {length}");
            }
        }
    }

    #[test]
    fn positions_outside_the_grid_have_a_key() {
        for coordinate in [-9e9, 9e9, f32::NAN, f32::INFINITY] {
            let code = HilbertCode::new(&PhotonGrid::UNIT, [coordinate; 3]);
            for drain in [Drain::Hash, Drain::Sort] {
                code.key(drain);
            }
        }
    }

    proptest! {
        #[test]
        fn the_parts_of_the_curve_are_equally_long(code: u64, bits in 0..64.min(usize::BITS)) {
            let length = 1_u128 << (64 - bits);
            prop_assert_eq!(HilbertCode::of_bits(code).part(bits) as u128, u128::from(code) / length);
        }
    }
}
