//! Photons in 20 bytes, after Jensen 2001: position, shared-exponent power, direction and flags.

use super::{Record, read_vector, write_vector};

/// Bytes of a photon's content: its power, direction and flags.
pub const PHOTON_CONTENT_BYTES: usize = 8;

/// A photon, and a node of the left-balanced kd-tree.
///
/// | bytes | contents |
/// |---|---|
/// | 0..12 | position, metres |
/// | 12..16 | power, [`Rgbe`], in units of the card image's photon power unit |
/// | 16..18 | incoming direction, from the surface towards the origin of the photon, [`super::encode_direction`] |
/// | 18..20 | flags: bits 0-1 axis or group, 2-9 normal ([`super::encode_normal`]), 10-14 disc, 15 direct |
///
/// The *disc fraction* is `A / (pi r^2)`, where `A` is the area of the surfaces from which a gather of radius
/// `r` around this photon takes photons. It is 1 on a flat wall, less at edges and in corners, more where
/// surfaces are stacked. The density estimate divides by `pi r^2` times this fraction. Where walls hide parts
/// of the disc from the photon, the fraction is relative to the visible region instead ([`is_of_region`]). A
/// gather then counts only photons of the region that the gather's point sees, and divides by the region's
/// area times the fraction. The fraction is stored as a code of [`disc_fraction`].
///
/// In the caustic map the five bits of the disc fraction hold the area of the photon's kernel, as a code of
/// [`super::kernel_share`].
///
/// A *direct* photon came straight from a light, without a bounce. The radiance estimate includes direct
/// photons. Importance sampling ignores them, because it needs the directions of indirect light. In the
/// caustic map the flag marks light of an emissive surface or of the environment, which gather rays of a
/// narrow lobe can hit as well.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Photon {
    /// Position, metres.
    pub position: [f32; 3],
    /// Power, photon power units.
    pub power: Rgbe,
    /// Octahedral code of the incoming direction, which points from the surface back along the photon's path.
    pub direction: [u8; 2],
    /// Splitting axis of the node in a kd-tree, 0, 1 or 2; in a wide tree, the light group of the photon's
    /// light, 0 to 3.
    pub axis_or_group: u8,
    /// Octahedral code of the surface normal, on the lit side.
    pub normal: u8,
    /// Code of the disc fraction, below [`DISC_CODES`].
    pub disc: u8,
    /// True if the photon came straight from a light.
    pub direct: bool,
}

/// Number of codes of the disc fraction.
pub const DISC_CODES: usize = 1 << 5;
/// Code of the disc fraction 1, for a photon from which no wall hides any part of the disc.
pub const FULL_DISC: u8 = 13;
/// First code of the disc fractions that are relative to a visible region, the unhidden part of the disc.
const FIRST_REGION: u8 = 20;
/// Code of the disc fraction 1 relative to a visible region.
const FULL_REGION: u8 = 25;

const DISC_MASK: u8 = DISC_CODES as u8 - 1;
const DISC_SHIFT: u32 = 10;
/// Ratio of the disc fractions of consecutive codes from 0.4 to 1: `4^(1/9)`.
const FINE_STEP: f64 = 1.166_529_039_576_120_8;
/// Ratio of the disc fractions of consecutive codes above 1, and of all codes of a visible region: `4^(1/6)`.
const COARSE_STEP: f64 = 1.259_921_049_894_873_2;
/// Ratio of the disc fractions of consecutive codes below 0.4.
const SMALL_STEP: f64 = 1.4;
/// Number of steps of [`FINE_STEP`] below the disc fraction 1.
const FINE_STEPS: u8 = 6;
const DISC_FRACTIONS: [f32; DISC_CODES] = disc_fractions();

/// Returns the disc fractions of all codes: one series from 0.038 to 4 relative to the disc, and one from
/// 0.31 to 4 relative to a visible region. Both are piecewise geometric, so that the relative rounding error
/// hardly varies.
#[expect(clippy::indexing_slicing, reason = "computed when it is compiled")]
const fn disc_fractions() -> [f32; DISC_CODES] {
    let mut fractions = [1.0; DISC_CODES];
    let (mut code, mut fraction) = (FULL_DISC, 1.0);
    while code > 0 {
        fraction /= if FULL_DISC - code < FINE_STEPS { FINE_STEP } else { SMALL_STEP };
        code -= 1;
        fractions[code as usize] = fraction as f32;
    }
    (code, fraction) = (FULL_DISC, 1.0);
    while code + 1 < FIRST_REGION {
        fraction *= COARSE_STEP;
        code += 1;
        fractions[code as usize] = fraction as f32;
    }
    (code, fraction) = (FULL_REGION, 1.0);
    while code > FIRST_REGION {
        fraction /= COARSE_STEP;
        code -= 1;
        fractions[code as usize] = fraction as f32;
    }
    (code, fraction) = (FULL_REGION, 1.0);
    while code < DISC_MASK {
        fraction *= COARSE_STEP;
        code += 1;
        fractions[code as usize] = fraction as f32;
    }
    fractions
}

