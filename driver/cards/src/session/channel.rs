//! Session's end of the link: the transport, commands that wait for its send window, and counts of bytes.

use std::collections::VecDeque;

use photoncard_shared::frame::MAX_PAYLOAD;
use photoncard_shared::image::LAYOUT_VERSION;
use photoncard_shared::message::{self, Command, PROTOCOL_VERSION};
use photoncard_shared::transport::{LineStatistics, Transport};

/// First message of a host.
pub(super) const HELLO: Command = Command::Hello { protocol: PROTOCOL_VERSION, layout: LAYOUT_VERSION };

pub(super) struct Channel {
    pub(super) transport: Transport,
    /// Encoded commands that wait for room in the send window.
    commands: VecDeque<Vec<u8>>,
    /// Number of the present session on the link.
    number: u32,
    pub(super) bytes: LinkBytes,
}

impl Channel {
    /// Creates a channel whose first session has the number `number`.
    pub(super) fn before(number: u32) -> Self {
        Self {
            transport: Transport::host(),
            commands: VecDeque::new(),
            number: number.wrapping_sub(1),
            bytes: LinkBytes::default(),
        }
    }

    /// Starts the next session of the link with a greeting.
    pub(super) fn greet(&mut self) {
        self.number = self.number.wrapping_add(1);
        self.commands.clear();
        self.transport.open(self.number);
        self.send(&HELLO);
    }

    pub(super) fn send(&mut self, command: &Command) {
        let mut bytes = vec![0; MAX_PAYLOAD];
        // Every command fits a frame: tests cover the longest.
        if let Some(length) = message::encode(command, &mut bytes) {
            bytes.truncate(length);
            self.commands.push_back(bytes);
        }
    }

    pub(super) fn drop_commands(&mut self) {
        self.commands.clear();
    }

    /// Returns whether no command waits and the window has room for one.
    pub(super) fn is_free(&self) -> bool {
        self.commands.is_empty() && self.transport.can_send()
    }

    /// Returns whether all commands have arrived at the card.
    pub(super) fn is_quiet(&self) -> bool {
        self.commands.is_empty() && self.transport.is_acknowledged()
    }

    /// Number of commands that wait for room in the send window.
    pub(super) fn waiting(&self) -> usize {
        self.commands.len()
    }

    /// Sends waiting commands while the window has room.
    pub(super) fn forward(&mut self) {
        while self.transport.can_send()
            && let Some(command) = self.commands.pop_front()
        {
            self.transport.send(|bytes| {
                bytes.get_mut(..command.len())?.copy_from_slice(&command);
                Some(command.len())
            });
        }
    }

    /// Statistics of the link so far.
    pub(super) fn statistics(&self) -> LinkBytes {
        LinkBytes { line: self.transport.statistics(), ..self.bytes }
    }
}

/// Counts of the bytes that passed a link, of damaged and repeated frames, of probes and of resets.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct LinkBytes {
    /// Bytes of the lines of the card image that were sent.
    pub image: u64,
    /// Bytes of the lines of the card image that were sent, and of the pixels that were received.
    pub payload: u64,
    /// All bytes in both directions.
    pub wire: u64,
    /// Frames that the host repeated, frames that it received damaged or repeated, and probes that it sent.
    pub line: LineStatistics,
    /// Number of times that the card was greeted again.
    pub resets: u64,
}

impl LinkBytes {
    /// Adds the counts of another link.
    pub fn add(&mut self, other: &Self) {
        self.image += other.image;
        self.payload += other.payload;
        self.wire += other.wire;
        self.line.damaged += other.line.damaged;
        self.line.repeated += other.line.repeated;
        self.line.duplicates += other.line.duplicates;
        self.line.probes += other.line.probes;
        self.resets += other.resets;
    }

    /// Difference to earlier counts of the same link.
    #[must_use]
    pub fn since(&self, earlier: &Self) -> Self {
        Self {
            image: self.image - earlier.image,
            payload: self.payload - earlier.payload,
            wire: self.wire - earlier.wire,
            line: LineStatistics {
                damaged: self.line.damaged - earlier.line.damaged,
                repeated: self.line.repeated - earlier.line.repeated,
                duplicates: self.line.duplicates - earlier.line.duplicates,
                probes: self.line.probes - earlier.line.probes,
            },
            resets: self.resets - earlier.resets,
        }
    }
}
