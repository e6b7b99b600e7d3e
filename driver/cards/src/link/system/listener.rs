//! Listeners by which hosts reach a card that this process emulates.

use std::io::{self, ErrorKind};
use std::net::{TcpListener, ToSocketAddrs};
#[cfg(unix)]
use std::os::unix::net::{UnixListener, UnixStream};
#[cfg(unix)]
use std::path::PathBuf;
use std::time::Duration;

use photoncard_shared::link::Port;
use rustix::event::PollFlags;

use super::LinkError;
use super::listen_address::ListenAddress;
#[cfg(unix)]
use super::pty::Pty;
use super::remote_address::tcp_address;
use super::socket::tcp_port;
#[cfg(unix)]
use super::socket::unix_port;
use super::stream::wait_for;

/// Accepts connections of hosts to a card. Dropping the listener removes the file of a Unix socket.
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
    /// Starts to listen.
    ///
    /// # Errors
    /// If the address does not belong to this machine, or is in use.
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
            // A stale socket, whose process has ended, is replaced; any other file is not.
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

    /// Argument of `--card` by which a host reaches the card.
    pub fn card_address(&self) -> &str {
        &self.card_address
    }

    /// Returns whether other machines can reach the card.
    pub fn is_public(&self) -> bool {
        match &self.kind {
            Kind::Tcp(listener) => !listener.local_addr().is_ok_and(|address| address.ip().is_loopback()),
            #[cfg(unix)]
            Kind::Unix(..) | Kind::Pty(_) => false,
        }
    }

    /// Returns whether each host has a connection of its own.
    pub(super) fn is_socket(&self) -> bool {
        match &self.kind {
            Kind::Tcp(_) => true,
            #[cfg(unix)]
            Kind::Unix(..) => true,
            #[cfg(unix)]
            Kind::Pty(_) => false,
        }
    }

    /// Accepts the next host; `None` if none connects within `wait`, if it is gone already, or if the system
    /// lacks the resources.
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
                    // Opening a terminal causes no event.
                    std::thread::sleep(wait);
                    None
                }
            },
        }
    }

    /// Accepts a second host while one is served; `None` if there is none. A terminal has no second host,
    /// because hosts lock it.
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
            // The file may have been removed already.
            let _ = std::fs::remove_file(path);
        }
    }
}
