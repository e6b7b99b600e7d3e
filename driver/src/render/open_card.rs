//! A card at the host's end of its link.

use std::time::Duration;

use photoncard_shared::link::{Port, PortError};

use super::RenderError;
use super::address::CardAddress;
use super::card_thread::Shared;
use super::reopening::reopen;
use crate::emulator::{ChipKind, EmulatedCard, MemoryModel, MemoryRecord, SharedImage};
use crate::link::{FaultInjector, LineFaults, LinkError, connect_tcp, connect_unix, open_serial};

/// A card that can be talked to.
pub(super) struct OpenCard {
    /// Its number.
    index: usize,
    place: Place,
    injector: Option<FaultInjector>,
}

enum Place {
    Emulated(EmulatedCard),
    /// Its port is closed before it is opened again, as a device may have one user at a time.
    Remote {
        address: CardAddress,
        port: Option<Box<dyn Port + Send>>,
    },
}

impl OpenCard {
    /// Starts or reaches the card at an address, the first if it has many. One that is emulated may have a model of its
    /// memory, and shares an image with the host.
    pub(super) fn open(
        index: usize,
        address: &CardAddress,
        model: Option<MemoryModel>,
        shared: &SharedImage,
        faults: Option<LineFaults>,
    ) -> Result<Self, RenderError> {
        let place = match reach(address) {
            Err(kind) => {
                let card = EmulatedCard::start(kind, model, shared.clone());
                Place::Emulated(card.map_err(|source| RenderError::Start { card: index, source })?)
            }
            Ok(port) => {
                let port = port.map_err(|source| RenderError::Link { card: index, source })?;
                Place::Remote { address: address.clone(), port: Some(port) }
            }
        };
        let injector = faults.map(|faults| FaultInjector::new(faults, index));
        Ok(Self { index, place, injector })
    }

    /// Tries to reach a card again whose link was closed, until it is there or nothing is left to do. Returns whether there is
    /// any sense in that: an emulated card does not come back.
    pub(super) fn reopen(&mut self, shared: &Shared) -> Result<bool, RenderError> {
        match &mut self.place {
            Place::Emulated(_) => Ok(false),
            Place::Remote { address, port } => {
                drop(port.take());
                *port = reopen(address, shared)?;
                Ok(true)
            }
        }
    }

    /// What errors call it: its number, and its address if it is not emulated.
    pub(super) fn name(&self) -> String {
        match &self.place {
            Place::Emulated(_) => format!("card {}", self.index),
            Place::Remote { address, .. } => format!("card {} ({address})", self.index),
        }
    }

    /// Whether its trace cannot be written.
    pub(super) fn trace_has_failed(&self) -> bool {
        matches!(&self.place, Place::Emulated(card) if card.trace_has_failed())
    }

    /// Ends an emulated card, or the link to another. Returns what its memory leaves, if it is modelled.
    pub(super) fn finish(self) -> Option<MemoryRecord> {
        match self.place {
            Place::Emulated(card) => card.finish(),
            Place::Remote { .. } => None,
        }
    }
}

impl Place {
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
        let port = self.place.port()?;
        match &mut self.injector {
            None => port.read(buffer, wait),
            Some(injector) => injector.read(port, buffer, wait),
        }
    }

    fn write(&mut self, bytes: &[u8], wait: Duration) -> Result<usize, PortError> {
        let port = self.place.port()?;
        match &mut self.injector {
            None => port.write(bytes, wait),
            Some(injector) => injector.write(port, bytes, wait),
        }
    }
}

pub(super) type Reached = Result<Box<dyn Port + Send>, LinkError>;

/// Opens the link to a card that is not emulated in this process; of one that is, its kind.
pub(super) fn reach(address: &CardAddress) -> Result<Reached, ChipKind> {
    fn boxed(port: Result<impl Port + Send + 'static, LinkError>) -> Reached {
        port.map(|port| Box::new(port) as Box<dyn Port + Send>)
    }
    match address {
        CardAddress::Emulated { kind, .. } => Err(*kind),
        CardAddress::Serial { path, baud } => Ok(boxed(open_serial(path, *baud))),
        CardAddress::Tcp { host, port } => Ok(boxed(connect_tcp(host, *port))),
        CardAddress::Unix { path } => Ok(boxed(connect_unix(path))),
    }
}
