//! Work of a chip in rounds: which block proceeds, and the gathers of a round.

use glam::Vec3;
use photoncard_shared::address::{Stage, Structure};
use photoncard_shared::message::{Drain, Fault, FrameParameters, Invariant};

use super::super::flight::{Flight, allowed_error};
use super::super::light::Component;
use super::super::position::Pass;
use super::super::{Chip, GATHERS_PER_PIECE, Progress};
use super::{OpenTile, Phase, Unfinished, WaitingBlock, first_gathers, gathers_of_pixels};
use crate::gather::{GatherResult, PointIndex, WrittenResults};
use crate::kind::{Array, ChipKind, Vacant};
use crate::light_groups::LightGroups;
use crate::memory::{MemoryPort, WordReader, WordWriter, Work};
use crate::render::RenderJob;

/// Index of the only tile in flight in a frame that is rendered in rounds.
const FLIGHT: usize = 0;
/// Maximum number of buckets, or of lines of gathers, that one piece of work writes or reads.
const LINES_PER_PIECE: usize = 16;

impl<K: ChipKind> Chip<K> {
    /// Does the next piece of work of a frame in rounds.
    #[inline(never)]
    pub(in super::super) fn piece_in_rounds<M: MemoryPort>(
        &mut self,
        job: &mut RenderJob<M>,
        work: &mut u64,
    ) -> Result<Progress, Fault> {
        match self.shared.rounds.phase {
            Phase::Filling => {}
            Phase::Closing(bucket) => return self.close_buckets(job, bucket),
            Phase::Reading(bucket) => return self.read_buckets(job, bucket, work),
        }
        if !self.shared.rounds.unread.is_empty() {
            return self.take_results(job);
        }
        let flight = self.flights.values().get(FLIGHT).ok_or(Invariant::Flight.fault())?;
        match flight.pass() {
            Pass::Vacant => self.choose_block(job),
            Pass::NextBlock => self.begin_next_block(job.frame),
            Pass::NextPixels => self.begin_pixels_in_round(job.frame),
            Pass::WaitForRecords | Pass::Wait if flight.waiting > 0 => self.save_block(job),
            Pass::WaitForRecords | Pass::Wait | Pass::CompletePlain | Pass::Complete => {
                self.complete(job, FLIGHT, work)
            }
            pass => self.go_on_with_pass(job, FLIGHT, pass, work),
        }
    }

    fn only_flight(&mut self) -> Result<&mut Flight<K>, Fault> {
        self.flights.values_mut().get_mut(FLIGHT).ok_or(Invariant::Flight.fault())
    }

    /// Takes up the next block: one whose gathers are done, or one that was put aside. If there is none, the
    /// chip is idle; if the round has no room for a tile, its gathers are done.
    fn choose_block<M: MemoryPort>(&mut self, job: &mut RenderJob<M>) -> Result<Progress, Fault> {
        let budget = *self.kind.budget();
        let rounds = &mut self.shared.rounds;
        if let Some(index) = rounds.gathered() {
            return self.choose_gathered(job, index);
        }
        let rest = rounds.unfinished.as_ref();
        let next = rest.and_then(|rest| Some((rounds.tiles.values().get(rest.tile)?, rest.blocks.last()?)));
        let gathers =
            next.map_or(0, |(open, block)| first_gathers(job.frame, &budget, &block.window(&open.tile)));
        let has_room = rounds.has_room(gathers);
        if rounds.unfinished.is_some() && has_room {
            return self.resume_unfinished();
        }
        let is_idle = rounds.unfinished.is_none() && has_room && rounds.accepts_tile();
        Ok(if is_idle || !rounds.flush() { Progress::Idle } else { Progress::Busy })
    }

