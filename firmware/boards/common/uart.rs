//! A board's UART as a port: interrupts store received bytes in a ring, and sending polls the transmitter.

use core::marker::PhantomData;
use core::time::Duration;

use photoncard_firmware::serve::Ring;
use photoncard_shared::link::{Port, PortError};

use super::board::{Board, Deadline};

/// Board whose link is a UART.
pub(crate) trait Uart: Board {
    /// Takes a received byte from the UART; `None` if none has arrived.
    fn receive() -> Option<u8>;

    /// Writes a byte to the UART's transmitter. Returns false if the transmitter is full.
    fn transmit(byte: u8) -> bool;

    /// Enables or disables the receive interrupt of the UART.
    fn listen(is_interrupt: bool);
}

/// Capacity of the ring of received bytes, far more than the few tile commands that a host sends while a card
/// computes.
const RECEIVED_BYTES: usize = 512;

static RECEIVED: Ring<RECEIVED_BYTES> = Ring::new();

/// On-chip memory of the port, bytes.
pub(crate) const STATIC_BYTES: usize = size_of::<Ring<RECEIVED_BYTES>>();

/// Handles the UART's interrupt: moves received bytes into the ring until the ring is full. When the ring is
/// full, further bytes stay in the UART, and its interrupt is disabled until [`UartPort`] has read from the
/// ring.
pub(crate) fn receive_all<B: Uart>() {
    while !RECEIVED.is_full() {
        let Some(byte) = B::receive() else { return };
        RECEIVED.put(byte);
    }
    B::listen(false);
}

/// Port that uses a board's UART.
pub(crate) struct UartPort<B>(PhantomData<B>);

impl<B: Uart> UartPort<B> {
    /// Creates the port. A board has only one.
    pub(crate) const fn new() -> Self {
        Self(PhantomData)
    }
}

impl<B: Uart> Port for UartPort<B> {
    fn read(&mut self, buffer: &mut [u8], wait: Duration) -> Result<usize, PortError> {
        let deadline = Deadline::<B>::new(wait);
        loop {
            let mut count = 0;
            for target in &mut *buffer {
                let Some(byte) = RECEIVED.take() else { break };
                *target = byte;
                count += 1;
            }
            // The ring has room again: the interrupt may have been disabled because it was full.
            B::masked(|| {
                B::listen(true);
                receive_all::<B>();
            });
            if count > 0 || deadline.is_over() {
                return Ok(count);
            }
            B::masked(|| {
                if RECEIVED.is_empty() {
                    B::sleep();
                }
            });
        }
    }

    fn write(&mut self, bytes: &[u8], wait: Duration) -> Result<usize, PortError> {
        let deadline = Deadline::<B>::new(wait);
        loop {
            let sent = bytes.iter().take_while(|&&byte| B::transmit(byte)).count();
            if sent > 0 || deadline.is_over() {
                return Ok(sent);
            }
        }
    }
}
