//! Reconnection to a card whose link was closed.

use std::sync::mpsc::{Receiver, RecvTimeoutError, channel};
use std::time::Duration;

use super::RenderError;
use super::exchange::WAIT;
use super::open_card::{BoxedPort, reach};
use photoncard_cards::link::RemoteAddress;

/// Pause before each attempt to reconnect.
const RETRY: Duration = Duration::from_millis(500);

/// Tries to reconnect to a card until it succeeds, or all tiles are done. `wait_for_end` waits for at most
/// the given time and returns whether all tiles are done.
pub(super) fn reopen(
    address: &RemoteAddress,
    wait_for_end: &dyn Fn(Duration) -> Result<bool, RenderError>,
) -> Result<Option<BoxedPort>, RenderError> {
    // The first attempt waits as well: a peer that closes every link at once must not be contacted in a tight
    // loop.
    while !wait_for_end(RETRY)? {
        let attempt = try_to_reach(address.clone());
        loop {
            match attempt.recv_timeout(WAIT) {
                Ok(Some(port)) => return Ok(Some(port)),
                Err(RecvTimeoutError::Timeout) if wait_for_end(Duration::ZERO)? => return Ok(None),
                Err(RecvTimeoutError::Timeout) => {}
                Ok(None) | Err(RecvTimeoutError::Disconnected) => break,
            }
        }
    }
    Ok(None)
}

/// Tries to connect once, on a separate thread: resolving or connecting to an address can take seconds, and a
/// render that ends does not wait for it. A port that nobody receives is closed.
fn try_to_reach(address: RemoteAddress) -> Receiver<Option<BoxedPort>> {
    let (sender, receiver) = channel();
    let work = move || {
        // The receiver is gone if the render has ended.
        let _ = sender.send(reach(&address).ok());
    };
    // If no thread can be started, the next attempt follows later.
    let _ = std::thread::Builder::new().name("reopen".into()).spawn(work);
    receiver
}
