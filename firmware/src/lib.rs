//! The photon mapping renderer of one rendering chip.
//!
//! No allocator, no I/O, every buffer sized at compile time by [`photoncard_shared::budget`]. From the memory to the
//! wire:
//!
//! | module | what |
//! |---|---|
//! | [`memory`] | 128-byte lines of card DRAM |
//! | [`scene`] | bounding volume hierarchy, triangles, materials, emitters, read from those lines |
//! | [`photon`] | the k nearest photons and the radiance they reflect; the nearest of precomputed irradiance |
//! | [`sampler`] | stratified random numbers from (pixel, sample, dimension) |
//! | [`gather`] | photon gathers that wait, and in which order they are done |
//! | [`importance`] | which way a final gather ray goes |
//! | [`irradiance_cache`] | indirect irradiance, gathered at few places and interpolated between them |
//! | [`render`] | eye rays, direct light, final gather: the stages of a tile |
//! | [`chip`] | owns the tile's state; one method a stage |
//! | [`card`] | commands in, replies out |
//! | [`serve`] | a card on a port |
//!
//! # Where each path of light is counted
//!
//! With E the eye, L a light, D and S a diffuse and a Phong reflection, at the point that the eye ray meets:
//!
//! - `LE`, light seen directly: the emission of the point itself.
//! - `L(D|S)E`, direct light: shadow rays to points on emitters, and final gather rays that meet an emitter, each
//!   weighted so that together they count it once ([`render::direct`]).
//! - `L(D|S)+(D|S)E`, indirect light: final gather rays alone ([`render::final_gather`]). Where a ray ends, the photon
//!   map gives all the light reflected there, first arrivals from lights included, as no shadow ray is cast from there.
//!
//! # Exactness
//!
//! Random numbers depend on (pixel, sample, dimension) alone. Sums over photons and over gather rays are made in fixed
//! point ([`fixed_point`]), so their order does not matter. Nothing depends on the processor: `f32` operations, `libm`
//! and integer arithmetic, never a fused multiply-add.
// But for the instructions that `simd` chooses.
#![deny(unsafe_code)]
#![no_std]
// A chip never panics: what could is kept out, or its reason given.
#![cfg_attr(
    not(test),
    warn(
        clippy::indexing_slicing,
        clippy::unwrap_used,
        clippy::expect_used,
        clippy::panic,
        clippy::unreachable
    )
)]

#[cfg(test)]
extern crate std;

pub mod card;
pub mod chip;
pub mod fixed_point;
pub mod gather;
pub mod importance;
pub mod irradiance_cache;
pub mod memory;
pub mod photon;
pub mod render;
pub mod sampler;
pub mod scene;
pub mod serve;
pub mod simd;
mod vector;
mod wide_tree;
