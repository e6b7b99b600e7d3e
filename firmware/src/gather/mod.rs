//! Photon gathers that wait, and the order in which they are done.
//!
//! The end of a gather ray becomes a [`GatherRequest`] of 24 bytes: a place, a partially evaluated reflection and a
//! pixel. Requests may be done in any order, as the sum of a pixel does not depend on it. In an order that keeps
//! neighbours together, the photons of one gather are still in the cache for the next (Steinhurst, Coombe, Lastra 2005,
//! *Reordering for cache conscious photon mapping*):
//!
//! - *generative* reordering casts the rays of one bin of directions ([`crate::importance::DirectionTable::rays`]) for
//!   all pixels of a tile before those of the next;
//! - *deferred* reordering ([`GatherQueue`]) lets requests wait, and does them by a hash of their place or along a
//!   Hilbert curve.

mod order;
mod queue;
mod request;

pub use order::{Place, hilbert_cell, hilbert_index};
pub use queue::GatherQueue;
pub use request::GatherRequest;
