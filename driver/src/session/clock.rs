//! How long a card may be silent or come no further, and when it is asked whether it is there.

use std::time::Duration;

use super::SessionError;

/// How long a card may be silent while an answer is due: it answers between any two pieces of its work.
const SILENCE: Duration = Duration::from_secs(10);
/// How long it may be silent before it is asked; after each question without an answer twice as long.
const PATIENCE: Duration = Duration::from_millis(200);
const MOST_PATIENCE: Duration = Duration::from_secs(1);
/// How long a card that answers may leave a hello without its reply. A slow serial line takes a second or two.
const GREETING: Duration = Duration::from_secs(5);
/// How long a card that answers may take to come further with all but tiles. The longest is to look through a whole image
/// that has come, and takes seconds.
const STANDSTILL: Duration = Duration::from_secs(120);
/// What a ray with its gather may add to that for a tile, whose pixels may all come at its end: some fifty times of what
/// the slowest chip takes that has been measured.
const RAY: Duration = Duration::from_millis(20);

/// When a card was heard.
pub(super) struct Clock {
    begun: Duration,
    heard: Option<Duration>,
    /// When silence began that counts.
    since: Duration,
    /// When a message passed last, in either direction.
    passed: Duration,
    /// When there was last a reason to wait for an answer.
    asked: Duration,
    patience: Duration,
}

impl Clock {
    pub(super) fn new(now: Duration) -> Self {
        Self { begun: now, heard: None, since: now, passed: now, asked: now, patience: PATIENCE }
    }

    /// Something of the session came.
    pub(super) fn heard(&mut self, now: Duration) {
        self.heard = Some(now);
        self.since = now;
        self.asked = now;
        self.patience = PATIENCE;
    }

    /// A message came that is the next, or one was taken.
    pub(super) fn passed(&mut self, now: Duration) {
        self.passed = now;
    }

    /// Whether anything of the session ever came.
    pub(super) fn has_heard(&self) -> bool {
        self.heard.is_some()
    }

    /// Something was sent: its answer takes its time. A line that takes no byte is silent.
    pub(super) fn sent(&mut self, now: Duration) {
        self.asked = now;
    }

    /// Nothing is expected.
    pub(super) fn rest(&mut self, now: Duration) {
        self.since = now;
        self.passed = now;
        self.asked = now;
    }

    /// Whether to ask now.
    pub(super) fn must_ask(&mut self, now: Duration) -> bool {
        let must_ask = now.saturating_sub(self.asked) > self.patience;
        if must_ask {
            self.asked = now;
            self.patience = (2 * self.patience).min(MOST_PATIENCE);
        }
        must_ask
    }

    /// Whether a card that is greeted answers, but not with a hello.
    pub(super) fn is_greeted_in_vain(&self, now: Duration) -> bool {
        self.has_heard() && now.saturating_sub(self.begun) > GREETING
    }

    /// Checks that the silence is not too long, nor the standstill of a card at work on tiles of `rays` rays at the most.
    ///
    /// # Errors
    /// If one is.
    pub(super) fn check(&self, rays: u64, now: Duration) -> Result<(), SessionError> {
        if now.saturating_sub(self.since) > SILENCE {
            return Err(SessionError::Silent(SILENCE));
        }
        let limit = STANDSTILL.saturating_add(RAY.saturating_mul(rays.try_into().unwrap_or(u32::MAX)));
        if now.saturating_sub(self.passed) > limit {
            return Err(SessionError::Standstill(limit));
        }
        Ok(())
    }
}
