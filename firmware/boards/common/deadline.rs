//! Time limits of waits.

use core::time::Duration;

use super::board::Board;

/// Time limit of a wait: start and length, milliseconds.
pub(crate) struct Deadline {
    start: u32,
    wait: u32,
}

impl Deadline {
    /// Starts a wait.
    pub(crate) fn new<B: Board>(wait: Duration) -> Self {
        Self { start: B::milliseconds(), wait: u32::try_from(wait.as_millis()).unwrap_or(u32::MAX) }
    }

    pub(crate) fn is_over<B: Board>(&self) -> bool {
        B::milliseconds().wrapping_sub(self.start) >= self.wait
    }
}
