//! Links to cards on serial ports.

use std::io::{self, ErrorKind, Read, Write};
use std::path::Path;
use std::time::{Duration, Instant};

use photoncard_shared::frame::MAX_FRAME;
use photoncard_shared::link::{Port, PortError};
use serialport::{
    ClearBuffer, DataBits, FlowControl, Parity, SerialPort as _, SerialPortBuilder, SerialPortType, StopBits,
};

use super::LinkError;
use super::serial_options::{Line, SerialOptions};
use super::stream::moved;
#[cfg(windows)]
use serialport::COMPort as SystemPort;
#[cfg(unix)]
use serialport::TTYPort as SystemPort;

/// Duration of silence after which a line holds no stale bytes.
const QUIET: Duration = Duration::from_millis(50);
/// Time for which all bytes are dropped if the card does not fall silent. After that time, only the bytes up
/// to the next end of a frame are dropped.
const STALE: Duration = Duration::from_secs(1);
/// Inverse of the maximum relative error of the bit rate: 50 for 2 %. A UART character of ten bits tolerates
/// more.
const SPEED_TOLERANCE: u32 = 50;
/// Minimum timeout. Windows interprets 0 as infinite.
const MIN_WAIT: Duration = if cfg!(windows) { Duration::from_millis(1) } else { Duration::ZERO };

/// Link over a serial port or a pseudo terminal. The time of every call is bounded: by `poll` before a
/// non-blocking read or write; on Windows by the driver's timeouts, of at least a millisecond.
pub struct SerialLink {
    port: SystemPort,
}

/// Opens a serial port, or a pseudo terminal, for a new session: 8 bits, no parity, one stop bit, no flow
/// control. Sets DTR and RTS; a port without such lines is no error unless `options` states them. Stale
/// bytes of an earlier session are dropped. The port is locked against other photoncard processes.
///
/// # Errors
/// If the device does not exist, is no serial port, cannot be used, is in use, or does not support the speed
/// or a state of the lines.
pub fn open_serial(path: &Path, baud: u32, options: SerialOptions) -> Result<SerialLink, LinkError> {
    let address = format!("serial:{}", path.display());
    let mut link = open(path, baud).map_err(|error| LinkError::open(&address, &error))?;
    // A board may send as soon as DTR is raised: bytes from before are dropped by now.
    options
        .set_lines(|line, is_raised| link.set_line(line, is_raised))
        .map_err(|(option, error)| LinkError::modem_line(&address, option, &error))?;
    begin(&mut link).map_err(|_| LinkError::open(&address, &io::Error::other("the device failed")))?;
    Ok(link)
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
    Ok(SerialLink { port })
}

/// Opens a port, locks it for this process and sets `O_NONBLOCK`. `serialport` leaves the port blocking, so
/// that a write would wait as long as the line is full.
///
/// `serialport` takes a shared lock before it configures the port, and fails if another session has the
/// exclusive lock. Its exclusive mode, TIOCEXCL, is not used, because on a pseudo terminal it would outlive a
/// killed host and exclude the next one.
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

/// Opens a port. Windows always opens ports exclusively.
#[cfg(windows)]
fn open_alone(settings: SerialPortBuilder) -> io::Result<SystemPort> {
    settings.open_native().map_err(device_error)
}

/// Returns whether a path names a pseudo terminal of macOS. Such a terminal rejects any speed. `serialport`
/// sets no speed if it is given a speed of 0.
fn is_without_speed(path: &Path) -> bool {
    let is_terminal = |path: &Path| path.to_str().is_some_and(|name| name.starts_with("/dev/ttys"));
    cfg!(target_os = "macos") && path.canonicalize().is_ok_and(|path| is_terminal(&path))
}

