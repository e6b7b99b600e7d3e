//! Links that this system does not have.

use std::io::ErrorKind;
use std::path::Path;

use super::{LinkError, LoopbackPort};

/// Opens no serial port.
///
/// # Errors
/// Always.
pub fn open_serial(path: &Path, _: u32) -> Result<LoopbackPort, LinkError> {
    Err(LinkError::open(format_args!("serial:{}", path.display()), &ErrorKind::Unsupported.into()))
}

/// Connects to no Unix socket.
///
/// # Errors
/// Always.
pub fn connect_unix(path: &Path) -> Result<LoopbackPort, LinkError> {
    Err(LinkError::connect(format_args!("unix:{}", path.display()), &ErrorKind::Unsupported.into()))
}
