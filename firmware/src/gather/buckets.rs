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

use photoncard_shared::budget::{LEAST_GATHERS_OF_LINE, MAX_BUCKETS, MOST_GATHERS_OF_LINE};
use photoncard_shared::message::{Fault, Invariant};

use super::chain;
use super::request::{
    GatherRequest, GatherResult, LAMBERTIAN_BYTES, LambertianRequest, OMITTED_BITS, REQUEST_BYTES,
    RESULT_BYTES,
};
use crate::kind::{Buffer, Capacity, Vacant};
use crate::memory::{MemoryPort, Room};

const _: () = assert!(LEAST_GATHERS_OF_LINE * REQUEST_BYTES == chain::RECORD_BYTES);
const _: () = assert!(MOST_GATHERS_OF_LINE * LAMBERTIAN_BYTES == chain::RECORD_BYTES);
// The number of a bucket is the part of a position that a Lambertian request leaves out.
const _: () = assert!(MAX_BUCKETS == 1 << OMITTED_BITS);

/// Format of a line with up to [`LEAST_GATHERS_OF_LINE`] gathers, and of lines of results.
const WHOLE: u8 = 0;
/// Format of a line with more gathers, which have no lobes.
const LAMBERTIAN: u8 = 1;
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

const HELD_BITS: u32 = 4;
const _: () = assert!(MOST_GATHERS_OF_LINE < 1 << HELD_BITS);
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
        let has_short_lines = self.len() == MAX_BUCKETS;
        let broken = Invariant::Room.fault();
        let bucket = self.buckets.values_mut().get_mut(number).ok_or(broken)?;
        let line = line_of(held, number).ok_or(broken)?;
        let is_short = |gathers: &[GatherRequest]| {
            has_short_lines && gathers.iter().all(|gather| LambertianRequest::new(gather).is_some())
        };
        // More gathers than a line of any holds are all Lambertian.
        if bucket.held() >= LEAST_GATHERS_OF_LINE && !is_short(&[request]) {
            bucket.write(memory, room, line)?;
        }
        let count = bucket.held();
        *line.get_mut(count).ok_or(broken)? = request;
        *bucket = Bucket(bucket.0 + 1);
        let is_full = match bucket.held() {
            LEAST_GATHERS_OF_LINE => !is_short(line.split_at(LEAST_GATHERS_OF_LINE).0),
            count => count == MOST_GATHERS_OF_LINE,
        };
        if is_full { bucket.write(memory, room, line) } else { Ok(()) }
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

    /// Reads a line of bucket `number` and removes it. `take` is called with each of its gathers, at most
    /// [`MOST_GATHERS_OF_LINE`]. Returns false if the bucket has no line.
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
        let line = chain::read(memory, &mut newest)?;
        if line.format == LAMBERTIAN {
            line.each(|bytes| take(LambertianRequest(*bytes).request(number as u8)))?;
        } else {
            line.each(|bytes| take(GatherRequest::from_bytes(bytes)))?;
        }
        *bucket = Bucket::new(newest, 0);
        Ok(true)
    }
}

/// Line of bucket `number` in the queue.
fn line_of(held: &mut [GatherRequest], number: usize) -> Option<&mut [GatherRequest; MOST_GATHERS_OF_LINE]> {
    held.as_chunks_mut().0.get_mut(number)
}

impl Bucket {
    /// Writes the gathers in `line`. More than [`LEAST_GATHERS_OF_LINE`] are Lambertian.
    fn write(
        &mut self,
        memory: &mut impl MemoryPort,
        room: &mut Room,
        line: &[GatherRequest; MOST_GATHERS_OF_LINE],
    ) -> Result<(), Fault> {
        let gathers = line.iter().take(self.held());
        let mut newest = self.newest();
        if self.held() > LEAST_GATHERS_OF_LINE {
            let short = gathers.filter_map(LambertianRequest::new).map(|LambertianRequest(bytes)| bytes);
            chain::append(memory, room, &mut newest, LAMBERTIAN, short)?;
        } else {
            chain::append(memory, room, &mut newest, WHOLE, gathers.map(GatherRequest::to_bytes))?;
        }
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
            chain::append(memory, room, &mut self.newest, WHOLE, records)?;
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
        chain::read(memory, &mut self.0)?.each(|bytes| take(GatherResult::from_bytes(bytes)))
    }
}

