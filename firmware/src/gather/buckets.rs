//! Second level of the gather queue, in card memory ([`Drain::Buckets`]).
//!
//! Gathers of many tiles are written into buckets, each a part of the Hilbert curve, and read back bucket by
//! bucket. The photons of a bucket are then read once for all tiles. While gathers are written, the chip's
//! queue holds the last, incomplete line of each bucket; while they are read, it holds consecutive buckets,
//! sorted along the curve. What gathers bring returns the same way, by block of pixels ([`Results`]). Pharr,
//! Kolb, Gershbein, Hanrahan 1997, *Rendering complex scenes with memory-coherent ray tracing*, queue rays by
//! cell of the scene in a similar way.
//!
//! [`Drain::Buckets`]: photoncard_shared::message::Drain::Buckets

use photoncard_shared::budget::GATHERS_PER_LINE;
use photoncard_shared::message::{Fault, Invariant};

use super::chain;
use super::request::{GatherRequest, GatherResult, REQUEST_BYTES, RESULT_BYTES};
use crate::kind::{Buffer, Capacity, Vacant};
use crate::memory::{MemoryPort, Room};

const _: () = assert!(GATHERS_PER_LINE * REQUEST_BYTES == chain::RECORD_BYTES);
/// Number of results in a line.
pub const RESULTS_PER_LINE: usize = chain::RECORD_BYTES / RESULT_BYTES;

/// Buckets of gathers in card memory.
pub struct Buckets<B: Capacity> {
    buckets: B::Buffer<Bucket>,
}

/// Chain of a bucket's lines: address of the newest line in the upper bits, and number of gathers in the
/// bucket's line in the queue in the lower [`HELD_BITS`].
#[derive(Clone, Copy)]
struct Bucket(u32);

const HELD_BITS: u32 = 3;
const _: () = assert!(GATHERS_PER_LINE < 1 << HELD_BITS);
/// Upper limit of the addresses of lines of buckets.
pub const MAX_BUCKET_LINE: u32 = 1 << (u32::BITS - HELD_BITS);

impl Bucket {
    const EMPTY: Self = Self::new(chain::NONE, 0);

    const fn new(newest: u32, held: u32) -> Self {
        Self(newest << HELD_BITS | held)
    }

    fn newest(self) -> u32 {
        self.0 >> HELD_BITS
    }

    fn held(self) -> usize {
        (self.0 & ((1 << HELD_BITS) - 1)) as usize
    }
}

impl<B: Capacity> Default for Buckets<B> {
    fn default() -> Self {
        Self::new()
    }
}

impl<B: Capacity> Buckets<B> {
    /// Creates empty buckets.
    pub const fn new() -> Self {
        Self { buckets: Buffer::EMPTY }
    }

    /// Sets the number of buckets to `buckets`, if the type leaves it open.
    pub fn reserve(&mut self, buckets: usize) {
        self.buckets.reserve(buckets);
    }

    /// Number of buckets: a power of two, or 0.
    pub fn len(&self) -> usize {
        self.buckets.capacity()
    }

    /// Returns true if there are no buckets.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Empties all buckets.
    pub fn clear(&mut self) {
        self.buckets.clear();
        // Always fits: the buffer's own capacity.
        let _ = self.buckets.resize(self.buckets.capacity(), Bucket::EMPTY);
    }

    /// Adds a gather to its bucket. `held` are the lines of the buckets in the queue.
    ///
    /// # Errors
    /// [`Invariant::Room`] if a line is full and there is no room for it.
    #[inline(never)]
    pub fn add(
        &mut self,
        memory: &mut impl MemoryPort,
        room: &mut Room,
        held: &mut [GatherRequest],
        request: GatherRequest,
    ) -> Result<(), Fault> {
        let number = request.position.part(self.len().checked_ilog2().unwrap_or(0));
        let broken = Invariant::Room.fault();
        let bucket = self.buckets.values_mut().get_mut(number).ok_or(broken)?;
        let line = line_of(held, number).ok_or(broken)?;
        *line.get_mut(bucket.held()).ok_or(broken)? = request;
        *bucket = Bucket(bucket.0 + 1);
        if bucket.held() == GATHERS_PER_LINE { bucket.write(memory, room, line) } else { Ok(()) }
    }

