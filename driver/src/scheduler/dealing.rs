//! The tile that a card is given next.

use std::time::Duration;

use super::card::{CardNumber, Standing};
use super::entry::{Copy, Entry};
use super::{CRASHES_APART, Scheduler};
use crate::session::Assignment;

/// How long a tile is left to a card, in mean times of tiles, before an idle one takes it as well.
const HELP_AFTER: u32 = 2;
/// How long a tile is left to a card before any tile is done.
const HELP_WITHOUT_MEAN: Duration = Duration::from_secs(1);
/// Tiles that wait to be compared among which a card looks for one that it has not rendered, while any other tile waits.
pub(super) const COMPARED_AT_ONCE: usize = 256;

impl Scheduler {
    /// The next tile for a card with a free credit.
    pub fn take(&mut self, card: CardNumber, now: Duration) -> Option<Assignment> {
        if self.cards[card].standing != Standing::Living {
            return None;
        }
        // A card renders a suspect tile alone: if it crashes, it is known at which.
        let tiles = &self.cards[card].tiles;
        if tiles.iter().any(|&index| self.is_suspect(index)) {
            return None;
        }
        let is_idle = tiles.is_empty();
        let index = (self.next_compared(card))
            .or_else(|| self.next_waiting(is_idle))
            .or_else(|| self.compared_for(card, usize::MAX))
            .or_else(|| if is_idle { self.next_set_apart(card) } else { None })
            .or_else(|| self.next_to_help(card, now))?;
        let entry = &mut self.entries[index];
        entry.copies.push(Copy { card, since: now });
        self.cards[card].tiles.push(index);
        Some(Assignment { tile: entry.tile, is_suspect: !entry.crashes.is_empty() })
    }

    /// Whether a card has crashed at a tile.
    fn is_suspect(&self, index: usize) -> bool {
        !self.entries[index].crashes.is_empty()
    }

    /// The next tile that no card has; a suspect one for an idle card alone.
    fn next_waiting(&mut self, is_idle: bool) -> Option<usize> {
        let next = self.waiting.iter().position(|&index| is_idle || !self.is_suspect(index))?;
        self.waiting.remove(next)
    }

    /// A tile that another card has rendered and this one can verify.
    fn next_compared(&mut self, card: CardNumber) -> Option<usize> {
        while self.compared.front().is_some_and(|&index| !self.entries[index].is_open()) {
            self.compared.pop_front();
        }
        self.compared_for(card, COMPARED_AT_ONCE)
    }

    /// The first of so many compared tiles that a card can verify.
    fn compared_for(&self, card: CardNumber, tiles: usize) -> Option<usize> {
        self.compared.iter().take(tiles).copied().find(|&index| self.is_for(card, index))
    }

    /// Whether a card can verify a tile that no other is at.
    pub(super) fn is_for(&self, card: CardNumber, index: usize) -> bool {
        let entry = &self.entries[index];
        entry.is_open() && entry.copies.is_empty() && !entry.has_answer_of(card)
    }

    /// A tile that is set apart, once all others are done: of the cards those take it that have crashed at it least.
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

    /// Tiles that are not done.
    pub(super) fn open_entries(&self) -> impl Iterator<Item = &Entry> {
        self.entries.iter().filter(|entry| entry.is_open())
    }

    /// The tile that has been at others for the longest time, if that is too long: of those that the fewest are at.
    fn next_to_help(&mut self, card: CardNumber, now: Duration) -> Option<usize> {
        if !self.has_helpers || !self.cards[card].tiles.is_empty() || now < self.next_help {
            return None;
        }
        let patience = self.times.mean().map_or(HELP_WITHOUT_MEAN, |mean| mean.saturating_mul(HELP_AFTER));
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
        // Others of them may be for the next idle card.
        self.next_help = now;
        Some(index)
    }
}
