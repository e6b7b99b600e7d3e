//! Connection to a card by its address.

#[cfg(target_family = "wasm")]
use std::io::ErrorKind;

use photoncard_shared::link::Port;

use super::{LinkError, RemoteAddress};

/// Connects to the card at an address.
///
/// # Errors
/// If the port or socket cannot be opened.
#[cfg(not(target_family = "wasm"))]
pub fn reach(address: &RemoteAddress) -> Result<Box<dyn Port + Send>, LinkError> {
    match address {
        RemoteAddress::Serial { path, baud, options } => {
            super::open_serial(path, *baud, *options).map(|port| Box::new(port) as _)
        }
        RemoteAddress::Tcp { host, port } => super::connect_tcp(host, *port).map(|port| Box::new(port) as _),
        RemoteAddress::Unix { path } => super::connect_unix(path).map(|port| Box::new(port) as _),
        RemoteAddress::Lent(card) => card.open().map(|port| Box::new(port) as _),
    }
}

/// Connects to the card at an address.
///
/// # Errors
/// If the card is not lent: a browser has no other links.
#[cfg(target_family = "wasm")]
pub fn reach(address: &RemoteAddress) -> Result<Box<dyn Port + Send>, LinkError> {
    match address {
        RemoteAddress::Lent(card) => card.open().map(|port| Box::new(port) as _),
        _ => Err(LinkError::connect(address, &ErrorKind::Unsupported.into())),
    }
}
