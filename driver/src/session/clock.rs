//! How long a card may be silent, and when it is asked whether it is there.

use std::time::Duration;

use super::SessionError;

/// How long a card may be silent while an answer is due: it answers between any two pieces of its work.
const SILENCE: Duration = Duration::from_secs(10);
/// How long it may be silent before it is asked; after each question without an answer twice as long.
const PATIENCE: Duration = Duration::from_millis(200);
const MOST_PATIENCE: Duration = Duration::from_secs(1);

/// When a card was heard.
pub(super) struct Clock {
    heard: Option<Duration>,
    /// When silence began that counts.
    since: Duration,
    /// When there was last a reason to wait for an answer.
    asked: Duration,
    patience: Duration,
}

impl Clock {
    pub(super) fn new(now: Duration) -> Self {
        Self { heard: None, since: now, asked: now, patience: PATIENCE }
    }

    /// Something of the session came.
    pub(super) fn heard(&mut self, now: Duration) {
        *self = Self { heard: Some(now), since: now, asked: now, patience: PATIENCE };
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

    /// Checks that the silence is not too long.
    ///
    /// # Errors
    /// If it is.
    pub(super) fn check(&self, now: Duration) -> Result<(), SessionError> {
        if now.saturating_sub(self.since) > SILENCE { Err(SessionError::Silent(SILENCE)) } else { Ok(()) }
    }
}
