//! Vector instructions on sixteen lanes, selected at run time; of WebAssembly, when it is compiled.
//!
//! A [`Kernel`] is written once, as loops over [`LANES`] lanes that all do the same operation. It is compiled
//! for each [`Isa`] that the processor may have. A WebAssembly program cannot ask: with `simd128` the whole
//! program needs it, and a browser that lacks it refuses the program. Compilers turn the loops into vector
//! instructions; operations that they do not recognise in loops, such as comparing and packing lanes, are
//! methods of the `Isa`. Every lane rounds like scalar code and no operations are fused, so that all
//! instruction sets give the same bits. [`Portable`] is the fallback for every processor.

mod kernel;
#[cfg(all(target_family = "wasm", target_feature = "simd128"))]
mod wasm;
#[cfg(all(target_arch = "x86_64", target_feature = "sse2"))]
#[expect(
    unsafe_code,
    reason = "instructions that only some processors have are called when they are known to be there"
)]
mod x86;

pub use self::kernel::{HALF_LANES, Isa, Kernel, LANES, Portable};

/// Runs a kernel with the best instruction set that the processor supports.
#[inline(always)]
pub fn run<K: Kernel>(kernel: K) -> K::Output {
    #[cfg(all(target_arch = "x86_64", target_feature = "sse2"))]
    return x86::run(kernel);
    #[cfg(all(target_family = "wasm", target_feature = "simd128"))]
    return kernel.run(wasm::Simd128);
    #[cfg(not(any(
        all(target_arch = "x86_64", target_feature = "sse2"),
        all(target_family = "wasm", target_feature = "simd128")
    )))]
    kernel.run(Portable)
}

/// An instruction set by name. Tests use it to check that all sets give the same bits.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Level {
    /// The portable fallback ([`Portable`]).
    Portable,
    /// AVX2 of x86-64.
    #[cfg(all(target_arch = "x86_64", target_feature = "sse2"))]
    Avx2,
    /// AVX-512 of x86-64.
    #[cfg(all(target_arch = "x86_64", target_feature = "sse2"))]
    Avx512,
    /// `simd128` of WebAssembly.
    #[cfg(all(target_family = "wasm", target_feature = "simd128"))]
    Simd128,
}

impl Level {
    /// All instruction sets of this architecture.
    #[cfg(all(target_arch = "x86_64", target_feature = "sse2"))]
    pub const ALL: &[Self] = &[Self::Portable, Self::Avx2, Self::Avx512];
    /// All instruction sets of this architecture.
    #[cfg(all(target_family = "wasm", target_feature = "simd128"))]
    pub const ALL: &[Self] = &[Self::Portable, Self::Simd128];
    /// All instruction sets of this architecture.
    #[cfg(not(any(
        all(target_arch = "x86_64", target_feature = "sse2"),
        all(target_family = "wasm", target_feature = "simd128")
    )))]
    pub const ALL: &[Self] = &[Self::Portable];

    /// Runs a kernel with this instruction set; `None` if the processor lacks it.
    pub fn run<K: Kernel>(self, kernel: K) -> Option<K::Output> {
        match self {
            Self::Portable => Some(kernel.run(Portable)),
            #[cfg(all(target_arch = "x86_64", target_feature = "sse2"))]
            Self::Avx2 => x86::run_with_avx2(kernel),
            #[cfg(all(target_arch = "x86_64", target_feature = "sse2"))]
            Self::Avx512 => x86::run_with_avx512(kernel),
            #[cfg(all(target_family = "wasm", target_feature = "simd128"))]
            Self::Simd128 => Some(kernel.run(wasm::Simd128)),
        }
    }
}

#[cfg(test)]
mod tests {
    use std::vec::Vec;

    use super::*;

    /// Kernel that returns the results of every vector method of an [`Isa`] for one mask.
    struct All {
        mask: u32,
        bound: u32,
        values: [u32; LANES],
    }

    impl Kernel for All {
        type Output = (u32, Vec<u32>, Vec<u64>, Vec<u32>);

        #[inline(always)]
        fn run(self, isa: impl Isa) -> Self::Output {
            let long = self.values.map(|value| u64::from(value) << 32 | u64::from(!value));
            let mut packed = ([0; LANES], [0; LANES]);
            isa.pack(self.mask, &self.values, &mut packed.0);
            isa.pack_long(self.mask, &long, &mut packed.1);
            let count = self.mask.count_ones() as usize;
            let indices = core::array::from_fn(|lane| self.values[lane] >> (self.mask % 29));
            let permuted = isa.permute(&self.values.map(f32::from_bits), &indices);
            let permuted = permuted.iter().map(|value| value.to_bits()).collect();
            (
                isa.below(&self.values, self.bound),
                packed.0[..count].to_vec(),
                packed.1[..count].to_vec(),
                permuted,
            )
        }
    }

    #[test]
    fn all_instructions_compare_pack_and_permute_alike() {
        for mask in 0..1 << LANES {
            let values = core::array::from_fn(|lane| crate::sampler::hash(mask ^ (lane as u32) << 20));
            let bound = match mask % 4 {
                0 => values[mask as usize % LANES],
                1 => u32::MAX,
                2 => 0,
                _ => crate::sampler::hash(mask),
            };
            let mut results = Level::ALL.iter().filter_map(|level| level.run(All { mask, bound, values }));
            let (below, packed, long, permuted) = results.next().expect("what every processor has");
            assert!((0..LANES).all(|lane| (below >> lane & 1 != 0) == (values[lane] < bound)));
            assert!(
                packed.iter().eq((0..LANES).filter(|lane| mask >> lane & 1 != 0).map(|lane| &values[lane]))
            );
            let expected = (below, packed, long, permuted);
            assert!(results.all(|result| result == expected), "{mask:b}");
        }
    }
}
