//! Detects renders that cannot be completed.

use std::time::Duration;

use photoncard_shared::message::Tile;

use super::card::Standing;
use super::dealing::COMPARED_AT_ONCE;
use super::entry::{Entry, Progress};
use super::{CRASHES_APART, Scheduler, SchedulerError};

/// Time for which the render waits for lost cards when no other card can continue.
const WAIT_FOR_LOST: Duration = Duration::from_secs(30);

impl Scheduler {
    /// Checks that the remaining cards can complete the render.
    ///
    /// # Errors
    /// If cards disagree on a tile and none is left to decide, or if no card can render the remaining tiles.
    pub fn check(&mut self, now: Duration) -> Result<(), SchedulerError> {
        if let Some(error) = self.undecidable() {
            return Err(error);
        }
        if self.can_go_on() {
            self.stuck_since = None;
            return Ok(());
        }
        let since = *self.stuck_since.get_or_insert(now);
        let is_any = |standing| self.cards.iter().any(|card| card.standing == standing);
        let may_come_back = is_any(Standing::Lost) && now.saturating_sub(since) < WAIT_FOR_LOST;
        if !is_any(Standing::Living) || may_come_back { Ok(()) } else { Err(self.what_is_left()) }
    }

    /// Returns the error of a tile that cards render differently when no card is left to decide; `None` if
    /// there is no such tile.
    fn undecidable(&self) -> Option<SchedulerError> {
        let disputed = self.compared.iter().take(COMPARED_AT_ONCE).map(|&index| &self.entries[index]);
        let can_decide = |entry: &Entry| {
            let mut cards = self.cards.iter().enumerate();
            cards.any(|(number, card)| card.standing != Standing::GivenUp && !entry.has_answer_of(number))
        };
        let entry = disputed.into_iter().find(|entry| entry.is_disputed() && !can_decide(entry))?;
        let sources = entry.answers.iter().map(|answer| answer.source).collect();
        Some(SchedulerError::Disagreement { tile: entry.tile, sources })
    }

    /// Returns whether the render is complete or can continue: a tile waits or is in transit to the sinks, or
    /// a card is working or can take a tile.
    fn can_go_on(&self) -> bool {
        let is_at_work = || self.cards.iter().any(|card| !card.tiles.is_empty());
        // A found tile is not done yet, but needs no card: another thread passes it to the sinks.
        let is_found = || self.entries.iter().any(|entry| matches!(entry.progress, Progress::Found(_)));
        if self.is_complete() || self.waiting_anywhere() > 0 || is_at_work() || is_found() {
            return true;
        }
        let can_compare = || {
            let mut compared = self.compared.iter();
            compared.any(|&index| self.living().any(|card| self.is_for(card, index)))
        };
        !self.set_apart.is_empty() && self.living().next().is_some() || can_compare()
    }

    /// Returns the error that names the reason why the remaining tiles cannot be rendered.
    fn what_is_left(&self) -> SchedulerError {
        match self.open_entries().find(|entry| !entry.answers.is_empty()) {
            Some(entry) if entry.is_disputed() => {
                let sources = entry.answers.iter().map(|answer| answer.source).collect();
                SchedulerError::Disagreement { tile: entry.tile, sources }
            }
            Some(entry) => SchedulerError::Unverified { tile: entry.tile },
            None => SchedulerError::Unrendered { tiles: self.crashed_at() },
        }
    }

    /// Returns the remaining tiles if all are set apart because cards have crashed at them, otherwise an
    /// empty list.
    pub fn crashed_at(&self) -> Vec<Tile> {
        let left = || self.entries.iter().filter(|entry| !matches!(entry.progress, Progress::Done(_)));
        if left().any(|entry| entry.crashes.len() < CRASHES_APART) {
            return Vec::new();
        }
        left().map(|entry| entry.tile).collect()
    }
}
