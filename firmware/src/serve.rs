//! A card on a port: the loop that a board and the emulated card both run.

use core::time::Duration;

use photoncard_shared::link::{Port, PortError};

use crate::card::Card;
use crate::memory::CardMemory;

/// How long an idle card waits for a byte before it looks around.
const IDLE_WAIT: Duration = Duration::from_millis(20);

/// Serves a card on a port until the port fails: bytes in, work, bytes out.
///
/// Between two looks at the port lies at most one call of [`Card::work`].
///
/// # Errors
/// Why the port cannot go on; [`PortError::Closed`] is how a session ends in order.
pub fn serve<
    M: CardMemory,
    const TILE_PIXELS: usize,
    const CANDIDATES: usize,
    const QUEUE: usize,
    const RECORDS: usize,
    const GATHERED: usize,
>(
    card: &mut Card<M, TILE_PIXELS, CANDIDATES, QUEUE, RECORDS, GATHERED>,
    port: &mut impl Port,
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
