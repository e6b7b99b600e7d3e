//! A port on a device with the traits of `embedded-io`.

use core::time::Duration;

use embedded_io::{ErrorType, Read, ReadReady, Write, WriteReady};

use super::{Port, PortError};

/// Port on a device that implements the traits of `embedded-io` 0.7, such as a UART of a hardware abstraction
/// layer. It never waits: a call without bytes, or without room, returns at once.
#[derive(Debug)]
pub struct IoPort<T: ErrorType> {
    device: T,
    error: Option<T::Error>,
}

impl<T: ErrorType> IoPort<T> {
    /// Port on a device.
    pub const fn new(device: T) -> Self {
        Self { device, error: None }
    }

    /// Device of the port.
    pub fn device(&mut self) -> &mut T {
        &mut self.device
    }

    /// Error of the device behind the last [`PortError::Device`].
    pub fn error(&self) -> Option<&T::Error> {
        self.error.as_ref()
    }

    fn failed(&mut self, error: T::Error) -> PortError {
        self.error = Some(error);
        PortError::Device(0)
    }
}

impl<T: Read + Write + ReadReady + WriteReady> Port for IoPort<T> {
    fn read(&mut self, buffer: &mut [u8], _: Duration) -> Result<usize, PortError> {
        match self.device.read_ready() {
            Ok(true) if !buffer.is_empty() => {}
            Ok(_) => return Ok(0),
            Err(error) => return Err(self.failed(error)),
        }
        match self.device.read(buffer) {
            Ok(0) => Err(PortError::Closed),
            Ok(count) => Ok(count),
            Err(error) => Err(self.failed(error)),
        }
    }

    fn write(&mut self, bytes: &[u8], _: Duration) -> Result<usize, PortError> {
        match self.device.write_ready() {
            Ok(true) if !bytes.is_empty() => {}
            Ok(_) => return Ok(0),
            Err(error) => return Err(self.failed(error)),
        }
        match self.device.write(bytes) {
            Ok(0) => Err(PortError::Closed),
            Ok(count) => Ok(count),
            Err(error) => Err(self.failed(error)),
        }
    }
}

#[cfg(test)]
mod tests {
    extern crate std;

    use std::collections::VecDeque;
    use std::vec::Vec;

    use embedded_io::ErrorKind;

    use super::*;

    /// Device with received bytes, of which a read takes one, and room for `room` bytes. `None` as received
    /// byte is the end of the link.
    struct Device {
        received: VecDeque<Option<u8>>,
        sent: Vec<u8>,
        room: usize,
        is_broken: bool,
    }

    impl ErrorType for Device {
        type Error = ErrorKind;
    }

    impl ReadReady for Device {
        fn read_ready(&mut self) -> Result<bool, ErrorKind> {
            if self.is_broken { Err(ErrorKind::Other) } else { Ok(!self.received.is_empty()) }
        }
    }

    impl WriteReady for Device {
        fn write_ready(&mut self) -> Result<bool, ErrorKind> {
            if self.is_broken { Err(ErrorKind::Other) } else { Ok(self.room > 0) }
        }
    }

    impl Read for Device {
        fn read(&mut self, buffer: &mut [u8]) -> Result<usize, ErrorKind> {
            let byte = self.received.pop_front().expect("a read would wait");
            Ok(byte.map_or(0, |byte| {
                buffer[0] = byte;
                1
            }))
        }
    }

    impl Write for Device {
        fn write(&mut self, bytes: &[u8]) -> Result<usize, ErrorKind> {
            assert!(self.room > 0, "a write would wait");
            let count = bytes.len().min(self.room);
            self.sent.extend(&bytes[..count]);
            self.room -= count;
            Ok(count)
        }

        fn flush(&mut self) -> Result<(), ErrorKind> {
            Ok(())
        }
    }

    const WAIT: Duration = Duration::from_secs(1);

    fn port(received: &[Option<u8>], room: usize) -> IoPort<Device> {
        let received = received.iter().copied().collect();
        IoPort::new(Device { received, sent: Vec::new(), room, is_broken: false })
    }

    #[test]
    fn a_port_moves_what_its_device_has_and_never_waits() {
        let mut port = port(&[Some(3), Some(4)], 2);
        let mut buffer = [0; 8];
        assert_eq!(port.read(&mut buffer, WAIT), Ok(1));
        assert_eq!(port.read(&mut buffer[1..], WAIT), Ok(1));
        assert_eq!(port.read(&mut buffer, WAIT), Ok(0));
        assert_eq!(buffer[..2], [3, 4]);
        assert_eq!(port.write(&[1, 2, 3], WAIT), Ok(2));
        assert_eq!(port.write(&[3], WAIT), Ok(0));
        assert_eq!(port.device().sent, [1, 2]);
    }

    #[test]
    fn nothing_is_moved_for_nothing() {
        let mut port = port(&[Some(3)], 2);
        assert_eq!((port.read(&mut [], WAIT), port.write(&[], WAIT)), (Ok(0), Ok(0)));
        assert_eq!(port.read(&mut [0], WAIT), Ok(1));
    }

    #[test]
    fn the_end_of_a_link_and_a_failure_of_its_device_differ() {
        let mut port = port(&[None], 2);
        assert_eq!(port.read(&mut [0], WAIT), Err(PortError::Closed));
        assert_eq!(port.error(), None);
        port.device().is_broken = true;
        assert_eq!(port.write(&[0], WAIT), Err(PortError::Device(0)));
        assert_eq!(port.error(), Some(&ErrorKind::Other));
    }
}
