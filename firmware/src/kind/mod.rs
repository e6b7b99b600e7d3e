//! Kinds of chip. A kind is a [`Budget`](photoncard_shared::budget::Budget) and the capacities of the buffers
//! that follow from it.
//!
//! Each file here is a kind: the constant of its budget, the limits of its techniques, and an implementation
//! of [`ChipKind`] for an uninhabited type. This type is the only capacity parameter of
//! [`Chip`](crate::chip::Chip) and [`Card`](crate::card::Card).

mod capacity;
mod chip_kind;
mod large;
mod micro;
mod reference;

pub use capacity::{Array, Buffer, Capacity, Entries, Map, Vacant};
pub(crate) use chip_kind::check;
pub use chip_kind::{ChipKind, TechniqueMemory, cache_bytes, tag_bytes};
pub use large::{LARGE, Large};
pub use micro::{MICRO, Micro};
pub use reference::{REFERENCE, Reference, ReferenceCandidates};
