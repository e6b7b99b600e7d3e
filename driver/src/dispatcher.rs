//! Between scheduler, sessions and sinks: gives cards their tiles, and sinks the finished ones.

use std::sync::{Condvar, Mutex, MutexGuard, PoisonError, RwLock};
use std::time::Duration;

use photoncard_shared::message::Tile;

use crate::scheduler::{Answered, CardNumber, Scheduler, SchedulerError, Standing};
use crate::session::{Event, Session, SessionError};
use crate::sink::{FinishedTile, TileSink};

/// State shared by the sessions of a render, each on a thread of its own or all on one.
pub struct Dispatcher<'a> {
    scheduler: Mutex<Scheduler>,
    /// A tile waits again, a card is given up, or all tiles are done.
    changed: Condvar,
    sinks: Vec<&'a dyn TileSink>,
    /// Shared by whoever has a tile on its way to the sinks, held alone by whoever has them forget tiles.
    order: RwLock<()>,
}

impl<'a> Dispatcher<'a> {
    /// Tiles go from the scheduler's cards to all sinks.
    pub fn new(scheduler: Scheduler, sinks: Vec<&'a dyn TileSink>) -> Self {
        Self { scheduler: Mutex::new(scheduler), changed: Condvar::new(), sinks, order: RwLock::default() }
    }

    /// Which tiles are left.
    pub fn scheduler(&self) -> MutexGuard<'_, Scheduler> {
        // A thread that panicked holding the lock ends the render.
        self.scheduler.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Gives a card as many tiles as it has free credits.
    pub fn supply(&self, card: CardNumber, session: &mut Session, now: Duration) {
        while session.wants_tile() {
            let Some(assignment) = self.scheduler().take(card, now) else { break };
            session.give(assignment);
            session.prepare();
        }
    }

    /// Takes what has come of a session.
    ///
    /// # Errors
    /// If cards contradict each other, or none can render the tiles that are left.
    pub fn collect(
        &self,
        card: CardNumber,
        session: &mut Session,
        now: Duration,
    ) -> Result<(), SchedulerError> {
        while let Some(event) = session.next_event() {
            match event {
                Event::Ready => self.scheduler().set_standing(card, Standing::Living),
                Event::TileDone(tile) => self.finish(card, tile, now)?,
                Event::TileLost { tile, was_at_work } => {
                    self.scheduler().give_back(card, tile.id, was_at_work, now);
                    self.changed.notify_all();
                }
            }
        }
        let result = self.scheduler().check(now);
        if let Err(SchedulerError::Disagreement { tile, sources }) = &result {
            // Which of them lies cannot be told: what they alone have rendered is not kept.
            sources.iter().filter_map(|source| source.card()).for_each(|card| self.distrust(card, *tile));
        }
        result
    }

    /// A card has rendered a tile.
    fn finish(&self, card: CardNumber, tile: FinishedTile, now: Duration) -> Result<(), SchedulerError> {
        let rectangle = *tile.tile();
        let order = self.order.read().unwrap_or_else(PoisonError::into_inner);
        let Answered { found, liars, fault } = self.scheduler().answer(card, tile, now);
        let order = if liars.is_empty() {
            order
        } else {
            drop(order);
            // The tile is not done yet: no render is complete with what a liar has left.
            liars.into_iter().for_each(|liar| self.distrust(liar, rectangle));
            self.order.read().unwrap_or_else(PoisonError::into_inner)
        };
        if let Some(tile) = found {
            self.sinks.iter().for_each(|sink| sink.put(&tile));
            self.scheduler().complete(rectangle.id);
        }
        drop(order);
        // Another may verify the tile, or all are done.
        self.changed.notify_all();
        fault.map_or(Ok(()), Err)
    }

    /// Gives up a card that has lied about a tile: all that it alone has rendered is rendered again.
    pub fn distrust(&self, card: CardNumber, about: Tile) {
        let _alone = self.order.write().unwrap_or_else(PoisonError::into_inner);
        let revoked = self.scheduler().expel(card, about);
        for tile in revoked {
            self.sinks.iter().for_each(|sink| sink.revoke(&tile));
        }
        self.changed.notify_all();
    }

    /// Verdict of other cards on a card that is used no more.
    ///
    /// # Errors
    /// If it has lied.
    pub fn check_card(&self, card: CardNumber) -> Result<(), SessionError> {
        let lie = self.scheduler().lie_of(card);
        lie.map_or(Ok(()), |tile| Err(SessionError::Outvoted { tile }))
    }

    /// Waits until there may be something to do, not longer than `longest`.
    pub fn wait(&self, longest: Duration) {
        let scheduler = self.scheduler();
        if !scheduler.is_complete() {
            drop(self.changed.wait_timeout(scheduler, longest));
        }
    }
}
