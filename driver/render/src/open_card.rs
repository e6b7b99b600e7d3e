//! Open connections to cards.

use std::time::Duration;

use photoncard_cards::link::{
    FaultInjector, LineFaults, LinkError, RemoteAddress, connect_tcp, connect_unix, open_serial,
};
use photoncard_shared::link::{Port, PortError};

use super::CardError;
use super::address::CardAddress;
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
    /// and shares the host's image. Injected faults depend on the card's number `index`.
    pub(super) fn open(
        index: usize,
        address: &CardAddress,
        model: Option<MemoryModel>,
        shared: &SharedImage,
        faults: Option<LineFaults>,
    ) -> Result<Self, CardError> {
        let connection = match address {
            CardAddress::Emulated { kind, .. } => Connection::Emulated(
                EmulatedCard::start(*kind, model, shared.clone()).map_err(CardError::Start)?,
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

    /// Closes the link to a card. Returns the address for reconnecting; `None` for an emulated card.
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

    /// Takes the empty memory of an emulated card ([`EmulatedCard::take_empty_memory`]).
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
