//! Which card renders which tile.
//!
//! Tiles wait in one queue. A card with a free credit takes the next one; no card waits for another, and results come in
//! any order. A tile's pixels do not depend on who renders it, nor when.
//!
//! - A tile that is to be verified is rendered by a second card as soon as one is free. If they differ, a third decides; what
//!   the odd one has rendered alone is rendered again.
//! - A tile that two cards have crashed at is set apart until all others are done, then goes to the cards that have crashed at
//!   it least, and is abandoned after five crashes.
//! - When nothing waits, an idle card takes the tile that has been at another for the longest time, if that is longer than tiles
//!   take. The first answer wins.
//!
//! The scheduler has no thread, lock or clock: [`crate::dispatcher`] is between it, sessions and sinks.

mod card;
mod dealing;
mod ending;
mod entry;
mod error;
#[cfg(test)]
mod tests;
mod tiles;

pub use self::card::{CardNumber, Standing};
pub(crate) use self::error::rectangles;
pub use self::error::{SchedulerError, Source};
pub use self::tiles::{GatherOrder, tiles};

use std::collections::{HashMap, VecDeque};
use std::time::Duration;

use photoncard_firmware::sampler::hash;
use photoncard_shared::counters::Counters;
use photoncard_shared::message::Tile;

use self::card::{Card, TileTimes};
use self::entry::{Answer, Entry, Judgement, Progress};
use crate::film::Film;
use crate::sink::FinishedTile;

/// Crashes after which a tile is set apart.
const CRASHES_APART: usize = 2;
/// Crashes after which a tile is abandoned.
const MAX_CRASHES: usize = 5;
/// How much longer than on average of its slowest tile a ray may take a card.
const SLOWER_THAN_BEFORE: f64 = 50.0;
/// How much longer than on the slowest other card, as long as a card has rendered no tile: a Cortex-M4F takes some 400 times
/// as long as a chip that a desktop computer emulates.
const SLOWER_THAN_OTHERS: f64 = 1000.0;

/// The tiles of a picture, and how far they are.
#[derive(Debug)]
pub struct Scheduler {
    entries: Vec<Entry>,
    by_id: HashMap<u32, usize>,
    /// Tiles that no card has, the next first.
    waiting: VecDeque<usize>,
    /// Tiles with an answer that wait for another card's.
    compared: VecDeque<usize>,
    /// Open tiles that cards have crashed at too often to be given to others before the end.
    set_apart: Vec<usize>,
    cards: Vec<Card>,
    has_helpers: bool,
    /// Before then no tile is at a card for too long.
    next_help: Duration,
    /// Since when no card can go on, though some are left.
    stuck_since: Option<Duration>,
    times: TileTimes,
    /// Work on tiles that were verified.
    verified_work: Counters,
    done: usize,
    counts: TileCounts,
}

/// Tiles that were more to render than a picture has.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct TileCounts {
    /// Tiles that an earlier render has left, but for those that are verified.
    pub kept: usize,
    /// Tiles that two cards agree on.
    pub verified: usize,
    /// Tiles that were rendered once more: to verify them, or by an idle card.
    pub repeated: usize,
    /// Tiles that were taken back, as their card has lied.
    pub revoked: usize,
}

/// What an answer has led to.
#[derive(Debug, Default)]
pub struct Answered {
    /// A tile for the sinks; [`Scheduler::complete`] tells that they have it.
    pub found: Option<FinishedTile>,
    /// Cards that have lied about that tile: for [`Scheduler::expel`].
    pub liars: Vec<CardNumber>,
    /// What ends the render.
    pub fault: Option<SchedulerError>,
}

impl Scheduler {
    /// All tiles wait for so many cards.
    pub fn new(tiles: Vec<Tile>, cards: usize) -> Self {
        Self {
            by_id: tiles.iter().zip(0..).map(|(tile, index)| (tile.id, index)).collect(),
            waiting: (0..tiles.len()).collect(),
            entries: tiles.into_iter().map(Entry::new).collect(),
            compared: VecDeque::new(),
            set_apart: Vec::new(),
            cards: (0..cards).map(|_| Card::new()).collect(),
            has_helpers: false,
            next_help: Duration::ZERO,
            stuck_since: None,
            times: TileTimes::default(),
            verified_work: Counters::ZERO,
            done: 0,
            counts: TileCounts::default(),
        }
    }

