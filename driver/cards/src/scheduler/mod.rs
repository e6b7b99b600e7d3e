//! Assignment of tiles to cards.
//!
//! Tiles wait in one queue. A card with a *free credit* may receive one more tile before it has answered all
//! earlier ones. It takes the next tile, unless so few tiles are left that other cards would have none. No
//! card waits for another, and results arrive in any order. The pixels of a tile depend neither on its card
//! nor on time.
//!
//! - A second card renders a tile that requires verification, as soon as a card is free. If the two answers
//!   differ, a third card decides. All tiles of the outvoted card that no other card has confirmed are
//!   rendered again.
//! - A dazzling tile is verified as well, if there is another card. A tile is dazzling if its radiance is so
//!   high that only a lamp next to a surface could explain it. If exactly one of two answers is dazzling, the
//!   other one is accepted. If there is only one card, its dazzling tiles are accepted and counted.
//! - A tile at which cards have crashed (were reset or lost) twice is set apart until all others are done. It
//!   then goes to the cards with the fewest crashes at it, and is abandoned after five crashes.
//! - In a render whose gathers wait in card memory a card works on all its tiles at once. If it is lost with
//!   several, no tile has a crash: the card receives as many tiles one at a time, so that the next crash is
//!   attributed to the right tile.
//! - In a render of several passes, a tile is reserved for the card that rendered it before and holds its
//!   irradiance records. Idle cards take tiles reserved for other cards, the last ones first, unless those
//!   cards will soon render them.
//! - If no tile waits, an idle card duplicates the tile that another card has had for the longest time, once
//!   this time exceeds twice the mean time of a tile. The first answer counts.
//!
//! The scheduler has no thread, lock or clock: [`crate::dispatcher`] connects it to sessions and sinks.

mod card;
mod dealing;
mod ending;
mod entry;
mod error;
#[cfg(test)]
mod tests;
mod tiles;

pub use self::card::{CardNumber, Standing};
pub use self::error::rectangles;
pub use self::error::{SchedulerError, Source};
pub use self::tiles::{GatherOrder, near, spread, tiles};

use std::collections::{HashMap, VecDeque};
use std::time::Duration;

use photoncard_picture::film::Film;
use photoncard_picture::sink::FinishedTile;
use photoncard_shared::counters::Counters;
use photoncard_shared::hash::hash;
use photoncard_shared::message::Tile;

use self::card::{Card, TileTimes};
use self::entry::{Agreement, Answer, Entry, Judgement, Progress};

/// Number of crashes after which a tile is set apart.
const CRASHES_APART: usize = 2;
/// Number of crashes after which a tile is abandoned.
const MAX_CRASHES: usize = 5;
/// Maximum time per ray, as a multiple of the mean time per ray in the card's slowest tile.
const SLOWER_THAN_BEFORE: f64 = 50.0;
/// Maximum time per ray of a card without rendered tiles, as a multiple of the mean time per ray in the
/// slowest tile of all cards. A Cortex-M4F takes some 400 times as long as a chip that a desktop computer
/// emulates.
const SLOWER_THAN_OTHERS: f64 = 1000.0;

/// Tiles of a picture with their progress, and the cards to which they are assigned.
#[derive(Debug)]
pub struct Scheduler {
    entries: Vec<Entry>,
    by_id: HashMap<u32, usize>,
    /// Queue of the waiting tiles' indices, without reserved tiles.
    waiting: VecDeque<usize>,
    /// Indices of the tiles that have an answer and await another one for comparison.
    compared: VecDeque<usize>,
    /// Indices of the unfinished tiles with several crashes, which wait until all others are done.
    set_apart: Vec<usize>,
    cards: Vec<Card>,
    has_helpers: bool,
    deals_shares: bool,
    /// Time before which no tile can be due for duplication.
    next_help: Duration,
    /// Time since which no card can continue an incomplete render; `None` while a card can.
    stuck_since: Option<Duration>,
    times: TileTimes,
    /// Sum of the counters of the tiles on which two cards agree.
    verified_work: Counters,
    done: usize,
    counts: TileCounts,
}

/// Numbers of tiles that were taken over, verified, repeated or revoked.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct TileCounts {
    /// Tiles taken over from an earlier render, without those that require verification.
    pub kept: usize,
    /// Dazzling tiles among those taken over.
    pub kept_dazzling: usize,
    /// Tiles on which two cards agree.
    pub verified: usize,
    /// Tiles rendered once more, for verification or by an idle card.
    pub repeated: usize,
    /// Tiles revoked because their card was outvoted or sent wrong messages.
    pub revoked: usize,
}

