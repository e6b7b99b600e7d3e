//! State of one session of a transport.

use heapless::Vec;

use crate::frame::{Frame, FrameHeader, FrameKind, MAX_FRAME, MAX_PAYLOAD, write_frame};

/// Maximum number of messages in flight in one direction.
pub const WINDOW: usize = 4;

/// Number of taken messages after which an acknowledgement is sent without a call of
/// `Transport::acknowledge`.
const MAX_UNACKNOWLEDGED: u16 = WINDOW as u16 / 2;

/// Numbers of damaged and repeated frames on a link, as counted by one end.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct LineStatistics {
    /// Damaged frames received.
    pub damaged: u64,
    /// Messages sent again.
    pub repeated: u64,
    /// Messages received more than once.
    pub duplicates: u64,
    /// Probes sent.
    pub probes: u64,
}

/// Event that a received frame reports to the caller of the transport.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Event {
    /// The frame is complete and belongs to this session.
    Heard,
    /// The other end does not know this session.
    Unknown,
}

/// Delivery state of an outgoing message.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u8)]
enum Passage {
    // Zero, as are the first states of `Control` and `End`: a static card is zeroed memory.
    /// The message has arrived at the other end, but is not taken there.
    Held = 0,
    /// The message is to be sent; `again` is true if it was sent before.
    Waiting { again: bool },
    /// The message was sent by the transmission with this number.
    Sent { transmission: u16 },
}

/// An outgoing message in flight.
struct Outgoing {
    payload: Vec<u8, MAX_PAYLOAD>,
    kind: FrameKind,
    passage: Passage,
}

/// Slot for a received message that is not yet taken. `payload` is meaningless unless `has_come`.
struct Incoming {
    payload: Vec<u8, MAX_PAYLOAD>,
    has_come: bool,
}

/// Next frame to be sent that carries no message.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u8)]
pub(super) enum Control {
    // Not 0, which is that of no control frame, as in `Passage`.
    Acknowledge = 1,
    Probe,
    Answer,
    /// Reply to a frame of the unknown session with this number.
    Unknown(u32),
}

/// Role of an end of a link.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum End {
    Card,
    Host,
}

pub(super) struct LinkSession {
    end: End,
    /// Number of the session; `None` before the first.
    number: Option<u32>,
    /// True once the first message of the session was sent.
    has_opened: bool,
    /// Unacknowledged messages, indexed by their number modulo [`WINDOW`].
    outgoing: [Outgoing; WINDOW],
    /// Number of the first message that is not acknowledged.
    oldest: u16,
    /// Number of the next message.
    next: u16,
    /// Number of transmissions so far: frames with messages, and probes.
    transmissions: u16,
    /// Number of messages that the other end had sent before its last answer; `None` if none of them is
    /// missing here. The next probe reports the missing ones as lost.
    lost_below: Option<u16>,
    /// Payload of the other end's last probe. The answer returns it.
    asked: [u8; 2],
    /// Received messages that are not taken, indexed by their number modulo [`WINDOW`].
    incoming: [Incoming; WINDOW],
    /// Number of the message that is to be taken next.
    expected: u16,
    /// Number of messages taken since the last acknowledgement.
    unacknowledged: u16,
    control: Option<Control>,
    statistics: LineStatistics,
}

/// Returns true if number `a` is before `b`, modulo 2^16.
fn is_before(a: u16, b: u16) -> bool {
    (a.wrapping_sub(b) as i16) < 0
}

/// Slot of message `number` in the window.
fn slot<T>(slots: &mut [T; WINDOW], number: u16) -> &mut T {
    let [a, b, c, d] = slots;
    match number % WINDOW as u16 {
        0 => a,
        1 => b,
        2 => c,
        _ => d,
    }
}

impl LinkSession {
    pub(super) const fn new(end: End) -> Self {
        Self {
            end,
            number: None,
            has_opened: false,
            outgoing: [const { Outgoing { payload: Vec::new(), kind: FrameKind::Data, passage: Passage::Held } };
                WINDOW],
            oldest: 0,
            next: 0,
            transmissions: 0,
            lost_below: None,
            asked: [0; 2],
            incoming: [const { Incoming { payload: Vec::new(), has_come: false } }; WINDOW],
            expected: 0,
            unacknowledged: 0,
            control: None,
            statistics: LineStatistics { damaged: 0, repeated: 0, duplicates: 0, probes: 0 },
        }
    }

    pub(super) fn begin(&mut self, number: u32) {
        self.number = Some(number);
        self.has_opened = false;
        [self.oldest, self.next, self.transmissions, self.expected, self.unacknowledged] = [0; 5];
        self.lost_below = None;
        self.control = None;
        self.incoming.iter_mut().for_each(|incoming| incoming.has_come = false);
    }

