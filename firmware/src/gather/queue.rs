//! Gather queue of deferred reordering. It keeps requests until it is full or no other work is left; they are
//! then done in the order of [`super::HilbertCode::key`]. A full queue is drained before the next request, so
//! that none is lost.

use photoncard_shared::message::Drain;

use super::GatherRequest;
use crate::kind::{Buffer, Capacity};

/// Queue of gather requests, 24 bytes each.
pub struct GatherQueue<C: Capacity> {
    waiting: C::Buffer<GatherRequest>,
    draining: bool,
}

impl<C: Capacity> Default for GatherQueue<C> {
    fn default() -> Self {
        Self::new()
    }
}

impl<C: Capacity> GatherQueue<C> {
    /// Creates an empty queue.
    pub const fn new() -> Self {
        Self { waiting: Buffer::EMPTY, draining: false }
    }

    /// Sets the capacity to `requests` requests, if the type leaves it open.
    pub fn reserve(&mut self, requests: usize) {
        self.waiting.reserve(requests);
    }

    /// Maximum number of requests.
    pub fn capacity(&self) -> usize {
        self.waiting.capacity()
    }

    /// Drops all queued requests.
    pub fn clear(&mut self) {
        self.waiting.clear();
        self.draining = false;
    }

    /// Number of queued requests.
    pub fn len(&self) -> usize {
        self.waiting.values().len()
    }

    /// Returns true if no request is queued.
    pub fn is_empty(&self) -> bool {
        self.waiting.values().is_empty()
    }

    /// Returns true between [`Self::begin_drain`] and the end of the drain.
    pub fn is_draining(&self) -> bool {
        self.draining
    }

    /// Requests in the first `count` places of the queue, for use as a buffer; fewer if it has fewer places.
    /// The queue must not be drained meanwhile, and be cleared afterwards.
    pub fn places(&mut self, count: usize) -> &mut [GatherRequest] {
        let count = count.min(self.waiting.capacity());
        if self.waiting.values().len() != count {
            // Always fits: at most the capacity.
            let _ = self.waiting.resize(count, GatherRequest::NONE);
        }
        self.waiting.values_mut()
    }

    /// Appends a request.
    ///
    /// # Errors
    /// Returns the request if the queue is full.
    pub fn push(&mut self, request: GatherRequest) -> Result<(), GatherRequest> {
        self.waiting.push(request)
    }

    /// Begins to drain the queue: sorts the requests in the order that `drain` names.
    pub fn begin_drain(&mut self, drain: Drain) {
        // In descending order, as requests are popped from the end.
        self.waiting.values_mut().sort_unstable_by_key(|request| u64::MAX - request.position.key(drain));
        self.draining = true;
    }

    /// Request that [`Self::take`] returns next in a drain that has begun; `None` if the queue is empty.
    pub fn first(&self) -> Option<&GatherRequest> {
        self.waiting.values().last()
    }

    /// Takes the next request of the drain; `None` after the last one, which ends the drain.
    pub fn take(&mut self) -> Option<GatherRequest> {
        let next = self.waiting.pop();
        self.draining = next.is_some();
        next
    }
}
