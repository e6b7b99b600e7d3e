//! One chip: its tiles in flight, and their passes.
//!
//! A tile goes through the passes that the module `position` lists, block by block. Each pass handles all
//! stored gather points before the next pass begins. Gathers of neighbouring points therefore follow one
//! another.
//!
//! When all rays of a block's irradiance records, or of its pixels, are cast, their gathers wait in the queue
//! with those of other tiles, and another tile proceeds. The queue is drained when it is full or nothing else
//! can be done. A block's pixels that need only irradiance records are completed when the records are
//! gathered. Its other pixels are completed when none of its gathers waits any more. Each call of
//! [`Chip::step`] does a small piece of this work.
//!
//! | state | data that it keeps of a tile in flight, from the tile's command to its last pixel |
//! |---|---|
//! | `Flight` | tile, counters, progress, irradiance records |
//! | `PixelSums` | sums of the pixels with gather rays: a ring for all tiles in flight |
//! | `Points` | nothing; it holds the gather points of the tile whose rays are being cast |
//! | `Gathers` | nothing; it is the queue, in which each gather names its tile in flight |
//! | `Rounds` | in a frame in rounds ([`Drain::Buckets`]), its counters; its blocks in card memory |
//! | `RecordStore` | nothing; it locates the irradiance records that frames of one picture share |

mod adaptive;
mod buffers;
mod completion;
mod finished_pixel;
mod flight;
mod gathers;
mod light;
mod pixel_sums;
mod pixels;
mod points;
mod position;
mod records;
mod rounds;
mod stored_point;
#[cfg(test)]
mod test_frame;
#[cfg(test)]
mod tests;

use core::ops::Range;

use photoncard_shared::counters::Counters;
use photoncard_shared::message::{Drain, Fault, FrameParameters, Invariant, Tile};

use self::buffers::Shared;
pub use self::finished_pixel::{FinishedPixel, PixelView};
use self::flight::Flight;
pub use self::light::{Component, PixelLight, add_light};
use self::pixel_sums::PixelSums;
use self::points::Points;
use self::position::{Pass, Position};
use self::rounds::Rounds;
pub use self::rounds::least_waiting_lines;
use crate::gather::{Buckets, GatherQueue, PointIndex};
use crate::importance::DirectionTable;
use crate::irradiance_cache::IrradianceCache;
use crate::kind::{
    self, Array, Capacity, ChipKind, FixedCapacity, FixedKind, Micro, Reference, TechniqueMemory,
};
use crate::memory::{MemoryPort, Work};
use crate::render::RenderJob;

/// Chip with the budget [`REFERENCE`](crate::kind::REFERENCE).
pub type ReferenceChip = Chip<Reference>;
/// Chip with the budget [`MICRO`](crate::kind::MICRO).
pub type MicroChip = Chip<Micro>;

/// A chip of kind `K`, which determines the capacities of all buffers.
pub struct Chip<K: ChipKind> {
    kind: K,
    flights: <K::Flights as Capacity>::Array<Flight<K>>,
    /// Index in `flights` of the tile whose rays are being cast.
    active: Option<usize>,
    shared: Shared<K>,
}

/// Number of rays and gathers after which [`Chip::step`] returns.
const WORK_OF_STEP: u64 = 16;
/// Maximum number of calls of [`Chip::piece`] in one step; it bounds a step whose pieces cast no rays.
const PIECES_PER_STEP: u32 = 64;
/// Maximum number of queued gathers done in one piece of work.
const GATHERS_PER_PIECE: u64 = 16;

/// Result of [`Chip::step`].
#[derive(Clone, Copy, Debug)]
pub enum Progress {
    /// There is more work to do.
    Busy,
    /// A pixel is complete. Within each block of a tile, pixels without gather rays come first, row by row,
    /// then the others, row by row.
    Pixel(FinishedPixel),
    /// A tile is complete, after its last pixel: [`Tile::id`], and the counters of the work on the tile.
    Tile(u32, Counters),
    /// There is nothing to do until [`Chip::begin`] or [`Chip::flush`] is called. There is room for another
    /// tile.
    Idle,
}

impl<K: FixedKind> Default for Chip<K> {
    fn default() -> Self {
        Self::new()
    }
}

