//! The thread that a card has on the host: it moves bytes between the card's port and its session.

use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::time::{Duration, Instant};

use photoncard_shared::address::LINE_BYTES;
use photoncard_shared::counters::Counters;

use super::cards::{Connected, WAIT, exchange};
use super::open_card::OpenCard;
use super::{Observer, Phase, RenderError};
use crate::emulator::memory_model::MemoryTraffic;
use crate::emulator::trace::TraceFile;
use crate::session::{Job, LinkBytes, Picture, Session, SessionError};

/// What the threads of all cards share.
pub(super) struct Shared<'a> {
    picture: &'a Picture,
    failed: AtomicBool,
    /// Cards that are not lost.
    alive: AtomicUsize,
    observer: &'a dyn Observer,
    start: Instant,
}

/// Ends the threads of the other cards if this one panics: they would wait for its tiles without end.
struct EndOthersOnPanic<'a>(&'a AtomicBool);

impl Drop for EndOthersOnPanic<'_> {
    fn drop(&mut self) {
        if std::thread::panicking() {
            // No thread waits for longer than a moment without looking at this.
            self.0.store(true, Ordering::Relaxed);
        }
    }
}

/// What came of one card.
#[derive(Default)]
pub(super) struct CardOutcome {
    pub(super) counters: Counters,
    pub(super) bytes: LinkBytes,
    pub(super) traffic: Option<MemoryTraffic>,
    pub(super) loaded: Duration,
}

impl CardOutcome {
    pub(super) fn add(&mut self, other: &Self) {
        self.counters.add(&other.counters);
        self.bytes.add(&other.bytes);
        if let Some(traffic) = &other.traffic {
            self.traffic.get_or_insert(MemoryTraffic::ZERO).add(traffic);
        }
        self.loaded = self.loaded.max(other.loaded);
    }
}

impl<'a> Shared<'a> {
    pub(super) fn new(
        picture: &'a Picture,
        observer: &'a dyn Observer,
        start: Instant,
        cards: usize,
    ) -> Self {
        Self { picture, failed: AtomicBool::new(false), alive: AtomicUsize::new(cards), observer, start }
    }

    /// Whether there is nothing left to do.
    ///
    /// # Errors
    /// If the observer or the failure of a card has stopped the render.
    pub(super) fn is_complete(&self) -> Result<bool, RenderError> {
        if self.failed.load(Ordering::Relaxed) || self.observer.is_stopped() {
            return Err(RenderError::Stopped);
        }
        if let Some(error) = self.picture.display_failure() {
            self.observer.not_shown(&error);
        }
        self.picture.check_partial().inspect_err(|_| self.failed.store(true, Ordering::Relaxed))?;
        Ok(self.picture.scheduler().is_complete())
    }

    /// Waits until there is nothing left to do, not longer than `most`. Returns whether that is so.
    ///
    /// # Errors
    /// As [`Self::is_complete`].
    pub(super) fn wait_for_end(&self, most: Duration) -> Result<bool, RenderError> {
        let begin = Instant::now();
        while !self.is_complete()? {
            let left = most.saturating_sub(begin.elapsed());
            if left.is_zero() {
                return Ok(false);
            }
            // Nothing wakes this thread when the render is stopped.
            self.picture.scheduler().wait_for_end(left.min(WAIT));
        }
        Ok(true)
    }

    /// A card is lost, or gives wrong answers; the others go on with its tiles.
    ///
    /// # Errors
    /// If no other is left.
    fn lose(&self, card: &OpenCard, error: SessionError, was_lost: bool) -> Result<(), RenderError> {
        let was_last = !was_lost && self.alive.fetch_sub(1, Ordering::Relaxed) <= 1;
        if was_last {
            self.failed.store(true, Ordering::Relaxed);
            return Err(RenderError::Card { card: card.name(), source: error });
        }
        self.observer.lost(&card.name(), &error);
        Ok(())
    }
}

/// Loads the image into a card and renders tiles on it until none is left. A card that is lost is tried again as long as
/// there are others; one that answers what is wrong, or fails again and again, is not.
pub(super) fn render_on(connected: Connected, job: Job, shared: &Shared) -> Result<CardOutcome, RenderError> {
    let _guard = EndOthersOnPanic(&shared.failed);
    let Connected { mut card, mut session, .. } = connected;
    session.start(job, shared.start.elapsed());
    let mut outcome = CardOutcome::default();
    let mut is_lost = false;
    while !shared.is_complete()? && !card.trace_has_failed() {
        if session.is_idle() {
            shared.picture.scheduler().wait_for_tile(WAIT);
        }
        match exchange(&mut session, &mut card, shared.picture, shared.start) {
            Ok(()) if is_lost && session.is_loaded() => {
                is_lost = false;
                shared.alive.fetch_add(1, Ordering::Relaxed);
            }
            Ok(()) => {}
            Err(error) => {
                if !recover(&mut session, &mut card, error, &mut is_lost, shared)? {
                    break;
                }
            }
        }
        tell_progress(&session, &mut outcome, job, shared);
    }
    outcome.counters = *session.counters();
    outcome.bytes = session.link_bytes();
    if let Some(record) = card.finish() {
        outcome.traffic = Some(record.traffic);
        record.trace.map_or(Ok(()), TraceFile::finish)?;
    }
    Ok(outcome)
}

/// Leaves a card's tiles to the others after an error. Returns whether it is tried again.
fn recover(
    session: &mut Session,
    card: &mut OpenCard,
    error: SessionError,
    is_lost: &mut bool,
    shared: &Shared,
) -> Result<bool, RenderError> {
    if !error.may_pass() {
        session.give_back(shared.picture);
        shared.lose(card, error, *is_lost)?;
        return Ok(false);
    }
    let is_closed = matches!(error, SessionError::Port(_));
    if !std::mem::replace(is_lost, true) {
        shared.lose(card, error, false)?;
    }
    session.greet_again(shared.picture, shared.start.elapsed());
    if is_closed { card.reopen(shared) } else { Ok(true) }
}

fn tell_progress(session: &Session, outcome: &mut CardOutcome, job: Job, shared: &Shared) {
    if session.is_loaded() {
        if outcome.loaded.is_zero() {
            outcome.loaded = shared.start.elapsed();
        }
        let (done, total) = shared.picture.scheduler().progress();
        shared.observer.progress(Phase::Tiles, done as u64, total as u64);
    } else if outcome.loaded.is_zero() {
        let [loaded, all] =
            [session.loaded_lines(), job.image.len()].map(|lines| (lines * LINE_BYTES) as u64);
        shared.observer.progress(Phase::Load, loaded, all);
    }
}
