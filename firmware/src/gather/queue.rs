//! The gather queue: requests wait here until it is full or their results are needed, and are then done in the order of their
//! places. Full is back-pressure: the queue is drained, and nothing is lost.

use heapless::Vec;
use photoncard_shared::message::Drain;

use super::GatherRequest;

/// Up to `N` requests, 24 bytes each.
pub struct GatherQueue<const N: usize> {
    waiting: Vec<GatherRequest, N>,
    draining: bool,
}

impl<const N: usize> Default for GatherQueue<N> {
    fn default() -> Self {
        Self::new()
    }
}

impl<const N: usize> GatherQueue<N> {
    /// An empty queue.
    pub const fn new() -> Self {
        Self { waiting: Vec::new(), draining: false }
    }

    /// Drops what waits.
    pub fn clear(&mut self) {
        self.waiting.clear();
        self.draining = false;
    }

    /// Requests that wait.
    pub fn len(&self) -> usize {
        self.waiting.len()
    }

    /// Whether none waits.
    pub fn is_empty(&self) -> bool {
        self.waiting.is_empty()
    }

    /// Whether requests are being taken out.
    pub fn is_draining(&self) -> bool {
        self.draining
    }

    /// Adds a request.
    ///
    /// # Errors
    /// Gives it back if there is no room.
    pub fn push(&mut self, request: GatherRequest) -> Result<(), GatherRequest> {
        self.waiting.push(request)
    }

    /// Begins to take requests out, in the order that `drain` tells.
    pub fn begin_drain(&mut self, drain: Drain) {
        // The last is taken first: the keys fall along the buffer.
        self.waiting.sort_unstable_by_key(|request| u64::MAX - request.place.key(drain));
        self.draining = true;
    }

    /// The next request; `None` ends the drain.
    pub fn take(&mut self) -> Option<GatherRequest> {
        let next = self.waiting.pop();
        self.draining = next.is_some();
        next
    }
}