/// Disc fraction of a code. Only the lower five bits of `code` count.
#[inline(always)]
pub fn disc_fraction(code: u8) -> f32 {
    DISC_FRACTIONS.get((code & DISC_MASK) as usize).copied().unwrap_or(1.0)
}

/// Returns true if the code's disc fraction is relative to a visible region, because walls hide a part of the
/// disc from the photon.
#[inline(always)]
pub fn is_of_region(code: u8) -> bool {
    code & DISC_MASK >= FIRST_REGION
}

/// Encodes a disc fraction, dithered. With `of_region` the fraction is relative to a visible region.
///
/// `dither`, in [0, 1), chooses between the two neighbouring codes such that the mean of `1 /
/// disc_fraction(code)`, the factor in a gather, is `1 / fraction`. Fractions out of range get the first or
/// the last code.
#[inline]
pub fn encode_disc(fraction: f32, of_region: bool, dither: f32) -> u8 {
    let (first, end) = if of_region { (FIRST_REGION, DISC_CODES as u8) } else { (0, FIRST_REGION) };
    let codes = DISC_FRACTIONS.get(first as usize..end as usize).unwrap_or_default();
    let upper = first + codes.partition_point(|&other| other < fraction).min(codes.len() - 1) as u8;
    let lower = upper.saturating_sub(1).max(first);
    let [at, lower_at, upper_at] = [fraction, disc_fraction(lower), disc_fraction(upper)].map(f32::recip);
    // Below the first fraction both codes are the first; above the last one the left side is negative.
    if at - upper_at > dither * (lower_at - upper_at) { lower } else { upper }
}

impl Record for Photon {
    const BYTES: usize = 20;
}

impl Photon {
    /// Reads a record.
    #[inline(always)]
    pub fn read(bytes: &[u8; Self::BYTES]) -> Self {
        let flags = Self::flags(bytes);
        Self {
            position: Self::position(bytes),
            power: Rgbe([bytes[12], bytes[13], bytes[14], bytes[15]]),
            direction: [bytes[16], bytes[17]],
            axis_or_group: Self::axis_of_flags(flags),
            normal: Self::normal_of_flags(flags),
            disc: Self::disc_of_flags(flags),
            direct: Self::direct_of_flags(flags),
        }
    }

    /// Reads the position from a record without reading the rest.
    #[inline(always)]
    pub fn position(bytes: &[u8; Self::BYTES]) -> [f32; 3] {
        read_vector(bytes, 0)
    }

    /// Reads the flags (bytes 18..20) from a record without reading the rest.
    #[inline(always)]
    pub fn flags(bytes: &[u8; Self::BYTES]) -> u16 {
        u16::from_le_bytes([bytes[18], bytes[19]])
    }

    /// Splitting axis in a record's flags.
    #[inline(always)]
    pub fn axis_of_flags(flags: u16) -> u8 {
        (flags & 3) as u8
    }

    /// Light group in a record's flags, in a map that is a wide tree.
    #[inline(always)]
    pub fn light_group_of_flags(flags: u16) -> u8 {
        (flags & 3) as u8
    }

    /// Content of a photon: the last eight bytes of the record, which hold power, direction and flags.
    #[inline(always)]
    pub fn content(bytes: &[u8; Self::BYTES]) -> [u8; PHOTON_CONTENT_BYTES] {
        let [.., a, b, c, d, e, f, g, h] = *bytes;
        [a, b, c, d, e, f, g, h]
    }

    /// Content of a photon of a kd-tree, with its splitting axis cleared.
    #[inline(always)]
    pub fn content_without_axis(bytes: &[u8; Self::BYTES]) -> [u8; PHOTON_CONTENT_BYTES] {
        let [a, b, c, d, e, f, low, high] = Self::content(bytes);
        [a, b, c, d, e, f, low & !3, high]
    }

