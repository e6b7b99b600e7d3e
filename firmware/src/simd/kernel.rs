//! Kernels over sixteen lanes, the instructions that they need, and a portable implementation of these.

use photoncard_shared::address::Line;

/// Number of lanes of a kernel.
pub const LANES: usize = 16;
/// Half of [`LANES`]: the number of lanes of a permutation.
pub const HALF_LANES: usize = LANES / 2;

/// An instruction set. A value of an implementing type is the proof that the processor supports it.
pub trait Isa: Copy {
    /// Number of lanes that a loop computes if only the first `used` are needed. It is [`LANES`] if all lanes
    /// cost no more than `used` lanes.
    fn lanes(self, used: usize) -> usize;

    /// Bit mask of the lanes whose value is below `bound`. Lane 0 is the lowest bit.
    fn below(self, values: &[u32; LANES], bound: u32) -> u32;

    /// Copies the lanes of `values` that are set in `mask` to the front of `packed`, in order. The remaining
    /// lanes of `packed` are meaningless.
    fn pack(self, mask: u32, values: &[u32; LANES], packed: &mut [u32; LANES]);

    /// Copies the 64-bit lanes of `values` that are set in `mask` to the front of `packed`, as [`Isa::pack`]
    /// does for 32-bit lanes.
    fn pack_long(self, mask: u32, values: &[u64; LANES], packed: &mut [u64; LANES]);

    /// Returns the values at `indices`. Only the lower four bits of an index count.
    fn permute(self, values: &[f32; LANES], indices: &[u32; HALF_LANES]) -> [f32; HALF_LANES];

    /// Prefetches a line into the processor's cache, if the instruction set supports it.
    #[inline(always)]
    fn prefetch(self, _: &Line) {}
}

/// An inner loop, compiled for every [`Isa`].
pub trait Kernel {
    /// Result of the kernel.
    type Output;

    /// Runs the kernel. This method and everything that it calls must be `#[inline(always)]`, or it is
    /// compiled without the instructions of `isa`.
    fn run(self, isa: impl Isa) -> Self::Output;
}

/// Fallback for every processor, without vector intrinsics.
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
