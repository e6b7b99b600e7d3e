//! Registers of devices.

/// A register of a device.
pub(crate) struct Register<T>(*mut T);

impl<T: Copy> Register<T> {
    /// The register at an address.
    ///
    /// # Safety
    /// There is a register of this width, and what is read from or written to it has no effect on memory that Rust uses.
    pub(crate) const unsafe fn at(address: usize) -> Self {
        Self(address as *mut T)
    }

    /// Reads it.
    pub(crate) fn read(&self) -> T {
        // SAFETY: whoever made it promised that there is one.
        unsafe { self.0.read_volatile() }
    }

    /// Writes it.
    pub(crate) fn write(&self, value: T) {
        // SAFETY: as above.
        unsafe { self.0.write_volatile(value) }
    }
}