    pub(super) fn number(&self) -> Option<u32> {
        self.number
    }

    pub(super) fn on_their_way(&self) -> u16 {
        self.next.wrapping_sub(self.oldest)
    }

    /// Sum of the numbers of messages taken at both ends, modulo 2^16.
    pub(super) fn passed(&self) -> u16 {
        self.oldest.wrapping_add(self.expected)
    }

    pub(super) fn send(&mut self, fill: impl FnOnce(&mut [u8]) -> Option<usize>) -> bool {
        let opens = self.end == End::Host && !core::mem::replace(&mut self.has_opened, true);
        let message = slot(&mut self.outgoing, self.next);
        // There is room for MAX_PAYLOAD.
        let _ = message.payload.resize_default(MAX_PAYLOAD);
        let Some(bytes) = fill(&mut message.payload).filter(|&bytes| bytes <= MAX_PAYLOAD) else {
            return false;
        };
        message.payload.truncate(bytes);
        message.kind = if opens { FrameKind::Open } else { FrameKind::Data };
        message.passage = Passage::Waiting { again: false };
        self.next = self.next.wrapping_add(1);
        true
    }

    /// Returns true if a message was taken that is not yet acknowledged.
    pub(super) fn has_unacknowledged(&self) -> bool {
        self.unacknowledged > 0
    }

    pub(super) fn count_damaged(&mut self) {
        self.statistics.damaged += 1;
    }

    pub(super) fn statistics(&self) -> LineStatistics {
        self.statistics
    }

    pub(super) fn ask_for(&mut self, control: Control) {
        if matches!(self.control, None | Some(Control::Acknowledge)) {
            self.control = Some(control);
        }
    }

    /// Visits the unacknowledged messages, from the oldest.
    fn each_on_its_way(&mut self, mut visit: impl FnMut(u16, &mut Outgoing)) {
        for offset in 0..self.on_their_way() {
            let number = self.oldest.wrapping_add(offset);
            visit(number, slot(&mut self.outgoing, number));
        }
    }

    /// Marks for repetition the sent messages for which `is_lost(number, transmission)` is true.
    pub(super) fn lose(&mut self, is_lost: impl Fn(u16, u16) -> bool) {
        self.each_on_its_way(|number, message| {
            if let Passage::Sent { transmission } = message.passage
                && is_lost(number, transmission)
            {
                message.passage = Passage::Waiting { again: true };
            }
        });
    }

    /// Writes the next frame, if there is one: the reply to an unknown session, else a message, else an
    /// acknowledgement, an answer or a probe.
    pub(super) fn write_next(&mut self, wire: &mut Vec<u8, MAX_FRAME>) {
        if let Some(Control::Unknown(number)) = self.control {
            self.control = None;
            let header = FrameHeader { session: number, ..self.header(FrameKind::Unknown, 0) };
            return write_frame(&header, &[], wire);
        }
        if self.number.is_none() {
            return;
        }
        for offset in 0..self.on_their_way() {
            let number = self.oldest.wrapping_add(offset);
            let header = self.header(FrameKind::Data, number);
            let message = slot(&mut self.outgoing, number);
            let Passage::Waiting { again } = message.passage else { continue };
            message.passage = Passage::Sent { transmission: self.transmissions };
            write_frame(&FrameHeader { kind: message.kind, ..header }, &message.payload, wire);
            self.statistics.repeated += u64::from(again);
            self.transmissions = self.transmissions.wrapping_add(1);
            self.unacknowledged = 0;
            return;
        }
        if self.unacknowledged >= MAX_UNACKNOWLEDGED {
            self.ask_for(Control::Acknowledge);
        }
        let mut payload: &[u8] = &[];
        let transmission = self.transmissions.to_le_bytes();
        let (kind, sequence) = match self.control.take() {
            None | Some(Control::Unknown(_)) => return,
            Some(Control::Acknowledge) => (FrameKind::Acknowledge, 0),
            Some(Control::Answer) => {
                payload = &self.asked;
                (FrameKind::Answer, self.next)
            }
            Some(Control::Probe) => {
                payload = &transmission;
                self.transmissions = self.transmissions.wrapping_add(1);
                self.statistics.probes += 1;
                (FrameKind::Probe, self.lost_below.take().unwrap_or(self.expected))
            }
        };
        write_frame(&self.header(kind, sequence), payload, wire);
        self.unacknowledged = 0;
    }

