//! Textures: texels, a sampler and a coordinate transform (glTF `KHR_texture_transform`).

use super::{Record, read_f32, read_u32, write_f32, write_u32};
use crate::address::LINE_BYTES;

/// Number of texels per line. A line holds a texel tile, 8x4 texels in row-major order, so that neighbouring
/// texels share a line.
pub const TEXELS_PER_LINE: u32 = (LINE_BYTES / 4) as u32;
/// Number of columns of a texel tile, the part of a texture in one line.
pub const TILE_WIDTH: u32 = 8;
/// Number of rows of a texel tile, the part of a texture in one line.
pub const TILE_HEIGHT: u32 = TEXELS_PER_LINE / TILE_WIDTH;

/// A texture. Each line holds a tile of 8x4 texels; the tiles are in row-major order. Tiles at the right and
/// lower border are padded to full size.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Texture {
    /// First line of the texels, counted from the start of [`crate::image::SectionKind::Texels`].
    pub first_line: u32,
    /// Width and height, texels: 1 to 65535.
    pub size: [u16; 2],
    /// Wrap modes of u and v.
    pub wrap: [Wrap; 2],
    /// True for nearest-neighbour filtering, false for bilinear.
    pub nearest: bool,
    /// Texture coordinate set, 0 or 1; a triangle has up to two sets.
    pub set: u32,
    /// Encoding of the texels.
    pub format: TexelFormat,
    /// Rows of the matrix of the coordinate transform `matrix uv + offset`.
    pub matrix: [[f32; 2]; 2],
    /// Offset of the coordinate transform `matrix uv + offset`.
    pub offset: [f32; 2],
}

/// Wrap mode of a texture coordinate outside [0, 1], as in a glTF sampler.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Wrap {
    /// glTF's `REPEAT`.
    #[default]
    Repeat,
    /// glTF's `MIRRORED_REPEAT`.
    Mirror,
    /// glTF's `CLAMP_TO_EDGE`.
    Clamp,
}

/// Encoding of a texel in four bytes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum TexelFormat {
    /// RGBA with 8 bits per channel: red, green and blue in sRGB, alpha linear.
    Srgb,
    /// RGBA with 8 bits per channel, linear.
    Linear,
    /// OpenGL's `RGB9_E5`: red, green and blue with 9 bits each and a shared exponent of 5 bits. Alpha is 1.
    SharedExponent,
    /// Two linear channels of 16 bits each, little-endian. The first gives red and blue, the second green.
    /// Alpha is 1.
    LinearPair,
    /// Texel of a normal map: red and green, linear, 16 bits each, little-endian. Blue is computed such that
    /// the normal `2 (red, green, blue) - 1` has unit length and points to the front. Alpha is 1.
    NormalPair,
}

impl Record for Texture {
    const BYTES: usize = 40;
}

const WRAP_BITS: u32 = 2;
const NEAREST: u32 = 1 << 4;
const SECOND_SET: u32 = 1 << 5;
const FORMAT_SHIFT: u32 = 6;

impl Texture {
    /// Reads a record.
    #[inline(always)]
    pub fn read(bytes: &[u8; Self::BYTES]) -> Self {
        let size = read_u32(bytes, 4);
        let flags = read_u32(bytes, 8);
        let wrap = |axis: u32| match flags >> (WRAP_BITS * axis) & 3 {
            0 => Wrap::Repeat,
            1 => Wrap::Mirror,
            _ => Wrap::Clamp,
        };
        let number = |index: usize| read_f32(bytes, 12 + 4 * index);
        Self {
            first_line: read_u32(bytes, 0),
            // A size of 0 occurs in unsound card images only.
            size: [(size as u16).max(1), ((size >> 16) as u16).max(1)],
            wrap: [wrap(0), wrap(1)],
            nearest: flags & NEAREST != 0,
            set: u32::from(flags & SECOND_SET != 0),
            format: match flags >> FORMAT_SHIFT & 7 {
                0 => TexelFormat::Srgb,
                1 => TexelFormat::Linear,
                2 => TexelFormat::SharedExponent,
                3 => TexelFormat::LinearPair,
                _ => TexelFormat::NormalPair,
            },
            matrix: [[number(0), number(1)], [number(2), number(3)]],
            offset: [number(4), number(5)],
        }
    }

    /// The record's bytes.
    pub fn to_bytes(&self) -> [u8; Self::BYTES] {
        let mut bytes = [0; Self::BYTES];
        let [width, height] = self.size.map(u32::from);
        let [across, down] = self.wrap.map(|wrap| wrap as u32);
        let flags = across
            | down << WRAP_BITS
            | if self.nearest { NEAREST } else { 0 }
            | if self.set == 1 { SECOND_SET } else { 0 }
            | (self.format as u32) << FORMAT_SHIFT;
        write_u32(&mut bytes, 0, self.first_line);
        write_u32(&mut bytes, 4, width | height << 16);
        write_u32(&mut bytes, 8, flags);
        let numbers = self.matrix.as_flattened().iter().chain(&self.offset);
        for (index, number) in numbers.enumerate() {
            write_f32(&mut bytes, 12 + 4 * index, *number);
        }
        bytes
    }

    /// Number of lines of the texels.
    pub fn lines(&self) -> u32 {
        let [width, height] = self.size.map(u32::from);
        width.div_ceil(TILE_WIDTH) * height.div_ceil(TILE_HEIGHT)
    }

    /// Returns the line of a texel, counted from the start of [`crate::image::SectionKind::Texels`], and the
    /// texel's index in that line.
    #[inline(always)]
    pub fn locate(&self, column: u32, row: u32) -> (u32, usize) {
        let tiles_across = u32::from(self.size[0]).div_ceil(TILE_WIDTH);
        let tile = (row / TILE_HEIGHT).wrapping_mul(tiles_across).wrapping_add(column / TILE_WIDTH);
        let place = row % TILE_HEIGHT * TILE_WIDTH + column % TILE_WIDTH;
        (self.first_line.wrapping_add(tile), place as usize)
    }
}

#[cfg(test)]
mod tests {
    extern crate std;

    use std::collections::BTreeSet;

    use super::*;

    fn texture() -> Texture {
        Texture {
            first_line: 70_000,
            size: [13, 6],
            wrap: [Wrap::Mirror, Wrap::Clamp],
            nearest: true,
            set: 1,
            format: TexelFormat::Linear,
            matrix: [[0.5, -1.0], [2.0, 0.25]],
            offset: [-3.0, 7.5],
        }
    }

    #[test]
    fn textures_survive_their_bytes() {
        let plain = Texture { wrap: [Wrap::Repeat; 2], nearest: false, set: 0, ..texture() };
        let formats = [
            TexelFormat::Srgb,
            TexelFormat::Linear,
            TexelFormat::SharedExponent,
            TexelFormat::LinearPair,
            TexelFormat::NormalPair,
        ];
        for format in formats {
            for texture in [texture(), plain] {
                let texture = Texture { format, ..texture };
                assert_eq!(Texture::read(&texture.to_bytes()), texture);
            }
        }
    }

    #[test]
    fn every_texel_has_its_own_position_in_the_textures_lines() {
        let texture = texture();
        let mut places = BTreeSet::new();
        for row in 0..6 {
            for column in 0..13 {
                let (line, place) = texture.locate(column, row);
                assert!(
                    (70_000..70_000 + texture.lines()).contains(&line) && place < TEXELS_PER_LINE as usize
                );
                assert!(places.insert((line, place)));
            }
        }
    }
}
