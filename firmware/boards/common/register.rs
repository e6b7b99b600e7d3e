//! Memory-mapped registers of devices.

pub(crate) struct Register<T>(*mut T);

impl<T: Copy> Register<T> {
    /// Register at `address`.
    ///
    /// # Safety
    /// `address` must be that of a register of this width. Reads and writes of it must not affect memory that
    /// Rust uses.
    pub(crate) const unsafe fn at(address: usize) -> Self {
        Self(address as *mut T)
    }

    pub(crate) fn read(&self) -> T {
        // SAFETY: guaranteed by the caller of [`Self::at`].
        unsafe { self.0.read_volatile() }
    }

    pub(crate) fn write(&self, value: T) {
        // SAFETY: as above.
        unsafe { self.0.write_volatile(value) }
    }
}
