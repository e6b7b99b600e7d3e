//! Lock-free ring buffer of bytes with one producer (an interrupt handler) and one consumer (the program).

use core::sync::atomic::{AtomicU8, AtomicUsize, Ordering};

/// Ring of `N` bytes between an interrupt handler, which alone puts them, and the program, which alone takes
/// them. `N` is a power of two.
pub struct Ring<const N: usize> {
    bytes: [AtomicU8; N],
    /// Number of bytes put so far, modulo the range of `usize`.
    put: AtomicUsize,
    /// Number of bytes taken so far, modulo the range of `usize`.
    taken: AtomicUsize,
}

impl<const N: usize> Default for Ring<N> {
    fn default() -> Self {
        Self::new()
    }
}

impl<const N: usize> Ring<N> {
    const IS_POWER_OF_TWO: () = assert!(N.is_power_of_two());

    /// Creates an empty ring, as the initial value of a static.
    pub const fn new() -> Self {
        let () = Self::IS_POWER_OF_TWO;
        Self { bytes: [const { AtomicU8::new(0) }; N], put: AtomicUsize::new(0), taken: AtomicUsize::new(0) }
    }

    /// Returns true if the ring holds no byte.
    pub fn is_empty(&self) -> bool {
        self.put.load(Ordering::Acquire) == self.taken.load(Ordering::Relaxed)
    }

    /// Returns true if the ring has no room for a byte.
    pub fn is_full(&self) -> bool {
        self.put.load(Ordering::Relaxed).wrapping_sub(self.taken.load(Ordering::Acquire)) >= N
    }

    /// Puts a byte. Returns false if the ring is full.
    pub fn put(&self, byte: u8) -> bool {
        let put = self.put.load(Ordering::Relaxed);
        let Some(place) = self.bytes.get(put % N).filter(|_| !self.is_full()) else { return false };
        place.store(byte, Ordering::Relaxed);
        self.put.store(put.wrapping_add(1), Ordering::Release);
        true
    }

    /// Takes the oldest byte; `None` if the ring is empty.
    pub fn take(&self) -> Option<u8> {
        let taken = self.taken.load(Ordering::Relaxed);
        let byte = self.bytes.get(taken % N).filter(|_| !self.is_empty())?.load(Ordering::Relaxed);
        self.taken.store(taken.wrapping_add(1), Ordering::Release);
        Some(byte)
    }
}
