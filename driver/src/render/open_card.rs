//! A card at the host's end of its link.

use std::time::Duration;

use photoncard_shared::link::{Port, PortError};

use super::CardError;
use super::address::{CardAddress, RemoteAddress};
use crate::emulator::{EmulatedCard, MemoryModel, MemoryRecord, SharedImage};
use crate::link::{FaultInjector, LineFaults, LinkError, connect_tcp, connect_unix, open_serial};

/// The host's end of a link.
pub(super) type BoxedPort = Box<dyn Port + Send>;

/// A card that can be talked to.
pub(super) struct OpenCard {
    connection: Connection,
    injector: Option<FaultInjector>,
}

/// Connection to a card.
enum Connection {
    Emulated(EmulatedCard),
    /// Its port is closed before it is opened again, as a device may have one user at a time.
    Remote {
        address: RemoteAddress,
        port: Option<BoxedPort>,
    },
}

impl OpenCard {
    /// Starts or reaches the card at an address, the first if it has many. One that is emulated may have a model of its
    /// memory, and shares an image with the host. Faults of its line are those of the number `index`.
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

    /// Closes the link to a card. Returns where it can be reached again: an emulated card does not come back.
    pub(super) fn close(&mut self) -> Option<RemoteAddress> {
        match &mut self.connection {
            Connection::Emulated(_) => None,
            Connection::Remote { address, port } => {
                drop(port.take());
                Some(address.clone())
            }
        }
    }

    /// Goes on with a link that was opened again.
    pub(super) fn go_on_with(&mut self, opened: BoxedPort) {
        if let Connection::Remote { port, .. } = &mut self.connection {
            *port = Some(opened);
        }
    }

    /// Whether its trace cannot be written.
    pub(super) fn trace_has_failed(&self) -> bool {
        matches!(&self.connection, Connection::Emulated(card) if card.trace_has_failed())
    }

    /// Ends an emulated card, or the link to another. Returns what its memory leaves, if it is modelled.
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

/// The host's end of the link.
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

/// Opens the link to a card.
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