    /// Lets idle cards render what has been at others for too long.
    #[must_use]
    pub fn with_helpers(self) -> Self {
        Self { has_helpers: true, ..self }
    }

    /// Has a share of the tiles rendered by two cards, one tile at least. Which ones is up to the seed.
    #[must_use]
    pub fn verifying(mut self, share: f64, seed: u32) -> Self {
        let chance = |entry: &Entry| hash(hash(seed) ^ entry.tile.id);
        let least = self.entries.iter().map(chance).min();
        for entry in &mut self.entries {
            let chance = hash(hash(seed) ^ entry.tile.id);
            entry.is_verified = f64::from(chance) < share * 2_f64.powi(32) || least == Some(chance);
        }
        self
    }

    /// Takes over the tiles that are in a film. Those that are to be verified are compared with what a card renders.
    #[must_use]
    pub fn with_kept(mut self, film: &Film) -> Self {
        for (index, entry) in self.entries.iter_mut().enumerate() {
            let Some(tile) = film.finished(&entry.tile) else { continue };
            if entry.is_verified {
                entry.answers.push(Answer { source: Source::Kept, tile });
                self.compared.push_back(index);
            } else {
                entry.progress = Progress::Done(None);
                self.done += 1;
                self.counts.kept += 1;
            }
        }
        let entries = &self.entries;
        self.waiting.retain(|&index| entries[index].is_open() && entries[index].answers.is_empty());
        self
    }

    /// A card has rendered a tile.
    pub fn answer(&mut self, card: CardNumber, tile: FinishedTile, now: Duration) -> Answered {
        let Some((index, since)) = self.remove_copy(card, tile.tile().id, now) else {
            return Answered::default();
        };
        let took = now.saturating_sub(since);
        self.times.count(took);
        let at = &mut self.cards[card];
        at.count_time(took, &tile.counters);
        let entry = &mut self.entries[index];
        if !entry.is_open() || at.standing == Standing::GivenUp {
            self.counts.repeated += 1;
            return Answered::default();
        }
        if !entry.is_verified {
            entry.progress = Progress::Found(Some(card));
            at.counters.add(&tile.counters);
            return Answered { found: Some(tile), ..Answered::default() };
        }
        if entry.answers.is_empty() {
            self.compared.push_back(index);
        } else {
            self.counts.repeated += 1;
        }
        entry.answers.push(Answer { source: Source::Card(card), tile });
        self.judge(index)
    }

    /// Compares the answers to a tile.
    fn judge(&mut self, index: usize) -> Answered {
        let entry = &mut self.entries[index];
        let Some(Judgement { tile, was_kept, liars }) = entry.judge() else { return Answered::default() };
        self.counts.verified += 1;
        entry.progress = Progress::Found(None);
        let fault = liars.contains(&Source::Kept).then_some(SchedulerError::KeptDiffers { tile: entry.tile });
        if was_kept {
            entry.progress = Progress::Done(None);
            self.done += 1;
        } else {
            self.verified_work.add(&tile.counters);
        }
        let liars = liars.into_iter().filter_map(Source::card).collect();
        Answered { found: (!was_kept).then_some(tile), liars, fault }
    }

    /// The sinks have a tile.
    pub fn complete(&mut self, id: u32) {
        let Some(entry) = self.by_id.get(&id).map(|&index| &mut self.entries[index]) else { return };
        if let Progress::Found(source) = entry.progress {
            entry.progress = Progress::Done(source);
            self.done += 1;
        }
    }

    /// A tile is not at a card any more, which has not rendered it: the next card takes it before all others, as it has waited
    /// longest. `has_crashed` says that the card was at work on it.
    pub fn give_back(&mut self, card: CardNumber, id: u32, has_crashed: bool, now: Duration) {
        let Some((index, _)) = self.remove_copy(card, id, now) else { return };
        let entry = &mut self.entries[index];
        if !entry.is_open() {
            return;
        }
        if has_crashed && self.cards[card].lie.is_none() {
            entry.crashes.push(card);
        }
        if entry.crashes.len() >= MAX_CRASHES {
            entry.progress = Progress::Abandoned;
        } else if entry.copies.is_empty() && entry.answers.is_empty() {
            if entry.crashes.len() < CRASHES_APART {
                self.waiting.push_front(index);
            } else {
                self.set_apart.push(index);
            }
        }
    }

