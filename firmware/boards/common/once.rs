//! Statics whose value can be taken once, as a mutable reference.

use core::cell::UnsafeCell;
use core::sync::atomic::{AtomicBool, Ordering};

/// Value of a static that can be taken once, as a mutable reference.
pub(crate) struct Once<T> {
    taken: AtomicBool,
    value: UnsafeCell<T>,
}

// SAFETY: the value is accessible through `take` alone, which returns it once: it moves between threads, and
// is not shared.
unsafe impl<T: Send> Sync for Once<T> {}

impl<T> Once<T> {
    /// Creates a value that was not taken yet.
    pub(crate) const fn new(value: T) -> Self {
        Self { taken: AtomicBool::new(false), value: UnsafeCell::new(value) }
    }

    /// Takes the value; `None` if it was taken before.
    #[expect(clippy::mut_from_ref, reason = "it is the only reference: see below")]
    pub(crate) fn take(&'static self) -> Option<&'static mut T> {
        if self.taken.swap(true, Ordering::Acquire) {
            return None;
        }
        // SAFETY: this line is reached once, so this is the only reference.
        Some(unsafe { &mut *self.value.get() })
    }
}
