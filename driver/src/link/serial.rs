//! Links to cards on serial ports.

use std::io::{self, ErrorKind, Read, Write};
use std::path::Path;
use std::time::{Duration, Instant};

use photoncard_shared::frame::MAX_FRAME;
use photoncard_shared::link::{Port, PortError};
#[cfg(windows)]
use serialport::COMPort as SystemPort;
#[cfg(unix)]
use serialport::TTYPort as SystemPort;
use serialport::{ClearBuffer, DataBits, FlowControl, Parity, SerialPort as _, SerialPortBuilder, StopBits};

use super::LinkError;
use super::stream::moved;

/// A line without a byte for so long has nothing stale left.
const QUIET: Duration = Duration::from_millis(50);
/// What a busy card still says is listened to for so long.
const STALE: Duration = Duration::from_secs(1);
/// A speed may differ from the one asked for by one part in so many: a frame of ten bits tolerates more.
const SPEED_TOLERANCE: u32 = 50;
/// Windows takes a wait of zero for one without an end.
const MIN_WAIT: Duration = if cfg!(windows) { Duration::from_millis(1) } else { Duration::ZERO };

/// A link over a serial port or a pseudo terminal. Every call is bounded: by `poll` before a read or write that does not
/// block, on Windows by the driver's timeouts, of which the shortest is a millisecond.
pub struct SerialLink {
    port: SystemPort,
}

/// Opens a serial port, or a pseudo terminal, for a session that begins: 8 bits, no parity, one stop bit, no flow
/// control. What an earlier session left on the line is dropped. No other photoncard can open it meanwhile.
///
/// # Errors
/// If there is no such device, it is not a serial port, cannot be used, is in use or has no such speed.
pub fn open_serial(path: &Path, baud: u32) -> Result<SerialLink, LinkError> {
    open(path, baud).map_err(|error| LinkError::open(format_args!("serial:{}", path.display()), &error))
}

fn open(path: &Path, baud: u32) -> io::Result<SerialLink> {
    let name = path.to_str().ok_or_else(|| io::Error::other("its name is no Unicode text"))?;
    let speed = if is_without_speed(path) { 0 } else { baud };
    let port = open_alone(
        serialport::new(name, speed)
            .data_bits(DataBits::Eight)
            .parity(Parity::None)
            .stop_bits(StopBits::One)
            .flow_control(FlowControl::None),
    )?;
    let is_close = port.baud_rate().map_err(device_error)?.abs_diff(speed) <= speed / SPEED_TOLERANCE;
    if !is_close {
        return Err(ErrorKind::InvalidInput.into());
    }
    port.clear(ClearBuffer::All).map_err(device_error)?;
    let mut link = SerialLink { port };
    begin(&mut link).map_err(|_| io::Error::other("the device failed"))?;
    Ok(link)
}

/// Opens a port and locks it for this process. Reads and writes of it end at once: `serialport` opens it so that a write waits
/// for as long as the line is full.
///
/// Its own lock is a shared one, taken before anything is set: it fails where another session has the exclusive one. Its
/// exclusive mode, TIOCEXCL, is left out: on a pseudo terminal it would outlive a host that is killed, and refuse the next.
#[cfg(unix)]
fn open_alone(settings: SerialPortBuilder) -> io::Result<SystemPort> {
    use std::os::fd::AsRawFd;

    use nix::fcntl::{FcntlArg, FlockArg, OFlag, fcntl, flock};

    let port = settings.exclusive(false).open_native().map_err(device_error)?;
    let descriptor = port.as_raw_fd();
    flock(descriptor, FlockArg::LockExclusiveNonblock)?;
    let flags = OFlag::from_bits_truncate(fcntl(descriptor, FcntlArg::F_GETFL)?);
    fcntl(descriptor, FcntlArg::F_SETFL(flags | OFlag::O_NONBLOCK))?;
    Ok(port)
}

/// Opens a port, which Windows does for one process alone.
#[cfg(windows)]
fn open_alone(settings: SerialPortBuilder) -> io::Result<SystemPort> {
    settings.open_native().map_err(device_error)
}

/// Whether a path names a pseudo terminal of macOS, which refuses any speed; `serialport` sets none if it is 0.
fn is_without_speed(path: &Path) -> bool {
    let is_terminal = |path: &Path| path.to_str().is_some_and(|name| name.starts_with("/dev/ttys"));
    cfg!(target_os = "macos") && path.canonicalize().is_ok_and(|path| is_terminal(&path))
}

/// What `serialport` has found, as the system would say it.
fn device_error(error: serialport::Error) -> io::Error {
    match error.kind() {
        // On Unix alone it means a port that is locked; on Windows its words tell which.
        serialport::ErrorKind::NoDevice if cfg!(unix) => ErrorKind::ResourceBusy.into(),
        serialport::ErrorKind::NoDevice => io::Error::other(error),
        _ => error.into(),
    }
}

/// Ends a frame that an earlier session has left half sent, and drops what the card still says of it: up to a quiet
/// line, or from a busy card up to the end of a frame.
fn begin(port: &mut impl Port) -> Result<(), PortError> {
    port.write(&[0], QUIET)?;
    let start = Instant::now();
    let mut buffer = [0; 512];
    while start.elapsed() < STALE {
        if port.read(&mut buffer, QUIET)? == 0 {
            return Ok(());
        }
    }
    for _ in 0..MAX_FRAME {
        let mut byte = [0];
        port.read(&mut byte, QUIET)?;
        if byte == [0] {
            break;
        }
    }
    Ok(())
}

impl SerialLink {
    /// Bounds the next read or write.
    fn limit(&mut self, wait: Duration) -> Result<(), PortError> {
        let wait = wait.max(MIN_WAIT);
        // On Windows each change is a call of the driver.
        if self.port.timeout() == wait {
            return Ok(());
        }
        self.port.set_timeout(wait).or_else(|error| moved(Err(error.into())).map(drop))
    }
}

impl Port for SerialLink {
    fn read(&mut self, buffer: &mut [u8], wait: Duration) -> Result<usize, PortError> {
        if wait < MIN_WAIT && self.port.bytes_to_read().is_ok_and(|count| count == 0) {
            return Ok(0);
        }
        self.limit(wait)?;
        match self.port.read(buffer) {
            Ok(0) if !buffer.is_empty() => Err(PortError::Closed),
            result => moved_in_time(result),
        }
    }

    fn write(&mut self, bytes: &[u8], wait: Duration) -> Result<usize, PortError> {
        self.limit(wait)?;
        moved_in_time(self.port.write(bytes))
    }
}

/// The bytes that have moved; none if the time was over before.
fn moved_in_time(result: io::Result<usize>) -> Result<usize, PortError> {
    match result {
        Err(error) if error.kind() == ErrorKind::TimedOut => Ok(0),
        result => moved(result),
    }
}
