//! Selects the next tile for a card.

use std::collections::HashMap;
use std::time::Duration;

use photoncard_shared::message::Tile;

use super::card::{CardNumber, Standing};
use super::entry::{Copy, Entry, Progress};
use super::{CRASHES_APART, Scheduler};
use crate::session::Assignment;

/// Time after which an idle card duplicates another card's tile, as a multiple of the mean time of a tile.
const HELP_AFTER: u32 = 2;
/// Time, while no tile is done yet, after which an idle card duplicates another card's tile.
const HELP_WITHOUT_MEAN: Duration = Duration::from_secs(1);
/// Factor of the number of waiting tiles above which a card takes another tile. A card with n tiles takes one
/// while more than `PLENTY * n * m` tiles wait, where m is the number of other living cards.
const PLENTY: usize = 4;
/// Number of tiles awaiting comparison that are searched for one that a card can verify.
pub(super) const COMPARED_AT_ONCE: usize = 256;

impl Scheduler {
    /// Assigns the next tile to a card that accepts one more; `None` if no tile is available for the card.
    pub fn take(&mut self, card: CardNumber, now: Duration) -> Option<Assignment> {
        if self.cards[card].standing != Standing::Living {
            return None;
        }
        // A card renders a suspect tile alone, so that a crash is attributed to the right tile.
        let tiles = &self.cards[card].tiles;
        if tiles.iter().any(|&index| self.is_suspect(index)) {
            return None;
        }
        let is_idle = tiles.is_empty();
        if !is_idle && self.cards[card].singly > 0 {
            return None;
        }
        let index = (self.next_compared(card))
            .or_else(|| if self.has_share(card) { self.next_waiting(card, is_idle) } else { None })
            .or_else(|| self.compared_for(card, usize::MAX))
            .or_else(|| if is_idle { self.next_set_apart(card) } else { None })
            .or_else(|| if is_idle { self.next_of_others(now) } else { None })
            .or_else(|| self.next_to_help(card, now))?;
        let entry = &mut self.entries[index];
        entry.copies.push(Copy { card, since: now });
        let at = &mut self.cards[card];
        at.tiles.push(index);
        at.most_tiles = at.most_tiles.max(at.tiles.len() as u32);
        Some(Assignment { tile: entry.tile, is_suspect: !entry.crashes.is_empty() })
    }

    /// Returns whether any card has crashed at tile `index`.
    fn is_suspect(&self, index: usize) -> bool {
        !self.entries[index].crashes.is_empty()
    }

    /// Returns whether a card may take another tile. A card without tiles may always take one, a card with
    /// tiles only while enough tiles wait for the other cards. Without this limit, tiles would wait behind a
    /// slow tile, and near the end idle cards could not take them.
    fn has_share(&self, card: CardNumber) -> bool {
        if self.deals_shares {
            let dealt: usize = self.living().map(|other| self.cards[other].tiles.len()).sum();
            let share = (self.waiting_anywhere() + dealt).div_ceil(self.living().count().max(1));
            return self.cards[card].tiles.len() < share;
        }
        let others = self.living().filter(|&other| other != card).count();
        self.waiting_anywhere() > PLENTY * self.cards[card].tiles.len() * others
    }

    /// Takes the next tile that is on no card: one reserved for this card, else one from the common queue.
    /// Only an idle card receives a suspect tile, at which cards have crashed.
    fn next_waiting(&mut self, card: CardNumber, is_idle: bool) -> Option<usize> {
        if let Some(own) = self.cards[card].at_home.pop_front() {
            return Some(own);
        }
        let next = self.waiting.iter().position(|&index| is_idle || !self.is_suspect(index))?;
        self.waiting.remove(next)
    }

    /// Finds a tile that another card has rendered and `card` can verify.
    fn next_compared(&mut self, card: CardNumber) -> Option<usize> {
        while self.compared.front().is_some_and(|&index| !self.entries[index].is_open()) {
            self.compared.pop_front();
        }
        self.compared_for(card, COMPARED_AT_ONCE)
    }

    /// Index of the first tile that the card can verify, among the first `tiles` ones awaiting comparison.
    fn compared_for(&self, card: CardNumber, tiles: usize) -> Option<usize> {
        self.compared.iter().take(tiles).copied().find(|&index| self.is_for(card, index))
    }

    /// Returns whether tile `index` is neither accepted nor abandoned, is on no card, and has no answer of
    /// this card.
    pub(super) fn is_for(&self, card: CardNumber, index: usize) -> bool {
        let entry = &self.entries[index];
        entry.is_open() && entry.copies.is_empty() && !entry.has_answer_of(card)
    }

