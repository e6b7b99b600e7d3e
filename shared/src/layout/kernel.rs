//! Density estimation kernels of caustic photons. The area of a photon's kernel is stored as a 5-bit code, in
//! the bits that hold the disc fraction in photons of the photon map.

use super::photon::DISC_CODES;

/// Code of the maximum kernel radius.
const LAST: u8 = DISC_CODES as u8 - 1;
const EXPONENT_BIAS: u32 = 127;
const MANTISSA_BITS: u32 = 23;

/// Returns the area of the kernel's disc, as a fraction of the maximum area: `2^(code - 31)`. Only the lower
/// five bits of `code` are used.
#[inline(always)]
pub fn kernel_share(code: u8) -> f32 {
    f32::from_bits((EXPONENT_BIAS - u32::from(LAST - (code & LAST))) << MANTISSA_BITS)
}

/// Returns the code of the smallest disc whose area is at least `share` times the maximum area. Values of
/// `share` out of range get the first or the last code.
pub fn encode_kernel(share: f32) -> u8 {
    (0..LAST).find(|&code| kernel_share(code) >= share).unwrap_or(LAST)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn kernel_areas_are_powers_of_two_up_to_one() {
        assert_eq!([0, 30, 31, 63].map(kernel_share), [1.0 / 2_147_483_648.0, 0.5, 1.0, 1.0]);
        assert_eq!(
            [0.0, 1e-20, 0.25, 0.26, 0.5, 0.51, 1.0, 7.0].map(encode_kernel),
            [0, 0, 29, 30, 30, 31, 31, 31]
        );
        assert_eq!(encode_kernel(f32::NAN), LAST);
    }
}
