//! Rounds of blocks whose gathers wait in card memory ([`Drain::Buckets`]).
//!
//! A round takes the gathers of many blocks, as many as its lines have room for ([`Buckets`]). Then its
//! gathers are done, bucket by bucket, and its blocks are taken up again one after another. Blocks wait in
//! card memory with all of their state, so that a chip with a single tile in flight has many that wait.
//!
//! There are two rounds. While the blocks of a round that waited for irradiance records are completed, those
//! that have pixels with gather rays fill the other round. If it becomes full, its gathers are done first:
//! its blocks wait for pixels alone, and need no further round.
//!
//! A block begins in a round only if all of its gathers, their results and its state have room there: with
//! little memory fewer blocks wait together. Only the first block of a round always begins; those of its
//! gathers that have no room are done at once. [`least_waiting_lines`] is the memory below which a card
//! refuses the frame.
//!
//! [`Buckets`]: crate::gather::Buckets
//! [`Drain::Buckets`]: photoncard_shared::message::Drain::Buckets

mod saved_block;
mod work;

use core::ops::Range;

use heapless::Vec;
use photoncard_shared::budget::{Budget, LEAST_GATHERS_OF_LINE, gather_buckets};
use photoncard_shared::counters::Counters;
use photoncard_shared::message::{Drain, Fault, FrameParameters, Invariant, Tile};

use self::saved_block::most_words;
use super::flight::{MAX_BLOCKS, allowed_error};
use super::position::Block;
use crate::gather::{MAX_BUCKET_LINE, RESULTS_PER_LINE, Results, WrittenResults};
use crate::irradiance_cache::Window;
use crate::kind::{Array, Capacity, Vacant};
use crate::light_groups::LightGroups;
use crate::memory::{Room, WORDS};

/// Rounds of a chip, and the tiles whose blocks wait in them. `W` are the containers for blocks.
pub(super) struct Rounds<W: Capacity> {
    rounds: [Round<W>; 2],
    /// Index of the round that takes gathers.
    filled: usize,
    /// Results, by block of the round whose gathers are being done.
    results: W::Array<Results>,
    tiles: W::Array<OpenTile>,
    phase: Phase,
    /// Blocks that have not begun, of the tile that was put aside because the round had no room for them.
    unfinished: Option<Unfinished>,
    /// Results for the block in flight that were not read yet.
    unread: WrittenResults,
    /// Number in the filled round of the block in flight; `None` if it has no gathers there.
    present: Option<usize>,
    /// Lines of both rounds.
    lines: Range<u32>,
    reserve: Reserve,
    /// Number of lines of a round in which as many blocks as the chip can hold have room.
    ample: u32,
    /// True if both rounds may take gathers at once.
    are_two: bool,
}

/// Lines of a round that its gathers and results leave free.
#[derive(Clone, Copy)]
struct Reserve {
    /// Maximum number of results of a gather: one for each light group.
    results: u64,
    /// Incomplete lines of the buckets.
    buckets: u32,
    /// State of a block, and its incomplete line of results.
    block: u32,
}

/// Work on the gathers of the filled round.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Phase {
    /// Rays are cast, and gathers written.
    Filling,
    /// The incomplete lines of the buckets are written, from this bucket on.
    Closing(usize),
    /// Buckets are read, from this one on, and their gathers done.
    Reading(usize),
}

/// Blocks that wait for gathers, and lines for these.
struct Round<W: Capacity> {
    /// Address of the first line.
    first: u32,
    room: Room,
    gathers: u32,
    /// Number of lines with the states of blocks.
    saved: u32,
    /// Number of blocks that have begun.
    blocks: usize,
    /// Number of blocks that were taken up again.
    resumed: usize,
    /// True from the last gather to the last block.
    is_gathered: bool,
    waiting: W::Array<WaitingBlock>,
}

/// A block in card memory.
#[derive(Clone, Copy)]
struct WaitingBlock {
    /// Address of its saved state.
    state: u32,
    results: WrittenResults,
    /// Number of its tile in [`Rounds::tiles`].
    tile: usize,
}

impl Vacant for WaitingBlock {
    const VACANT: Self = Self { state: 0, results: WrittenResults::NONE, tile: 0 };
}

/// A tile that has begun and has not ended.
struct OpenTile {
    tile: Tile,
    counters: Counters,
    /// Number of its blocks that wait.
    waiting: u32,
    is_open: bool,
}

impl Vacant for OpenTile {
    const VACANT: Self = Self {
        tile: Tile { id: 0, x: 0, y: 0, width: 0, height: 0 },
        counters: Counters::ZERO,
        waiting: 0,
        is_open: false,
    };
}

/// Blocks of a tile that have not begun.
struct Unfinished {
    tile: usize,
    blocks: Vec<Block, MAX_BLOCKS>,
}

