//! Textures: bilinear interpolation of texels in card memory.

use photoncard_shared::address::LINE_BYTES;
use photoncard_shared::image::SectionKind;
use photoncard_shared::layout::{Record, TexelFormat, Texture, Wrap};
use photoncard_shared::message::{Fault, FaultCode};

use super::SceneImage;
use crate::memory::MemoryPort;
use crate::vector::{max, min, sqrt};

const TEXTURES_PER_LINE: u32 = Texture::PER_LINE as u32;

const TEXEL_BYTES: u32 = 4;

/// Reads the parameters of texture `index`, without its texels.
///
/// # Errors
/// If there is no such texture.
pub fn read_texture(scene: &SceneImage, memory: &mut impl MemoryPort, index: u32) -> Result<Texture, Fault> {
    let bytes =
        scene.record::<{ Texture::BYTES }, TEXTURES_PER_LINE>(memory, SectionKind::Textures, index)?;
    Ok(Texture::read(bytes))
}

/// Choice of one of the four texels of a bilinear interpolation: two random numbers in [0, 1).
pub(super) type TexelChoice = [f32; 2];

/// Value of a texture at texture coordinates, bilinearly interpolated or of the nearest texel: linear RGBA.
///
/// # Errors
/// If the card image is invalid.
pub fn sample_texture(
    scene: &SceneImage,
    memory: &mut impl MemoryPort,
    texture: &Texture,
    coordinates: [f32; 2],
) -> Result<[f32; 4], Fault> {
    sample_texels(scene, memory, texture, coordinates, None)
}

/// Does [`sample_texture`]. With a choice, one texel stands for the four of the interpolation, whose weights
/// are the probabilities (Fajardo, Wronski, Salvi, Pharr 2023, *Stochastic texture filtering*).
pub(super) fn sample_texels(
    scene: &SceneImage,
    memory: &mut impl MemoryPort,
    texture: &Texture,
    coordinates: [f32; 2],
    choice: Option<TexelChoice>,
) -> Result<[f32; 4], Fault> {
    let [u, v] = coordinates;
    let [columns, rows] = texture.size;
    let place = |axis: usize, size: u16, wrap: Wrap| {
        let [[a, b], [c, d]] = texture.matrix;
        let [x, y] = texture.offset;
        TexelPair::new(if axis == 0 { a * u + b * v + x } else { c * u + d * v + y }, size, wrap)
    };
    let [across, down] = texture.wrap;
    let [across, down] = [place(0, columns, across), place(1, rows, down)];
    if texture.nearest {
        return texel(scene, memory, texture, [across.nearest(), down.nearest()]);
    }
    if let Some([column, row]) = choice {
        return texel(scene, memory, texture, [across.chosen(column), down.chosen(row)]);
    }
    let mut sum = [0.0; 4];
    for (row, row_weight) in down.texels() {
        for (column, column_weight) in across.texels() {
            let weight = row_weight * column_weight;
            let texel = texel(scene, memory, texture, [column, row])?;
            sum.iter_mut().zip(texel).for_each(|(sum, channel)| *sum += channel * weight);
        }
    }
    Ok(sum)
}

/// Two adjacent texels on one axis of a texture. The sampled coordinate lies between their centres.
struct TexelPair {
    /// Indices of the two texels.
    texels: [u32; 2],
    /// Weight of the second texel, 0 to 1.
    fraction: f32,
}

impl TexelPair {
    fn new(coordinate: f32, size: u16, wrap: Wrap) -> Self {
        let texels = u32::from(size.max(1));
        // Period of the wrap mode, texels; unused for clamping.
        let period = if wrap == Wrap::Mirror { 2 * texels } else { texels };
        let turns = match wrap {
            Wrap::Clamp => coordinate,
            Wrap::Repeat => coordinate - libm::floorf(coordinate),
            Wrap::Mirror => (coordinate * 0.5 - libm::floorf(coordinate * 0.5)) * 2.0,
        };
        let half_outside = 0.5 / texels as f32;
        // NaN becomes the first texel.
        let turns = if turns > -half_outside { turns } else { -half_outside };
        let turns = min(turns, period as f32 / texels as f32 + half_outside);
        let at = turns * texels as f32 + 0.5;
        // Texel indices are increased by 1 here, so that the texel before the first has index 0.
        let first = at as u32;
        let wrapped = |texel: u32| match wrap {
            Wrap::Clamp => texel.saturating_sub(1).min(texels - 1),
            Wrap::Repeat => (texel + texels - 1) % texels,
            Wrap::Mirror => {
                let texel = (texel + period - 1) % period;
                texel.min(period - 1 - texel)
            }
        };
        Self { texels: [wrapped(first), wrapped(first + 1)], fraction: at - first as f32 }
    }

    /// Indices of both texels with their weights, whose sum is 1.
    fn texels(&self) -> [(u32, f32); 2] {
        let [first, second] = self.texels;
        [(first, 1.0 - self.fraction), (second, self.fraction)]
    }

