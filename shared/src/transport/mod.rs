//! The transport: delivers messages once, whole and in order, over a link that damages, loses or repeats
//! bytes.
//!
//! Each end of a link has a [`Transport`]. It does no I/O and has no clock: the caller passes received bytes
//! to it and sends the bytes that it returns.
//!
//! - The host begins a session with an [`FrameKind::Open`] frame of number 0 and a random session number of
//!   32 bits; the card then forgets any other session. A card answers a frame of an unknown session with
//!   [`FrameKind::Unknown`], from which the host concludes that the card was reset.
//! - Messages are numbered from 0 in each direction. At most [`WINDOW`] are in flight: sent and not
//!   acknowledged.
//! - Every frame acknowledges messages of the other direction. `acknowledged` is the number of messages
//!   taken; `held` marks which of the following messages have arrived. A link keeps the order of its bytes: a
//!   message is lost if it has not arrived but a message sent after it has. Only lost messages are repeated.
//! - The loss of the last messages is detected after some silence. The host, which has a clock, then sends a
//!   [`FrameKind::Probe`] with the number of this transmission. The card's [`FrameKind::Answer`] returns that
//!   number. Host messages sent before the probe are lost unless the answer acknowledges their arrival. The
//!   answer also carries the number of messages that the card has sent. If some of these have not arrived,
//!   they are lost, and the host's next probe reports the loss.

mod session;

use heapless::Vec;

use self::session::{Control, End, LinkSession};
pub use self::session::{Event, LineStatistics, WINDOW};
#[cfg(doc)]
use crate::frame::{FrameKind, MAX_PAYLOAD};
use crate::frame::{FrameReader, MAX_FRAME};

/// One end of a link.
pub struct Transport {
    reader: FrameReader,
    wire: Vec<u8, MAX_FRAME>,
    /// Number of bytes of `wire` that were sent.
    sent: usize,
    session: LinkSession,
}

impl Transport {
    const fn new(end: End) -> Self {
        Self { reader: FrameReader::new(), wire: Vec::new(), sent: 0, session: LinkSession::new(end) }
    }

    /// Creates the host's end, without a session.
    pub const fn host() -> Self {
        Self::new(End::Host)
    }

    /// Creates a card's end, without a session.
    pub const fn card() -> Self {
        Self::new(End::Card)
    }

    /// Begins session `number` with the next message sent. Unacknowledged messages of an earlier session are
    /// dropped.
    pub fn open(&mut self, number: u32) {
        self.session.begin(number);
    }

    /// Number of the present session; `None` before the first.
    pub fn session(&self) -> Option<u32> {
        self.session.number()
    }

    /// Returns whether another message fits in the window.
    pub fn can_send(&self) -> bool {
        self.session.on_their_way() < WINDOW as u16
    }

    /// Returns whether all sent messages are acknowledged.
    pub fn is_acknowledged(&self) -> bool {
        self.session.on_their_way() == 0
    }

    /// Returns the number of messages delivered in both directions, modulo 2^16: messages taken at this end
    /// plus messages acknowledged by the other end.
    pub fn passed(&self) -> u16 {
        self.session.passed()
    }

    /// Sends the message that `fill` writes into a slice of [`MAX_PAYLOAD`] bytes; `fill` returns its length.
    /// Returns false, and sends nothing, if the window is full or `fill` returns `None` or a length beyond
    /// the slice.
    pub fn send(&mut self, fill: impl FnOnce(&mut [u8]) -> Option<usize>) -> bool {
        self.can_send() && self.session.send(fill)
    }

    /// Bytes to be sent now.
    pub fn outgoing(&mut self) -> &[u8] {
        if self.sent >= self.wire.len() {
            self.wire.clear();
            self.sent = 0;
            self.session.write_next(&mut self.wire);
        }
        self.wire.get(self.sent..).unwrap_or(&[])
    }

    /// Removes the first `bytes` bytes of [`Self::outgoing`] after they were sent.
    pub fn sent(&mut self, bytes: usize) {
        self.sent = self.sent.saturating_add(bytes);
    }

    /// Consumes bytes from the link, up to the end of the next frame. Returns the number of bytes consumed,
    /// and the event of the frame, if any.
    pub fn receive(&mut self, bytes: &[u8]) -> (usize, Option<Event>) {
        let (taken, frame) = self.reader.read(bytes);
        let event = match frame {
            None => None,
            Some(Ok(frame)) => self.session.hear(&frame),
            Some(Err(_)) => {
                self.session.count_damaged();
                None
            }
        };
        (taken, event)
    }

    /// Takes the next message in order; `None` if it has not arrived.
    pub fn take(&mut self) -> Option<&[u8]> {
        self.session.take()
    }

    /// Requests a frame that acknowledges the messages taken since the last frame was sent. Must be called
    /// before this end waits, or works for a long time.
    pub fn acknowledge(&mut self) {
        if self.session.has_unacknowledged() {
            self.session.ask_for(Control::Acknowledge);
        }
    }

    /// Sends a probe.
    pub fn probe(&mut self) {
        self.session.ask_for(Control::Probe);
    }

    /// Repeats all unacknowledged messages.
    pub fn send_again(&mut self) {
        self.session.lose(|_, _| true);
    }

    /// Returns the numbers of damaged and repeated frames and of probes so far.
    pub fn statistics(&self) -> LineStatistics {
        self.session.statistics()
    }
}
