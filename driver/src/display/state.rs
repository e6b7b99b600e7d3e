//! What a display's owner and its thread share: the packets that wait, and how it stands.

use std::collections::VecDeque;
use std::sync::{Condvar, Mutex, MutexGuard, PoisonError};
use std::time::Duration;

use photoncard_shared::message::Tile;

use super::DisplayError;

/// Packets on their way from the owner to the thread.
#[derive(Default)]
pub(super) struct State {
    queue: VecDeque<Vec<u8>>,
    /// Bytes in the queue.
    waiting: usize,
    /// Whether a packet that was taken from the queue is not wholly sent.
    is_sending: bool,
    /// Bytes that were sent.
    pub(super) sent: u64,
    /// Tiles that found no room.
    pub(super) missed: Vec<Tile>,
    /// Nothing more is to be sent.
    pub(super) is_closed: bool,
    /// Nothing more can be sent.
    has_failed: bool,
    /// Why, until that is told.
    failure: Option<DisplayError>,
}

impl State {
    /// Whether a packet would still be sent.
    pub(super) fn is_open(&self) -> bool {
        !self.is_closed && !self.has_failed
    }

    /// Whether all is sent that is to be.
    pub(super) fn is_empty(&self) -> bool {
        self.queue.is_empty() && !self.is_sending
    }

    /// Packets that are not wholly sent, and tiles that were missed.
    pub(super) fn left(&self) -> usize {
        self.queue.len() + usize::from(self.is_sending) + self.missed.len()
    }

    /// Whether so many more bytes may wait, of `most` in all: those of one packet always.
    pub(super) fn has_room(&self, bytes: usize, most: usize) -> bool {
        self.waiting == 0 || self.waiting + bytes <= most
    }

    /// Puts a packet behind the others.
    pub(super) fn push(&mut self, packet: Vec<u8>) {
        self.waiting += packet.len();
        self.queue.push_back(packet);
    }

    /// Nothing more can be sent. Tells of the first failure alone.
    pub(super) fn fail(&mut self, error: DisplayError) {
        if self.is_open() {
            self.failure = Some(error);
        }
        self.has_failed = true;
        self.queue.clear();
        self.missed.clear();
        self.is_sending = false;
    }

    /// What went wrong, if that was not told before.
    pub(super) fn take_failure(&mut self) -> Option<DisplayError> {
        self.failure.take()
    }
}

/// The state with its lock, and who waits for it to change.
#[derive(Default)]
pub(super) struct SharedState {
    state: Mutex<State>,
    changed: Condvar,
}

impl SharedState {
    pub(super) fn lock(&self) -> MutexGuard<'_, State> {
        // No step of a thread that panicked is half done.
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Changes the state, and tells the other thread.
    pub(super) fn change<T>(&self, change: impl FnOnce(&mut State) -> T) -> T {
        let result = change(&mut self.lock());
        self.changed.notify_all();
        result
    }

    /// Waits until the state is as `is_ready` says, not longer than `most`. Returns whether it is.
    pub(super) fn wait_until(&self, most: Duration, is_ready: impl Fn(&State) -> bool) -> bool {
        let is_not_ready = |state: &mut State| !is_ready(state);
        let waited = self.changed.wait_timeout_while(self.lock(), most, is_not_ready);
        let (state, _) = waited.unwrap_or_else(PoisonError::into_inner);
        is_ready(&state)
    }

    /// The next packet to send; `None` once there will be none.
    pub(super) fn next(&self) -> Option<Vec<u8>> {
        let mut state = self.lock();
        loop {
            if !state.is_open() {
                return None;
            }
            if let Some(packet) = state.queue.pop_front() {
                state.waiting -= packet.len();
                state.is_sending = true;
                return Some(packet);
            }
            state = self.changed.wait(state).unwrap_or_else(PoisonError::into_inner);
        }
    }

    /// So many bytes of the present packet were sent. Returns whether to go on with it.
    pub(super) fn advance(&self, bytes: usize, is_last: bool) -> bool {
        self.change(|state| {
            state.sent += bytes as u64;
            state.is_sending &= !is_last;
            state.is_open()
        })
    }
}
