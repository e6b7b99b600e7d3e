//! A card's thread on the host, which moves bytes between the card's port and its session.

use std::time::Duration;

use photoncard_shared::address::LINE_BYTES;

use super::crew::{Crew, EndOthersOnPanic};
use super::exchange::{WAIT, exchange};
use super::greeting::GreetedCard;
use super::open_card::OpenCard;
use super::reopening::reopen;
use super::{CardError, Phase, RenderError};
use crate::emulator::memory_model::MemoryTraffic;
use crate::emulator::trace::TraceFile;
use crate::scheduler::{CardNumber, Standing};
use crate::session::{Job, LinkBytes, Session, SessionError};

/// Outcome of one card.
#[derive(Default)]
pub(super) struct CardOutcome {
    pub(super) bytes: LinkBytes,
    pub(super) traffic: Option<MemoryTraffic>,
    pub(super) loaded: Duration,
}

impl CardOutcome {
    pub(super) fn add(&mut self, other: &Self) {
        self.bytes.add(&other.bytes);
        if let Some(traffic) = &other.traffic {
            self.traffic.get_or_insert(MemoryTraffic::ZERO).add(traffic);
        }
        self.loaded = self.loaded.max(other.loaded);
    }
}

/// Card at work.
struct CardAtWork<'a> {
    number: CardNumber,
    card: OpenCard,
    session: Session<'a>,
    /// True after the card's loss was reported, until it is loaded again.
    is_lost: bool,
    crew: &'a Crew<'a>,
}

/// Loads the image into a card and renders tiles on it until none is left. A lost card is retried as long as there are
/// others; a card that answers wrongly, or fails repeatedly, is given up.
pub(super) fn render_on<'a>(
    number: CardNumber,
    greeted: GreetedCard,
    job: Job<'a>,
    crew: &'a Crew<'a>,
) -> Result<CardOutcome, RenderError> {
    let _guard = EndOthersOnPanic(&crew.failed);
    let GreetedCard { card, mut session, .. } = greeted;
    session.start(job, crew.start.elapsed());
    let mut at_work = CardAtWork { number, card, session, is_lost: false, crew };
    let mut outcome = CardOutcome::default();
    while !crew.is_complete()? && !at_work.card.trace_has_failed() && at_work.go_on()? {
        at_work.tell_progress(&mut outcome, job);
    }
    let CardAtWork { card, session, .. } = at_work;
    outcome.bytes = session.link_bytes();
    if let Some(record) = card.finish() {
        outcome.traffic = Some(record.traffic);
        record.trace.map_or(Ok(()), TraceFile::finish)?;
    }
    Ok(outcome)
}

impl CardAtWork<'_> {
    /// Moves bytes and tiles once. Returns false if the card is given up.
    fn go_on(&mut self) -> Result<bool, RenderError> {
        let Self { number, crew, .. } = *self;
        let dispatcher = &crew.dispatcher;
        dispatcher.supply(number, &mut self.session, crew.start.elapsed());
        if self.session.is_idle() {
            dispatcher.wait(WAIT);
        }
        let slowest = dispatcher.scheduler().slowest(number);
        let exchanged = dispatcher
            .check_card(number)
            .and_then(|()| exchange(&mut self.session, &mut self.card, slowest, crew.start));
        // Answers before the error count.
        self.collect()?;
        self.is_lost &= !self.session.is_loaded();
        exchanged.map_or_else(|error| self.recover(error), |()| Ok(true))
    }

    fn collect(&mut self) -> Result<(), RenderError> {
        let collected =
            self.crew.dispatcher.collect(self.number, &mut self.session, self.crew.start.elapsed());
        collected.map_err(|error| self.crew.end(error))
    }

    /// Returns a card's tiles to the scheduler after an error. Returns whether the card is retried.
    fn recover(&mut self, error: SessionError) -> Result<bool, RenderError> {
        let Self { number, crew, .. } = *self;
        if let Some(tile) = error.lie() {
            crew.dispatcher.distrust(number, tile);
        }
        if !error.may_pass() {
            self.session.give_back();
            self.collect()?;
            crew.lose(number, CardError::Session(error), Standing::GivenUp, self.is_lost)?;
            return Ok(false);
        }
        let is_closed = matches!(error, SessionError::Port(_));
        self.session.greet_again(crew.start.elapsed());
        self.collect()?;
        if !std::mem::replace(&mut self.is_lost, true) {
            crew.lose(number, CardError::Session(error), Standing::Lost, false)?;
        }
        if is_closed { self.reopen() } else { Ok(true) }
    }

    /// Reconnects to a card whose link was closed. Returns false for an emulated card, which cannot be reached again.
    fn reopen(&mut self) -> Result<bool, RenderError> {
        let Some(address) = self.card.close() else { return Ok(false) };
        if let Some(port) = reopen(&address, &|longest| self.crew.wait_for_end(longest))? {
            self.card.go_on_with(port);
        }
        Ok(true)
    }

    fn tell_progress(&self, outcome: &mut CardOutcome, job: Job) {
        let Self { session, crew, .. } = self;
        if session.is_loaded() {
            if outcome.loaded.is_zero() {
                outcome.loaded = crew.start.elapsed();
            }
            let (done, total) = crew.dispatcher.scheduler().progress();
            crew.outputs.observer.progress(Phase::Tiles, done as u64, total as u64);
        } else if outcome.loaded.is_zero() {
            let [loaded, all] =
                [session.loaded_lines(), job.image.len()].map(|lines| (lines * LINE_BYTES) as u64);
            crew.outputs.observer.progress(Phase::Load, loaded, all);
        }
    }
}