    /// Takes up the next block of a round whose gathers are done. If its pixels' gathers have no room in the
    /// other round, does those that wait there first.
    fn choose_gathered<M: MemoryPort>(
        &mut self,
        job: &mut RenderJob<M>,
        index: usize,
    ) -> Result<Progress, Fault> {
        let rounds = &mut self.shared.rounds;
        let round = rounds.rounds.get_mut(index).ok_or(Invariant::Flight.fault())?;
        if round.resumed == round.blocks {
            round.empty();
            return Ok(Progress::Busy);
        }
        let block = round.waiting.values().get(round.resumed).copied().ok_or(Invariant::Flight.fault())?;
        let of_pixels = gathers_of_pixels(job.frame, rounds.tile(block.tile)?.tile.pixels());
        if index == rounds.filled || allowed_error(job.frame).is_none() || rounds.has_room(of_pixels) {
            let round = rounds.rounds.get_mut(index).ok_or(Invariant::Flight.fault())?;
            round.resumed += 1;
            self.restore_block(job, block)?;
        } else {
            rounds.phase = Phase::Closing(0);
        }
        Ok(Progress::Busy)
    }

    fn resume_unfinished(&mut self) -> Result<Progress, Fault> {
        let Some(Unfinished { tile: number, blocks }) = self.shared.rounds.unfinished.take() else {
            return Ok(Progress::Busy);
        };
        let OpenTile { tile, counters, .. } = *self.shared.rounds.tile(number)?;
        self.only_flight()?.resume(tile, counters, number, blocks);
        Ok(Progress::Busy)
    }

    /// Begins the next block of the tile in flight, or puts the tile aside if the round has no room for it.
    fn begin_next_block(&mut self, frame: &FrameParameters) -> Result<Progress, Fault> {
        let budget = *self.kind.budget();
        let window = self.only_flight()?.window_of_next_block();
        let rounds = &mut self.shared.rounds;
        let gathers = first_gathers(frame, &budget, &window);
        // A block that was halved leaves its number to its first half.
        if rounds.present.is_none() && !rounds.has_room(gathers) {
            return self.leave_tile();
        }
        let number = rounds.take_number();
        let flight = self.only_flight()?;
        flight.block_number = number;
        flight.begin_block(frame)?;
        Ok(Progress::Busy)
    }

    fn begin_pixels_in_round(&mut self, frame: &FrameParameters) -> Result<Progress, Fault> {
        self.shared.sums.begin(FLIGHT);
        let number = self.shared.rounds.take_number();
        let flight = self.only_flight()?;
        flight.block_number = number;
        flight.begin_pixels(frame);
        Ok(Progress::Busy)
    }

    /// Writes the block in flight into card memory, where it waits for its gathers.
    fn save_block<M: MemoryPort>(&mut self, job: &mut RenderJob<M>) -> Result<Progress, Fault> {
        let broken = Invariant::Flight.fault();
        let Self { flights, shared, .. } = self;
        let flight = flights.values_mut().get_mut(FLIGHT).ok_or(broken)?;
        let number = shared.rounds.present.take().ok_or(broken)?;
        let tile = flight.tile_number;
        let round = shared.rounds.filled_round().ok_or(broken)?;
        let state = round.room.next();
        job.memory.enter(Stage::Gather);
        let words = &mut WordWriter::new(job.memory, &mut round.room);
        flight.save(job.frame, &shared.sums, FLIGHT, words)?;
        round.saved += round.room.next() - state;
        let block = round.waiting.values_mut().get_mut(number).ok_or(broken)?;
        *block = WaitingBlock { state, results: WrittenResults::NONE, tile };
        shared.rounds.tile(tile)?.waiting += 1;
        shared.sums.end(FLIGHT);
        self.leave_tile()
    }

