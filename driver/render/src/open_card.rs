//! Connections to cards: opening, transfer of bytes between a session and its port, and reconnection.

use std::sync::mpsc::{Receiver, RecvTimeoutError, channel};
use std::time::{Duration, Instant};

use photoncard_cards::link::{FaultInjector, LineFaults, LinkError, RemoteAddress, reach};
use photoncard_cards::session::{Session, SessionError};
use photoncard_shared::link::{Port, PortError};

use super::address::CardAddress;
use super::hands::Hands;
use super::{CardError, RenderError};
use crate::emulator::{EmulatedCard, MemoryModel, MemoryRecord, SharedImage, TileLines};

/// Port at the host's end of the link to a remote card.
pub(super) type BoxedPort = Box<dyn Port + Send>;

/// Connection to a card, with a fault injector for its link if the settings ask for injected faults.
pub(super) struct OpenCard {
    connection: Connection,
    injector: Option<FaultInjector>,
}

enum Connection {
    Emulated(EmulatedCard),
    /// Port of an emulated card outside this program.
    Worker(BoxedPort),
    /// Port of a remote card; `None` while the link is closed. The port is closed before it is reopened,
    /// because a device may allow only one user at a time.
    Remote {
        address: RemoteAddress,
        port: Option<BoxedPort>,
    },
}

impl OpenCard {
    /// Starts one emulated card, or connects to the remote card, at `address`. `index` is the number of the
    /// card, on which injected faults depend. An emulated card gets the memory model `model`, if any, and
    /// reads the card image in `shared` without a copy.
    pub(super) fn open(
        index: usize,
        address: &CardAddress,
        hands: &Hands,
        model: Option<MemoryModel>,
        shared: &SharedImage,
        faults: Option<LineFaults>,
    ) -> Result<Self, CardError> {
        let connection = match address {
            CardAddress::Emulated { model: chip, memory, .. } => {
                let chip = chip.kind().emulated().with_memory(*memory);
                match hands {
                    Hands::Threads => {
                        EmulatedCard::start(chip, model, shared.clone()).map(Connection::Emulated)
                    }
                    Hands::Turns(workers) => workers.start(index, chip).map(Connection::Worker),
                }
                .map_err(CardError::Start)?
            }
            CardAddress::Remote(address) => {
                Connection::Remote { address: address.clone(), port: Some(reach(address)?) }
            }
        };
        Ok(Self { connection, injector: faults.map(|faults| FaultInjector::new(faults, index)) })
    }

    /// Returns whether the card is emulated in this process.
    pub(super) fn is_emulated(&self) -> bool {
        matches!(self.connection, Connection::Emulated(_) | Connection::Worker(_))
    }

    /// Closes the link to a remote card, and returns the address at which it can be reopened. Returns `None`
    /// for an emulated card.
    pub(super) fn close(&mut self) -> Option<RemoteAddress> {
        match &mut self.connection {
            Connection::Emulated(_) | Connection::Worker(_) => None,
            Connection::Remote { address, port } => {
                drop(port.take());
                Some(address.clone())
            }
        }
    }

    /// Time for which a render without any other card waits for this card to come back after a loss.
    pub(super) fn wait_for_return(&self) -> Duration {
        match &self.connection {
            Connection::Emulated(_) | Connection::Worker(_) => Duration::ZERO,
            Connection::Remote { address, .. } => address.wait_for_return(),
        }
    }

    /// Sets the reopened port of a remote card after `Self::close`.
    pub(super) fn go_on_with(&mut self, opened: BoxedPort) {
        if let Connection::Remote { port, .. } = &mut self.connection {
            *port = Some(opened);
        }
    }

    /// Closes the link to a remote card and opens it again. Returns whether it is open.
    pub(super) fn reach_again(&mut self) -> bool {
        let Some(port) = self.close().and_then(|address| reach(&address).ok()) else { return false };
        self.go_on_with(port);
        true
    }

    /// Takes the handle through which an emulated card with empty memory can get a card image by reference.
    /// Returns `None` from the second call on, for a modelled memory, and for a remote card.
    pub(super) fn take_empty_memory(&mut self) -> Option<SharedImage> {
        match &mut self.connection {
            Connection::Emulated(card) => card.take_empty_memory(),
            Connection::Worker(_) | Connection::Remote { .. } => None,
        }
    }