impl<W: Capacity> Round<W> {
    const EMPTY: Self = Self {
        first: 0,
        room: Room::NONE,
        gathers: 0,
        saved: 0,
        blocks: 0,
        resumed: 0,
        is_gathered: false,
        waiting: Array::VACANT,
    };

    /// Begins a round in these lines.
    fn begin(&mut self, lines: Range<u32>) {
        self.empty();
        self.first = lines.start;
        self.room = Room::new(lines.start, lines.end.saturating_sub(lines.start));
    }

    /// Returns whether another `gathers` gathers and the states of `blocks` blocks, the present one among
    /// them, have room. The states of other blocks are written.
    fn fits(&self, gathers: u64, blocks: usize, reserve: &Reserve) -> bool {
        let lines = lines_of(u64::from(self.gathers) + gathers, blocks, reserve);
        lines + u64::from(self.saved) <= u64::from(self.room.end().saturating_sub(self.first))
    }

    /// Forgets all blocks.
    fn empty(&mut self) {
        self.room = Room::NONE;
        (self.gathers, self.saved, self.blocks, self.resumed) = (0, 0, 0, 0);
        self.is_gathered = false;
    }

    /// Lines in use.
    fn used(&self) -> Range<u32> {
        self.first..self.room.next().max(self.first)
    }
}

impl<W: Capacity> Rounds<W> {
    pub(super) const fn new() -> Self {
        Self {
            rounds: [Round::EMPTY, Round::EMPTY],
            filled: 0,
            results: Array::VACANT,
            tiles: Array::VACANT,
            phase: Phase::Filling,
            unfinished: None,
            unread: WrittenResults::NONE,
            present: None,
            lines: 0..0,
            reserve: Reserve { results: 0, buckets: 0, block: 0 },
            ample: 0,
            are_two: false,
        }
    }

    /// Sets the number of blocks of a round to `blocks`, if the type leaves it open.
    pub(super) fn reserve(&mut self, blocks: usize) {
        self.results.reserve(blocks);
        self.tiles.reserve(blocks);
        self.rounds.iter_mut().for_each(|round| round.waiting.reserve(blocks));
    }

    /// Drops all tiles and blocks.
    pub(super) fn clear(&mut self) {
        self.tiles.values_mut().iter_mut().for_each(|tile| *tile = OpenTile::VACANT);
        self.results.values_mut().iter_mut().for_each(|results| *results = Results::VACANT);
        self.rounds.iter_mut().for_each(Round::empty);
        self.filled = 0;
        self.phase = Phase::Filling;
        self.unfinished = None;
        self.unread = WrittenResults::NONE;
        self.present = None;
    }

    /// Begins a frame on a chip with `budget`, and drops all tiles. `room` is the range of lines that the
    /// rounds may use. Returns the part of it that they do not use.
    pub(super) fn begin_frame(
        &mut self,
        frame: &FrameParameters,
        budget: &Budget,
        room: Range<u32>,
    ) -> Range<u32> {
        self.clear();
        if frame.drain != Drain::Buckets {
            return room;
        }
        let count = room.end.saturating_sub(room.start);
        // Kept irradiance records, if any, have half of the lines.
        let lines = (if frame.keep_records { count / 2 } else { count })
            .min(MAX_BUCKET_LINE.saturating_sub(room.start));
        self.reserve = Reserve::new(frame, budget);
        let blocks = budget.waiting_blocks.saturating_mul(self.reserve.block);
        self.ample =
            lines_of_queue(budget, &self.reserve).saturating_add(blocks.into()).min(u32::MAX.into()) as u32;
        self.lines = room.start..room.start + lines;
        self.are_two = allowed_error(frame).is_some();
        self.lines.end..room.end
    }

    /// Lines for the filled round: the whole of them if they are not shared, else at most half. If they are
    /// ample, they lie before or after those that the other round uses.
    fn lines_of_round(&self) -> Range<u32> {
        let Range { start, end } = self.lines;
        if !self.are_two {
            return start..end;
        }
        let half = (end - start) / 2;
        // A round has a quarter of the lines at least: the other one has no more than half of them.
        if half / 2 < self.ample {
            return if self.filled == 0 { start..start + half } else { start + half..end };
        }
        let other = self.rounds.get(1 - self.filled.min(1)).filter(|round| round.blocks > 0);
        let used = other.map_or(start..start, Round::used);
        let [below, above] = [used.start - start, end.saturating_sub(used.end)];
        // The lower lines are used again if they are ample, so that an emulated card takes little host
        // memory.
        let ample = (used.end - used.start).saturating_add(self.ample.saturating_mul(2));
        if below >= ample || below > above {
            return start..used.start.min(start + half);
        }
        used.end..end.min(used.end.saturating_add(half))
    }

