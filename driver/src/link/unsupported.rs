//! Links that only Unix systems have.

use std::io::ErrorKind;
use std::path::Path;

use super::{LinkError, LoopbackPort};

/// Connects to no Unix socket.
///
/// # Errors
/// Always.
pub fn connect_unix(path: &Path) -> Result<LoopbackPort, LinkError> {
    Err(LinkError::connect(format_args!("unix:{}", path.display()), &ErrorKind::Unsupported.into()))
}
