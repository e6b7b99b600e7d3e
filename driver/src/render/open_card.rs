//! A card at the host's end of its link.

use photoncard_shared::link::Port;

use super::RenderError;
use super::address::CardAddress;
use crate::emulator::{EmulatedCard, MemoryModel, MemoryRecord};
use crate::link::{connect_tcp, connect_unix, open_serial};

/// A card that can be talked to.
pub(super) struct OpenCard {
    /// Its number.
    index: usize,
    place: Place,
}

enum Place {
    Emulated(EmulatedCard),
    Remote { address: CardAddress, port: Box<dyn Port + Send> },
}

impl OpenCard {
    /// Starts or reaches the card at an address, the first if it has many. One that is emulated may have a model of its
    /// memory.
    pub(super) fn open(
        index: usize,
        address: &CardAddress,
        model: Option<MemoryModel>,
    ) -> Result<Self, RenderError> {
        let unreachable = |source| RenderError::Link { card: index, source };
        let port: Box<dyn Port + Send> = match address {
            CardAddress::Emulated { kind, .. } => {
                let card = EmulatedCard::start(*kind, model);
                let card = card.map_err(|source| RenderError::Start { card: index, source })?;
                return Ok(Self { index, place: Place::Emulated(card) });
            }
            CardAddress::Serial { path, baud } => Box::new(open_serial(path, *baud).map_err(unreachable)?),
            CardAddress::Tcp { host, port } => Box::new(connect_tcp(host, *port).map_err(unreachable)?),
            CardAddress::Unix { path } => Box::new(connect_unix(path).map_err(unreachable)?),
        };
        Ok(Self { index, place: Place::Remote { address: address.clone(), port } })
    }

    /// The host's end of the link.
    pub(super) fn port(&mut self) -> &mut dyn Port {
        match &mut self.place {
            Place::Emulated(card) => card.port(),
            Place::Remote { port, .. } => port.as_mut(),
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
