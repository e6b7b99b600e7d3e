//! Memory-mapped registers of devices.

/// Memory-mapped register of a device.
pub(crate) struct Register<T>(*mut T);

impl<T: Copy> Register<T> {
    /// Register at an address.
    ///
    /// # Safety
    /// The address must be a register of this width, whose reads and writes have no effect on memory that
    /// Rust uses.
    pub(crate) const unsafe fn at(address: usize) -> Self {
        Self(address as *mut T)
    }

    /// Reads the register.
    pub(crate) fn read(&self) -> T {
        // SAFETY: guaranteed by the caller of [`Self::at`].
        unsafe { self.0.read_volatile() }
    }

    /// Writes the register.
    pub(crate) fn write(&self, value: T) {
        // SAFETY: as above.
        unsafe { self.0.write_volatile(value) }
    }
}
