//! Passes assignments of tiles from the scheduler to sessions, and finished tiles from sessions to sinks
//! (film, files, display).

use std::sync::{Condvar, Mutex, MutexGuard, PoisonError, RwLock};
use std::time::Duration;

use photoncard_picture::sink::{FinishedTile, TileSink};
use photoncard_shared::message::Tile;

use crate::scheduler::{Answered, CardNumber, Scheduler, SchedulerError, Standing};
use crate::session::{Event, Session, SessionError};

/// State that all sessions of a render share: the scheduler of the tiles, and the sinks of finished tiles. A
/// session runs on a thread of its own, or on one that other sessions use too.
pub struct Dispatcher<'a> {
    scheduler: Mutex<Scheduler>,
    /// Notified when a tile becomes available, a card is given up, or all tiles are done.
    changed: Condvar,
    sinks: Vec<&'a dyn TileSink>,
    /// Called before the sinks receive a tile from a card.
    rendered: &'a (dyn Fn(CardNumber, &Tile) + Sync),
    /// Lock held for reading while sinks receive a tile, and for writing while they revoke tiles.
    order: RwLock<()>,
}

impl<'a> Dispatcher<'a> {
    /// Creates a dispatcher between a scheduler and all sinks.
    pub fn new(scheduler: Scheduler, sinks: Vec<&'a dyn TileSink>) -> Self {
        Self {
            scheduler: Mutex::new(scheduler),
            changed: Condvar::new(),
            sinks,
            rendered: &|_, _| {},
            order: RwLock::default(),
        }
    }

    /// Sets a function that is called before the sinks receive a tile from a card.
    #[must_use]
    pub fn telling(self, rendered: &'a (dyn Fn(CardNumber, &Tile) + Sync)) -> Self {
        Self { rendered, ..self }
    }

    /// Locks and returns the scheduler.
    pub fn scheduler(&self) -> MutexGuard<'_, Scheduler> {
        // A poisoned lock is taken over: the panic that poisoned it ends the render.
        self.scheduler.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Assigns tiles to a card as long as it accepts more. If the scheduler has no tile for the card, makes
    /// the card do the gathers that wait in its queue.
    pub fn supply(&self, card: CardNumber, session: &mut Session, now: Duration) {
        while session.wants_tile() {
            match self.scheduler().take(card, now) {
                Some(assignment) => session.give(assignment),
                None => {
                    session.flush();
                    session.prepare();
                    break;
                }
            }
            session.prepare();
        }
    }

    /// Passes the events of a session to the scheduler, and its finished tiles to the sinks.
    ///
    /// # Errors
    /// If cards contradict each other, or no card can render the remaining tiles.
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
                // Cards under test, and those of a relay, are no cards of a render.
                Event::Computed(_)
                | Event::MemoryTested(_)
                | Event::Checksums(_)
                | Event::ImageAccepted
                | Event::Refused(_) => {}
            }
        }
        let result = self.scheduler().check(now);
        if let Err(SchedulerError::Disagreement { tile, sources }) = &result {
            // Either of two cards that disagree may be wrong: tiles that only they have rendered are revoked.
            sources
                .iter()
                .filter_map(|source| source.card())
                .for_each(|card| self.distrust(card, Some(*tile)));
        }
        result
    }

    /// Passes a tile that a card has rendered to the scheduler and, once it is accepted, to the sinks.
    fn finish(&self, card: CardNumber, tile: FinishedTile, now: Duration) -> Result<(), SchedulerError> {
        let rectangle = *tile.tile();
        let order = self.order.read().unwrap_or_else(PoisonError::into_inner);
        let Answered { found, liars, fault } = self.scheduler().answer(card, tile, now);
        let order = if liars.is_empty() {
            order
        } else {
            drop(order);
            // The tile is not complete yet, so the render cannot end before the wrong card's tiles are
            // revoked.
            liars.into_iter().for_each(|liar| self.distrust(liar, Some(rectangle)));
            self.order.read().unwrap_or_else(PoisonError::into_inner)
        };
        if let Some(tile) = found {
            (self.rendered)(card, &rectangle);
            self.sinks.iter().for_each(|sink| sink.put(&tile));
            self.scheduler().complete(rectangle.id);
        }
        drop(order);
        // Another card may verify the tile, or all tiles are done.
        self.changed.notify_all();
        fault.map_or(Ok(()), Err)
    }

    /// Excludes a card from the render because it sent wrong messages, or wrong pixels of tile `about`. The
    /// sinks revoke the card's tiles that no other card has confirmed.
    pub fn distrust(&self, card: CardNumber, about: Option<Tile>) {
        let _alone = self.order.write().unwrap_or_else(PoisonError::into_inner);
        let revoked = self.scheduler().expel(card, about);
        for tile in revoked {
            self.sinks.iter().for_each(|sink| sink.revoke(&tile));
        }
        self.changed.notify_all();
    }

    /// Checks, after a card's session has ended, whether other cards have contradicted its pixels of a tile.
    ///
    /// # Errors
    /// [`SessionError::Outvoted`] with the card's wrong tile, if other cards have outvoted the card.
    pub fn check_card(&self, card: CardNumber) -> Result<(), SessionError> {
        let lie = self.scheduler().lie_of(card);
        lie.map_or(Ok(()), |tile| Err(SessionError::Outvoted { tile }))
    }

    /// Waits at most `longest` for a tile to become available, a card to be given up or the last tile to be
    /// done. Returns at once if all tiles are done.
    pub fn wait(&self, longest: Duration) {
        let scheduler = self.scheduler();
        if !scheduler.is_complete() {
            drop(self.changed.wait_timeout(scheduler, longest));
        }
    }
}
