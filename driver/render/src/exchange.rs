//! Transfer of bytes between a session and its card's port.

use std::time::{Duration, Instant};

use photoncard_cards::session::{Session, SessionError};
use photoncard_shared::link::Port;

/// Maximum time that a port waits for a byte, and thus until a card's thread notices that the render was
/// stopped.
pub(super) const WAIT: Duration = Duration::from_millis(4);

/// Moves the available bytes once in each direction. Waits at most [`WAIT`] if there are none. `slowest` is
/// the argument of [`Session::tick`].
pub(super) fn exchange(
    session: &mut Session,
    port: &mut impl Port,
    slowest: Option<f64>,
    start: Instant,
) -> Result<(), SessionError> {
    session.prepare();
    let sent = match session.outgoing() {
        [] => 0,
        outgoing => port.write(outgoing, WAIT).map_err(SessionError::Port)?,
    };
    session.sent(sent, start.elapsed());
    let mut buffer = [0; 8192];
    let wait = if session.has_more_to_send() || session.is_idle() { Duration::ZERO } else { WAIT };
    match port.read(&mut buffer, wait).map_err(SessionError::Port)? {
        0 => session.acknowledge(),
        received => session.receive(&buffer[..received], start.elapsed())?,
    }
    session.tick(slowest, start.elapsed())
}
