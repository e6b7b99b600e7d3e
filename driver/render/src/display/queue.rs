//! Queue of packets that a display shares with its sending thread.

use std::collections::VecDeque;
use std::sync::{Condvar, Mutex, MutexGuard, PoisonError};
use std::time::Duration;

use photoncard_shared::message::Tile;

use super::DisplayError;

/// Queue of packets from the display to its sending thread, and the progress of sending.
#[derive(Default)]
pub(super) struct PacketQueue {
    packets: VecDeque<Vec<u8>>,
    /// Number of bytes in the queue.
    waiting: usize,
    /// True while a packet taken from the queue is not completely sent.
    is_sending: bool,
    /// Number of bytes sent so far.
    pub(super) sent: u64,
    /// Tiles that were not queued because the queue was full.
    pub(super) missed: Vec<Tile>,
    /// True after the display was dropped. No more packets are sent then.
    pub(super) is_closed: bool,
    /// True after a failure. No more packets can be sent then.
    has_failed: bool,
    /// The failure, until [`Self::take_failure`] returns it.
    failure: Option<DisplayError>,
}

impl PacketQueue {
    /// Returns whether packets can still be sent: the display was not dropped and has not failed.
    pub(super) fn is_open(&self) -> bool {
        !self.is_closed && !self.has_failed
    }

    /// Returns whether all packets of the queue are sent.
    pub(super) fn is_empty(&self) -> bool {
        self.packets.is_empty() && !self.is_sending
    }

    /// Number of packets that are not completely sent, plus the number of tiles that were not queued.
    pub(super) fn left(&self) -> usize {
        self.packets.len() + usize::from(self.is_sending) + self.missed.len()
    }

    /// Returns whether a packet of `bytes` bytes fits into a queue of at most `most` bytes. An empty queue
    /// accepts any packet.
    pub(super) fn has_room(&self, bytes: usize, most: usize) -> bool {
        self.waiting == 0 || self.waiting + bytes <= most
    }

    pub(super) fn push(&mut self, packet: Vec<u8>) {
        self.waiting += packet.len();
        self.packets.push_back(packet);
    }

    /// Ends the display with an error and empties the queue. Only the first error is kept.
    pub(super) fn fail(&mut self, error: DisplayError) {
        if self.is_open() {
            self.failure = Some(error);
        }
        self.has_failed = true;
        self.packets.clear();
        self.missed.clear();
        self.is_sending = false;
    }

    /// Takes the failure, if it was not taken before.
    pub(super) fn take_failure(&mut self) -> Option<DisplayError> {
        self.failure.take()
    }
}

/// A queue with its lock, and a condition variable that signals changes.
#[derive(Default)]
pub(super) struct SharedQueue {
    queue: Mutex<PacketQueue>,
    changed: Condvar,
}

impl SharedQueue {
    pub(super) fn lock(&self) -> MutexGuard<'_, PacketQueue> {
        // A thread that panicked has left the queue consistent.
        self.queue.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Changes the queue and wakes the other thread.
    pub(super) fn change<T>(&self, change: impl FnOnce(&mut PacketQueue) -> T) -> T {
        let result = change(&mut self.lock());
        self.changed.notify_all();
        result
    }

    /// Waits until `is_ready` returns true, for at most the time `most`. Returns the last result of
    /// `is_ready`.
    pub(super) fn wait_until(&self, most: Duration, is_ready: impl Fn(&PacketQueue) -> bool) -> bool {
        let is_not_ready = |queue: &mut PacketQueue| !is_ready(queue);
        let waited = self.changed.wait_timeout_while(self.lock(), most, is_not_ready);
        let (queue, _) = waited.unwrap_or_else(PoisonError::into_inner);
        is_ready(&queue)
    }

    /// Waits for the next packet to send; `None` after the display was closed or failed.
    pub(super) fn next(&self) -> Option<Vec<u8>> {
        let mut queue = self.lock();
        loop {
            if !queue.is_open() {
                return None;
            }
            if let Some(packet) = queue.packets.pop_front() {
                queue.waiting -= packet.len();
                queue.is_sending = true;
                return Some(packet);
            }
            queue = self.changed.wait(queue).unwrap_or_else(PoisonError::into_inner);
        }
    }

    /// Counts `bytes` more bytes of the current packet as sent; `is_last` is true if they end the packet.
    /// Returns whether to send more.
    pub(super) fn advance(&self, bytes: usize, is_last: bool) -> bool {
        self.change(|queue| {
            queue.sent += bytes as u64;
            queue.is_sending &= !is_last;
            queue.is_open()
        })
    }
}
