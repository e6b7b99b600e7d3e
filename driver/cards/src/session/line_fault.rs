//! Probable cause of a line on which no message comes through, from the bytes that have come.

use std::fmt;

/// Minimum number of bytes other than zero that reveal a changed bit or text. Of as many random bytes, none
/// has its top bit set with a probability of 2^-32.
const SOME: u32 = 32;
/// Minimum number of different bytes that are no noise of few patterns.
const MIXED: usize = 12;
/// Minimum number of bytes other than zero that reveal a missing value. Of as many random bytes, none has
/// either of two values with a probability of 10^-7.
const MANY: u32 = 2048;
/// Minimum number of different bytes of varied data.
const VARIED: usize = 200;
/// Number of bytes of text that a message quotes.
const QUOTED: usize = 40;

/// Probable cause of a line on which no message of the card comes through.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum LineFault {
    /// The bytes are text, which begins with this.
    Text(String),
    /// All bytes are zero.
    Zeros,
    /// No byte has its top bit set.
    SevenBits,
    /// The top bit of each byte makes its number of ones even, or odd.
    Parity {
        /// True for an even number of ones.
        is_even: bool,
    },
    /// The bytes of software flow control are missing.
    FlowControl,
    /// Each line feed follows a carriage return.
    LineFeeds(u32),
    /// Carriage returns are missing.
    NoReturns,
    /// Some frames are whole, and this number is damaged.
    Damage(u64),
    /// There is no sign of another cause.
    NoFrames,
}

impl LineFault {
    /// Suggestion how to correct the line.
    pub(super) fn remedy(&self) -> &'static str {
        match self {
            Self::Text(_) => {
                "the firmware writes log text on this line, or another program or device is at the address: \
                 check the address, and give the log another line"
            }
            Self::Zeros | Self::NoFrames => {
                "set the bit rate of the card's firmware (`serial:PATH@BAUD`), check its clock and the cable, and \
                 that a card is at the address"
            }
            Self::SevenBits | Self::Parity { .. } => {
                "set 8 data bits, no parity and one stop bit in the firmware, the adapter and each converter on \
                 the line"
            }
            Self::FlowControl => {
                "switch off XON/XOFF in the firmware, the adapter and each converter on the line"
            }
            Self::LineFeeds(_) | Self::NoReturns => {
                "set each terminal and converter on the line to raw bytes (`stty raw`; `socat` without `crnl`)"
            }
            Self::Damage(_) => {
                "lower the bit rate, shorten the cable, check ground and power; a receiver without flow control \
                 may be too slow"
            }
        }
    }
}

/// A clause about the bytes that have come.
impl fmt::Display for LineFault {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        match self {
            Self::Text(text) => write!(f, "the bytes are text, {text:?}"),
            Self::Zeros => {
                f.write_str("all bytes are zero, as of a wrong bit rate or a line that is held low")
            }
            Self::SevenBits => {
                f.write_str("no byte has its top bit set: 7 data bits or a parity bit somewhere on the line")
            }
            Self::Parity { is_even } => {
                let kind = if *is_even { "even" } else { "odd" };
                write!(
                    f,
                    "the top bit of each byte is {kind} parity: 7 data bits and a parity bit on the line"
                )
            }
            Self::FlowControl => f.write_str(
                "no byte is 0x11 or 0x13: software flow control (XON/XOFF) on the line takes both",
            ),
            Self::LineFeeds(feeds) => {
                write!(f, "0x0D comes before each 0x0A ({feeds} times): line ends are translated on the way")
            }
            Self::NoReturns => f.write_str("no byte is 0x0D: line ends are translated on the way"),
            Self::Damage(frames) => {
                write!(f, "{frames} frames are damaged: bytes are lost or altered on the way")
            }
            Self::NoFrames => f.write_str("the bytes are no frames: a wrong bit rate, or no card"),
        }
    }
}

/// Bytes received since the last message, counted by value, and frames.
pub(super) struct Evidence {
    counts: [u32; 256],
    /// Number of line feeds directly after a carriage return.
    pairs: u32,
    last: u8,
    begin: Vec<u8>,
    /// Number of whole frames.
    whole: u64,
    /// Number of damaged frames.
    damaged: u64,
}

