//! The interface between a board's hardware and the code that all images share.

/// A board: one UART, one clock, one processor. There is one of each, so nothing has a `self`. The module `hardware` of an
/// image calls its own `ThisBoard`.
pub(crate) trait Board {
    /// Its name.
    const NAME: &'static str;

    /// Does what comes before the first message.
    fn prepare() {}

    /// Sets up clock and UART, and lets interrupts in.
    fn start();

    /// A byte that the UART has received.
    fn receive() -> Option<u8>;

    /// Hands the UART a byte to send. Returns whether it had room.
    fn transmit(byte: u8) -> bool;

    /// Whether a received byte is an interrupt.
    fn listen(is_interrupt: bool);

    /// Time since the start, milliseconds, modulo 2^32.
    fn milliseconds() -> u32;

    /// Does some work without interrupts.
    fn masked<R>(work: impl FnOnce() -> R) -> R;

    /// Sleeps until there is an interrupt to be taken, masked or not: a byte's, or the clock's within a millisecond.
    fn sleep();
}
