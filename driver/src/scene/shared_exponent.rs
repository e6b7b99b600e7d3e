//! Texels of three channels with a shared exponent.

/// The nearest `RGB9_E5` texel: nine bits a channel with a shared exponent (OpenGL's
/// `EXT_texture_shared_exponent`).
pub(crate) fn shared_exponent(texel: [f32; 3]) -> [u8; 4] {
    const GREATEST: f32 = 65408.0;
    let [red, green, blue] = texel.map(|channel| channel.clamp(0.0, GREATEST));
    let greatest = red.max(green).max(blue);
    let exponent = if greatest > 0.0 { libm::ilogbf(greatest).max(-16) + 16 } else { 0 };
    let mantissa = |channel: f32, exponent: i32| libm::ldexpf(channel, 24 - exponent).round() as u32;
    // A mantissa that rounds up to 512 takes the next exponent.
    let exponent = if mantissa(greatest, exponent) > 511 { exponent + 1 } else { exponent };
    let [red, green, blue] = [red, green, blue].map(|channel| mantissa(channel, exponent).min(511));
    (red | green << 9 | blue << 18 | (exponent as u32) << 27).to_le_bytes()
}

/// Texel of codes of 16 bits in the sRGB transfer function (IEC 61966-2-1).
pub(super) fn of_srgb(codes: [u16; 3]) -> [u8; 4] {
    shared_exponent(codes.map(|code| {
        let value = f64::from(code) / f64::from(u16::MAX);
        let linear = if value <= 0.04045 { value / 12.92 } else { libm::pow((value + 0.055) / 1.055, 2.4) };
        linear as f32
    }))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn decode(texel: [u8; 4]) -> [f32; 3] {
        let bits = u32::from_le_bytes(texel);
        [0, 9, 18].map(|shift| libm::ldexpf((bits >> shift & 511) as f32, (bits >> 27) as i32 - 24))
    }

    #[test]
    fn texels_keep_eight_bits_of_their_greatest_channel() {
        for value in [1e-7_f32, 1e-4, 0.3, 0.999, 1.0, 511.5, 1023.0, 40_000.0, 65_408.0] {
            let [red, green, blue] = decode(shared_exponent([value, value * 0.25, 0.0]));
            let step = (value / 256.0).max(1.0 / 16_777_216.0);
            assert!((red - value).abs() <= 0.5 * step, "{value}: {red}");
            assert!((green - value * 0.25).abs() <= 0.5 * step, "{value}: {green}");
            assert_eq!(blue, 0.0);
        }
        assert_eq!(decode(shared_exponent([0.0; 3])), [0.0; 3]);
    }

    #[test]
    fn codes_of_16_bits_are_nearer_than_those_of_8() {
        let [grey, dark, white] = [0x8000, 100, u16::MAX].map(|code| decode(of_srgb([code; 3]))[1]);
        assert!((grey / 0.214_05 - 1.0).abs() < 1e-3, "{grey}");
        let exact = 100.0 / 65_535.0 / 12.92;
        assert!((dark / exact - 1.0).abs() < 3e-3 && white == 1.0, "{dark} {white}");
    }
}
