//! Hosts that come and go on one link, as their card sees them.

use crate::frame::FrameReader;

/// Terminating zero of a frame.
const FRAME_END: u8 = 0;

/// Card's end of the links to consecutive hosts, which are one link to the card: it never closes.
///
/// Output is lost while no host is connected, as on an unplugged cable. Between two hosts the link is cut at
/// the end of a frame in both directions. A host receives nothing before it has sent a byte.
#[derive(Default)]
pub struct Handover {
    host: Option<Host>,
    /// True if the last byte that the card sent was not the end of a frame.
    in_frame: bool,
}

struct Host {
    /// Parser of the first whole frame; `None` once it has arrived.
    first_frame: Option<FrameReader>,
    has_spoken: bool,
    /// True while the card sends the rest of a frame that it began before the host's first byte.
    skips_frame: bool,
}

impl Handover {
    /// Creates the end of a link that no host is connected to.
    pub const fn new() -> Self {
        Self { host: None, in_frame: false }
    }

    /// Returns whether a host is connected.
    pub const fn has_host(&self) -> bool {
        self.host.is_some()
    }

    /// Begins the connection to the next host. Returns the byte that the card is to receive before those of
    /// the host, because the previous host may have left a frame unfinished.
    pub fn welcome(&mut self) -> u8 {
        self.host =
            Some(Host { first_frame: Some(FrameReader::new()), has_spoken: false, skips_frame: false });
        FRAME_END
    }

    /// Ends the connection to the host.
    pub fn leave(&mut self) {
        self.host = None;
    }

    /// Takes note of bytes that the host has sent.
    pub fn received(&mut self, bytes: &[u8]) {
        let Some(host) = self.host.as_mut().filter(|_| !bytes.is_empty()) else { return };
        if !host.has_spoken {
            host.has_spoken = true;
            host.skips_frame = self.in_frame;
        }
        host.look_for_frame(bytes);
    }

    /// Returns whether the host has sent a whole, valid frame. A connection that does not within some seconds
    /// is of something else than a host.
    pub fn is_proven(&self) -> bool {
        self.host.as_ref().is_some_and(|host| host.first_frame.is_none())
    }

    /// Drops as many of the first bytes of the card's output as no host may receive. Returns their number; if
    /// it is 0, the bytes are to be sent.
    pub fn drop_unwanted(&mut self, bytes: &[u8]) -> usize {
        let unwanted = match self.host.as_mut().filter(|host| host.has_spoken) {
            None => bytes.len(),
            Some(host) if host.skips_frame => {
                let end = bytes.iter().position(|&byte| byte == FRAME_END);
                host.skips_frame = end.is_none();
                end.map_or(bytes.len(), |end| end + 1)
            }
            Some(_) => 0,
        };
        self.sent(bytes.get(..unwanted).unwrap_or(&[]));
        unwanted
    }

    /// Takes note of bytes that the card has sent.
    pub fn sent(&mut self, bytes: &[u8]) {
        if let Some(&last) = bytes.last() {
            self.in_frame = last != FRAME_END;
        }
    }
}

impl Host {
    fn look_for_frame(&mut self, mut bytes: &[u8]) {
        while let Some(reader) = self.first_frame.as_mut().filter(|_| !bytes.is_empty()) {
            let (taken, frame) = reader.read(bytes);
            bytes = bytes.get(taken..).unwrap_or(&[]);
            if matches!(frame, Some(Ok(_))) {
                self.first_frame = None;
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use heapless::Vec;

    use super::Handover;
    use crate::frame::{FrameHeader, FrameKind, write_frame};

    fn frame() -> Vec<u8, 64> {
        let mut wire = Vec::new();
        let header = FrameHeader { kind: FrameKind::Open, session: 1, sequence: 0, acknowledged: 0, held: 0 };
        write_frame(&header, &[7], &mut wire);
        wire
    }

    #[test]
    fn output_without_a_host_or_before_its_first_byte_is_dropped() {
        let mut link = Handover::new();
        assert_eq!(link.drop_unwanted(&[1, 0, 2]), 3);
        assert_eq!(link.welcome(), 0);
        assert_eq!(link.drop_unwanted(&[3]), 1);
    }

    #[test]
    fn a_host_receives_no_rest_of_a_frame_that_was_begun_before_it() {
        let mut link = Handover::new();
        link.welcome();
        link.received(&[5]);
        assert_eq!(link.drop_unwanted(&[1, 2]), 0);
        link.sent(&[1, 2]);
        link.leave();
        assert!(!link.has_host());
        link.welcome();
        link.received(&[5]);
        assert_eq!(link.drop_unwanted(&[3]), 1);
        assert_eq!(link.drop_unwanted(&[4, 0, 6]), 2);
        assert_eq!(link.drop_unwanted(&[6]), 0);
    }

    #[test]
    fn a_host_is_proven_by_its_first_valid_frame() {
        let mut link = Handover::new();
        assert!(!link.is_proven());
        link.welcome();
        link.received(b"GET / HTTP/1.1\r\n\r\n\0");
        assert!(!link.is_proven());
        let wire = frame();
        let (start, end) = wire.split_at(3);
        link.received(start);
        assert!(!link.is_proven());
        link.received(end);
        assert!(link.is_proven());
        link.welcome();
        assert!(!link.is_proven());
    }
}