    /// Reads a block back, whose gathers are done.
    fn restore_block<M: MemoryPort>(
        &mut self,
        job: &mut RenderJob<M>,
        block: WaitingBlock,
    ) -> Result<(), Fault> {
        let Self { flights, shared, .. } = self;
        let flight = flights.values_mut().get_mut(FLIGHT).ok_or(Invariant::Flight.fault())?;
        let open = shared.rounds.tile(block.tile)?;
        open.waiting = open.waiting.checked_sub(1).ok_or(Invariant::Waiting.fault())?;
        flight.resume(open.tile, open.counters, block.tile, heapless::Vec::new());
        shared.rounds.unread = block.results;
        job.memory.enter(Stage::Gather);
        let words = &mut WordReader::new(job.memory, Structure::Waiting, block.state);
        flight.restore(job.frame, &mut shared.sums, FLIGHT, words)
    }

    /// Adds the next results to the sums of the block in flight.
    fn take_results<M: MemoryPort>(&mut self, job: &mut RenderJob<M>) -> Result<Progress, Fault> {
        let Self { flights, shared, .. } = self;
        let flight = flights.values_mut().get_mut(FLIGHT).ok_or(Invariant::Flight.fault())?;
        let (frame, sums) = (job.frame, &mut shared.sums);
        job.memory.enter(Stage::Gather);
        let groups = LightGroups::of(frame);
        shared.rounds.unread.read(job.memory, |GatherResult { target, light_group, brought }| {
            let brought = groups.light(light_group, brought);
            match target.block_and_point().1 {
                PointIndex::Pixel(pixel) => sums.add(frame, (FLIGHT, pixel), Component::Indirect, &brought),
                PointIndex::Record(record) => flight.cache.add(record, target.cell(), &brought),
            }
        })?;
        Ok(Progress::Busy)
    }

    /// Ends the work on a block that is complete or waits. Puts the tile's other blocks aside.
    fn leave_tile(&mut self) -> Result<Progress, Fault> {
        let Self { flights, shared, .. } = self;
        let flight = flights.values_mut().get_mut(FLIGHT).ok_or(Invariant::Flight.fault())?;
        shared.rounds.tile(flight.tile_number)?.counters = flight.counters;
        if flight.has_blocks() {
            shared.rounds.unfinished =
                Some(Unfinished { tile: flight.tile_number, blocks: flight.take_blocks() });
        }
        flight.vacate();
        Ok(Progress::Busy)
    }

    /// Ends the completed block in flight, and its tile if the block was the last.
    pub(in super::super) fn end_block_in_rounds(&mut self) -> Result<Progress, Fault> {
        self.shared.rounds.release();
        let Self { flights, shared, .. } = self;
        let flight = flights.values_mut().get_mut(FLIGHT).ok_or(Invariant::Flight.fault())?;
        let number = flight.tile_number;
        let is_put_aside = shared.rounds.unfinished.as_ref().is_some_and(|rest| rest.tile == number);
        let open = shared.rounds.tile(number)?;
        if open.waiting > 0 || is_put_aside || flight.has_blocks() {
            return self.leave_tile();
        }
        *open = OpenTile::VACANT;
        flight.vacate();
        Ok(Progress::Tile(flight.tile.id, flight.counters))
    }

    /// Writes the incomplete lines of the next buckets, from `first` on.
    fn close_buckets<M: MemoryPort>(
        &mut self,
        job: &mut RenderJob<M>,
        first: usize,
    ) -> Result<Progress, Fault> {
        let end = self.shared.gathers.buckets().min(first + LINES_PER_PIECE);
        job.memory.enter(Stage::Gather);
        let round = self.shared.rounds.filled_round().ok_or(Invariant::Flight.fault())?;
        for bucket in first..end {
            self.shared.gathers.close_bucket(job.memory, &mut round.room, bucket)?;
        }
        let is_last = end == self.shared.gathers.buckets();
        if is_last {
            self.shared.gathers.clear();
            job.memory.begin_work(Work::Gathering);
        }
        self.shared.rounds.phase = if is_last { Phase::Reading(0) } else { Phase::Closing(end) };
        Ok(Progress::Busy)
    }

