//! One chip: its tiles in flight, and their passes.
//!
//! A tile goes through the passes of `position`, block by block; every pass is done for all gather points
//! before the next begins, so that gathers of neighbouring points are adjacent. When all rays of the
//! irradiance records of a block are cast, or all rays of its pixels, their gathers wait in the queue with
//! those of other tiles, and another tile goes on: the queue is drained when it is full, or when there is
//! nothing else to do. Pixels are completed when the last of these gathers is done: first those that need the
//! records alone. Each call of [`Chip::step`] does a small piece of this work.
//!
//! | state | kept from the command to the last pixel, of each tile in flight |
//! |---|---|
//! | `Flight` | tile, counters, progress, irradiance records |
//! | `PixelSums` | sums of the pixels with gather rays: a ring for all tiles in flight |
//! | `Points` | nothing: gather points of the tile whose rays are being cast |
//! | `Gathers` | nothing: the queue, each gather with its tile in flight |
//! | `RecordStore` | nothing: the place of the irradiance records that frames of one picture share |

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
mod stored_point;
#[cfg(test)]
mod test_frame;
#[cfg(test)]
mod tests;

use core::ops::Range;

use photoncard_shared::counters::Counters;
use photoncard_shared::message::{Fault, FrameParameters, Invariant, Tile};

use self::buffers::Shared;
pub use self::finished_pixel::{FinishedPixel, PixelView};
use self::flight::Flight;
pub use self::light::{Component, PixelLight};
use self::position::{Pass, Position};
use crate::gather::{GatherQueue, PointIndex};
use crate::importance::DirectionTable;
use crate::irradiance_cache::IrradianceCache;
use crate::kind::{self, Array, Capacity, ChipKind, Micro, Reference, TechniqueMemory};
use crate::memory::MemoryPort;
use crate::render::RenderJob;

/// The chip of the budget [`REFERENCE`](crate::kind::REFERENCE).
pub type ReferenceChip = Chip<Reference>;
/// The chip of the budget [`MICRO`](crate::kind::MICRO).
pub type MicroChip = Chip<Micro>;

/// A chip of one kind, which gives the capacities of all its buffers.
pub struct Chip<K: ChipKind> {
    flights: <K::Flights as Capacity>::Array<Flight<K>>,
    /// The tile in flight whose rays are being cast.
    active: Option<usize>,
    shared: Shared<K>,
}

/// Number of rays and gathers after which a step ends.
const WORK_OF_STEP: u64 = 16;
/// Maximum number of pieces of one step, as some pieces cast no ray.
const PIECES_PER_STEP: u32 = 64;
/// Maximum number of queued gathers done in one piece.
const GATHERS_PER_PIECE: u64 = 16;

/// Result of a step.
#[derive(Clone, Copy, Debug)]
pub enum Progress {
    /// There is more to do.
    Busy,
    /// A pixel of a tile is complete. The pixels of each block of a tile come row by row: those without
    /// gather rays of their own, then the others.
    Pixel(FinishedPixel),
    /// A tile is complete, with its last pixel before: its number, and the counts of its work.
    Tile(u32, Counters),
    /// There is nothing to do before the next [`Chip::begin`], for which there is room, or [`Chip::flush`].
    Idle,
}

impl<K: ChipKind> Default for Chip<K> {
    fn default() -> Self {
        Self::new()
    }
}

impl<K: ChipKind> Chip<K> {
    /// On-chip memory that each technique adds to the chip.
    pub const TECHNIQUES: TechniqueMemory = TechniqueMemory {
        reordering: size_of::<GatherQueue<K::GatherQueue>>(),
        irradiance_cache: K::Flights::ENTRIES * size_of::<IrradianceCache<K::IrradianceRecords>>(),
        importance_sampling: K::Points::ENTRIES * size_of::<DirectionTable>(),
    };

    /// A chip without a tile.
    pub const fn new() -> Self {
        const { kind::check::<K>() };
        Self { flights: Array::VACANT, active: None, shared: Shared::new() }
    }

