//! How long a card may be silent or come no further, and when it is asked whether it is there.

use std::time::Duration;

use super::SessionError;

/// How long a card may be silent while an answer is due: it answers between any two pieces of its work.
const SILENCE: Duration = Duration::from_secs(10);
/// How long it may be silent before it is asked; after each question without an answer twice as long.
const PATIENCE: Duration = Duration::from_millis(200);
const MAX_PATIENCE: Duration = Duration::from_secs(1);
/// How long a card that answers may leave a hello without its reply, from its first answer on. A slow serial line takes a
/// second or two.
const GREETING: Duration = Duration::from_secs(5);
/// The shortest time for a tile, where those that were rendered tell how long one may take.
const TILE: Duration = Duration::from_secs(30);
/// How long a card that answers may take to come further with all but tiles. The longest is to look through a whole image
/// that has come, and takes seconds.
const STANDSTILL: Duration = Duration::from_secs(120);
/// What a ray with its gather may add to that for a tile, whose pixels may all come at its end, as long as no tile was
/// rendered: some fifty times of what the slowest chip takes that has been measured.
const RAY: Duration = Duration::from_millis(20);

/// The most time between two looks at a link of a host that runs. For the rest it is absent: stopped, or without a
/// processor.
const MAX_BETWEEN_LOOKS: Duration = Duration::from_secs(1);

/// When a card was heard.
pub(super) struct Clock {
    /// When the first of the session came.
    heard: Option<Duration>,
    /// When silence began that counts.
    since: Duration,
    /// When a message passed last, in either direction.
    passed: Duration,
    /// When there was last a reason to wait for an answer.
    asked: Duration,
    patience: Duration,
    /// When the host looked last.
    looked: Duration,
}

impl Clock {
    pub(super) fn new(now: Duration) -> Self {
        Self { heard: None, since: now, passed: now, asked: now, patience: PATIENCE, looked: now }
    }

    /// Something of the session came.
    pub(super) fn heard(&mut self, now: Duration) {
        self.heard.get_or_insert(now);
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

    /// The host looks at the link. What it was absent is not the card's silence.
    pub(super) fn look(&mut self, now: Duration) {
        let absent = now.saturating_sub(self.looked).saturating_sub(MAX_BETWEEN_LOOKS);
        self.looked = now;
        let times = [&mut self.since, &mut self.passed, &mut self.asked];
        for time in times.into_iter().chain(&mut self.heard) {
            *time = (*time + absent).min(now);
        }
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
            self.patience = (2 * self.patience).min(MAX_PATIENCE);
        }
        must_ask
    }

    /// Whether a card that is greeted answers, but not with a hello.
    pub(super) fn is_greeted_in_vain(&self, now: Duration) -> bool {
        self.heard.is_some_and(|heard| now.saturating_sub(heard) > GREETING)
    }

    /// Checks that the silence is not too long, nor the standstill of a card at work on tiles of `rays` rays at the most, each of
    /// `slowest` seconds at the most if that is known.
    ///
    /// # Errors
    /// If one is.
    pub(super) fn check(&self, rays: u64, slowest: Option<f64>, now: Duration) -> Result<(), SessionError> {
        if now.saturating_sub(self.since) > SILENCE {
            return Err(SessionError::Silent(SILENCE));
        }
        let limit = match slowest.filter(|_| rays > 0) {
            // A ray has a gather at its end.
            Some(slowest) => time(2.0 * rays as f64 * slowest).max(TILE),
            None => STANDSTILL.saturating_add(RAY.saturating_mul(rays.try_into().unwrap_or(u32::MAX))),
        };
        if now.saturating_sub(self.passed) > limit {
            return Err(SessionError::Standstill(limit));
        }
        Ok(())
    }
}

/// A time of some seconds, up to the longest there is.
fn time(seconds: f64) -> Duration {
    Duration::try_from_secs_f64(seconds).unwrap_or(Duration::MAX)
}
