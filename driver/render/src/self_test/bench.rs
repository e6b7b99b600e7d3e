//! A card under test, with its link and its clock.

use std::time::{Duration, Instant};

use photoncard_cards::session::{Event, Session};
use photoncard_shared::link::Port;

use crate::greeting::GreetingError;
use crate::open_card::exchange;
use crate::{CardError, Observer};

pub(super) struct Bench<'a, P> {
    pub(super) session: Session,
    port: &'a mut P,
    start: Instant,
    /// Number of times that the card was greeted again before the test.
    resets: u64,
    pub(super) observer: &'a dyn Observer,
}

impl<'a, P: Port> Bench<'a, P> {
    /// Creates the bench of a card that answered the greeting in `session`.
    pub(super) fn new(session: Session, port: &'a mut P, start: Instant, observer: &'a dyn Observer) -> Self {
        let resets = session.link_bytes().resets;
        Self { session, port, start, resets, observer }
    }

    pub(super) fn now(&self) -> Duration {
        self.start.elapsed()
    }

    pub(super) fn next_event(&mut self) -> Result<Event, GreetingError> {
        loop {
            if let Some(event) = self.session.next_event() {
                return Ok(event);
            }
            if self.observer.is_stopped() {
                return Err(GreetingError::Stopped);
            }
            exchange(&mut self.session, self.port, None, self.start).map_err(CardError::Session)?;
            if self.session.link_bytes().resets > self.resets {
                return Err(CardError::Reset.into());
            }
        }
    }
}
