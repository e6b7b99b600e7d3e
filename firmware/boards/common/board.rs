//! Interface between a board's hardware and the code that all board images share.

/// Board with one UART, one clock and one processor. Functions have no `self`, because there is one of each.
/// Every board image names its board `ThisBoard` in its module `hardware`.
pub(crate) trait Board {
    const NAME: &'static str;

    /// Prepares the output of diagnostics; called before anything else.
    fn prepare() {}

    /// Initializes clock and UART, and enables interrupts.
    fn start();

    /// Takes a received byte from the UART; `None` if none has arrived.
    fn receive() -> Option<u8>;

    /// Writes a byte to the UART's transmitter. Returns false if the transmitter is full.
    fn transmit(byte: u8) -> bool;

    /// Enables or disables the receive interrupt of the UART.
    fn listen(is_interrupt: bool);

    /// Returns the time since the start, milliseconds, modulo 2^32.
    fn milliseconds() -> u32;

    /// Runs `work` with interrupts masked.
    fn masked<R>(work: impl FnOnce() -> R) -> R;

    /// Sleeps until an interrupt is pending, even if it is masked: the interrupt of the UART, or that of the
    /// clock, which comes within a millisecond.
    fn sleep();
}
