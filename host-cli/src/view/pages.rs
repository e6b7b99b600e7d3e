//! Messages to pages: selection of the next message to each page, in bounded memory.

use std::collections::VecDeque;
use std::sync::Arc;

use super::canvas::{Canvas, Patch, Shown};

/// Maximum total size of the tiles that a page was sent and has not acknowledged, bytes. A larger tile is
/// sent once all tiles before are acknowledged.
const MAX_ON_THE_WAY: u64 = 4 << 20;
/// Maximum number of answers that wait for a page. Older ones are dropped.
const MAX_REPLIES: usize = 64;

/// Message to a page.
#[derive(Debug)]
pub(super) enum Outgoing {
    /// Answer to a message of the page, or an error.
    Reply(String),
    /// Newest state of the view. The flag is true if the page has all tiles: only then the state may be
    /// `settled`.
    State(bool),
    /// Newest states of the cards.
    Cards,
    /// Tile, and the quantity in it that the page shows.
    Tile(Arc<Patch>, Shown),
    /// Picture that the page has asked for, as a message.
    File(Vec<u8>),
}

/// First word of a file's message, where that of a tile has the number of a request.
const FILE: u32 = u32::MAX;

/// Message with a file: little-endian words [`FILE`] and the length of the name, then name and contents.
pub(super) fn file_message(name: &str, contents: &[u8]) -> Vec<u8> {
    [&FILE.to_le_bytes()[..], &(name.len() as u32).to_le_bytes(), name.as_bytes(), contents].concat()
}

/// Numbers of changes so far: of the view's state, and of the states of the cards.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct Revisions {
    pub(super) state: u64,
    pub(super) cards: u64,
}

/// Connected page.
#[derive(Debug)]
pub(super) struct Page {
    replies: VecDeque<String>,
    /// File that waits to be sent, as a message.
    file: Option<Vec<u8>>,
    seen: Revisions,
    /// Number of the request in the last state message that was sent. The state message of a request states
    /// the picture's size, and therefore precedes the request's tiles.
    told: u32,
    shown: Shown,
    /// Number of the next tile to send, in the [`Canvas`].
    next: u64,
    /// Total size of the tiles and files sent, bytes.
    sent: u64,
    /// Total size of the tiles and files that the page has acknowledged, bytes.
    received: u64,
}

impl Page {
    pub(super) fn new() -> Self {
        Self {
            replies: VecDeque::new(),
            file: None,
            seen: Revisions::default(),
            told: 0,
            shown: Shown::Radiance,
            next: 0,
            sent: 0,
            received: 0,
        }
    }

    pub(super) fn reply(&mut self, text: String) {
        if self.replies.len() == MAX_REPLIES {
            self.replies.pop_front();
        }
        self.replies.push_back(text);
    }

    /// Returns whether a file waits to be sent.
    pub(super) fn has_file(&self) -> bool {
        self.file.is_some()
    }

    /// Queues the message of a file.
    pub(super) fn send_file(&mut self, message: Vec<u8>) {
        self.file = Some(message);
    }

    /// Sets what the page shows: radiance or a layer. All tiles are sent to it again.
    pub(super) fn show(&mut self, shown: Shown) {
        (self.shown, self.next) = (shown, 0);
    }

    /// Sends all tiles to the page again, if it shows radiance.
    pub(super) fn show_again(&mut self) {
        if self.shown == Shown::Radiance {
            self.next = 0;
        }
    }

    /// Returns whether the page shows a layer that chips render only on request, such as `direct`.
    pub(super) fn shows_layer_of_chip(&self) -> bool {
        self.shown.is_of_chip()
    }

    /// Records the total size of the tiles and files that the page has received, bytes.
    pub(super) fn acknowledge(&mut self, bytes: u64) {
        // A page cannot have received what was not sent.
        self.received = self.received.max(bytes.min(self.sent));
    }

    /// Selects the next message; `None` if there is none, or if tiles have to be acknowledged first. The
    /// state message of a request precedes its first tile; the `settled` state follows the last tile.
    pub(super) fn take(
        &mut self,
        canvas: &Canvas,
        newest: Revisions,
        version: u32,
        is_settled: bool,
    ) -> Option<Outgoing> {
        if let Some(text) = self.replies.pop_front() {
            return Some(Outgoing::Reply(text));
        }
        if let Some(message) = self.file.take() {
            self.sent += message.len() as u64;
            return Some(Outgoing::File(message));
        }
        if self.seen.cards != newest.cards {
            self.seen.cards = newest.cards;
            return Some(Outgoing::Cards);
        }
        let patch = canvas.after(self.next);
        let is_behind = is_settled && patch.is_some();
        let is_first = patch.is_some() && self.told != version;
        if is_first || (self.seen.state != newest.state && !is_behind) {
            if !is_behind {
                self.seen.state = newest.state;
            }
            self.told = version;
            return Some(Outgoing::State(!is_behind));
        }
        let (number, patch) = patch?;
        let bytes = patch.bytes() as u64;
        let on_the_way = self.sent - self.received;
        if on_the_way > 0 && on_the_way + bytes > MAX_ON_THE_WAY {
            return None;
        }
        self.next = number + 1;
        self.sent += bytes;
        Some(Outgoing::Tile(patch, self.shown))
    }
}
