//! Reduction of images to fewer texels.

use std::ops::Range;

use glam::{DVec4, Vec4};

use crate::srgb::{Srgb, linear};
use crate::texture::{Encoding, shared_exponent};

/// Size of an image that is reduced to at most `limit` texels a side. Both sides are divided by the smallest
/// whole number that suffices, and rounded up.
pub(crate) fn reduced_size(size: [u32; 2], limit: u32) -> [u32; 2] {
    let [width, height] = size;
    let factor = width.max(height).div_ceil(limit.max(1));
    size.map(|side| side.div_ceil(factor))
}

/// Reduces an image of size `from` to size `to`. Each new texel is the mean, in linear light, of the old
/// texels within it; each old texel contributes to one mean. Colour and alpha are averaged separately, as in
/// a GPU's mipmaps, so that the colour of a texel of alpha 0 counts.
pub(crate) fn reduced(texels: &[[u8; 4]], encoding: Encoding, from: [u32; 2], to: [u32; 2]) -> Vec<[u8; 4]> {
    let code = Code { encoding, srgb: Srgb::new() };
    let [width, _] = from;
    let covered = |axis: usize, at: u32| -> Range<u32> {
        let start = |at: u32| (u64::from(at) * u64::from(from[axis]) / u64::from(to[axis])) as u32;
        start(at)..start(at + 1)
    };
    let mean = |x: u32, y: u32| {
        let (columns, rows) = (covered(0, x), covered(1, y));
        let count = f64::from((columns.end - columns.start) * (rows.end - rows.start));
        let places = rows.flat_map(|row| columns.clone().map(move |column| (row * width + column) as usize));
        let sum: DVec4 = places.map(|place| code.decode(texels[place]).as_dvec4()).sum();
        code.encode((sum / count).as_vec4())
    };
    (0..to[1]).flat_map(|y| (0..to[0]).map(move |x| (x, y))).map(|(x, y)| mean(x, y)).collect()
}

/// Conversion of texels to linear values and back.
struct Code {
    encoding: Encoding,
    srgb: Srgb,
}

impl Code {
    fn decode(&self, texel: [u8; 4]) -> Vec4 {
        match self.encoding {
            Encoding::Srgb => self.srgb.decode(texel),
            Encoding::Linear => Vec4::from(texel.map(f32::from)) / 255.0,
            Encoding::SharedExponent => {
                let bits = u32::from_le_bytes(texel);
                let channel =
                    |shift: u32| libm::ldexpf((bits >> shift & 511) as f32, (bits >> 27) as i32 - 24);
                Vec4::new(channel(0), channel(9), channel(18), 1.0)
            }
            Encoding::LinearPair | Encoding::NormalPair => {
                let [a, b, c, d] = texel;
                let [first, second] = [[a, b], [c, d]].map(|pair| f32::from(u16::from_le_bytes(pair)));
                Vec4::new(first, second, 0.0, 1.0)
            }
        }
    }

    fn encode(&self, value: Vec4) -> [u8; 4] {
        let [red, green, blue, alpha] = value.to_array();
        match self.encoding {
            Encoding::Srgb => {
                let [red, green, blue] = [red, green, blue].map(|channel| self.srgb.encode(channel));
                [red, green, blue, linear(alpha)]
            }
            Encoding::Linear => [red, green, blue, alpha].map(linear),
            Encoding::SharedExponent => shared_exponent([red, green, blue]),
            Encoding::LinearPair | Encoding::NormalPair => {
                let [[a, b], [c, d]] = [red, green].map(|channel| ((channel + 0.5) as u16).to_le_bytes());
                [a, b, c, d]
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const ENCODINGS: [Encoding; 5] = [
        Encoding::Srgb,
        Encoding::Linear,
        Encoding::SharedExponent,
        Encoding::LinearPair,
        Encoding::NormalPair,
    ];

    #[test]
    fn sides_are_within_the_limit_and_keep_their_ratio() {
        for (size, limit, expected) in [
            ([4096, 4096], 1024, [1024, 1024]),
            ([4096, 2048], 1000, [820, 410]),
            ([100, 7], 100, [100, 7]),
            ([101, 7], 100, [51, 4]),
            ([16_384, 1], 1, [1, 1]),
        ] {
            assert_eq!(reduced_size(size, limit), expected);
        }
    }

    #[test]
    fn an_image_of_one_colour_keeps_it() {
        for encoding in ENCODINGS {
            let texel = match encoding {
                Encoding::SharedExponent => shared_exponent([3.0, 0.25, 100.0]),
                _ => [13, 200, 77, 31],
            };
            let reduced = reduced(&[texel; 7 * 5], encoding, [7, 5], [3, 2]);
            assert_eq!(reduced, [texel; 6], "{encoding:?}");
        }
    }

    #[test]
    fn means_are_of_linear_light() {
        let texels = [[255, 255, 255, 255], [0, 0, 0, 0]];
        // Half of the light of white has the code 188 of 255.
        assert_eq!(reduced(&texels, Encoding::Srgb, [2, 1], [1, 1]), [[188, 188, 188, 128]]);
        assert_eq!(reduced(&texels, Encoding::Linear, [2, 1], [1, 1]), [[128; 4]]);
        let lights = [[8.0, 0.0, 1.0], [0.0, 4.0, 1.0]].map(shared_exponent);
        let mean = shared_exponent([4.0, 2.0, 1.0]);
        assert_eq!(reduced(&lights, Encoding::SharedExponent, [2, 1], [1, 1]), [mean]);
        // 0x00ff and 0x0101 have the mean 0x0100.
        for encoding in [Encoding::LinearPair, Encoding::NormalPair] {
            let pairs = [[0xff, 0x00, 10, 0], [0x01, 0x01, 20, 0]];
            assert_eq!(reduced(&pairs, encoding, [2, 1], [1, 1]), [[0x00, 0x01, 15, 0]]);
        }
    }

    #[test]
    fn each_texel_has_a_part_in_one_mean() {
        let of = |size: [u32; 2], at: usize| {
            let mut texels = vec![[0; 4]; (size[0] * size[1]) as usize];
            texels[at] = [255; 4];
            reduced(&texels, Encoding::Linear, size, [3, 2])
        };
        for at in 0..35 {
            let lit = of([7, 5], at).into_iter().filter(|texel| texel[0] > 0).count();
            assert_eq!(lit, 1, "texel {at}");
        }
    }
}