impl<K: FixedKind> Chip<K> {
    /// On-chip memory that each technique adds to the chip, bytes.
    pub const TECHNIQUES: TechniqueMemory = TechniqueMemory {
        reordering: size_of::<GatherQueue<K::GatherQueue>>()
            + size_of::<Buckets<K::Buckets>>()
            + size_of::<Rounds<K::WaitingBlocks>>(),
        irradiance_cache: K::Flights::ENTRIES * size_of::<IrradianceCache<K::IrradianceRecords>>(),
        importance_sampling: K::Points::ENTRIES * size_of::<DirectionTable>(),
    };

    /// On-chip memory, bytes, of the buffers that are empty while gathers are done that have waited in card
    /// memory ([`Work::Gathering`]).
    pub const EMPTY_WHILE_GATHERING: usize = size_of::<Points<K::Points>>()
        + size_of::<PixelSums<K::TilePixels>>()
        + K::Flights::ENTRIES * Flight::<K>::BUFFER_BYTES;

    /// Creates a chip without tiles.
    pub const fn new() -> Self {
        const { kind::check::<K>() };
        Self::vacant_of(K::KIND)
    }
}

impl<K: ChipKind> Chip<K> {
    const fn vacant_of(kind: K) -> Self {
        Self { kind, flights: Array::VACANT, active: None, shared: Shared::new() }
    }

    /// Creates a chip without tiles, with capacities set at run time instead of by types. The capacity for
    /// gather points whose rays are cast together is `points`; all others are those of the kind's budget.
    pub fn sized(kind: K, points: usize) -> Self {
        let budget = *kind.budget();
        let mut chip = Self::vacant_of(kind);
        chip.flights.reserve(budget.in_flight as usize);
        for flight in chip.flights.values_mut() {
            flight.reserve(budget.tile_pixels as usize, budget.irradiance_records as usize);
        }
        chip.shared.reserve(&budget, points);
        chip
    }

    /// Kind of the chip: its budget and the capacities of its buffers.
    pub fn kind(&self) -> &K {
        &self.kind
    }

    /// Maximum number of pixels of a tile in `frame` ([`Budget::pixels_of_tile`]).
    ///
    /// [`Budget::pixels_of_tile`]: photoncard_shared::budget::Budget::pixels_of_tile
    pub fn tile_pixels(&self, frame: &FrameParameters) -> u64 {
        u64::from(self.kind.budget().pixels_of_tile(frame.form().sums_of_light()))
    }

    /// Drops all tiles and their queued gathers.
    pub fn clear(&mut self) {
        self.active = None;
        self.shared.gathers.clear();
        self.shared.gathers.empty_buckets();
        self.shared.rounds.clear();
        for (number, flight) in self.flights.values_mut().iter_mut().enumerate() {
            flight.vacate();
            self.shared.sums.end(number);
        }
    }

    /// Begins a frame, after [`Self::clear`]. If `frame` asks for it, gathers wait and irradiance records are
    /// kept in `room`, a range of line addresses of card memory past the card image. Without this call no
    /// records are kept, and gathers do not wait in card memory.
    pub fn begin_frame(&mut self, frame: &FrameParameters, room: Range<u32>) {
        let room = self.shared.rounds.begin_frame(frame, self.kind.budget(), room);
        self.shared.gathers.empty_buckets();
        self.shared.store.begin_frame(frame, room);
    }

    /// Drops the irradiance records that earlier frames have kept. Must be called when the card image
    /// changes.
    pub fn forget_records(&mut self) {
        self.shared.store.forget();
    }

    /// Begins a tile of a frame. Returns false if the tile has no pixels or more than [`Self::tile_pixels`],
    /// or if the frame or the chip allows no further tile in flight.
    #[must_use]
    pub fn begin(&mut self, memory: &mut impl MemoryPort, frame: &FrameParameters, tile: Tile) -> bool {
        if tile.pixels() == 0 || tile.pixels() > self.tile_pixels(frame) {
            return false;
        }
        let Some(number) = self.vacant(frame) else { return false };
        let is_alone =
            self.find(|flight| flight.pass() != Pass::Vacant).is_none() && !self.shared.rounds.have_tiles();
        let Some(flight) = self.flights.values_mut().get_mut(number) else { return false };
        if is_alone {
            memory.begin_tile();
            if frame.drain == Drain::Buckets {
                memory.begin_work(Work::Casting);
            }
        }
        flight.begin(tile);
        if frame.drain == Drain::Buckets {
            let Some(number) = self.shared.rounds.open(tile) else { return false };
            flight.tile_number = number;
        }
        true
    }

