//! Memory that the processor does not address: PSRAM behind an SPI port, or an SD card.

use core::ops::Range;

use photoncard_shared::address::{LINE_BYTES, Line, LineAddress, Structure};
use photoncard_shared::message::{Fault, FaultCode};

use super::{CardMemory, MemoryPort, outside};

/// Device that stores lines. Its calls block, also in an executor.
pub trait LineDevice {
    /// Failure of the device. Its host reads a [`FaultCode::Memory`].
    type Error;

    /// Number of lines.
    fn lines(&self) -> u32;

    /// Reads consecutive lines, from line `first` on.
    ///
    /// # Errors
    /// If the device fails.
    fn read(&mut self, first: u32, lines: &mut [Line]) -> Result<(), Self::Error>;

    /// Writes consecutive lines, from line `first` on.
    ///
    /// # Errors
    /// If the device fails.
    fn write(&mut self, first: u32, lines: &[[u8; LINE_BYTES]]) -> Result<(), Self::Error>;
}

/// Card memory on a [`LineDevice`], read through a buffer of `N` lines, which is filled from a multiple of
/// `N`. A sector of an SD card has four lines. [`LineCaches`](super::LineCaches) around it keep more lines.
/// The memory test writes each byte of its pattern of byte lanes as a whole line.
pub struct Unmapped<D, const N: usize> {
    device: D,
    buffer: [Line; N],
    /// Lines that the buffer holds.
    held: Range<u32>,
    failed: Option<u32>,
}

impl<D: LineDevice, const N: usize> Unmapped<D, N> {
    /// Memory on a device.
    pub const fn new(device: D) -> Self {
        const { assert!(N > 0, "a buffer has a line") };
        Self { device, buffer: [Line::ZERO; N], held: 0..0, failed: None }
    }

    /// The device.
    pub fn device(&mut self) -> &mut D {
        &mut self.device
    }

    /// Fills the buffer so that it holds the line at `address`, which exists.
    fn hold(&mut self, address: u32) -> Result<(), Fault> {
        if self.held.contains(&address) {
            return Ok(());
        }
        let first = address - address % N as u32;
        let end = first.saturating_add(N as u32).min(self.device.lines());
        self.held = 0..0;
        let buffer = self.buffer.get_mut(..(end - first) as usize).unwrap_or_default();
        self.device.read(first, buffer).map_err(|_| {
            self.failed = Some(address);
            failure(address)
        })?;
        self.held = first..end;
        Ok(())
    }

    /// Line at `address`, if the buffer holds it.
    fn buffered(&self, address: u32, count: u32) -> Option<&[Line]> {
        let first = address.checked_sub(self.held.start)? as usize;
        let count = count.min(self.held.end.checked_sub(address)?) as usize;
        self.buffer.get(first..first + count)
    }

    fn has(&self, first: u32, count: usize) -> bool {
        (first as usize).checked_add(count).is_some_and(|end| end <= self.device.lines() as usize)
    }
}

fn failure(line: u32) -> Fault {
    Fault { code: FaultCode::Memory, detail: line }
}

impl<D: LineDevice, const N: usize> MemoryPort for Unmapped<D, N> {
    fn read(&mut self, _: Structure, address: LineAddress, _: Range<u32>) -> Result<&Line, Fault> {
        if !self.has(address.0, 1) {
            return Err(outside(address));
        }
        self.hold(address.0)?;
        self.buffered(address.0, 1).and_then(<[Line]>::first).ok_or_else(|| outside(address))
    }

    fn write(&mut self, _: Structure, first: LineAddress, lines: &[[u8; LINE_BYTES]]) -> Option<()> {
        self.failed = None;
        if !self.has(first.0, lines.len()) {
            return None;
        }
        self.held = 0..0;
        self.device.write(first.0, lines).map_err(|_| self.failed = Some(first.0)).ok()
    }
}

impl<D: LineDevice, const N: usize> CardMemory for Unmapped<D, N> {
    fn lines(&self) -> u32 {
        self.device.lines()
    }

    fn stored(&mut self, first: LineAddress, count: u32) -> Option<&[Line]> {
        self.failed = None;
        if !self.has(first.0, count as usize) || count == 0 {
            return None;
        }
        self.hold(first.0).ok()?;
        self.buffered(first.0, count)
    }

    fn failure(&self) -> Option<Fault> {
        self.failed.map(failure)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::memory::{CacheEntry, CacheShape, LineCache, LineCaches, SetIndex};

    /// Device of 64 lines that hold their index. Reads of line `broken` fail.
    struct Device {
        broken: u32,
    }

    impl LineDevice for Device {
        type Error = ();

        fn lines(&self) -> u32 {
            64
        }

        fn read(&mut self, first: u32, lines: &mut [Line]) -> Result<(), ()> {
            for (address, line) in (first..).zip(lines) {
                if address == self.broken {
                    return Err(());
                }
                *line = Line([address as u8; LINE_BYTES]);
            }
            Ok(())
        }

        fn write(&mut self, _: u32, _: &[[u8; LINE_BYTES]]) -> Result<(), ()> {
            Err(())
        }
    }

    fn read(memory: &mut impl MemoryPort, address: u32) -> Result<u8, Fault> {
        memory.read(Structure::Nodes, LineAddress(address), 0..4).map(|line| line.0[0])
    }

    #[test]
    fn a_buffer_of_any_size_gives_each_line_and_refuses_those_outside() {
        fn check<const N: usize>() {
            let mut memory = Unmapped::<_, N>::new(Device { broken: u32::MAX });
            for address in [0, 63, 5, 6, 62, 7, 63] {
                assert_eq!(read(&mut memory, address), Ok(address as u8), "{N}");
            }
            assert_eq!(read(&mut memory, 64), Err(outside(LineAddress(64))));
            assert!(memory.stored(LineAddress(60), 5).is_none() && memory.failure().is_none());
            let lines = memory.stored(LineAddress(60), 4).map(|lines| lines[0]);
            assert_eq!(lines, Some(Line([60; LINE_BYTES])));
        }
        check::<1>();
        check::<4>();
        check::<7>();
        check::<100>();
    }

    #[test]
    fn a_failure_of_the_device_behind_a_cache_is_no_end_of_the_memory() {
        let shape = CacheShape::new(1024, 512, 2, SetIndex::Modulo).unwrap();
        let cache = LineCache::new(shape, [CacheEntry::EMPTY; 2], [Line::ZERO; 8]).unwrap();
        let mut memory = LineCaches::unified(Unmapped::<_, 1>::new(Device { broken: 10 }), cache);
        assert_eq!(read(&mut memory, 20), Ok(20));
        for address in [8, 10] {
            assert_eq!(read(&mut memory, address), Err(failure(10)));
        }
        assert_eq!((read(&mut memory, 20), read(&mut memory, 63)), (Ok(20), Ok(63)));
    }

    #[test]
    fn a_write_that_fails_names_its_first_line() {
        let mut memory = Unmapped::<_, 4>::new(Device { broken: u32::MAX });
        assert_eq!(memory.write(Structure::Header, LineAddress(9), &[[0; LINE_BYTES]; 2]), None);
        assert_eq!(memory.failure(), Some(failure(9)));
        assert_eq!(memory.write(Structure::Header, LineAddress(63), &[[0; LINE_BYTES]; 2]), None);
        assert_eq!(memory.failure(), None);
    }
}