/// Consequences of a card's answer to a tile.
#[derive(Debug, Default)]
pub struct Answered {
    /// Tile to store in the sinks, to be confirmed by [`Scheduler::complete`].
    pub found: Option<FinishedTile>,
    /// Cards that were outvoted at the tile, to be passed to `Scheduler::expel`.
    pub liars: Vec<CardNumber>,
    /// Error that ends the render; `None` to continue.
    pub fault: Option<SchedulerError>,
}

impl Scheduler {
    /// Creates a scheduler of `tiles` for `cards` cards.
    pub fn new(tiles: Vec<Tile>, cards: usize) -> Self {
        Self {
            by_id: tiles.iter().zip(0..).map(|(tile, index)| (tile.id, index)).collect(),
            waiting: (0..tiles.len()).collect(),
            entries: tiles.into_iter().map(Entry::new).collect(),
            compared: VecDeque::new(),
            set_apart: Vec::new(),
            cards: (0..cards).map(|_| Card::new()).collect(),
            has_helpers: false,
            deals_shares: false,
            next_help: Duration::ZERO,
            stuck_since: None,
            times: TileTimes::default(),
            verified_work: Counters::ZERO,
            done: 0,
            counts: TileCounts::default(),
        }
    }

    /// Enables duplication of late tiles and verification of dazzling ones, by other cards.
    #[must_use]
    pub fn with_helpers(self) -> Self {
        Self { has_helpers: true, ..self }
    }

    /// With `deals_shares`, gives each card its share of the tiles at once, as far as it accepts them,
    /// instead of a few at a time: a card whose gathers wait in card memory reads less the more tiles it
    /// has. The card works on them together.
    #[must_use]
    pub fn in_shares(self, deals_shares: bool) -> Self {
        Self { deals_shares, ..self }
    }

    /// Requires that a second card verify a share (0 to 1) of the tiles, at least one tile. A hash of seed
    /// and tile number selects them.
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