    fn nearest(&self) -> u32 {
        let [first, second] = self.texels;
        if self.fraction < 0.5 { first } else { second }
    }

    /// Index of a texel that the random number `random`, in [0, 1), chooses with the texel's weight.
    fn chosen(&self, random: f32) -> u32 {
        let [first, second] = self.texels;
        if random < self.fraction { second } else { first }
    }
}

/// Reads a texel and decodes it to linear RGBA.
fn texel(
    scene: &SceneImage,
    memory: &mut impl MemoryPort,
    texture: &Texture,
    [column, row]: [u32; 2],
) -> Result<[f32; 4], Fault> {
    let (line, place) = texture.locate(column, row);
    let first = place as u32 * TEXEL_BYTES;
    let bytes: &[u8; LINE_BYTES] =
        scene.line(memory, SectionKind::Texels, line, first..first + TEXEL_BYTES)?;
    let texel = bytes.as_chunks().0.get(place);
    let texel = *texel.ok_or(Fault { code: FaultCode::Record, detail: line })?;
    Ok(decode_texel(texture.format, texel))
}

/// Minimum and maximum of each channel, linear RGBA, over all texels of a texture.
///
/// # Errors
/// If the card image is invalid.
pub(super) fn channel_ranges(
    scene: &SceneImage,
    memory: &mut impl MemoryPort,
    texture: &Texture,
) -> Result<[[f32; 2]; 4], Fault> {
    let mut ranges = [[f32::INFINITY, f32::NEG_INFINITY]; 4];
    let [columns, rows] = texture.size.map(u32::from);
    for row in 0..rows {
        for column in 0..columns {
            let texel = texel(scene, memory, texture, [column, row])?;
            for ([least, greatest], channel) in ranges.iter_mut().zip(texel) {
                (*least, *greatest) = (min(channel, *least), max(channel, *greatest));
            }
        }
    }
    Ok(ranges)
}

/// Decodes a texel to linear RGBA.
pub fn decode_texel(format: TexelFormat, texel: [u8; 4]) -> [f32; 4] {
    let linear = |channel: u8| f32::from(channel) * (1.0 / 255.0);
    let [red, green, blue, alpha] = texel;
    match format {
        TexelFormat::Linear => texel.map(linear),
        TexelFormat::Srgb => [srgb(red), srgb(green), srgb(blue), linear(alpha)],
        TexelFormat::SharedExponent => {
            let bits = u32::from_le_bytes(texel);
            // 2^(exponent - 15 - 9), never subnormal.
            let scale = f32::from_bits(((bits >> 27) + 127 - 24) << 23);
            let mantissa = |channel: u32| (bits >> (9 * channel) & 0x1ff) as f32 * scale;
            [mantissa(0), mantissa(1), mantissa(2), 1.0]
        }
        TexelFormat::LinearPair => {
            let [first, second] = pair(texel);
            [first, second, first, 1.0]
        }
        TexelFormat::NormalPair => {
            let [first, second] = pair(texel);
            let [x, y] = [first, second].map(|channel| 2.0 * channel - 1.0);
            let z = sqrt(max(1.0 - (x * x + y * y), 0.0));
            [first, second, 0.5 * z + 0.5, 1.0]
        }
    }
}

/// Decodes two 16-bit channels to linear values, 0 to 1.
fn pair([a, b, c, d]: [u8; 4]) -> [f32; 2] {
    [[a, b], [c, d]].map(|code| f32::from(u16::from_le_bytes(code)) * (1.0 / 65_535.0))
}

/// Linear value, 0 to 1, of an sRGB byte (IEC 61966-2-1).
fn srgb(code: u8) -> f32 {
    SRGB.get(usize::from(code)).copied().unwrap_or(1.0)
}

static SRGB: [f32; 256] = srgb_table();

#[expect(clippy::indexing_slicing, reason = "computed at compile time")]
const fn srgb_table() -> [f32; 256] {
    let mut table = [0.0; 256];
    let mut code = 0;
    while code < 256 {
        let encoded = code as f64 / 255.0;
        table[code] = if encoded <= 0.040_45 {
            (encoded / 12.92) as f32
        } else {
            let base = (encoded + 0.055) / 1.055;
            // base^2.4
            (base * base * fifth_root(base * base)) as f32
        };
        code += 1;
    }
    table
}