#[cfg(test)]
mod tests {
    use std::vec;
    use std::vec::Vec;

    use photoncard_shared::address::Line;
    use proptest::prelude::*;

    use super::*;
    use crate::gather::{GatherTarget, HilbertCode};
    use crate::kind::Entries;
    use crate::memory::Dram;
    use crate::scene::PartialReflection;

    /// Gathers of random positions, of which each has a lobe or none.
    fn gathers() -> impl Strategy<Value = Vec<GatherRequest>> {
        let few_buckets = (any::<u64>(), 0..4_u64).prop_map(|(bits, part)| bits >> 8 | (part * 85) << 56);
        let gather = (few_buckets, any::<[u8; 13]>(), any::<[u8; 3]>(), prop::bool::weighted(0.2));
        let gather = gather.prop_map(|(position, [a, b, c, d, rest @ ..], target, has_lobe)| {
            let lobe = if has_lobe { rest } else { [0, 0, 0, 0, 0, 0, 0, 0, rest[8]] };
            let [e, f, g, h, i, j, k, l, m] = lobe;
            GatherRequest {
                position: HilbertCode::of_bits(position),
                reflection: PartialReflection::from_bytes(&[a, b, c, d, e, f, g, h, i, j, k, l, m]),
                target: GatherTarget::from_bytes(target),
            }
        });
        prop::collection::vec(gather, 0..120)
    }

    /// Writes gathers into `BUCKETS` buckets. Returns what each bucket holds, and the number of its lines.
    fn written<const BUCKETS: usize>(gathers: &[GatherRequest]) -> Vec<(Vec<GatherRequest>, usize)> {
        let mut lines = vec![Line::ZERO; 2 + gathers.len()];
        let (mut memory, mut room) = (Dram::new(&mut lines), Room::new(1, 1 + gathers.len() as u32));
        let mut buckets = Buckets::<Entries<BUCKETS>>::new();
        buckets.clear();
        let mut held = vec![GatherRequest::NONE; BUCKETS * MOST_GATHERS_OF_LINE];
        for gather in gathers {
            buckets.add(&mut memory, &mut room, &mut held, *gather).unwrap();
        }
        let bucket = |number| {
            buckets.write(&mut memory, &mut room, &mut held, number).unwrap();
            let (mut found, mut lines) = (Vec::new(), 0);
            let mut take = |gather| {
                found.push(gather);
                Ok(())
            };
            while buckets.read(&mut memory, number, &mut take).unwrap() {
                lines += 1;
            }
            (found, lines)
        };
        (0..BUCKETS).map(bucket).collect()
    }

    fn sorted(gathers: impl Iterator<Item = GatherRequest>) -> Vec<[u8; REQUEST_BYTES]> {
        let mut bytes: Vec<_> = gathers.map(|gather| gather.to_bytes()).collect();
        bytes.sort_unstable();
        bytes
    }

    fn check<const BUCKETS: usize>(gathers: &[GatherRequest]) -> Result<(), TestCaseError> {
        for (number, (found, lines)) in written::<BUCKETS>(gathers).into_iter().enumerate() {
            let bits = BUCKETS.ilog2();
            let of_bucket = gathers.iter().filter(|gather| gather.position.part(bits) == number);
            prop_assert_eq!(sorted(found.iter().copied()), sorted(of_bucket.copied()));
            let is_short = |gather| LambertianRequest::new(gather).is_some();
            let most = found.len().div_ceil(LEAST_GATHERS_OF_LINE);
            prop_assert!(lines <= most, "{} lines of {} gathers", lines, found.len());
            if BUCKETS == MAX_BUCKETS && found.iter().all(is_short) {
                prop_assert_eq!(lines, found.len().div_ceil(MOST_GATHERS_OF_LINE));
            }
        }
        Ok(())
    }

    proptest! {
        /// Lambertian gathers, in the greatest number of buckets, take an eighth of a line, others a fifth.
        #[test]
        fn buckets_return_their_gathers_and_take_few_lines(gathers in gathers()) {
            check::<MAX_BUCKETS>(&gathers)?;
            check::<4>(&gathers)?;
        }
    }
}
