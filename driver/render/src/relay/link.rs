//! Links of a relay: to its host, and to its cards.

use std::sync::mpsc::{Receiver, TryRecvError};
use std::time::Duration;

use photoncard_cards::link::{HostPort, LinkError};
use photoncard_shared::link::{Port, PortError};

use crate::open_card::{BoxedPort, OpenCard, try_to_reach};

/// Link to the host of a relay.
pub trait HostLink: Port {
    /// Closes the connection to the present host, if the link has connections.
    fn hang_up(&mut self);
}

impl HostLink for HostPort {
    fn hang_up(&mut self) {
        HostPort::hang_up(self);
    }
}

/// Link to a card of a relay. No call waits.
pub trait CardLink: Port {
    /// Closes the link after a failure.
    fn close(&mut self);

    /// Opens a closed link. Returns whether it is open, or `None` while an attempt is in progress.
    fn open(&mut self) -> Option<bool>;
}

/// Card that is emulated in this process, or at the other end of a link.
pub(super) struct CardPort {
    card: OpenCard,
    /// Attempt to reach a remote card again.
    attempt: Option<Receiver<Result<BoxedPort, LinkError>>>,
}

impl CardPort {
    pub(super) fn new(card: OpenCard) -> Self {
        Self { card, attempt: None }
    }
}

impl CardLink for CardPort {
    fn close(&mut self) {
        self.card.close();
    }

    fn open(&mut self) -> Option<bool> {
        if self.attempt.is_none() {
            // The link to an emulated card is never closed.
            let Some(address) = self.card.close() else { return Some(true) };
            self.attempt = Some(try_to_reach(address));
        }
        let found = match self.attempt.as_ref()?.try_recv() {
            Err(TryRecvError::Empty) => return None,
            Ok(found) => found.ok(),
            Err(TryRecvError::Disconnected) => None,
        };
        self.attempt = None;
        let is_open = found.is_some();
        found.into_iter().for_each(|port| self.card.go_on_with(port));
        Some(is_open)
    }
}

impl Port for CardPort {
    fn read(&mut self, buffer: &mut [u8], wait: Duration) -> Result<usize, PortError> {
        self.card.read(buffer, wait)
    }

    fn write(&mut self, bytes: &[u8], wait: Duration) -> Result<usize, PortError> {
        self.card.write(bytes, wait)
    }
}