    /// Returns a photon's content in which the code of the disc fraction is replaced by `disc`.
    #[must_use]
    pub fn content_with_disc(content: [u8; PHOTON_CONTENT_BYTES], disc: u8) -> [u8; PHOTON_CONTENT_BYTES] {
        let [a, b, c, d, e, f, low, high] = content;
        let flags = u16::from_le_bytes([low, high]) & !((DISC_MASK as u16) << DISC_SHIFT);
        let [low, high] = (flags | ((disc & DISC_MASK) as u16) << DISC_SHIFT).to_le_bytes();
        [a, b, c, d, e, f, low, high]
    }

    /// Code of the surface normal in a record's flags.
    #[inline(always)]
    pub fn normal_of_flags(flags: u16) -> u8 {
        (flags >> 2) as u8
    }

    /// Code of the disc fraction in a record's flags.
    #[inline(always)]
    pub fn disc_of_flags(flags: u16) -> u8 {
        (flags >> DISC_SHIFT) as u8 & DISC_MASK
    }

    /// Returns whether a record's flags mark a photon that came straight from a light.
    #[inline(always)]
    pub fn direct_of_flags(flags: u16) -> bool {
        flags >> 15 != 0
    }

    /// The record's bytes.
    pub fn to_bytes(&self) -> [u8; Self::BYTES] {
        let mut bytes = [0; Self::BYTES];
        write_vector(&mut bytes, 0, self.position);
        bytes[12..16].copy_from_slice(&self.power.0);
        bytes[16..18].copy_from_slice(&self.direction);
        let flags = (self.axis_or_group & 3) as u16
            | (self.normal as u16) << 2
            | ((self.disc & DISC_MASK) as u16) << DISC_SHIFT
            | (self.direct as u16) << 15;
        bytes[18..20].copy_from_slice(&flags.to_le_bytes());
        bytes
    }
}

/// RGBE colour (Ward 1991): three non-negative components with 8-bit mantissas and a shared exponent,
/// `mantissa * 2^(exponent - 136)`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Rgbe(pub [u8; 4]);

impl Rgbe {
    /// Bias of the exponent, the fourth byte: 128, plus 8 for the bits of a mantissa.
    pub const EXPONENT_BIAS: i32 = 136;

    /// Encodes a colour, dithered. Negative and non-finite components are encoded as 0.
    ///
    /// The random bits of `dither` choose whether each component is rounded up or down. The mean over many
    /// encodings is therefore the colour. Rounding to nearest would have the same bias for all photons of one
    /// light.
    #[inline]
    pub fn encode(colour: [f32; 3], dither: u32) -> Self {
        let colour = colour.map(|c| if c.is_finite() && c > 0.0 { c } else { 0.0 });
        let largest = colour.into_iter().fold(0.0_f32, |a, b| if b > a { b } else { a });
        if largest < f32::MIN_POSITIVE {
            return Self([0; 4]);
        }
        // largest = m 2^e with m in [1, 2); its mantissa byte is then in [128, 255], and must not round up to
        // 256.
        let mut exponent = (largest.to_bits() >> 23) as i32 - 127 + 1;
        if largest * power_of_two(8 - exponent) > 255.0 {
            exponent += 1;
        }
        let code = exponent + Self::EXPONENT_BIAS - 8;
        if code <= 0 {
            return Self([0; 4]);
        }
        let scale = power_of_two(8 - exponent);
        let threshold = |shift: u32| (dither.rotate_left(shift) >> 8) as f32 * (1.0 / 16_777_216.0);
        let [r, g, b] = colour;
        let round = |c: f32, shift: u32| (c * scale + threshold(shift)) as u8;
        Self([round(r, 0), round(g, 11), round(b, 22), code.min(255) as u8])
    }

    /// Decodes the colour.
    #[inline(always)]
    pub fn decode(self) -> [f32; 3] {
        let [r, g, b, exponent] = self.0;
        let scale = power_of_two(exponent as i32 - Self::EXPONENT_BIAS);
        [r as f32 * scale, g as f32 * scale, b as f32 * scale]
    }
}

/// `2^exponent`, clamped to the normal numbers.
#[inline(always)]
fn power_of_two(exponent: i32) -> f32 {
    f32::from_bits(((exponent.clamp(-126, 127) + 127) as u32) << 23)
}

