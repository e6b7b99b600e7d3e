//! Errors of links that cannot be opened.

use std::fmt::Display;
use std::io::{self, ErrorKind};

/// Error of a link that cannot be opened: action, address, reason and remedy.
#[derive(Debug, thiserror::Error, miette::Diagnostic)]
#[error("cannot {action} {address}: {reason}")]
#[diagnostic(help("{remedy}"))]
pub struct LinkError {
    action: &'static str,
    address: String,
    reason: String,
    remedy: &'static str,
}

const UNIX_ONLY: &str = "only Unix systems have such links";

impl LinkError {
    /// Error of opening a serial port.
    pub(super) fn open(address: impl Display, error: &io::Error) -> Self {
        let (reason, remedy) = match error.kind() {
            ErrorKind::NotFound => ("there is no such device", "check the cable and the device's name"),
            ErrorKind::PermissionDenied => (
                "no permission to use the device",
                "join the group that owns it, often `dialout`, or change its permissions",
            ),
            // Another process holds the exclusive lock.
            ErrorKind::WouldBlock | ErrorKind::ResourceBusy => {
                ("the device is busy", "end the program that uses it, or wait until it is done")
            }
            ErrorKind::InvalidInput => {
                ("it does not run at that speed", "choose a speed that both ends have, such as @115200")
            }
            _ => {
                let remedy = "check that the path names a serial port, which no other program uses";
                return Self::other("open", address, error, remedy);
            }
        };
        Self::new("open", address, reason, remedy)
    }

    /// Error of a line of a serial port that cannot be set as its address demands.
    pub(super) fn modem_line(address: impl Display, option: impl Display, error: &io::Error) -> Self {
        let reason = format!("{option} is not possible: {error}");
        let remedy = "leave the option out: lines are then raised if the port has them";
        Self::new("open", address, &reason, remedy)
    }

    /// Error of connecting to a socket.
    pub(super) fn connect(address: impl Display, error: &io::Error) -> Self {
        let (reason, remedy) = match error.kind() {
            ErrorKind::NotFound => {
                ("there is no such socket", "start the card that listens there, or check the path")
            }
            ErrorKind::PermissionDenied => {
                ("no permission to use the socket", "change its permissions, or run as its owner")
            }
            ErrorKind::ConnectionRefused => {
                ("nothing listens there", "start the card that listens there, or check the address")
            }
            ErrorKind::TimedOut | ErrorKind::HostUnreachable | ErrorKind::NetworkUnreachable => {
                ("it does not answer", "check the network, the address and firewalls")
            }
            ErrorKind::Unsupported => (UNIX_ONLY, "use a card on a TCP port: tcp:HOST:PORT"),
            _ => return Self::other("connect to", address, error, "check the address"),
        };
        Self::new("connect to", address, reason, remedy)
    }

    /// Error of reaching a card that is no longer lent.
    pub(crate) fn taken_back(card: impl Display) -> Self {
        Self::new("connect to", card, "its owner has taken it back", "ask its owner, or leave the card out")
    }

    /// Error of listening on an address.
    pub(super) fn listen(address: impl Display, error: &io::Error) -> Self {
        let (reason, remedy) = match error.kind() {
            ErrorKind::AddrInUse => ("it is in use", "choose another, or end what listens there"),
            ErrorKind::AddrNotAvailable => {
                ("this machine has no such address", "use one of its own, such as 127.0.0.1")
            }
            ErrorKind::AlreadyExists => ("a file has that name", "choose another path, or remove the file"),
            ErrorKind::PermissionDenied => {
                ("no permission to listen there", "choose a port above 1023, or a folder you may write to")
            }
            ErrorKind::NotFound => ("its folder does not exist", "create the folder, or choose another path"),
            ErrorKind::Unsupported => (UNIX_ONLY, "listen on a TCP port: tcp:PORT"),
            _ => return Self::other("listen on", address, error, "choose another address"),
        };
        Self::new("listen on", address, reason, remedy)
    }

    /// Error of listing serial ports.
    pub(super) fn list(error: &io::Error) -> Self {
        Self::other("list", "serial ports", error, "give the port's path: `cards.addresses` serial:PATH")
    }

    fn new(action: &'static str, address: impl Display, reason: &str, remedy: &'static str) -> Self {
        Self { action, address: address.to_string(), reason: reason.into(), remedy }
    }

    fn other(action: &'static str, address: impl Display, error: &io::Error, remedy: &'static str) -> Self {
        Self::new(action, address, &error.to_string(), remedy)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// esp-rs/espflash issue 103: a port without permission was said not to exist.
    #[test]
    fn a_port_without_permission_names_the_group_that_has_it() {
        let error = LinkError::open("serial:/dev/ttyUSB0", &ErrorKind::PermissionDenied.into());
        assert!(error.to_string().ends_with("no permission to use the device"), "{error}");
        assert!(error.remedy.contains("the group that owns it, often `dialout`"), "{}", error.remedy);
    }

    #[test]
    fn links_that_a_system_lacks_are_named_with_one_that_it_has() {
        let lacking = ErrorKind::Unsupported.into();
        for (error, address) in [
            (LinkError::connect("unix:card", &lacking), "unix:card"),
            (LinkError::listen("pty", &lacking), "pty"),
        ] {
            let text = error.to_string();
            assert!(text.contains(address) && text.ends_with("only Unix systems have such links"), "{text}");
            assert!(error.remedy.contains("tcp:"), "{}", error.remedy);
        }
    }
}
