//! Replacements for links that only Unix systems have.

use std::io::ErrorKind;
use std::path::Path;

use super::LinkError;
use crate::link::LoopbackPort;

/// Fails, because this system has no Unix sockets.
///
/// # Errors
/// Always.
pub fn connect_unix(path: &Path) -> Result<LoopbackPort, LinkError> {
    Err(LinkError::connect(format_args!("unix:{}", path.display()), &ErrorKind::Unsupported.into()))
}