    /// Takes a tile that was set apart because cards crashed at it. Such a tile is available once all other
    /// tiles are done, to the living cards with the fewest crashes at it.
    fn next_set_apart(&mut self, card: CardNumber) -> Option<usize> {
        if self.set_apart.is_empty() || self.open_entries().any(|entry| entry.crashes.len() < CRASHES_APART) {
            return None;
        }
        let found = self.set_apart.iter().position(|&index| self.has_crashed_least(card, index))?;
        Some(self.set_apart.remove(found))
    }

    fn has_crashed_least(&self, card: CardNumber, index: usize) -> bool {
        let entry = &self.entries[index];
        let least = self.living().map(|living| entry.crashes_of(living)).min();
        least.is_none_or(|least| entry.crashes_of(card) <= least)
    }

    pub(super) fn living(&self) -> impl Iterator<Item = CardNumber> {
        let cards = self.cards.iter().enumerate();
        cards.filter(|(_, card)| card.standing == Standing::Living).map(|(number, _)| number)
    }

    /// Tiles that are neither accepted nor abandoned.
    pub(super) fn open_entries(&self) -> impl Iterator<Item = &Entry> {
        self.entries.iter().filter(|entry| entry.is_open())
    }

    /// Time for which a card may have a tile before idle cards duplicate it.
    pub(super) fn patience(&self) -> Duration {
        self.times.mean().map_or(HELP_WITHOUT_MEAN, |mean| mean.saturating_mul(HELP_AFTER))
    }

    /// Selects a tile that an idle card duplicates because other cards have had it for too long: among the
    /// tiles with the fewest copies, the one assigned first.
    fn next_to_help(&mut self, card: CardNumber, now: Duration) -> Option<usize> {
        if !self.has_helpers || !self.cards[card].tiles.is_empty() || now < self.next_help {
            return None;
        }
        let patience = self.patience();
        let mut candidates = Vec::new();
        self.next_help = now + patience;
        for &index in self.cards.iter().flat_map(|card| &card.tiles) {
            let entry = &self.entries[index];
            if !entry.is_open() || entry.concerns(card) || entry.crashes.len() >= CRASHES_APART {
                continue;
            }
            let [first, last] = [entry.copies.first()?, entry.copies.last()?].map(|copy| copy.since);
            let due = last + patience;
            if due <= now {
                candidates.push((entry.copies.len(), first, index));
            } else {
                self.next_help = self.next_help.min(due);
            }
        }
        let (_, _, index) = candidates.into_iter().min()?;
        // Another candidate may be left for the next idle card.
        self.next_help = now;
        Some(index)
    }
}

/// Maximum number of tiles reserved for a working card that idle cards leave to it. An idle card would have
/// to gather the tiles' irradiance records again.
const MAX_AT_HOME: usize = 4;

impl Scheduler {
    /// Reserves waiting tiles for the cards that have rendered the same tiles before.
    #[must_use]
    pub fn with_homes<'a>(mut self, homes: impl IntoIterator<Item = (CardNumber, &'a Tile)>) -> Self {
        let homes: HashMap<u32, (CardNumber, &Tile)> =
            homes.into_iter().map(|(card, tile)| (tile.id, (card, tile))).collect();
        for index in std::mem::take(&mut self.waiting) {
            let tile = &self.entries[index].tile;
            match homes.get(&tile.id) {
                Some(&(card, before)) if before == tile => self.cards[card].at_home.push_back(index),
                _ => self.waiting.push_back(index),
            }
        }
        self
    }

    /// Finished tiles that were accepted from this card without an equal answer of another card.
    pub fn rendered_by(&self, card: CardNumber) -> impl Iterator<Item = &Tile> {
        let entries = self.entries.iter().filter(move |entry| entry.progress == Progress::Done(Some(card)));
        entries.map(|entry| &entry.tile)
    }

    /// Number of waiting tiles, reserved ones included.
    pub(super) fn waiting_anywhere(&self) -> usize {
        self.waiting.len() + self.cards.iter().map(|card| card.at_home.len()).sum::<usize>()
    }

    /// Makes the tiles that are reserved for a card available to all.
    pub(super) fn release_homes(&mut self, card: CardNumber) {
        let tiles = std::mem::take(&mut self.cards[card].at_home);
        self.waiting.extend(tiles);
    }

    /// Takes the last reserved tile of the card that has the most reserved tiles; `None` if that card will
    /// soon render the tile itself.
    pub(super) fn next_of_others(&mut self, now: Duration) -> Option<usize> {
        let patience = self.patience();
        let has_most = |card: &CardNumber| self.cards[*card].at_home.len();
        let card = self.living().max_by_key(has_most)?;
        let at_work = self.cards[card].tiles.first().and_then(|&index| self.entries[index].since(card));
        let is_late = at_work.is_none_or(|since| since + patience <= now);
        let at_home = &mut self.cards[card].at_home;
        if is_late || at_home.len() > MAX_AT_HOME { at_home.pop_back() } else { None }
    }
}
