//! The transport: messages come once, whole and in order, over a line that damages, loses or repeats bytes.
//!
//! Both ends of a link hold one [`Transport`]. It does no I/O and has no clock: it is fed with bytes and gives bytes.
//!
//! - The host begins a session with an [`FrameKind::Open`] frame of number 0 and a random session number of 32 bits; the
//!   card then forgets any other. A card answers a frame of a session that it does not know with [`FrameKind::Unknown`]: that is
//!   how a host learns that the card was reset.
//! - Messages are numbered from 0 in each direction. At most [`WINDOW`] are on their way: sent and not acknowledged.
//! - Every frame tells how many messages of the other direction were taken (`acknowledged`), and which of the next ones
//!   have come (`held`). A line keeps the order of its bytes. So a message is lost when one that was sent after it has
//!   come, and only what is lost is sent again.
//! - A loss at the end of what was sent shows in nothing that comes. It takes a clock to notice, and the host has one: when
//!   nothing comes for a while it sends a [`FrameKind::Probe`], which carries the number of its transmission. The card's
//!   [`FrameKind::Answer`] carries the same: what was sent before it and has not come is lost. It tells as well how many
//!   messages the card has sent; those of them that have not come are lost, which the host's next probe tells the card.

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
    /// Bytes of the wire's frame that are sent.
    sent: usize,
    session: LinkSession,
}

impl Transport {
    const fn new(end: End) -> Self {
        Self { reader: FrameReader::new(), wire: Vec::new(), sent: 0, session: LinkSession::new(end) }
    }

    /// The host's end; it has no session yet.
    pub const fn host() -> Self {
        Self::new(End::Host)
    }

    /// A card's end; it has no session yet.
    pub const fn card() -> Self {
        Self::new(End::Card)
    }

    /// Begins a session; all that is on its way in another is forgotten. Its first message is the next that is sent.
    pub fn open(&mut self, number: u32) {
        self.session.begin(number);
    }

    /// Whether there is room for another message on its way.
    pub fn can_send(&self) -> bool {
        self.session.on_their_way() < WINDOW as u16
    }

    /// Whether all messages that were sent have been taken.
    pub fn is_acknowledged(&self) -> bool {
        self.session.on_their_way() == 0
    }

    /// A number that is another as soon as a message has passed: one of the other end was taken, or one of this end is known to
    /// have been.
    pub fn passed(&self) -> u16 {
        self.session.passed()
    }

    /// Sends the message that `fill` writes into the slice of [`MAX_PAYLOAD`] bytes that it is given, returning its length.
    /// Returns whether it was sent: not without room for it, nor if `fill` returns `None` or more than the slice's length.
    pub fn send(&mut self, fill: impl FnOnce(&mut [u8]) -> Option<usize>) -> bool {
        self.can_send() && self.session.send(fill)
    }

    /// Bytes that are to be sent now.
    pub fn outgoing(&mut self) -> &[u8] {
        if self.sent >= self.wire.len() {
            self.wire.clear();
            self.sent = 0;
            self.session.write_next(&mut self.wire);
        }
        self.wire.get(self.sent..).unwrap_or(&[])
    }

    /// Tells that the first `bytes` of [`Self::outgoing`] are sent.
    pub fn sent(&mut self, bytes: usize) {
        self.sent = self.sent.saturating_add(bytes);
    }

    /// Takes bytes from the line, up to the end of the next frame. Returns how many, and what they meant.
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

    /// The next message, in order; `None` if it has not come.
    pub fn take(&mut self) -> Option<&[u8]> {
        self.session.take()
    }

    /// Tells the other end what was taken, if it does not know. An end does so before it waits or works.
    pub fn acknowledge(&mut self) {
        if self.session.has_untold() {
            self.session.ask_for(Control::Acknowledge);
        }
    }

    /// Asks the other end what has come.
    pub fn probe(&mut self) {
        self.session.ask_for(Control::Probe);
    }

    /// Takes all messages on their way for lost.
    pub fn send_again(&mut self) {
        self.session.lose(|_, _| true);
    }

    /// What was seen of the line so far.
    pub fn statistics(&self) -> LineStatistics {
        self.session.statistics()
    }
}
