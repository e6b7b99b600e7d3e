//! Load balance of many chips: simulates the scheduler with the render time of each tile of a picture.
//!
//! The real [`Scheduler`] assigns tiles from one queue, with the policy of [`photoncard_cards::session`]. A
//! card has a number of credits, one for each tile command that may be unanswered. When the host serves a
//! card, it sends a tile for each free credit. A chip renders its tiles in the order of arrival. A tile frees
//! its credit when its result arrives at the host. A chip is done with a tile when it has rendered it; the
//! time to send the result belongs to the link.
//!
//! Times are whole nanoseconds, and simultaneous events happen in the order of the chips, so that a
//! simulation gives the same result on every machine.

use std::cmp::Reverse;
use std::collections::BinaryHeap;
use std::time::Duration;

use photoncard_cards::scheduler::Scheduler;
use photoncard_firmware::sampler::hash;
use photoncard_picture::sink::FinishedTile;
use photoncard_picture::sums::SumFormat;
use photoncard_shared::counters::Counters;
use photoncard_shared::message::{PIXEL_BYTES, Tile};

/// Model of the chips' links. One host serves all of them, one message at a time.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct LinkModel {
    /// Time that the host takes for a tile command, seconds.
    pub(crate) command_seconds: f64,
    /// Time that the host takes for the result of a tile (pixels and final message), seconds.
    pub(crate) result_seconds: f64,
    /// Latency of any message, seconds.
    pub(crate) latency_seconds: f64,
}

/// Number of chips, credits of each chip, and links.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Setup {
    pub(crate) chips: usize,
    /// Maximum number of unanswered tile commands per chip
    /// ([`Budget::tiles`](photoncard_shared::budget::Budget::tiles)).
    pub(crate) credits: usize,
    pub(crate) link: LinkModel,
}

/// Error of [`simulate`].
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub(crate) enum LoadBalanceError {
    /// The picture has no tiles.
    #[error("there are no tiles to deal; give the cost of one at least")]
    NoTiles,
    /// The machine has no chips or no credits.
    #[error("{chips} chips of {credits} credits render nothing; give one of each at least")]
    NoChips {
        chips: usize,
        /// Maximum number of unanswered tile commands per chip.
        credits: usize,
    },
    /// A time is negative, above [`MAX_SECONDS`] or NaN.
    #[error("{0} is no time; give seconds from 0 to {MAX_SECONDS}")]
    Time(f64),
}

/// Maximum time of a tile or a message, seconds. Sums of nanoseconds stay exact below this limit.
pub(crate) const MAX_SECONDS: f64 = 1e9;

/// Result of a simulation that begins at time 0, when the host assigns the first tile.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Balance {
    /// Time when the host has the last result, seconds.
    pub(crate) makespan_seconds: f64,
    /// Time to render all tiles on one chip, without links, seconds.
    pub(crate) work_seconds: f64,
    /// Time when each chip is done with its last tile, seconds; 0 for a chip without tiles.
    pub(crate) chip_seconds: Vec<f64>,
    /// Time that the host spent on messages, seconds.
    pub(crate) host_seconds: f64,
    /// Maximum number of tiles that were assigned and unanswered at the same time, over all chips.
    pub(crate) most_in_flight: usize,
    /// Index of the chip that rendered each tile, in the picture's order.
    pub(crate) chip_of_tile: Vec<usize>,
}

impl Balance {
    /// Speed-up over one chip without links: `work / makespan`.
    pub(crate) fn speedup(&self) -> f64 {
        if self.makespan_seconds > 0.0 { self.work_seconds / self.makespan_seconds } else { 1.0 }
    }

    /// Parallel efficiency, `speedup / chips`: fraction of the makespan that chips spend on rendering, on
    /// average.
    pub(crate) fn efficiency(&self) -> f64 {
        self.speedup() / self.chip_seconds.len() as f64
    }

    /// Idle fraction, `1 - efficiency`: fraction of the makespan that chips spend on waiting, on average, for
    /// tiles or for the last chip to finish.
    pub(crate) fn idle_share(&self) -> f64 {
        1.0 - self.efficiency()
    }
}

/// Simulates the assignment of a picture's tiles to chips.
///
/// `costs` are the seconds that a chip takes for each tile, in the picture's order.
///
/// # Errors
/// If there are no tiles, no chips or no credits, or a time is negative, above [`MAX_SECONDS`] or NaN.
pub(crate) fn simulate(costs: &[f64], order: TileOrder, setup: &Setup) -> Result<Balance, LoadBalanceError> {
    let &Setup { chips, credits, link } = setup;
    if costs.is_empty() {
        return Err(LoadBalanceError::NoTiles);
    }
    if chips == 0 || credits == 0 {
        return Err(LoadBalanceError::NoChips { chips, credits });
    }
    let costs: Vec<u128> = costs.iter().map(|&cost| nanoseconds(cost)).collect::<Result<_, _>>()?;
    let mut simulation = Simulation {
        scheduler: Scheduler::new(order.tiles(&costs), chips),
        credits,
        command: nanoseconds(link.command_seconds)?,
        result: nanoseconds(link.result_seconds)?,
        latency: nanoseconds(link.latency_seconds)?,
        chips: vec![Chip::default(); chips],
        chip_of_tile: vec![0; costs.len()],
        costs,
        results: BinaryHeap::new(),
        now: 0,
        busy: 0,
        most_in_flight: 0,
    };
    simulation.run();
    Ok(simulation.balance())
}

