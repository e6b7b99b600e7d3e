//! Port on a stream of the system: a socket, or the card's end of a pseudo terminal.

use std::io::{self, ErrorKind, Read, Write};
use std::time::Duration;

use photoncard_shared::link::{Port, PortError};
use rustix::event::{PollFd, PollFlags, Timespec, poll};
use rustix::fd::AsFd;

/// Port on a non-blocking stream; `poll` bounds the wait of every call.
pub struct StreamPort<S> {
    stream: S,
}

impl<S: Read + Write + AsFd> StreamPort<S> {
    /// Creates a port on a stream, which must be non-blocking.
    pub(super) fn new(stream: S) -> Self {
        Self { stream }
    }

    fn try_read(&mut self, buffer: &mut [u8]) -> Result<usize, PortError> {
        match self.stream.read(buffer) {
            Ok(0) if !buffer.is_empty() => Err(PortError::Closed),
            result => moved(result),
        }
    }

    fn try_write(&mut self, bytes: &[u8]) -> Result<usize, PortError> {
        moved(self.stream.write(bytes))
    }
}

impl<S: Read + Write + AsFd> Port for StreamPort<S> {
    fn read(&mut self, buffer: &mut [u8], wait: Duration) -> Result<usize, PortError> {
        match self.try_read(buffer)? {
            0 if !wait.is_zero() => {
                wait_for(&self.stream, PollFlags::IN, wait);
                self.try_read(buffer)
            }
            count => Ok(count),
        }
    }

    fn write(&mut self, bytes: &[u8], wait: Duration) -> Result<usize, PortError> {
        match self.try_write(bytes)? {
            0 if !bytes.is_empty() => {
                // A terminal that no host has open accepts no bytes and reports no error.
                if wait_for(&self.stream, PollFlags::OUT, wait).contains(PollFlags::HUP) {
                    return Err(PortError::Closed);
                }
                self.try_write(bytes)
            }
            count => Ok(count),
        }
    }
}

/// Waits until one of `events` occurs on a stream, at most `wait`. Returns the events that occurred.
pub(super) fn wait_for(stream: &impl AsFd, events: PollFlags, wait: Duration) -> PollFlags {
    let mut streams = [PollFd::new(stream, events)];
    // A signal ends the wait early. A time beyond the system's maximum means no limit.
    let timeout = Timespec::try_from(wait).ok();
    let _ = poll(&mut streams, timeout.as_ref());
    streams[0].revents()
}

/// Converts the result of a read or write to the number of bytes moved; 0 if the stream would block.
pub(super) fn moved(result: io::Result<usize>) -> Result<usize, PortError> {
    result.or_else(|error| match error.kind() {
        ErrorKind::WouldBlock | ErrorKind::Interrupted => Ok(0),
        ErrorKind::ConnectionReset
        | ErrorKind::ConnectionAborted
        | ErrorKind::BrokenPipe
        | ErrorKind::NotConnected
        | ErrorKind::TimedOut => Err(PortError::Closed),
        // A terminal whose other end is closed; a serial adapter that was unplugged.
        _ if is_gone(&error) => Err(PortError::Closed),
        _ => Err(PortError::Device(error.raw_os_error().unwrap_or(0).unsigned_abs())),
    })
}

/// Returns whether the error of a terminal means that its device is gone.
#[cfg(unix)]
fn is_gone(error: &io::Error) -> bool {
    use rustix::io::Errno;
    Errno::from_io_error(error).is_some_and(|errno| [Errno::IO, Errno::NODEV, Errno::NXIO].contains(&errno))
}

/// Returns false. Sockets, the only streams on other systems, report a closed connection by the kind of the
/// error.
#[cfg(not(unix))]
fn is_gone(_: &io::Error) -> bool {
    false
}
