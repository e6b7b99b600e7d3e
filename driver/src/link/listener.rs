//! Where hosts come to a card that this process emulates.

use std::io::{self, ErrorKind};
use std::net::{TcpListener, ToSocketAddrs};
#[cfg(unix)]
use std::os::unix::net::{UnixListener, UnixStream};
use std::path::PathBuf;
use std::str::FromStr;
use std::time::Duration;

use photoncard_shared::link::Port;
use rustix::event::PollFlags;

use super::LinkError;
#[cfg(unix)]
use super::pty::Pty;
#[cfg(unix)]
use super::socket::unix_port;
use super::socket::{host_name, tcp_address, tcp_port};
use super::stream::wait_for;

/// Where to wait for hosts: an argument of `--listen`.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum ListenAddress {
    /// A new pseudo terminal.
    Pty,
    /// A TCP port of this machine.
    Tcp {
        /// Name or number of the address.
        host: String,
        /// The port; 0 for any that is free.
        port: u16,
    },
    /// A Unix socket.
    Unix {
        /// Its path.
        path: PathBuf,
    },
}

/// Without an address, no other machine can reach a card.
const LOCAL_HOST: &str = "127.0.0.1";

impl FromStr for ListenAddress {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        match text.split_once(':').unwrap_or((text, "")) {
            ("pty", "") => Ok(Self::Pty),
            ("tcp", rest) => {
                let (host, port) = rest.rsplit_once(':').unwrap_or(("", rest));
                let host = host_name(if host.is_empty() { LOCAL_HOST } else { host })?;
                let port = if port.is_empty() { Ok(0) } else { port.parse() };
                let port = port.map_err(|_| format!("{rest:?} has no port of 0 to 65535; use tcp:PORT"))?;
                Ok(Self::Tcp { host, port })
            }
            ("unix", path) if !path.is_empty() => Ok(Self::Unix { path: path.into() }),
            _ => Err(format!(
                "{text:?} is nothing to listen on; use pty, tcp:PORT, tcp:ADDRESS:PORT or unix:PATH"
            )),
        }
    }
}

/// A place where hosts come to a card. A socket's file is removed when it is dropped.
pub struct Listener {
    kind: Kind,
    card_address: String,
}

enum Kind {
    Tcp(TcpListener),
    #[cfg(unix)]
    Unix(UnixListener, PathBuf),
    #[cfg(unix)]
    Pty(Pty),
}

impl Listener {
    /// Begins to listen.
    ///
    /// # Errors
    /// If the address is not this machine's, or is taken.
    pub fn new(address: &ListenAddress) -> Result<Self, LinkError> {
        match address {
            ListenAddress::Tcp { host, port } => {
                Self::tcp(host, *port).map_err(|error| LinkError::listen(tcp_address(host, *port), &error))
            }
            #[cfg(unix)]
            ListenAddress::Unix { path } => Self::unix(path.clone())
                .map_err(|error| LinkError::listen(format_args!("unix:{}", path.display()), &error)),
            #[cfg(unix)]
            ListenAddress::Pty => Self::pty().map_err(|error| LinkError::listen("pty", &error)),
            #[cfg(not(unix))]
            ListenAddress::Unix { path } => Err(LinkError::listen(
                format_args!("unix:{}", path.display()),
                &ErrorKind::Unsupported.into(),
            )),
            #[cfg(not(unix))]
            ListenAddress::Pty => Err(LinkError::listen("pty", &ErrorKind::Unsupported.into())),
        }
    }

    fn tcp(host: &str, port: u16) -> io::Result<Self> {
        let addresses: Vec<_> = (host, port).to_socket_addrs()?.collect();
        let listener = TcpListener::bind(addresses.as_slice())?;
        listener.set_nonblocking(true)?;
        let bound = listener.local_addr()?;
        let card_address = tcp_address(&bound.ip().to_string(), bound.port());
        Ok(Self { kind: Kind::Tcp(listener), card_address })
    }

    #[cfg(unix)]
    fn unix(path: PathBuf) -> io::Result<Self> {
        let listener = UnixListener::bind(&path).or_else(|error| {
            if error.kind() != ErrorKind::AddrInUse {
                return Err(error);
            }
            // The socket of a process that is gone is replaced; any other file is not.
            match UnixStream::connect(&path) {
                Err(refused) if refused.kind() == ErrorKind::ConnectionRefused => {
                    use std::os::unix::fs::FileTypeExt;
                    if !std::fs::symlink_metadata(&path)?.file_type().is_socket() {
                        return Err(ErrorKind::AlreadyExists.into());
                    }
                    std::fs::remove_file(&path)?;
                    UnixListener::bind(&path)
                }
                _ => Err(error),
            }
        })?;
        listener.set_nonblocking(true)?;
        let card_address = format!("unix:{}", path.display());
        Ok(Self { kind: Kind::Unix(listener, path), card_address })
    }

    #[cfg(unix)]
    fn pty() -> io::Result<Self> {
        let (pty, path) = Pty::open()?;
        Ok(Self { kind: Kind::Pty(pty), card_address: format!("serial:{}", path.display()) })
    }

    /// What a host gives as `--card` to reach the card.
    pub fn card_address(&self) -> &str {
        &self.card_address
    }

    /// Whether other machines can reach the card.
    pub fn is_public(&self) -> bool {
        match &self.kind {
            Kind::Tcp(listener) => !listener.local_addr().is_ok_and(|address| address.ip().is_loopback()),
            #[cfg(unix)]
            Kind::Unix(..) | Kind::Pty(_) => false,
        }
    }

    /// Whether hosts come on connections of their own.
    pub(super) fn is_socket(&self) -> bool {
        match &self.kind {
            Kind::Tcp(_) => true,
            #[cfg(unix)]
            Kind::Unix(..) => true,
            #[cfg(unix)]
            Kind::Pty(_) => false,
        }
    }

    /// The next host, if one comes within `wait`. One that is gone again, or that the system has no room for, is none.
    pub(super) fn accept(&mut self, wait: Duration) -> Option<Box<dyn Port + Send>> {
        match &mut self.kind {
            Kind::Tcp(listener) => {
                wait_for(listener, PollFlags::IN, wait);
                boxed(tcp_port(listener.accept().ok()?.0).ok()?)
            }
            #[cfg(unix)]
            Kind::Unix(listener, _) => {
                wait_for(listener, PollFlags::IN, wait);
                boxed(unix_port(listener.accept().ok()?.0).ok()?)
            }
            #[cfg(unix)]
            Kind::Pty(pty) => match pty.accept() {
                Ok(Some(port)) => boxed(port),
                _ => {
                    // Nothing tells when a terminal is opened.
                    std::thread::sleep(wait);
                    None
                }
            },
        }
    }

    /// A host that has come while there is one, if any has. Those on a terminal lock it themselves.
    pub(super) fn accept_other(&mut self) -> Option<Box<dyn Port + Send>> {
        match self.kind {
            Kind::Tcp(_) => self.accept(Duration::ZERO),
            #[cfg(unix)]
            Kind::Unix(..) => self.accept(Duration::ZERO),
            #[cfg(unix)]
            Kind::Pty(_) => None,
        }
    }
}

fn boxed(port: impl Port + Send + 'static) -> Option<Box<dyn Port + Send>> {
    Some(Box::new(port))
}

#[cfg(unix)]
impl Drop for Listener {
    fn drop(&mut self) {
        if let Kind::Unix(_, path) = &self.kind {
            // It may have been removed already.
            let _ = std::fs::remove_file(path);
        }
    }
}
