//! Kinds of chip: a [`Budget`](photoncard_shared::budget::Budget), and the capacities of the buffers that
//! follow from it.
//!
//! A kind is one file here: the constant of its budget, the limits of its techniques, and an implementation
//! of [`ChipKind`] on a type without values. [`Chip`](crate::chip::Chip) and [`Card`](crate::card::Card) have
//! that type as their one parameter for all buffers.

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
