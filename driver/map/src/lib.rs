//! Creates card images: everything that a host computes from a scene once, before any tile is rendered.
//!
//! A [`PackedScene`](pack::PackedScene) has the sections of the scene.
//! [`map_photons`](photon_map::map_photons) traces photons in it and adds the sections of the photon map. The
//! result is a [`CardImage`](pack::CardImage). Photons are traced by the chip's ray caster, in the packed
//! lines, and lie on exactly the surfaces that gather rays hit.
//!
//! - [`bvh`], `fold`, `light`: bounding volume hierarchy; folding of binary trees into wide nodes; light tree
//!   and environment.
//! - [`pack`]: the scene's sections of the card image.
//! - [`photon`], `density`, [`photon_map`]: photon pass; area corrections of the density estimate; the photon
//!   map's sections.
//!
//! These modules are one crate because inlining across them saves a third of the photon pass's time.
#![forbid(unsafe_code)]

pub mod bvh;
mod density;
mod detail;
mod fold;
mod light;
pub mod pack;
pub mod photon;
pub mod photon_map;
