//! Implementation of [`Isa`] by AVX2 and AVX-512 of x86-64.
#![cfg_attr(not(test), expect(clippy::indexing_slicing, reason = "the tables have an entry for every index"))]

use core::arch::x86_64::{
    __m256i, _MM_HINT_T0, _mm_cvtsi64_si128, _mm_prefetch, _mm256_blendv_ps, _mm256_castsi256_ps,
    _mm256_cmpgt_epi32, _mm256_cvtepu8_epi32, _mm256_loadu_ps, _mm256_loadu_si256, _mm256_movemask_ps,
    _mm256_permutevar8x32_epi32, _mm256_permutevar8x32_ps, _mm256_permutex2var_ps, _mm256_set1_epi32,
    _mm256_slli_epi32, _mm256_storeu_ps, _mm256_storeu_si256, _mm256_xor_si256, _mm512_cmplt_epu32_mask,
    _mm512_loadu_si512, _mm512_maskz_compress_epi32, _mm512_maskz_compress_epi64, _mm512_set1_epi32,
    _mm512_storeu_si512,
};

use photoncard_shared::address::Line;

use super::kernel::{HALF_LANES, Isa, Kernel, LANES, Portable};

cpufeatures::new!(
    has_avx512, "avx512f", "avx512bw", "avx512dq", "avx512vl", "avx2", "bmi1", "bmi2", "popcnt"
);
cpufeatures::new!(has_avx2, "avx2", "bmi1", "bmi2", "popcnt");

/// AVX-512: sixteen lanes in one register.
#[derive(Clone, Copy)]
struct Avx512(());

/// AVX2: eight lanes in one register.
#[derive(Clone, Copy)]
struct Avx2(());

impl Avx512 {
    #[inline(always)]
    fn detect() -> Option<Self> {
        has_avx512::get().then_some(Self(()))
    }

    #[target_feature(enable = "avx512f,avx512bw,avx512dq,avx512vl,avx2,bmi1,bmi2,popcnt")]
    fn compile<K: Kernel>(self, kernel: K) -> K::Output {
        kernel.run(self)
    }

    #[inline(always)]
    fn run<K: Kernel>(self, kernel: K) -> K::Output {
        // SAFETY: an `Avx512` exists only where the processor has the instructions.
        unsafe { self.compile(kernel) }
    }
}

impl Avx2 {
    #[inline(always)]
    fn detect() -> Option<Self> {
        has_avx2::get().then_some(Self(()))
    }

    #[target_feature(enable = "avx2,bmi1,bmi2,popcnt")]
    fn compile<K: Kernel>(self, kernel: K) -> K::Output {
        kernel.run(self)
    }

    #[inline(always)]
    fn run<K: Kernel>(self, kernel: K) -> K::Output {
        // SAFETY: an `Avx2` exists only where the processor has the instructions.
        unsafe { self.compile(kernel) }
    }
}

#[inline(always)]
pub(super) fn run<K: Kernel>(kernel: K) -> K::Output {
    match (Avx512::detect(), Avx2::detect()) {
        (Some(isa), _) => isa.run(kernel),
        (None, Some(isa)) => isa.run(kernel),
        (None, None) => kernel.run(Portable),
    }
}

pub(super) fn run_with_avx2<K: Kernel>(kernel: K) -> Option<K::Output> {
    Avx2::detect().map(|isa| isa.run(kernel))
}

pub(super) fn run_with_avx512<K: Kernel>(kernel: K) -> Option<K::Output> {
    Avx512::detect().map(|isa| isa.run(kernel))
}

/// Cache line of x86-64 processors, bytes.
const CACHE_LINE_BYTES: usize = 64;

#[inline(always)]
fn prefetch(line: &Line) {
    for part in line.0.chunks(CACHE_LINE_BYTES) {
        // SAFETY: every x86-64 processor has the instruction, which changes nothing that a program can see.
        unsafe { _mm_prefetch::<_MM_HINT_T0>(part.as_ptr().cast()) };
    }
}

