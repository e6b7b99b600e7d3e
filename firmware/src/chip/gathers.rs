//! Photon gathers of a chip, done at once or queued for deferred reordering.

use photoncard_shared::budget::{MOST_GATHERS_OF_LINE, places_of_gathering};
use photoncard_shared::message::{Drain, Fault, FrameParameters, Invariant};

use super::rounds::Rounds;
use crate::gather::{Buckets, GatherQueue, GatherRequest};
use crate::kind::Capacity;
use crate::light_groups::GroupedLight;
use crate::memory::{MemoryPort, Room, Stage};
use crate::photon::{CandidateStorage, Candidates};
use crate::render::Context;
use crate::render::final_gather::gathered;

/// Candidate buffer of a gather, and the gather queue with its second level in card memory. The queue holds
/// requests of all tiles in flight.
pub(super) struct Gathers<C: Capacity, Q: Capacity, B: Capacity> {
    candidates: C::Candidates,
    queue: GatherQueue<Q>,
    buckets: Buckets<B>,
}

impl<C: Capacity, Q: Capacity, B: Capacity> Gathers<C, Q, B> {
    pub(super) const fn new() -> Self {
        Self { candidates: CandidateStorage::EMPTY, queue: GatherQueue::new(), buckets: Buckets::new() }
    }

    /// Sets the capacities for candidates, queued gathers and buckets, if the types leave them open.
    pub(super) fn reserve(&mut self, candidates: usize, queue: usize, buckets: usize) {
        self.candidates.reserve(candidates);
        self.queue.reserve(queue);
        self.buckets.reserve(buckets);
    }

    /// Candidate buffer, for the photon search of a direction table.
    pub(super) fn candidates(&mut self) -> Candidates<'_> {
        self.candidates.view()
    }

    /// Drops all queued gathers.
    pub(super) fn clear(&mut self) {
        self.queue.clear();
    }

    /// Returns true if no gather is queued.
    pub(super) fn is_empty(&self) -> bool {
        self.queue.is_empty()
    }

    /// Returns true while the queue is being drained.
    pub(super) fn is_draining(&self) -> bool {
        self.queue.is_draining()
    }

    /// Maximum number of gathers that wait in the queue.
    fn capacity(&self, frame: &FrameParameters) -> usize {
        (frame.queue as usize).clamp(1, self.queue.capacity())
    }

    /// Returns true if the queue has reached the frame's limit or its own capacity. It must then be drained
    /// before another ray is cast.
    pub(super) fn is_full(&self, frame: &FrameParameters) -> bool {
        self.queue.len() >= self.capacity(frame)
    }

    /// Returns whether the queue has room for the gathers of another line of a bucket.
    pub(super) fn has_room_for_line(&self, frame: &FrameParameters) -> bool {
        let places = places_of_gathering(self.capacity(frame) as u32);
        self.queue.len() + MOST_GATHERS_OF_LINE <= places
    }

    /// Number of buckets.
    pub(super) fn buckets(&self) -> usize {
        self.buckets.len()
    }

    /// Empties all buckets, whose incomplete lines take the queue from now on.
    pub(super) fn empty_buckets(&mut self) {
        self.queue.clear();
        self.buckets.clear();
    }

    /// Writes the incomplete line of a bucket.
    ///
    /// # Errors
    /// If there is no room for it.
    pub(super) fn close_bucket(
        &mut self,
        memory: &mut impl MemoryPort,
        room: &mut Room,
        bucket: usize,
    ) -> Result<(), Fault> {
        let lines = self.queue.places(self.buckets.len() * MOST_GATHERS_OF_LINE);
        self.buckets.write(memory, room, lines, bucket)
    }

    /// Reads a line of a bucket into the queue, which must have room for it. Returns false if the bucket has
    /// no line.
    ///
    /// # Errors
    /// If card memory ends before the line.
    pub(super) fn read_bucket(&mut self, memory: &mut impl MemoryPort, bucket: usize) -> Result<bool, Fault> {
        let queue = &mut self.queue;
        self.buckets.read(memory, bucket, |request| queue.push(request).map_err(|_| Invariant::Room.fault()))
    }

    /// Queues a gather, or does it at once and returns its radiance. It is done at once in a frame without
    /// deferred reordering ([`Drain::Immediate`]), and if the queue or the round is full.
    ///
    /// # Errors
    /// If the card image is invalid.
    pub(super) fn submit<M: MemoryPort, W: Capacity>(
        &mut self,
        context: &mut Context<M>,
        rounds: &mut Rounds<W>,
        request: GatherRequest,
    ) -> Result<Option<GroupedLight>, Fault> {
        if context.frame.drain == Drain::Buckets {
            let Some(room) = rounds.room_for_gather() else {
                return self.gather(context, &request).map(Some);
            };
            let lines = self.queue.places(self.buckets.len() * MOST_GATHERS_OF_LINE);
            context.memory.enter(Stage::Gather);
            self.buckets.add(context.memory, room, lines, request)?;
            context.memory.enter(Stage::GatherRay);
            return Ok(None);
        }
        let must_not_wait = context.frame.drain == Drain::Immediate || self.is_full(context.frame);
        let rejected = if must_not_wait { Err(request) } else { self.queue.push(request) };
        match rejected {
            Ok(()) => Ok(None),
            Err(request) => self.gather(context, &request).map(Some),
        }
    }

    /// Queues a gather that no tile counts as waiting. Returns whether there was room.
    #[cfg(test)]
    pub(super) fn wait_for_test(&mut self, request: GatherRequest) -> bool {
        self.queue.push(request).is_ok()
    }

    /// Begins to drain the queue in the order `drain`. Returns the number of waiting gathers and the first
    /// gather; `None` if no gather waits.
    pub(super) fn begin_drain(&mut self, drain: Drain) -> Option<(usize, &GatherRequest)> {
        if self.queue.is_empty() {
            return None;
        }
        self.queue.begin_drain(drain);
        self.queue.first().map(|first| (self.queue.len(), first))
    }

    /// Takes the next gather of the drain; `None` after the last one, which ends the drain.
    pub(super) fn take(&mut self) -> Option<GatherRequest> {
        self.queue.take()
    }

    /// Does a gather and returns its radiance.
    ///
    /// # Errors
    /// If the card image is invalid.
    pub(super) fn gather<M: MemoryPort>(
        &mut self,
        context: &mut Context<M>,
        request: &GatherRequest,
    ) -> Result<GroupedLight, Fault> {
        gathered(context, request, self.candidates.view())
    }
}