    /// Does the next gathers of the round. Without any in the queue, reads further buckets, from `bucket` on.
    fn read_buckets<M: MemoryPort>(
        &mut self,
        job: &mut RenderJob<M>,
        mut bucket: usize,
        work: &mut u64,
    ) -> Result<Progress, Fault> {
        if self.shared.gathers.is_draining() {
            self.do_gathers_of_round(job)?;
            *work += GATHERS_PER_PIECE;
            return Ok(Progress::Busy);
        }
        job.memory.enter(Stage::Gather);
        let gathers = &mut self.shared.gathers;
        for _ in 0..LINES_PER_PIECE {
            if bucket == gathers.buckets() || !gathers.has_room_for_line(job.frame) {
                break;
            }
            bucket += usize::from(!gathers.read_bucket(job.memory, bucket)?);
        }
        let is_last = bucket == gathers.buckets();
        self.shared.rounds.phase = Phase::Reading(bucket);
        if is_last || !self.shared.gathers.has_room_for_line(job.frame) {
            self.begin_drain_of_round()?;
        }
        if is_last && self.shared.gathers.is_empty() {
            self.end_gathers_of_round(job)?;
        }
        Ok(Progress::Busy)
    }

    /// Sorts the gathers in the queue. The drain is counted for the tile of the first gather.
    fn begin_drain_of_round(&mut self) -> Result<(), Fault> {
        let Self { shared, .. } = self;
        let Some((_, first)) = shared.gathers.begin_drain(Drain::Buckets) else { return Ok(()) };
        let (block, _) = first.target.block_and_point();
        let round = shared.rounds.filled_round().ok_or(Invariant::Flight.fault())?;
        let waiting = round.gathers.into();
        let tile = round.waiting.values().get(block).ok_or(Invariant::Flight.fault())?.tile;
        let counters = &mut shared.rounds.tile(tile)?.counters;
        counters.drains += 1;
        counters.most_waiting = counters.most_waiting.max(waiting);
        Ok(())
    }

    fn do_gathers_of_round<M: MemoryPort>(&mut self, job: &mut RenderJob<M>) -> Result<(), Fault> {
        let broken = Invariant::Flight.fault();
        let shared = &mut self.shared;
        for _ in 0..GATHERS_PER_PIECE {
            let Some(request) = shared.gathers.take() else { break };
            let (block, _) = request.target.block_and_point();
            let round = shared.rounds.filled_round().ok_or(broken)?;
            let tile = round.waiting.values().get(block).ok_or(broken)?.tile;
            let context = &mut job.context(&mut shared.rounds.tile(tile)?.counters);
            let brought = shared.gathers.gather(context, &request)?;
            let rounds = &mut shared.rounds;
            let round = rounds.rounds.get_mut(rounds.filled).ok_or(broken)?;
            let results = rounds.results.values_mut().get_mut(block).ok_or(broken)?;
            let (groups, target) = (LightGroups::of(job.frame), request.target);
            for (light_group, brought) in (0..).zip(brought.groups(groups)) {
                // A group without light has no result, unless it is the only one.
                if groups.is_one() || brought != Vec3::ZERO {
                    let result = GatherResult { target, light_group, brought };
                    results.add(job.memory, &mut round.room, result)?;
                }
            }
        }
        Ok(())
    }

    /// Writes the incomplete lines of results, after the last gather of the round.
    fn end_gathers_of_round<M: MemoryPort>(&mut self, job: &mut RenderJob<M>) -> Result<(), Fault> {
        let rounds = &mut self.shared.rounds;
        let round = rounds.rounds.get_mut(rounds.filled).ok_or(Invariant::Flight.fault())?;
        for results in rounds.results.values_mut() {
            results.write(job.memory, &mut round.room)?;
        }
        rounds.end_gathers();
        self.shared.gathers.empty_buckets();
        job.memory.begin_work(Work::Casting);
        Ok(())
    }
}