    /// Returns whether writing the memory trace of the card failed.
    pub(super) fn trace_has_failed(&self) -> bool {
        matches!(&self.connection, Connection::Emulated(card) if card.trace_has_failed())
    }

    /// Number of DRAM lines read for each finished tile; empty if the memory is not modelled.
    pub(super) fn tile_lines(&self) -> TileLines {
        match &self.connection {
            Connection::Emulated(card) => card.tile_lines().clone(),
            Connection::Worker(_) | Connection::Remote { .. } => TileLines::default(),
        }
    }

    /// Ends an emulated card, or closes the link to a remote one. Returns the traffic and the trace of the
    /// card's memory; `None` if the memory is not modelled.
    pub(super) fn finish(self) -> Option<MemoryRecord> {
        match self.connection {
            Connection::Emulated(card) => card.finish(),
            Connection::Worker(_) | Connection::Remote { .. } => None,
        }
    }
}

impl Connection {
    fn port(&mut self) -> Result<&mut dyn Port, PortError> {
        match self {
            Self::Emulated(card) => Ok(card.port()),
            Self::Worker(port) => Ok(port.as_mut()),
            Self::Remote { port, .. } => match port {
                Some(port) => Ok(port.as_mut()),
                None => Err(PortError::Closed),
            },
        }
    }
}

/// Reads and writes at the host's end of the link, with injected faults.
impl Port for OpenCard {
    fn read(&mut self, buffer: &mut [u8], wait: Duration) -> Result<usize, PortError> {
        let port = self.connection.port()?;
        match &mut self.injector {
            None => port.read(buffer, wait),
            Some(injector) => injector.read(port, buffer, wait),
        }
    }

    fn write(&mut self, bytes: &[u8], wait: Duration) -> Result<usize, PortError> {
        let port = self.connection.port()?;
        match &mut self.injector {
            None => port.write(bytes, wait),
            Some(injector) => injector.write(port, bytes, wait),
        }
    }
}

/// Maximum time that a port waits for a byte. After a render is stopped, the thread of a card notices it
/// within this time.
pub(super) const WAIT: Duration = Duration::from_millis(4);

/// Sends the outgoing bytes of a session to a port, then passes received bytes to the session. Waits for
/// bytes for at most [`WAIT`]. `slowest` is the time limit per ray or gather, seconds, for [`Session::tick`].
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

/// Pause before each attempt to reconnect.
const RETRY: Duration = Duration::from_millis(500);

/// Function that waits until all tiles are done, for at most the given time, and returns whether they are. It
/// may end the render with the error of the last attempt to reconnect, if there was one.
type WaitForEnd<'a> = &'a dyn Fn(Duration, &mut Option<LinkError>) -> Result<bool, RenderError>;

/// Tries repeatedly to reconnect to a card. Returns the port, or `None` as soon as all tiles are done.
pub(super) fn reopen(
    address: &RemoteAddress,
    wait_for_end: WaitForEnd,
) -> Result<Option<BoxedPort>, RenderError> {
    let mut last = None;
    // The first attempt also follows a pause: a peer that closes every new link must not be contacted in a
    // tight loop.
    while !wait_for_end(RETRY, &mut last)? {
        let attempt = try_to_reach(address.clone());
        loop {
            match attempt.recv_timeout(WAIT) {
                Ok(Ok(port)) => return Ok(Some(port)),
                Err(RecvTimeoutError::Timeout) if wait_for_end(Duration::ZERO, &mut last)? => {
                    return Ok(None);
                }
                Err(RecvTimeoutError::Timeout) => {}
                Ok(Err(error)) => {
                    last = Some(error);
                    break;
                }
                Err(RecvTimeoutError::Disconnected) => break,
            }
        }
    }
    Ok(None)
}

/// Tries to connect once, on a separate thread. Sends the port or the error to the returned receiver. The
/// attempt can take seconds. A render can end meanwhile: it drops the receiver, and the port is then closed.
pub(super) fn try_to_reach(address: RemoteAddress) -> Receiver<Result<BoxedPort, LinkError>> {
    let (sender, receiver) = channel();
    let work = move || {
        // The receiver is gone if the render has ended.
        let _ = sender.send(reach(&address));
    };
    // If no thread can be started, the next attempt follows later.
    let _ = std::thread::Builder::new().name("reopen".into()).spawn(work);
    receiver
}