    fn filled_round(&mut self) -> Option<&mut Round<W>> {
        self.rounds.get_mut(self.filled)
    }

    /// Lines for the next gather of the block in flight; `None` if there is no room for it.
    pub(super) fn room_for_gather(&mut self) -> Option<&mut Room> {
        self.present?;
        let reserve = self.reserve;
        let round = self.filled_round().filter(|round| round.fits(1, round.blocks, &reserve))?;
        round.gathers += 1;
        Some(&mut round.room)
    }

    /// Returns whether the filled round has room for another block with up to `gathers` gathers. The first
    /// block of a round always has room: it may do gathers at once.
    fn has_room(&self, gathers: u64) -> bool {
        self.rounds.get(self.filled).is_some_and(|round| {
            let fits = || round.fits(gathers, round.blocks + 1, &self.reserve);
            round.blocks < round.waiting.values().len() && (round.blocks == 0 || fits())
        })
    }

    /// Number in the filled round of the block in flight, which is a new one if it has none.
    fn take_number(&mut self) -> Option<usize> {
        if self.present.is_none() {
            let lines = self.lines_of_round();
            let round = self.filled_round()?;
            if round.blocks == 0 {
                round.begin(lines);
            }
            round.blocks += 1;
            self.present = Some(round.blocks - 1);
        }
        self.present
    }

    /// Frees the number of the block in flight, which needs no gathers.
    fn release(&mut self) {
        if self.present.take().is_some()
            && let Some(round) = self.filled_round()
        {
            round.blocks = round.blocks.saturating_sub(1);
        }
    }

    /// Index of the round whose blocks are to be taken up again; `None` if no round's gathers are done. The
    /// filled round comes first, as its blocks need no room of the other.
    fn gathered(&self) -> Option<usize> {
        let other = 1 - self.filled.min(1);
        [self.filled, other]
            .into_iter()
            .find(|&round| self.rounds.get(round).is_some_and(|round| round.is_gathered))
    }

    /// Ends the gathers of the filled round. If no other round's blocks wait, the other one is filled next.
    fn end_gathers(&mut self) {
        for (number, results) in self.results.values_mut().iter_mut().enumerate() {
            let round = self.rounds.get_mut(self.filled);
            if let Some(block) = round.and_then(|round| round.waiting.values_mut().get_mut(number)) {
                block.results = results.take();
            }
        }
        let other = 1 - self.filled.min(1);
        self.phase = Phase::Filling;
        if let Some(round) = self.filled_round() {
            round.is_gathered = true;
        }
        if self.rounds.get(other).is_some_and(|round| !round.is_gathered) {
            self.filled = other;
        }
    }

    /// Returns whether the chip has room for another tile.
    pub(super) fn accepts_tile(&self) -> bool {
        self.vacant_tile().is_some()
            && self.phase == Phase::Filling
            && self.unfinished.is_none()
            && self.gathered().is_none()
    }

    /// Returns whether a tile has begun and has not ended.
    pub(super) fn have_tiles(&self) -> bool {
        self.tiles.values().iter().any(|tile| tile.is_open)
    }

    fn vacant_tile(&self) -> Option<usize> {
        self.tiles.values().iter().position(|tile| !tile.is_open)
    }

    /// Opens a tile. Returns its number; `None` if there is no room.
    pub(super) fn open(&mut self, tile: Tile) -> Option<usize> {
        let number = self.vacant_tile()?;
        *self.tiles.values_mut().get_mut(number)? = OpenTile { tile, is_open: true, ..OpenTile::VACANT };
        Some(number)
    }

    fn tile(&mut self, number: usize) -> Result<&mut OpenTile, Fault> {
        self.tiles.values_mut().get_mut(number).ok_or(Invariant::Flight.fault())
    }

    /// Begins to do the gathers of the filled round, because no tile follows. Returns false if no block
    /// waits.
    pub(super) fn flush(&mut self) -> bool {
        let waits = self.present.is_none() && self.filled_round().is_some_and(|round| round.blocks > 0);
        if waits && self.phase == Phase::Filling {
            self.phase = Phase::Closing(0);
        }
        waits
    }
}

impl Reserve {
    fn new(frame: &FrameParameters, budget: &Budget) -> Self {
        let block = most_words(budget, allowed_error(frame).is_some()).div_ceil(WORDS) + 1;
        Self {
            results: LightGroups::of(frame).count() as u64,
            buckets: gather_buckets(budget.gather_queue) as u32,
            block: block as u32,
        }
    }
}