impl Isa for Avx512 {
    #[inline(always)]
    fn lanes(self, _: usize) -> usize {
        LANES
    }

    #[inline(always)]
    fn below(self, values: &[u32; LANES], bound: u32) -> u32 {
        // SAFETY: the processor has AVX-512; sixteen numbers of four bytes are read, as many as there are.
        unsafe {
            let values = _mm512_loadu_si512(values.as_ptr().cast());
            u32::from(_mm512_cmplt_epu32_mask(values, _mm512_set1_epi32(bound.cast_signed())))
        }
    }

    #[inline(always)]
    fn pack(self, mask: u32, values: &[u32; LANES], packed: &mut [u32; LANES]) {
        // SAFETY: the processor has AVX-512; sixteen numbers of four bytes are read and written, as many as
        // there are.
        unsafe {
            let values = _mm512_loadu_si512(values.as_ptr().cast());
            let front = _mm512_maskz_compress_epi32(mask as u16, values);
            _mm512_storeu_si512(packed.as_mut_ptr().cast(), front);
        }
    }

    #[inline(always)]
    fn pack_long(self, mask: u32, values: &[u64; LANES], packed: &mut [u64; LANES]) {
        let [lower, upper] = [mask as u8, (mask >> 8) as u8];
        // SAFETY: the processor has AVX-512; sixteen numbers of eight bytes are read and written, as many as
        // there are: the second eight are written after at most eight of the first.
        unsafe {
            let first = _mm512_loadu_si512(values.as_ptr().cast());
            let second = _mm512_loadu_si512(values.as_ptr().add(8).cast());
            let target = packed.as_mut_ptr();
            _mm512_storeu_si512(target.cast(), _mm512_maskz_compress_epi64(lower, first));
            let target = target.add(lower.count_ones() as usize);
            _mm512_storeu_si512(target.cast(), _mm512_maskz_compress_epi64(upper, second));
        }
    }

    #[inline(always)]
    fn permute(self, values: &[f32; LANES], indices: &[u32; HALF_LANES]) -> [f32; HALF_LANES] {
        let mut permuted = [0.0; HALF_LANES];
        // SAFETY: the processor has AVX-512; sixteen numbers and eight indices are read and eight numbers
        // written, as many as there are.
        unsafe {
            let indices = _mm256_loadu_si256(indices.as_ptr().cast());
            let lower = _mm256_loadu_ps(values.as_ptr());
            let upper = _mm256_loadu_ps(values.as_ptr().add(HALF_LANES));
            _mm256_storeu_ps(permuted.as_mut_ptr(), _mm256_permutex2var_ps(lower, indices, upper));
        }
        permuted
    }

    #[inline(always)]
    fn prefetch(self, line: &Line) {
        prefetch(line);
    }
}

/// Indices of the set lanes, ascending, for each mask of eight lanes.
const LANES_OF: [[u8; 8]; 256] = {
    let mut lanes_of = [[0; 8]; 256];
    let mut mask = 0;
    while mask < 256 {
        let (mut lane, mut count) = (0, 0);
        while lane < 8 {
            if mask >> lane & 1 != 0 {
                lanes_of[mask][count] = lane;
                count += 1;
            }
            lane += 1;
        }
        mask += 1;
    }
    lanes_of
};

/// Indices of the set lanes, ascending, for each mask of four 64-bit lanes. Each lane is given as its two
/// 32-bit halves, `2 * lane` and `2 * lane + 1`.
const LONG_LANES_OF: [[u8; 8]; 16] = {
    let mut lanes_of = [[0; 8]; 16];
    let mut mask = 0;
    while mask < 16 {
        let (mut lane, mut count) = (0, 0);
        while lane < 4 {
            if mask >> lane & 1 != 0 {
                lanes_of[mask][count] = 2 * lane;
                lanes_of[mask][count + 1] = 2 * lane + 1;
                count += 2;
            }
            lane += 1;
        }
        mask += 1;
    }
    lanes_of
};

/// Sign bit. Flipping it in both operands turns a signed comparison into an unsigned one.
const SIGN: u32 = 1 << 31;

