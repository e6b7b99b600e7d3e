//! Interface between a board's hardware and the code that all images share.

/// Board with one UART, one clock and one processor. As there is one of each, functions have no `self`. The
/// module `hardware` of an image defines `ThisBoard`.
pub(crate) trait Board {
    /// Name of the board.
    const NAME: &'static str;

    /// Prepares the board for its first message.
    fn prepare() {}

    /// Initializes clock and UART, and enables interrupts.
    fn start();

    /// Reads a byte from the UART's receiver, if there is one.
    fn receive() -> Option<u8>;

    /// Writes a byte to the UART's transmitter. Returns false if the transmitter is full.
    fn transmit(byte: u8) -> bool;

    /// Enables or disables the UART's receive interrupt.
    fn listen(is_interrupt: bool);

    /// Time since the start, milliseconds, modulo 2^32.
    fn milliseconds() -> u32;

    /// Runs `work` with interrupts masked.
    fn masked<R>(work: impl FnOnce() -> R) -> R;

    /// Sleeps until an interrupt is pending, masked or not: the UART's, or within a millisecond the clock's.
    fn sleep();
}
