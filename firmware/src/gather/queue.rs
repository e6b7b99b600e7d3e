//! The gather queue: requests wait here until it is full or their results are needed, and are then done in the order of their
//! keys. Full is back-pressure: the queue is drained, and nothing is lost.

use heapless::Vec;

use super::GatherRequest;

/// A request with its key.
#[derive(Clone, Copy, Debug)]
struct Waiting {
    key: u32,
    request: GatherRequest,
}

/// Up to `N` requests, 32 bytes each.
pub struct GatherQueue<const N: usize> {
    waiting: Vec<Waiting, N>,
    draining: bool,
}

const _: () = assert!(size_of::<Waiting>() == 32);

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
    pub fn push(&mut self, key: u32, request: GatherRequest) -> Result<(), GatherRequest> {
        self.waiting.push(Waiting { key, request }).map_err(|waiting| waiting.request)
    }

    /// Begins to take requests out, in the order of their keys.
    pub fn begin_drain(&mut self) {
        // The last is taken first: the keys fall along the buffer.
        self.waiting.sort_unstable_by_key(|waiting| u32::MAX - waiting.key);
        self.draining = true;
    }

    /// The next request; `None` ends the drain.
    pub fn take(&mut self) -> Option<GatherRequest> {
        let next = self.waiting.pop();
        self.draining = next.is_some();
        next.map(|waiting| waiting.request)
    }
}
