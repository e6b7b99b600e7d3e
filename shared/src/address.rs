//! Addresses in a card's memory: 128-byte lines, the dissertation's cache line (chapter 7).

/// Bytes of one line.
pub const LINE_BYTES: usize = 128;

/// One line of card memory, aligned to itself.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(C, align(128))]
pub struct Line(pub [u8; LINE_BYTES]);

impl Line {
    /// A line of zero bytes.
    pub const ZERO: Self = Self([0; LINE_BYTES]);

    /// The `slot`-th record of `N` bytes, records packed from the start of the line; `None` past the last whole one.
    #[inline(always)]
    pub fn record<const N: usize>(&self, slot: usize) -> Option<&[u8; N]> {
        self.0.as_chunks::<N>().0.get(slot)
    }

    /// The `slot`-th record of `N` bytes, to be written.
    pub fn record_mut<const N: usize>(&mut self, slot: usize) -> Option<&mut [u8; N]> {
        self.0.as_chunks_mut::<N>().0.get_mut(slot)
    }
}

/// The number of a line, counted from the start of card memory.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct LineAddress(pub u32);

/// Who asks for a line: memory traffic is counted, and cached, by structure.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Structure {
    /// The photon kd-tree.
    PhotonMap,
    /// Bounding volume hierarchy, triangles, materials and emitters.
    Scene,
}