impl Default for Evidence {
    fn default() -> Self {
        Self { counts: [0; 256], pairs: 0, last: 0, begin: Vec::new(), whole: 0, damaged: 0 }
    }
}

impl Evidence {
    /// Adds received bytes.
    pub(super) fn add(&mut self, bytes: &[u8]) {
        for &byte in bytes {
            self.counts[usize::from(byte)] += 1;
            self.pairs += u32::from((self.last, byte) == (b'\r', b'\n'));
            self.last = byte;
        }
        let room = QUOTED.saturating_sub(self.begin.len());
        self.begin.extend(bytes.iter().take(room));
    }

    /// Adds a whole frame.
    pub(super) fn add_whole(&mut self) {
        self.whole += 1;
    }

    /// Adds damaged frames.
    pub(super) fn add_damaged(&mut self, frames: u64) {
        self.damaged += frames;
    }

    /// Returns whether a fourth of the frames was damaged, and more than a few: the line is at fault, and not
    /// the card.
    pub(super) fn is_of_bad_line(&self) -> bool {
        self.damaged > 3 && 3 * self.damaged >= self.whole
    }

    /// Most probable fault of the line.
    pub(super) fn fault(&self) -> LineFault {
        let [returns, feeds] = [b'\r', b'\n'].map(|byte| self.counts[usize::from(byte)]);
        let [many, some] = [(MANY, VARIED), (SOME, MIXED)].map(|(bytes, values)| self.has(bytes, values));
        let flow = [0x11, 0x13].map(|byte: usize| self.counts[byte]);
        let has_parity = |is_even| self.all(|byte| (byte.count_ones() % 2 == 0) == is_even);
        if self.count(|_| true) == 0 {
            LineFault::Zeros
        } else if self.is_text() {
            LineFault::Text(String::from_utf8_lossy(&self.begin).trim().to_owned())
        } else if some && self.all(|byte| byte < 0x80) {
            LineFault::SevenBits
        } else if some && (has_parity(true) || has_parity(false)) {
            LineFault::Parity { is_even: has_parity(true) }
        } else if many && flow == [0, 0] {
            LineFault::FlowControl
        } else if many && feeds > 0 && self.pairs == feeds {
            LineFault::LineFeeds(feeds)
        } else if many && returns == 0 {
            LineFault::NoReturns
        } else if self.whole > 0 && self.damaged > 0 {
            LineFault::Damage(self.damaged)
        } else {
            LineFault::NoFrames
        }
    }

    /// Returns whether at least `bytes` bytes other than zero have come, of `values` different values.
    fn has(&self, bytes: u32, values: usize) -> bool {
        self.count(|_| true) >= bytes && self.counts.iter().filter(|&&count| count > 0).count() >= values
    }

    /// Returns whether a property is true of all bytes other than zero.
    fn all(&self, is: impl Fn(u8) -> bool) -> bool {
        self.count(|byte| !is(byte)) == 0
    }

    /// Number of bytes other than zero of which a property is true.
    fn count(&self, is: impl Fn(u8) -> bool) -> u32 {
        (1..=255).filter(|&byte| is(byte)).map(|byte| self.counts[usize::from(byte)]).sum()
    }

    /// Returns whether nearly all bytes are those of text, with colours of a terminal.
    fn is_text(&self) -> bool {
        let is_of_text = |byte: u8| matches!(byte, b' '..=b'~' | b'\t' | b'\n' | b'\r' | 0x1b);
        let [of_text, all] = [self.count(is_of_text), self.count(|_| true)];
        all >= SOME / 2 && u64::from(of_text) * 20 >= u64::from(all) * 19
    }
}

#[cfg(test)]
mod tests {
    use photoncard_shared::transport::Transport;

    use super::*;

