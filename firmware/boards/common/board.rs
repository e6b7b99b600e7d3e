//! Interface between a board's hardware and the code that all board images share.

use core::marker::PhantomData;
use core::time::Duration;

use photoncard_shared::link::Port;

/// Board with one link, one clock and one processor. Functions have no `self`, because there is one of each.
/// Every board image names its board `ThisBoard` in its module `hardware`.
pub(crate) trait Board {
    const NAME: &'static str;

    /// Clock rate of [`Self::CYCLES`], Hz; 0 if it is unknown.
    const CLOCK_HZ: u32 = 0;

    /// Function that reads a counter of processor cycles; `None` without such a counter.
    const CYCLES: Option<fn() -> u32> = None;

    /// On-chip memory of the link, bytes.
    const LINK_BYTES: usize;

    /// Prepares the output of diagnostics; called before anything else.
    fn prepare() {}

    /// Initializes clock and link, and enables interrupts.
    fn start();

    /// Returns the link to hosts. Called once, after [`Self::start`].
    fn port() -> impl Port;

    /// Returns the time since the start, milliseconds, modulo 2^32.
    fn milliseconds() -> u32;

    /// Runs `work` with interrupts masked.
    fn masked<R>(work: impl FnOnce() -> R) -> R;

    /// Sleeps until an interrupt is pending, even if it is masked: the interrupt of the link, or that of the
    /// clock, which comes within a millisecond.
    fn sleep();
}

/// Time limit of a wait by a board's clock: start and length, milliseconds.
pub(crate) struct Deadline<B> {
    start: u32,
    wait: u32,
    board: PhantomData<B>,
}

impl<B: Board> Deadline<B> {
    /// Starts a wait.
    pub(crate) fn new(wait: Duration) -> Self {
        let wait = u32::try_from(wait.as_millis()).unwrap_or(u32::MAX);
        Self { start: B::milliseconds(), wait, board: PhantomData }
    }

    pub(crate) fn is_over(&self) -> bool {
        B::milliseconds().wrapping_sub(self.start) >= self.wait
    }
}