    /// Takes a tile from a card. Returns its index, and since when it was there.
    fn remove_copy(&mut self, card: CardNumber, id: u32, now: Duration) -> Option<(usize, Duration)> {
        let index = *self.by_id.get(&id)?;
        let copies = &mut self.entries[index].copies;
        let copy = copies.iter().position(|copy| copy.card == card)?;
        let since = copies.remove(copy).since;
        let tiles = &mut self.cards[card].tiles;
        tiles.retain(|&tile| tile != index);
        // Not before now can the card have begun with the next.
        if let Some(&next) = tiles.first() {
            let copies = &mut self.entries[next].copies;
            copies
                .iter_mut()
                .filter(|copy| copy.card == card)
                .for_each(|copy| copy.since = copy.since.max(now));
        }
        Some((index, since))
    }

    /// Tells how a card stands.
    pub fn set_standing(&mut self, card: CardNumber, standing: Standing) {
        if self.cards[card].standing != Standing::GivenUp {
            self.cards[card].standing = standing;
        }
    }

    /// How a card stands.
    pub fn standing(&self, card: CardNumber) -> Standing {
        self.cards[card].standing
    }

    /// Whether any card can have tiles.
    pub fn has_living(&self) -> bool {
        self.living().next().is_some()
    }

    /// The tile that a card has lied about.
    pub fn lie_of(&self, card: CardNumber) -> Option<Tile> {
        self.cards[card].lie
    }

    /// Gives up a card that has lied about a tile, and all that it alone has rendered. Returns the tiles that the sinks are to
    /// forget. None of this card may be on its way to them.
    pub fn expel(&mut self, card: CardNumber, about: Tile) -> Vec<Tile> {
        self.cards[card].standing = Standing::GivenUp;
        self.cards[card].lie = Some(about);
        self.cards[card].counters = Counters::ZERO;
        let mut revoked = Vec::new();
        for (index, entry) in self.entries.iter_mut().enumerate() {
            if entry.progress == Progress::Done(Some(card)) {
                entry.progress = Progress::Open;
                self.done -= 1;
                self.waiting.push_back(index);
                revoked.push(entry.tile);
            } else if entry.is_open() && entry.has_answer_of(card) {
                entry.answers.retain(|answer| answer.source != Source::Card(card));
                if entry.answers.is_empty() {
                    self.compared.retain(|&compared| compared != index);
                    if entry.copies.is_empty() {
                        self.waiting.push_back(index);
                    }
                }
            }
        }
        self.counts.revoked += revoked.len();
        revoked
    }

    /// The most seconds that a ray, or the gather at its end, may take a card, if tiles that were rendered tell.
    pub fn slowest(&self, card: CardNumber) -> Option<f64> {
        let before = self.cards[card].slowest.map(|seconds| seconds * SLOWER_THAN_BEFORE);
        let others = self.cards.iter().filter_map(|card| card.slowest).reduce(f64::max);
        before.or(others.map(|seconds| seconds * SLOWER_THAN_OTHERS))
    }

    /// Whether all tiles are done.
    pub fn is_complete(&self) -> bool {
        self.done == self.entries.len()
    }

    /// Tiles that are done, and all of them, but for those that an earlier render has left.
    pub fn progress(&self) -> (usize, usize) {
        (self.done - self.counts.kept, self.entries.len() - self.counts.kept)
    }

    /// Tiles that were more to render than a picture has.
    pub fn counts(&self) -> TileCounts {
        self.counts
    }

    /// Work on the tiles of the picture, each counted once.
    pub fn counters(&self) -> Counters {
        let mut sum = self.verified_work;
        self.cards.iter().for_each(|card| sum.add(&card.counters));
        sum
    }

    /// Work on the tiles that the picture has of one card alone.
    pub fn counters_of(&self, card: CardNumber) -> &Counters {
        &self.cards[card].counters
    }
}
