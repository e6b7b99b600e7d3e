//! Frames: byte sequences with a checksum, for a link that damages, loses or repeats bytes.
//!
//! ```text
//! COBS( kind: u8 | session: u32 | sequence: u16 | acknowledged: u16 | held: u8 | payload | CRC-32C of all
//! before: u32 ) 0x00
//! ```
//!
//! Numbers are little-endian. Byte stuffing ([`crate::stuffing`]) removes all zero bytes before the
//! terminator, so that a receiver finds the next frame after any damage. [`crate::transport`] defines the
//! meaning of the numbers in the header.

use core::fmt;

use heapless::Vec;
use memchr::memchr;

use crate::checksum::{Checksum, checksum};
use crate::stuffing::{max_stuffed_bytes, stuff, unstuff};

/// Maximum length of a payload, bytes: eight lines, and 32 bytes for the other fields of a message.
pub const MAX_PAYLOAD: usize = 8 * crate::address::LINE_BYTES + 32;
/// Bytes of a frame's header.
pub const HEADER_BYTES: usize = 10;
const CHECKSUM_BYTES: usize = 4;
const MAX_PLAIN: usize = HEADER_BYTES + MAX_PAYLOAD + CHECKSUM_BYTES;
/// Maximum length of a frame on the wire, bytes, its terminating zero included.
pub const MAX_FRAME: usize = max_stuffed_bytes(MAX_PLAIN) + 1;

/// Reason why received bytes are not a frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum FrameError {
    /// No zero byte within [`MAX_FRAME`] bytes, or a payload above [`MAX_PAYLOAD`].
    TooLong,
    /// Not a COBS encoding.
    Encoding,
    /// Shorter than a header and a checksum.
    TooShort,
    /// Wrong checksum.
    Checksum,
    /// A [`FrameKind`] unknown to this version.
    Kind,
}

impl fmt::Display for FrameError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::TooLong => "the frame is too long",
            Self::Encoding => "the frame is not encoded by COBS",
            Self::TooShort => "the frame is shorter than a header and a checksum",
            Self::Checksum => "the frame has another checksum",
            Self::Kind => "the frame is of an unknown kind",
        })
    }
}

impl core::error::Error for FrameError {}

/// Purpose of a frame. The numbers are part of the protocol.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u8)]
pub enum FrameKind {
    /// A message.
    Data = 0,
    /// A message that begins a session.
    Open = 1,
    /// An acknowledgement without a message.
    Acknowledge = 2,
    /// A request for an [`Self::Answer`]. It also reports losses: the receiver's messages with numbers below
    /// the probe's sequence number are lost, unless the probe acknowledges them.
    Probe = 3,
    /// Reply to a probe. Its sequence number is that of the sender's next message.
    Answer = 4,
    /// Reply to a frame whose session the card does not know.
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
    /// Purpose of the frame.
    pub kind: FrameKind,
    /// Number of the frame's session.
    pub session: u32,
    /// Number of this frame's message in its direction, modulo 2^16. An answer has the number of the sender's
    /// next message, a probe the bound described at [`FrameKind::Probe`]. Other frames without a message have
    /// 0.
    pub sequence: u16,
    /// Number of the next message of the other direction that the frame's sender expects. The sender has
    /// taken all messages before that one.
    pub acknowledged: u16,
    /// Bit `i` is set if message `acknowledged + i` of the other direction has arrived.
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

/// Appends a frame to `wire`. Appends nothing if there is no room; [`MAX_FRAME`] bytes suffice for a payload
/// of [`MAX_PAYLOAD`].
pub fn write_frame<const N: usize>(header: &FrameHeader, payload: &[u8], wire: &mut Vec<u8, N>) {
    let begin = wire.len();
    let header = header.to_bytes();
    let mut sum = Checksum::default();
    sum.update(&header);
    sum.update(payload);
    let sum = sum.value().to_le_bytes();
    if !stuff(&[&header, payload, &sum], wire) || wire.push(0).is_err() {
        wire.truncate(begin);
    }
}

/// A received frame with a valid checksum.
#[derive(Debug, PartialEq, Eq)]
pub struct Frame<'a> {
    /// Header of the frame.
    pub header: FrameHeader,
    /// Payload of the frame, at most [`MAX_PAYLOAD`] bytes.
    pub payload: &'a [u8],
}

/// Decoder of the frames that arrive on a link.
pub struct FrameReader {
    /// Bytes of the current frame, without its terminating zero.
    wire: Vec<u8, { MAX_FRAME - 1 }>,
    /// True if the current frame is too long. Its bytes are dropped up to the next zero byte.
    overrun: bool,
    complete: bool,
}

impl Default for FrameReader {
    fn default() -> Self {
        Self::new()
    }
}

impl FrameReader {
    /// Creates a reader at the start of a frame.
    pub const fn new() -> Self {
        Self { wire: Vec::new(), overrun: false, complete: false }
    }

    /// Consumes bytes up to the end of the next frame. Returns the number of bytes consumed and, if a frame
    /// ended, the frame or its defect. Two zero bytes in a row are neither a frame nor an error.
    pub fn read(&mut self, bytes: &[u8]) -> (usize, Option<Result<Frame<'_>, FrameError>>) {
        if core::mem::take(&mut self.complete) {
            self.wire.clear();
            self.overrun = false;
        }
        let end = memchr(0, bytes);
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
