//! State shared by the threads of all cards.

use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Mutex, PoisonError};
use std::time::{Duration, Instant};

use photoncard_cards::dispatcher::Dispatcher;
use photoncard_cards::scheduler::{CardNumber, SchedulerError, Source, Standing, rectangles};

use super::hands::Hands;
use super::open_card::WAIT;
use super::outputs::Outputs;
use super::{CardError, RenderError};

pub(super) struct Crew<'a> {
    pub(super) dispatcher: Dispatcher<'a>,
    pub(super) outputs: &'a Outputs<'a>,
    pub(super) hands: &'a Hands,
    pub(super) start: Instant,
    /// Name of each card in errors.
    pub(super) names: &'a [String],
    /// Time for which the render waits for each card after it is lost, if no other card is left.
    pub(super) waits: Vec<Duration>,
    /// Time since which no card is left; `None` if a card was left when the crew last looked.
    pub(super) alone: Mutex<Option<Instant>>,
    pub(super) failed: AtomicBool,
}

/// Guard that stops the threads of the other cards if its own thread panics. Otherwise they would wait
/// forever for the tiles of the panicked thread.
pub(super) struct EndOthersOnPanic<'a>(pub(super) &'a AtomicBool);

impl Drop for EndOthersOnPanic<'_> {
    fn drop(&mut self) {
        if std::thread::panicking() {
            // No thread waits longer than [`WAIT`] before it reads the flag.
            self.0.store(true, Ordering::Relaxed);
        }
    }
}

impl Crew<'_> {
    /// Returns whether all tiles are done.
    ///
    /// # Errors
    /// If the observer stopped the render, a card failed, or a finished tile could not be stored.
    pub(super) fn is_complete(&self) -> Result<bool, RenderError> {
        if self.failed.load(Ordering::Relaxed) || self.outputs.observer.is_stopped() {
            return Err(RenderError::Stopped);
        }
        self.outputs.report_failed_viewers();
        self.outputs.check_partial().map_err(|error| self.fail(error.into()))?;
        Ok(self.dispatcher.scheduler().is_complete())
    }

    /// Waits until all tiles are done, for at most `longest`. Returns whether they are.
    ///
    /// # Errors
    /// As [`Self::is_complete`].
    pub(super) fn wait_for_end(&self, longest: Duration) -> Result<bool, RenderError> {
        let begin = Instant::now();
        while !self.is_complete()? {
            let left = longest.saturating_sub(begin.elapsed());
            if left.is_zero() {
                return Ok(false);
            }
            // A stop of the render does not notify this thread.
            self.dispatcher.wait(left.min(WAIT));
        }
        Ok(true)
    }

    /// Tells the threads of all cards to stop. Returns `error`.
    pub(super) fn fail(&self, error: RenderError) -> RenderError {
        self.failed.store(true, Ordering::Relaxed);
        error
    }

    /// Marks a card as lost or given up (`standing`), and reports it to the observer. Other cards render its
    /// tiles. If none is left, the render waits for lost cards.
    ///
    /// # Errors
    /// If no other card is left, and no lost one may return.
    pub(super) fn lose(
        &self,
        card: CardNumber,
        error: CardError,
        standing: Standing,
    ) -> Result<(), RenderError> {
        // Ends an earlier wait if a card has come back since.
        self.has_hope();
        let mut scheduler = self.dispatcher.scheduler();
        scheduler.set_standing(card, standing);
        let is_last = !scheduler.has_living();
        drop(scheduler);
        let (name, observer) = (&self.names[card], self.outputs.observer);
        if !is_last {
            observer.lost(name, &error);
        } else if self.has_hope() {
            observer.waits_for(name, &error, self.longest_wait());
        } else {
            return Err(self.fail_by(card, error));
        }
        Ok(())
    }

    /// Returns whether a card is left, or a lost one may still return.
    pub(super) fn has_hope(&self) -> bool {
        let mut alone = self.alone.lock().unwrap_or_else(PoisonError::into_inner);
        if self.dispatcher.scheduler().has_living() {
            *alone = None;
            return true;
        }
        alone.get_or_insert_with(Instant::now).elapsed() < self.longest_wait()
    }

    /// Longest time for which the render waits for a lost card, if no card is left.
    pub(super) fn longest_wait(&self) -> Duration {
        let scheduler = self.dispatcher.scheduler();
        let cards = self.waits.iter().enumerate();
        let lost = cards.filter(|&(card, _)| scheduler.standing(card) == Standing::Lost);
        lost.map(|(_, wait)| *wait).max().unwrap_or_default()
    }

    /// Tells the threads of all cards to stop because of the error of the last card. Returns the error of the
    /// render.
    pub(super) fn fail_by(&self, card: CardNumber, source: CardError) -> RenderError {
        let crashed_at = self.dispatcher.scheduler().crashed_at();
        self.fail(if crashed_at.is_empty() {
            RenderError::Card { card: self.names[card].clone(), source }
        } else {
            RenderError::Unrendered { tiles: rectangles(&crashed_at) }
        })
    }

    /// Tells the threads of all cards to stop because of the error `error` of the scheduler. Returns the
    /// corresponding error of the render.
    pub(super) fn end(&self, error: SchedulerError) -> RenderError {
        let name = |source: &Source| match *source {
            Source::Card(card) => self.names[card].clone(),
            Source::Kept => "the file of finished tiles".into(),
        };
        self.fail(match error {
            SchedulerError::Disagreement { tile, sources } => RenderError::Disagreement {
                tile: rectangles(&[tile]),
                cards: sources.iter().map(name).collect::<Vec<_>>().join(" and "),
            },
            SchedulerError::KeptDiffers { tile } => RenderError::KeptDiffers { tile: rectangles(&[tile]) },
            SchedulerError::Unverified { tile } => RenderError::Unverified { tile: rectangles(&[tile]) },
            SchedulerError::Unrendered { tiles } => RenderError::Unrendered { tiles: rectangles(&tiles) },
        })
    }
}