impl Isa for Avx2 {
    #[inline(always)]
    fn lanes(self, _: usize) -> usize {
        LANES
    }

    #[inline(always)]
    fn below(self, values: &[u32; LANES], bound: u32) -> u32 {
        let (halves, _) = values.as_chunks::<8>();
        // SAFETY: the processor has AVX2; eight numbers of four bytes are read, as many as there are.
        let below = |half: &[u32; 8]| unsafe {
            let values = _mm256_loadu_si256(half.as_ptr().cast());
            let values = _mm256_xor_si256(values, _mm256_set1_epi32(SIGN.cast_signed()));
            let is_below = _mm256_cmpgt_epi32(_mm256_set1_epi32((bound ^ SIGN).cast_signed()), values);
            _mm256_movemask_ps(_mm256_castsi256_ps(is_below)).cast_unsigned()
        };
        halves.iter().rev().fold(0, |mask, half| mask << 8 | below(half))
    }

    #[inline(always)]
    fn pack(self, mask: u32, values: &[u32; LANES], packed: &mut [u32; LANES]) {
        let mut target = packed.as_mut_ptr();
        let mut mask = mask;
        for half in values.as_chunks::<8>().0 {
            let lanes = mask as u8;
            mask >>= 8;
            // SAFETY: the processor has AVX2; eight numbers are read and written, as many as there are: the
            // second eight are written after at most eight of the first.
            unsafe {
                let order = order(&LANES_OF[usize::from(lanes)]);
                let values = _mm256_loadu_si256(half.as_ptr().cast());
                _mm256_storeu_si256(target.cast(), _mm256_permutevar8x32_epi32(values, order));
                target = target.add(lanes.count_ones() as usize);
            }
        }
    }

    #[inline(always)]
    fn pack_long(self, mask: u32, values: &[u64; LANES], packed: &mut [u64; LANES]) {
        let mut target = packed.as_mut_ptr();
        let mut mask = mask;
        for quarter in values.as_chunks::<4>().0 {
            let lanes = mask & 15;
            mask >>= 4;
            // SAFETY: the processor has AVX2; four numbers are read and written, as many as there are: the
            // last four are written after at most twelve others.
            unsafe {
                let order = order(&LONG_LANES_OF[lanes as usize]);
                let values = _mm256_loadu_si256(quarter.as_ptr().cast());
                _mm256_storeu_si256(target.cast(), _mm256_permutevar8x32_epi32(values, order));
                target = target.add(lanes.count_ones() as usize);
            }
        }
    }

    #[inline(always)]
    fn permute(self, values: &[f32; LANES], indices: &[u32; HALF_LANES]) -> [f32; HALF_LANES] {
        let mut permuted = [0.0; HALF_LANES];
        // SAFETY: the processor has AVX2; sixteen numbers and eight indices are read and eight numbers
        // written, as many as there are.
        unsafe {
            let indices = _mm256_loadu_si256(indices.as_ptr().cast());
            let half = |first: *const f32| _mm256_permutevar8x32_ps(_mm256_loadu_ps(first), indices);
            let [lower, upper] = [half(values.as_ptr()), half(values.as_ptr().add(HALF_LANES))];
            // Bit 3 of an index, shifted to the sign bit, selects the upper half.
            let is_upper = _mm256_castsi256_ps(_mm256_slli_epi32::<28>(indices));
            _mm256_storeu_ps(permuted.as_mut_ptr(), _mm256_blendv_ps(lower, upper, is_upper));
        }
        permuted
    }

    #[inline(always)]
    fn prefetch(self, line: &Line) {
        prefetch(line);
    }
}

/// Widens the lane indices of a permutation from bytes to 32 bits.
///
/// # Safety
/// The processor must have AVX2.
#[inline]
#[target_feature(enable = "avx2")]
unsafe fn order(lanes: &[u8; 8]) -> __m256i {
    _mm256_cvtepu8_epi32(_mm_cvtsi64_si128(i64::from_le_bytes(*lanes)))
}
