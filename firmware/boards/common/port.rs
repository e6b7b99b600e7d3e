//! A board's UART as a port: interrupts store received bytes in a ring, and sending polls the transmitter.

use core::marker::PhantomData;
use core::time::Duration;

use photoncard_firmware::serve::Ring;
use photoncard_shared::link::{Port, PortError};

use super::board::Board;

/// Capacity of the ring of received bytes, far more than the few tile commands that a host sends while a card
/// computes.
const RECEIVED_BYTES: usize = 512;

static RECEIVED: Ring<RECEIVED_BYTES> = Ring::new();

/// On-chip memory of the port, bytes.
pub(super) const STATIC_BYTES: usize = size_of::<Ring<RECEIVED_BYTES>>();

/// Handles the UART's interrupt: moves received bytes into the ring until the ring is full. When the ring is
/// full, further bytes stay in the UART, and its interrupt is disabled until [`BoardPort`] has read from the
/// ring.
pub(crate) fn receive_all<B: Board>() {
    while !RECEIVED.is_full() {
        let Some(byte) = B::receive() else { return };
        RECEIVED.put(byte);
    }
    B::listen(false);
}

/// Port that uses a board's UART.
pub(super) struct BoardPort<B>(PhantomData<B>);

impl<B: Board> BoardPort<B> {
    /// Creates the port. A board has only one.
    pub(super) const fn new() -> Self {
        Self(PhantomData)
    }
}

/// Time limit of a wait: start and length, milliseconds.
struct Deadline {
    start: u32,
    wait: u32,
}

impl Deadline {
    fn new<B: Board>(wait: Duration) -> Self {
        Self { start: B::milliseconds(), wait: u32::try_from(wait.as_millis()).unwrap_or(u32::MAX) }
    }

    fn is_over<B: Board>(&self) -> bool {
        B::milliseconds().wrapping_sub(self.start) >= self.wait
    }
}

impl<B: Board> Port for BoardPort<B> {
    fn read(&mut self, buffer: &mut [u8], wait: Duration) -> Result<usize, PortError> {
        let deadline = Deadline::new::<B>(wait);
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
            if count > 0 || deadline.is_over::<B>() {
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
        let deadline = Deadline::new::<B>(wait);
        loop {
            let sent = bytes.iter().take_while(|&&byte| B::transmit(byte)).count();
            if sent > 0 || deadline.is_over::<B>() {
                return Ok(sent);
            }
        }
    }
}
