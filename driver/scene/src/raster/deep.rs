//! Encodes texels of 16 bits per channel in four bytes each.

use crate::texture::{Encoding, shared_exponent};

/// Encoding of a 16-bit image in four bytes per texel that keeps more than 8 bits of some channels.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Deep {
    /// Colour in sRGB, as [`Encoding::SharedExponent`].
    Emission,
    /// Normals, as [`Encoding::NormalPair`].
    Normal,
    /// Red and green, as [`Encoding::LinearPair`].
    RedGreen,
    /// Blue and green, as [`Encoding::LinearPair`].
    BlueGreen,
}

impl Deep {
    pub(crate) fn encoding(self) -> Encoding {
        match self {
            Self::Emission => Encoding::SharedExponent,
            Self::Normal => Encoding::NormalPair,
            Self::RedGreen | Self::BlueGreen => Encoding::LinearPair,
        }
    }

    pub(super) fn texel(self, [red, green, blue, _]: [u16; 4]) -> [u8; 4] {
        match self {
            Self::Emission => shared_exponent([red, green, blue].map(linear)),
            Self::Normal => normal([red, green, blue]),
            Self::RedGreen => pair([red, green]),
            Self::BlueGreen => pair([blue, green]),
        }
    }
}

fn pair(channels: [u16; 2]) -> [u8; 4] {
    let [[a, b], [c, d]] = channels.map(u16::to_le_bytes);
    [a, b, c, d]
}

/// Decodes a 16-bit code of the sRGB transfer function (IEC 61966-2-1).
fn linear(code: u16) -> f32 {
    let value = f64::from(code) / f64::from(u16::MAX);
    let linear = if value <= 0.04045 { value / 12.92 } else { libm::pow((value + 0.055) / 1.055, 2.4) };
    linear as f32
}

/// Encodes x and y of a normal after normalisation. A normal with z < 0 is moved into the surface (z = 0),
/// because z is not stored. Images of 8 bits per channel keep such normals.
fn normal(codes: [u16; 3]) -> [u8; 4] {
    const HALF: f64 = u16::MAX as f64 / 2.0;
    let [x, y, z] = codes.map(|code| f64::from(code) - HALF);
    let length = libm::sqrt(x * x + y * y + z.max(0.0) * z.max(0.0));
    // Every channel is at least half a step from 0, so that the length is not 0.
    pair([x, y].map(|channel| ((channel / length + 1.0) * HALF).round() as u16))
}

#[cfg(test)]
mod tests {
    use glam::Vec3;
    use photoncard_firmware::scene::decode_texel;

    use super::*;

    fn decoded(deep: Deep, [red, green, blue]: [u16; 3]) -> [f32; 3] {
        let texel = deep.texel([red, green, blue, u16::MAX]);
        let [red, green, blue, _] = decode_texel(deep.encoding().into(), texel);
        [red, green, blue]
    }

    #[test]
    fn emission_has_less_error_than_with_8_bits() {
        let [grey, dark, white] = [0x8000, 100, u16::MAX].map(|code| decoded(Deep::Emission, [code; 3])[1]);
        assert!((grey / 0.214_05 - 1.0).abs() < 1e-3, "{grey}");
        let exact = 100.0 / 65_535.0 / 12.92;
        assert!((dark / exact - 1.0).abs() < 3e-3 && white == 1.0, "{dark} {white}");
    }

    #[test]
    fn linear_channels_keep_all_bits() {
        let codes = [40_001, 40_002, 40_003];
        let exact = codes.map(|code| f32::from(code) * (1.0 / 65_535.0));
        assert_eq!(decoded(Deep::RedGreen, codes)[..2], exact[..2]);
        assert_eq!(decoded(Deep::BlueGreen, codes)[1..], exact[1..]);
    }

    #[test]
    fn normals_keep_their_direction() {
        for [x, y, z] in [[0.0, 0.0, 1.0], [0.001, -0.002, 1.0], [0.3, 0.5, 0.6], [0.05, 0.05, 0.1]] {
            let codes = [x, y, z].map(|channel: f32| ((channel + 1.0) * 32_767.5).round() as u16);
            let found = Vec3::from(decoded(Deep::Normal, codes)) * 2.0 - 1.0;
            let direction = Vec3::new(x, y, z).normalize();
            // The short normal magnifies the rounding error of its codes eight times.
            assert!(found.distance(direction) < 3e-4 && found.is_normalized(), "{found} {direction}");
        }
        for codes in [[0x8000, 0x8000, 0], [0; 3], [u16::MAX; 3]] {
            let found = Vec3::from(decoded(Deep::Normal, codes)) * 2.0 - 1.0;
            assert!(found.z >= 0.0 && (found.length() - 1.0).abs() < 1e-4, "{found}");
        }
    }
}
