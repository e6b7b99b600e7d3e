//! Frames: how bytes stay whole on a line.
//!
//! ```text
//! COBS( kind: u8 | session: u32 | sequence: u16 | acknowledged: u16 | held: u8 | payload | CRC-32C of all before: u32 ) 0x00
//! ```
//!
//! Numbers are little-endian. Stuffing ([`crate::stuffing`]) leaves no zero byte inside a frame, so that a receiver finds
//! the next frame after any damage. What the header's numbers mean is told in
//! [`crate::transport`].

use heapless::Vec;

use crate::checksum::{Checksum, checksum};
use crate::stuffing::{max_stuffed_bytes, stuff, unstuff};

/// Bytes of the longest payload: eight lines and the words of their message.
pub const MAX_PAYLOAD: usize = 8 * crate::address::LINE_BYTES + 32;
/// Bytes of a frame's header.
pub const HEADER_BYTES: usize = 10;
const CHECKSUM_BYTES: usize = 4;
const MAX_PLAIN: usize = HEADER_BYTES + MAX_PAYLOAD + CHECKSUM_BYTES;
/// Bytes of the longest frame on the wire, its zero byte included.
pub const MAX_FRAME: usize = max_stuffed_bytes(MAX_PLAIN) + 1;

/// Why what came is not a frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum FrameError {
    /// No zero byte within [`MAX_FRAME`] bytes, or a payload above [`MAX_PAYLOAD`].
    TooLong,
    /// Not a COBS encoding.
    Encoding,
    /// Shorter than the shortest frame.
    TooShort,
    /// The checksum differs.
    Checksum,
    /// A kind that this version does not know.
    Kind,
}

/// What a frame is for. The numbers are part of the protocol.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u8)]
pub enum FrameKind {
    /// Carries a message.
    Data = 0,
    /// The same, and begins a session.
    Open = 1,
    /// Tells what has come.
    Acknowledge = 2,
    /// Asks what has come; tells that frames below its sequence number, if they are not acknowledged, are lost.
    Probe = 3,
    /// Answers a probe: tells what has come, and the number of the next frame.
    Answer = 4,
    /// Tells that its session is not known.
    Unknown = 5,
}

impl FrameKind {
    fn read(number: u8) -> Option<Self> {
        let kinds = [Self::Data, Self::Open, Self::Acknowledge, Self::Probe, Self::Answer, Self::Unknown];
        kinds.into_iter().find(|&kind| kind as u8 == number)
    }
}

/// The header of a frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct FrameHeader {
    /// What it is for.
    pub kind: FrameKind,
    /// The session that it belongs to.
    pub session: u32,
    /// The number of the frame in its direction; see the kinds.
    pub sequence: u16,
    /// All frames of the other direction before this number have been taken.
    pub acknowledged: u16,
    /// Of the frames from that number on, a bit for each that has come: the lowest is of the number itself.
    pub held: u8,
}

impl FrameHeader {
    fn to_bytes(self) -> [u8; HEADER_BYTES] {
        let [a, b, c, d] = self.session.to_le_bytes();
        let [[e, f], [g, h]] = [self.sequence, self.acknowledged].map(u16::to_le_bytes);
        [self.kind as u8, a, b, c, d, e, f, g, h, self.held]
    }

    fn read([kind, a, b, c, d, e, f, g, h, held]: [u8; HEADER_BYTES]) -> Option<Self> {
        let session = u32::from_le_bytes([a, b, c, d]);
        let [sequence, acknowledged] = [[e, f], [g, h]].map(u16::from_le_bytes);
        Some(Self { kind: FrameKind::read(kind)?, session, sequence, acknowledged, held })
    }
}

/// Writes a frame behind what `wire` holds, or nothing if there is no room: a payload of up to [`MAX_PAYLOAD`] bytes fits
/// [`MAX_FRAME`].
pub fn write_frame<const N: usize>(header: &FrameHeader, payload: &[u8], wire: &mut Vec<u8, N>) {
    let begin = wire.len();
    let header = header.to_bytes();
    let mut sum = Checksum::default();
    sum.update(&header);
    sum.update(payload);
    let sum = sum.value().to_le_bytes();
    let plain = [&header[..], payload, &sum].into_iter().flatten().copied();
    if !stuff(plain, wire) || wire.push(0).is_err() {
        wire.truncate(begin);
    }
}

/// A frame that came whole.
#[derive(Debug, PartialEq, Eq)]
pub struct Frame<'a> {
    /// Its header.
    pub header: FrameHeader,
    /// What it carries.
    pub payload: &'a [u8],
}

/// Reads the frames of one direction.
pub struct FrameReader {
    /// The bytes of the present frame: all but its zero byte.
    wire: Vec<u8, { MAX_FRAME - 1 }>,
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
    let plain: &[u8] = unstuff(wire).ok_or(FrameError::Encoding)?;
    let (body, sum) = plain.split_last_chunk().ok_or(FrameError::TooShort)?;
    let (header, payload) = body.split_first_chunk().ok_or(FrameError::TooShort)?;
    if checksum(body) != u32::from_le_bytes(*sum) {
        return Err(FrameError::Checksum);
    }
    if payload.len() > MAX_PAYLOAD {
        return Err(FrameError::TooLong);
    }
    Ok(Frame { header: FrameHeader::read(*header).ok_or(FrameError::Kind)?, payload })
}
