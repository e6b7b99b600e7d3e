//! Place for a value that is there or not.

/// Place for a value. The bytes of an empty slot are zero in constants, unlike those of an `Option` whose
/// empty state is a niche of the value, such as a Boolean's 2. A static card is zeroed memory, and takes no
/// place in flash.
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