    /// Maximum number of pixels of a tile of a frame.
    pub fn tile_pixels(&self, frame: &FrameParameters) -> u64 {
        u64::from(K::BUDGET.pixels_of_tile(frame.layers))
    }

    /// Drops all tiles.
    pub fn clear(&mut self) {
        self.active = None;
        self.shared.gathers.clear();
        for (number, flight) in self.flights.values_mut().iter_mut().enumerate() {
            flight.vacate();
            self.shared.sums.end(number);
        }
    }

    /// Begins a frame, with the lines of card memory beyond the image, where irradiance records may be kept.
    /// Without this call none are.
    pub fn begin_frame(&mut self, frame: &FrameParameters, room: Range<u32>) {
        self.shared.store.begin_frame(frame, room);
    }

    /// Forgets the irradiance records of earlier frames, as the image changes.
    pub fn forget_records(&mut self) {
        self.shared.store.forget();
    }

    /// Begins a tile of a frame. Returns false if the tile has no pixels or more than [`Self::tile_pixels`],
    /// or as many tiles are in flight as the frame or the chip allows.
    #[must_use]
    pub fn begin(&mut self, memory: &mut impl MemoryPort, frame: &FrameParameters, tile: Tile) -> bool {
        if tile.pixels() == 0 || tile.pixels() > self.tile_pixels(frame) {
            return false;
        }
        let Some(number) = self.vacant(frame) else { return false };
        let is_alone = self.find(|flight| flight.pass() != Pass::Vacant).is_none();
        let Some(flight) = self.flights.values_mut().get_mut(number) else { return false };
        if is_alone {
            memory.begin_tile();
        }
        flight.begin(tile);
        true
    }

    /// Number of a vacant place for a tile in flight.
    fn vacant(&self, frame: &FrameParameters) -> Option<usize> {
        let flights = self.flights.values().iter().take(frame.in_flight.max(1) as usize);
        flights.map(Flight::pass).position(|pass| pass == Pass::Vacant)
    }

    /// Number of the first tile in flight for which something holds.
    fn find(&self, holds: impl Fn(&Flight<K>) -> bool) -> Option<usize> {
        self.flights.values().iter().position(holds)
    }

    /// Begins to do the gathers that wait, as no tile follows. Returns false if there are none.
    pub fn flush(&mut self, frame: &FrameParameters) -> bool {
        let waits = !self.shared.gathers.is_empty();
        if waits && !self.shared.gathers.is_draining() {
            self.begin_drain(frame);
        }
        waits
    }

    /// Does the next pieces of work, about 16 rays and gathers: a card polls its link after each step, which
    /// must be short enough for a prompt reply and long enough to make the cost of polling negligible.
    ///
    /// # Errors
    /// If the image is not sound, or an [`Invariant`] is broken. All tiles should be dropped then.
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

    /// Does the next piece of work, and adds its rays and gathers to `work`: some of the queued gathers, one
    /// sample of a pixel to be completed, or a piece of a pass.
    #[inline(always)]
    fn piece<M: MemoryPort>(&mut self, job: &mut RenderJob<M>, work: &mut u64) -> Result<Progress, Fault> {
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

    /// Begins the next block of a tile in flight, or the gather rays of its pixels. Without one the chip has
    /// room for a tile or must drain its queue.
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

    /// Completes the next sample of a block whose gathers are done. Its last pixels are followed by those
    /// with gather rays, by another block or by the end of the tile.
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

    /// Begins a drain of the queue, which is counted with the tile of its first gather.
    fn begin_drain(&mut self, frame: &FrameParameters) {
        let Some((waiting, first)) = self.shared.gathers.begin_drain(frame.drain) else { return };
        if let Some(flight) = self.flights.values_mut().get_mut(first.target.flight()) {
            flight.counters.drains += 1;
            flight.counters.most_waiting = flight.counters.most_waiting.max(waiting as u64);
        }
    }

    /// Does some of the queued gathers, and adds their radiance to records or pixels.
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
                    shared.sums.add(job.frame, (number, pixel), Component::Indirect, brought)?;
                }
                PointIndex::Record(record) => flight.cache.add(record, request.target.cell(), brought)?,
            }
        }
        Ok(())
    }
}