    /// Index of the first entry of `flights` without a tile, among those that the frame may use.
    fn vacant(&self, frame: &FrameParameters) -> Option<usize> {
        let is_in_rounds = frame.drain == Drain::Buckets;
        if is_in_rounds && !self.shared.rounds.accepts_tile() {
            return None;
        }
        let in_flight = if is_in_rounds { 1 } else { frame.in_flight.max(1) };
        let flights = self.flights.values().iter().take(in_flight as usize);
        flights.map(Flight::pass).position(|pass| pass == Pass::Vacant)
    }

    /// Index of the first entry of `flights` for which `holds` is true.
    fn find(&self, holds: impl Fn(&Flight<K>) -> bool) -> Option<usize> {
        self.flights.values().iter().position(holds)
    }

    /// Begins to drain the gather queue although it is not full, because no tile follows. Returns false if no
    /// gather waits.
    pub fn flush(&mut self, frame: &FrameParameters) -> bool {
        if frame.drain == Drain::Buckets {
            return self.shared.rounds.flush();
        }
        let waits = !self.shared.gathers.is_empty();
        if waits && !self.shared.gathers.is_draining() {
            self.begin_drain(frame);
        }
        waits
    }

    /// Does the next pieces of work, about 16 rays and gathers in all. A card polls its link after each step.
    /// Steps are short enough for a prompt reply, and long enough to make the cost of polling negligible.
    ///
    /// # Errors
    /// If the card image is invalid, or an [`Invariant`] is violated. The caller should then drop all tiles
    /// ([`Self::clear`]).
    pub fn step<M: MemoryPort>(&mut self, job: &mut RenderJob<M>) -> Result<Progress, Fault> {
        let mut work = 0;
        for _ in 0..PIECES_PER_STEP {
            let progress = self.piece(job, &mut work)?;
            if !matches!(progress, Progress::Busy) {
                return Ok(progress);
            }
            if work >= WORK_OF_STEP {
                break;
            }
        }
        Ok(Progress::Busy)
    }

    /// Does the next piece of work: up to [`GATHERS_PER_PIECE`] queued gathers, one path of a pixel's
    /// completion, or one step of a pass. Adds the piece's number of rays and gathers to `work`.
    #[inline(always)]
    fn piece<M: MemoryPort>(&mut self, job: &mut RenderJob<M>, work: &mut u64) -> Result<Progress, Fault> {
        if job.frame.drain == Drain::Buckets {
            return self.piece_in_rounds(job, work);
        }
        if self.shared.gathers.is_draining() {
            self.drain(job)?;
            *work += GATHERS_PER_PIECE;
            return Ok(Progress::Busy);
        }
        if let Some(number) = self.find(Flight::is_completable) {
            return self.complete(job, number, work);
        }
        let Some(number) = self.active else { return self.go_on(job.frame) };
        let Self { flights, shared, .. } = self;
        let flight = flights.values_mut().get_mut(number).ok_or(Invariant::Flight.fault())?;
        let pass = flight.pass();
        if shared.gathers.is_full(job.frame) || pass == Pass::Eye && !flight.has_room(job.frame, shared) {
            self.begin_drain(job.frame);
            return Ok(Progress::Busy);
        }
        self.go_on_with_pass(job, number, pass, work)
    }

    /// Does the next step of a pass of tile in flight `number`.
    #[inline(always)]
    fn go_on_with_pass<M: MemoryPort>(
        &mut self,
        job: &mut RenderJob<M>,
        number: usize,
        pass: Pass,
        work: &mut u64,
    ) -> Result<Progress, Fault> {
        let Self { flights, shared, .. } = self;
        let flight = flights.values_mut().get_mut(number).ok_or(Invariant::Flight.fault())?;
        let done = flight.counters.rays_and_gathers();
        match pass {
            Pass::ReadKept => flight.read_kept(job, shared)?,
            Pass::Survey => flight.survey(job, shared)?,
            Pass::RecordPoints => flight.choose_record_point(job, shared)?,
            Pass::RecordRays => flight.cast_for_record(job, shared, number)?,
            Pass::Probe => flight.probe(job)?,
            Pass::Eye => flight.look(job, shared, number)?,
            Pass::Direct => flight.gather_direct_light(job, shared, number)?,
            Pass::Rays => flight.cast_for_pixel(job, shared, number)?,
            _ => self.active = None,
        }
        if let Some(flight) = self.flights.values().get(number) {
            *work += flight.counters.rays_and_gathers().wrapping_sub(done);
        }
        Ok(Progress::Busy)
    }

