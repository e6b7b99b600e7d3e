//! The checksums of frames and of images. They are of two polynomials, so that what is wrong in a way that one does not
//! show is shown by the other.
//!
//! [`Checksum`], of frames, is CRC-32C (Castagnoli), sixteen bytes at a time (Kounavis, Berry 2005): one table for each
//! place among the sixteen. [`ImageChecksum`], of chunks and of the whole image, is CRC-64/XZ (ECMA-182), byte by byte.

use crate::address::Line;

/// The polynomial of frames, its lowest coefficient first.
const POLYNOMIAL: u32 = 0x82f6_3b78;
/// The polynomial of images, its lowest coefficient first.
const IMAGE_POLYNOMIAL: u64 = 0xc96c_5795_d787_0f42;

/// What a byte adds that is followed by as many zero bytes as its table's number.
static TABLES: [[u32; 256]; 16] = tables();

#[expect(clippy::indexing_slicing, reason = "the compiler runs it")]
const fn tables() -> [[u32; 256]; 16] {
    let mut tables = [[0; 256]; 16];
    let mut byte = 0;
    while byte < 256 {
        let (mut sum, mut bit) = (byte as u32, 0);
        while bit < 8 {
            sum = (sum >> 1) ^ (POLYNOMIAL & (sum & 1).wrapping_neg());
            bit += 1;
        }
        tables[0][byte] = sum;
        byte += 1;
    }
    let mut place = 1;
    while place < 16 {
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

/// What a byte adds to the checksum of an image.
static IMAGE_TABLE: [u64; 256] = image_table();

#[expect(clippy::indexing_slicing, reason = "the compiler runs it")]
const fn image_table() -> [u64; 256] {
    let mut table = [0; 256];
    let mut byte = 0;
    while byte < 256 {
        let (mut sum, mut bit) = (byte as u64, 0);
        while bit < 8 {
            sum = (sum >> 1) ^ (IMAGE_POLYNOMIAL & (sum & 1).wrapping_neg());
            bit += 1;
        }
        table[byte] = sum;
        byte += 1;
    }
    table
}

/// What a byte adds.
#[expect(clippy::indexing_slicing, reason = "a byte is below 256: the compiler drops the check")]
#[inline(always)]
fn look_up<T: Copy>(table: &[T; 256], byte: u8) -> T {
    table[usize::from(byte)]
}

/// CRC-32C of some bytes.
pub fn checksum(bytes: &[u8]) -> u32 {
    let mut sum = Checksum::default();
    sum.update(bytes);
    sum.value()
}

/// A CRC-32C over bytes that come in pieces.
#[derive(Clone)]
pub struct Checksum(u32);

impl Default for Checksum {
    fn default() -> Self {
        Self(u32::MAX)
    }
}

impl Checksum {
    /// Goes on with the next bytes.
    pub fn update(&mut self, bytes: &[u8]) {
        let (sixteens, rest) = bytes.as_chunks::<16>();
        for [a, b, c, d, behind @ ..] in sixteens {
            let add = |sum, (byte, table): (u8, &[u32; 256])| sum ^ look_up(table, byte);
            let mut tables = TABLES.iter().rev();
            let head = (u32::from_le_bytes([*a, *b, *c, *d]) ^ self.0).to_le_bytes();
            let head = head.into_iter().zip(&mut tables).fold(0, add);
            // Only the head waits for the sum so far.
            self.0 = behind.iter().copied().zip(tables).fold(0, add) ^ head;
        }
        for &byte in rest {
            let [first, ..] = &TABLES;
            let [low, ..] = self.0.to_le_bytes();
            self.0 = (self.0 >> 8) ^ look_up(first, low ^ byte);
        }
    }

    /// The checksum of all bytes so far.
    pub fn value(&self) -> u32 {
        !self.0
    }
}

/// CRC-64/XZ of the bytes of some lines.
pub fn image_checksum(lines: &[Line]) -> u64 {
    let mut sum = ImageChecksum::default();
    sum.update(lines);
    sum.value()
}

/// A CRC-64/XZ over lines that come in pieces.
#[derive(Clone)]
pub struct ImageChecksum(u64);

impl Default for ImageChecksum {
    fn default() -> Self {
        Self(u64::MAX)
    }
}

impl ImageChecksum {
    /// Goes on with the next lines.
    pub fn update(&mut self, lines: &[Line]) {
        for &byte in lines.iter().flat_map(|line| &line.0) {
            let [low, ..] = self.0.to_le_bytes();
            self.0 = (self.0 >> 8) ^ look_up(&IMAGE_TABLE, low ^ byte);
        }
    }

    /// The checksum of all lines so far.
    pub fn value(&self) -> u64 {
        !self.0
    }
}
