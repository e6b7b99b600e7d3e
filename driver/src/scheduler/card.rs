//! What the scheduler knows of a card.

use std::time::Duration;

use photoncard_shared::counters::Counters;
use photoncard_shared::message::Tile;

/// A card, by its place among those of a render.
pub type CardNumber = usize;

/// Whether a card can have tiles.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Standing {
    /// It can.
    Living,
    /// It is silent, or its link is closed: it may come back.
    Lost,
    /// It is used no more.
    GivenUp,
}

/// What the scheduler knows of a card.
#[derive(Debug)]
pub(super) struct Card {
    pub(super) standing: Standing,
    /// The tile that it has lied about.
    pub(super) lie: Option<Tile>,
    /// Indices of the tiles that are at it, the one that it is at first.
    pub(super) tiles: Vec<usize>,
    /// Work on the tiles that the picture has of this card alone.
    pub(super) counters: Counters,
    /// The most seconds that a ray or a gather of a whole tile has taken on average.
    pub(super) slowest: Option<f64>,
}

impl Card {
    pub(super) fn new() -> Self {
        let tiles = Vec::new();
        Self { standing: Standing::Living, lie: None, tiles, counters: Counters::ZERO, slowest: None }
    }

    /// The card has taken so long for a tile of so much work.
    pub(super) fn count_time(&mut self, took: Duration, work: &Counters) {
        let rays = work.rays_and_gathers();
        if rays > 0 {
            let seconds = took.as_secs_f64() / rays as f64;
            self.slowest = Some(self.slowest.map_or(seconds, |slowest| slowest.max(seconds)));
        }
    }
}

/// Times that tiles have taken, until their answers came.
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

    /// The mean; `None` before the first tile.
    pub(super) fn mean(&self) -> Option<Duration> {
        self.sum.checked_div(self.count)
    }
}
