//! Main loop of a card on a port, for boards and for the emulated card.

#[cfg(feature = "embedded-io-async")]
mod asynchronous;
mod ring;

use core::time::Duration;

#[cfg(feature = "embedded-io-async")]
pub use asynchronous::{ServeError, serve_async};
use photoncard_shared::link::{Port, PortError};
pub use ring::Ring;

use crate::card::Card;
use crate::kind::ChipKind;
use crate::memory::CardMemory;

/// Maximum time that an idle card waits for a byte.
const IDLE_WAIT: Duration = Duration::from_millis(20);

/// Serves a card on a port until the port fails: receives bytes, works, and sends bytes.
///
/// Calls [`Card::work`] at most once between two reads of the port.
///
/// # Errors
/// The port's failure; [`PortError::Closed`] is the regular end of a session.
pub fn serve<K: ChipKind, M: CardMemory>(
    card: &mut Card<K, M>,
    port: &mut (impl Port + ?Sized),
) -> Result<(), PortError> {
    let mut buffer = [0; 512];
    loop {
        let must_not_wait = card.is_busy() || !card.outgoing().is_empty();
        let wait = if must_not_wait { Duration::ZERO } else { IDLE_WAIT };
        match port.read(&mut buffer, wait)? {
            0 => card.acknowledge(),
            received => card.feed(buffer.get(..received).unwrap_or(&[])),
        }
        if card.outgoing().is_empty() {
            card.work();
        } else {
            let sent = port.write(card.outgoing(), IDLE_WAIT)?;
            card.sent(sent);
        }
    }
}
