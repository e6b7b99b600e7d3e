//! Kernels over sixteen lanes, the instructions that they ask for, and those of every processor.

use photoncard_shared::address::Line;

/// Numbers that are computed at once.
pub const LANES: usize = 16;
/// Half of [`LANES`]: the length of a permutation.
pub const HALF_LANES: usize = LANES / 2;

/// Instructions of a processor. A value of a type is the proof that the processor has them.
pub trait Isa: Copy {
    /// How many lanes to compute if `used` are asked for: all, where they cost no more.
    fn lanes(self, used: usize) -> usize;

    /// A bit for every lane that is below a bound.
    fn below(self, values: &[u32; LANES], bound: u32) -> u32;

    /// Moves the lanes of a mask to the front of `packed`, in their order. What lies behind is of no use.
    fn pack(self, mask: u32, values: &[u32; LANES], packed: &mut [u32; LANES]);

    /// [`Isa::pack`] for 64-bit lanes.
    fn pack_long(self, mask: u32, values: &[u64; LANES], packed: &mut [u64; LANES]);

    /// The values with these indices, of which the lower four bits count.
    fn permute(self, values: &[f32; LANES], indices: &[u32; HALF_LANES]) -> [f32; HALF_LANES];

    /// Has a line brought near, if the processor can, as it may be read soon.
    #[inline(always)]
    fn prefetch(self, _: &Line) {}
}

/// An inner loop that is compiled for every [`Isa`].
pub trait Kernel {
    /// Its result.
    type Output;

    /// Does it. To be inlined always, as must be all that it calls, or it is compiled for [`Portable`] whatever `isa` is.
    fn run(self, isa: impl Isa) -> Self::Output;
}

/// The instructions of every processor: plain loops.
#[derive(Clone, Copy, Debug)]
pub struct Portable;

impl Isa for Portable {
    #[inline(always)]
    fn lanes(self, used: usize) -> usize {
        used.min(LANES)
    }

    #[inline(always)]
    fn below(self, values: &[u32; LANES], bound: u32) -> u32 {
        (0..).zip(values).fold(0, |mask, (lane, &value)| mask | u32::from(value < bound) << lane)
    }

    #[inline(always)]
    fn pack(self, mask: u32, values: &[u32; LANES], packed: &mut [u32; LANES]) {
        pack(mask, values, packed);
    }

    #[inline(always)]
    fn pack_long(self, mask: u32, values: &[u64; LANES], packed: &mut [u64; LANES]) {
        pack(mask, values, packed);
    }

    #[inline(always)]
    fn permute(self, values: &[f32; LANES], indices: &[u32; HALF_LANES]) -> [f32; HALF_LANES] {
        indices.map(|index| values.get(index as usize % LANES).copied().unwrap_or(0.0))
    }
}

#[inline(always)]
fn pack<T: Copy>(mut mask: u32, values: &[T; LANES], packed: &mut [T; LANES]) {
    for target in packed {
        let Some(value) = values.get(mask.trailing_zeros() as usize) else { break };
        *target = *value;
        mask &= mask - 1;
    }
}
