//! State of one card in the scheduler.

use std::collections::VecDeque;
use std::time::Duration;

use photoncard_shared::counters::Counters;
use photoncard_shared::message::Tile;

/// Index of a card among the cards of a render.
pub type CardNumber = usize;

/// Availability of a card for tiles.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Standing {
    /// The card renders tiles.
    Living,
    /// The card is silent, or its link is closed. It may return.
    Lost,
    /// The card is excluded for the rest of the render.
    GivenUp,
}

#[derive(Debug)]
pub(super) struct Card {
    pub(super) standing: Standing,
    /// Tile of which the card sent wrong pixels; `None` if it sent none.
    pub(super) lie: Option<Tile>,
    /// Indices of the tiles assigned to the card. The card works on the first of them, up to its number of
    /// tiles in flight.
    pub(super) tiles: Vec<usize>,
    /// Maximum number of tiles that the card has had at a time.
    pub(super) most_tiles: u32,
    /// Number of tiles that the card receives one at a time, because it was lost with several.
    pub(super) singly: usize,
    /// Indices of the waiting tiles reserved for the card, which rendered them in an earlier pass.
    pub(super) at_home: VecDeque<usize>,
    /// Sum of the counters of the card's tiles that no other card has confirmed.
    pub(super) counters: Counters,
    /// Mean time per ray or gather of the card's slowest tile, seconds.
    pub(super) slowest: Option<f64>,
}

impl Card {
    pub(super) fn new() -> Self {
        Self {
            standing: Standing::Living,
            lie: None,
            tiles: Vec::new(),
            most_tiles: 0,
            singly: 0,
            at_home: VecDeque::new(),
            counters: Counters::ZERO,
            slowest: None,
        }
    }

    /// Raises [`Self::slowest`] to the mean time per ray or gather of a tile, if that is greater.
    pub(super) fn count_time(&mut self, took: Duration, work: &Counters) {
        let rays = work.rays_and_gathers();
        if rays > 0 {
            let seconds = took.as_secs_f64() / rays as f64;
            self.slowest = Some(self.slowest.map_or(seconds, |slowest| slowest.max(seconds)));
        }
    }
}

/// Mean time from the earliest possible start of a tile on its card to its answer.
#[derive(Debug, Default)]
pub(super) struct TileTimes {
    sum: Duration,
    count: u32,
}

impl TileTimes {
    pub(super) fn count(&mut self, took: Duration) {
        self.sum = self.sum.saturating_add(took);
        self.count = self.count.saturating_add(1);
    }

    /// Mean time; `None` before the first tile.
    pub(super) fn mean(&self) -> Option<Duration> {
        self.sum.checked_div(self.count)
    }
}
