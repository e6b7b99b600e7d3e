//! Photon gathers that wait, and the order in which they are done.
//!
//! The end of a gather ray becomes a [`GatherRequest`] of 24 bytes: position, partial reflection, target.
//! Requests can be executed in any order, because sums are in fixed point. In a spatially coherent order,
//! photons of one gather are still in the cache for the next (Steinhurst, Coombe, Lastra 2005, *Reordering
//! for cache conscious photon mapping*):
//!
//! - *generative* reordering casts the rays of one bin of directions
//!   ([`crate::importance::DirectionTable::bin`]) for all pixels of a tile before the rays of the next bin;
//! - *deferred* reordering ([`GatherQueue`]) queues requests, and executes them by a hash of their position
//!   or along a Hilbert curve;
//! - a second level of the queue, in card memory ([`Buckets`]), holds the gathers of many tiles.

mod buckets;
mod chain;
mod order;
mod queue;
mod request;

pub use buckets::{Buckets, MAX_BUCKET_LINE, RESULTS_PER_LINE, Results, WrittenResults};
pub use order::{HilbertCode, hilbert_cell, hilbert_index};
pub use queue::GatherQueue;
pub use request::{GatherRequest, GatherResult, GatherTarget, PointIndex, REQUEST_BYTES, RESULT_BYTES};