    /// Chooses the next tile in flight to work on. A tile whose block has pixels with gather rays left comes
    /// first, then a tile whose next block has not begun. If there is neither, begins a drain if there is no
    /// room for another tile; otherwise the chip is idle.
    fn go_on(&mut self, frame: &FrameParameters) -> Result<Progress, Fault> {
        let of_pass = |pass| self.find(|flight| flight.pass() == pass);
        if let Some(number) = of_pass(Pass::NextPixels).or_else(|| of_pass(Pass::NextBlock)) {
            let flight = self.flights.values_mut().get_mut(number).ok_or(Invariant::Flight.fault())?;
            if flight.pass() == Pass::NextPixels {
                self.shared.sums.begin(number);
                flight.begin_pixels(frame);
            } else {
                flight.begin_block(frame)?;
            }
            self.active = Some(number);
            return Ok(Progress::Busy);
        }
        let must_drain = self.vacant(frame).is_none() && self.flush(frame);
        Ok(if must_drain { Progress::Busy } else { Progress::Idle })
    }

    /// Completes the next path of a pixel of tile in flight `number`, whose block has no waiting gathers.
    /// After the last pixel of the pass, the tile proceeds to the block's pixels with gather rays or to the
    /// next block, or it ends.
    fn complete<M: MemoryPort>(
        &mut self,
        job: &mut RenderJob<M>,
        number: usize,
        work: &mut u64,
    ) -> Result<Progress, Fault> {
        let Self { flights, shared, .. } = self;
        let flight = flights.values_mut().get_mut(number).ok_or(Invariant::Flight.fault())?;
        match flight.pass() {
            Pass::WaitForRecords => {
                flight.end_records(job, shared)?;
                flight.position = Position::at(Pass::CompletePlain);
            }
            Pass::Wait => flight.position = Position::at(Pass::Complete),
            _ => {}
        }
        let Some(pixel) = flight.pixel_to_complete() else {
            let is_plain = flight.pass() == Pass::CompletePlain;
            if is_plain && flight.first_with_rays(0..flight.block.pixels()).is_some() {
                flight.position = Position::at(Pass::NextPixels);
                return Ok(Progress::Busy);
            }
            shared.sums.end(number);
            if job.frame.drain == Drain::Buckets {
                return self.end_block_in_rounds();
            }
            if flight.has_blocks() {
                flight.position = Position::at(Pass::NextBlock);
                return Ok(Progress::Busy);
            }
            flight.vacate();
            return Ok(Progress::Tile(flight.tile.id, flight.counters));
        };
        let done = flight.counters.rays_and_gathers();
        let finished = flight.complete(job, shared, (number, pixel))?;
        *work += flight.counters.rays_and_gathers().wrapping_sub(done);
        Ok(finished.map_or(Progress::Busy, Progress::Pixel))
    }

    /// Begins to drain the gather queue. The drain is counted for the tile of the first gather.
    fn begin_drain(&mut self, frame: &FrameParameters) {
        // An empty queue has nothing to drain.
        let Some((waiting, first)) = self.shared.gathers.begin_drain(frame.drain) else { return };
        if let Some(flight) = self.flights.values_mut().get_mut(first.target.flight()) {
            flight.counters.drains += 1;
            flight.counters.most_waiting = flight.counters.most_waiting.max(waiting as u64);
        }
    }

    /// Does up to [`GATHERS_PER_PIECE`] queued gathers and adds their radiance to irradiance records or pixel
    /// sums.
    fn drain<M: MemoryPort>(&mut self, job: &mut RenderJob<M>) -> Result<(), Fault> {
        let Self { flights, shared, .. } = self;
        for _ in 0..GATHERS_PER_PIECE {
            let Some(request) = shared.gathers.take() else { break };
            let (number, point) = (request.target.flight(), request.target.point());
            let flight = flights.values_mut().get_mut(number).ok_or(Invariant::Flight.fault())?;
            flight.waiting = flight.waiting.checked_sub(1).ok_or(Invariant::Waiting.fault())?;
            let brought = shared.gathers.gather(&mut job.context(&mut flight.counters), &request)?;
            match point {
                PointIndex::Pixel(pixel) => {
                    shared.sums.add(job.frame, (number, pixel), Component::Indirect, &brought)?;
                }
                PointIndex::Record(record) => flight.cache.add(record, request.target.cell(), &brought)?,
            }
        }
        Ok(())
    }
}