/// Converts an error of `serialport` to the system's kind of error.
fn device_error(error: serialport::Error) -> io::Error {
    match error.kind() {
        // On Unix `NoDevice` always means a locked port; on Windows only its message distinguishes the
        // causes.
        serialport::ErrorKind::NoDevice if cfg!(unix) => ErrorKind::ResourceBusy.into(),
        serialport::ErrorKind::NoDevice => io::Error::other(error),
        _ => error.into(),
    }
}

/// Ends a frame that an earlier session may have left unfinished, and drops stale bytes. Returns once the
/// line is quiet or, if the card is busy, at the end of a frame.
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
    fn set_line(&mut self, line: Line, is_raised: bool) -> io::Result<()> {
        match line {
            Line::Dtr => self.port.write_data_terminal_ready(is_raised),
            Line::Rts => self.port.write_request_to_send(is_raised),
        }
        .map_err(io::Error::from)
    }

    /// Sets the timeout of the next read or write.
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

/// Converts the result of a read or write to the number of bytes moved; 0 after a timeout.
fn moved_in_time(result: io::Result<usize>) -> Result<usize, PortError> {
    match result {
        Err(error) if error.kind() == ErrorKind::TimedOut => Ok(0),
        result => moved(result),
    }
}

/// Serial port of this machine.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct ListedPort {
    /// Path of the port; its name on Windows.
    pub path: String,
    /// Manufacturer and product as a USB device reports them, arbitrary text; empty for other ports.
    pub usb_name: String,
    /// Serial number as a USB device reports it, arbitrary text; empty if there is none.
    pub serial_number: String,
}

/// Lists the serial ports of this machine by path, without pseudo terminals.
///
/// # Errors
/// If the system does not list them.
pub fn list_serial_ports() -> Result<Vec<ListedPort>, LinkError> {
    let mut ports = available().map_err(|error| LinkError::list(&error))?;
    ports.sort_by(|a, b| a.path.cmp(&b.path));
    Ok(ports)
}

fn available() -> io::Result<Vec<ListedPort>> {
    // `serialport` panics without /sys, which a container may lack.
    if cfg!(target_os = "linux") {
        std::fs::read_dir("/sys/class/tty")?;
    }
    Ok(serialport::available_ports()?.into_iter().map(listed).collect())
}

fn listed(port: serialport::SerialPortInfo) -> ListedPort {
    let path = port.port_name;
    match port.port_type {
        SerialPortType::UsbPort(usb) => {
            let names = [usb.manufacturer, usb.product].map(Option::unwrap_or_default);
            ListedPort {
                path,
                usb_name: names.join(" ").trim().to_owned(),
                serial_number: usb.serial_number.unwrap_or_default(),
            }
        }
        _ => ListedPort { path, ..ListedPort::default() },
    }
}

#[cfg(test)]
mod tests {
    use serialport::{SerialPortInfo, UsbPortInfo};

    use super::*;

    #[test]
    fn a_port_has_the_names_that_its_device_reports() {
        let usb = |manufacturer: Option<&str>, product: Option<&str>, serial_number: Option<&str>| {
            let [manufacturer, product, serial_number] =
                [manufacturer, product, serial_number].map(|text| text.map(str::to_owned));
            let info = UsbPortInfo { vid: 1, pid: 2, serial_number, manufacturer, product };
            listed(SerialPortInfo { port_name: "p".into(), port_type: SerialPortType::UsbPort(info) })
        };
        let port = |usb_name: &str, serial_number: &str| ListedPort {
            path: "p".into(),
            usb_name: usb_name.into(),
            serial_number: serial_number.into(),
        };
        assert_eq!(usb(Some("ST"), Some("STLINK-V3"), Some("06")), port("ST STLINK-V3", "06"));
        assert_eq!(usb(None, Some("STLINK-V3"), None), port("STLINK-V3", ""));
        assert_eq!(usb(Some("ST"), None, None), port("ST", ""));
        let other = SerialPortInfo { port_name: "p".into(), port_type: SerialPortType::Unknown };
        assert_eq!(listed(other), port("", ""));
    }
}