    /// Bytes of frames, four at most, of random payloads of `length` bytes.
    fn frames(frames: usize, length: usize) -> Vec<u8> {
        let mut random = 1_u64;
        let mut next = || {
            random = random.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            (random >> 56) as u8
        };
        let (mut transport, mut bytes) = (Transport::host(), Vec::new());
        transport.open(1);
        for _ in 0..frames {
            assert!(transport.send(|payload| {
                payload[..length].fill_with(&mut next);
                Some(length)
            }));
            let frame = transport.outgoing().to_vec();
            transport.sent(frame.len());
            bytes.extend(frame);
        }
        bytes
    }

    fn fault_of(bytes: &[u8]) -> LineFault {
        let mut evidence = Evidence::default();
        bytes.chunks(7).for_each(|chunk| evidence.add(chunk));
        evidence.fault()
    }

    fn each(bytes: &[u8], change: impl Fn(u8) -> u8) -> Vec<u8> {
        bytes.iter().map(|&byte| if byte == 0 { 0 } else { change(byte) }).collect()
    }

    fn with_parity(byte: u8, odd: u32) -> u8 {
        let bits = byte & 0x7f;
        bits | u8::from(bits.count_ones() % 2 != odd) << 7
    }

    #[test]
    fn a_changed_bit_is_found_in_one_short_frame() {
        let frame = frames(1, 100);
        for (changed, fault) in [
            (each(&frame, |byte| byte & 0x7f), LineFault::SevenBits),
            (each(&frame, |byte| with_parity(byte, 0)), LineFault::Parity { is_even: true }),
            (each(&frame, |byte| with_parity(byte, 1)), LineFault::Parity { is_even: false }),
            (frame.clone(), LineFault::NoFrames),
        ] {
            assert_eq!(fault_of(&changed), fault);
        }
    }

    /// pyserial/pyserial issue 345: 0x11 was missing in answers. gauteh/defmt-serial issue 12: `socat` with
    /// `crnl` translates bytes of frames.
    #[test]
    fn swallowed_and_translated_bytes_are_found_in_many_frames() {
        let bytes = frames(4, 1000);
        let kept = |is_kept: &dyn Fn(u8) -> bool| -> Vec<u8> {
            bytes.iter().copied().filter(|&byte| is_kept(byte)).collect()
        };
        let fed = |byte: &u8| if *byte == b'\n' { b"\r\n".to_vec() } else { vec![*byte] };
        let fed: Vec<u8> = bytes.iter().flat_map(fed).collect();
        let feeds = bytes.iter().filter(|&&byte| byte == b'\n').count() as u32;
        for (changed, fault) in [
            (kept(&|byte| !matches!(byte, 0x11 | 0x13)), LineFault::FlowControl),
            (fed, LineFault::LineFeeds(feeds)),
            (kept(&|byte| byte != b'\r'), LineFault::NoReturns),
            (each(&bytes, |byte| if byte == b'\r' { b'\n' } else { byte }), LineFault::NoReturns),
            (bytes.clone(), LineFault::NoFrames),
        ] {
            assert_eq!(fault_of(&changed), fault);
        }
    }

    #[test]
    fn text_zeros_and_noise_are_told_apart() {
        let text = b"\x1b[32mI (31) boot: ESP-IDF v5.1 2nd stage bootloader\r\n";
        assert!(matches!(fault_of(text), LineFault::Text(quoted) if quoted.contains("I (31) boot")));
        assert_eq!(fault_of(&[0; 50]), LineFault::Zeros);
        for noise in [&[0x80; 500][..], &[0x06, 0x1e, 0x78].repeat(200), &[0xf8, 0, 0x80].repeat(200)] {
            assert_eq!(fault_of(noise), LineFault::NoFrames);
        }
    }

    #[test]
    fn losses_are_told_by_the_frames_that_were_damaged() {
        let mut evidence = Evidence::default();
        evidence.add(&frames(3, 900));
        evidence.add_whole();
        evidence.add_damaged(2);
        assert_eq!(evidence.fault(), LineFault::Damage(2));
        assert!(!evidence.is_of_bad_line());
        evidence.add_damaged(2);
        assert!(evidence.is_of_bad_line());
        (0..12).for_each(|_| evidence.add_whole());
        assert!(!evidence.is_of_bad_line());
    }
}
