//! Directly addressed memory: a slice of lines, without copies or counts.

use core::hint::black_box;
use core::ops::Range;

use photoncard_shared::address::{LINE_BYTES, Line, LineAddress, Structure};
use photoncard_shared::message::Fault;

use super::{CardMemory, MemoryPort, copy_lines, outside};

/// DRAM that the processor addresses directly.
pub struct Dram<'a> {
    lines: Option<&'a mut [Line]>,
}

impl<'a> Dram<'a> {
    /// Memory that consists of `lines`. Lines past the first 2^32 are unused.
    pub const fn new(lines: &'a mut [Line]) -> Self {
        Self { lines: Some(lines) }
    }

    /// Memory without lines: that of a static card until its board gives it lines. Its bytes are zero.
    pub const EMPTY: Self = Self { lines: None };

    #[inline(always)]
    fn lines(&self) -> &[Line] {
        self.lines.as_deref().unwrap_or_default()
    }
}

impl MemoryPort for Dram<'_> {
    #[inline(always)]
    fn read(&mut self, _: Structure, address: LineAddress, _: Range<u32>) -> Result<&Line, Fault> {
        self.lines().get(address.0 as usize).ok_or_else(|| outside(address))
    }

    #[inline(always)]
    fn near(&self, address: LineAddress) -> Option<&Line> {
        self.lines().get(address.0 as usize)
    }

    fn write(&mut self, _: Structure, first: LineAddress, lines: &[[u8; LINE_BYTES]]) -> Option<()> {
        let first = first.0 as usize;
        copy_lines(lines, self.lines.as_deref_mut()?.get_mut(first..first.checked_add(lines.len())?)?);
        Some(())
    }
}

/// Read-only memory that several readers can share.
#[derive(Clone, Copy)]
pub struct Lines<'a>(pub &'a [Line]);

impl MemoryPort for Lines<'_> {
    #[inline(always)]
    fn read(&mut self, _: Structure, address: LineAddress, _: Range<u32>) -> Result<&Line, Fault> {
        self.0.get(address.0 as usize).ok_or_else(|| outside(address))
    }

    #[inline(always)]
    fn near(&self, address: LineAddress) -> Option<&Line> {
        self.0.get(address.0 as usize)
    }
}

impl CardMemory for Lines<'_> {
    fn lines(&self) -> u32 {
        u32::try_from(self.0.len()).unwrap_or(u32::MAX)
    }

    fn stored(&mut self, first: LineAddress, count: u32) -> Option<&[Line]> {
        let first = first.0 as usize;
        self.0.get(first..first.checked_add(count as usize)?)
    }
}

impl CardMemory for Dram<'_> {
    fn lines(&self) -> u32 {
        u32::try_from(self.lines().len()).unwrap_or(u32::MAX)
    }

    fn stored(&mut self, first: LineAddress, count: u32) -> Option<&[Line]> {
        let first = first.0 as usize;
        self.lines().get(first..first.checked_add(count as usize)?)
    }

    fn write_byte(&mut self, address: LineAddress, place: usize, byte: u8) -> Option<()> {
        // `black_box` hides the address from the compiler, which could otherwise merge this store with others
        // into the store of a word.
        *black_box(self.lines.as_deref_mut()?.get_mut(address.0 as usize)?.0.get_mut(place)?) = byte;
        Some(())
    }
}
