//! Work of the host on a card, which moves bytes between the card's port and its session.

use std::time::Duration;

use photoncard_cards::link::LinkError;
use photoncard_cards::scheduler::{CardNumber, Standing};
use photoncard_cards::session::{Job, Restart, SessionError};
use photoncard_shared::address::LINE_BYTES;
use photoncard_shared::link::PortError;

use super::crew::{Crew, EndOthersOnPanic};
use super::greeting::GreetedCard;
use super::open_card::{WAIT, exchange, reopen};
use super::{CardError, Phase, RenderError};

struct CardAtWork<'a> {
    number: CardNumber,
    greeted: &'a mut GreetedCard,
    /// True from the time when the loss of the card is reported until the card is loaded again.
    is_lost: bool,
    crew: &'a Crew<'a>,
}

/// Loads the card image into a card and renders tiles on the card until all are done. A lost card is greeted
/// again while other cards render. A card that sends wrong data, or fails repeatedly, is given up. Returns
/// the time from the start of the crew until the card was loaded; zero if it was not loaded.
pub(super) async fn render_on(
    number: CardNumber,
    greeted: &mut GreetedCard,
    job: &Job,
    crew: &Crew<'_>,
) -> Result<Duration, RenderError> {
    let _guard = EndOthersOnPanic(&crew.failed);
    greeted.session.start(job.clone(), crew.start.elapsed());
    let mut at_work = CardAtWork { number, greeted, is_lost: false, crew };
    let mut loaded = Duration::ZERO;
    while !crew.is_complete()? && !at_work.greeted.card.trace_has_failed() && at_work.go_on()? {
        at_work.tell_progress(&mut loaded, job);
        crew.hands.pass().await;
    }
    Ok(loaded)
}

impl CardAtWork<'_> {
    /// Exchanges bytes and tiles with the card once. Returns false if the card failed and is not retried.
    fn go_on(&mut self) -> Result<bool, RenderError> {
        let Self { number, crew, .. } = *self;
        let dispatcher = &crew.dispatcher;
        dispatcher.supply(number, &mut self.greeted.session, crew.start.elapsed());
        if self.greeted.session.is_idle() && crew.hands.may_wait() {
            dispatcher.wait(WAIT);
        }
        let slowest = dispatcher.scheduler().slowest(number);
        let GreetedCard { card, session, .. } = &mut *self.greeted;
        let exchanged =
            dispatcher.check_card(number).and_then(|()| exchange(session, card, slowest, crew.start));
        // Answers that came before the error are valid.
        self.collect()?;
        self.is_lost &= !self.greeted.session.is_loaded();
        exchanged.map_or_else(|error| self.recover(error), |()| Ok(true))
    }

    fn collect(&mut self) -> Result<(), RenderError> {
        let collected =
            self.crew.dispatcher.collect(self.number, &mut self.greeted.session, self.crew.start.elapsed());
        collected.map_err(|error| self.crew.end(error))
    }

    /// Gives the card's tiles back to the scheduler after an error. Returns whether the card is retried.
    fn recover(&mut self, error: SessionError) -> Result<bool, RenderError> {
        let Self { number, crew, .. } = *self;
        if error.is_wrong() {
            crew.dispatcher.distrust(number, error.lie());
        }
        if !error.may_pass() {
            self.greeted.session.give_back();
            self.collect()?;
            crew.lose(number, CardError::Session(error), Standing::GivenUp)?;
            return Ok(false);
        }
        let is_closed = matches!(error, SessionError::Port(_));
        self.greeted.session.restart(Restart::Lost, crew.start.elapsed());
        self.collect()?;
        if !std::mem::replace(&mut self.is_lost, true) {
            crew.lose(number, CardError::Session(error), Standing::Lost)?;
        } else if !crew.has_hope() {
            return Err(crew.fail_by(number, CardError::Session(error)));
        }
        if is_closed { self.reopen() } else { Ok(true) }
    }

    /// Reconnects to a remote card whose link was closed. Returns false for an emulated card.
    fn reopen(&mut self) -> Result<bool, RenderError> {
        let Some(address) = self.greeted.card.close() else { return Ok(false) };
        let wait = |longest, last: &mut Option<LinkError>| {
            if self.crew.has_hope() {
                self.crew.wait_for_end(longest)
            } else {
                Err(self.give_up(last.take()))
            }
        };
        if let Some(port) = reopen(&address, &wait)? {
            self.greeted.card.go_on_with(port);
        }
        Ok(true)
    }

    /// Ends the render because the card has not returned. `last` is the error of the last attempt to reopen
    /// its link, if there was one.
    fn give_up(&self, last: Option<LinkError>) -> RenderError {
        let seconds = self.crew.longest_wait().as_secs();
        let error = match last {
            Some(source) => CardError::Gone { seconds, source },
            None => CardError::Session(SessionError::Port(PortError::Closed)),
        };
        self.crew.fail_by(self.number, error)
    }

    fn tell_progress(&self, loaded: &mut Duration, job: &Job) {
        let Self { greeted, crew, .. } = self;
        let session = &greeted.session;
        if session.is_loaded() {
            if loaded.is_zero() {
                *loaded = crew.start.elapsed();
            }
            let (done, total) = crew.dispatcher.scheduler().progress();
            crew.outputs.observer.progress(Phase::Tiles, done as u64, total as u64);
        } else if loaded.is_zero() {
            let [sent, all] =
                [session.loaded_lines(), job.upload.lines().len()].map(|lines| (lines * LINE_BYTES) as u64);
            crew.outputs.observer.progress(Phase::Load, sent, all);
        }
    }
}
