//! CRC-32C (Castagnoli), sixteen bytes at a time (Kounavis, Berry 2005): one table for each place among the sixteen.

/// The polynomial, its lowest coefficient first.
const POLYNOMIAL: u32 = 0x82f6_3b78;

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

/// What a byte adds.
#[expect(clippy::indexing_slicing, reason = "a byte is below 256: the compiler drops the check")]
#[inline(always)]
fn look_up(table: &[u32; 256], byte: u8) -> u32 {
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
