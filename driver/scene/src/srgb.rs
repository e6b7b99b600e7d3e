//! The sRGB transfer function (IEC 61966-2-1) of 8-bit codes.

use glam::Vec4;

/// Tables of the transfer function.
pub(crate) struct Srgb {
    values: [f32; 256],
    /// For each code but the last, the least linear value that is rounded to the next code.
    borders: [f32; 255],
}

impl Srgb {
    pub(crate) fn new() -> Self {
        let value = |code: f32| {
            let encoded = code / 255.0;
            if encoded <= 0.04045 { encoded / 12.92 } else { libm::powf((encoded + 0.055) / 1.055, 2.4) }
        };
        Self {
            values: std::array::from_fn(|code| value(code as f32)),
            borders: std::array::from_fn(|code| value(code as f32 + 0.5)),
        }
    }

    /// Decodes a texel to linear colour, and alpha from 0 to 1.
    pub(crate) fn decode(&self, [red, green, blue, alpha]: [u8; 4]) -> Vec4 {
        let [red, green, blue] = [red, green, blue].map(|code| self.values[usize::from(code)]);
        Vec4::new(red, green, blue, f32::from(alpha) / 255.0)
    }

    pub(crate) fn encode(&self, value: f32) -> u8 {
        self.borders.partition_point(|border| *border <= value) as u8
    }
}

/// Nearest 8-bit code of a linear value from 0 to 1.
pub(crate) fn linear(value: f32) -> u8 {
    (value * 255.0 + 0.5) as u8
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn srgb_codes_are_encoded_from_their_decoded_values() {
        let srgb = Srgb::new();
        assert!((0..=255).all(|code| srgb.encode(srgb.values[usize::from(code)]) == code));
        assert_eq!((srgb.encode(-1.0), srgb.encode(2.0), srgb.encode(f32::NAN)), (0, 255, 0));
    }
}