#[cfg(test)]
mod tests {
    extern crate std;

    use std::vec::Vec;

    use super::*;

    #[test]
    fn a_photon_survives_its_record() {
        let photon = Photon {
            position: [1.5, -2.25, 1e-7],
            power: Rgbe::encode([1.0, 0.25, 0.5], 7),
            direction: [3, 200],
            axis_or_group: 2,
            normal: 0xa5,
            disc: 21,
            direct: true,
        };
        assert_eq!(Photon::read(&photon.to_bytes()), photon);
    }

    #[test]
    fn disc_fractions_ascend_from_a_thirtieth_to_four_and_a_whole_disc_is_one() {
        assert_eq!([FULL_DISC, FULL_REGION].map(disc_fraction), [1.0; 2]);
        for (codes, least) in [(0..FIRST_REGION, 0.038), (FIRST_REGION..DISC_CODES as u8, 0.315)] {
            let fractions: Vec<f32> = codes.map(disc_fraction).collect();
            assert!(fractions.is_sorted() && (fractions[0] - least).abs() < 1e-3, "{fractions:?}");
            assert!((fractions[fractions.len() - 1] - 4.0).abs() < 1e-5);
            for pair in fractions.windows(2) {
                assert!(pair[1] / pair[0] < 1.001 * SMALL_STEP as f32, "{pair:?}");
            }
        }
    }

    #[test]
    fn the_mean_reciprocal_of_dithered_disc_fractions_is_unbiased() {
        let dithers = || (0..1000).map(|i| (i as f32 + 0.5) / 1000.0);
        for of_region in [false, true] {
            let codes = |fraction: f32| dithers().map(move |dither| encode_disc(fraction, of_region, dither));
            for fraction in [0.04, 0.1, 0.25, 0.51, 0.999, 1.0, 1.01, 1.7, 3.99] {
                if of_region && fraction < 0.32 {
                    continue;
                }
                let mean = codes(fraction).map(|code| 1.0 / disc_fraction(code)).sum::<f32>() / 1000.0;
                assert!((mean * fraction - 1.0).abs() < 1e-3, "{fraction}: {mean}");
                assert!(codes(fraction).all(|code| is_of_region(code) == of_region));
            }
            let [whole, first, last] = match of_region {
                true => [FULL_REGION, FIRST_REGION, DISC_MASK],
                false => [FULL_DISC, 0, FIRST_REGION - 1],
            };
            assert!(codes(1.0).all(|code| code == whole));
            assert!(codes(0.0).chain(codes(0.03)).all(|code| code == first));
            assert!(codes(100.0).all(|code| code == last));
        }
    }

    #[test]
    fn rgbe_is_accurate_to_a_step_of_its_largest_component() {
        for exponent in -40..40 {
            for mantissa in 0..64 {
                let largest = (1.0 + mantissa as f32 / 64.0) * power_of_two(exponent);
                for colour in [[largest, largest * 0.3, 0.0], [0.01 * largest, largest, largest]] {
                    let decoded = Rgbe::encode(colour, 0x9e37_79b9).decode();
                    for (a, b) in colour.into_iter().zip(decoded) {
                        assert!((a - b).abs() <= largest / 63.0, "{colour:?} {decoded:?}");
                    }
                }
            }
        }
    }

    #[test]
    fn the_mean_of_dithered_encodings_is_the_colour() {
        for colour in [[1.0, 0.01, 0.003], [0.9, 0.7, 0.37], [0.998, 0.001, 0.5]] {
            let mut mean = [0.0_f64; 3];
            let count = 100_000_u32;
            for i in 0..count {
                let decoded = Rgbe::encode(colour, i.wrapping_mul(0x9e37_79b9)).decode();
                (0..3).for_each(|c| mean[c] += decoded[c] as f64 / count as f64);
            }
            for (a, b) in colour.into_iter().zip(mean) {
                assert!((b / a as f64 - 1.0).abs() < 0.01, "{colour:?} {mean:?}");
            }
        }
    }

    #[test]
    fn rgbe_encodes_negative_and_non_finite_components_as_black() {
        for colour in [[0.0; 3], [-1.0, f32::NAN, f32::NEG_INFINITY], [1e-45, 0.0, 0.0]] {
            assert_eq!(Rgbe::encode(colour, 0x9e37_79b9).decode(), [0.0; 3]);
        }
    }
}