    /// Writes the incomplete line of bucket `number`, if it has gathers.
    ///
    /// # Errors
    /// [`Invariant::Room`] if there is no room for it.
    pub fn write(
        &mut self,
        memory: &mut impl MemoryPort,
        room: &mut Room,
        held: &mut [GatherRequest],
        number: usize,
    ) -> Result<(), Fault> {
        match (self.buckets.values_mut().get_mut(number), line_of(held, number)) {
            (Some(bucket), Some(line)) if bucket.held() > 0 => bucket.write(memory, room, line),
            _ => Ok(()),
        }
    }

    /// Reads a line of bucket `number` and removes it. `take` is called with each of its gathers. Returns
    /// false if the bucket has no line.
    ///
    /// # Errors
    /// Errors of `take`, and [`FaultCode::LineRange`](photoncard_shared::message::FaultCode::LineRange).
    pub fn read(
        &mut self,
        memory: &mut impl MemoryPort,
        number: usize,
        mut take: impl FnMut(GatherRequest) -> Result<(), Fault>,
    ) -> Result<bool, Fault> {
        let Some(bucket) = self.buckets.values_mut().get_mut(number) else { return Ok(false) };
        let mut newest = bucket.newest();
        if newest == chain::NONE {
            return Ok(false);
        }
        chain::read(memory, &mut newest, |bytes| take(GatherRequest::from_bytes(bytes)))?;
        *bucket = Bucket::new(newest, 0);
        Ok(true)
    }
}

/// Line of bucket `number` in the queue.
fn line_of(held: &mut [GatherRequest], number: usize) -> Option<&mut [GatherRequest; GATHERS_PER_LINE]> {
    held.as_chunks_mut().0.get_mut(number)
}

impl Bucket {
    fn write(
        &mut self,
        memory: &mut impl MemoryPort,
        room: &mut Room,
        line: &[GatherRequest; GATHERS_PER_LINE],
    ) -> Result<(), Fault> {
        let records = line.iter().take(self.held()).map(GatherRequest::to_bytes);
        let mut newest = self.newest();
        chain::append(memory, room, &mut newest, records)?;
        *self = Self::new(newest, 0);
        Ok(())
    }
}

/// Results for one block: a chain in card memory, and its incomplete line.
#[derive(Clone, Copy)]
pub struct Results {
    newest: u32,
    held: u32,
    line: [GatherResult; RESULTS_PER_LINE],
}

impl Vacant for Results {
    const VACANT: Self = Self { newest: chain::NONE, held: 0, line: [GatherResult::NONE; RESULTS_PER_LINE] };
}

impl Results {
    /// Adds a result.
    ///
    /// # Errors
    /// [`Invariant::Room`] if a line is full and there is no room for it.
    pub fn add(
        &mut self,
        memory: &mut impl MemoryPort,
        room: &mut Room,
        result: GatherResult,
    ) -> Result<(), Fault> {
        *self.line.get_mut(self.held as usize).ok_or(Invariant::Room.fault())? = result;
        self.held += 1;
        if self.held as usize == RESULTS_PER_LINE { self.write(memory, room) } else { Ok(()) }
    }

    /// Writes the incomplete line, if it has results.
    ///
    /// # Errors
    /// [`Invariant::Room`] if there is no room for it.
    pub fn write(&mut self, memory: &mut impl MemoryPort, room: &mut Room) -> Result<(), Fault> {
        if self.held > 0 {
            let records = self.line.iter().take(self.held as usize).map(GatherResult::to_bytes);
            chain::append(memory, room, &mut self.newest, records)?;
            self.held = 0;
        }
        Ok(())
    }

    /// Removes all results, and returns the chain of the written ones.
    pub fn take(&mut self) -> WrittenResults {
        let newest = self.newest;
        *self = Self::VACANT;
        WrittenResults(newest)
    }
}

/// Chain of results in card memory.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct WrittenResults(u32);

impl WrittenResults {
    /// Chain without results.
    pub const NONE: Self = Self(chain::NONE);

    /// Returns true if no result is left.
    pub fn is_empty(&self) -> bool {
        *self == Self::NONE
    }

    /// Reads a line of results and removes it. `take` is called with each of them.
    ///
    /// # Errors
    /// Errors of `take`, and [`FaultCode::LineRange`](photoncard_shared::message::FaultCode::LineRange).
    pub fn read(
        &mut self,
        memory: &mut impl MemoryPort,
        mut take: impl FnMut(GatherResult) -> Result<(), Fault>,
    ) -> Result<(), Fault> {
        chain::read(memory, &mut self.0, |bytes| take(GatherResult::from_bytes(bytes)))
    }
}