#[derive(Clone, Copy, Default)]
struct Chip {
    /// Number of tiles that are assigned and unanswered.
    tiles: usize,
    /// Time when the chip is done with its tiles, nanoseconds.
    done: u128,
}

/// State of the simulation. Times are in nanoseconds.
struct Simulation {
    scheduler: Scheduler,
    credits: usize,
    command: u128,
    result: u128,
    latency: u128,
    costs: Vec<u128>,
    chips: Vec<Chip>,
    chip_of_tile: Vec<usize>,
    /// Queue of results in transit. Each has the time of arrival at the host, the chip and the tile.
    results: BinaryHeap<Reverse<(u128, usize, u32)>>,
    /// Time up to which the host has worked or waited.
    now: u128,
    /// Time that the host has spent on messages.
    busy: u128,
    most_in_flight: usize,
}

impl Simulation {
    fn run(&mut self) {
        for chip in 0..self.chips.len() {
            self.deal(chip);
        }
        // The result of a tile arrives later than the result that freed the tile's credit. No new result can
        // therefore precede a result that was already handled.
        while let Some(Reverse((arrival, chip, id))) = self.results.pop() {
            self.now = self.now.max(arrival) + self.result;
            self.busy += self.result;
            self.chips[chip].tiles -= 1;
            self.receive(chip, id);
            self.deal(chip);
        }
    }

    /// Handles the arrival of a result. The scheduler's clock, which only matters for lost or late cards, is
    /// not used.
    fn receive(&mut self, chip: usize, id: u32) {
        let finished = FinishedTile::new(tile(id), vec![0; PIXEL_BYTES], SumFormat::ONE, Counters::ZERO);
        if let Some(tile) = finished {
            self.scheduler.answer(chip, tile, Duration::ZERO);
            self.scheduler.complete(id);
        }
    }

    /// Sends tiles to a chip until it has no free credit, as a session does.
    fn deal(&mut self, chip: usize) {
        while self.chips[chip].tiles < self.credits {
            let Some(assignment) = self.scheduler.take(chip, Duration::ZERO) else { break };
            let id = assignment.tile.id;
            self.now += self.command;
            self.busy += self.command;
            let at = &mut self.chips[chip];
            at.tiles += 1;
            at.done = at.done.max(self.now + self.latency) + self.costs[id as usize];
            self.results.push(Reverse((at.done + self.latency, chip, id)));
            self.chip_of_tile[id as usize] = chip;
        }
        // Each tile that is dealt and unanswered has a result in transit.
        self.most_in_flight = self.most_in_flight.max(self.results.len());
    }

    fn balance(self) -> Balance {
        Balance {
            makespan_seconds: seconds(self.now),
            work_seconds: seconds(self.costs.iter().sum()),
            chip_seconds: self.chips.iter().map(|chip| seconds(chip.done)).collect(),
            host_seconds: seconds(self.busy),
            most_in_flight: self.most_in_flight,
            chip_of_tile: self.chip_of_tile,
        }
    }
}

fn nanoseconds(seconds: f64) -> Result<u128, LoadBalanceError> {
    if !(0.0..=MAX_SECONDS).contains(&seconds) {
        return Err(LoadBalanceError::Time(seconds));
    }
    Ok((seconds * 1e9).round() as u128)
}

fn seconds(nanoseconds: u128) -> f64 {
    nanoseconds as f64 / 1e9
}

/// Order in which tiles are assigned to chips.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) enum TileOrder {
    /// Row by row, as the driver assigns tiles if it models the chips' memory.
    #[default]
    Picture,
    /// Random permutation with this seed.
    Random(u32),
    /// Descending cost (Graham 1969). Costs are known only after the render, so that no scheduler can use
    /// this order; it gives a bound.
    LongestFirst,
}

impl TileOrder {
    /// Returns one tile for each of `costs`, in the order `self`. A tile's number is its index in `costs`.
    fn tiles(self, costs: &[u128]) -> Vec<Tile> {
        let mut tiles: Vec<Tile> = (0_u32..).zip(costs).map(|(id, _)| tile(id)).collect();
        match self {
            Self::Picture => {}
            // The hash is a bijection, so that there are no ties.
            Self::Random(seed) => tiles.sort_by_key(|tile| (hash(hash(seed) ^ tile.id), tile.id)),
            // The sort is stable: tiles of equal cost stay in the picture's order.
            Self::LongestFirst => tiles.sort_by_key(|tile| Reverse(costs[tile.id as usize])),
        }
        tiles
    }
}

/// Tile number `id`. Its rectangle is not used.
fn tile(id: u32) -> Tile {
    Tile { id, x: id, y: 0, width: 1, height: 1 }
}

#[cfg(test)]
mod tests;