    fn header(&self, kind: FrameKind, sequence: u16) -> FrameHeader {
        let held = (0..WINDOW as u16).filter(|&offset| self.has_come(self.expected.wrapping_add(offset)));
        let held = held.fold(0, |bits, offset| bits | 1 << offset);
        let session = self.number.unwrap_or(0);
        FrameHeader { kind, session, sequence, acknowledged: self.expected, held }
    }

    /// Returns whether message `number` has arrived. It must lie in the window that begins at the expected
    /// message.
    fn has_come(&self, number: u16) -> bool {
        self.incoming.get(number as usize % WINDOW).is_some_and(|incoming| incoming.has_come)
    }

    pub(super) fn hear(&mut self, frame: &Frame) -> Option<Event> {
        let header = frame.header;
        let is_card = self.end == End::Card;
        if header.kind == FrameKind::Open && is_card && self.number != Some(header.session) {
            self.begin(header.session);
        }
        if self.number != Some(header.session) {
            if is_card {
                self.ask_for(Control::Unknown(header.session));
            }
            return None;
        }
        if header.kind == FrameKind::Unknown {
            return (!is_card).then_some(Event::Unknown);
        }
        self.learn(&header);
        match header.kind {
            FrameKind::Data | FrameKind::Open => self.keep(header.sequence, frame.payload),
            FrameKind::Probe => {
                self.lose(|number, _| is_before(number, header.sequence));
                self.asked = frame.payload.first_chunk().copied().unwrap_or_default();
                self.ask_for(Control::Answer);
            }
            FrameKind::Answer => {
                let probe = frame.payload.first_chunk().map_or(0, |bytes| u16::from_le_bytes(*bytes));
                self.conclude(probe, header.sequence);
            }
            FrameKind::Acknowledge | FrameKind::Unknown => {}
        }
        Some(Event::Heard)
    }

    /// Processes the acknowledgements of a header. Marks as lost each message that has not arrived although a
    /// message sent after it has.
    fn learn(&mut self, header: &FrameHeader) {
        let taken = header.acknowledged.wrapping_sub(self.oldest);
        if taken > self.on_their_way() {
            // The acknowledgement is older than a known one, or of messages never sent.
            return;
        }
        let mut latest: Option<u16> = None;
        self.each_on_its_way(|number, message| {
            let offset = number.wrapping_sub(header.acknowledged);
            let is_there = is_before(number, header.acknowledged)
                || offset < WINDOW as u16 && header.held >> offset & 1 != 0;
            if !is_there {
                return;
            }
            if let Passage::Sent { transmission } = message.passage {
                latest = Some(match latest {
                    Some(latest) if is_before(transmission, latest) => latest,
                    _ => transmission,
                });
            }
            message.passage = Passage::Held;
        });
        self.oldest = header.acknowledged;
        if let Some(latest) = latest {
            self.lose(|_, transmission| is_before(transmission, latest));
        }
    }

    /// Processes the answer to the probe of transmission `probe`. Messages sent before the probe that have
    /// not arrived are marked as lost. If one of the first `sent` messages of the other end has not arrived
    /// here, a probe is requested that reports the loss.
    fn conclude(&mut self, probe: u16, sent: u16) {
        self.lose(|_, transmission| is_before(transmission, probe));
        let count = sent.wrapping_sub(self.expected).min(WINDOW as u16);
        let is_missing = |offset| !self.has_come(self.expected.wrapping_add(offset));
        if is_before(self.expected, sent) && (0..count).any(is_missing) {
            self.lost_below = Some(sent);
            self.ask_for(Control::Probe);
        }
    }

    fn keep(&mut self, number: u16, payload: &[u8]) {
        let offset = number.wrapping_sub(self.expected);
        if offset >= WINDOW as u16 || self.has_come(number) {
            // A repetition: the acknowledgement of the message was lost, and is sent again.
            self.statistics.duplicates += 1;
            return self.ask_for(Control::Acknowledge);
        }
        let incoming = slot(&mut self.incoming, number);
        incoming.payload.clear();
        // A frame's payload is never longer than MAX_PAYLOAD.
        incoming.has_come = incoming.payload.extend_from_slice(payload).is_ok();
        if !self.has_come(self.expected) {
            self.ask_for(Control::Acknowledge);
        }
    }

    pub(super) fn take(&mut self) -> Option<&[u8]> {
        let incoming = slot(&mut self.incoming, self.expected);
        if !core::mem::take(&mut incoming.has_come) {
            return None;
        }
        self.expected = self.expected.wrapping_add(1);
        self.unacknowledged = self.unacknowledged.saturating_add(1);
        Some(&incoming.payload)
    }
}
