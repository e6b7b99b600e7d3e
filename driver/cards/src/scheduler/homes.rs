//! Reserves tiles for their home, the card that rendered them in an earlier pass and holds their irradiance
//! records.

use std::collections::HashMap;
use std::time::Duration;

use photoncard_shared::message::Tile;

use super::Scheduler;
use super::card::CardNumber;
use super::entry::Progress;

/// Number of reserved tiles of a working card that other cards do not take, because they would have to gather
/// the irradiance records again.
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

    /// Tiles of which this card's answer was accepted without another.
    pub fn rendered_by(&self, card: CardNumber) -> impl Iterator<Item = &Tile> {
        let entries = self.entries.iter().filter(move |entry| entry.progress == Progress::Done(Some(card)));
        entries.map(|entry| &entry.tile)
    }

    /// Number of tiles that are on no card.
    pub(super) fn waiting_anywhere(&self) -> usize {
        self.waiting.len() + self.cards.iter().map(|card| card.at_home.len()).sum::<usize>()
    }

    /// Makes the tiles that are reserved for a card available to all.
    pub(super) fn release_homes(&mut self, card: CardNumber) {
        let tiles = std::mem::take(&mut self.cards[card].at_home);
        self.waiting.extend(tiles);
    }

    /// Takes the last tile from the card with the most reserved tiles; `None` if that card will soon render
    /// it itself.
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
