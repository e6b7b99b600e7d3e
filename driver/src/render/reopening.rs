//! Reaching a card again whose link was closed.

use std::sync::mpsc::{Receiver, RecvTimeoutError, channel};
use std::time::Duration;

use super::RenderError;
use super::address::RemoteAddress;
use super::exchange::WAIT;
use super::open_card::{BoxedPort, reach};

/// How long a lost card is left alone.
const RETRY: Duration = Duration::from_millis(500);

/// Tries to reach a card until it is there, or nothing is left to do: which `wait_for_end` waits for, not longer than it is
/// given.
pub(super) fn reopen(
    address: &RemoteAddress,
    wait_for_end: &dyn Fn(Duration) -> Result<bool, RenderError>,
) -> Result<Option<BoxedPort>, RenderError> {
    // Before the first try as well: what closes each link at once is not to be asked without a pause.
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

/// Tries once, on a thread of its own: an address may take seconds to be looked up or to answer, and a render that ends does
/// not wait for it. A port that nobody receives is closed.
fn try_to_reach(address: RemoteAddress) -> Receiver<Option<BoxedPort>> {
    let (sender, receiver) = channel();
    let work = move || {
        // The render may have ended.
        let _ = sender.send(reach(&address).ok());
    };
    // Without a thread, the next try comes later.
    let _ = std::thread::Builder::new().name("reopen".into()).spawn(work);
    receiver
}
