//! The gathers of a chip: done at once, or waiting in the queue.

use glam::Vec3;
use photoncard_shared::message::{Drain, Fault, FrameParameters};

use crate::gather::{GatherQueue, GatherRequest};
use crate::memory::MemoryPort;
use crate::photon::CandidateBuffer;
use crate::render::Context;
use crate::render::final_gather::gathered;

/// The candidates of a gather, and the gathers that wait.
pub(super) struct Gathers<const CANDIDATES: usize, const QUEUE: usize> {
    pub(super) candidates: CandidateBuffer<CANDIDATES>,
    queue: GatherQueue<QUEUE>,
}

/// Waiting gathers that one step does.
const GATHERS_PER_STEP: usize = 16;

impl<const CANDIDATES: usize, const QUEUE: usize> Gathers<CANDIDATES, QUEUE> {
    pub(super) const fn new() -> Self {
        Self { candidates: CandidateBuffer::new(), queue: GatherQueue::new() }
    }

    /// Drops what waits.
    pub(super) fn clear(&mut self) {
        self.queue.clear();
    }

    /// Whether none waits.
    pub(super) fn is_empty(&self) -> bool {
        self.queue.is_empty()
    }

    /// Whether waiting gathers are being done.
    pub(super) fn is_draining(&self) -> bool {
        self.queue.is_draining()
    }

    /// Whether the queue holds as many gathers as it may: they are to be done before another ray is cast.
    pub(super) fn is_full(&self, frame: &FrameParameters) -> bool {
        self.queue.len() >= most_waiting::<QUEUE>(frame)
    }

    /// Does a gather at once, or lets it wait. One that finds the queue full, as a step before it did not, is done at
    /// once. A gather that was done goes to `add`.
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

    /// Does some of the gathers that wait.
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

/// Gathers that may wait in a queue of `QUEUE`.
fn most_waiting<const QUEUE: usize>(frame: &FrameParameters) -> usize {
    (frame.queue as usize).clamp(1, QUEUE)
}
