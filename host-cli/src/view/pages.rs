//! Messages to pages: what each is sent next, in memory that is bounded for each.

use std::collections::VecDeque;
use std::sync::Arc;

use super::canvas::{Canvas, Patch, Shown};

/// Bytes of tiles that may be on the way to a page, beyond one tile.
const MAX_ON_THE_WAY: u64 = 4 << 20;
/// Maximum number of answers that wait for a page; older ones are dropped.
const MAX_REPLIES: usize = 64;

/// A message to a page.
#[derive(Debug)]
pub(super) enum Outgoing {
    /// An answer.
    Reply(String),
    /// The newest state; for a page that has all tiles, if it is true.
    State(bool),
    /// The newest states of the cards.
    Cards,
    /// A tile, as the page shows it.
    Tile(Arc<Patch>, Shown),
}

/// Numbers of the newest state and of the newest states of cards.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct Revisions {
    pub(super) state: u64,
    pub(super) cards: u64,
}

/// A connected page.
#[derive(Debug)]
pub(super) struct Page {
    replies: VecDeque<String>,
    seen: Revisions,
    /// Number of the wish of the last state that was sent: a page must know a picture's size before its
    /// tiles.
    told: u32,
    shown: Shown,
    /// Number of the next tile.
    next: u64,
    /// Bytes of tiles that were sent.
    sent: u64,
    /// Bytes of tiles that the page has acknowledged.
    received: u64,
}

impl Page {
    pub(super) fn new() -> Self {
        Self {
            replies: VecDeque::new(),
            seen: Revisions::default(),
            told: 0,
            shown: Shown::Radiance,
            next: 0,
            sent: 0,
            received: 0,
        }
    }

    /// Answers the page.
    pub(super) fn reply(&mut self, text: String) {
        if self.replies.len() == MAX_REPLIES {
            self.replies.pop_front();
        }
        self.replies.push_back(text);
    }

    /// Shows another layer: all tiles are sent again.
    pub(super) fn show(&mut self, shown: Shown) {
        (self.shown, self.next) = (shown, 0);
    }

    /// Returns whether the page shows a layer that only pictures with layers of chips have.
    pub(super) fn shows_layer_of_chip(&self) -> bool {
        self.shown.is_of_chip()
    }

    /// Takes the acknowledgement of all bytes of tiles so far.
    pub(super) fn acknowledge(&mut self, bytes: u64) {
        // A page cannot have received what was not sent.
        self.received = self.received.max(bytes.min(self.sent));
    }

    /// Next message to send; `None` if there is nothing, or the page is behind. A state comes before the
    /// first tile of its wish, and the settled one after the last tile.
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
