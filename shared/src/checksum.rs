//! Checksums of frames (packets on the link) and of card images (scenes in card memory). Their polynomials
//! differ: an error that is a multiple of one polynomial is detected by the checksum with the other.
//!
//! Frames use [`Checksum`]: CRC-32C (Castagnoli), computed by slicing-by-16 (Kounavis, Berry 2005). It
//! processes sixteen bytes at a time with one table per byte position. Card images and their chunks use
//! [`ImageChecksum`]: CRC-64/XZ (ECMA-182), computed by slicing-by-8.

use crate::address::Line;

/// Polynomial of CRC-32C, bit-reversed: the coefficient of x^31 is the lowest bit.
const POLYNOMIAL: u32 = 0x82f6_3b78;
/// Polynomial of CRC-64/XZ, bit-reversed: the coefficient of x^63 is the lowest bit.
const IMAGE_POLYNOMIAL: u64 = 0xc96c_5795_d787_0f42;

/// `TABLES[n][b]`: the CRC-32C remainder of byte `b` followed by `n` zero bytes.
static TABLES: [[u32; 256]; 16] = narrowed(tables(POLYNOMIAL as u64));
/// `IMAGE_TABLES[n][b]`: the CRC-64/XZ remainder of byte `b` followed by `n` zero bytes.
static IMAGE_TABLES: [[u64; 256]; 8] = tables(IMAGE_POLYNOMIAL);

/// Slicing tables of a bit-reversed polynomial of degree at most 64: entry `[n][b]` is the remainder of byte
/// `b` followed by `n` zero bytes.
#[expect(clippy::indexing_slicing, reason = "the compiler runs it")]
const fn tables<const PLACES: usize>(polynomial: u64) -> [[u64; 256]; PLACES] {
    let mut tables = [[0; 256]; PLACES];
    let mut byte = 0;
    while byte < 256 {
        let (mut sum, mut bit) = (byte as u64, 0);
        while bit < 8 {
            sum = (sum >> 1) ^ (polynomial & (sum & 1).wrapping_neg());
            bit += 1;
        }
        tables[0][byte] = sum;
        byte += 1;
    }
    let mut place = 1;
    while place < PLACES {
        byte = 0;
        while byte < 256 {
            let sum = tables[place - 1][byte];
            tables[place][byte] = (sum >> 8) ^ tables[0][(sum & 0xff) as usize];
            byte += 1;
        }
        place += 1;
    }
    tables
}

/// Converts the tables of a polynomial of degree 32, whose entries fit in 32 bits, to `u32`.
#[expect(clippy::indexing_slicing, reason = "the compiler runs it")]
const fn narrowed<const PLACES: usize>(wide: [[u64; 256]; PLACES]) -> [[u32; 256]; PLACES] {
    let mut tables = [[0; 256]; PLACES];
    let mut entry = 0;
    while entry < PLACES * 256 {
        tables[entry / 256][entry % 256] = wide[entry / 256][entry % 256] as u32;
        entry += 1;
    }
    tables
}

#[expect(clippy::indexing_slicing, reason = "a byte is below 256: the compiler drops the check")]
#[inline(always)]
fn look_up<T: Copy>(table: &[T; 256], byte: u8) -> T {
    table[usize::from(byte)]
}

/// CRC-32C of `bytes`.
pub fn checksum(bytes: &[u8]) -> u32 {
    let mut sum = Checksum::default();
    sum.update(bytes);
    sum.value()
}

/// CRC-32C of bytes that arrive in pieces.
#[derive(Clone, Debug)]
pub struct Checksum(u32);

impl Default for Checksum {
    fn default() -> Self {
        Self(u32::MAX)
    }
}

impl Checksum {
    /// Continues the checksum with `bytes`.
    #[inline]
    pub fn update(&mut self, bytes: &[u8]) {
        let (sixteens, rest) = bytes.as_chunks::<16>();
        for [a, b, c, d, behind @ ..] in sixteens {
            let add = |sum, (byte, table): (u8, &[u32; 256])| sum ^ look_up(table, byte);
            let mut tables = TABLES.iter().rev();
            let head = (u32::from_le_bytes([*a, *b, *c, *d]) ^ self.0).to_le_bytes();
            let head = head.into_iter().zip(&mut tables).fold(0, add);
            // Only the first four bytes depend on the sum so far; the other twelve lookups run meanwhile.
            self.0 = behind.iter().copied().zip(tables).fold(0, add) ^ head;
        }
        for &byte in rest {
            let [first, ..] = &TABLES;
            let [low, ..] = self.0.to_le_bytes();
            self.0 = (self.0 >> 8) ^ look_up(first, low ^ byte);
        }
    }

    /// CRC-32C of all bytes so far.
    pub fn value(&self) -> u32 {
        !self.0
    }
}

/// CRC-64/XZ of the bytes of `lines`.
pub fn image_checksum(lines: &[Line]) -> u64 {
    let mut sum = ImageChecksum::default();
    sum.update(lines);
    sum.value()
}

/// CRC-64/XZ of lines that arrive in pieces.
#[derive(Clone)]
pub struct ImageChecksum(u64);

impl Default for ImageChecksum {
    fn default() -> Self {
        Self(u64::MAX)
    }
}

impl ImageChecksum {
    /// Continues the checksum with `lines`.
    pub fn update(&mut self, lines: &[Line]) {
        // A line is a multiple of eight bytes.
        for &eight in lines.iter().flat_map(|line| line.0.as_chunks::<8>().0) {
            let head = (u64::from_le_bytes(eight) ^ self.0).to_le_bytes();
            let tables = IMAGE_TABLES.iter().rev();
            self.0 = head.into_iter().zip(tables).fold(0, |sum, (byte, table)| sum ^ look_up(table, byte));
        }
    }

    /// CRC-64/XZ of all lines so far.
    pub fn value(&self) -> u64 {
        !self.0
    }
}
