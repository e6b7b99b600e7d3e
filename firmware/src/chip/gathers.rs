//! Photon gathers of a chip: done at once, or queued for deferred reordering.

use glam::Vec3;
use photoncard_shared::message::{Drain, Fault, FrameParameters};

use crate::gather::{GatherQueue, GatherRequest};
use crate::kind::Capacity;
use crate::memory::MemoryPort;
use crate::photon::{CandidateStorage, Candidates};
use crate::render::Context;
use crate::render::final_gather::gathered;

/// Candidate buffer of a gather, and the gather queue.
pub(super) struct Gathers<C: Capacity, Q: Capacity> {
    candidates: C::Candidates,
    queue: GatherQueue<Q>,
}

/// Number of queued gathers done in one call of [`Gathers::drain`].
const GATHERS_PER_STEP: usize = 16;

impl<C: Capacity, Q: Capacity> Gathers<C, Q> {
    pub(super) const fn new() -> Self {
        Self { candidates: CandidateStorage::EMPTY, queue: GatherQueue::new() }
    }

    /// The candidate buffer, for a search that is no gather.
    pub(super) fn candidates(&mut self) -> Candidates<'_> {
        self.candidates.view()
    }

    /// Drops all queued gathers.
    pub(super) fn clear(&mut self) {
        self.queue.clear();
    }

    /// True if no gather is queued.
    pub(super) fn is_empty(&self) -> bool {
        self.queue.is_empty()
    }

    /// True while the queue is being drained.
    pub(super) fn is_draining(&self) -> bool {
        self.queue.is_draining()
    }

    /// True if the queue is at the frame's limit: it must be drained before another ray is cast.
    pub(super) fn is_full(&self, frame: &FrameParameters) -> bool {
        self.queue.len() >= most_waiting::<Q>(frame)
    }

    /// Queues a gather, or does it at once: without deferred reordering, or if the queue has filled up since the last
    /// check of [`Self::is_full`]. `add` is called with a finished gather and its radiance.
    ///
    /// # Errors
    /// If the image is not sound.
    pub(super) fn submit<M: MemoryPort>(
        &mut self,
        context: &mut Context<M>,
        request: GatherRequest,
        add: &mut impl FnMut(&GatherRequest, Vec3),
    ) -> Result<(), Fault> {
        let must_not_wait = context.frame.drain == Drain::Immediate || self.is_full(context.frame);
        let rejected = if must_not_wait { Err(request) } else { self.queue.push(request) };
        rejected.or_else(|request| self.gather(context, &request, add))
    }

    fn begin_drain<M>(&mut self, context: &mut Context<M>) {
        let counters = &mut *context.counters;
        counters.drains += 1;
        counters.most_waiting = counters.most_waiting.max(self.queue.len() as u64);
        self.queue.begin_drain(context.frame.drain);
    }

    /// Does the next [`GATHERS_PER_STEP`] queued gathers; `add` is called with each and its radiance.
    ///
    /// # Errors
    /// If the image is not sound.
    pub(super) fn drain<M: MemoryPort>(
        &mut self,
        context: &mut Context<M>,
        add: &mut impl FnMut(&GatherRequest, Vec3),
    ) -> Result<(), Fault> {
        if !self.queue.is_draining() {
            self.begin_drain(context);
        }
        for _ in 0..GATHERS_PER_STEP {
            let Some(request) = self.queue.take() else { break };
            self.gather(context, &request, add)?;
        }
        Ok(())
    }

    fn gather<M: MemoryPort>(
        &mut self,
        context: &mut Context<M>,
        request: &GatherRequest,
        add: &mut impl FnMut(&GatherRequest, Vec3),
    ) -> Result<(), Fault> {
        let brought = gathered(context, request, self.candidates.view())?;
        add(request, brought);
        Ok(())
    }
}

/// Maximum number of queued gathers in a frame: its own limit, within the capacity of the queue.
fn most_waiting<Q: Capacity>(frame: &FrameParameters) -> usize {
    (frame.queue as usize).clamp(1, Q::ENTRIES)
}
