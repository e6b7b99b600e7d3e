//! Relay's end of the link to its host: the transport, and what waits for its send window.

use std::collections::VecDeque;

use photoncard_picture::sink::FinishedTile;
use photoncard_shared::frame::MAX_PAYLOAD;
use photoncard_shared::message::{self, PIXELS_BYTES, Reply};
use photoncard_shared::transport::Transport;

/// Number of waiting replies at which no further command is taken.
const MAX_REPLIES: usize = 8;

pub(super) struct HostEnd {
    pub(super) transport: Transport,
    /// Number of the session whose commands are executed.
    session: Option<u32>,
    /// Encoded replies, without those about tiles.
    replies: VecDeque<Vec<u8>>,
    /// Tiles that the host has not received, each with the length of the records that were sent.
    finished: VecDeque<(FinishedTile, usize)>,
}

impl HostEnd {
    pub(super) fn new() -> Self {
        Self {
            transport: Transport::card(),
            session: None,
            replies: VecDeque::new(),
            finished: VecDeque::new(),
        }
    }

    /// Returns whether the host has begun another session since the last call. Replies of the earlier one are
    /// dropped.
    pub(super) fn begins_session(&mut self) -> bool {
        let begins = self.session != self.transport.session();
        if begins {
            self.session = self.transport.session();
            self.replies.clear();
            self.finished.clear();
        }
        begins
    }

    pub(super) fn has_room(&self) -> bool {
        self.replies.len() < MAX_REPLIES
    }

    pub(super) fn reply(&mut self, reply: &Reply) {
        let mut bytes = vec![0; MAX_PAYLOAD];
        // Every reply fits a frame.
        if let Some(length) = message::encode(reply, &mut bytes) {
            bytes.truncate(length);
            self.replies.push_back(bytes);
        }
    }

    pub(super) fn finish(&mut self, tile: FinishedTile) {
        self.finished.push_back((tile, 0));
    }

    /// Number of tiles that the host has not received whole.
    pub(super) fn tiles(&self) -> usize {
        self.finished.len()
    }

    pub(super) fn drop_tiles(&mut self) {
        self.finished.clear();
    }

    /// Fills the send window with replies, then with the pixels and ends of finished tiles.
    pub(super) fn prepare(&mut self) {
        while self.transport.can_send() {
            if let Some(reply) = self.replies.pop_front() {
                self.transport.send(|bytes| {
                    bytes.get_mut(..reply.len())?.copy_from_slice(&reply);
                    Some(reply.len())
                });
            } else if !self.send_part_of_tile() {
                break;
            }
        }
    }

    /// Sends the next pixels of the oldest finished tile, or its end. Returns false if there is none.
    fn send_part_of_tile(&mut self) -> bool {
        let Some((tile, sent)) = self.finished.front_mut() else { return false };
        let bytes = tile.format().record_bytes();
        let id = tile.tile().id;
        let rest = tile.records().get(*sent..).unwrap_or(&[]);
        if rest.is_empty() {
            let end = Reply::TileDone { tile: id, counters: tile.counters };
            self.transport.send(|payload| message::encode(&end, payload));
            self.finished.pop_front();
            return true;
        }
        let data = &rest[..rest.len().min(PIXELS_BYTES / bytes * bytes)];
        let pixels = Reply::Pixels { tile: id, first: (*sent / bytes) as u32, data };
        self.transport.send(|payload| message::encode(&pixels, payload));
        *sent += data.len();
        true
    }
}
