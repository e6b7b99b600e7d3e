//! Place for a value that is there or not.

/// Place for a value. Unlike those of `Option`, the bytes of an empty slot are zero in constants, so that a
/// static card is zeroed memory and takes no place in flash.
#[repr(u8)]
pub(crate) enum Slot<T> {
    Empty = 0,
    Full(T),
}

impl<T> Slot<T> {
    pub(crate) fn as_ref(&self) -> Option<&T> {
        match self {
            Self::Empty => None,
            Self::Full(value) => Some(value),
        }
    }

    /// Takes the value out, and leaves the slot empty.
    pub(crate) fn take(&mut self) -> Option<T> {
        match core::mem::replace(self, Self::Empty) {
            Self::Empty => None,
            Self::Full(value) => Some(value),
        }
    }
}
