//! Limits of a session: how long a card may be silent or make no progress, when it is probed, and how often
//! it may fail.

use std::time::Duration;

use super::SessionError;

/// Maximum silence of a card that owes an answer. Cards answer between any two steps of their work.
const SILENCE: Duration = Duration::from_secs(10);
/// Silence before the first probe. The time doubles with each unanswered probe, up to `MAX_PATIENCE`.
const PATIENCE: Duration = Duration::from_millis(200);
const MAX_PATIENCE: Duration = Duration::from_secs(1);
/// Maximum time from the first frame of a card to its hello. A slow serial line takes a second or two.
const GREETING: Duration = Duration::from_secs(5);
/// Minimum of the time limit for tiles that is computed from the times of rendered tiles.
const TILE: Duration = Duration::from_secs(30);
/// Maximum time without progress while no tile is rendered. The longest step is the check of a received
/// image, which takes seconds.
const STANDSTILL: Duration = Duration::from_secs(120);
/// Time per ray that is added to [`STANDSTILL`] while a tile is rendered and no times of tiles are known. All
/// pixels of a tile may arrive at its end. The value is some fifty times the time per ray of the slowest
/// measured chip.
const RAY: Duration = Duration::from_millis(20);

/// Maximum time between two polls of the link that counts as silence of the card. A longer gap means that the
/// host was suspended or had no processor time.
const MAX_BETWEEN_LOOKS: Duration = Duration::from_secs(1);

/// Times of events on a session's link.
pub(super) struct Clock {
    /// Time of the first frame received in the session.
    heard: Option<Duration>,
    /// Start of the present silence.
    since: Duration,
    /// Time of the last delivered message, in either direction.
    passed: Duration,
    /// Start of the wait for the present answer.
    asked: Duration,
    patience: Duration,
    /// Time of the last poll.
    looked: Duration,
}

impl Clock {
    pub(super) fn new(now: Duration) -> Self {
        Self { heard: None, since: now, passed: now, asked: now, patience: PATIENCE, looked: now }
    }

    /// Records that a frame of the session was received.
    pub(super) fn heard(&mut self, now: Duration) {
        self.heard.get_or_insert(now);
        self.since = now;
        self.asked = now;
        self.patience = PATIENCE;
    }

    /// Records that a message was delivered, in either direction.
    pub(super) fn passed(&mut self, now: Duration) {
        self.passed = now;
    }

    /// Returns whether any frame of the session was received.
    pub(super) fn has_heard(&self) -> bool {
        self.heard.is_some()
    }

    /// Records that bytes were sent; the time for the answer starts again. A line that accepts no bytes
    /// counts as silent.
    pub(super) fn sent(&mut self, now: Duration) {
        self.asked = now;
    }

    /// Records a poll of the link. Time in which the host did not run does not count as silence of the card.
    pub(super) fn look(&mut self, now: Duration) {
        let absent = now.saturating_sub(self.looked).saturating_sub(MAX_BETWEEN_LOOKS);
        self.looked = now;
        let times = [&mut self.since, &mut self.passed, &mut self.asked];
        for time in times.into_iter().chain(&mut self.heard) {
            *time = (*time + absent).min(now);
        }
    }

    /// Restarts all time limits, because no answer is due.
    pub(super) fn rest(&mut self, now: Duration) {
        self.since = now;
        self.passed = now;
        self.asked = now;
    }

    /// Returns whether a probe is due. If so, the wait for the next one starts.
    pub(super) fn must_ask(&mut self, now: Duration) -> bool {
        let must_ask = now.saturating_sub(self.asked) > self.patience;
        if must_ask {
            self.asked = now;
            self.patience = (2 * self.patience).min(MAX_PATIENCE);
        }
        must_ask
    }

    /// Returns whether more than [`GREETING`] has passed since the first frame of a card that has not said
    /// hello.
    pub(super) fn is_greeted_in_vain(&self, now: Duration) -> bool {
        self.heard.is_some_and(|heard| now.saturating_sub(heard) > GREETING)
    }

    /// Checks the limits of silence and of time without progress, for a card that works on tiles of `rays`
    /// rays in all. `slowest` is the time limit per ray or gather, seconds, if known.
    ///
    /// # Errors
    /// If the card has exceeded either limit.
    pub(super) fn check(&self, rays: u64, slowest: Option<f64>, now: Duration) -> Result<(), SessionError> {
        if now.saturating_sub(self.since) > SILENCE {
            return Err(SessionError::Silent(SILENCE));
        }
        let limit = match slowest.filter(|_| rays > 0) {
            // Each ray may have a gather.
            Some(slowest) => time(2.0 * rays as f64 * slowest).max(TILE),
            None => STANDSTILL.saturating_add(RAY.saturating_mul(rays.try_into().unwrap_or(u32::MAX))),
        };
        if now.saturating_sub(self.passed) > limit {
            return Err(SessionError::Standstill(limit));
        }
        Ok(())
    }
}

/// Duration of `seconds`, limited to [`Duration::MAX`].
fn time(seconds: f64) -> Duration {
    Duration::try_from_secs_f64(seconds).unwrap_or(Duration::MAX)
}

/// Maximum number of failures without a completed tile.
const MAX_FAILURES: u32 = 4;

pub(super) struct Failures {
    /// Maximum number of failures without a completed tile.
    most: u32,
    /// Number of resets and standstills since the last completed tile.
    failed: u32,
    /// Number of lines that the card has written. A smaller number in its next hello reveals a reset.
    written_lines: u32,
}

impl Default for Failures {
    fn default() -> Self {
        Self { most: MAX_FAILURES, failed: 0, written_lines: 0 }
    }
}

impl Failures {
    /// Creates the count of a card whose first failure is an error.
    pub(super) fn none_allowed() -> Self {
        Self { most: 0, ..Self::default() }
    }

    /// Counts a reset or a standstill.
    ///
    /// # Errors
    /// If there are more than the maximum.
    pub(super) fn count(&mut self) -> Result<(), SessionError> {
        self.failed += 1;
        if self.failed > self.most { Err(SessionError::Failures(self.failed)) } else { Ok(()) }
    }

    /// Forgets the written lines after a known reset, so that the next hello does not count the reset again.
    pub(super) fn forget_lines(&mut self) {
        self.written_lines = 0;
    }

    /// Compares the number of written lines in a hello with the last known number. Returns whether the card
    /// was reset since it was loaded.
    pub(super) fn says_hello(&mut self, written_lines: u32) -> bool {
        std::mem::replace(&mut self.written_lines, written_lines) > written_lines
    }

    /// Records that the card holds a card image of `lines` lines.
    pub(super) fn is_loaded(&mut self, lines: u32) {
        self.written_lines = lines;
    }

    /// Resets the count after a completed tile.
    pub(super) fn completes_tile(&mut self) {
        self.failed = 0;
    }
}
