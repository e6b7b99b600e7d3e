//! Reaching a card again whose link was closed.

use std::sync::mpsc::{Receiver, RecvTimeoutError, channel};
use std::time::Duration;

use photoncard_shared::link::Port;

use super::RenderError;
use super::address::CardAddress;
use super::card_thread::Shared;
use super::cards::WAIT;
use super::open_card::reach;

/// How long a lost card is left alone.
const RETRY: Duration = Duration::from_millis(500);

/// A port, once it is there.
pub(super) type Reopened = Option<Box<dyn Port + Send>>;

/// Tries to reach a card again until it is there, or nothing is left to do.
pub(super) fn reopen(address: &CardAddress, shared: &Shared) -> Result<Reopened, RenderError> {
    // Before the first try as well: what closes each link at once is not to be asked without a pause.
    while !shared.wait_for_end(RETRY)? {
        let attempt = try_to_reach(address.clone());
        loop {
            match attempt.recv_timeout(WAIT) {
                Ok(Some(port)) => return Ok(Some(port)),
                Err(RecvTimeoutError::Timeout) if shared.is_complete()? => return Ok(None),
                Err(RecvTimeoutError::Timeout) => {}
                Ok(None) | Err(RecvTimeoutError::Disconnected) => break,
            }
        }
    }
    Ok(None)
}

/// Tries once, on a thread of its own: an address may take seconds to be looked up or to answer, and a render that ends does
/// not wait for it. A port that nobody receives is closed.
fn try_to_reach(address: CardAddress) -> Receiver<Reopened> {
    let (sender, receiver) = channel();
    let work = move || {
        let port = reach(&address).ok().and_then(Result::ok);
        // The render may have ended.
        let _ = sender.send(port);
    };
    // Without a thread, the next try comes later.
    let _ = std::thread::Builder::new().name("reopen".into()).spawn(work);
    receiver
}
