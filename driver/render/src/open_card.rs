//! Open connections to cards: transfer of bytes between a session and its port, and reconnection.

use std::sync::mpsc::{Receiver, RecvTimeoutError, channel};
use std::time::{Duration, Instant};

use photoncard_cards::link::{
    FaultInjector, LineFaults, LinkError, RemoteAddress, connect_tcp, connect_unix, open_serial,
};
use photoncard_cards::session::{Session, SessionError};
use photoncard_shared::link::{Port, PortError};

use super::address::CardAddress;
use super::{CardError, RenderError};
use crate::emulator::{EmulatedCard, MemoryModel, MemoryRecord, SharedImage, TileLines};

/// Host's end of a link.
pub(super) type BoxedPort = Box<dyn Port + Send>;

/// Card with an open connection, and faults injected into its line, if any.
pub(super) struct OpenCard {
    connection: Connection,
    injector: Option<FaultInjector>,
}

enum Connection {
    Emulated(EmulatedCard),
    /// Port of a remote card. It is closed before it is reopened, because a device may allow only one user at
    /// a time.
    Remote {
        address: RemoteAddress,
        port: Option<BoxedPort>,
    },
}

impl OpenCard {
    /// Starts, or connects to, the first card at an address. An emulated card can have a model of its memory,
    /// and shares the host's card image. Injected faults depend on the card's number `index`.
    pub(super) fn open(
        index: usize,
        address: &CardAddress,
        model: Option<MemoryModel>,
        shared: &SharedImage,
        faults: Option<LineFaults>,
    ) -> Result<Self, CardError> {
        let connection = match address {
            &CardAddress::Emulated { kind, memory, .. } => Connection::Emulated(
                EmulatedCard::start(kind.emulated().with_memory(memory), model, shared.clone())
                    .map_err(CardError::Start)?,
            ),
            CardAddress::Remote(address) => {
                Connection::Remote { address: address.clone(), port: Some(reach(address)?) }
            }
        };
        Ok(Self { connection, injector: faults.map(|faults| FaultInjector::new(faults, index)) })
    }

    /// Returns whether the card is part of this process.
    pub(super) fn is_emulated(&self) -> bool {
        matches!(self.connection, Connection::Emulated(_))
    }

    /// Closes the link to a remote card and returns its address, for reconnecting; `None` for an emulated
    /// card.
    pub(super) fn close(&mut self) -> Option<RemoteAddress> {
        match &mut self.connection {
            Connection::Emulated(_) => None,
            Connection::Remote { address, port } => {
                drop(port.take());
                Some(address.clone())
            }
        }
    }

    /// Replaces the closed link by a reopened one.
    pub(super) fn go_on_with(&mut self, opened: BoxedPort) {
        if let Connection::Remote { port, .. } = &mut self.connection {
            *port = Some(opened);
        }
    }

    /// Takes the handle of an emulated card's empty memory ([`EmulatedCard::take_empty_memory`]).
    pub(super) fn take_empty_memory(&mut self) -> Option<SharedImage> {
        match &mut self.connection {
            Connection::Emulated(card) => card.take_empty_memory(),
            Connection::Remote { .. } => None,
        }
    }

    /// Returns whether writing the trace failed.
    pub(super) fn trace_has_failed(&self) -> bool {
        matches!(&self.connection, Connection::Emulated(card) if card.trace_has_failed())
    }

    /// Number of DRAM lines read for each of the card's tiles, if its memory is modelled.
    pub(super) fn tile_lines(&self) -> TileLines {
        match &self.connection {
            Connection::Emulated(card) => card.tile_lines().clone(),
            Connection::Remote { .. } => TileLines::default(),
        }
    }

    /// Ends an emulated card, or closes the link to a remote one. Returns the record of a modelled memory.
    pub(super) fn finish(self) -> Option<MemoryRecord> {
        match self.connection {
            Connection::Emulated(card) => card.finish(),
            Connection::Remote { .. } => None,
        }
    }
}

impl Connection {
    fn port(&mut self) -> Result<&mut dyn Port, PortError> {
        match self {
            Self::Emulated(card) => Ok(card.port()),
            Self::Remote { port, .. } => match port {
                Some(port) => Ok(port.as_mut()),
                None => Err(PortError::Closed),
            },
        }
    }
}

/// Host's end of the link, with injected faults.
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

pub(super) fn reach(address: &RemoteAddress) -> Result<BoxedPort, LinkError> {
    match address {
        RemoteAddress::Serial { path, baud } => open_serial(path, *baud).map(boxed),
        RemoteAddress::Tcp { host, port } => connect_tcp(host, *port).map(boxed),
        RemoteAddress::Unix { path } => connect_unix(path).map(boxed),
    }
}

fn boxed(port: impl Port + Send + 'static) -> BoxedPort {
    Box::new(port)
}

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

/// Pause before each attempt to reconnect.
const RETRY: Duration = Duration::from_millis(500);

/// Tries to reconnect to a card until it succeeds and returns the port, or until all tiles are done and
/// returns `None`. `wait_for_end` waits for at most the given time and returns whether all tiles are done.
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