/// Upper bound of the number of lines of a round with `gathers` gathers, without the states of blocks other
/// than the present one. `blocks` is the number of blocks, the present one among them.
fn lines_of(gathers: u64, blocks: usize, reserve: &Reserve) -> u64 {
    let results = gathers * reserve.results;
    let lines = gathers.div_ceil(LEAST_GATHERS_OF_LINE as u64) + results.div_ceil(RESULTS_PER_LINE as u64);
    // Each chain of a bucket or of results has one incomplete line.
    lines + u64::from(reserve.buckets) + blocks as u64 + u64::from(reserve.block)
}

/// Number of lines of a round of one block with as many gathers as the chip's queue holds.
fn lines_of_queue(budget: &Budget, reserve: &Reserve) -> u64 {
    lines_of(budget.gather_queue.into(), 1, reserve)
}

/// Number of lines of card memory after the card image that a chip with `budget` needs to render a frame with
/// gathers that wait there: rounds of one block with as many gathers as the chip's own queue holds. It is 0
/// in other frames.
pub fn least_waiting_lines(frame: &FrameParameters, budget: &Budget) -> u64 {
    if frame.drain != Drain::Buckets || frame.gather_rays == 0 {
        return 0;
    }
    let rounds = if allowed_error(frame).is_some() { 2 } else { 1 };
    let parts = if frame.keep_records { 2 } else { 1 };
    parts * rounds * lines_of_queue(budget, &Reserve::new(frame, budget))
}

/// Upper bound of the number of gathers that a block casts first: those of its irradiance records, or of its
/// pixels in a frame without records.
fn first_gathers(frame: &FrameParameters, budget: &Budget, window: &Window) -> u64 {
    if allowed_error(frame).is_none() {
        return gathers_of_pixels(frame, window.pixels());
    }
    u64::from(frame.gather_rays) * window.most_points().min(budget.irradiance_records.into())
}

/// Upper bound of the number of gathers of `pixels` pixels without adaptive sampling.
fn gathers_of_pixels(frame: &FrameParameters, pixels: u64) -> u64 {
    let planned = if allowed_error(frame).is_some() { frame.planned_samples.max(1) } else { 1 };
    pixels * u64::from(frame.samples) * u64::from(frame.gather_rays).div_ceil(planned.into())
}

#[cfg(test)]
mod tests {
    use std::vec;

    use photoncard_shared::address::Line;
    use photoncard_shared::budget::MOST_GATHERS_OF_LINE;
    use proptest::prelude::*;

    use super::*;
    use crate::gather::{Buckets, GatherRequest, GatherResult, GatherTarget, HilbertCode, PointIndex};
    use crate::kind::Entries;
    use crate::memory::Dram;

    const BUCKETS: usize = 4;
    const BLOCKS: usize = 3;

    /// Number of lines that these gathers, each given by bucket and block, and their results take.
    fn lines_in_use(gathers: &[(usize, usize)]) -> u32 {
        let mut lines = vec![Line::ZERO; 2 + 2 * gathers.len()];
        let (mut memory, mut room) = (Dram::new(&mut lines), Room::new(1, 1 + 2 * gathers.len() as u32));
        let mut buckets = Buckets::<Entries<BUCKETS>>::new();
        buckets.clear();
        let mut held = [GatherRequest::NONE; BUCKETS * MOST_GATHERS_OF_LINE];
        let mut results = [Results::VACANT; BLOCKS];
        for &(bucket, block) in gathers {
            let position = HilbertCode::of_bits((bucket as u64) << 62);
            let target = GatherTarget::of_block(block, PointIndex::Pixel(0));
            let request = GatherRequest { position, target, ..GatherRequest::NONE };
            buckets.add(&mut memory, &mut room, &mut held, request).unwrap();
            let result = GatherResult { target, ..GatherResult::NONE };
            results[block].add(&mut memory, &mut room, result).unwrap();
        }
        (0..BUCKETS).for_each(|bucket| buckets.write(&mut memory, &mut room, &mut held, bucket).unwrap());
        results.iter_mut().for_each(|results| results.write(&mut memory, &mut room).unwrap());
        let mut found = 0;
        for bucket in 0..BUCKETS {
            while buckets
                .read(&mut memory, bucket, |_| {
                    found += 1;
                    Ok(())
                })
                .unwrap()
            {}
        }
        assert_eq!(found, gathers.len());
        room.next() - 1
    }

    proptest! {
        #[test]
        fn gathers_and_results_take_no_more_lines_than_are_reserved(
            gathers in prop::collection::vec((0..BUCKETS, 0..BLOCKS), 0..200),
        ) {
            let reserve = Reserve { results: 1, buckets: BUCKETS as u32, block: 0 };
            prop_assert!(u64::from(lines_in_use(&gathers)) <= lines_of(gathers.len() as u64, BLOCKS, &reserve));
        }
    }
}
