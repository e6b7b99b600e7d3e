//! Implementation of [`Isa`] by the 128-bit vectors of WebAssembly.

use core::arch::wasm32::{
    i8x16_narrow_i16x8, i16x8_narrow_i32x4, u8x16_bitmask, u8x16_shuffle, u8x16_splat, u8x16_sub,
    u8x16_swizzle, u32x4, u32x4_extract_lane, u32x4_ge, u32x4_shl, u32x4_splat, v128, v128_and, v128_or,
};

use super::kernel::{HALF_LANES, Isa, LANES};

/// `simd128`: four lanes in one register.
#[derive(Clone, Copy, Debug)]
pub(super) struct Simd128;

/// Lanes of a register.
const WIDTH: usize = 4;
/// 64-bit lanes of a register.
const LONG_WIDTH: usize = 2;

/// Bytes of the set lanes, ascending, for each mask of a register's lanes.
#[expect(clippy::indexing_slicing, reason = "computed at compile time")]
static BYTES_OF: [v128; 1 << WIDTH] = {
    let mut bytes_of = [u32x4(0, 0, 0, 0); 1 << WIDTH];
    let mut mask = 0;
    while mask < bytes_of.len() {
        let (mut bytes, mut lane, mut count) = ([0; WIDTH], 0, 0);
        while lane < WIDTH {
            if mask >> lane & 1 != 0 {
                bytes[count] = 0x0302_0100 + 0x0404_0404 * lane as u32;
                count += 1;
            }
            lane += 1;
        }
        let [a, b, c, d] = bytes;
        bytes_of[mask] = u32x4(a, b, c, d);
        mask += 1;
    }
    bytes_of
};

impl Isa for Simd128 {
    #[inline(always)]
    fn lanes(self, _: usize) -> usize {
        LANES
    }

    #[inline(always)]
    fn below(self, values: &[u32; LANES], bound: u32) -> u32 {
        let bound = u32x4_splat(bound);
        let mut reached = [bound; LANES / WIDTH];
        for (reached, values) in reached.iter_mut().zip(values.as_chunks().0) {
            *reached = u32x4_ge(load(*values), bound);
        }
        // The lanes are 0 or -1, also as shorter signed numbers.
        let [a, b, c, d] = reached;
        let reached = i8x16_narrow_i16x8(i16x8_narrow_i32x4(a, b), i16x8_narrow_i32x4(c, d));
        u32::from(!u8x16_bitmask(reached))
    }

    #[inline(always)]
    fn pack(self, mask: u32, values: &[u32; LANES], packed: &mut [u32; LANES]) {
        let mut mask = mask;
        let mut count = 0;
        for &values in values.as_chunks().0 {
            let lanes = mask % (1 << WIDTH);
            mask >>= WIDTH;
            // There is room: a register is written behind at most as many lanes as were read.
            let target = packed.get_mut(count..).and_then(<[u32]>::first_chunk_mut);
            if let (Some(target), Some(&bytes)) = (target, BYTES_OF.get(lanes as usize)) {
                store(u8x16_swizzle(load(values), bytes), target);
            }
            count += lanes.count_ones() as usize;
        }
    }

    #[inline(always)]
    fn pack_long(self, mask: u32, values: &[u64; LANES], packed: &mut [u64; LANES]) {
        let mut mask = mask;
        let mut count = 0;
        for &[lower, upper] in values.as_chunks::<LONG_WIDTH>().0 {
            let lanes = mask % (1 << LONG_WIDTH);
            mask >>= LONG_WIDTH;
            // There is room, as in `pack`.
            let target = packed.get_mut(count..).and_then(<[u64]>::first_chunk_mut::<LONG_WIDTH>);
            if let Some(target) = target {
                *target = [if lanes & 1 != 0 { lower } else { upper }, upper];
            }
            count += lanes.count_ones() as usize;
        }
    }

    #[inline(always)]
    fn permute(self, values: &[f32; LANES], indices: &[u32; HALF_LANES]) -> [f32; HALF_LANES] {
        let values = values.map(f32::to_bits);
        let mut permuted = [0; HALF_LANES];
        for (permuted, &indices) in permuted.as_chunks_mut().0.iter_mut().zip(indices.as_chunks().0) {
            // The bytes of each value's four, counted from the first value.
            let first = u32x4_shl(load(indices), 2);
            let first = u8x16_shuffle::<0, 0, 0, 0, 4, 4, 4, 4, 8, 8, 8, 8, 12, 12, 12, 12>(first, first);
            let mut bytes = v128_or(v128_and(first, u8x16_splat(63)), u32x4_splat(0x0302_0100));
            let mut found = u32x4_splat(0);
            for &values in values.as_chunks().0 {
                // Bytes of other registers are out of range here, for which a swizzle gives 0.
                found = v128_or(found, u8x16_swizzle(load(values), bytes));
                bytes = u8x16_sub(bytes, u8x16_splat(16));
            }
            store(found, permuted);
        }
        permuted.map(f32::from_bits)
    }
}

#[inline(always)]
fn load([a, b, c, d]: [u32; WIDTH]) -> v128 {
    u32x4(a, b, c, d)
}

#[inline(always)]
fn store(vector: v128, lanes: &mut [u32; WIDTH]) {
    *lanes = [
        u32x4_extract_lane::<0>(vector),
        u32x4_extract_lane::<1>(vector),
        u32x4_extract_lane::<2>(vector),
        u32x4_extract_lane::<3>(vector),
    ];
}
