//! Radii of caustic photons' kernels, in the five bits that hold the disc fraction of other photons.

use super::photon::DISC_CODES;

/// Last code of a kernel's radius: that of the maximum radius.
const LAST: u8 = DISC_CODES as u8 - 1;
/// Bias of the exponent of an `f32`.
const EXPONENT_BIAS: u32 = 127;
/// Number of the mantissa's bits of an `f32`.
const MANTISSA_BITS: u32 = 23;

/// Area of the disc of a code over that of the last code: `2^(code - 31)`; only the lower five bits count.
#[inline(always)]
pub fn kernel_share(code: u8) -> f32 {
    f32::from_bits((EXPONENT_BIAS - u32::from(LAST - (code & LAST))) << MANTISSA_BITS)
}

/// Code of the smallest disc whose area is at least `share` of that of the last code; the first or the last
/// code beyond them.
pub fn encode_kernel(share: f32) -> u8 {
    (0..LAST).find(|&code| kernel_share(code) >= share).unwrap_or(LAST)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn codes_are_powers_of_two_up_to_the_whole() {
        assert_eq!([0, 30, 31, 63].map(kernel_share), [1.0 / 2_147_483_648.0, 0.5, 1.0, 1.0]);
        assert_eq!(
            [0.0, 1e-20, 0.25, 0.26, 0.5, 0.51, 1.0, 7.0].map(encode_kernel),
            [0, 0, 29, 30, 30, 31, 31, 31]
        );
        assert_eq!(encode_kernel(f32::NAN), LAST);
    }
}
