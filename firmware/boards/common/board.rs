//! Interface between a board's hardware and the code that all images share.

/// Board with one UART, one clock and one processor. Functions have no `self`, because there is one of each.
/// Every image defines its `ThisBoard` in a module `hardware`.
pub(crate) trait Board {
    const NAME: &'static str;

    /// Prepares the board for its first message.
    fn prepare() {}

    /// Initializes clock and UART, and enables interrupts.
    fn start();

    /// Reads a byte from the UART's receiver, if there is one.
    fn receive() -> Option<u8>;

    /// Writes a byte to the UART's transmitter. Returns false if the transmitter is full.
    fn transmit(byte: u8) -> bool;

    /// Enables or disables the receive interrupt of the UART.
    fn listen(is_interrupt: bool);

    /// Returns the time since the start, milliseconds, modulo 2^32.
    fn milliseconds() -> u32;

    /// Runs `work` with interrupts masked.
    fn masked<R>(work: impl FnOnce() -> R) -> R;

    /// Sleeps until an interrupt is pending, masked or not. It is the UART's, or within a millisecond the
    /// clock's.
    fn sleep();
}