    /// Takes over the finished tiles of an earlier render from its film. A tile that requires verification is
    /// compared with the answer of one card.
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
                self.counts.kept_dazzling += usize::from(tile.is_dazzling());
            }
        }
        let entries = &self.entries;
        self.waiting.retain(|&index| entries[index].is_open() && entries[index].answers.is_empty());
        self
    }

    /// Records a tile that a card has rendered. Compares it with other answers if it needs verification.
    pub fn answer(&mut self, card: CardNumber, tile: FinishedTile, now: Duration) -> Answered {
        let Some((index, since)) = self.remove_copy(card, tile.tile().id, now) else {
            return Answered::default();
        };
        let has_others = self.has_helpers && self.living().any(|other| other != card);
        let took = now.saturating_sub(since);
        self.times.count(took);
        let at = &mut self.cards[card];
        at.count_time(if self.deals_shares { took / at.most_tiles.max(1) } else { took }, &tile.counters);
        at.singly = at.singly.saturating_sub(1);
        let entry = &mut self.entries[index];
        if !entry.is_open() || at.standing == Standing::GivenUp {
            self.counts.repeated += 1;
            return Answered::default();
        }
        entry.is_dazzling = tile.is_dazzling();
        entry.is_doubted |= has_others && entry.is_dazzling;
        if !entry.is_verified && !entry.is_doubted {
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

    /// Compares the answers to a tile. Accepts one of them if two agree, or if exactly one of two is
    /// dazzling.
    fn judge(&mut self, index: usize) -> Answered {
        let entry = &mut self.entries[index];
        let Some(Judgement { tile, agreed, liars }) = entry.judge() else { return Answered::default() };
        // Only tiles without a second answer count as dazzling.
        entry.is_dazzling = false;
        let was_kept = agreed == Agreement::WithKept;
        match agreed {
            Agreement::ByLight(card) => {
                entry.progress = Progress::Found(Some(card));
                self.cards[card].counters.add(&tile.counters);
            }
            Agreement::OfCards | Agreement::WithKept => {
                self.counts.verified += 1;
                entry.progress = Progress::Found(None);
            }
        }
        let fault = liars.contains(&Source::Kept).then_some(SchedulerError::KeptDiffers { tile: entry.tile });
        if was_kept {
            entry.progress = Progress::Done(None);
            self.done += 1;
        } else if agreed == Agreement::OfCards {
            self.verified_work.add(&tile.counters);
        }
        let liars = liars.into_iter().filter_map(Source::card).collect();
        Answered { found: (!was_kept).then_some(tile), liars, fault }
    }

    /// Marks a tile as stored by all sinks.
    pub fn complete(&mut self, id: u32) {
        let Some(entry) = self.by_id.get(&id).map(|&index| &mut self.entries[index]) else { return };
        if let Progress::Found(source) = entry.progress {
            entry.progress = Progress::Done(source);
            self.done += 1;
        }
    }

    /// Takes an unfinished tile from a card and puts it at the front of the queue. After several crashes the
    /// tile is set apart or abandoned instead. `has_crashed` is true if the card was working on the tile.
    pub fn give_back(&mut self, card: CardNumber, id: u32, has_crashed: bool, now: Duration) {
        let Some((index, _)) = self.remove_copy(card, id, now) else { return };
        self.cards[card].singly += usize::from(self.deals_shares && !has_crashed);
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
        self.release_doubted();
    }

    /// Removes the copy of a tile from a card. Returns the tile's index, and the time at which the card can
    /// have started it.
    fn remove_copy(&mut self, card: CardNumber, id: u32, now: Duration) -> Option<(usize, Duration)> {
        let index = *self.by_id.get(&id)?;
        let copies = &mut self.entries[index].copies;
        let copy = copies.iter().position(|copy| copy.card == card)?;
        let since = copies.remove(copy).since;
        let tiles = &mut self.cards[card].tiles;
        tiles.retain(|&tile| tile != index);
        // The card can start its next tile no earlier than now, unless it works on all of them.
        if let Some(&next) = tiles.first()
            && !self.deals_shares
        {
            let copies = &mut self.entries[next].copies;
            copies
                .iter_mut()
                .filter(|copy| copy.card == card)
                .for_each(|copy| copy.since = copy.since.max(now));
        }
        Some((index, since))
    }

    /// Sets the availability of a card. A card that was given up stays given up.
    pub fn set_standing(&mut self, card: CardNumber, standing: Standing) {
        if self.cards[card].standing != Standing::GivenUp {
            self.cards[card].standing = standing;
        }
        if standing != Standing::Living {
            self.release_homes(card);
            self.release_doubted();
        }
    }

    /// Makes the dazzling tiles that await confirmation available to the last card, if no other card is left
    /// to confirm them.
    fn release_doubted(&mut self) {
        if self.living().nth(1).is_some() {
            return;
        }
        for (index, entry) in self.entries.iter_mut().enumerate() {
            let is_waiting = entry.is_open() && entry.copies.is_empty() && entry.answers.len() == 1;
            if entry.is_doubted && !entry.is_verified && is_waiting {
                entry.is_doubted = false;
                entry.answers.clear();
                self.compared.retain(|&compared| compared != index);
                self.waiting.push_back(index);
            }
        }
    }

    /// Availability of a card.
    pub fn standing(&self, card: CardNumber) -> Standing {
        self.cards[card].standing
    }

    /// Returns whether any card is available.
    pub fn has_living(&self) -> bool {
        self.living().next().is_some()
    }

    /// Tile of which a card sent wrong pixels; `None` if there is no such tile.
    pub fn lie_of(&self, card: CardNumber) -> Option<Tile> {
        self.cards[card].lie
    }

    /// Excludes a card that sent wrong messages, or wrong pixels of tile `about`. Returns the card's tiles
    /// that no other card has confirmed, which the sinks must revoke. None of these may be in transit to the
    /// sinks.
    pub(crate) fn expel(&mut self, card: CardNumber, about: Option<Tile>) -> Vec<Tile> {
        self.set_standing(card, Standing::GivenUp);
        self.cards[card].lie = about;
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
                    entry.is_doubted = false;
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

    /// Time limit per ray or gather of a card, seconds, from the times of rendered tiles; `None` before any
    /// card has rendered a tile.
    pub fn slowest(&self, card: CardNumber) -> Option<f64> {
        let before = self.cards[card].slowest.map(|seconds| seconds * SLOWER_THAN_BEFORE);
        let others = self.cards.iter().filter_map(|card| card.slowest).reduce(f64::max);
        before.or(others.map(|seconds| seconds * SLOWER_THAN_OTHERS))
    }

    /// Returns whether all tiles are done.
    pub fn is_complete(&self) -> bool {
        self.done == self.entries.len()
    }

    /// Numbers of finished tiles and of all tiles, both without those taken over from an earlier render.
    pub fn progress(&self) -> (usize, usize) {
        (self.done - self.counts.kept, self.entries.len() - self.counts.kept)
    }

    /// Numbers of tiles that were taken over, verified, repeated or revoked.
    pub fn counts(&self) -> TileCounts {
        self.counts
    }

    /// Number of dazzling tiles accepted from a card without confirmation by another.
    pub fn dazzling_of(&self, card: CardNumber) -> usize {
        self.entries.iter().filter(|entry| entry.is_dazzling_of(card)).count()
    }

    /// Sum of the counters of the rendered tiles. A tile that was rendered twice counts once.
    pub fn counters(&self) -> Counters {
        let mut sum = self.verified_work;
        self.cards.iter().for_each(|card| sum.add(&card.counters));
        sum
    }

    /// Sum of the counters of a card's tiles that no other card has confirmed.
    pub fn counters_of(&self, card: CardNumber) -> &Counters {
        &self.cards[card].counters
    }
}
