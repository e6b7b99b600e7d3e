//! Kinds of chip. A kind is a [`Budget`](photoncard_shared::budget::Budget) and the buffer capacities that
//! follow from the budget.
//!
//! Each of the files `large`, `micro` and `reference` defines a kind: its budget, the memory limits of its
//! techniques, and implementations of [`ChipKind`] and [`FixedKind`]. The kind is the only capacity parameter
//! of [`Chip`](crate::chip::Chip) and [`Card`](crate::card::Card). An emulator adds one kind whose capacities
//! are runtime values. One compiled copy of the chip's code then emulates all kinds.

mod capacity;
mod chip_kind;
mod large;
mod micro;
mod nano;
mod reference;

pub use crate::irradiance_cache::MIN_RECORDS;
pub use capacity::{Array, Buffer, Capacity, Entries, FixedCapacity, Map, Vacant};
pub(crate) use chip_kind::check;
pub use chip_kind::{ChipKind, FixedKind, TechniqueMemory, cache_bytes, tag_bytes};
pub use large::{LARGE, Large};
pub use micro::{MICRO, Micro};
pub use nano::{NANO, Nano};
pub use reference::{REFERENCE, Reference, ReferenceCandidates};
