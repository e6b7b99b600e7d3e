//! Frames: how a message stays whole on a line of bytes.
//!
//! ```text
//! COBS( sequence: u16 LE | payload | CRC-32C of both: u32 LE ) 0x00
//! ```
//!
//! Consistent overhead byte stuffing (Cheshire, Baker 1999) leaves no zero byte inside a frame, so that a receiver
//! finds the next frame after any damage. The sequence number counts the frames of one direction from 0 and wraps: a
//! gap tells of a lost frame.

use crc::{CRC_32_ISCSI, Crc, Table};
use heapless::Vec;

/// Bytes of the longest payload: sixteen lines and the words of their message.
pub const MAX_PAYLOAD: usize = 16 * crate::address::LINE_BYTES + 64;
const SEQUENCE_BYTES: usize = 2;
const CHECKSUM_BYTES: usize = 4;
const MAX_PLAIN: usize = SEQUENCE_BYTES + MAX_PAYLOAD + CHECKSUM_BYTES;
/// Bytes of the longest frame on the wire, its zero byte included.
pub const MAX_FRAME: usize = cobs::max_encoding_length(MAX_PLAIN) + 1;

static CRC_32C: Crc<u32, Table<16>> = Crc::<u32, Table<16>>::new(&CRC_32_ISCSI);

/// CRC-32C (Castagnoli) of some bytes.
pub fn checksum(bytes: &[u8]) -> u32 {
    CRC_32C.checksum(bytes)
}

/// A CRC-32C over bytes that come in pieces.
#[derive(Clone)]
pub struct Checksum(crc::Digest<'static, u32, Table<16>>);

impl Default for Checksum {
    fn default() -> Self {
        Self(CRC_32C.digest())
    }
}

impl Checksum {
    /// Goes on with the next bytes.
    pub fn update(&mut self, bytes: &[u8]) {
        self.0.update(bytes);
    }

    /// The checksum of all bytes so far.
    pub fn value(&self) -> u32 {
        self.0.clone().finalize()
    }
}

/// Why what came is not a frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum FrameError {
    /// No zero byte within [`MAX_FRAME`] bytes.
    TooLong,
    /// Not a COBS encoding.
    Encoding,
    /// Shorter than the shortest frame.
    TooShort,
    /// The checksum differs.
    Checksum,
}

/// A frame that came whole.
#[derive(Debug, PartialEq, Eq)]
pub struct Frame<'a> {
    /// Its number.
    pub sequence: u16,
    /// What it carries.
    pub payload: &'a [u8],
}

/// Writes the frames of one direction.
pub struct FrameWriter {
    sequence: u16,
    plain: [u8; MAX_PLAIN],
    wire: [u8; MAX_FRAME],
}

impl Default for FrameWriter {
    fn default() -> Self {
        Self::new()
    }
}

impl FrameWriter {
    /// A writer whose first frame has number 0.
    pub const fn new() -> Self {
        Self { sequence: 0, plain: [0; MAX_PLAIN], wire: [0; MAX_FRAME] }
    }

    /// Frames the payload that `fill` writes into the slice it is given, returning its length.
    ///
    /// `None` if `fill` returns `None` or more than the slice's length: nothing is framed and no number is used.
    pub fn write(&mut self, fill: impl FnOnce(&mut [u8]) -> Option<usize>) -> Option<&[u8]> {
        let payload = self.plain.get_mut(SEQUENCE_BYTES..SEQUENCE_BYTES + MAX_PAYLOAD)?;
        let end = fill(payload).filter(|&bytes| bytes <= MAX_PAYLOAD)? + SEQUENCE_BYTES;
        *self.plain.first_chunk_mut()? = self.sequence.to_le_bytes();
        let sum = checksum(self.plain.get(..end)?);
        *self.plain.get_mut(end..)?.first_chunk_mut()? = sum.to_le_bytes();
        let encoded = cobs::try_encode(self.plain.get(..end + CHECKSUM_BYTES)?, &mut self.wire).ok()?;
        *self.wire.get_mut(encoded)? = 0;
        self.sequence = self.sequence.wrapping_add(1);
        self.wire.get(..=encoded)
    }
}

/// Reads the frames of one direction.
pub struct FrameReader {
    wire: Vec<u8, MAX_FRAME>,
    /// The bytes of the present frame are more than can be held: they are dropped up to the next zero byte.
    overrun: bool,
    complete: bool,
}

impl Default for FrameReader {
    fn default() -> Self {
        Self::new()
    }
}

impl FrameReader {
    /// A reader at the start of a frame.
    pub const fn new() -> Self {
        Self { wire: Vec::new(), overrun: false, complete: false }
    }

    /// Takes bytes up to the end of the next frame. Returns how many were taken and, if a frame ended, the frame or
    /// what is wrong with it. Two zero bytes in a row are no frame and no error.
    pub fn read(&mut self, bytes: &[u8]) -> (usize, Option<Result<Frame<'_>, FrameError>>) {
        if core::mem::take(&mut self.complete) {
            self.wire.clear();
            self.overrun = false;
        }
        let end = bytes.iter().position(|&byte| byte == 0);
        let body = bytes.get(..end.unwrap_or(bytes.len())).unwrap_or(&[]);
        if self.wire.extend_from_slice(body).is_err() {
            self.overrun = true;
        }
        let Some(end) = end else { return (bytes.len(), None) };
        self.complete = true;
        if self.overrun {
            return (end + 1, Some(Err(FrameError::TooLong)));
        }
        if self.wire.is_empty() {
            return (end + 1, None);
        }
        (end + 1, Some(decode(&mut self.wire)))
    }
}

fn decode(wire: &mut [u8]) -> Result<Frame<'_>, FrameError> {
    let length = cobs::decode_in_place(wire).map_err(|_| FrameError::Encoding)?;
    let plain = wire.get(..length).ok_or(FrameError::Encoding)?;
    let (body, sum) = plain.split_last_chunk().ok_or(FrameError::TooShort)?;
    let (sequence, payload) = body.split_first_chunk().ok_or(FrameError::TooShort)?;
    if checksum(body) != u32::from_le_bytes(*sum) {
        return Err(FrameError::Checksum);
    }
    Ok(Frame { sequence: u16::from_le_bytes(*sequence), payload })
}