/// Fifth root of a number in (0, 1], by Newton's method.
const fn fifth_root(number: f64) -> f64 {
    let mut root = 1.0;
    let mut step = 0;
    while step < 64 {
        root = (4.0 * root + number / (root * root * root * root)) / 5.0;
        step += 1;
    }
    root
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn srgb_codes_have_the_values_of_the_standard() {
        for code in 0..=255_u8 {
            let encoded = f64::from(code) / 255.0;
            let expected =
                if encoded <= 0.040_45 { encoded / 12.92 } else { ((encoded + 0.055) / 1.055).powf(2.4) };
            assert!((f64::from(srgb(code)) - expected).abs() < 1e-7, "{code}");
        }
    }

    #[test]
    fn shared_exponents_are_those_of_opengl() {
        let bits = |red: u32, green: u32, blue: u32, exponent: u32| {
            (red | green << 9 | blue << 18 | exponent << 27).to_le_bytes()
        };
        assert_eq!(decode_texel(TexelFormat::SharedExponent, bits(256, 128, 0, 16)), [1.0, 0.5, 0.0, 1.0]);
        assert_eq!(decode_texel(TexelFormat::SharedExponent, bits(511, 1, 2, 31))[0], 65_408.0);
        assert_eq!(decode_texel(TexelFormat::SharedExponent, [0; 4]), [0.0, 0.0, 0.0, 1.0]);
    }

    #[test]
    fn channel_pairs_have_sixteen_bits() {
        let texel = |first: u16, second: u16| {
            let ([a, b], [c, d]) = (first.to_le_bytes(), second.to_le_bytes());
            [a, b, c, d]
        };
        let decoded = decode_texel(TexelFormat::LinearPair, texel(u16::MAX, 1));
        assert_eq!(decoded, [1.0, 1.0 / 65_535.0, 1.0, 1.0]);
        for normal in [[0.0_f32, 0.0, 1.0], [0.6, -0.64, 0.48], [-0.001, 0.002, 0.999_997_5], [0.0, 1.0, 0.0]]
        {
            let [x, y] = [normal[0], normal[1]].map(|channel| ((channel + 1.0) * 32_767.5).round() as u16);
            let decoded =
                decode_texel(TexelFormat::NormalPair, texel(x, y)).map(|channel| 2.0 * channel - 1.0);
            let error = normal.iter().zip(decoded).map(|(a, b)| (a - b).abs()).fold(0.0, f32::max);
            // The slope of z as a function of x and y has no bound where z is 0.
            assert!(error < if normal[2] > 0.0 { 4e-5 } else { 8e-3 }, "{normal:?} {decoded:?}");
        }
        let outside = decode_texel(TexelFormat::NormalPair, texel(u16::MAX, u16::MAX));
        assert_eq!(outside, [1.0, 1.0, 0.5, 1.0]);
    }

    #[track_caller]
    fn between(coordinate: f32, wrap: Wrap) -> [(u32, f32); 2] {
        TexelPair::new(coordinate, 4, wrap).texels()
    }

    #[test]
    fn positions_lie_between_texel_centres() {
        for wrap in [Wrap::Repeat, Wrap::Mirror, Wrap::Clamp] {
            assert_eq!(between(0.5, wrap), [(1, 0.5), (2, 0.5)], "{wrap:?}");
            assert_eq!(between(0.375, wrap)[0], (1, 1.0), "{wrap:?}");
        }
    }

    #[test]
    fn coordinates_beyond_an_edge_follow_the_wrap_mode() {
        assert_eq!(between(0.0, Wrap::Repeat), [(3, 0.5), (0, 0.5)]);
        assert_eq!(between(1.0, Wrap::Repeat), [(3, 0.5), (0, 0.5)]);
        assert_eq!(between(-0.25, Wrap::Repeat), [(2, 0.5), (3, 0.5)]);
        assert_eq!(between(5.5, Wrap::Repeat), [(1, 0.5), (2, 0.5)]);
        assert_eq!(between(0.0, Wrap::Mirror), [(0, 0.5), (0, 0.5)]);
        assert_eq!(between(1.0, Wrap::Mirror), [(3, 0.5), (3, 0.5)]);
        assert_eq!(between(1.25, Wrap::Mirror), [(3, 0.5), (2, 0.5)]);
        assert_eq!(between(-0.25, Wrap::Mirror), [(1, 0.5), (0, 0.5)]);
        assert_eq!(between(-7.0, Wrap::Clamp), [(0, 1.0), (0, 0.0)]);
        assert_eq!(between(7.0, Wrap::Clamp)[0].0, 3);
        assert_eq!(between(7.0, Wrap::Clamp)[1].0, 3);
    }

    #[test]
    fn every_coordinate_maps_to_texels_within_the_texture() {
        let mut coordinates = std::vec![f32::NAN, f32::INFINITY, f32::NEG_INFINITY, f32::MAX, 1e-40, -1e-40];
        coordinates.extend((0..20_000).map(|i| (i as f32 - 10_000.0) * 0.000_731));
        for wrap in [Wrap::Repeat, Wrap::Mirror, Wrap::Clamp] {
            for size in [1, 2, 3, 16_384, u16::MAX] {
                for &coordinate in &coordinates {
                    let place = TexelPair::new(coordinate, size, wrap);
                    assert!(place.texels.into_iter().all(|texel| texel < u32::from(size)));
                    assert!(
                        (0.0..=1.0).contains(&place.fraction),
                        "{coordinate} {place_fraction}",
                        place_fraction = place.fraction
                    );
                }
            }
        }
    }
}
