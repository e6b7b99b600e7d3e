//! Links to cards on serial ports.

use std::fs::File;
use std::io::{self, ErrorKind};
use std::path::Path;
use std::time::{Duration, Instant};

use photoncard_shared::frame::MAX_FRAME;
use photoncard_shared::link::{Port, PortError};
use rustix::fd::OwnedFd;
use rustix::fs::{FlockOperation, Mode, OFlags};
use rustix::termios::{self, ControlModes, OptionalActions, QueueSelector};

use super::{LinkError, StreamPort};

/// A line without a byte for so long has nothing stale left.
const QUIET: Duration = Duration::from_millis(50);
/// What a busy card still says is listened to for so long.
const STALE: Duration = Duration::from_secs(1);
/// A speed may differ from the one asked for by one part in so many: a frame of ten bits tolerates more.
const SPEED_TOLERANCE: u32 = 50;

/// Opens a serial port, or a pseudo terminal, for a session that begins: 8 bits, no parity, one stop bit, no flow
/// control. What an earlier session left on the line is dropped. No other process can open it here meanwhile.
///
/// # Errors
/// If there is no such device, it is not a serial port, cannot be used, is in use or has no such speed.
pub fn open_serial(path: &Path, baud: u32) -> Result<StreamPort<File>, LinkError> {
    open(path, baud).map_err(|error| LinkError::open(format_args!("serial:{}", path.display()), &error))
}

fn open(path: &Path, baud: u32) -> io::Result<StreamPort<File>> {
    let flags = OFlags::RDWR | OFlags::NOCTTY | OFlags::NONBLOCK | OFlags::CLOEXEC;
    let device = rustix::fs::open(path, flags, Mode::empty())?;
    // Before anything else: another's session is not to be disturbed.
    rustix::fs::flock(&device, FlockOperation::NonBlockingLockExclusive)?;
    configure(&device, baud)?;
    termios::tcflush(&device, QueueSelector::IOFlush)?;
    let mut port = StreamPort::new(File::from(device));
    begin(&mut port).map_err(|_| io::Error::other("the device failed"))?;
    Ok(port)
}

/// Sets a terminal to raw bytes at a speed.
fn configure(device: &OwnedFd, baud: u32) -> io::Result<()> {
    let mut settings = termios::tcgetattr(device)?;
    settings.make_raw();
    settings.control_modes.remove(ControlModes::CSTOPB | ControlModes::PARENB | ControlModes::CRTSCTS);
    settings.control_modes.insert(ControlModes::CREAD | ControlModes::CLOCAL);
    settings.set_speed(baud)?;
    termios::tcsetattr(device, OptionalActions::Now, &settings)?;
    let speed = termios::tcgetattr(device)?.output_speed();
    let is_close = speed.abs_diff(baud) <= baud / SPEED_TOLERANCE;
    if is_close { Ok(()) } else { Err(ErrorKind::InvalidInput.into()) }
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
